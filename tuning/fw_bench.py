"""A motor on the virtual board whose field-weakening tables change while it turns: speed, load and table entries in, measured points out."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tools.bench import build
from tools.bench.board import Board, Library
from tools.bench.panel import Ranges
from tools.bench.scenario import start_time_s
from tools.common import paths
from tools.common.errors import UserError
from tools.common.trace import wrapped_deg

from .fw_tables import ENTRIES, Entry

SPEED_SHARE = 0.005
"""A speed is held when its mean is within this share of the reference."""
SIGNALS = ("plant.speed_rpm", "plant.theta_e_deg", "plant.i_d", "plant.i_q", "fw.theta_est_deg", "fw.v_d_v", "fw.v_q_v", "fw.v_limit_v",
           "fw.id_ref_a", "fw.id_trim_a", "bus.voltage_v")
DECIMATION = 3
START_S = 8.0
"""Patience with a start beyond its lock and ramp."""
REMEDY = {"START_FAILED": "the motor does not follow the ramp: raise Q_CURRENT_REF_OPENLOOP, or lower OPENLOOP_RAMPSPEED_INCREASERATE",
          "STALL": "raise Q_CURRENT_REF_OPENLOOP or END_SPEED_RPM",
          "LOST_LOCK": "check MOTOR_RS_OHM, MOTOR_LS_MH and MOTOR_KPHI_V_PER_KRPM",
          "OVERCURRENT_SW": "lower CURRENT_BANDWIDTH_HZ in [tune]; the trip level follows [rating] maximum_current and the board's range",
          "OVERCURRENT_HW": "lower CURRENT_BANDWIDTH_HZ, or raise inverter.trip_a of the board file",
          "UNDERVOLTAGE": "check the supply in the board file", "OVERVOLTAGE": "lower REGEN_LIMIT_V or SPEEDREFRAMP_RPM_PER_S"}


def built(folder: Path, header: str, defines: list[str]) -> Path:
    """The virtual board with the firmware for this header, whose text is kept in `folder`: built anew only where it has changed."""
    path = folder / build.HEADER
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.is_file() or path.read_text(encoding="utf-8") != header:
            path.write_text(header, encoding="utf-8")
    except OSError as error:
        raise UserError(f"cannot write '{paths.shown(path)}' ({error.strerror})", "", "free some space, or make build/ writable") from None
    return build.library(defines, folder)


@dataclass(frozen=True)
class Point:
    """Means over a stretch of steady running; `use` is the commanded voltage as a share of its limit."""

    speed_rpm: float
    reference_rpm: float
    use: float
    angle_deg: float
    id_a: float
    iq_a: float
    current_rms_a: float
    trim_a: float
    bus_v: float

    @property
    def held(self) -> bool:
        return abs(self.speed_rpm - self.reference_rpm) <= SPEED_SHARE * self.reference_rpm


class Fault(Exception):
    """The drive stopped by itself; the text is the fault's name."""


class Bench:
    """One board in this process. Speeds in mechanical rpm; loads in N m on top of the motor's own friction."""

    def __init__(self, library: Path, values: dict[str, float], report: Callable[[float], None] = lambda seconds: None,
                 risks: str = "") -> None:
        """`risks`: what the tuner has said may keep the motor from starting; it knows better than the fault what to change."""
        self.library = Library(library)
        self.params = self.library.params
        self.states, self.faults = self.library.states, self.library.faults
        self.ranges = Ranges.of(self.params, [])
        self.report = report
        self.risks = risks
        self.motor_s = 0.0
        self.fast = False
        self.target_rpm = 0.0
        self.load_nm = 0.0
        # two periods of the speed loop's bandwidth, and the angle's filters
        self.settle_s = 0.12 + 1.5 / self.params["SPEED_BANDWIDTH_HZ"]
        self.measure_s = 0.12
        self.board = Board(self.library)
        for key, value in values.items():
            self.board.set(key, value)
        self.board.power_up()
        self.run(0.1)

    def close(self) -> None:
        self.board.close()

    # ---- time ---------------------------------------------------------------------------------------------------------
    def run(self, seconds: float) -> None:
        self.board.run(max(1, round(seconds / self.params["LOOPTIME_SEC"])))
        self.motor_s += seconds
        self.report(seconds)

    def state(self) -> str:
        return self.states.get(int(self.board.get("fw.state")), "?")

    def fault(self) -> str:
        """Name of the present fault; "" while all is well."""
        code = int(self.board.get("fw.fault"))
        return self.faults.get(code, f"code {code}") if code else ""

    def check(self) -> None:
        if fault := self.fault():
            raise Fault(fault)

    # ---- the operator ---------------------------------------------------------------------------------------------------
    def press(self, button: str) -> None:
        self.board.set(f"input.{button}", 1.0)
        self.run(0.06)
        self.board.set(f"input.{button}", 0.0)
        self.run(0.03)

    def start(self) -> None:
        """From standstill to closed loop at the lowest speed. A motor that does not start is the user's to cure."""
        self.load(0.0)
        if self.fault():
            self.press("s2")
            self.run(0.1)
        self.board.set("state.speed_rpm", 0.0)
        self.board.set("input.pot", self.ranges.pot_for_speed(max(self.params["END_SPEED_RPM"], self.ranges.minimum_rpm), False))
        self.fast = False
        self.press("s2")
        waited, patience_s = 0.0, START_S + start_time_s(self.params)
        while self.state() != "CLOSED":
            if self.fault() or waited > patience_s:
                fault = self.fault() or "no fault"
                raise UserError(f"the motor does not start ({fault} in state {self.state()} after {waited:.1f} s)", "",
                                self.risks or REMEDY.get(fault, "run `make run` for this motor and look at its plots"))
            self.run(0.05)
            waited += 0.05
        self.target_rpm = max(self.params["END_SPEED_RPM"], self.ranges.minimum_rpm)
        self.run(0.5)

    def load(self, torque_nm: float) -> None:
        self.board.set("load.constant_nm", max(0.0, torque_nm))
        self.load_nm = torque_nm

    def speed(self, rpm: float) -> bool:
        """Ramp to a speed; False if the motor does not get there. Faults are raised."""
        rpm = min(max(rpm, self.ranges.minimum_rpm), self.ranges.maximum_rpm)
        fast = rpm > self.ranges.nominal_rpm
        if fast != self.fast:
            self._switch(fast)
        self.board.set("input.pot", self.ranges.pot_for_speed(rpm, fast))
        self.run(0.1) # the potentiometer's filter
        patience_s = 2.0 * abs(self.board.get("fw.speed_ref_rpm") - rpm) / self.params["SPEEDREFRAMP_RPM_PER_S"] + 1.0
        while patience_s > 0.0:
            self.check()
            self.target_rpm = self.board.get("fw.speed_target_rpm")
            if abs(self.board.get("fw.speed_ref_rpm") - self.target_rpm) < 1.0:
                self.run(self.settle_s)
                self.check()
                return True
            self.run(0.05)
            patience_s -= 0.05
        return False

    def _switch(self, fast: bool) -> None:
        """S3, with the potentiometer where both ranges mean the nominal speed."""
        ends = (1.0, 0.0) if fast else (0.0, 1.0)
        self.board.set("input.pot", ends[0])
        self.run(0.1)
        before = self.board.get("fw.speed_target_rpm")
        self.board.set("input.s3", 1.0)
        for _ in range(60):
            self.run(0.001)
            if abs(self.board.get("fw.speed_target_rpm") - before) > 20.0:
                break
        self.board.set("input.pot", ends[1])
        self.board.set("input.s3", 0.0)
        self.run(0.05)
        self.fast = fast

    def stopped(self) -> bool:
        return self.state() != "CLOSED"

    def settle(self) -> None:
        self.run(self.settle_s)
        self.check()

    def regain(self, patience_s: float = 3.0) -> bool:
        """Waits until the speed is at its reference; after a time at the voltage limit the speed controller has to unwind first."""
        reference = self.board.get("fw.speed_target_rpm")
        calm = 0
        while patience_s > 0.0:
            self.run(0.05)
            self.check()
            patience_s -= 0.05
            calm = calm + 1 if abs(self.board.get("plant.speed_rpm") - reference) <= SPEED_SHARE * reference else 0
            if calm == 3:
                return True
        return False

    # ---- tables ----------------------------------------------------------------------------------------------------------
    def entry(self, index: int, entry: Entry) -> None:
        self.board.write_parameter(f"IDREF_SPEED{index}", entry.idref_a)
        self.board.write_parameter(f"INVKFI_SPEED{index}", entry.inv_kfi)
        self.board.write_parameter(f"LS_OVER2LS0_SPEED{index}", entry.ls_ratio)

    def entries_from(self, index: int, entry: Entry) -> None:
        """The same for an entry and all above it, so that what lies above cannot matter."""
        for above in range(index, ENTRIES):
            self.entry(above, entry)

    def set(self, name: str, value: float) -> None:
        self.board.write_parameter(name, value)

    # ---- measuring -------------------------------------------------------------------------------------------------------
    def point(self, seconds: float | None = None) -> Point:
        """Means over `seconds` of running. Faults are raised."""
        self.board.trace_start(list(SIGNALS), DECIMATION)
        self.run(seconds or self.measure_s)
        rows = self.board.trace_take().astype(np.float64)
        self.board.trace_start([], 1)
        self.check()
        return reduced(rows, self.target_rpm)


def reduced(rows: np.ndarray, reference_rpm: float) -> Point:
    """The point that rows of SIGNALS make."""
    column = {name: rows[:, number] for number, name in enumerate(SIGNALS)}
    length = np.hypot(column["fw.v_d_v"], column["fw.v_q_v"])
    error = wrapped_deg(column["fw.theta_est_deg"] - column["plant.theta_e_deg"])
    squares = column["plant.i_d"] ** 2 + column["plant.i_q"] ** 2
    mean = lambda name: float(np.mean(column[name])) # noqa: E731
    return Point(mean("plant.speed_rpm"), reference_rpm, float(np.mean(length / column["fw.v_limit_v"])), float(np.mean(error)),
                 mean("plant.i_d"), mean("plant.i_q"), math.sqrt(float(np.mean(squares)) / 2.0),
                 mean("fw.id_trim_a"), mean("bus.voltage_v"))

