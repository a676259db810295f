"""Writes the tables of docs/ that are made from headers and loaders: faults, limits, parameters, pins, keys of files, scope, self-tests, the simulator's
assumptions.

    python3 -m tools.docs.tables                  writes the pages
    python3 -m tools.docs.tables --print faults   prints one page instead
"""

import argparse
import itertools
import re
import sys
from collections.abc import Callable

from tools.common import drive_tables
from tools.common import pins as chip_pins
from tools.common.errors import UserError
from tools.common.param_rows import FOLLOWS, parameters
from tools.common.paths import ROOT
from tools.common.x_macro import rows

BEGIN, END = "<!-- table -->\n", "<!-- end -->"


def table(head: str, align: str, lines: list[list[str]]) -> str:
    """In Markdown; `align` has one letter a column, r for numbers."""
    rule = "|".join("---:" if letter == "r" else "---" for letter in align)
    return f"| {head.replace(', ', ' | ')} |\n|{rule}|\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def faults() -> str:
    return table("code, name, may pass, cause, remedy", "lllll", [
        [str(row.code), row.name, "yes" if row.passes else "", row.cause, row.remedy] for row in drive_tables.faults()[1:]])


def limits() -> str:
    return table("bit, name, cause, remedy", "rlll", [[str(row.code), row.name, row.cause, row.remedy] for row in drive_tables.limits()])


def selftest() -> str:
    found = rows("include", "drive/selftest.h", "SELFTEST_TABLE", "#code #name clause what")
    return table("code, name, clause of table H.1, what is tested", "rlll", [[code, name, clause, what] for code, name, clause, what in found])


def scope() -> str:
    services = rows("include", "board/lnet.h", "LNET_SERVICE_TABLE", "#number #name meaning")
    errors = rows("include", "board/lnet.h", "LNET_ERROR_TABLE", "#number #name meaning")
    modes = rows("include", "drive/remote.h", "REMOTE_MODE_TABLE", "#number #name meaning")
    return "\n".join(table(f"{head}, name, meaning", "rll", [list(row) for row in found])
                     for head, found in (("service", services), ("error", errors), ("mode of scope_command", modes)))


def simulator() -> str:
    found = rows("tools/cpu_33f", "iss_assumptions.h", "ASSUMPTIONS", "#name #value meaning place", also="tools/chip")
    return table("name, value, meaning, where", "lrll", [[f"`{name}`", *rest] for name, *rest in found])


def params() -> str:
    text = ""
    for section, group in itertools.groupby(parameters().values(), lambda row: row.section):
        text += f"## {section}\n\n" + table("parameter, unit, minimum, maximum, default, meaning", "llrrll", [
            [f"`{row.name}`" if not row.stem else f"`{row.stem}0` .. `17`", row.unit, row.low, row.high, FOLLOWS.get(row.default, row.default), row.meaning]
            for row in group if not row.stem or row.name == f"{row.stem}0"]) + "\n"
    relations = [message for _, message in rows("include", "drive/param_table.h", "PARAM_RELATION_TABLE", "#condition message")]
    return text + "## What must hold between them\n\n" + "".join(
        f"- {message.replace('SPEED0', 'SPEED0 .. 17')}\n" for message in relations if not re.match(r"IDREF_SPEED[1-9]", message))


def files() -> str:
    from . import file_keys # needs numpy, which the other pages do without
    return file_keys.page(table)


def pins() -> str:
    return table("pin, port, analogue, remappable, also, on the MCLV, known from", "rllllll", chip_pins.page())


PAGES: dict[str, Callable[[], str]] = {"faults": faults, "files": files, "limits": limits, "parameters": params,
                                         "pins": pins, "scope": scope, "selftest": selftest, "simulator": simulator}


def page(name: str) -> str:
    """A whole page with the table that the header has now."""
    path = ROOT / "docs" / f"{name}.md"
    before, begin, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        sys.exit(f"foc33: a table's place is not marked, {path.relative_to(ROOT)}: put in {BEGIN.strip()} and {END}")
    return before + begin + PAGES[name]() + end + after


def main() -> None:
    options = argparse.ArgumentParser(prog="tools.docs.tables", description=__doc__.splitlines()[0])
    options.add_argument("--print", choices=PAGES, metavar="PAGE", help="print one page instead of writing all: " + ", ".join(PAGES))
    wanted = options.parse_args().print
    try:
        if wanted:
            print(page(wanted), end="")
            return
        for name in PAGES:
            (ROOT / "docs" / f"{name}.md").write_text(page(name), encoding="utf-8")
    except OSError as error:
        sys.exit(f"foc33: {error.strerror}, {error.filename}: check the file")
    except UserError as error:
        sys.exit(f"foc33: {error}")


if __name__ == "__main__":
    main()
