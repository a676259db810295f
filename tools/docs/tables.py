"""Writes the tables of docs/ that are made from headers and loaders: faults, the schedule, limits, parameters, pins, keys of files, scope, kept parameters, self-tests, states, the
simulator's assumptions, numbers chosen by trial.

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
from tools.common.tuned_rows import tuned
from tools.common.x_macro import rows

BEGIN, END = "<!-- table -->\n", "<!-- end -->"


def table(head: str, align: str, lines: list[list[str]]) -> str:
    """In Markdown; `align` has one letter a column, r for numbers."""
    rule = "|".join("---:" if letter == "r" else "---" for letter in align)
    return f"| {head.replace(', ', ' | ')} |\n|{rule}|\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _where(functions: tuple[str, ...]) -> str:
    """Each function with the file that defines it."""
    found = []
    for name in functions:
        defined = re.compile(rf"^[\w ]+ \*?{name}\([^;]*$", re.MULTILINE)
        place = next((path for path in sorted(ROOT.glob("firmware/*/*.c")) if defined.search(path.read_text(encoding="utf-8"))), None)
        if place is None:
            raise UserError(f"no function '{name}'", "include/drive/faults.h", "name the one that decides the fault")
        found.append(f"[`{name}`](../{place.relative_to(ROOT)})")
    return ", ".join(found)


def faults() -> str:
    return table("code, name, may pass, cause, remedy, decided by", "llllll", [
        [str(row.code), row.name, "yes" if row.passes else "", row.cause, row.remedy, _where(row.decided_by)]
        for row in drive_tables.faults()[1:]])


def states() -> str:
    """The transitions as a diagram, but for those to FAULT, and as a table with all reasons."""
    found, drawn, lines = drive_tables.states(), "", []
    for state in found:
        for following, group in itertools.groupby(sorted(state.transitions, key=lambda to: to[0] == "FAULT"), lambda to: to[0]):
            reasons = [reason for _, reason in group]
            lines.append([state.name, following, "<br>".join(reasons)])
            if following != "FAULT":
                drawn += f"    {state.name} --> {following}: {re.split('[:;]', reasons[0])[0]}\n"
    diagram = f"```mermaid\nstateDiagram-v2\n    [*] --> {found[0].name}\n{drawn}```\n\nEach state leads to FAULT, too: the table says why.\n"
    return "\n".join([diagram, table("state, what the drive does", "ll", [[state.name, state.meaning] for state in found]), table("from, to, why", "lll", lines)])


def limits() -> str:
    return table("bit, name, cause, remedy", "rlll", [[str(row.code), row.name, row.cause, row.remedy] for row in drive_tables.limits()])


SLOT_MS = 0.1
"""Two periods (SLOW_EVERY) at 20 kHz."""


def _calls(source: str, names: list[str]) -> list[tuple[str, str, bool]]:
    """Of the schedule's functions: which calls which, and whether it always does in the states in which the called one runs by its own row."""
    found = []
    for caller, body in re.findall(r"\nstatic void (\w+)\([^\n]*\n\{\n(.*?)\n\}", source, re.DOTALL):
        for condition, name in re.findall(r"(?:if \(([^\n]*)\) \{\n\s+)?\b(\w+)\(d, p, raw\);", body):
            if name in names and caller in names:
                found.append((caller, name, condition in ("", "drive_is_closed(d)")))
    return found


def _every(slots: int, always: int, at_times: int) -> str:
    """How often a function of so many of the slots runs: in each round, and where its callers let it."""
    often = f"{2 * slots // always} periods"
    return often + (f", at times {2 * slots // (always + at_times)}" if at_times else "")


def schedule() -> str:
    """The slots, and what each of their functions does, as its comment says."""
    found = rows("include", "drive/schedule.h", "SCHEDULE_TABLE", "#number #first #first_in #second #second_in")
    source = (ROOT / "firmware/drive/schedule.c").read_text(encoding="utf-8")
    says = {name: " ".join(text.split()) for text, name in re.findall(r"/\*\* ((?:(?!\*/).)*?) \*/\n(?:static|QM_INLINE) void (\w+)\(", source, re.DOTALL)}
    slots: dict[str, list[str]] = {}
    for number, first, _, second, _ in found:
        for name in (first, second):
            slots.setdefault(name, []).append(number)
    for name in slots:
        if name not in says:
            raise UserError(f"no comment says what '{name}' does", "firmware/drive/schedule.c", "write one above it: /** ... */")
    when = table("slot, ms, first half, in states, second half, in states", "rrllll", [
        [number, f"{int(number) * SLOT_MS:.1f}", f"`{first}`", first_in, f"`{second}`", second_in] for number, first, first_in, second, second_in in found])
    lines = []
    for name, numbers in slots.items():
        callers = [(caller, always) for caller, called, always in _calls(source, list(slots)) if called == name]
        places = [", ".join(numbers)] + [f"{', '.join(slots[caller])} by `{caller}`" for caller, _ in callers]
        often = len(numbers) + sum(len(slots[caller]) for caller, always in callers if always)
        lines.append([f"`{name}`", "; ".join(places), _every(len(found), often, sum(len(slots[caller]) for caller, always in callers if not always)), says[name]])
    return when + "\n" + table("function, in slots, every, what it does", "llrl", lines)


def selftest() -> str:
    found = rows("include", "drive/selftest.h", "SELFTEST_TABLE", "#code #name clause what")
    return table("code, name, clause of table H.1, what is tested", "rlll", [[code, name, clause, what] for code, name, clause, what in found])


def scope() -> str:
    services = rows("include", "board/scope.h", "LNET_SERVICE_TABLE", "#number #name meaning", also="tools/cpu_host")
    errors = rows("include", "board/scope.h", "LNET_ERROR_TABLE", "#number #name meaning", also="tools/cpu_host")
    modes = rows("include", "drive/request.h", "REMOTE_MODE_TABLE", "#number #name meaning")
    return "\n".join(table(f"{head}, name, meaning", "rll", [list(row) for row in found])
                     for head, found in (("service", services), ("error", errors), ("mode of scope_command", modes)))


def kept() -> str:
    found = {name: rows("include", "board/kept.h", f"KEPT_{name.upper()}_TABLE", "#number #name meaning") for name in ("request", "result", "state")}
    return "\n".join(table(f"{name}, name, meaning", "rll", [list(row) for row in lines]) for name, lines in found.items())


def simulator() -> str:
    found = rows("tools/cpu_33f", "iss_assumptions.h", "ASSUMPTIONS", "#name #value meaning place", also="tools/chip")
    return table("name, value, meaning, where", "lrll", [[f"`{name}`", *rest] for name, *rest in found])


def params() -> str:
    text = ""
    for section, group in itertools.groupby(parameters().values(), lambda row: row.section):
        text += f"## {section}\n\n" + table("parameter, unit, minimum, maximum, default, meaning", "llrrll", [
            [f"`{row.name}`" if not row.stem else f"`{row.stem}0` .. `17`", row.unit, row.low, row.high, FOLLOWS.get(row.default, row.default), row.meaning]
            for row in group if not row.stem or row.name == f"{row.stem}0"]) + "\n"
    relations = [message for _, message in rows("include", "drive/param_limits.h", "PARAM_RELATION_TABLE", "#condition message")]
    return text + "## What must hold between them\n\n" + "".join(
        f"- {message.replace('SPEED0', 'SPEED0 .. 17')}\n" for message in relations if not re.match(r"(IDREF|INVKFI)_SPEED[1-9]", message))


def tuned_numbers() -> str:
    return "\n".join(f"### {section}\n\n" + table("number, value, unit, meaning, shown by", "lrlll", [
        [f"`{row.name}`", row.value, row.unit, row.meaning, f"`make {row.command}`"] for row in group])
        for section, group in itertools.groupby(tuned().values(), lambda row: row.section))


def files() -> str:
    from . import file_keys # needs numpy, which the other pages do without
    return file_keys.page(table)


def pins() -> str:
    return table("pin, port, analogue, remappable, also, on the MCLV, known from", "rllllll", chip_pins.page())


PAGES: dict[str, Callable[[], str]] = {"faults": faults, "files": files, "law": schedule, "kept": kept, "limits": limits, "parameters": params,
                                         "pins": pins, "scope": scope, "selftest": selftest, "simulator": simulator, "states": states,
                                         "tuned": tuned_numbers}


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
