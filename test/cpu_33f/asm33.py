"""A small assembler for the dsPIC33F: one row per encoding, and the same table read backwards to tell which words are instructions.

A row is mnemonic, operands, bit pattern. In a pattern 0 and 1 are fixed, a dot does not count, a letter is a field, most
significant bit first. Operands:

    Wb Ws Wd Wm    a register, in the field w s d m             {Ws} {Wd}      a register or an indirect mode, fields p s and q d
    {Ws+} {Wd+}    the same with [Ws+Wb], fields g s w, h d w   [Ws] [Wd]      only the indirect modes of {Ws} and {Wd}
    Ws: Wd:        an even register, for a pair                 [Ws+k] [Wd+k]  register with a signed offset k
    #k             unsigned literal; its width is the number of k's       #±k   signed literal (two's complement)
    f              address in the file registers                f.bit          address and bit number
    ,WREG          optional: the result goes to W0 (field D)    label          branch target, words relative to the next word (n)
    Acc            A or B (field A)                             X Y AWB ...    operands of the DSP engine, see _dsp

A mnemonic that ends in * takes .b (field B); without it, it works on words. Names between bars share a row: their number, from 0, is in
the bits @; a name of "-" leaves a number out. Written from the Programmer's Reference Manual (DS70157, "16-bit MCU and DSC Programmer's
Reference Manual"), chapter 5 and table 6.
"""

import re
from dataclasses import dataclass, field

ROWS_TEXT = """
add                               {Ws+},#±r,Acc     1100 1001 Awww wrrr rggg ssss
add|addc|sub|subb|and|xor|ior|-*  f,WREG            1011 01@@ @BDf ffff ffff ffff
add|addc|sub|subb|and|xor|ior|-*  #k,Wd             1011 00@@ @Bkk kkkk kkkk dddd
add|addc|sub|subb|and|xor|ior|-*  Wb,#k,{Wd}        01@@ @www wBqq qddd d11k kkkk
add|addc|sub|subb|and|xor|ior|-*  Wb,{Ws},{Wd}      01@@ @www wBqq qddd dppp ssss
add|neg|-|sub                     Acc               1100 1011 A0@@ 0000 0000 0000
bra                               ov|c|z|n|le|lt|leu|-,label 0011 0@@@ nnnn nnnn nnnn nnnn
bra                               nov|nc|nz|nn|gt|ge|gtu|-,label 0011 1@@@ nnnn nnnn nnnn nnnn
bra                               oa|ob|sa|sb,label 0000 11@@ nnnn nnnn nnnn nnnn
bra                               label             0011 0111 nnnn nnnn nnnn nnnn
bset|bclr|btg|-*                  {Ws},#b           1010 00@@ bbbb 0B00 0ppp ssss
bset|bclr|btg|-*                  f.bit             1010 10@@ bbbf ffff ffff ffff
bsw.c|bsw.z                       {Ws},Wb           1010 1101 @www w000 0ppp ssss
btss|btsc                         {Ws},#b           1010 011@ bbbb 0000 0ppp ssss
btss|btsc*                        f.bit             1010 111@ bbbf ffff ffff ffff
btst*                             f.bit             1010 1011 bbbf ffff ffff ffff
btst.c|btst.z                     {Ws},Wb           1010 0101 @www w000 0ppp ssss
btst.c|btst.z                     {Ws},#b           1010 0011 bbbb @000 0ppp ssss
btsts*                            f.bit             1010 1100 bbbf ffff ffff ffff
btsts.c|btsts.z                   {Ws},#b           1010 0100 bbbb @000 0ppp ssss
call                              target            0000 0010 nnnn nnnn nnnn nnn0 | 0000 0000 0000 0000 0nnn nnnn
call|goto                         Ws                0000 0001 0@00 0000 0000 ssss
clrwdt                            -                 1111 1110 0110 0000 0000 0000
clr|movsac                        Acc,X,Y,AWB       1100 0@11 A0xx yyii iijj jjaa
clr|setm*                         f                 1110 1111 @B1f ffff ffff ffff
clr|setm*                         WREG              1110 1111 @B00 0000 0000 0000
clr|setm*                         {Wd}              1110 1011 @Bqq qddd d000 0000
cp0*                              f                 1110 0010 0B0f ffff ffff ffff
cp0*                              {Ws}              1110 0000 0000 0B00 0ppp ssss
cpsgt|cpslt|cpsne|cpseq*          Wb,Ws             1110 011@ @www wB00 0000 ssss
cp|cpb*                           f                 1110 0011 @B0f ffff ffff ffff
cp|cpb*                           Wb,#k             1110 0001 @www wB00 011k kkkk
cp|cpb*                           Wb,{Ws}           1110 0001 @www wB00 0ppp ssss
daw.b                             Ws                1111 1101 0100 0000 0000 ssss
disi                              #k                1111 1100 00kk kkkk kkkk kkkk
div.sd|div.ud                     Wm:,Ws            1101 1000 @ttt tmmm m100 ssss
div.s|div.u                       Wm,Ws             1101 1000 @000 0mmm m000 ssss
divf                              Wm,Ws             1101 1001 0mmm m000 0000 ssss
do                                #k,label          0000 1000 00kk kkkk kkkk kkkk | 0000 0000 nnnn nnnn nnnn nnnn
do                                Ws,label          0000 1000 1000 0000 0000 ssss | 0000 0000 nnnn nnnn nnnn nnnn
edac|ed                           Wm*Wm,Acc,X-Y     1111 00mm A1xx 00ii iijj jj1@
exch                              Ws,Wd             1111 1101 0000 0ddd d000 ssss
fbcl                              {Ws},Wd           1101 1111 0000 0ddd dppp ssss
ff1r|ff1l                         {Ws},Wd           1100 1111 @000 0ddd dppp ssss
goto                              target            0000 0100 nnnn nnnn nnnn nnn0 | 0000 0000 0000 0000 0nnn nnnn
inc|inc2|dec|dec2|neg|com|-|-*    f,WREG            1110 11@@ @BDf ffff ffff ffff
inc|inc2|dec|dec2|neg|com|-|-*    {Ws},{Wd}         1110 10@@ @Bqq qddd dppp ssss
lac                               {Ws+},#±r,Acc     1100 1010 Awww wrrr rggg ssss
lnk                               #k0               1111 1010 00kk kkkk kkkk kkk0
lsr|asr                           Wb,#k,Wd          1101 1110 @www wddd d100 kkkk
lsr|asr                           Wb,Ws,Wd          1101 1110 @www wddd d000 ssss
mac|mpy                           Wm*Wm,Acc,X,Y     1111 00mm A0xx yyii iijj jj0@
mac|msc                           Wm*Wn,Acc,X,Y,AWB 1100 0mmm A@xx yyii iijj jjaa
mov                               f,Wd              1000 0fff ffff ffff ffff dddd
mov                               Ws,f              1000 1fff ffff ffff ffff ssss
mov                               #k,Wd             0010 kkkk kkkk kkkk kkkk dddd
mov*                              f,WREG            1011 1111 1BDf ffff ffff ffff
mov*                              WREG,f            1011 0111 1B1f ffff ffff ffff
mov*                              [Ws+k],Wd         1001 0kkk kBkk kddd dkkk ssss
mov*                              Ws,[Wd+k]         1001 1kkk kBkk kddd dkkk ssss
mov*                              {Ws+},{Wd+}       0111 1www wBhh hddd dggg ssss
mov.b                             #k,Wd             1011 0011 1100 kkkk kkkk dddd
mov.d                             {Ws:},Wd:         1011 1110 0000 0ddd dppp ssss
mov.d                             Ws:,[Wd]          1011 1110 10qq qddd d000 ssss
mpy|mpy.n                         Wm*Wn,Acc,X,Y     1100 0mmm A@xx yyii iijj jj11
mul*                              f                 1011 1100 0B0f ffff ffff ffff
mul.uu|mul.su                     Wb,#k,Wd:         1011 100@ 0www wddd d11k kkkk
mul.uu|mul.us|mul.su|mul.ss       Wb,{Ws},Wd:       1011 100@ @www wddd dppp ssss
nop                               -                 0000 0000 .... .... .... ....
nopr                              -                 1111 1111 .... .... .... ....
pop.s                             -                 1111 1110 1000 0000 0000 0000
push.s                            -                 1111 1110 1010 0000 0000 0000
push|pop                          f                 1111 100@ ffff ffff ffff fff0
pwrsav                            #k                1111 1110 0100 0000 0000 000k
rcall                             label             0000 0111 nnnn nnnn nnnn nnnn
rcall|bra                         Ws                0000 0001 0@10 0000 0000 ssss
repeat                            #k                0000 1001 00kk kkkk kkkk kkkk
repeat                            Ws                0000 1001 1000 0000 0000 ssss
reset                             -                 1111 1110 0000 0000 0000 0000
retlw*                            #k,Wd             0000 0101 0Bkk kkkk kkkk dddd
return|retfie                     -                 0000 0110 0@00 0000 0000 0000
sac|sac.r                         Acc,#±r,{Wd+}     1100 110@ Awww wrrr rhhh dddd
se|ze                             {Ws},Wd           1111 1011 @000 0ddd dppp ssss
sftac                             Acc,#±k           1100 1000 A000 0000 01kk kkkk
sftac                             Acc,Ws            1100 1000 A000 0000 0000 ssss
sl                                Wb,#k,Wd          1101 1101 0www wddd d100 kkkk
sl                                Wb,Ws,Wd          1101 1101 0www wddd d000 ssss
sl|-|lsr|asr|rlnc|rlc|rrnc|rrc*   f,WREG            1101 01@@ @BDf ffff ffff ffff
sl|-|lsr|asr|rlnc|rlc|rrnc|rrc*   {Ws},{Wd}         1101 00@@ @Bqq qddd dppp ssss
subr|subbr*                       f,WREG            1011 1101 @BDf ffff ffff ffff
subr|subbr*                       Wb,#k,{Wd}        0001 @www wBqq qddd d11k kkkk
subr|subbr*                       Wb,{Ws},{Wd}      0001 @www wBqq qddd dppp ssss
swap*                             Ws                1111 1101 1B00 0000 0000 ssss
tblrdl|tblrdh*                    [Ws],{Wd}         1011 1010 @Bqq qddd dppp ssss
tblwtl|tblwth*                    {Ws},[Wd]         1011 1011 @Bqq qddd dppp ssss
ulnk                              -                 1111 1010 1000 0000 0000 0000
"""

# Second names of the same words.
ALIASES = [
    (r"push\.d (w\d+)$", r"mov.d \1,[w15++]"), (r"pop\.d (w\d+)$", r"mov.d [--w15],\1"),
    (r"push(\.b|\.w)? (.*w\d.*)$", r"mov\1 \2,[w15++]"), (r"pop(\.b|\.w)? (.*w\d.*)$", r"mov\1 [--w15],\2"),
    (r"div\.([su])w ", r"div.\1 "), (r"bra geu,", "bra c,"), (r"bra ltu,", "bra nc,"),
]


class Unfit(ValueError):
    """An operand that does not fit a row."""


@dataclass
class Row:
    """One encoding; words holds the pattern of each of its words without spaces."""

    mnemonic: str
    byte: bool
    operands: list[str]
    words: list[str]
    text: str = field(repr=False)

    def insert(self, fields: dict[str, int]) -> list[int]:
        """The words with these field values."""
        left = {name: (value, self.width(name)) for name, value in fields.items()}
        result = []
        for pattern in self._in_field_order():
            word = 0
            for position, letter in enumerate(pattern):
                if letter == "1":
                    word |= 1 << 23 - position
                elif letter not in "0.":
                    value, width = left[letter]
                    left[letter] = (value, width - 1)
                    word |= (value >> width - 1 & 1) << 23 - position
            result.append(word)
        return result[::-1] if self._low_half_first() else result

    def extract(self, words: list[int]) -> dict[str, int]:
        """Field values of these words."""
        fields: dict[str, int] = {}
        ordered = words[:len(self.words)]
        for pattern, word in zip(self._in_field_order(), ordered[::-1] if self._low_half_first() else ordered):
            for position, letter in enumerate(pattern):
                if letter not in "01.":
                    fields[letter] = fields.get(letter, 0) << 1 | word >> 23 - position & 1
        return fields

    def width(self, letter: str) -> int:
        """Bits of a field."""
        return sum(pattern.count(letter) for pattern in self.words)

    def matches(self, word: int) -> bool:
        """Whether a first word can be this encoding; of the fields, only the modes that do not exist are looked at."""
        if any(bit in "01" and int(bit) != word >> 23 - position & 1 for position, bit in enumerate(self.words[0])):
            return False
        fields = self.extract([word, 0])
        if "t" in fields and fields["t"] != fields["m"] + 1:  # the dividend's upper half
            return False
        if fields.get("B") and fields.get("b", 0) > 7:  # a byte has no such bit
            return False
        if "X-Y" in self.operands and 4 in (fields["i"], fields["j"]):  # ED needs both numbers
            return False
        return all(_field_is_legal(self, name, value) for name, value in fields.items())

    def _low_half_first(self) -> bool:
        return "target" in self.operands

    def _in_field_order(self) -> list[str]:
        return self.words[::-1] if self._low_half_first() else self.words


def _single(line: str) -> list[str]:
    """A line of the table as one for each of its names."""
    names = re.search(r"[\w.-]+(\|[\w.-]+)+", line)
    if not names:
        return [line]
    bits = [iter(f"{number:0{line.count('@')}b}") for number in range(names[0].count("|") + 1)]
    return [re.sub("@", lambda _: next(number), line.replace(names[0], name))
            for name, number in zip(names[0].split("|"), bits) if name != "-"]


def _read_rows() -> list[Row]:
    rows = []
    for line in (single for line in ROWS_TEXT.strip().splitlines() for single in _single(line)):
        mnemonic, operands, pattern = line.split(maxsplit=2)
        words = [word.replace(" ", "") for word in pattern.split("|")]
        assert all(len(word) == 24 for word in words), line
        rows.append(Row(mnemonic.rstrip("*"), mnemonic.endswith("*"), [] if operands == "-" else operands.split(","), words, line))
    return rows


MODES = {"{}": 0, "[{}]": 1, "[{}--]": 2, "[{}++]": 3, "[--{}]": 4, "[++{}]": 5}
X_STEPS = {0: 0, 2: 1, 4: 2, 6: 3, -6: 5, -4: 6, -2: 7}
PAIRS = {(4, 5): 0, (4, 6): 1, (4, 7): 2, (5, 6): 4, (5, 7): 5, (6, 7): 6}
ROWS = _read_rows()
_BY_NAME: dict[str, list[Row]] = {}
for _row in ROWS:
    _BY_NAME.setdefault(_row.mnemonic, []).append(_row)
_BY_HIGH_BYTE = [[row for row in ROWS if all(bit not in "01" or int(bit) == high >> 7 - position & 1 for position, bit in enumerate(row.words[0][:8]))]
                 for high in range(256)]


def _field_is_legal(row: Row, name: str, value: int) -> bool:
    """Whether a field's value exists: modes, prefetch codes, pairs of registers, accumulator write-back."""
    operands = row.text.split(maxsplit=2)[1]
    if name in "pq":
        return value <= 5 and not ("[Ws]" in operands and name == "p" and value == 0) and not (
            "[Wd]" in operands and name == "q" and value == 0)
    if name == "a":
        return value != 3
    if name == "m" and "Wm*Wn" in operands:
        return value in PAIRS.values()
    if name == "s" and row.mnemonic.startswith("div"):
        return value >= 2  # the divisor: W0 and W1 hold the result
    if name == "m" and "Wm:" in operands or name in "sd" and f"W{name}:" in operands:
        return value % 2 == 0 or f"{{W{name}:}}" in operands  # a pair starts at an even register; as an address any will do
    return True


def match(word: int) -> Row | None:
    """The row of a word, or None: not an instruction. Second words of CALL, GOTO and DO read as NOP."""
    return next((row for row in _BY_HIGH_BYTE[word >> 16] if row.matches(word)), None)


def split(text: str) -> list[str]:
    """Operands between commas."""
    return [part.strip() for part in text.split(",")] if text.strip() else []


def number(text: str, symbols: dict[str, int]) -> int:
    """An integer, a symbol, or symbol plus or minus an integer."""
    text = text.strip().lower()
    plus = re.fullmatch(r"([a-z_.]\w*)\s*([+-]\s*\w+)?", text)
    if plus and plus[1] in symbols:
        return symbols[plus[1]] + (int(plus[2].replace(" ", ""), 0) if plus[2] else 0)
    try:
        return int(text, 0)
    except ValueError:
        raise Unfit(f"{text}: no number and no symbol") from None


def _register(text: str) -> int:
    found = re.fullmatch(r"w(\d|1[0-5])", text)
    if not found:
        raise Unfit(f"{text} is no register")
    return int(found[1])


def _mode(text: str) -> tuple[int, int, int | None]:
    """Mode, register and, for [Wx+Wy], the offset register."""
    for form, mode in MODES.items():
        found = re.fullmatch(re.escape(form).replace(r"\{\}", r"(w\d+)"), text)
        if found:
            return mode, _register(found[1]), None
    found = re.fullmatch(r"\[(w\d+)\s*\+\s*(w\d+)\]", text)
    if found:
        return 6, _register(found[1]), _register(found[2])
    raise Unfit(f"{text} is no register or indirect operand")


def _literal(text: str, width: int, signed: bool, symbols: dict[str, int]) -> int:
    if not text.startswith("#"):
        raise Unfit(f"{text} is no literal")
    value = number(text[1:], symbols)
    low, high = (-(1 << width - 1), (1 << width - 1) - 1) if signed else (0, (1 << width) - 1)
    if not low <= value <= high:
        raise Unfit(f"{text} is not in {low}..{high}")
    return value & (1 << width) - 1


class Line:
    """Encodes one instruction by one row; fields collects the values."""

    def __init__(self, row: Row, byte: bool, operands: list[str], address: int, symbols: dict[str, int]) -> None:
        self.row, self.byte, self.address, self.symbols = row, byte, address, symbols
        self.fields: dict[str, int] = {letter: 0 for letter in set("".join(row.words)) - set("01.")}
        if "B" in self.fields:
            self.fields["B"] = int(byte)
        self.kinds = list(row.operands)
        self.left = list(operands)
        while self.kinds:
            self._next(self.kinds.pop(0))
        if self.left:
            raise Unfit("too many operands")

    def words(self) -> list[int]:
        """The encoded instruction."""
        return self.row.insert(self.fields)

    def _take(self) -> str:
        if not self.left:
            raise Unfit("an operand is missing")
        return self.left.pop(0)

    def _next(self, kind: str) -> None:
        name = kind.strip("{}[]:+")
        if kind == "WREG" and "D" in self.fields:
            if self.left:
                self._exactly("wreg")
            else:
                self.fields["D"] = 1
        elif kind == "WREG":
            self._exactly("wreg")
        elif kind in ("f", "f.bit"):
            self._file(kind)
        elif kind == "Wm*Wn" or kind == "Wm*Wm":
            self._product(kind)
        elif kind in ("X", "Y", "AWB", "X-Y"):
            self._dsp(kind)
        elif kind == "Acc":
            self.fields["A"] = {"a": 0, "b": 1}.get(self._take(), 2)
            if self.fields["A"] == 2:
                raise Unfit("no accumulator")
        elif kind.startswith("#"):
            self._number(kind)
        elif kind in ("label", "target"):
            self._target(kind)
        elif kind in ("[Ws+k]", "[Wd+k]"):
            self._offset(kind[2])
        elif kind.startswith(("{", "[")):
            self._indirect(kind, name)
        elif re.fullmatch(r"W[bsdm]:?", kind):
            self._plain(name[1], pair=kind.endswith(":"))
        else:
            self._exactly(kind)

    def _exactly(self, text: str) -> None:
        if self._take() != text:
            raise Unfit(f"{text} expected")

    def _plain(self, letter: str, pair: bool) -> None:
        value = _register(self._take())
        if pair and value % 2:
            raise Unfit(f"w{value} does not start a pair")
        self.fields["w" if letter == "b" else letter] = value
        if letter == "m" and "t" in self.fields:
            self.fields["t"] = value + 1
        if not _field_is_legal(self.row, letter, value):
            raise Unfit(f"w{value} not allowed")

    def _indirect(self, kind: str, name: str) -> None:
        letter = name[1]
        mode, register, offset = _mode(self._take())
        if kind.startswith("[") and mode == 0 or offset is not None and "+" not in kind:
            raise Unfit("mode not allowed")
        if ":" in kind and mode == 0 and register % 2:
            raise Unfit(f"w{register} does not start a pair")
        mode_letter = ({"s": "g", "d": "h"} if "+" in kind else {"s": "p", "d": "q"})[letter]
        self.fields[mode_letter], self.fields[letter] = mode, register
        if offset is not None:
            if getattr(self, "offset", offset) != offset:
                raise Unfit("one offset register only")
            self.offset = self.fields["w"] = offset

    def _offset(self, letter: str) -> None:
        found = re.fullmatch(r"\[(w\d+)\s*([+-]\s*\w+)\]", self._take())
        if not found or re.fullmatch(r"\+\s*w\d+", found[2]):
            raise Unfit("register with a number expected")
        value, step = int(found[2].replace(" ", ""), 0), 1 if self.byte else 2
        if value % step or not -512 <= value // step <= 511:
            raise Unfit(f"offset {value} does not fit")
        self.fields[letter], self.fields["k"] = _register(found[1]), value // step & 0x3FF

    def _file(self, kind: str) -> None:
        address = number(self._take(), self.symbols)
        width = self.row.width("f")
        if kind == "f.bit":
            bit = _literal(self._take(), 3 if self.byte else 4, False, self.symbols)
            if not self.byte and address & 1:
                raise Unfit(f"odd address {address:#x}")
            self.fields["b"] = bit & 7
            address |= bit >> 3
        elif not self.byte and address & 1:
            raise Unfit(f"odd address {address:#x}")
        if width == 15:  # word address
            address, width = address >> 1, 15
        if not 0 <= address < 1 << width:
            raise Unfit(f"address {address:#x} is too far")
        self.fields["f"] = address

    def _number(self, kind: str) -> None:
        signed, letter = "±" in kind, kind.strip("#±0")
        if letter == "r" and (not self.left or not self.left[0].startswith("#")):
            return  # a shift left away is 0
        width = self.row.width(letter)
        text = self._take()
        if kind == "#k0":
            value = _literal(text, width + 1, False, self.symbols)
            if value & 1:
                raise Unfit(f"{text} is odd")
            self.fields[letter] = value >> 1
            return
        value = _literal(text, width, signed, self.symbols)
        if self.byte and "B" in self.fields and (letter == "b" and value > 7 or letter == "k" and value > 255):
            raise Unfit(f"{text} is too large for a byte")
        if self.row.mnemonic == "sftac" and not -16 <= (value ^ 32) - 32 <= 16:
            raise Unfit(f"{text} is not in -16..16")
        self.fields[letter] = value

    def _target(self, kind: str) -> None:
        text = self._take()
        to = self.address + int(text[1:] or "0", 0) if re.fullmatch(r"\.([+-]\w+)?", text) else number(text, self.symbols)
        if to & 1:
            raise Unfit(f"odd target {to:#x}")
        if kind == "target":
            self.fields["n"] = to >> 1
            return
        words = (to - self.address - 2 * len(self.row.words)) >> 1
        if not -0x8000 <= words <= 0x7FFF:
            raise Unfit(f"target {to:#x} is too far")
        self.fields["n"] = words & 0xFFFF

    def _product(self, kind: str) -> None:
        found = re.fullmatch(r"(w\d+)\s*\*\s*(w\d+)", self._take())
        if not found:
            raise Unfit("product expected")
        pair = tuple(sorted((_register(found[1]), _register(found[2]))))
        if kind == "Wm*Wm":
            if pair[0] != pair[1] or not 4 <= pair[0] <= 7:
                raise Unfit("square of w4..w7 expected")
            self.fields["m"] = pair[0] - 4
        elif pair in PAIRS:
            self.fields["m"] = PAIRS[pair]
        else:
            raise Unfit("product of w4..w7 expected")

    def _dsp(self, kind: str) -> None:
        if kind == "X-Y":  # two addresses, one register that takes the difference
            self.fields["i"] = self._prefetch("X", self._take())
            self.fields["j"] = self._prefetch("Y", self._take())
            self._taken("x")
        elif kind in "XY":
            code, into = ("i", "x") if kind == "X" else ("j", "y")
            try:
                self.fields[code] = self._prefetch(kind, self.left[0] if self.left else "")
            except Unfit:
                self.fields[code] = 4
                return
            self._take()
            self._taken(into)
        else:
            self.fields["a"] = {"w13": 0, "[w13]+=2": 1}.get(self._take().replace(" ", ""), 3) if self.left else 2
            if self.fields["a"] == 3:
                raise Unfit("no write-back")

    def _taken(self, letter: str) -> None:
        register = _register(self._take())
        if not 4 <= register <= 7:
            raise Unfit("w4..w7 expected")
        self.fields[letter] = register - 4

    def _prefetch(self, space: str, text: str) -> int:
        base = 8 if space == "X" else 10
        if text.replace(" ", "") == f"[w{base + 1}+w12]":
            return 12
        found = re.fullmatch(r"\[(w\d+)\](?:([+-])=([246]))?", text.replace(" ", ""))
        if not found or _register(found[1]) not in (base, base + 1):
            raise Unfit("no prefetch")
        step = int(found[2] + found[3]) if found[2] else 0
        return X_STEPS[step] | (8 if _register(found[1]) > base else 0)


def encode(text: str, address: int = 0, symbols: dict[str, int] | None = None) -> list[int]:
    """The words of one instruction."""
    text = re.sub(r"\s+", " ", text.strip().lower())
    text = re.sub(r"\s*,\s*", ",", text)
    for form, replacement in ALIASES:
        text = re.sub(f"^{form}", replacement, text)
    name, _, rest = text.partition(" ")
    if name == ".word24":
        return [int(rest, 0)]
    byte = False
    rows = _BY_NAME.get(name)
    if name.endswith((".b", ".w")) and (rows is None or name == "mov.b"):
        byte = name.endswith(".b")
        rows = [*(rows or []), *(row for row in _BY_NAME.get(name[:-2], []) if row.byte or not byte)]
    why = "unknown instruction"
    for row in rows or []:
        try:
            return Line(row, byte, split(rest), address, symbols or {}).words()
        except Unfit as error:
            why = str(error)
    raise ValueError(f"{text}: {why}")


def length(text: str) -> int:
    """Words of an instruction, known before its operands are."""
    name, _, rest = text.strip().lower().partition(" ")
    return 2 if name == "do" or name in ("call", "goto") and not re.fullmatch(r"\s*w\d+\s*", rest) else 1


def assemble(text: str, origin: int = 0x200, symbols: dict[str, int] | None = None) -> tuple[dict[int, int], dict[str, int]]:
    """Words by program address and all labels of a program; instructions stand on lines or between semicolons, "label:" before them.

    ".org address" goes on at another address; "end" is the label after the last instruction.
    """
    labels = dict(symbols or {})
    lines: list[tuple[int, str]] = []
    address = origin
    for line in re.split(r"[;\n]", text):
        line = line.split("//")[0].strip()
        while found := re.match(r"(\w+):\s*", line):
            labels[found[1].lower()] = address
            line = line[found.end():]
        if line.startswith(".org"):
            address = int(line.split()[1], 0)
        elif line:
            lines.append((address, line))
            address += 2 * length(line)
    labels["end"] = address
    words: dict[int, int] = {}
    for at, line in lines:
        for index, word in enumerate(encode(line, at, labels)):
            words[at + 2 * index] = word
    return words, labels
