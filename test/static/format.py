"""The C files are as .clang-format says, all text files as .editorconfig says. Environment: CLANG_FORMAT (the tool to use)."""

import configparser
import os
import re
import subprocess
import sys
from fnmatch import fnmatch
from pathlib import Path

C_FILES = ("firmware/**/*.[ch]", "include/**/*.[ch]", "examples/**/*.[ch]")  # tools/ and test/ are full of tables
MADE = ("*/vectors/*", "*.xlsx", "*.png", "firmware.X/*")  # written by programs


def c_files() -> list[str]:
    return sorted(str(path) for pattern in C_FILES for path in Path().glob(pattern))


def clang_format(*arguments: str) -> str:
    """What clang-format prints, or one line if it cannot run."""
    tool = os.environ.get("CLANG_FORMAT", "clang-format-14")
    try:
        return subprocess.run([tool, *arguments, *c_files()], capture_output=True, text=True, check=False).stderr
    except OSError as error:
        sys.exit(f"foc33: {tool}, format: cannot be run ({error.strerror}); make static installs it")


def wanted(rules: configparser.ConfigParser, path: str) -> dict[str, str]:
    """The properties that .editorconfig gives a file; later sections win."""
    found: dict[str, str] = {}
    for section in rules.sections():
        head, _, rest = section.partition("{")
        names, _, tail = rest.partition("}")
        if any(fnmatch(Path(path).name, head + name + tail) for name in names.split(",")):
            found |= rules[section]
    return found


def problems(path: str, rule: dict[str, str]) -> list[str]:
    data = Path(path).read_bytes()
    try:
        text = data.decode(rule["charset"])
    except UnicodeDecodeError as error:
        return [f"{path}: no {rule['charset']} at byte {error.start}"]
    found = []
    if data and not data.endswith(b"\n"):
        found.append(f"{path}: ends without a newline")
    for number, line in enumerate(text.split("\n"), 1):
        blanks = re.match(r"[ \t]*", line)[0]
        if line != line.rstrip() and rule["trim_trailing_whitespace"] == "true":
            found.append(f"{path}:{number}: blanks or a carriage return at the end of the line")
        if "\t" in blanks and rule["indent_style"] == "space":
            found.append(f"{path}:{number}: indented by a tab")
    return found


def main() -> int:
    if sys.argv[1:] == ["--write"]:
        print(clang_format("-i"), end="")
        return 0
    rules = configparser.ConfigParser()
    rules.read_string("[root]\n" + Path(".editorconfig").read_text(encoding="utf-8"))
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], capture_output=True, text=True, check=True).stdout.splitlines()
    texts = [path for path in listed if Path(path).is_file() and not any(fnmatch(path, pattern) for pattern in MADE)]
    messages = {"clang_format": [line for line in clang_format("--dry-run", "-Werror").splitlines() if ": error: " in line],
                "editorconfig": [problem for path in texts for problem in problems(path, wanted(rules, path))]}
    for name, lines in messages.items():
        print(*(f"  {line}" for line in lines[:20]), sep="\n", end="\n" if lines else "")
        print(f"{name}: " + (f"FAIL: {len(lines)} places; make format writes the C files" if lines else "PASS"))
    return int(any(messages.values()))


if __name__ == "__main__":
    sys.exit(main())
