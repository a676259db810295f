"""`table2`: the eight rows of AN1292's Table 2 beside ours. The rows are data in tools/bench/scenarios/tables/table2.toml."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tools.common.errors import UserError
from . import case, report, simulate, sweep
from .expect import Outcome
from .scenario import BRAKE, Event
from .sweep import within


@dataclass(frozen=True)
class Row:
    """One row of AN1292's table, and what must hold for it."""

    reference_rpm: float
    torque_nm: float
    note_rpm: float
    note_current_a: float
    error_percent: float
    no_more_current: bool
    more_percent: float = 0.0
    """of current, for a header whose shorter period leaves less voltage"""


@dataclass(kw_only=True)
class Table(sweep.Table):
    """tables/table2.toml, with its columns as rows."""

    reference_rpm_where: str
    start_s: float = within(0.0)
    torque_from_s: float = within(0.0)
    torque_over_s: float = within(0.0)
    measure_from_s: float = within(0.0)
    measure_to_s: float = within(0.0)
    error_percent: float = within(0.0)
    reference_rpm: list[float] = within(1.0)
    torque_nm: list[float] = within(0.0)
    note_rpm: list[float] = within(0.0)
    note_current_a: list[float] = within(0.0)
    more_current_rpm: list[float] = within(0.0)
    note_period_us: float = within(10.0)
    shorter_period_percent: float = within(0.0)

    def __post_init__(self) -> None:
        if not self.start_s < self.torque_from_s < self.measure_from_s < self.measure_to_s:
            raise UserError("the times are not in order", self.where, "start_s < torque_from_s < measure_from_s < measure_to_s")
        self.same_lengths("reference_rpm", "torque_nm", "note_rpm", "note_current_a")
        self.rows = [Row(*cells, self.error_percent, cells[0] not in self.more_current_rpm)
                     for cells in zip(self.reference_rpm, self.torque_nm, self.note_rpm, self.note_current_a)]


class Table2(sweep.Sweep):
    """The sweep."""

    name, about, kind_of_table = "table2", "the eight rows of AN1292's Table 2 beside ours", Table
    columns = (
        ("torque_nm_set", "torque\nN m", "{:.3f}"), ("note_rpm", "note\nrpm", "{:.0f}"), ("speed_rpm", "ours\nrpm", "{:.1f}"),
        ("speed_error_percent", "error\n%", "{:+.2f}"), ("note_current_a", "note I\nA rms", "{:.3f}"),
        ("current_rms_a", "our I\nA rms", "{:.3f}"),
        ("angle_error_mean_deg", "angle err\nmean deg", "{:+.2f}"), ("angle_error_rms_deg", "angle err\nrms deg", "{:.2f}"),
        ("voltage_v", "voltage\nV", "{:.2f}"), ("voltage_percent", "of limit\n%", "{:.0f}"), ("limit", "\nlimited by", "{}"))
    keys = ("reference_rpm", *(key for key, _, _ in columns), "fault")

    def cases(self) -> list[Row]:
        """What must hold with a header of this period."""
        shorter = self.params["LOOPTIME_SEC"] < 0.99e-6 * self.table.note_period_us
        return [replace(row, more_percent=self.table.shorter_period_percent) if shorter else row for row in self.table.rows]

    def job(self, item: Row) -> simulate.Job:
        """A fresh start for a row."""
        table, where = self.table, self.table.reference_rpm_where
        events = case.start_events(table.start_s, item.reference_rpm, self.params.get("NOMINAL_SPEED_RPM", 0.0), where)
        events.append(Event(table.torque_from_s, "set", where, keys={BRAKE: item.torque_nm}, over_s=table.torque_over_s))
        scenario = case.scenario(f"{item.reference_rpm:g} rpm", table.title, events, item.reference_rpm, table.measure_from_s, table.measure_to_s)
        return simulate.prepare(scenario, self.library, self.motor, self.board)

    def row(self, item: Row, job: simulate.Job, result: dict[str, Any]) -> dict[str, Any]:
        """AN1292's numbers and ours."""
        return {"name": f"{item.reference_rpm:.0f} rpm", "reference_rpm": item.reference_rpm, "torque_nm_set": item.torque_nm,
                "note_rpm": item.note_rpm, "note_current_a": item.note_current_a, **result, "limit": case.limit_text(result)}

    def check(self, item: Row, row: dict[str, Any]) -> list[Outcome]:
        name, error = f"{item.reference_rpm:g} rpm, {item.torque_nm:g} N m", row["speed_error_percent"]
        got = f"{row['speed_rpm']:.1f} rpm" + (f", fault {row['fault']}" if row["fault"] else "")
        ok = error is not None and abs(error) <= item.error_percent and not row["fault"]
        outcomes = [Outcome(f"{name}: speed", ok, got, f"{item.reference_rpm:g} rpm +- {item.error_percent:g} %")]
        if item.no_more_current:
            current, most = row["current_rms_a"], item.note_current_a * (1.0 + 0.01 * item.more_percent)
            outcomes.append(Outcome(f"{name}: current", current is not None and current <= most, "nothing" if current is None else f"{current:.3f} A RMS",
                                    f"at most AN1292's {item.note_current_a:g} A" + (f" and {item.more_percent:g} %" if item.more_percent else "")))
        return outcomes

    def more(self, rows: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
        from . import plots
        return {"plots": plots.write_table2(rows, folder)}

    def text(self, rows: list[dict[str, Any]]) -> str:
        return f"{super().text(rows)}\n\n{report.outcomes_text(self.outcomes)}"
