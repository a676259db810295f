"""`import`: an AN1292 userparms.h becomes a motor file, a board file where it differs, field-weakening tables and a userparams.h.

    python3 -m tuning import userparms.h --name my_motor --board mclv inertia=5.5e-6 supply=24

What the header does not say is estimated and told; `key=value` says it: inertia, friction, current, torque, supply, and every key of `make board`."""

import argparse
import contextlib
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tools.common import board_file, motor_file, paths, units
from tools.common.board_file import BoardFile
from tools.common.errors import UserError, UserErrors, suggestion
from tools.common.param_rows import ENTRIES, number, parameters
from tools.common.progress import waiting
from tools.common.toml_file import Document
from tools.common.units import Kind

from . import an1292, board, c_header, fw_tables, limits
from .an1292 import Line, UserParms
from .design import Design, design, plain
from .fw_tables import Entry, Tables

MOTOR_KEYS = {"inertia": units.INERTIA, "friction": units.FRICTION, "current": units.CURRENT, "torque": units.TORQUE}
DIVISOR_KEYS = {key: name for name, key in an1292.DIVISOR_KEYS.items()}
TABLES_KEY, FLAT, AS_THEY_ARE = "tables", "flat", "header"
"""tables=flat takes the d current only: 1/Kphi and Ls do not change with the speed."""
DIVISOR = Kind("1", 1, 32768, {"1": units.Conversion(1.0)})
START = ("END_SPEED_RPM", "OPENLOOP_RAMPSPEED_INCREASERATE", "Q_CURRENT_REF_OPENLOOP")
RISE_S = 0.03
"""Estimate: in which rated torque brings the bare rotor to rated speed; small motors take 0.02 to 0.06 s."""
FRICTION_SHARE = 0.05
"""Estimate: of the rated torque; 0.04 to 0.05 of the project's motors."""
LEAST_INVKFI, LEAST_LS, MOST_LS = (float(text) for text in (parameters()["INVKFI_SPEED0"].low, parameters()["LS_OVER2LS0_SPEED0"].low, parameters()["LS_OVER2LS0_SPEED0"].high))
KFI_LEAST, KFI_MOST = number("PARAM_INVKFI_LEAST"), number("PARAM_INVKFI_MOST")
"""What an entry of 1/Kphi may be of the motor's own."""
SCALE_SAME = 0.005
"""A board file is written where the header's numbers differ by more."""
SAMPLE_MARGIN_S = 1.0e-6
SAMPLE_DELAY_S = 25e-9 * number("SAMPLE_DELAY_CLOCKS")


@dataclass
class Given:
    """What the command line says beside the header."""

    motor: dict[str, float] = field(default_factory=dict)
    divisors: dict[str, int] = field(default_factory=dict)
    board: dict[str, str] = field(default_factory=dict)
    title: str = ""
    flat_tables: bool = False


@dataclass
class Plan:
    """Everything that is going to be written, and what was decided on the way."""

    name: str
    found: UserParms
    board: BoardFile
    board_text: str = ""
    """of a board file of its own; "" where the board that is there fits"""
    motor_text: str = ""
    rating: dict[str, tuple[float, str]] = field(default_factory=dict)
    """numbers of the motor file that the header does not have, each with its source"""
    tune: dict[str, float] = field(default_factory=dict)
    dropped: list[str] = field(default_factory=list)
    estimated: list[str] = field(default_factory=list)
    tables: Tables | None = None
    design: Design | None = None

    @property
    def motor_path(self) -> Path:
        return paths.MOTORS / f"{self.name}.toml"

    @property
    def board_path(self) -> Path:
        return paths.BOARDS / f"{self.name}.toml"

    @property
    def tables_path(self) -> Path:
        return fw_tables.path_of(self.name)


def add_command(commands: Any) -> None:
    """Adds `import` to a command line's commands."""
    parser = commands.add_parser("import", help="a header of AN1292: motor file, tables and userparams.h")
    parser.add_argument("header", nargs="?", help="AN1292's userparms.h, or that of a fork")
    parser.add_argument("given", nargs="*", metavar="key=value", help="e.g. inertia=5.5e-6 supply=24")
    parser.add_argument("--name", help="of the motor file; default: the header's")
    parser.add_argument("--board", help="a name in tuning/boards or a path, default mclv: what the header does not say")
    parser.add_argument("--defines", default="", help="-DNAME or -DNAME=value, which choose branches of #ifdef")
    parser.set_defaults(command=command)


def command(options: argparse.Namespace) -> int:
    """The whole command; returns the exit code."""
    if not options.header:
        raise UserError("no header", "HEADER", "name a file: make import HEADER=userparms.h")
    from . import report
    told = given(options.given)
    name = name_of(options.name, Path(options.header))
    base = board_file.load(options.board or board_file.DEFAULT, "BOARD")
    found = an1292.read(c_header.read(Path(options.header), defines(options.defines)), _supply_v(told, base), base.dead_time_s, told.divisors)
    with waiting(f"tuning {name}"):
        plan = planned(name, found, base, told, _doubts)
    with _written(plan):
        plan.design = _designed(plan, fresh=True)
        target = paths.TUNED / paths.pair_name(plan.motor_path, None)
        report.write(plan.design, target, anew=False)
    print(text(plan))
    print(f"wrote {', '.join(str(paths.shown(path)) for path in _files(plan))}, {paths.shown(target)}/userparams.h\n")
    print(report.brief(plan.design))
    print(f"next: make run MOTOR={name}; make tune MOTOR={name} makes userparams.h anew after a change of the motor file")
    return 0


def _doubts(plan: Plan) -> None:
    """What was taken for more than the header says, where the tuner refuses what came of it."""
    if doubtful := [*plan.found.contradictions, *plan.found.notes]:
        print("\n  ".join([f"{plan.found.header.label}: look at", *doubtful]))


# ---- what is given -----------------------------------------------------------------------------------------------------------
def given(words: list[str]) -> Given:
    """The key=value of the command line; keys of a board file are those of `make board`."""
    result, rest = Given(), []
    for word in words:
        key, sign, value = word.partition("=")
        if key in MOTOR_KEYS and sign:
            kind = MOTOR_KEYS[key]
            found, unit = board.number(key, kind, value)
            result.motor[key] = kind.units[unit](found)
        elif key in DIVISOR_KEYS and sign:
            divisor, _ = board.number(key, DIVISOR, value)
            if divisor != int(divisor) or int(divisor) & (int(divisor) - 1):
                raise UserError(f"{key} = {value} is no power of two", board.WHERE, "write 1, 2, 4 ... 32768")
            result.divisors[DIVISOR_KEYS[key]] = int(divisor)
        elif key == TABLES_KEY and sign:
            if value not in (FLAT, AS_THEY_ARE):
                raise UserError(f"'{word}' is unknown", board.WHERE, f"write {TABLES_KEY}={FLAT} or {TABLES_KEY}={AS_THEY_ARE}")
            result.flat_tables = value == FLAT
        elif sign and key not in {*board.keys(), *board.FLAGS, "title"}:
            raise UserError(f"unknown key '{key}'", board.WHERE, suggestion(key, [*MOTOR_KEYS, *DIVISOR_KEYS, TABLES_KEY, *board.keys(), *board.FLAGS, "title"]))
        else:
            rest.append(word)
    result.board = board.given(rest)
    result.title = result.board.pop("title", "")
    return result


def defines(words: str) -> dict[str, str]:
    """-DNAME or -DNAME=value as a compiler takes them."""
    found = {}
    for word in words.split():
        match = re.fullmatch(r"-D([A-Za-z_]\w*)(?:=(.*))?", word)
        if not match:
            raise UserError(f"'{word}' is no -DNAME", "DEFINES", "write -DNAME or -DNAME=value")
        found[match[1]] = "1" if match[2] is None else match[2]
    return found


def name_of(asked: str | None, header: Path) -> str:
    """The motor's name: what was asked for, else the header's."""
    name = asked or re.sub(r"[^A-Za-z0-9_]+", "_", header.stem).strip("_")
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", name) or name == "all" or name.endswith(".toml"):
        raise UserError(f"'{name}' is no name for a motor", "NAME", "use letters, digits and _, without a path")
    return name


def _supply_v(told: Given, base: BoardFile) -> float:
    if "supply.voltage" not in told.board:
        return base.nominal_bus_v
    value, unit = board.number("supply.voltage", board_file.TABLES["supply"]["voltage"].kind, told.board["supply.voltage"])
    return board_file.TABLES["supply"]["voltage"].kind.units[unit](value)


# ---- the plan ----------------------------------------------------------------------------------------------------------------
def planned(name: str, found: UserParms, base: BoardFile, told: Given, refused: Callable[[Plan], object] = lambda plan: None) -> Plan:
    """What is going to be written; refuses what could not be used, and files that are there. `refused` is told of a plan that the tuner refuses."""
    plan = prepared(name, found, base, told)
    try:
        plan.design = _settled(plan, told)
    except UserError:
        refused(plan)
        raise
    plan.tables = _tables(plan, told)
    return plan


def prepared(name: str, found: UserParms, base: BoardFile, told: Given) -> Plan:
    """The same before the tuner has seen it: the board, the motor file, and which of the header's choices are in range."""
    plan = Plan(name, found, base)
    _plan_board(plan, base, told)
    wanted = {"motor": plan.motor_path, "tables": plan.tables_path} | ({"board": plan.board_path} if plan.board_text else {})
    for kind, path in wanted.items():
        if path.exists():
            raise UserError(f"the {kind} file is there already", str(paths.shown(path)), "give another name, NAME=, or remove it first")
    plan.rating = _rating(plan, told)
    _plan_tune(plan)
    plan.motor_text = _motor_text(plan, told)
    return plan


def _source(found: UserParms, name: str) -> str:
    return _quoted(f"{Path(found.header.label).name}:{found.where(name).rpartition(':')[2]} {name}") if found.name_of(name) else Path(found.header.label).name


def _quoted(words: str) -> str:
    return re.sub(r"[\"\\\x00-\x1f\x7f]", " ", words)


# ---- the board ---------------------------------------------------------------------------------------------------------------
def _plan_board(plan: Plan, base: BoardFile, told: Given) -> None:
    """A board file of the header's own where it measures or switches in another way than the board that is there."""
    found, changes, sources = plan.found, dict(told.board), {}

    def change(key: str, name: str, value: str) -> None:
        changes.setdefault(key, value)
        sources[key] = _source(found, name)

    if abs(found.period_s / base.pwm_period_s - 1.0) > 1e-6:
        change("pwm.period", "LOOPTIME_SEC", f"{found.period_s * 1e6:.8g}us")
    if abs(found.dead_time_s / base.dead_time_s - 1.0) > 1e-6:
        change("pwm.dead_time", "DEADTIME_SEC", f"{found.dead_time_s * 1e6:.8g}us")
        window_s = max(base.sample_window_s, found.dead_time_s + SAMPLE_MARGIN_S - SAMPLE_DELAY_S)
        change("pwm.sample_window", "DEADTIME_SEC", f"{window_s * 1e6:.8g}us")
    if (found.gain < 0.0) != (base.current_gain < 0.0):
        change("shunt.inverted", "KCURRA", "yes" if found.gain < 0.0 else "no")
    share = found.full_scale_a / base.current_full_scale_a
    if abs(share - 1.0) > SCALE_SAME and not {"shunt.resistance", "shunt.amplifier_gain"} & set(told.board):
        change("shunt.amplifier_gain", "NORM_CURRENT_CONST", f"{_amplifier_gain(plan, base, share):.6g}")
        change("inverter.trip_current", "NORM_CURRENT_CONST", f"{base.quantities['inverter.trip_current'].value_si * share:.3g}A")
    if not changes:
        return
    title = f"{base.title}, as {found.header.label} measures" + (f" at {found.supply_v:g} V" if "supply.voltage" in told.board else "")
    text = board.written({"from": str(base.path), "title": title} | changes, plan.board_path)
    plan.board_text = _with_sources(text, sources).replace("# Made by: make board;", "# Made by: make import;").replace("given to make board:", "given to make import:")
    try:
        plan.board = board_file.read(Document(plan.board_path, plan.board_text))
    except UserError as error:
        where = re.escape(str(paths.shown(plan.board_path))) + r" line \d+"
        raise UserError(re.sub(where, f"the board of {found.header.label} and SET", error.lines[0])) from None


def _amplifier_gain(plan: Plan, base: BoardFile, share: float) -> float:
    """The gain that puts the header's current at the end of the converter's range."""
    gain = base.quantities["shunt.amplifier_gain"].value_si / share
    kind = board_file.TABLES["shunt"]["amplifier_gain"].kind
    assert kind
    if not kind.minimum <= gain <= kind.maximum:
        raise UserError(f"NORM_CURRENT_CONST makes {plan.found.full_scale_a:.3g} A the converter's range, a gain of {gain:.3g} with the shunt of {base.name}",
                        plan.found.where("NORM_CURRENT_CONST"), "give the shunt and the gain: SET=\"shunt=10mohm gain=20\"")
    return gain


def _with_sources(text: str, sources: dict[str, str]) -> str:
    """The board file with the header's lines as sources."""
    table, lines = "", []
    for line in text.splitlines():
        table = line[1:-1] if line.startswith("[") else table
        key = f"{table}.{line.partition(' ')[0]}"
        if key in sources and "source" in line:
            line = re.sub(r'source = ".*"', lambda _, key=key: f'source = "{sources[key]}"', line)
        lines.append(line)
    return "\n".join(lines) + "\n"


# ---- the motor file ------------------------------------------------------------------------------------------------------------
def _rating(plan: Plan, told: Given) -> dict[str, tuple[float, str]]:
    """Numbers of the motor file that AN1292's header does not have, each with its source; estimates are told."""
    found, most_a = plan.found, limits.TRIP_SHARE * plan.found.full_scale_a / limits.LEAST_TRIP_OVER_MAXIMUM
    psi_vs = found.kphi / (units.SQRT3 * units.KRPM * found.pole_pairs)
    start_a = found.ampere_of("Q_CURRENT_REF_OPENLOOP")
    result: dict[str, tuple[float, str]] = {}

    def put(key: str, value: float, why: str) -> float:
        known = key in told.motor
        result[key] = (told.motor[key], "given to make import") if known else (float(f"{value:.3g}"), f"estimate: {why} [?]")
        if not known:
            plan.estimated.append(f"{key} {result[key][0]:.4g} {MOTOR_KEYS[key].si_unit}: {why}")
        return result[key][0]

    heat_a = 0.9 * found.supply_v / (units.SQRT3 * found.rs_ohm)
    rated_a = put("current", min(start_a or 0.5 * most_a, most_a, heat_a), f"the start's current, {_source(found, 'Q_CURRENT_REF_OPENLOOP')}" if start_a else
                  "half of what the board measures")
    torque_nm = put("torque", 1.5 * found.pole_pairs * psi_vs * rated_a / (1.0 + FRICTION_SHARE), "torque constant times current, less friction")
    put("friction", FRICTION_SHARE * torque_nm, f"{FRICTION_SHARE:.0%} of the torque")
    put("inertia", RISE_S * torque_nm / (found.nominal_rpm * units.RPM), f"rated torque brings it to rated speed in {RISE_S:g} s; measure it with IDENTIFY")
    result["maximum_current"] = _maximum_current(found, rated_a, most_a)
    return result


def _maximum_current(found: UserParms, rated_a: float, most_a: float) -> tuple[float, str]:
    """The speed controller's limit, where it is one; else what field weakening asks for."""
    limit = found.maybe("SPEEDCNTR_OUTMAX", 1, an1292.FULL_COUNT)
    deepest = max((-entry.idref_a for entry in found.tables), default=0.0)
    least = max(deepest, rated_a)
    if limit is not None and limit < an1292.FULL_COUNT - 1:
        return max(limit * found.ampere, least), _source(found, "SPEEDCNTR_OUTMAX")
    return min(max(deepest, motor_file.MAXIMUM_OVER_RATED * rated_a), max(most_a, rated_a)), "estimate: 1.5 times the current, or the deepest entry of IDREF_SPEED [?]"


def _plan_tune(plan: Plan) -> None:
    """Values of the header that the tuner shall keep, as far as they are in this firmware's range."""
    found = plan.found
    wanted = {name: found.maybe(name) for name in ("END_SPEED_RPM", "OPENLOOP_RAMPSPEED_INCREASERATE", "TUNING_DELAY_RAMPUP", "SNAPDELAY", "DATA_BUFFER_SIZE")}
    wanted |= {"Q_CURRENT_REF_OPENLOOP": found.ampere_of("Q_CURRENT_REF_OPENLOOP"), "OVER_CURRENT_THRESHOLD_A": found.ampere_of("Q15_OVER_CURRENT_THRESHOLD"),
               "SPEEDREFRAMP_RPM_PER_S": an1292.reference_ramp(found) or None}
    for name, value in wanted.items():
        if value is None:
            continue
        row = parameters()[name]
        value = float(f"{value:.3g}") if row.unit.startswith("A") else float(f"{value:.5g}") # a count is coarser
        if not float(row.low) <= value <= float(row.high):
            plan.dropped.append(f"{name} = {value:g} is outside {row.span}: the tuner chooses one")
        elif name == "END_SPEED_RPM" and value > found.nominal_rpm:
            plan.dropped.append(f"END_SPEED_RPM = {value:g} is above NOMINAL_SPEED_RPM: the tuner chooses one")
        else:
            plan.tune[name] = value


def _motor_text(plan: Plan, told: Given) -> str:
    found, rating = plan.found, plan.rating

    def row(key: str, value: float, unit: str, source: str) -> str:
        return f'{key} = {{ value = {value:.6g}, ' + (f'unit = "{unit}", ' if unit else "") + f'source = "{source}" }}'

    supply = "given to make import" if "supply.voltage" in told.board else _quoted(str(paths.shown(plan.board.path)))
    chosen = plan.name if plan.board_text else plan.board.name if plan.board.path.resolve().parent == paths.BOARDS.resolve() else str(plan.board.path.resolve())
    lines = [f"# Made from {_quoted(found.header.label)} by: make import. [?] in a source: an estimate, which the header does not have; look through it.",
             f'title = "{_quoted(told.title or f"{plan.name}, from {found.header.label}")}"', 'connection = "Y"', f'board = "{_quoted(chosen)}"', "", "[electrical]",
             row("pole_pairs", found.pole_pairs, "", _source(found, "NOPOLESPAIRS")),
             row("resistance", found.rs_ohm, "ohm phase", _source(found, "NORM_RS")), row("inductance", found.ls_h * 1e3, "mH phase", _source(found, "NORM_LSDTBASE")),
             row("kphi", found.kphi, "V peak line-to-line/krpm", _source(found, "NORM_INVKFIBASE")), "", "[mechanical]",
             row("inertia", rating["inertia"][0], "kg m2", rating["inertia"][1]), row("coulomb_friction", rating["friction"][0], "N m", rating["friction"][1]), "", "[rating]",
             row("voltage", found.supply_v, "V", supply), row("current", rating["current"][0], "A peak", rating["current"][1]),
             row("torque", rating["torque"][0], "N m", rating["torque"][1]), row("speed", found.nominal_rpm, "rpm", _source(found, "NOMINAL_SPEED_RPM")),
             row("maximum_speed", found.maximum_rpm, "rpm", _source(found, "MAXIMUM_SPEED_RPM")),
             row("maximum_current", rating["maximum_current"][0], "A peak", rating["maximum_current"][1])]
    if plan.tune:
        lines += ["", "# Kept from the header; remove a line, and the tuner chooses.", "[tune]", *(f"{name} = {plain(value)}" for name, value in plan.tune.items())]
    return "\n".join(lines) + "\n"


# ---- the design ----------------------------------------------------------------------------------------------------------------
def _designed(plan: Plan, fresh: bool = False) -> Design:
    """The tuner's design of the motor file; what it refuses is told with the header's lines. `fresh`: from the files on disk"""
    try:
        if fresh:
            return design(motor_file.load(plan.name), board_file.load(*board_file.named(motor_file.load(plan.name))))
        return design(motor_file.read(Document(plan.motor_path, plan.motor_text)), plan.board)
    except UserError as error:
        lines = [_of_header(plan, line) for line in error.lines]
        raise UserErrors([UserError(line) for line in lines]) if len(lines) > 1 else UserError(lines[0]) from None


def _of_header(plan: Plan, line: str) -> str:
    """A message about a line of the motor file, which is not written yet, with that line's source in its place."""
    def source(match: re.Match[str]) -> str:
        found = re.search(r'source = "([^"]*)"', plan.motor_text.splitlines()[int(match[1]) - 1])
        return found[1] if found else match[0]
    return re.sub(re.escape(str(paths.shown(plan.motor_path))) + r" line (\d+)", source, line).replace(f"{paths.shown(plan.motor_path)} [tune]", plan.found.header.label)


def _settled(plan: Plan, told: Given) -> Design:
    """The design with as much of the header's choices as works."""
    while True:
        plan.motor_text = _motor_text(plan, told)
        try:
            return _calmed(plan, _designed(plan), told)
        except UserError as error:
            if not plan.tune:
                raise
            blamed = [name for name in plan.tune if name in str(error)] or [name for name in START if name in plan.tune] or list(plan.tune)
            _drop(plan, blamed, error.lines[0])


def _calmed(plan: Plan, made: Design, told: Given) -> Design:
    """A design whose rotor starts: without the header's start where the tuner's own is calmer."""
    if not made.start_risks:
        return made
    for names in (START[:1], START):
        kept = [name for name in names if name in plan.tune]
        other = replace(plan, tune={name: value for name, value in plan.tune.items() if name not in kept})
        other.motor_text = _motor_text(other, told)
        calmer = _designed(other) if kept else made
        if len(calmer.start_risks) < len(made.start_risks):
            _drop(plan, kept, made.start_risks[0])
            plan.motor_text = other.motor_text
            return calmer
    return made


def _drop(plan: Plan, names: list[str], why: str) -> None:
    told = " and ".join(f"{name} = {plain(plan.tune.pop(name))}" for name in names)
    plan.dropped.append(f"{told}: the tuner chooses ({why})")


# ---- tables ------------------------------------------------------------------------------------------------------------------
def _tables(plan: Plan, told: Given) -> Tables | None:
    """The header's tables for this motor: d current as it is, 1/Kphi and Ls as they are or flat."""
    found, made = plan.found, plan.design
    assert made
    if not found.tables:
        return None
    if found.maximum_rpm <= found.nominal_rpm:
        plan.dropped.append("the tables: MAXIMUM_SPEED_RPM is not above NOMINAL_SPEED_RPM, field weakening is not reached")
        return None
    deepest, base = made.value("MAXIMUM_CURRENT_A"), made.scales.invkfi
    _tell_tables(plan, deepest, base, told.flat_tables)
    entries = [Entry(-min(round(-entry.idref_a, 2), limits.down(deepest, 0.01)), base if told.flat_tables else _kfi(base, entry.inv_kfi),
                     0.5 if told.flat_tables else min(max(entry.ls_ratio, LEAST_LS), MOST_LS)) for entry in found.tables]
    last = min(ENTRIES - 1, math.ceil((found.maximum_rpm - found.nominal_rpm) * found.pole_pairs / fw_tables.STEP_ERPM))
    return Tables(plan.name, found.nominal_rpm, entries, fw_tables.fingerprint({name: made.value(name) for name in fw_tables.FINGERPRINT}), base,
                  last, "", found.maximum_rpm, origin=found.header.label)


def _kfi(base: float, share: float) -> float:
    """An entry of 1/Kphi, in counts, within what the build accepts."""
    return min(max(base * share, math.ceil(KFI_LEAST * base), LEAST_INVKFI), math.floor(KFI_MOST * base), 32767.0)


def _tell_tables(plan: Plan, deepest: float, base: float, flat: bool) -> None:
    """What of the tables is not taken as it is."""
    tables = plan.found.tables
    if any(-entry.idref_a > deepest for entry in tables):
        plan.dropped.append(f"IDREF_SPEED beyond MAXIMUM_CURRENT_A: those entries are {-deepest:g} A")
    rising = any(abs(entry.inv_kfi - 1.0) > an1292.SAME_SPEED or abs(entry.ls_ratio - 0.5) > an1292.SAME for entry in tables)
    if rising and flat:
        plan.dropped.append(f"INVKFI_SPEED and LS_OVER2LS0_SPEED: {TABLES_KEY}={FLAT} leaves 1/Kphi and Ls as they are at base speed")
    elif rising:
        plan.found.notes.append("INVKFI_SPEED and LS_OVER2LS0_SPEED are taken as they are. AN1292's make up for a back-EMF that it clips; here it is not clipped, and "
                                f"flat tables may give the better angle: SET={TABLES_KEY}={FLAT}, or make tune-fw MOTOR={plan.name}")
        if any(not LEAST_LS <= entry.ls_ratio <= MOST_LS for entry in tables):
            plan.dropped.append(f"LS_OVER2LS0_SPEED outside {LEAST_LS:g} .. {MOST_LS:g}: those entries end there")
        if any(abs(_kfi(base, entry.inv_kfi) - base * entry.inv_kfi) > 1.0 for entry in tables):
            plan.dropped.append(f"INVKFI_SPEED outside {KFI_LEAST:g} .. {KFI_MOST:g} of NORM_INVKFIBASE: those entries end there")


# ---- files ---------------------------------------------------------------------------------------------------------------------
def _files(plan: Plan) -> list[Path]:
    return [plan.motor_path, *([plan.board_path] if plan.board_text else []), *([plan.tables_path] if plan.tables else [])]


@contextlib.contextmanager
def _written(plan: Plan) -> Iterator[None]:
    """Writes the files; they are gone again where what follows fails."""
    done: list[Path] = []
    try:
        for path, content in ((plan.board_path, plan.board_text), (plan.motor_path, plan.motor_text), (plan.tables_path, fw_tables.text(plan.tables) if plan.tables else "")):
            if content:
                _create(path, content)
                done.append(path)
        yield
    except BaseException:
        for path in done:
            with contextlib.suppress(OSError):
                path.unlink()
        raise


def _create(path: Path, content: str) -> None:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(content)
    except FileExistsError:
        raise UserError("the file is there already", str(paths.shown(path)), "give another name, NAME=, or remove it first") from None
    except OSError as error:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
        raise UserError(f"cannot write the file ({error.strerror})", str(paths.shown(path)), "make the folder writable") from None


# ---- what is printed -------------------------------------------------------------------------------------------------------------
def text(plan: Plan) -> str:
    """Every number with its line, what it became, and what could not be taken over."""
    found = plan.found
    lines = [f"{found.header.label}: at {found.supply_v:g} V, {found.period_s * 1e6:.4g} us and {found.dead_time_s * 1e6:.3g} us dead time a count is "
             f"{found.volt * 1e3:.4g} mV (U0) and {found.ampere * 1e3:.4g} mA (I0)", "", *_columns([("line", "name", "header", "is", "goes to")] + [
                 (str(line.line), line.name, line.written, line.shown, line.goes_to) for line in found.lines if line.goes_to])]
    lines += _table_lines(found)
    others: dict[bool, list[str]] = {True: [], False: []}
    for line in found.lines:
        if not line.goes_to:
            others[_has_counterpart(line)].append(f"line {line.line} {line.name}{f' ({line.shown})' if line.shown else ''}: {line.why}")
    for title, rows in (("chosen anew, what takes its place is named:", others[True]), ("no counterpart:", others[False]), ("branches:", found.header.branches), ("contradictions:", found.contradictions), ("notes:", [*found.header.notes, *found.notes]),
                        ("not taken over:", plan.dropped),
                        ("not in the header, estimated (SET=\"inertia=... friction=... current=... torque=...\" says it):", plan.estimated)):
        if rows:
            lines += ["", title, *(f"  {row}" for row in rows)]
    return "\n".join(lines) + "\n"


def _has_counterpart(line: Line) -> bool:
    """Whether something here takes its place: a name of userparams.h that the reason tells, or its own."""
    return "userparams.h" in line.why or bool({line.name, *re.findall(r"[A-Z][A-Z0-9_]+", line.why)} & set(parameters()))


def _columns(rows: list[tuple[str, ...]]) -> list[str]:
    """A table with aligned columns."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  " + "  ".join(cell.rjust(width) if i == 0 else cell.ljust(width) for i, (cell, width) in enumerate(zip(row, widths))).rstrip() for row in rows]


def _table_lines(found: UserParms) -> list[str]:
    """The 18 entries: speed, d current, Kphi and L, each with its line."""
    if not found.tables:
        return ["", "no tables: the tuner makes them from the motor's voltage equation"]

    def lined(stem: str, i: int, value: str) -> str:
        name = found.name_of(f"{stem}{i}")
        return f"{value} (line {found.header.defines[name].line})" if name else value
    step = fw_tables.STEP_ERPM / found.pole_pairs
    rows = [("entry", "speed", "d current", "Kphi", "L")]
    for i, entry in enumerate(found.tables):
        rows.append((str(i), f"{found.nominal_rpm + i * step:.0f} rpm", lined("IDREF_SPEED", i, f"{entry.idref_a:.3g} A"),
                     lined("INVKFI_SPEED", i, f"{found.kphi / entry.inv_kfi:.4g} V/krpm"), lined("LS_OVER2LS0_SPEED", i, f"{2.0 * entry.ls_ratio * found.ls_h * 1e3:.4g} mH")))
    return ["", *_columns(rows)]
