"""The search for the field-weakening tables: AN1292's procedure, one entry after the other, on a bench that runs the motor.

Order, as in AN1292: d current first; then, only where the angle error asks for it, Ls and last 1/Kphi. The least d current is the one
with which the voltage stays a margin inside the circle at the entry's load, because the voltage is what ends every other way: the
q current cannot follow, the speed falls, and with the reference ahead of the speed the tables no longer fit.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from tools.common.errors import UserError
from tools.common.param_rows import phase_ohm

from .fw_bench import Bench, Fault, Point
from .fw_tables import ENTRIES, STEP_ERPM, Entry
from .limits import halved

STEP_A = 0.01
"""Resolution of a d current in the table."""
LOAD_SHARES = tuple(step / 10.0 for step in range(10, -1, -1))
START_STEP_RPM = 10.0
LS_RANGE, KFI_RANGE = (0.1, 0.6), (1024.0, 32767.0)
RETRIES, ROUNDS = 4, 3
LOST_DEG = 90.0


@dataclass(frozen=True)
class Goal:
    """What a table must do. `load_nm(rpm)` is the load on top of the motor's friction that the d current of an entry makes room for."""

    use: float                     # largest share of the voltage limit
    angle_deg: float               # largest mean angle error before Ls and 1/Kphi are touched
    limit_a: float                 # largest d current
    rated_a: float                 # above it d current is spent on speed only, not on room for a load
    rated_torque_nm: float
    rated_speed_rpm: float
    torque_share: float            # of the rated torque up to rated speed, falling with 1/speed above
    maximum_rpm: float             # what the user wants to reach

    def load_nm(self, rpm: float) -> float:
        return self.torque_share * self.rated_torque_nm * min(1.0, self.rated_speed_rpm / rpm)


@dataclass
class Found:
    """One entry with what was measured at it: without load, and at its load."""

    index: int
    rpm: float
    entry: Entry
    load_nm: float
    free: Point
    loaded: Point
    corrected: bool = False


@dataclass
class Result:
    """What the search has found; `found[0]` is the start speed without d current."""

    start_rpm: float
    needed: bool = True
    found: list[Found] = field(default_factory=list)
    stopped: str = ""
    beyond: Entry | None = None    # for the entries above the last: what takes the motor furthest there

    def entries(self) -> list[Entry]:
        """All 18: the found ones, and above them as much current as helps, or the last."""
        entries = [found.entry for found in self.found]
        return entries + [self.beyond or entries[-1]] * (ENTRIES - len(entries))


# ---- pure parts --------------------------------------------------------------------------------------------------------------
def least(good: Callable[[int], bool], guess: int, low: int, high: int) -> int | None:
    """The smallest n in low .. high for which good(n), if good() is false below it and true above; None if it is false at `high`.

    From the guess it goes in growing steps to where the answer changes, and halves what is left. Each n is asked for once.
    """
    guess = min(max(guess, low), high)
    bad, enough, step = low - 1, high + 1, 4
    n = guess
    while True:
        if good(n):
            enough = n
            n = max(n - step, bad + 1)
        else:
            bad = n
            n = min(n + step, enough - 1)
        if enough == low or bad == high or bad >= low and enough <= high:
            break
        step *= 2
    if bad == high:
        return None
    while enough - bad > 1:
        middle = (bad + enough) // 2
        bad, enough = (bad, middle) if good(middle) else (middle, enough)
    return enough


def peak(value: Callable[[int], float], known: dict[int, float], low: int, high: int, step: int = 4) -> int:
    """Where value() is largest in low .. high, to about `step`, if it rises and then falls; `known` holds what was asked already.

    The wider of the two gaps beside the best is halved until both are small.
    """
    for n in (low, high):
        if n not in known:
            known[n] = value(n)
    while True:
        order = sorted(n for n in known if low <= n <= high)
        place = max(range(len(order)), key=lambda i: (known[order[i]], -order[i]))
        best = order[place]
        gaps = [(best - order[place - 1], (best + order[place - 1]) // 2)] if place > 0 else []
        gaps += [(order[place + 1] - best, (best + order[place + 1]) // 2)] if place + 1 < len(order) else []
        wide = max(gaps, default=(0, best))
        if wide[0] <= step:
            return best
        known[wide[1]] = value(wide[1])


def largest(good: Callable[[float], bool], limit: float, steps: int) -> float:
    """The largest value in 0 .. limit with good(value), to limit / 2^steps; 0 if there is none. Halving; 0 itself is not asked for."""
    return limit if good(limit) else halved(good, 0.0, limit, steps)


def model_use(params: dict[str, float], rpm: float, id_a: float, iq_a: float, ls_ratio: float = 0.5) -> float:
    """Voltage in steady state as a share of the circle at the nominal bus, by the parameters of userparams.h:
    vd = R id - w L iq, vq = R iq + w (L id + psi)."""
    pairs, ls_h = params["NOPOLESPAIRS"], params["MOTOR_LS_MH"] * 1e-3 * 2.0 * ls_ratio
    w = rpm * pairs * 2.0 * math.pi / 60.0
    v_d = phase_ohm(params) * id_a - w * ls_h * iq_a
    v_q = phase_ohm(params) * iq_a + w * (ls_h * id_a + flux_vs(params))
    return math.hypot(v_d, v_q) / voltage_limit(params)


def flux_vs(params: dict[str, float]) -> float:
    """Flux linkage of a phase from Kphi, V peak line to line per 1000 rpm."""
    return params["MOTOR_KPHI_V_PER_KRPM"] / (math.sqrt(3.0) * 1000.0 * 2.0 * math.pi / 60.0 * params["NOPOLESPAIRS"])


def torque_per_ampere(params: dict[str, float]) -> float:
    return 1.5 * params["NOPOLESPAIRS"] * flux_vs(params)


def voltage_limit(params: dict[str, float]) -> float:
    """Radius of the voltage circle at the nominal bus."""
    return (1.0 - 2.0 * params["SAMPLE_WINDOW_SEC"] / params["LOOPTIME_SEC"]) * params["NOMINAL_BUS_V"] / math.sqrt(3.0)


def model_current(params: dict[str, float], rpm: float, iq_a: float, use: float, limit_a: float) -> float:
    """Least d current (as a positive number) for a voltage use; the limit if even that is too little."""
    n = least(lambda n: model_use(params, rpm, -n * STEP_A, iq_a) <= use, 0, 0, max(0, round(limit_a / STEP_A)))
    return limit_a if n is None else n * STEP_A


def correction(errors: list[float], slopes: list[float]) -> float:
    """Change of one quantity that makes the errors smallest (least squares), given how each of them changes with it."""
    size = sum(slope * slope for slope in slopes)
    return 0.0 if size == 0.0 else -sum(error * slope for error, slope in zip(errors, slopes)) / size


def worst(errors: list[float]) -> float:
    return max(abs(error) for error in errors)


# ---- the search --------------------------------------------------------------------------------------------------------------
class Search:
    """One motor's search. `tell(index, rpm, text)` hears where it is."""

    def __init__(self, motor: Bench, goal: Goal, tell: Callable[[int, float, str], None] = lambda index, rpm, text: None,
                 entries: int = ENTRIES) -> None:
        self.motor, self.goal, self.tell = motor, goal, tell
        self.params = motor.params
        self.count = entries
        self.flat = Entry(0.0, self.params["INVKFI_SPEED0"], 0.5)
        self.rpm = 0.0
        self.index = 0
        self.safe = self.flat      # an entry that held the present speed
        self.below_rpm = 0.0
        self.last: Point | None = None
        self.rpm_now = 0.0         # the speed at which the motor is; 0: unknown
        self.limit = math.floor(goal.limit_a / STEP_A + 1e-9)
        self.rated = math.floor(goal.rated_a / STEP_A + 1e-9)
        self.tried = self.flat     # the last entry that an entry's search looked at
        self.most = self.limit     # the d current that gives most speed where nothing suffices

    def run(self) -> Result:
        """The whole search. The motor runs at the end."""
        motor, goal = self.motor, self.goal
        motor.set("FW_TRIM_CURRENT_A", 0.0) # the tables have to carry the load
        motor.entries_from(0, self.flat)
        motor.start()
        start_rpm = self.start_speed()
        result = Result(start_rpm, start_rpm < min(goal.maximum_rpm, self.params["MAXIMUM_SPEED_RPM"]), [self.first(start_rpm)])
        if not result.needed:
            result.stopped = f"no field weakening is needed up to {start_rpm:.0f} rpm"
            return result
        motor.set("FW_START_SPEED_RPM", start_rpm)
        self.below_rpm = start_rpm
        for index in range(1, self.count):
            rpm = start_rpm + index * STEP_ERPM / self.params["NOPOLESPAIRS"]
            if rpm > self.params["MAXIMUM_SPEED_RPM"]:
                result.stopped = f"the number format of speeds ends at {self.params['MAXIMUM_SPEED_RPM']:.0f} rpm"
                break
            found = self.entry(index, rpm, result)
            if found is None:
                result.stopped = self.reason(rpm)
                result.beyond = _with_current(self.tried, max(self.most if self.falls_off() else self.limit, current_steps(self.tried)))
                break
            result.found.append(found)
            self.below_rpm = rpm
        else:
            result.stopped = "the table ends"
        return result

    # ---- where it begins
    def start_speed(self) -> float:
        """Highest speed whose voltage suffices without d current at the load; the maximum speed if that is lower."""
        low = max(self.params["END_SPEED_RPM"], self.params["MINIMUM_SPEED_RPM"], 100.0)
        high = min(self.goal.maximum_rpm, self.params["MAXIMUM_SPEED_RPM"])
        self.safe = self.flat

        def enough(step: int) -> bool:
            rpm = max(high - step * START_STEP_RPM, low)
            self.tell(0, rpm, "no d current")
            return self.good(rpm, self.flat, self.goal.load_nm(rpm))

        steps = math.ceil((high - low) / START_STEP_RPM)
        use = self.goal.use
        guess = next((n for n in range(steps) if model_use(self.params, high - n * START_STEP_RPM, 0.0,
                     self.goal.load_nm(high - n * START_STEP_RPM) / torque_per_ampere(self.params)) <= use), steps)
        step = least(enough, guess, 0, steps)
        return low if step is None else high - step * START_STEP_RPM

    def first(self, rpm: float) -> Found:
        """Entry 0: no d current, and the motor's own Ls and 1/Kphi, because it counts for all speeds below."""
        load_nm = self.goal.load_nm(rpm)
        points = []
        for load in (0.0, load_nm):
            self.good(rpm, self.flat, load)
            if self.last is None:
                raise UserError(f"the motor loses its lock at {rpm:.0f} rpm, below field weakening", "",
                                "check MOTOR_RS_OHM, MOTOR_LS_MH and MOTOR_KPHI_V_PER_KRPM")
            points.append(self.last)
        return Found(0, rpm, self.flat, load_nm, *points)

    # ---- one entry
    def entry(self, index: int, rpm: float, result: Result) -> Found | None:
        """The least d current at one entry, for as much of the load as the rated current allows; for none of it up to the limit."""
        self.index, self.rpm = index, rpm
        before = result.found[-1]
        low = current_steps(before.entry)
        shares = [share for share in LOAD_SHARES if share * self.goal.load_nm(rpm) <= before.load_nm + 1e-9]
        for share in shares:
            high = max(low, min(self.rated, self.limit)) if share > 0.0 else self.limit
            found = self.at_load(index, rpm, share * self.goal.load_nm(rpm), before.entry, low, high)
            if found is not None:
                return found
        return None

    def at_load(self, index: int, rpm: float, load_nm: float, base: Entry, low: int, high: int) -> Found | None:
        entry, corrected = self.tuned(rpm, load_nm, base, low, high)
        for _ in range(RETRIES):
            if entry is None:
                return None
            self.tell(index, rpm, f"{entry.idref_a:.2f} A, over the entry and a load step")
            if self.survives(rpm, entry, load_nm):
                self.good(rpm, entry, 0.0)
                free = self.last
                self.good(rpm, entry, load_nm)
                if free is not None and self.last is not None:
                    return Found(index, rpm, entry, load_nm, free, self.last, corrected)
            entry = _with_current(entry, current_steps(entry) + 3) if current_steps(entry) + 3 <= high else None
        return None

    def tuned(self, rpm: float, load_nm: float, base: Entry, low: int, high: int) -> tuple[Entry | None, bool]:
        """Least current, then the angle, then the current again, for each changes the other; None if no current is enough."""
        entry, corrected = base, False
        for _ in range(ROUNDS):
            n = self.least_current(rpm, load_nm, entry, low, high)
            # Where no current is enough because the angle is wrong, most current shows most of what is wrong.
            entry = self.tried = _with_current(entry, high if n is None else n)
            if worst(self.angles(entry, load_nm if n is not None else 0.0)) <= self.goal.angle_deg:
                return (entry if n is not None else None), corrected
            better = self.corrected(entry, load_nm if n is not None else 0.0)
            if better == entry:
                return (entry if n is not None else None), corrected
            entry, corrected = better, True
        n = self.least_current(rpm, load_nm, entry, low, high)
        self.tried = entry
        return (None if n is None else _with_current(entry, n)), corrected

    def least_current(self, rpm: float, load_nm: float, base: Entry, low: int, high: int) -> int | None:
        iq_a = load_nm / torque_per_ampere(self.params)
        guess = round(model_current(self.params, rpm, iq_a, self.goal.use, self.goal.limit_a) / STEP_A)
        self.safe = _with_current(base, min(max(guess + 15, low), high))
        tried: dict[int, float] = {}
        enough: set[int] = set()

        def reach(n: int) -> float:
            """How far a current takes the motor: by its speed where the voltage is used up, beyond that by the voltage that is free."""
            entry = _with_current(base, n)
            if self.good(rpm, entry, load_nm):
                enough.add(n)
                self.safe = entry
            self.tell(self.index, rpm, f"{entry.idref_a:.2f} A {'holds' if n in enough else 'does not hold'}; best {self.safe.idref_a:.2f} A")
            tried[n] = 0.0 if self.last is None else min(1.0, self.last.speed_rpm / self.last.reference_rpm) + 1.0 - self.last.use
            return tried[n]

        def good(n: int) -> bool:
            if n not in tried:
                reach(n)
            return n in enough

        n = least(good, guess, low, high)
        if n is None:
            self.most = peak(reach, tried, low, high, max(4, (high - low) // 20))
            if self.most in enough:
                n = least(good, self.most, low, self.most)
        return n

    def falls_off(self) -> bool:
        """Did the last search see the speed fall again with more current?"""
        return self.most < 0.95 * self.limit

    def reason(self, rpm: float) -> str:
        if self.falls_off():
            return f"{rpm:.0f} rpm: more d current than {self.most * STEP_A:.2f} A gives no more speed"
        return f"{rpm:.0f} rpm: the d current limit of {self.goal.limit_a:.2f} A does not hold it"

    # ---- the angle
    def angles(self, entry: Entry, load_nm: float) -> list[float]:
        """Mean angle errors without load and at it."""
        errors = []
        for load in (0.0, load_nm) if load_nm > 0.0 else (0.0,):
            self.good(self.rpm, entry, load)
            errors.append(LOST_DEG if self.last is None else self.last.angle_deg)
        return errors

    def corrected(self, entry: Entry, load_nm: float) -> Entry:
        """Ls, and if that is not enough 1/Kphi, such that the angle errors are smallest; unchanged where nothing helps."""
        errors = self.angles(entry, load_nm)
        for name, step, bounds in (("ls_ratio", -0.02, LS_RANGE), ("inv_kfi", -0.02 * self.flat.inv_kfi, KFI_RANGE)):
            for _ in range(3):
                if worst(errors) <= 0.5 * self.goal.angle_deg:
                    return entry
                value = getattr(entry, name)
                tried = self.angles(_with(entry, name, value + step, bounds), load_nm)
                slopes = [(b - a) / step for a, b in zip(errors, tried)]
                change = correction(errors, slopes)
                better = _with(entry, name, value + max(-5.0 * abs(step), min(5.0 * abs(step), change)), bounds)
                result = self.angles(better, load_nm)
                self.tell(self.index, self.rpm, f"{name} {getattr(better, name):g}: angle error {worst(result):.1f} deg")
                if worst(result) >= worst(errors) - 0.05:
                    break
                entry, errors = better, result
        return entry

    # ---- asking the motor
    def good(self, rpm: float, entry: Entry, load_nm: float) -> bool:
        """Does the entry hold speed, lock and voltage at this load? `last` keeps what was measured."""
        motor = self.motor
        self.last = None
        try:
            self.approach(rpm)
            motor.entries_from(self.index, entry)
            motor.settle()
            motor.load(load_nm)
            motor.settle()
            self.last = motor.point()
        except Fault:
            motor.load(0.0)
            self.rpm_now = 0.0
            return False
        held = self.last.held and self.last.use <= self.goal.use
        if not self.last.held:
            self.back()
        return held

    def approach(self, rpm: float) -> None:
        """To the entry's speed without load, with an entry that is known to hold it or likely to."""
        motor = self.motor
        motor.load(0.0)
        if self.rpm_now == rpm:
            return
        motor.entries_from(self.index, self.safe)
        if self.rpm_now == 0.0 and motor.stopped():
            motor.start()
        self.rpm_now = 0.0
        motor.speed(rpm)
        motor.regain()
        self.rpm_now = rpm

    def back(self) -> None:
        """After an entry that did not hold: unload, and wait until the speed is there again."""
        self.motor.load(0.0)
        self.motor.entries_from(self.index, self.safe)
        if not self.motor.regain():
            self.rpm_now = 0.0

    def survives(self, rpm: float, entry: Entry, load_nm: float) -> bool:
        """From the entry below to this one with its load, held half-way too, where the table is interpolated; then the load off and on."""
        motor, below_rpm = self.motor, self.below_rpm
        self.safe = entry
        try:
            self.approach(rpm)
            motor.entries_from(self.index, entry)
            motor.speed(below_rpm)
            motor.load(load_nm)
            self.rpm_now = 0.0
            if not (motor.speed(0.5 * (below_rpm + rpm)) and motor.point().held and motor.speed(rpm)):
                motor.load(0.0)
                return False
            self.rpm_now = rpm
            for torque in (load_nm, 0.0, load_nm):
                motor.load(torque)
                motor.settle()
            point = motor.point()
        except Fault:
            self.rpm_now = 0.0
            return False
        if not point.held:
            self.back()
        return point.held and abs(point.angle_deg) < LOST_DEG / 3.0


def current_steps(entry: Entry) -> int:
    return round(-entry.idref_a / STEP_A)


def _with_current(entry: Entry, steps: int) -> Entry:
    return replace(entry, idref_a=round(-steps * STEP_A, 4) if steps else 0.0)


def _with(entry: Entry, name: str, value: float, bounds: tuple[float, float]) -> Entry:
    value = min(max(value, bounds[0]), bounds[1])
    return replace(entry, **{name: round(value) if name == "inv_kfi" else round(value, 4)})
