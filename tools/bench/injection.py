"""What may break, and how it must end: one table of kinds of faults, and the cases that a seed draws from it.

A kind's size is a share of what the motor at hand is rated for; its keys are the virtual board's. `ends` are the faults of the drive that name
it rightly: any of them, or riding through, is a good end."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace

from tools.common import param_rows

from .judge import Unseen
from .scenario import BRAKE

Keys = dict[str, float]
SIDES = ("a", "b")
TRANSISTORS = ("A low", "A high", "B low", "B high", "C low", "C high")
OVERCURRENT = ("OVERCURRENT_SW", "OVERCURRENT_HW")
NO_TURN = ("STALL", "LOST_LOCK", "START_FAILED")
"""A shaft that stops within a period drives the current over its limit, so an over-current names a block as well."""


@dataclass(frozen=True)
class Rating:
    """What the sizes are shares of."""

    current_a: float
    torque_nm: float
    bus_v: float
    rs_ohm: float
    psi_vs: float
    crystal_hz: float
    inertia_kgm2: float = 0.0
    speed_rpm: float = 0.0
    """the slowest reference from when it happens on, at least the lowest that there is"""
    dead_rpm: float = 0.0
    """from which deviation of the speed on dead time cannot be behind it (PARAM_LARGE_ERPM)"""
    start_dead: float = 0.0
    """dead time's voltage, as a share of what the start's current drives through R"""


@dataclass(frozen=True)
class Kind:
    """One row. `draw` gives size and place; `keys` what is set for them. `limits`: a speed below the reference is right where the drive says
    which limit holds it back."""

    room: str
    name: str
    ends: tuple[str, ...]
    draw: Callable[[random.Random], tuple[float, str]]
    keys: Callable[[float, str, Rating], Keys] = lambda size, place, rating: {}
    over_s: tuple[float, float] = (0.0, 0.0)
    """it comes slowly, within a time between these"""
    reverses: bool = False
    """a negative size turns the rotor backwards: a start catches it, and needs a second ramp to bring it up"""
    passes: float = 0.0
    """share of the cases in which it is over soon, within a time between lasts_s"""
    lasts_s: tuple[float, float] = (0.02, 0.3)
    limits: bool = False
    swings: bool = False
    """its torque swings the speed with the turn"""
    weight: float = 1.0
    unseen: Callable[[float, Rating], Unseen] = lambda size, rating: Unseen()


def _side(low: float, high: float, both_signs: bool = False) -> Callable[[random.Random], tuple[float, str]]:
    """A size between these, of one of the two current sensors; each decade as often as the next."""
    def draw(r: random.Random) -> tuple[float, str]:
        size = low * (high / low) ** r.random()
        return (-size if both_signs and r.random() < 0.5 else size), r.choice(SIDES)
    return draw


def _size(low: float, high: float, both_signs: bool = False) -> Callable[[random.Random], tuple[float, str]]:
    return lambda r: (_side(low, high, both_signs)(r)[0], "")


def _one_of(*sizes: float) -> Callable[[random.Random], tuple[float, str]]:
    return lambda r: (r.choice(sizes), "")


def _stuck(*states: float) -> Callable[[random.Random], tuple[float, str]]:
    return lambda r: (r.choice(states), r.choice(SIDES))


def _transistor(r: random.Random) -> tuple[float, str]:
    """One of the six: its bit, and its name."""
    number = r.randrange(len(TRANSISTORS))
    return float(1 << number), TRANSISTORS[number]


def _bits(first: tuple[str, ...]) -> Callable[[random.Random], tuple[float, str]]:
    """A bit of one of these; the size is the bit's place, 0..1."""
    return lambda r: (r.random(), r.choice(first))


def _sets(key: str, of: str = "") -> Callable[[float, str, Rating], Keys]:
    """The size goes to a key of the board, or that share of what the rating says; {} is the place."""
    return lambda size, place, rating: {key.format(place): size * (getattr(rating, of) if of else 1.0)}


def _pulses(size: float, place: str, rating: Rating) -> Keys:
    """A torque that swings with the shaft's angle, as that of a piston."""
    order = float(place)
    return {"load.pulse1_nm": pulse_nm(size * rating.torque_nm, order, rating.inertia_kgm2, rating.speed_rpm), "load.pulse1_order": order}


def pulse_nm(torque_nm: float, order: float, inertia_kgm2: float, rpm: float) -> float:
    """What of a torque may swing `order` times in a turn: it swings a motor with constant current by J w dw/dt = T, at most PULSE_SWING of its speed."""
    return min(torque_nm, PULSE_SWING * inertia_kgm2 * order * (rpm * math.pi / 30.0) ** 2)


PULSE_SWING = 0.15
"""Of the speed."""
PULSE_ORDERS = ("1", "2")


def _as_dead_time(size: float, rating: Rating) -> Unseen:
    """A ripple of the speed whose mean size is what dead time makes in a healthy motor."""
    return Unseen(more_rpm=math.pi / 2.0 * rating.dead_rpm)


def _as_slow_clock(size: float, rating: Rating) -> Unseen:
    """The drive counts its time in interrupts: what is too few to be seen makes it as much slower."""
    return Unseen(clock=1.0 - size) if size <= LOST_UNSEEN else Unseen()


LOST_UNSEEN = 0.03
"""Of the interrupts of a tenth of a second (LEAST_TICKS of firmware/board/firmware.c)."""


def _as_warm_winding(size: float, rating: Rating) -> Unseen:
    """The same; and without a back-EMF, a signal that is too small looks like a resistance that is larger than the header's, and like dead time."""
    return replace(_as_dead_time(size, rating), start_current=min(max(1.0 / size, 1.0), MOST_RESISTANCE + rating.start_dead))


MOST_RESISTANCE = 1.6
"""Times the header's, where OVERTEMPERATURE begins."""


SENSOR = ("CURRENT_SENSOR", *OVERCURRENT, "OFFSET")
BUS = ("BUS_SENSOR", "UNDERVOLTAGE", "OVERVOLTAGE")
BRIDGE = ("OPEN_PHASE", *OVERCURRENT)
IMAGE = "image"
"""The room of what only the image in the simulator has: XC16 makes it."""
IMAGE_MOTOR = "hurst_dmb0224c10002"
"""The motor of the project's own header."""
STOPPED_CORE = ("SELFTEST", "TRAP", "WATCHDOG")
DRIVE_RAM, OTHER_RAM = "the drive", "the rest"
FLASH, STACK, RAM = "flash", "stack", "RAM"
REGISTERS = {
    "PWM": ("P1TCON", "P1TPER", "P1SECMP", "PWM1CON1", "PWM1CON2", "P1DTCON1", "P1FLTACON", "P1OVDCON", "P1DC1", "P1DC2", "P1DC3"),
    "ADC": ("AD1CON1", "AD1CON2", "AD1CON3", "AD1CHS0", "AD1CHS123", "AD1PCFGL"),
    "ports": ("TRISA", "TRISB", "TRISC", "LATB", "LATC", "RPINR12"),
    "interrupts": ("IEC0", "IEC3", "IPC3", "IPC15"),
    "clock": ("CLKDIV", "PLLFBD")}


def _register_kind(group: str, weight: float) -> Kind:
    return Kind("registers", f"a bit of the {group} registers", ("SELFTEST",), _bits(REGISTERS[group]), weight=weight)


KINDS = (
    Kind("sensors", "current stuck at its value", SENSOR, _stuck(1.0), _sets("fault.i{}_stuck"), passes=0.2),
    Kind("sensors", "current reads zero", SENSOR, _stuck(4.0), _sets("fault.i{}_stuck"), passes=0.2, unseen=_as_dead_time),
    Kind("sensors", "current stuck at a rail", SENSOR, _stuck(2.0, 3.0), _sets("fault.i{}_stuck"), passes=0.2),
    Kind("sensors", "current offset", SENSOR, _side(0.02, 0.6, True), _sets("fault.i{}_error_a", "current_a"),
         unseen=_as_dead_time),
    Kind("sensors", "current offset drifts", SENSOR, _side(0.02, 0.6, True), _sets("fault.i{}_error_a", "current_a"),
         over_s=(0.3, 1.0), unseen=_as_dead_time),
    Kind("sensors", "current gain", SENSOR, lambda r: (r.choice((r.uniform(0.0, 0.9), r.uniform(1.1, 2.5))), r.choice(SIDES)),
         _sets("fault.i{}_gain"), unseen=_as_warm_winding),
    Kind("sensors", "current noise", SENSOR, _side(0.02, 0.5), _sets("fault.i{}_noise_a", "current_a"), unseen=_as_dead_time),
    Kind("sensors", "bus stuck at its value", ("BUS_SENSOR",), _one_of(1.0), _sets("fault.vbus_stuck"), weight=0.5),
    Kind("sensors", "bus stuck at a rail", BUS, _one_of(2.0, 3.0), _sets("fault.vbus_stuck")),
    Kind("sensors", "bus gain", BUS, lambda r: (r.choice((0.5, r.uniform(0.2, 0.95), r.uniform(1.05, 2.0))), ""),
         _sets("fault.vbus_gain")),
    Kind("sensors", "bus offset", BUS, _size(0.02, 0.5, True),
         _sets("fault.vbus_error_v", "bus_v")),
    Kind("sensors", "potentiometer wire", ("POTENTIOMETER",), _one_of(2.0, 3.0), _sets("fault.pot_stuck"), passes=0.2),
    Kind("power stage", "phase wire open", ("OPEN_PHASE",), _one_of(1.0, 2.0, 3.0), _sets("fault.open_phase"), weight=2.0),
    Kind("power stage", "transistor never turns on", ("OPEN_PHASE",), _transistor, _sets("fault.never_on"), weight=2.0,
         unseen=_as_dead_time),
    Kind("power stage", "transistor never turns off", BRIDGE, _transistor, _sets("fault.never_off")),
    Kind("supply", "sag", ("UNDERVOLTAGE",), _size(0.3, 0.9), _sets("supply.voltage_v", "bus_v"), passes=0.5, limits=True),
    Kind("supply", "lost", ("UNDERVOLTAGE",), _one_of(1000.0), _sets("supply.resistance_ohm"), passes=0.5, limits=True),
    Kind("supply", "bad contact", ("UNDERVOLTAGE",), _size(0.5, 20.0), _sets("supply.resistance_ohm"), limits=True),
    Kind("supply", "too high", ("OVERVOLTAGE",), _size(1.05, 1.6), _sets("supply.voltage_v", "bus_v"), passes=0.5, limits=True),
    Kind("shaft", "blocked", (*NO_TURN, *OVERCURRENT), _one_of(1.0), _sets("load.locked"), passes=0.2, weight=2.0),
    Kind("shaft", "load step", (*NO_TURN, "OVERTEMPERATURE"), _size(0.1, 3.0), _sets(BRAKE, "torque_nm"), passes=0.5,
         limits=True),
    Kind("shaft", "held and let go", (*NO_TURN, *OVERCURRENT), _one_of(1.0), _sets("load.locked"), passes=1.0, lasts_s=(0.01, 1.0), weight=2.0),
    Kind("shaft", "load that pulses", NO_TURN, lambda r: (r.uniform(0.05, 0.5), r.choice(PULSE_ORDERS)), _pulses, limits=True, swings=True),
    Kind("shaft", "driven by the load", (*NO_TURN, "OVERVOLTAGE"), _size(0.1, 1.0, True), _sets("load.active_nm", "torque_nm"),
         passes=0.5, limits=True, reverses=True),
    Kind("temperature", "warm winding", ("OVERTEMPERATURE",), _size(1.05, 1.6), _sets("motor.rs_ohm", "rs_ohm"),
         over_s=(0.3, 1.0), limits=True),
    Kind("temperature", "warm magnets", ("OVERTEMPERATURE",), _size(0.8, 0.99), _sets("motor.psi_vs", "psi_vs"),
         over_s=(0.3, 1.0), limits=True),
    Kind("clock", "crystal off frequency", ("CLOCK", "INTERRUPT_RATE"), lambda r: (1.0 + _size(0.005, 0.3, True)(r)[0], ""),
         _sets("cpu.crystal_hz", "crystal_hz"), unseen=lambda size, rating: Unseen(clock=size)),
    Kind("interrupts", "some lost", ("INTERRUPT_RATE", "ADC_LOST", "ISR_OVERRUN"), _size(0.002, 0.6), _sets("fault.isr_lost_share"),
         passes=0.3, weight=2.0, unseen=_as_slow_clock),
    Kind("interrupts", "all lost", ("INTERRUPT_RATE", "ADC_LOST"), _one_of(1.0), _sets("cpu.isr_dropped"), passes=0.3, weight=0.5),
    Kind("interrupts", "late", ("INTERRUPT_RATE", "ISR_OVERRUN", "ADC_LOST"), _size(1.0, 45.0),
         lambda size, place, rating: {"fault.isr_late_us": size, "fault.isr_late_share": 0.02 if size > 20.0 else 0.3}, passes=0.3),
    Kind("RAM", "a bit of the drive's state", ("SELFTEST",), _bits((DRIVE_RAM,)), weight=6.0),
    Kind("RAM", "a bit of other variables", ("SELFTEST",), _bits((OTHER_RAM,)), weight=2.0),
    *(_register_kind(group, weight) for group, weight in (("PWM", 2.0), ("ADC", 1.5), ("ports", 1.0), ("interrupts", 0.5), ("clock", 0.5))),
    *(Kind(IMAGE, f"a bit of the {area}", STOPPED_CORE, _bits((area,)), weight=weight)
      for area, weight in ((FLASH, 1.0), (STACK, 0.5), (RAM, 0.5))),
)
BY_NAME = {f"{kind.room}: {kind.name}": kind for kind in KINDS}

SCENES = {"CALIBRATE": 0.6, "STOPPED": 0.6, "BOOTSTRAP": 0.6, "ALIGN": 1.0, "RAMP": 1.2, "low speed": 2.0, "half speed": 2.5, "rated speed": 2.5,
          "accelerating": 1.2, "braking": 1.5, "field weakening": 2.0, "STOPPING": 1.0, "FAULT": 0.8, "retry": 0.8}
"""When it happens, and how often: a state of the drive, or what it does in closed loop; "retry" is the pause after a stall."""
SLOW_PHASES = int(param_rows.number("SLOW_PERIODS_IN_TIME"))
HEADER_OFF, HEADER_SHARE = (("motor.rs_ohm", 0.7, 1.3), ("motor.psi_vs", 0.8, 1.2), ("motor.ld_h", 0.75, 1.25)), 0.25
"""What the true motor may be of its header's, and the share of the cases in which it is."""
PULSE_SHARE, PULSE_MOST = 0.15, 0.3
"""Of the cases, and of the rated torque."""


@dataclass(frozen=True)
class Case:
    """One injected fault. `part` 0..1: how far into the scene; `load`: of the rated torque."""

    number: int
    kind: str
    size: float
    place: str
    scene: str
    part: float
    phase: int
    motor: str
    load: float
    over_s: float
    lasts_s: float
    rotor_deg: float
    noise: int
    header: tuple[float, ...] = ()
    """the true motor's values over its header's, of HEADER_OFF; empty: the same"""
    pulse: float = 0.0
    """a torque that swings once a turn all the time, of the rated torque"""

    @property
    def what(self) -> Kind:
        return BY_NAME[self.kind]

    @property
    def swings(self) -> bool:
        """A load swings the speed with the turn."""
        return self.what.swings or self.pulse > 0.0


def draw(seed: int, number: int, motors: list[str], scenes: tuple[str, ...] = tuple(SCENES)) -> Case:
    """The case with this number: always the same. Kinds and scenes take turns in an order of the seed's own, so that every one is drawn as
    often as its weight says."""
    r = random.Random(f"campaign/{seed}/{number}")
    name = _in_turn(seed, number, {name: kind.weight for name, kind in BY_NAME.items()}, "kinds")
    scene = r.choices(scenes, [SCENES[name] for name in scenes])[0]
    kind = BY_NAME[name]
    size, place = kind.draw(r)
    motor = r.choice(motors)
    return Case(number, name, float(f"{size:.4g}"), place, scene, r.random(), r.randrange(SLOW_PHASES), IMAGE_MOTOR if kind.room == IMAGE else motor,
                r.choice((0.0, 0.25, 0.5, 0.75)), round(r.uniform(*kind.over_s), 3), round(r.uniform(*kind.lasts_s), 3) if r.random() < kind.passes else 0.0,
                float(r.randrange(360)), r.randrange(1, 2**31), _header(r), round(r.uniform(0.05, PULSE_MOST), 3) if r.random() < PULSE_SHARE else 0.0)


def _header(r: random.Random) -> tuple[float, ...]:
    return tuple(round(r.uniform(low, high), 3) for _, low, high in HEADER_OFF) if r.random() < HEADER_SHARE else ()


def true_motor(case: Case, values: Keys) -> Keys:
    """What of the motor is not as its header says."""
    off = {key: values[key] * factor for (key, _, _), factor in zip(HEADER_OFF, case.header)}
    return off | ({"motor.lq_h": values["motor.lq_h"] * case.header[2]} if case.header else {})


def _in_turn(seed: int, number: int, weights: dict[str, float], what: str) -> str:
    """Rounds in which each name comes twice its weight often, shuffled anew for each round."""
    names = [name for name, weight in weights.items() for _ in range(round(2.0 * weight))]
    turn, place = divmod(number - 1, len(names))
    random.Random(f"{what}/{seed}/{turn}").shuffle(names)
    return names[place]


def keys_of(case: Case, rating: Rating) -> Keys:
    """What is set on the virtual board."""
    return case.what.keys(case.size, case.place, rating)
