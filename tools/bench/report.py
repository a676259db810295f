"""What a run leaves for people and programs: the summary as data (summary.json) and as text (table, protocol, expectations)."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tools.common import output
from .expect import Outcome
from .run import Run

COLUMNS = (
    ("reference_rpm", "reference\nrpm", "{:.0f}"), ("speed_rpm", "true\nrpm", "{:.1f}"),
    ("estimated_rpm", "estimated\nrpm", "{:.1f}"), ("speed_error_percent", "error\n%", "{:+.2f}"),
    ("current_rms_a", "phase I\nA rms", "{:.3f}"), ("torque_nm", "torque\nN m", "{:.4f}"),
    ("angle_error_mean_deg", "angle err\nmean deg", "{:+.2f}"), ("angle_error_rms_deg", "angle err\nrms deg", "{:.2f}"),
    ("voltage_v", "voltage\nV", "{:.2f}"), ("voltage_percent", "of limit\n%", "{:.0f}"))
"""Columns of the summary table: value, heading, format."""


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
        "protocol": [{"at_s": at_s, "event": text} for at_s, text in protocol(run)],
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
                more: dict[str, Any]) -> None:
    """What a table of many runs leaves: NAME.csv with the keys of each row, and all of it in the summary."""
    output.write_csv(folder / f"{name}.csv", list(keys), [[row[key] for key in keys] for row in rows])
    data = {**head, "passed": all(outcome.ok for outcome in outcomes), "rows": rows,
            "expectations": [vars(outcome) for outcome in outcomes], **more}
    output.write_summary(folder, clean(data))


def protocol(run: Run) -> list[tuple[float, str]]:
    """What happened and when: the operator's actions, the drive's states, faults."""
    entries = list(run.actions)
    hand_overs = {item.row: item for item in run.hand_overs()}
    for row, at_s, name in run.state_changes():
        text = f"state {name}"
        if row in hand_overs:
            item = hand_overs[row]
            text = f"closed loop {item.after_s2_s:.2f} s after S2, overshoot {item.overshoot_percent:.1f} %"
        entries.append((at_s, text))
    faults = run.fault_changes()
    entries += [(at_s, f"fault {name}" if code else "fault cleared") for (row, at_s, name), code in
                zip(faults, (run.trace.column("fw.fault")[row] for row, _, _ in faults)) if row > 0 or code]
    return sorted(entries, key=lambda entry: entry[0])


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
    return value if isinstance(value, str) else form.format(value)


def outcomes_text(outcomes: list[Outcome]) -> str:
    """One line for each expectation, the failed ones marked."""
    if not outcomes:
        return "no expectations"
    width = max(len(outcome.row) for outcome in outcomes)
    lines = [f"{'ok  ' if outcome.ok else 'FAIL'}  {outcome.row.ljust(width)}  {outcome.got}  (allowed: {outcome.allowed})"
             for outcome in outcomes]
    return "\n".join(lines)


def used_text(data: dict[str, Any]) -> str:
    """Which motor and header a result was made with (steps.used), and a note if they do not belong together."""
    lines = [f"motor   {data['motor']}: {data['motor_title']}", f"header  {data['header']}"]
    return "\n".join(lines + ([f"note    {data['note']}"] if data["note"] else []))


def text(run: Run, outcomes: list[Outcome], data: dict[str, Any]) -> str:
    """The whole report of a run, as printed."""
    parts = [f"{run.scenario.name}: {run.scenario.title}"]
    if "header" in data:
        parts.append(used_text(data))
    if data["measures"]:
        parts.append(table(data["measures"]))
    parts.append("\n".join(f"{at_s:9.4f} s  {line}" for at_s, line in protocol(run)))
    if run.warnings:
        parts.append("\n".join(f"warning of the board: {line}" for line in run.warnings))
    parts.append(outcomes_text(outcomes))
    return "\n\n".join(parts)
