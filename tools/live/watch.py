"""What the page reads of a real board twenty times a second, in as few requests as the addresses allow."""

from collections.abc import Mapping
from dataclasses import dataclass

from tools.common.errors import UserError

from .lnet import MOST_BYTES, Lnet
from .scale import scale_of
from .symbols import Symbols, Variable

CONTROL = "board_drive.run.control."
WATCHED = {
    "state": "board_drive.state", "fault": "board_drive.fault", "limits": "LimitParm.now", "target_rpm": "board_drive.command.target_erpm",
    "reference_rpm": CONTROL + "reference_erpm", "estimate_rpm": "board_drive.run.estimator.omega_filtered_q16", "angle_deg": "board_drive.angle",
    "i_d_a": CONTROL + "i_q13.d", "i_q_a": CONTROL + "i_q13.q", "iq_ref_a": CONTROL + "ref_q13.q", "iq_limit_a": CONTROL + "iq_limit_q13",
    "v_d_v": CONTROL + "v_q14.d", "v_q_v": CONTROL + "v_q14.q", "v_limit_v": "board_drive.circle.limit_q14", "bus_v": "board_drive.bus_q31",
    "mode": "scope_command.mode", "lease_ms": "scope_command.lease_ms"}
"""By the page's name."""


@dataclass(frozen=True)
class Block:
    """A stretch of memory."""

    address: int
    bytes: int


def blocks(variables: list[Variable]) -> list[Block]:
    """Stretches that hold all of them, each as long as one answer can be."""
    found: list[Block] = []
    for item in sorted(variables, key=lambda item: item.address):
        start, end = item.address & ~1, item.address + item.bytes
        if found and end - found[-1].address <= MOST_BYTES - 1:
            found[-1] = Block(found[-1].address, max(found[-1].bytes, end - found[-1].address))
        else:
            found.append(Block(start, end - start))
    return found


class Watch:
    """Reads them. A firmware without one of them, or without its scope, is refused."""

    def __init__(self, symbols: Symbols, params: Mapping[str, float]) -> None:
        missing = [name for name in WATCHED.values() if name not in symbols.variables]
        if missing:
            raise UserError(f"the ELF file has no '{missing[0]}'", "ELF", "name the file of a firmware of this version, built with SCOPE 1")
        self.variables = {name: symbols.find(where) for name, where in WATCHED.items()}
        self.scales = {name: scale_of(where, params) for name, where in WATCHED.items()}
        self.blocks = blocks(list(self.variables.values()))

    def read(self, link: Lnet) -> dict[str, float]:
        """All of them, in engineering units."""
        memory = {block: link.read(block.address, block.bytes) for block in self.blocks}
        return {name: self._value(item, memory) * self.scales[name].per_count for name, item in self.variables.items()}

    @staticmethod
    def _value(item: Variable, memory: dict[Block, bytes]) -> int:
        block = next(block for block in memory if block.address <= item.address and item.address + item.bytes <= block.address + block.bytes)
        return item.value(memory[block][item.address - block.address:])
