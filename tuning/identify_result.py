"""The result of an identification: what was told, what the firmware measured, and how far that is from the truth."""

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.bench import report
from tools.common import board_file, motor_file, paths, x_macro
from tools.common.board_file import BoardFile
from tools.common.errors import UserError
from tools.common.motor_file import Motor
from tools.common.param_rows import number, parameters
from tools.common.toml_file import Document
from tools.common.trace import Trace

MODE = "IDENTIFY"
LIMITS_PERCENT = {"R": 3.0, "Ld": 5.0, "Lq": 5.0, "Kphi": 2.0, "J": 10.0, "friction": 10.0}
LEAST_FRICTION_STEPS = 5.0
"""Friction that takes less current than so many steps of the converter counts as that much: the limit is half a step. So does friction that
takes less than what a sample misses of the current, which is taken late: delay * back-EMF / L. A tenth of that is not known."""
SAMPLE_LATE_S = 25e-9 * number("SAMPLE_DELAY_CLOCKS")
FASTEST_ERPM, BEYOND_TOP = 30000.0, 1.25
"""IDENTIFY turns no rotor faster; usually the rated speed is 1.25 times the top speed of the measurement."""
CONVERTER_STEPS = 512
"""In the current's full scale."""
SALIENT = 0.03
"""Inductances that differ by less are one."""
COLUMNS = (("measured", "measured\n", "{}"), ("true", "true\n", "{}"), ("error_percent", "error\n%", "{:+.2f}"), ("limit_percent", "limit\n%", "{:g}"),
           ("verdict", "\nverdict", "{}"))


# ---- the firmware's own tables ---------------------------------------------------------------------------------------------
@functools.cache
def step_names() -> list[str]:
    """Names of the numbers in IdentifyParm.step."""
    return [name for name, _ in x_macro.rows("include", "drive/modes/identify.h", "IDENTIFY_STEP_TABLE", "#name meaning")]


@dataclass(frozen=True)
class Result:
    """How an identification ended."""

    name: str
    cause: str
    remedy: str


@functools.cache
def results() -> dict[int, Result]:
    """Meaning of the numbers in IdentifyParm.result."""
    table = x_macro.rows("include", "drive/modes/identify.h", "IDENTIFY_RESULT_TABLE", "#code #name cause remedy")
    return {int(code): Result(*texts) for code, *texts in table}


# ---- what was told, what was measured ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Known:
    """What somebody without a data sheet knows of a motor, or dares to try."""

    pole_pairs: int
    current_a: float
    speed_rpm: float

    @classmethod
    def of(cls, motor: Motor, board: BoardFile, current_a: float | None = None, speed_rpm: float | None = None) -> "Known":
        """From the rating: the rated current as far as the board allows it, and 40 % of the speed that the rating promises at this bus."""
        share = min(1.0, board.nominal_bus_v / motor.rated_voltage_v)
        return cls(motor.pole_pairs, current_a or min(motor.rated_current_a, 0.8 * trip_a(board), float(parameters()["Q_CURRENT_REF_OPENLOOP"].high)),
                   speed_rpm or max(50.0, min(0.4 * share * motor.rated_speed_rpm, 5000.0)))


def trip_a(board: BoardFile) -> float:
    """Over-current threshold that suits any motor."""
    return 0.86 * board.current_full_scale_a


@dataclass
class Measured:
    """What the firmware said, and when."""

    watch: dict[str, int]
    fault: str
    steps: list[tuple[float, int]]
    """Time and number of every change of the step."""
    trace: Trace
    motor_s: float = 0.0
    outputs_seen: float = 0.0
    """Outputs that were on in the last period."""


# ---- the comparison ---------------------------------------------------------------------------------------------------------
@dataclass
class Identified:
    """A motor, what was told, what was measured."""

    motor: Motor
    board: BoardFile
    known: Known
    header: str
    values: dict[str, float]
    measured: Measured

    @property
    def result(self) -> Result:
        return results()[self.measured.watch["result"]]

    @property
    def done(self) -> bool:
        return self.result.name == "DONE"

    @property
    def has_electrical(self) -> bool:
        """R, L and Kphi are valid, whether or not inertia and friction could be measured."""
        return self.result.name in ("DONE", "NOT_ACCELERATING", "INERTIA_RANGE", "FRICTION_RANGE")

    @property
    def has_inertia(self) -> bool:
        """The inertia is valid, whether or not the friction could be measured."""
        return self.result.name in ("DONE", "FRICTION_RANGE")

    @property
    def bridge_ohm(self) -> float:
        """What transistors and shunt add to a phase."""
        return self.board.rds_on_ohm + 0.5 * self.board.shunt_ohm

    @property
    def winding_ohm(self) -> float:
        return 1e-6 * self.measured.watch["Rs_uohm"] - self.bridge_ohm

    @property
    def inertia_kgm2(self) -> float:
        """Of all that turns."""
        return 1e-9 * self.measured.watch["J_1e9_kgm2"]

    def rows(self) -> list[dict[str, Any]]:
        """Measured and true values with the limits of the errors. The truth is the plant's, changes and temperature included."""
        watch, plant_now = self.measured.watch, self.values
        degrees = plant_now.get("motor.temp_c", 25.0) - 25.0
        rs_ohm = plant_now["motor.rs_ohm"] * (1.0 + plant_now["motor.r_tempco"] * degrees)
        kphi = 3.0 ** 0.5 * plant_now["motor.psi_vs"] * plant_now["motor.pole_pairs"] * 1000.0 * 2.0 * np.pi / 60.0
        kphi *= 1.0 + plant_now["motor.psi_tempco"] * degrees
        rows = [
            _row("R loop [mohm]", f"{1e-3 * watch['Rs_uohm']:.2f}", f"{1e3 * (rs_ohm + self.bridge_ohm):.2f}"),
            _row("R winding [mohm]", f"{1e3 * self.winding_ohm:.2f}", f"{1e3 * rs_ohm:.2f}", self.winding_ohm / rs_ohm, "R"),
            _row("Ld [uH]", f"{1e-3 * watch['Ld_nH']:.2f}", f"{1e6 * plant_now['motor.ld_h']:.2f}", 1e-9 * watch["Ld_nH"] / plant_now["motor.ld_h"], "Ld"),
            _row("Lq [uH]", f"{1e-3 * watch['Lq_nH']:.2f}", f"{1e6 * plant_now['motor.lq_h']:.2f}", 1e-9 * watch["Lq_nH"] / plant_now["motor.lq_h"], "Lq"),
            _row("Kphi [mV/krpm]", f"{1e-3 * watch['Kphi_uV_per_krpm']:.1f}", f"{1e3 * kphi:.1f}", 1e-6 * watch["Kphi_uV_per_krpm"] / kphi, "Kphi")]
        if self.has_inertia:
            rows.append(_row("J [1e-6 kg m2]", f"{1e6 * self.inertia_kgm2:.5g}", f"{1e6 * plant_now['mech.inertia_kgm2']:.5g}",
                             self.inertia_kgm2 / plant_now["mech.inertia_kgm2"], "J"))
        if self.done:
            rows += [self._friction_row(share, kphi) for share in (0.5, 1.0)]
        return rows

    def _friction_row(self, share: float, kphi: float) -> dict[str, Any]:
        """Friction at a share of the rated speed, or of the one that bus and firmware allow: what is far above all that was measured says nothing."""
        watch, plant_now = self.measured.watch, self.values
        allowed_rpm = min(1000.0 * self.board.nominal_bus_v / kphi, BEYOND_TOP * FASTEST_ERPM / self.motor.pole_pairs)
        speed_rpm = share * min(self.motor.rated_speed_rpm, allowed_rpm)
        speed_rad_s = speed_rpm * np.pi / 30.0
        true_nm = plant_now["mech.coulomb_nm"] + plant_now.get("load.constant_nm", 0.0)
        true_nm += speed_rad_s * (plant_now["mech.viscous_nms"] + plant_now.get("load.viscous_nms", 0.0))
        found_nm = 1e-8 * watch["Coulomb_1e8_Nm"] + 1e-9 * watch["Viscous_1e9_Nms"] * speed_rad_s
        kt_nm_per_a = kphi * 1.5 / (3.0 ** 0.5 * 1000.0 * np.pi / 30.0)
        missed_a = SAMPLE_LATE_S * kphi / 3.0 ** 0.5 * speed_rpm / 1000.0 / plant_now["motor.lq_h"]
        least_nm = max(LEAST_FRICTION_STEPS * self.board.current_full_scale_a / CONVERTER_STEPS, missed_a) * kt_nm_per_a
        name = "rated speed" if share == 1.0 else f"{100.0 * share:.0f} % of rated speed"
        if allowed_rpm < self.motor.rated_speed_rpm:
            name = f"{speed_rpm:.0f} rpm"
        return _row(f"friction at {name} [uN m]", f"{1e6 * found_nm:.0f}", f"{1e6 * true_nm:.0f}",
                    1.0 + (found_nm - true_nm) / max(true_nm, least_nm), "friction")

    def problems(self) -> list[str]:
        """What is wrong, one line each."""
        problems = []
        if not self.done:
            fault = f" (fault {self.measured.fault})" if self.measured.fault != "NONE" else ""
            problems = [f"{self.result.name}{fault}: {self.result.cause}: {self.result.remedy}"]
        if not self.has_electrical:
            return problems
        return problems + [f"{row['name']} is off by {row['error_percent']:+.2f} %, allowed are {row['limit_percent']:g} %"
                for row in self.rows() if row["verdict"] == "FAIL"]

    def paste(self, inertia_kgm2: float | None = None) -> str:
        """The lines for a motor file: line to line, which means the same in a star and in a delta. `inertia_kgm2`: the rotor's share"""
        watch = self.measured.watch
        source = f"measured with {MODE}, {self.known.current_a:.3g} A"
        ld_mh, lq_mh = 1e-6 * watch["Ld_nH"], 1e-6 * watch["Lq_nH"]
        lines = ["[electrical]", f'pole_pairs = {{ value = {self.known.pole_pairs}, source = "counted" }}',
                 f'resistance = {{ value = {2.0 * self.winding_ohm:.4g}, unit = "ohm line-to-line", at_degc = 25, source = "{source}" }}']
        if abs(ld_mh - lq_mh) <= SALIENT * ld_mh:
            lines.append(f'inductance = {{ value = {ld_mh + lq_mh:.4g}, unit = "mH line-to-line", source = "{source}" }}')
        else:
            lines.append(f'inductance_d = {{ value = {2.0 * ld_mh:.4g}, unit = "mH line-to-line", source = "{source}" }}')
            lines.append(f'inductance_q = {{ value = {2.0 * lq_mh:.4g}, unit = "mH line-to-line", source = "{source}" }}')
        lines.append(f'kphi = {{ value = {1e-6 * watch["Kphi_uV_per_krpm"]:.4g}, unit = "V peak line-to-line/krpm", at_degc = 25, '
                     f'source = "{source}, {self.known.speed_rpm:.4g} rpm" }}')
        lines += ["", "[mechanical]", f'inertia = {{ value = {inertia_kgm2 or self.inertia_kgm2:.4g}, unit = "kg m2", source = "{source}" }}' if self.has_inertia
                  else f"# inertia is missing: {self.result.name}, {self.result.cause}"]
        if self.done:
            lines += [f'viscous_friction = {{ value = {1e-9 * watch["Viscous_1e9_Nms"]:.4g}, unit = "N m s", source = "{source}" }}',
                      f'coulomb_friction = {{ value = {1e-5 * watch["Coulomb_1e8_Nm"]:.4g}, unit = "mN m", source = "{source}" }}']
        return "\n".join(lines)

    def file(self) -> str:
        """A whole motor file: what was measured, and the rating that was told."""
        motor, where = self.motor, f'source = "{paths.shown(self.motor.path)}"'
        rating = (("voltage", motor.rated_voltage_v, "V"), ("current", motor.rated_current_a, "A peak"), ("torque", motor.rated_torque_nm, "N m"),
                  ("speed", motor.rated_speed_rpm, "rpm"), ("maximum_speed", motor.maximum_speed_rpm, "rpm"),
                  ("maximum_current", motor.maximum_current_a, "A peak"))
        board = self.board.name if self.board.path.resolve().parent == paths.BOARDS else self.board.path.resolve()
        rotor = min(self.inertia_kgm2, motor.heaviest_kgm2)
        load = ["", "[load]", f'inertia = {{ value = {self.inertia_kgm2 - rotor:.4g}, unit = "kg m2" }}'] if self.has_inertia and rotor < self.inertia_kgm2 else []
        return "\n".join([f'title = "{motor.title}, as measured"', f'connection = "{motor.connection}"', f'board = "{board}"', "",
                          self.paste(rotor), "", "[rating]", *(f'{key} = {{ value = {value:.6g}, unit = "{unit}", {where} }}' for key, value, unit in rating), *load])

    def tuner(self) -> str:
        """Why `make tune` refuses the motor as it was measured; "" if it takes it."""
        from .design import design
        try:
            design(motor_file.read(Document(self.motor.path, self.file())), board_file.load(str(self.board.path)))
        except UserError as error:
            return error.lines[0]
        return ""

    def text(self) -> str:
        """The whole report, as printed."""
        known = self.known
        parts = [f"{self.motor.name}: {self.motor.title}",
                 f"told: {known.pole_pairs} pole pairs, {known.current_a:.3g} A, {known.speed_rpm:.4g} rpm; "
                 f"bridge of {self.board.name}: {1e3 * self.bridge_ohm:.1f} mohm (transistor, half of the shunt)",
                 "\n".join(f"{at_s:9.4f} s  {step_names()[number]}" for at_s, number in self.measured.steps[1:])]
        if self.has_electrical:
            parts += [report.table(self.rows(), COLUMNS), "The motor file (R without the bridge; note the winding's temperature):\n\n" + self.file()]
            refused = self.tuner()
            parts += [f"`make tune` refuses this motor: {refused}"] if refused else []
        if self.has_inertia:
            parts.append(f"For userparams.h, a load's inertia comes on top:\n\n#define MOTOR_INERTIA_KGM2 {self.inertia_kgm2:.4g}")
        return "\n\n".join(parts)

    def data(self) -> dict[str, Any]:
        names = step_names()
        return {"motor": str(paths.shown(self.motor.path)), "board": str(paths.shown(self.board.path)), "result": self.result.name,
                "fault": self.measured.fault, "watch": self.measured.watch, "bridge_ohm": self.bridge_ohm, "rows": self.rows() if self.has_electrical else [],
                "steps": [{"at_s": round(at_s, 4), "step": names[number]} for at_s, number in self.measured.steps],
                "told": {"pole_pairs": self.known.pole_pairs, "current_a": self.known.current_a, "speed_rpm": self.known.speed_rpm}}


def _row(name: str, measured: str, true: str, ratio: float | None = None, limit: str = "") -> dict[str, Any]:
    error, allowed, verdict = None, None, None
    if ratio is not None:
        error, allowed = 100.0 * (ratio - 1.0), LIMITS_PERCENT[limit]
        verdict = "PASS" if abs(error) <= allowed else "FAIL"
    return {"name": name, "measured": measured, "true": true, "error_percent": error, "limit_percent": allowed, "verdict": verdict}
