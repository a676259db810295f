"""Tables that C headers keep as X-macros, as the compiler sees them."""

import os
import re
import shlex
import subprocess

from .errors import UserError
from .paths import ROOT


def run_compiler(arguments: list[str], source: str) -> subprocess.CompletedProcess:
    """What this machine's C compiler says to a source on its standard input."""
    compiler = shlex.split(os.environ.get("CC") or "gcc")
    try:
        return subprocess.run([*compiler, "-xc", "-", *arguments], input=source, capture_output=True, text=True, check=False)
    except OSError as error:
        raise UserError(f"the compiler does not run ({error.strerror})", compiler[0], "install gcc (Debian package: gcc), or name another by CC=") from None


def rows(folder: str, header: str, macro: str, columns: str, also: str = "") -> list[list[str]]:
    """The rows of a table in a header of a folder. `columns` names the macro's parameters, with # those that are no texts; the header may
    include from the folder `also`."""
    names = columns.replace("#", "").split()
    source = f'#include "{header}"\n#define ROW({", ".join(names)}) @@ {" @ ".join(columns.split())}\n{macro}(ROW)\n'
    done = run_compiler(["-E", "-P", f"-I{ROOT / folder}", f"-I{ROOT}", f"-I{ROOT / also}"], source)
    if done.returncode != 0:
        raise UserError(f"{folder}/{header} does not compile", done.args[0], (done.stderr.splitlines() or ["no message"])[0])
    found = [row.split(" @ ") for row in done.stdout.replace("\n", " ").split("@@")[1:]]
    return [["".join(re.findall(r'"((?:[^"\\]|\\.)*)"', cell)) for cell in row] for row in found]
