"""Reference of the integer instructions: what they do to registers, memory and flags, in exact integers.

Written from chapter 5 of the Programmer's Reference Manual, from each instruction's "Operation" and "Status Affected". It executes one
instruction of the assembler's table; branches, calls, table instructions and traps are not here but in the vectors.
"""

from asm33 import Row

# Status bits that exist in SR, by position.
C, Z, OV, N, RA, DC, DA, SAB, OAB, SB, SA, OB, OA = 0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 14, 15
FLAG_NAMES = {"C": C, "Z": Z, "OV": OV, "N": N, "RA": RA, "DC": DC, "DA": DA, "SAB": SAB, "OAB": OAB, "SB": SB, "SA": SA, "OB": OB, "OA": OA}

BITS = {"bset": lambda value, bit: value | bit, "bclr": lambda value, bit: value & ~bit, "btg": lambda value, bit: value ^ bit}


def signed(value: int, bits: int) -> int:
    """The value of a two's complement word."""
    return (value & (1 << bits) - 1 ^ 1 << bits - 1) - (1 << bits - 1)


class State:
    """Registers W0..W15, SR, accumulators A and B (signed integers within 40 bits), CORCON, and data memory up to the end of RAM."""

    def __init__(self, ram: bytes = bytes(0x800)) -> None:
        self.w = [0] * 16
        self.sr = 0
        self.acc = [0, 0]
        self.corcon = 0x20
        self.memory = bytearray(0x800) + ram

    def flag(self, bit: int) -> int:
        """A status bit."""
        return self.sr >> bit & 1

    def set_flag(self, bit: int, value: object) -> None:
        """Sets or clears a status bit."""
        self.sr = self.sr | 1 << bit if value else self.sr & ~(1 << bit)

    def mode(self, bit: int) -> int:
        """A bit of CORCON."""
        return self.corcon >> bit & 1

    def load(self, address: int, bits: int) -> int:
        """A little-endian number in memory."""
        return int.from_bytes(self.memory[address:address + bits // 8], "little")

    def store(self, address: int, value: int, bits: int) -> None:
        """Writes a little-endian number."""
        self.memory[address:address + bits // 8] = (value & (1 << bits) - 1).to_bytes(bits // 8, "little")


class Alu:
    """Executes one instruction on a state."""

    def __init__(self, state: State, row: Row, fields: dict[str, int]) -> None:
        self.state, self.row, self.fields = state, row, fields
        self.kinds = row.operands
        byte = fields.get("B", 0) or row.mnemonic in ("mov.b", "daw.b") or "f.bit" in row.operands
        self.bits = 8 if byte else 16
        self.mask = (1 << self.bits) - 1

    # ---- operands ----------------------------------------------------------------------------------------------------
    def address(self, letter: str, step: int | None = None) -> int | None:
        """Effective address of operand s or d by its mode, with the register's modification; None for a register itself."""
        mode_letter = {"s": "p" if "p" in self.fields else "g", "d": "q" if "q" in self.fields else "h"}[letter]
        mode, register = self.fields.get(mode_letter, 0), self.fields[letter]
        w, step = self.state.w, step or self.bits // 8
        if mode == 0:
            return None
        if mode >= 6:
            return w[register] + w[self.fields["w"]] & 0xFFFF
        before = {4: -step, 5: step}.get(mode, 0)
        after = {2: -step, 3: step}.get(mode, 0)
        effective = w[register] + before & 0xFFFF
        w[register] = effective + after & 0xFFFF
        return effective

    def source(self, bits: int | None = None) -> int:
        """Value of operand Ws, whatever its mode, or of the 5-bit literal in its place."""
        if "k" in self.fields:
            return self.fields["k"]
        bits = bits or self.bits
        address = self.address("s", bits // 8)
        if address is None:
            return self.state.w[self.fields["s"]] & (1 << bits) - 1
        return self.state.load(address, bits)

    def write(self, value: int) -> None:
        """Writes the result to Wd or where it points; a byte leaves the register's high byte."""
        address = self.address("d")
        if address is None:
            self.write_register(self.fields["d"], value)
        else:
            self.state.store(address, value & self.mask, self.bits)

    def write_register(self, register: int, value: int) -> None:
        """The low byte or all of a register."""
        self.state.w[register] = self.state.w[register] & ~self.mask & 0xFFFF | value & self.mask

    # ---- flags -------------------------------------------------------------------------------------------------------
    def nz(self, result: int, sticky: bool = False) -> None:
        """N and Z; a sticky Z can only be cleared."""
        self.state.set_flag(N, result >> self.bits - 1 & 1)
        zero = result & self.mask == 0
        self.state.set_flag(Z, zero and (self.state.flag(Z) if sticky else True))

    def sum(self, a: int, b: int, carry: int, sticky: bool = False) -> int:
        """a + b + carry with DC, N, OV, Z, C. A subtraction is the sum with the complement."""
        total = a + b + carry
        result = total & self.mask
        half = (1 << self.bits // 2) - 1
        self.nz(result, sticky)
        self.state.set_flag(C, total > self.mask)
        self.state.set_flag(DC, (a & half) + (b & half) + carry > half)
        exact = signed(a, self.bits) + signed(b, self.bits) + carry
        self.state.set_flag(OV, exact != signed(result, self.bits))
        return result

    def calculate(self, name: str, a: int, b: int) -> int:
        """Two operands: a is Wb, f or Wn; b is Ws, WREG or the literal."""
        borrow = self.state.flag(C)
        inverse = self.mask
        if name in ("and", "ior", "xor"):
            result = {"and": a & b, "ior": a | b, "xor": a ^ b}[name]
            self.nz(result)
            return result
        return {
            "add": lambda: self.sum(a, b, 0),
            "addc": lambda: self.sum(a, b, self.state.flag(C), sticky=True),
            "sub": lambda: self.sum(a, b ^ inverse, 1),
            "cp": lambda: self.sum(a, b ^ inverse, 1),
            "subb": lambda: self.sum(a, b ^ inverse, borrow, sticky=True),
            "cpb": lambda: self.sum(a, b ^ inverse, borrow, sticky=True),
            "subr": lambda: self.sum(b, a ^ inverse, 1),
            "subbr": lambda: self.sum(b, a ^ inverse, borrow, sticky=True),
        }[name]()

    def change(self, name: str, value: int) -> int:
        """One operand."""
        if name in ("inc", "inc2"):
            return self.sum(value, {"inc": 1, "inc2": 2}[name], 0)
        if name in ("dec", "dec2"):
            return self.sum(value, {"dec": 1, "dec2": 2}[name] ^ self.mask, 1)
        if name == "neg":
            return self.sum(0, value ^ self.mask, 1)
        if name == "cp0":
            return self.sum(value, self.mask, 1)
        if name == "clr":
            return 0
        if name == "setm":
            return self.mask
        if name == "com":
            result = value ^ self.mask
            self.nz(result)
            return result
        return self.shift_by_one(name, value)

    def shift_by_one(self, name: str, value: int) -> int:
        """SL, LSR, ASR and the rotations."""
        top, low, carry = value >> self.bits - 1, value & 1, self.state.flag(C)
        left, right = value << 1 & self.mask, value >> 1
        high = self.bits - 1
        result, out = {
            "sl": (left, top), "lsr": (right, low), "asr": (right | top << high, low),
            "rlc": (left | carry, top), "rlnc": (left | top, None),
            "rrc": (right | carry << high, low), "rrnc": (right | low << high, None),
        }[name]
        if out is not None:
            self.state.set_flag(C, out)
        self.nz(result)
        return result

    # ---- execution ---------------------------------------------------------------------------------------------------
    def execute(self) -> None:
        """Runs the instruction."""
        name = self.row.mnemonic.split(".")[0]
        if name in BITS:
            self._bit(BITS[name])
            return
        special = getattr(self, f"_{self.row.mnemonic.replace('.', '_')}", None) or getattr(self, f"_{name}", None)
        if special:
            special()
        elif "f" in self.fields or self.kinds == ["WREG"]:
            self._file(name)
        elif name in ("asr", "lsr", "sl") and "w" in self.fields:
            self._shift(name)
        elif self.kinds == ["#k", "Wd"]:
            register = self.fields["d"]
            self.write_register(register, self.calculate(name, self.state.w[register] & self.mask, self.fields["k"] & self.mask))
        elif self.kinds[0] == "Wb":
            a = self.state.w[self.fields["w"]] & self.mask
            result = self.calculate(name, a, self.source())
            if len(self.kinds) == 3:
                self.write(result)
        else:
            value = self.source() if "s" in self.fields else 0
            result = self.change(name, value)
            if name != "cp0":
                self.write(result)

    def _file(self, name: str) -> None:
        address, to_wreg = self.fields.get("f", 0), self.kinds == ["WREG"] or self.fields.get("D") == 0
        value = self.state.load(address, self.bits)
        wreg = self.state.w[0] & self.mask
        if name in ("add", "addc", "sub", "subb", "subr", "subbr", "and", "ior", "xor", "cp", "cpb"):
            result = self.calculate(name, value, wreg)
        else:
            result = self.change(name, value)
        if name in ("cp", "cpb", "cp0"):
            return
        if to_wreg:
            self.write_register(0, result)
        else:
            self.state.store(address, result, self.bits)

    def _shift(self, name: str) -> None:
        value = self.state.w[self.fields["w"]]
        count = self.fields["k"] if "k" in self.fields else self.state.w[self.fields["s"]] & 31
        result = {"sl": value << count, "lsr": value >> count, "asr": signed(value, 16) >> count}[name] & 0xFFFF
        self.state.w[self.fields["d"]] = result
        self.nz(result)

    def _mov(self) -> None:
        fields, state = self.fields, self.state
        if self.kinds == ["f", "WREG"]:
            value = state.load(fields["f"], self.bits)
            self.nz(value)
            if fields["D"]:
                state.store(fields["f"], value, self.bits)
            else:
                self.write_register(0, value)
        elif self.kinds == ["WREG", "f"]:
            state.store(fields["f"], state.w[0] & self.mask, self.bits)
        elif self.kinds == ["f", "Wd"]:
            state.w[fields["d"]] = state.load(fields["f"] << 1, 16)
        elif self.kinds == ["Ws", "f"]:
            state.store(fields["f"] << 1, state.w[fields["s"]], 16)
        elif self.kinds == ["#k", "Wd"]:
            self.write_register(fields["d"], fields["k"])
        elif "k" in fields:
            self._mov_with_offset()
        else:
            self.write(self.source())

    def _mov_with_offset(self) -> None:
        state, offset = self.state, signed(self.fields["k"], 10) * (self.bits // 8)
        pointer = self.fields["s" if self.kinds[0] == "[Ws+k]" else "d"]
        address = state.w[pointer] + offset & 0xFFFF
        if self.kinds[0] == "[Ws+k]":
            self.write_register(self.fields["d"], state.load(address, self.bits))
        else:
            state.store(address, state.w[self.fields["s"]] & self.mask, self.bits)

    def _mov_d(self) -> None:
        state, fields = self.state, self.fields
        if self.kinds[0] == "Ws:":
            low, high = state.w[fields["s"]], state.w[fields["s"] + 1]
            state.store(self.address("d", 4), low | high << 16, 32)
            return
        address = self.address("s", 4)
        pair = state.w[fields["s"]] | state.w[fields["s"] + 1] << 16 if address is None else state.load(address, 32)
        state.w[fields["d"]], state.w[fields["d"] + 1] = pair & 0xFFFF, pair >> 16

    def _exch(self) -> None:
        w, s, d = self.state.w, self.fields["s"], self.fields["d"]
        w[s], w[d] = w[d], w[s]

    def _swap(self) -> None:
        value, half = self.state.w[self.fields["s"]] & self.mask, self.bits // 2
        self.write_register(self.fields["s"], value >> half | value << half)

    def _daw_b(self) -> None:
        register = self.fields["s"]
        value, carry = self.state.w[register] & 0xFF, self.state.flag(C)
        low = value & 15
        total = value + (6 if low > 9 or self.state.flag(DC) else 0)
        if total >> 4 > 9 or carry:
            total += 0x60
        self.write_register(register, total)
        self.state.set_flag(C, carry or total > 0xFF)

    def _se(self) -> None:
        value = self.source(8)
        self.state.w[self.fields["d"]] = result = signed(value, 8) & 0xFFFF
        self.nz(result)
        self.state.set_flag(C, result >> 15 == 0)

    def _ze(self) -> None:
        self.state.w[self.fields["d"]] = result = self.source(8)
        self.nz(result)
        self.state.set_flag(C, 1)

    def _ff1l(self) -> None:
        self._bit_number(17 - self.source().bit_length())

    def _ff1r(self) -> None:
        value = self.source()
        self._bit_number((value & -value).bit_length() if value else 17)

    def _bit_number(self, number: int) -> None:
        self.state.w[self.fields["d"]] = 0 if number == 17 else number
        self.state.set_flag(C, number == 17)

    def _fbcl(self) -> None:
        value = self.source()
        other = value ^ 0xFFFF if value & 0x8000 else value
        self.state.w[self.fields["d"]] = other.bit_length() - 15 & 0xFFFF
        self.state.set_flag(C, other == 0)

    def _mul(self) -> None:
        state, fields = self.state, self.fields
        kind = self.row.mnemonic.partition(".")[2]
        if not kind:
            product = state.load(fields["f"], self.bits) * (state.w[0] & self.mask)
            state.w[2] = product & 0xFFFF
            if self.bits == 16:
                state.w[3] = product >> 16
            return
        a, b = state.w[fields["w"]], self.source()
        product = (signed(a, 16) if kind[0] == "s" else a) * (signed(b, 16) if kind[1] == "s" else b)
        state.w[fields["d"]], state.w[fields["d"] + 1] = product & 0xFFFF, product >> 16 & 0xFFFF

    def _bit_place(self) -> tuple[int | None, int, int]:
        """Address (None for a register), old value, bit number; a file register is looked at bytewise."""
        if "f" in self.fields:
            return self.fields["f"], self.state.load(self.fields["f"], 8), self.fields["b"]
        address = self.address("s")
        value = self.state.w[self.fields["s"]] & self.mask if address is None else self.state.load(address, self.bits)
        return address, value, self.fields["b"] if "b" in self.fields else self.state.w[self.fields["w"]] & 15

    def _bit(self, change) -> int:
        place, value, bit = self._bit_place()
        result = change(value, 1 << bit)
        if place is None:
            self.write_register(self.fields["s"], result)
        elif result != value:
            self.state.store(place, result, self.bits)
        return value >> bit & 1

    def _bsw(self) -> None:
        new = self.state.flag(C) if self.row.mnemonic == "bsw.c" else 1 - self.state.flag(Z)
        self._bit(lambda value, bit: value | bit if new else value & ~bit)

    def _btst(self) -> None:
        self._to_flag(self._bit(lambda value, bit: value))

    def _btsts(self) -> None:
        self._to_flag(self._bit(lambda value, bit: value | bit))

    def _to_flag(self, bit: int) -> None:
        if self.row.mnemonic.endswith(".c"):
            self.state.set_flag(C, bit)
        else:
            self.state.set_flag(Z, not bit)

    def _div(self) -> None:
        """The result of REPEAT #17 and the division; OV leaves W0 and W1 open, which is not looked at then."""
        state, fields = self.state, self.fields
        kind = self.row.mnemonic.partition(".")[2]
        bits = 32 if kind.endswith("d") else 16
        dividend = state.w[fields["m"]] | (state.w[fields["m"] + 1] << 16 if bits == 32 else 0)
        divisor = state.w[fields["s"]]
        if kind[0] == "s":
            dividend, divisor = signed(dividend, bits), signed(divisor, 16)
        self._quotient(dividend, divisor, kind[0] == "s")

    def _divf(self) -> None:
        w, fields = self.state.w, self.fields
        self._quotient(signed(w[fields["m"]], 16) << 15, signed(w[fields["s"]], 16), True)

    def _quotient(self, dividend: int, divisor: int, has_sign: bool) -> None:
        state = self.state
        quotient = abs(dividend) // abs(divisor) * (-1 if (dividend < 0) != (divisor < 0) else 1)
        rest = dividend - quotient * divisor
        low, high = (-32768, 32767) if has_sign else (0, 65535)
        state.set_flag(OV, not low <= quotient <= high)
        if not state.flag(OV):
            state.w[0], state.w[1] = quotient & 0xFFFF, rest & 0xFFFF
            state.set_flag(Z, rest == 0)
            state.set_flag(N, rest < 0)
