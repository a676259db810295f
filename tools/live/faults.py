"""The faults that the page offers to throw in: rows of the bench's table of faults (tools/bench/injection.py), each with a size."""

from collections.abc import Iterable
from dataclasses import dataclass

from tools.bench.injection import BY_NAME, Keys, Rating


@dataclass(frozen=True)
class Fault:
    """A switch on the page. Size and place are those of the kind."""

    name: str
    label: str
    kind: str
    size: float
    place: str = ""

    def keys(self, rating: Rating) -> Keys:
        """What it sets on the virtual board."""
        return BY_NAME[self.kind].keys(self.size, self.place, rating)


FAULTS = {fault.name: fault for fault in (
    Fault("open_a", "phase A open", "power stage: phase wire open", 1.0),
    Fault("open_b", "phase B open", "power stage: phase wire open", 2.0),
    Fault("open_c", "phase C open", "power stage: phase wire open", 3.0),
    Fault("never_on", "low side A stays off", "power stage: transistor never turns on", 1.0, "A low"),
    Fault("never_off", "high side B stays on", "power stage: transistor never turns off", 8.0, "B high"),
    Fault("ia_zero", "current A reads zero", "sensors: current reads zero", 4.0, "a"),
    Fault("ib_stuck", "current B sticks", "sensors: current stuck at its value", 1.0, "b"),
    Fault("ib_rail", "current B at 3.3 V", "sensors: current stuck at a rail", 3.0, "b"),
    Fault("ia_gain", "current A reads half", "sensors: current gain", 0.5, "a"),
    Fault("bus_half", "bus reads half", "sensors: bus gain", 0.5),
    Fault("bus_rail", "bus reads its end", "sensors: bus stuck at a rail", 3.0),
    Fault("pot_wire", "potentiometer's wire off", "sensors: potentiometer wire", 2.0),
    Fault("supply_lost", "supply lost", "supply: lost", 1000.0),
    Fault("blocked", "shaft blocked", "shaft: blocked", 1.0),
    Fault("driven", "load drives the shaft", "shaft: driven by the load", 0.5),
    Fault("interrupts_some", "some interrupts lost", "interrupts: some lost", 0.1),
    Fault("interrupts_all", "interrupts stop", "interrupts: all lost", 1.0),
    Fault("crystal", "crystal 10 % slow", "clock: crystal off frequency", 0.9))}
"""By name, in the page's order."""


def keys_of(names: Iterable[str], rating: Rating) -> Keys:
    """What several of them set; where two set the same key the later one counts."""
    result: Keys = {}
    for name in names:
        result |= FAULTS[name].keys(rating)
    return result
