"""Golden vectors for test images: headers without the rows, and the rows as 16-bit words for the simulator."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "golden"))
import to_c # noqa: E402


def words(columns: list[tuple[str, str]], row: list[str]) -> list[int]:
    """A row as the chip has it in memory: low word first, members without gaps."""
    result = []
    for (_, ctype), cell in zip(columns, row):
        value = int(cell)
        result += [value >> shift & 0xFFFF for shift in range(0, int(ctype[1:]), 16)]
    return result


def header(name: str, table: int, columns: list, constants: dict, rows: list) -> str:
    """to_c's header, but golden_NAME_row() asks the simulator."""
    size = sum(int(ctype[1:]) for _, ctype in columns) // 16
    return '#include "ports.h"\n' + to_c.header(name, columns, constants, rows, [
        f"    golden_{name}_t row;", f"    golden_fetch({table}, n * {size}u, &row, sizeof row / 2u);", "    return row;"])


def write(vectors: Path, out: Path) -> list[Path]:
    """Headers golden_NAME.h and tables NAME.words in `out`.
    @return the tables; their places in this list are their numbers"""
    out.mkdir(parents=True, exist_ok=True)
    tables = []
    for number, path in enumerate(sorted(vectors.glob("*.txt"))):
        columns, constants, rows = to_c.read(path)
        table = out / f"{path.stem}.words"
        table.write_bytes(b"".join(word.to_bytes(2, "little") for row in rows for word in words(columns, row)))
        to_c.write_new(out / f"golden_{path.stem}.h", header(path.stem, number, columns, constants, rows))
        tables.append(table)
    return tables
