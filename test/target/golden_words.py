"""Golden vectors for test images: headers without the rows, the rows as 16-bit words for the simulator, and tests that ask for them."""

import re
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "golden"))
import to_c # noqa: E402

ACCESS = re.compile(r"\b(golden_\w*)(##\w+)?\[([^][]+)\]")


def words(columns: list[tuple[str, str]], row: list[str]) -> list[int]:
    """A row as the target has it in memory: low word first, members without gaps."""
    result = []
    for (_, ctype), cell in zip(columns, row):
        value = int(cell)
        result += [value >> shift & 0xFFFF for shift in range(0, int(ctype[1:]), 16)]
    return result


def header(name: str, table: int, columns: list, constants: dict, rows: list) -> str:
    """to_c's header with a function golden_NAME_row() instead of the array."""
    text = to_c.header(name, columns, constants, rows)
    if not rows:
        return text
    begin = text.index("static GOLDEN_STORAGE")
    end = text.index("};\n", begin) + len("};\n")
    fetch = [f"static inline golden_{name}_t golden_{name}_row(uint32_t n)", "{",
             f"    golden_{name}_t row;",
             f"    golden_fetch({table}, n * {sum(int(ctype[1:]) for _, ctype in columns) // 16}u, &row, sizeof row / 2u);",
             "    return row;", "}", ""]
    return text[:begin] + '#include "golden_fetch.h"\n\n' + "\n".join(fetch) + text[end:]


def write(vectors: Path, out: Path) -> list[Path]:
    """Headers golden_NAME.h and tables NAME.words in `out`.
    @return the tables; their places in this list are their numbers"""
    out.mkdir(parents=True, exist_ok=True)
    tables = []
    for number, path in enumerate(sorted(vectors.glob("*.txt"))):
        columns, constants, rows = to_c.read(path)
        target, table = out / f"golden_{path.stem}.h", out / f"{path.stem}.words"
        data = b"".join(word.to_bytes(2, "little") for row in rows for word in words(columns, row))
        if not table.exists() or table.read_bytes() != data:
            table.write_bytes(data)
        text = header(path.stem, number, columns, constants, rows)
        if not target.exists() or target.read_text() != text:
            target.write_text(text)
        tables.append(table)
    return tables


def fed(source: str, name: str) -> str:
    """A test's text with golden_x[n] read by golden_x_row(n); lines keep their numbers."""
    def call(match: re.Match) -> str:
        return f"{match[1]}{match[2] or ''}{'##' if match[2] else ''}_row({match[3]})"
    return f'#line 1 "{name}"\n' + ACCESS.sub(call, source)
