"""Reference of the DSP engine: 40-bit accumulators in exact integers, written from the data sheet's description of the DSP engine.

Saturation, as the data sheet puts it: with SATA (SATB) clear, the accumulator wraps at 40 bits and SA (SB) tells that bit 39 overflowed;
with SATA set and ACCSAT clear it saturates at bit 31, guard bits stay a sign and OA is never set; with both set it saturates at bit 39.
OA (OB) tells that the guard bits are in use. SA and SB stay set. SATDW saturates what is written to data memory or a register.
"""

from alu import OA, OAB, OB, SA, SAB, SB, Alu, signed
from asm33 import Row

NAMES = {"mac", "msc", "mpy", "mpy.n", "movsac", "ed", "edac", "lac", "sac", "sac.r", "sftac"}

US, SATA, SATB, SATDW, ACCSAT, RND, IF = 12, 7, 6, 5, 4, 1, 0
STEPS = {0: 0, 1: 2, 2: 4, 3: 6, 5: -6, 6: -4, 7: -2}
PAIRS = {0: (4, 5), 1: (4, 6), 2: (4, 7), 4: (5, 6), 5: (5, 7), 6: (6, 7)}
UNUSED = 4
INDEXED = 12
# What the accumulator becomes; None leaves it.
CHANGES = {"mac": lambda acc, product: acc + product, "msc": lambda acc, product: acc - product, "mpy": lambda acc, product: product,
           "mpy.n": lambda acc, product: -product, "movsac": lambda acc, product: None}


def is_dsp(row: Row) -> bool:
    """Whether an instruction belongs to the DSP engine."""
    return row.mnemonic in NAMES or "Acc" in row.operands


class Dsp(Alu):
    """Executes one DSP instruction."""

    # ---- accumulators ------------------------------------------------------------------------------------------------
    def result(self, which: int, exact: int) -> None:
        """Puts an exact result into an accumulator: overflow, saturation, flags."""
        state = self.state
        saturates = state.mode(SATA if which == 0 else SATB)
        limit = 1 << (39 if not saturates or state.mode(ACCSAT) else 31)
        overflow = not -limit <= exact < limit
        if overflow:
            state.set_flag(SA if which == 0 else SB, 1)
        if overflow and saturates:
            value = limit - 1 if exact > 0 else -limit
        else:
            value = signed(exact, 40)
        state.acc[which] = value
        state.set_flag(OA if which == 0 else OB, not -(1 << 31) <= value < 1 << 31)
        state.set_flag(OAB, state.flag(OA) or state.flag(OB))
        state.set_flag(SAB, state.flag(SA) or state.flag(SB))

    def product(self, a: int, b: int) -> int:
        """Product of two registers' values, shifted left by one in fractional mode."""
        if not self.state.mode(US):
            a, b = signed(a, 16), signed(b, 16)
        return a * b << (0 if self.state.mode(IF) else 1)

    def out(self, value: int, rounded: bool) -> int:
        """What leaves an accumulator: bits 31..16, rounded if asked for, saturated if SATDW is set."""
        if rounded:
            low = value & 0xFFFF
            up = low >= 0x8000 if self.state.mode(RND) else low > 0x8000 or low == 0x8000 and value >> 16 & 1
            value += 0x10000 if up else 0
        high = value >> 16
        if self.state.mode(SATDW):
            high = max(-32768, min(32767, high))
        return high & 0xFFFF

    # ---- prefetch and write-back -------------------------------------------------------------------------------------
    def _step(self, code: int, base: int) -> int | None:
        """Address of a prefetch, with the pointer's change."""
        if code == UNUSED:
            return None
        w, register = self.state.w, base + (code >> 3)
        if code == INDEXED:
            return w[register] + w[12] & 0xFFFF
        address = w[register]
        w[register] = address + STEPS[code & 7] & 0xFFFF
        return address

    def _prefetch(self) -> None:
        state, fields = self.state, self.fields
        x, y = self._step(fields["i"], 8), self._step(fields["j"], 10)
        if x is not None:
            state.w[4 + fields["x"]] = state.load(x, 16)
        if y is not None:
            state.w[4 + fields["y"]] = state.load(y, 16)

    def _write_back(self, value: int) -> None:
        """The other accumulator, rounded, to W13 or through it."""
        if self.fields.get("a", 2) == 0:
            self.state.w[13] = value
        elif self.fields.get("a", 2) == 1:
            self.state.store(self.state.w[13], value, 16)
            self.state.w[13] = self.state.w[13] + 2 & 0xFFFF

    def _mac_class(self, change) -> None:
        """change(accumulator, product) gives the accumulator's new exact value; None leaves it."""
        state, fields = self.state, self.fields
        which = fields["A"]
        other = self.out(state.acc[1 - which], rounded=True) if fields.get("a", 2) < 2 else 0
        product = 0
        if "m" in fields:
            first, second = PAIRS[fields["m"]] if self.kinds[0] == "Wm*Wn" else (4 + fields["m"], 4 + fields["m"])
            product = self.product(state.w[first], state.w[second])
        exact = change(state.acc[which], product)
        if exact is not None:
            self.result(which, exact)
        self._prefetch()
        self._write_back(other)

    def execute(self) -> None:
        """Runs the instruction."""
        if self.row.mnemonic in CHANGES:
            self._mac_class(CHANGES[self.row.mnemonic])
        else:
            super().execute()

    def _clr(self) -> None:
        """CLR Acc; its flags are cleared with it, SA and SB too."""
        which = self.fields["A"]
        self._mac_class(lambda acc, product: 0)
        self.state.set_flag(SA if which == 0 else SB, 0)
        self.state.set_flag(SAB, self.state.flag(SA) or self.state.flag(SB))

    def _distance(self, keep: bool) -> None:
        state, fields = self.state, self.fields
        value = state.w[4 + fields["m"]]
        self.result(fields["A"], (state.acc[fields["A"]] if keep else 0) + self.product(value, value))
        x, y = self._step(fields["i"], 8), self._step(fields["j"], 10)
        state.w[4 + fields["x"]] = state.load(x, 16) - state.load(y, 16) & 0xFFFF

    def _ed(self) -> None:
        self._distance(keep=False)

    def _edac(self) -> None:
        self._distance(keep=True)

    # ---- accumulator and shifter -------------------------------------------------------------------------------------
    def _shifted_source(self) -> int:
        shift = signed(self.fields["r"], 4)
        value = signed(self.source(), 16) << 16
        return value >> shift if shift >= 0 else value << -shift

    def _lac(self) -> None:
        self.result(self.fields["A"], self._shifted_source())

    def _add(self) -> None:
        which, acc = self.fields["A"], self.state.acc
        self.result(which, acc[0] + acc[1] if self.kinds == ["Acc"] else acc[which] + self._shifted_source())

    def _sub(self) -> None:
        which, acc = self.fields["A"], self.state.acc
        self.result(which, acc[which] - acc[1 - which])

    def _neg(self) -> None:
        self.result(self.fields["A"], -self.state.acc[self.fields["A"]])

    def _sftac(self) -> None:
        shift = signed(self.fields["k"], 6) if "k" in self.fields else signed(self.state.w[self.fields["s"]], 16)
        value = self.state.acc[self.fields["A"]]
        self.result(self.fields["A"], value >> shift if shift >= 0 else value << -shift)

    def _store_accumulator(self, rounded: bool) -> None:
        shift = signed(self.fields["r"], 4)
        value = self.state.acc[self.fields["A"]]
        value = value >> shift if shift >= 0 else signed(value << -shift, 40)
        self.write(self.out(value, rounded))

    def _sac(self) -> None:
        self._store_accumulator(rounded=False)

    def _sac_r(self) -> None:
        self._store_accumulator(rounded=True)
