"""Makes up operands: for a row of the assembler's table, instructions as text with random or extreme operands."""

import random

from asm33 import MODES, PAIRS, Row

PREFETCH = ["", "+=2", "+=4", "+=6", "-=6", "-=4", "-=2"]


class Sampler:
    """Random instruction texts; branch targets lie around an address."""

    def __init__(self, seed: int, address: int = 0x200) -> None:
        self.random = random.Random(seed)
        self.address = address

    def text(self, row: Row) -> str:
        """An instruction of this row."""
        byte = row.byte and self.random.random() < 0.5
        operands = []
        self.offset = f"w{self.random.randrange(16)}"
        for kind in row.operands:
            operands += self._operand(row, kind, byte)
        return f"{row.mnemonic}{'.b' if byte else ''} {', '.join(operands)}".strip()

    def _operand(self, row: Row, kind: str, byte: bool) -> list[str]:
        pick, name = self.random.choice, kind.strip("{}[]:+")
        if kind == "WREG":
            return ["wreg"] if not row.width("D") or pick((True, False)) else []
        if kind == "f":
            width = row.width("f")
            return [hex(self._number(16 if width == 15 else 13) & (0xFFFF if byte else 0xFFFE))]
        if kind == "f.bit":
            return [hex(self._number(13) & (0x1FFF if byte else 0x1FFE)), f"#{self.random.randrange(8 if byte else 16)}"]
        if kind == "Acc":
            return [pick("ab")]
        if kind.startswith("#"):
            return self._literal(row, kind, byte)
        if kind == "label":
            return [hex(self.address + 2 * len(row.words) + 2 * self.random.randrange(-0x80, 0x7FFF))]
        if kind == "target":
            return [hex(self._number(23) & 0x7FFFFE)]
        if kind in ("[Ws+k]", "[Wd+k]"):
            value = self.random.randrange(-512, 512) * (1 if byte else 2)
            return [f"[w{self.random.randrange(16)}{value:+d}]"]
        if kind.startswith(("{", "[")):
            return [self._indirect(kind)]
        if kind in ("Wm*Wn", "Wm*Wm", "X", "Y", "AWB", "X-Y"):
            return self._dsp(kind)
        if row.mnemonic.startswith("div") and kind == "Ws":
            return [f"w{self.random.randrange(2, 16)}"]
        if name in ("Wb", "Ws", "Wd", "Wm"):
            return [self._even() if kind.endswith(":") else f"w{self.random.randrange(16)}"]
        return [kind]

    def _even(self) -> str:
        return f"w{2 * self.random.randrange(7)}"

    def _number(self, width: int) -> int:
        return self.random.choice([0, (1 << width) - 1, 1 << width - 1, self.random.getrandbits(width), self.random.getrandbits(width)])

    def _literal(self, row: Row, kind: str, byte: bool) -> list[str]:
        letter = kind.strip("#±0")
        width = row.width(letter)
        if kind == "#k0":
            return [f"#{self._number(width + 1) & 0x3FFE}"]
        if row.mnemonic == "sftac":
            return [f"#{self.random.randint(-16, 16)}"]
        if "±" in kind:
            value = self._number(width) - (1 << width - 1)
            return [] if letter == "r" and value == 0 else [f"#{value}"]
        if byte and letter == "b":
            width = 3
        elif byte and letter == "k":
            width = min(width, 8)
        return [f"#{self._number(width):#x}"]

    def _indirect(self, kind: str) -> str:
        forms = list(MODES)[1 if kind.startswith("[") else 0:]
        if "+" in kind:
            forms.append("+")
        form = self.random.choice(forms)
        register = f"w{self.random.randrange(16)}"
        if form == "+":
            return f"[{register}+{self.offset}]"
        if form == "{}" and ":" in kind:
            register = self._even()
        return form.format(register)

    def _prefetch(self, base: int) -> str:
        if self.random.random() < 0.15:
            return f"[w{base + 1}+w12]"
        return f"[w{base + self.random.randrange(2)}]{self.random.choice(PREFETCH)}"

    def _dsp(self, kind: str) -> list[str]:
        pick = self.random.choice
        if kind == "Wm*Wn":
            return ["w{}*w{}".format(*pick(list(PAIRS)))]
        if kind == "Wm*Wm":
            register = f"w{self.random.randint(4, 7)}"
            return [f"{register}*{register}"]
        if kind == "X-Y":
            return [self._prefetch(8), self._prefetch(10), f"w{self.random.randint(4, 7)}"]
        if kind == "AWB":
            return pick([[], ["w13"], ["[w13]+=2"]])
        if pick((True, False)):
            self.into = getattr(self, "into", 4) % 4 + 4  # never the same register from both prefetches of one instruction
            return [self._prefetch(8 if kind == "X" else 10), f"w{self.into}"]
        return []
