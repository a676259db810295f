"""What the firmware's sources define: functions and variables by file, and members of structures (board_drive.control.pi_d)."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from tools.common import paths

PATTERNS = ("firmware/**/*.c", "include/**/*.h")
DROPPED = re.compile(r"/\*.*?\*/|//[^\n]*|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.DOTALL | re.MULTILINE) # comments, lines of the preprocessor
FUNCTION = re.compile(r"^\w[\w \*]*?\b(\w+)\([^(){};]*\)\s*\{", re.MULTILINE)
VARIABLE = re.compile(r"^((?:\w+[ \*]+)+)(?![A-Z_]+;)(\w+(?:, \*?\w+)*)(?: [A-Z_]+)?(?: =|;)",
                      re.MULTILINE) # after array sizes are taken out
STRUCT = re.compile(r"^(?:typedef )?struct\b(?: (\w+))?[^{;]*\{", re.MULTILINE) # struct name { is a name_t of drive/forward.h
NOT_DEFINED = ("typedef", "extern", "return")

Members = dict[str, "str | Members"]    # name -> name of the type, or the members of a nested structure


@dataclass
class Sources:
    """Names that the sources define."""

    functions: dict[str, set[str]] = field(default_factory=dict)    # by file
    variables: dict[str, dict[str, str]] = field(default_factory=dict)  # by file: name and type
    types: dict[str, Members] = field(default_factory=dict)

    @staticmethod
    def read(root: Path = paths.ROOT) -> "Sources":
        result = Sources()
        for path in sorted(path for pattern in PATTERNS for path in root.glob(pattern)):
            text = DROPPED.sub("", path.read_text(encoding="utf-8"))
            file = path.relative_to(root).as_posix()
            result.functions[file] = set(FUNCTION.findall(text))
            result.variables[file] = {name: words[-1] for kind, list_ in VARIABLE.findall(re.sub(r"\[[^\]]*\]", "", text))
                                      if not set(NOT_DEFINED) & set(words := kind.split()) for name in re.findall(r"\w+", list_)}
            for start in STRUCT.finditer(text):
                tokens = iter(re.findall(r"\w+|[{};,\[\]]", text[start.end():]))
                members = _members(tokens)
                result.types[f"{start[1]}_t" if start[1] else next(tokens)] = members
        return result

    def objects(self) -> set[str]:
        """Every variable, and every member of one as a path."""
        return {path for known in self.variables.values() for name, kind in known.items() for path in (name, *self._paths(name, kind))}

    def _paths(self, before: str, kind: "str | Members") -> list[str]:
        members = self.types.get(kind, {}) if isinstance(kind, str) else kind
        return [path for name, inner in members.items() for path in (f"{before}.{name}", *self._paths(f"{before}.{name}", inner))]


def _members(tokens) -> Members:
    """The members up to the closing brace: "volatile int16_t a, b[3];", "struct { ... } c;"."""
    result: Members = {}
    words: list[str] = []
    nested: Members | None = None
    kind: "str | Members | None" = None
    for token in tokens:
        if token == "}":
            break
        if token == "{":
            nested = _members(tokens)
        elif token == "[":
            while next(tokens) != "]":
                pass
        elif token in ",;":
            kind = kind or nested or (words[-2] if len(words) > 1 else "")
            result[words[-1] if words else ""] = kind
            words = []
            if token == ";":
                nested, kind = None, None
        else:
            words.append(token)
    return result
