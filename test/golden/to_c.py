"""Turns the committed text vectors into C headers, so that tests need no files and run on a small target as well.

vectors/park.txt becomes golden_park.h: the type golden_park_t with one member a column, golden_park_row(n) for each of the
GOLDEN_PARK_ROWS, also named golden_park_rows, and GOLDEN_PARK_<NAME> for each constant line.
"""

import argparse
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
TYPES = {"s16": "int16_t", "u16": "uint16_t", "s32": "int32_t", "u32": "uint32_t"}


def literal(text, ctype):
    """An integer constant that is right where int has 16 bits, too."""
    value = int(text)
    bits, signed = int(ctype[1:]), ctype[0] == "s"
    if not (-(1 << (bits - 1)) <= value < (1 << (bits - 1)) if signed else 0 <= value < (1 << bits)):
        raise ValueError(f"{value} does not fit {ctype}")
    if bits == 16:
        return "INT16_MIN" if value == -32768 else f"{value}u" if value > 32767 else str(value)
    if value == -(1 << 31):
        return "INT32_MIN"
    return f"INT32_C({value})" if signed else f"UINT32_C({value})"


def constant(text):
    value = int(text)
    if value > 0x7FFFFFFF:
        return f"UINT32_C({value})"
    return f"INT32_C({value})" if abs(value) > 32767 else f"({value})" if value < 0 else str(value)


def read(path):
    """@return columns [(name, type)], constants {name: text}, rows [[text]]"""
    columns, constants, rows = [], {}, []
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
        if line.startswith("# columns:"):
            columns = [tuple(c.split(":")) for c in line.split()[2:]]
        elif line.startswith("# constant "):
            name, _, value = line[len("# constant "):].partition(" = ")
            constants[name] = value
        elif line and not line.startswith("#"):
            cells = line.split()
            if len(cells) != len(columns):
                raise ValueError(f"line {number} has {len(cells)} columns, not {len(columns)}")
            rows.append(cells)
    return columns, constants, rows


def header(name, columns, constants, rows, access=None):
    """@param access statements that return row n, in place of the array of all rows"""
    upper = f"GOLDEN_{name.upper()}"
    out = [f"/* Generated from test/golden/vectors/{name}.txt. */", f"#ifndef {upper}_H", f"#define {upper}_H", "",
           "#include <stdint.h>", ""]
    out += [f"#define {upper}_{key.upper()} {constant(value)}" for key, value in constants.items()]
    if rows:
        out += ["", f"#define {upper}_ROWS {len(rows)}u", "typedef struct {"]
        out += [f"    {TYPES[ctype]} {column};" for column, ctype in columns]
        out += [f"}} golden_{name}_t;", f"enum {{ golden_{name}_rows = {len(rows)} }};"]
        out += [] if access else [f"static const golden_{name}_t golden_{name}[{upper}_ROWS] = {{",
                                  *("    { " + ", ".join(literal(x, c[1]) for x, c in zip(row, columns)) + " }," for row in rows), "};"]
        out += ["", f"static inline golden_{name}_t golden_{name}_row(uint32_t n)", "{"]
        out += [*(access or [f"    return golden_{name}[n];"]), "}"]
    return "\n".join(out + ["", "#endif", ""])


def write_new(path, text):
    """Only what is new, so that nothing else is built again."""
    if not path.exists() or path.read_text(encoding="ascii") != text:
        path.write_text(text, encoding="ascii")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="directory of the headers")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for name in sorted(p.stem for p in (HERE / "vectors").glob("*.txt")):
        try:
            columns, constants, rows = read(HERE / "vectors" / f"{name}.txt")
            text = header(name, columns, constants, rows)
        except (OSError, ValueError, KeyError) as error:
            print(f"foc33: {error}, test/golden/vectors/{name}.txt: run make golden", file=sys.stderr)
            return 2
        write_new(options.out / f"golden_{name}.h", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
