"""What a run leaves for people and programs: the summary as data (summary.json), as text (table, protocol, expectations) and as a page."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tools.common import drive_tables, output
from . import page, picture, reach
from .expect import Outcome
from .metrics import limited_percent
from .run import Run

COLUMNS = (
    ("reference_rpm", "reference\nrpm", "{:.0f}"), ("speed_rpm", "true\nrpm", "{:.1f}"),
    ("estimated_rpm", "estimated\nrpm", "{:.1f}"), ("speed_error_percent", "error\n%", "{:+.2f}"),
    ("current_rms_a", "phase I\nA rms", "{:.3f}"), ("torque_nm", "torque\nN m", "{:.4f}"),
    ("angle_error_mean_deg", "angle err\nmean deg", "{:+.2f}"), ("angle_error_rms_deg", "angle err\nrms deg", "{:.2f}"),
    ("voltage_v", "voltage\nV", "{:.2f}"), ("voltage_percent", "of limit\n%", "{:.0f}"),
    ("inv_kphi_rpm_per_v", "1/Kphi\nrpm/V", "{:.1f}"), ("limited_percent", "\nlimited by", ""))
"""Columns of the summary table: value, heading, format."""
UNITS = {"rpm": "rpm", "percent": "%", "a": "A", "v": "V", "nm": "N·m", "deg": "°", "s": "s", "degc": "°C"}
FINE = ("ok", reach.BEYOND)
"""Verdicts of rows in which nothing is wrong."""
EXTRA_PLOTS = ("field_weakening.", "variables.", "recorder.", "recorder_")
"""Plots of a run that its page's curves do not show: how their names begin."""


def check(run: Run) -> list[Outcome]:
    """Every expectation of the scenario against the run."""
    return [outcome for expectation in run.scenario.expectations for outcome in expectation.check(run)]


def summary(run: Run, outcomes: list[Outcome], motor: str, board: str) -> dict[str, Any]:
    """All results as plain data."""
    scenario = run.scenario
    return clean({
        "scenario": scenario.name, "title": scenario.title, "motor": motor, "board": board, "defines": scenario.defines,
        "passed": all(outcome.ok for outcome in outcomes), "motor_seconds": run.motor_s, "wall_seconds": run.wall_s, "cpu_seconds": run.cpu_s,
        "speed_factor": run.speed_factor,
        "measures": [{"name": measure.name, "from_s": measure.from_s, "to_s": measure.to_s, "reference_rpm": measure.reference_rpm,
                      **run.measures[measure.name]} for measure in scenario.measures],
        "hand_overs": [{"at_s": item.at_s, "after_s2_s": item.after_s2_s, "overshoot_percent": item.overshoot_percent,
                        "lowest_rpm": item.lowest_rpm} for item in run.hand_overs()],
        "protocol": [{"at_s": at_s, "event": text} for at_s, text in run.protocol()],
        "expectations": [vars(outcome) for outcome in outcomes],
        "warnings": run.warnings, "variables": run.variables})


def clean(value: Any) -> Any:
    """The value with numbers that JSON does not know (infinite, not a number) replaced by None."""
    if isinstance(value, dict):
        return {key: clean(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [clean(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_table(folder: Path, name: str, keys: Sequence[str], rows: list[dict[str, Any]], outcomes: list[Outcome], head: dict[str, Any],
                more: dict[str, Any], fine: tuple[str, ...] = FINE) -> None:
    """What a table of many runs leaves: NAME.csv with the keys of each row, all of it in the summary, and the page, with the "picture" that
    a row may have; it is taken out of the row. `fine`: verdicts of rows in which nothing is wrong."""
    pictures = [row.pop("picture", None) for row in rows]
    output.write_csv(folder / f"{name}.csv", list(keys), [[row[key] for key in keys] for row in rows])
    data = {**head, "passed": all(outcome.ok for outcome in outcomes), "rows": rows,
            "expectations": [vars(outcome) for outcome in outcomes], **more}
    output.write_summary(folder, clean(data))
    used = head.get("motors", [head] if "header" in head else [])
    shown = page.Table("Runs", [*(_heading(key) for key in keys), "limited by"], [
        page.Row([*(_number(row[key]) for key in keys), limits_text(row.get("limited_percent", {})) or "-"],
                 bool(row.get("fault")) or row.get("verdict", fine[0]) not in fine, number if pictures[number] else None)
        for number, row in enumerate(rows)])
    page.write(folder, page.Page(f"{name}: {head['title']}", data["passed"], outcomes_count(outcomes),
                                 [line for item in used for line in used_lines(item)], [shown], pictures, [outcomes_table(outcomes)],
                                 more.get("plots", []), [f"{name}.csv", output.SUMMARY]))


def write_page(folder: Path, run: Run, outcomes: list[Outcome], data: dict[str, Any]) -> None:
    """The page of a single run, with all that summary() and used() tell of it."""
    shown = picture.of(run, picture.RUN_STRETCHES)
    rows = [page.Row([measure["name"], *(_cell(measure.get(key), form) for key, _, form in COLUMNS)]) for measure in data["measures"]]
    measures = page.Table("Measured", ["", *(" ".join(heading.split("\n")) for _, heading, _ in COLUMNS)], rows)
    events = page.Table("What happened", ["", "s", ""], [
        page.Row([str(number), f"{at_s:.4f}", text], at_s=at_s, bad=text.startswith("fault ") and text != "fault cleared")
        for number, (at_s, text) in enumerate(run.protocol(), 1)])
    page.write(folder, page.Page(
        f"{run.scenario.name}: {run.scenario.title}", data["passed"], outcomes_count(outcomes),
        used_lines(data) + notes(run),
        [*faults_table(run), *([measures] if rows else []), outcomes_table(outcomes)], [shown], [*limits_table(run), events],
        [name for name in data.get("plots", []) if name.startswith(EXTRA_PLOTS) or not page.draws()], sorted(file.name for file in folder.iterdir())))


def notes(run: Run) -> list[str]:
    """What a reader should know beside the results."""
    thinned = [f"the run is so long that its trace has one period of {run.trace.step}"] if run.trace.step > 1 else []
    return thinned + [f"warning of the board: {line}" for line in run.warnings]


def faults_table(run: Run) -> list[page.Table]:
    """The faults of a run, with cause and remedy."""
    known = {row.name: row for row in drive_tables.faults()}
    rows = [page.Row([f"{at_s:.4f}", name, *((known[name].cause, known[name].remedy) if name in known else ("", ""))], True, at_s=at_s)
            for _, at_s, name in run.raised()]
    return [page.Table("Faults", ["s", "fault", "cause", "remedy"], rows)] if rows else []


def limits_table(run: Run) -> list[page.Table]:
    """Why the output was limited, of the time with the bridge on."""
    if "fw.limits" not in run.trace:
        return []
    shares = limited_percent(run.trace)
    rows = [page.Row([row.name, f"{shares[row.name]:.1f} %", row.cause, row.remedy]) for row in drive_tables.limits() if row.name in shares]
    return [page.Table("Why the output was limited", ["reason", "of the time with the bridge on", "cause", "remedy"], rows)]


def outcomes_table(outcomes: list[Outcome]) -> page.Table:
    """The expectations, the failed ones first."""
    rows = [page.Row(["ok" if outcome.ok else "FAIL", outcome.row, outcome.got, outcome.allowed], not outcome.ok)
            for outcome in sorted(outcomes, key=lambda outcome: outcome.ok)]
    return page.Table("Expectations", ["", "what", "got", "allowed"], rows)


def outcomes_count(outcomes: list[Outcome]) -> str:
    """How many expectations hold."""
    return f"{sum(outcome.ok for outcome in outcomes)} of {len(outcomes)} expectations hold"


def _heading(key: str) -> str:
    """A key of a row as a heading: speed_error_percent becomes "speed error, %"."""
    name, _, unit = key.rpartition("_")
    return f"{name.replace('_', ' ')}, {UNITS[unit]}" if name and unit in UNITS else key.replace("_", " ")


def _number(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def table(rows: list[dict[str, Any]], columns: tuple = COLUMNS) -> str:
    """Rows of values under their headings; what is missing is a dash."""
    names = ["row"] + [row["name"] for row in rows]
    width = max(map(len, names))
    heads = [heading.split("\n") for _, heading, _ in columns]
    cells = [[_cell(row.get(key), form) for key, _, form in columns] for row in rows]
    widths = [max([len(part) for part in head] + [len(line[i]) for line in cells]) for i, head in enumerate(heads)]

    def joined(name: str, parts: list[str]) -> str:
        return "  ".join([name.ljust(width)] + [part.rjust(w) for part, w in zip(parts, widths)])

    lines = [joined(names[0], [head[0] for head in heads]), joined("", [head[1] for head in heads])]
    lines.append("-" * len(lines[0]))
    lines += [joined(name, line) for name, line in zip(names[1:], cells)]
    return "\n".join(line.rstrip() for line in lines)


def _cell(value: Any, form: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, dict):
        return limits_text(value) or "-"
    return value if isinstance(value, str) else form.format(value)


def limits_text(shares: dict[str, float]) -> str:
    """The reasons for a limit that held for a hundredth of the time or more."""
    return ", ".join(f"{name} {share:.0f} %" for name, share in shares.items() if share >= 1.0)


def outcomes_text(outcomes: list[Outcome]) -> str:
    """One line for each expectation, the failed ones marked."""
    if not outcomes:
        return "no expectations"
    width = max(len(outcome.row) for outcome in outcomes)
    lines = [f"{'ok  ' if outcome.ok else 'FAIL'}  {outcome.row.ljust(width)}  {outcome.got}  (allowed: {outcome.allowed})"
             for outcome in outcomes]
    return "\n".join(lines)


def used_text(data: dict[str, Any]) -> str:
    """Which motor and header a result was made with (command_common.used), and a note if they do not belong together."""
    return "\n".join(used_lines(data))


def used_lines(data: dict[str, Any]) -> list[str]:
    """The same in lines; none for data that does not tell."""
    if "header" not in data:
        return []
    lines = [f"motor   {data['motor']}: {data['motor_title']}", f"header  {data['header']}"]
    lines += [f"app     {data['app']}"] if data.get("app") else []
    return lines + ([f"note    {data['note']}"] if data["note"] else [])


def text(run: Run, outcomes: list[Outcome], data: dict[str, Any]) -> str:
    """The whole report of a run, as printed."""
    parts = [f"{run.scenario.name}: {run.scenario.title}"]
    if "header" in data:
        parts.append(used_text(data))
    if data["measures"]:
        parts.append(table(data["measures"]))
    parts.append("\n".join(f"{at_s:9.4f} s  {line}" for at_s, line in run.protocol()))
    if told := notes(run):
        parts.append("\n".join(told))
    parts.append(outcomes_text(outcomes))
    return "\n\n".join(parts)
