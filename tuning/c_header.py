"""Reads the #defines of a C header as the chip's compiler would: comments, continued lines, #ifdef, macros with parameters, expressions.

    header = read(Path("userparms.h"))
    header.value("NORM_RS")        the number, with C's integers: 1/20000 is 0
    header.branches                which branch of each #ifdef was taken

Nothing is included. Q15(x) and NORM_CURRENT(x) mean what AN1292 means, where the header does not define them."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from tools.common import paths
from tools.common.errors import UserError, suggestion

Number = int | float

LARGEST_FILE = 1 << 18
MOST_TOKENS = 5000
"""Of one expression with its macros replaced."""
DEEPEST = 30
LARGEST = 1e30
WORD_BITS = 16
"""Of the chip's int."""
TOKEN = re.compile(r"\s*(0[xX][0-9a-fA-F]+[uUlL]*(?![\w.])|(?:\d+\.\d*|\.\d+|\d+)(?:[eE][-+]?\d+)?\w*|[A-Za-z_]\w*|<<|>>|<=|>=|==|!=|&&|\|\||\S)")
COMMENT = re.compile(r"\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'|//(?:\\\n|[^\n])*|/\*[\s\S]*?(?:\*/|\Z)")
DIRECTIVE = re.compile(r"\s*#\s*(\w*)\s*(.*)", re.DOTALL)
DEFINE = re.compile(r"([A-Za-z_]\w*)(\(([^()]*)\))?(.*)", re.DOTALL)
SHORT_TYPES = {"int", "short", "signed", "char", "SFRAC16", "SFRAC", "fractional", "int16_t", "INT16"}
LONG_TYPES = {"long", "int32_t", "uint32_t", "INT32", "UINT32", "unsigned", "uint16_t", "UINT16", "WORD", "DWORD"}
REAL_TYPES = {"float", "double"}
TYPES = SHORT_TYPES | LONG_TYPES | REAL_TYPES
LEVELS = (("||",), ("&&",), ("|",), ("^",), ("&",), ("==", "!="), ("<", ">", "<=", ">="), ("<<", ">>"), ("+", "-"), ("*", "/", "%"))
"""Operators of two operands, the loosest first."""
BUILT_IN = ("Q15", "NORM_CURRENT")


@dataclass(frozen=True)
class Define:
    """One #define as it stands."""

    name: str
    body: str
    line: int
    parameters: tuple[str, ...] | None = None
    """None: a macro without brackets"""


@dataclass
class Branch:
    """One #if, #ifdef or #ifndef with its #elif and #else."""

    line: int
    text: str
    taken: str = ""
    """the directive whose lines count, with its line; "" for none"""
    outer: bool = True
    """whether the lines around it count"""
    counts: bool = False
    """whether the lines at this place count"""


@dataclass
class Header:
    """What a header defines. `label` is its name in messages."""

    label: str
    defines: dict[str, Define] = field(default_factory=dict)
    branches: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    """what was read in another way than a compiler would, or not at all"""
    semicolons: list[int] = field(default_factory=list)
    """lines whose number ends in one, as AN1292's Example 6 prints it"""

    def where(self, line: int) -> str:
        return f"{self.label}:{line}"

    def place(self, name: str) -> str:
        """File and line of a definition."""
        return self.where(self.defines[name].line)

    def __contains__(self, name: str) -> bool:
        return name in self.defines

    def value(self, name: str) -> Number:
        """The number of a macro without brackets."""
        define = self.defines[name]
        tokens = _tokens(define.body, self.place(name), name)
        if not tokens:
            raise UserError(f"{name} has no value", self.place(name), "write a number behind it")
        return _Expression(self, name, define.line).of(tokens)


# ---- files ------------------------------------------------------------------------------------------------------------------
def read(path: Path, defined: dict[str, str] | None = None) -> Header:
    """The header in a file; `defined`: what the compiler's -D would add."""
    header = Header(str(paths.shown(path)))
    text = _text(path, header.label)
    for name, body in (defined or {}).items():
        header.defines[name] = Define(name, body, 0)
    if not re.search(r"^[ \t]*#[ \t]*define\b", text, re.MULTILINE):
        raise UserError("no #define in the file", header.label, "give a C header such as AN1292's userparms.h")
    _read_lines(header, _lines(text, header.label))
    if header.semicolons:
        lines = ", ".join(map(str, header.semicolons[:3])) + (f" ... {header.semicolons[-1]}" if len(header.semicolons) > 3 else "")
        header.notes.append(f"line {lines}: a semicolon behind a number is left out")
    return header


def _text(path: Path, label: str) -> str:
    remedy = "give a C header such as AN1292's userparms.h"
    try:
        if path.is_dir():
            raise UserError("this is a folder", label, remedy)
        if path.exists() and not path.is_file():
            raise UserError("this is no file", label, remedy)
        if path.exists() and path.stat().st_size > LARGEST_FILE:
            raise UserError(f"the file is too large, {path.stat().st_size // 1024} KiB", label, remedy)
        data = path.read_bytes()
    except FileNotFoundError:
        raise UserError("no such file", label, "check the path of HEADER=") from None
    except (OSError, ValueError) as error:
        raise UserError(f"cannot read the file ({getattr(error, 'strerror', error)})", label, "make it readable") from None
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise UserError("the file is UTF-16", label, "save it as UTF-8 or ASCII, as a compiler reads it")
    if b"\0" in data:
        raise UserError("the file is binary", label, remedy)
    if not data.strip():
        raise UserError("the file is empty", label, remedy)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1") # comments of an older editor
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _lines(text: str, label: str) -> list[tuple[int, str]]:
    """Logical lines without comments, each with the number of its first line."""
    def blank(match: re.Match[str]) -> str:
        found = match[0]
        if found.startswith("/*") and (len(found) < 4 or not found.endswith("*/")):
            raise UserError("a comment is not closed", f"{label}:{text.count(chr(10), 0, match.start()) + 1}", "end it with */")
        return found if found[0] in "\"'" else " " + "\n" * found.count("\n")

    found: list[tuple[int, str]] = []
    held, first = "", 0
    for number, line in enumerate(COMMENT.sub(blank, text).split("\n"), 1):
        first = first or number
        if line.rstrip().endswith("\\"):
            held += line.rstrip()[:-1] + " "
            continue
        found.append((first, held + line))
        held, first = "", 0
    return [*found, (first, held)] if held else found


# ---- directives -------------------------------------------------------------------------------------------------------------
def _read_lines(header: Header, lines: Iterable[tuple[int, str]]) -> None:
    stack: list[Branch] = []
    for number, line in lines:
        match = DIRECTIVE.fullmatch(line)
        if not match:
            continue
        word, rest = match[1], match[2].strip()
        if word in ("if", "ifdef", "ifndef", "elif", "else", "endif"):
            _branch(header, stack, number, word, rest)
        elif not stack or stack[-1].counts:
            _directive(header, number, word, rest)
    if stack:
        raise UserError(f"{stack[-1].text} is not closed", header.where(stack[-1].line), "add its #endif")


def _directive(header: Header, number: int, word: str, rest: str) -> None:
    if word == "define":
        _define(header, number, rest)
    elif word == "undef":
        header.defines.pop(rest, None)
    elif word == "include":
        header.notes.append(f"line {number}: #include {rest} is not read")
    elif word == "error":
        raise UserError(f"#error {rest}", header.where(number), "the header refuses what is defined; add DEFINES=-DNAME")
    elif word not in ("", "pragma", "warning", "line", "undef"):
        raise UserError(f"#{word} is no directive", header.where(number), suggestion(word, ("define", "undef", "ifdef", "ifndef", "include")))


def _define(header: Header, number: int, rest: str) -> None:
    match = DEFINE.fullmatch(rest)
    if not match:
        raise UserError("a #define without a name", header.where(number), "write #define NAME number")
    name, brackets, inside, body = match.groups()
    body = body.strip()
    if body.endswith(";"):
        body = body.rstrip("; \t")
        header.semicolons.append(number)
    parameters = tuple(word.strip() for word in inside.split(",") if word.strip()) if brackets else None
    old = header.defines.get(name)
    if old and old.line and old.body.split() != body.split():
        header.notes.append(f"line {number}: {name} is defined again, line {old.line} has '{old.body}': the last one, '{body}', counts")
    header.defines[name] = Define(name, body, number, parameters)


def _branch(header: Header, stack: list[Branch], number: int, word: str, rest: str) -> None:
    """Goes into, through or out of an #if."""
    text = f"#{word} {rest}".strip()
    if word in ("if", "ifdef", "ifndef"):
        item = Branch(number, text, outer=not stack or stack[-1].counts)
        stack.append(item)
    elif not stack:
        raise UserError(f"{text} without #if", header.where(number), "remove it, or add the #ifdef")
    else:
        item = stack[-1]
    if word == "endif":
        stack.pop()
        _tell(header, item)
        return
    item.counts = item.outer and not item.taken and _holds(header, number, word, rest)
    if item.counts:
        item.taken = text if number == item.line else f"{text} in line {number}"


def _tell(header: Header, item: Branch) -> None:
    name = item.text.split()[-1]
    if not item.outer or (item.text.startswith("#ifndef") and name in header.defines and not header.defines[name].body):
        return # inside of what does not count, or the guard against a second inclusion
    how = "taken" if item.taken == item.text else f"not taken, but {item.taken}" if item.taken else "not taken"
    header.branches.append(f"line {item.line}: {item.text} is {how}")


def _holds(header: Header, number: int, word: str, rest: str) -> bool:
    if word == "else":
        return True
    if word in ("ifdef", "ifndef"):
        name = rest.split()[0] if rest else ""
        if not name:
            raise UserError(f"#{word} without a name", header.where(number), "write the name of a macro")
        return (name in header.defines) == (word == "ifdef")
    known = re.sub(r"\bdefined\s*(?:\(\s*(\w+)\s*\)|(\w+))", lambda m: "1" if (m[1] or m[2]) in header.defines else "0", rest)
    tokens = _tokens(known, header.where(number), f"#{word}")
    if not tokens:
        raise UserError(f"#{word} without a condition", header.where(number), "write one")
    return bool(_Expression(header, f"#{word}", number, unknown=0).of(tokens))


# ---- expressions --------------------------------------------------------------------------------------------------------------
def _tokens(text: str, where: str, name: str) -> list[str]:
    found = TOKEN.findall(text)
    if len(found) > MOST_TOKENS:
        raise UserError(f"{name} is too long", where, "write a number")
    return found


def truncated(value: Number) -> int:
    """C's conversion to an integer: towards zero."""
    return math.trunc(value)


class _Expression:
    """Expands and computes one expression; `name` and `line` are for messages, `unknown` is an undefined name's value (None: refused)."""

    def __init__(self, header: Header, name: str, line: int, unknown: Number | None = None) -> None:
        self.header, self.name, self.line, self.unknown = header, name, line, unknown
        self.tokens: list[str] = []
        self.at = 0
        self.depth = 0

    def fail(self, what: str, remedy: str) -> UserError:
        return UserError(f"{self.name}: {what}", self.header.where(self.line), remedy)

    def of(self, tokens: list[str]) -> Number:
        """The value of an expression."""
        self.tokens, self.at = self._expanded(tokens, frozenset()), 0
        try:
            value = self._ternary()
        except RecursionError:
            raise self.fail("the expression is too deep", "write a number") from None
        if self.at < len(self.tokens):
            raise self._unexpected()
        return value

    # -- macros --
    def _expanded(self, tokens: list[str], hidden: frozenset[str]) -> list[str]:
        found: list[str] = []
        at = 0
        while at < len(tokens):
            define = self.header.defines.get(tokens[at])
            at += 1
            if define is None or define.name in hidden or (define.name in BUILT_IN and not define.body):
                found.append(tokens[at - 1])
            elif define.parameters is None:
                found += self._replaced(define, {}, hidden)
            elif at < len(tokens) and tokens[at] == "(":
                arguments, at = self._arguments(tokens, at)
                if len(arguments) != len(define.parameters):
                    raise self.fail(f"{define.name} has {len(arguments)} arguments instead of {len(define.parameters)}", "correct the brackets")
                expanded = [self._expanded(argument, hidden) for argument in arguments]
                found += self._replaced(define, dict(zip(define.parameters, expanded)), hidden)
            else:
                raise self.fail(f"{define.name} has no brackets here", f"write {define.name}(number)")
            if len(found) > MOST_TOKENS:
                raise self.fail("its macros become too long", "write a number")
        return found

    def _replaced(self, define: Define, arguments: dict[str, list[str]], hidden: frozenset[str]) -> list[str]:
        if len(hidden) > DEEPEST:
            raise self.fail("its macros are too deep", "write a number")
        tokens = [part for token in _tokens(define.body, self.header.where(define.line), define.name) for part in arguments.get(token, [token])]
        return self._expanded(tokens, hidden | {define.name})

    def _arguments(self, tokens: list[str], at: int) -> tuple[list[list[str]], int]:
        """Arguments of a macro whose bracket opens at `at`, and what follows."""
        found: list[list[str]] = [[]]
        depth = 0
        for place in range(at, len(tokens)):
            token = tokens[place]
            depth += (token == "(") - (token == ")")
            if depth == 0:
                return found, place + 1
            if token == "," and depth == 1:
                found.append([])
            elif place > at:
                found[-1].append(token)
        raise self.fail("a bracket is not closed", "add )")

    # -- values --
    def _peek(self, ahead: int = 0) -> str:
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else ""

    def _unexpected(self) -> UserError:
        token = self._peek()
        if token == ",":
            return self.fail("a comma in a number", "write it with a decimal point")
        return self.fail(f"'{token}' is not expected" if token else "the expression ends too early", "correct the expression, or write a number")

    def _take(self, token: str) -> None:
        if self._peek() != token:
            raise self._unexpected() if self._peek() else self.fail("a bracket is not closed", f"add {token}")
        self.at += 1

    def _ternary(self) -> Number:
        condition = self._binary(0)
        if self._peek() != "?":
            return condition
        self.at += 1
        chosen = self._maybe(bool(condition), self._ternary)
        self._take(":")
        other = self._maybe(not condition, self._ternary)
        return chosen if condition else other

    def _maybe(self, counts: bool, part) -> Number:
        """A part's value; what is wrong in one that C would not compute does not count."""
        start = self.at
        try:
            return part()
        except UserError:
            if counts:
                raise
            self.at = self._end_of_part(start)
            return 0

    def _end_of_part(self, at: int) -> int:
        depth = 0
        while at < len(self.tokens) and not (depth == 0 and self.tokens[at] in (")", ":")):
            depth += (self.tokens[at] == "(") - (self.tokens[at] == ")")
            at += 1
        return at

    def _binary(self, level: int) -> Number:
        if level == len(LEVELS):
            return self._unary()
        left = self._binary(level + 1)
        while self._peek() in LEVELS[level]:
            operator = self._peek()
            self.at += 1
            left = self._computed(operator, left, self._binary(level + 1))
        return left

    def _computed(self, operator: str, left: Number, right: Number) -> Number:
        value = self._operated(operator, left, right)
        if not abs(value) < LARGEST:
            raise self.fail(f"'{operator}' gives a number out of range", "write a smaller number")
        return value

    def _operated(self, operator: str, left: Number, right: Number) -> Number:
        whole = isinstance(left, int) and isinstance(right, int)
        if operator in ("/", "%") and right == 0:
            raise self.fail("division by zero", "correct the divisor")
        if operator in ("%", "<<", ">>", "&", "|", "^") and (not whole or operator in ("<<", ">>") and not 0 <= right < 32):
            raise self.fail(f"'{operator}' of these numbers", "use whole numbers")
        if operator == "/":
            return truncated(abs(left) // abs(right)) * (1 if (left < 0) == (right < 0) else -1) if whole else left / right
        if operator == "%":
            return int(math.fmod(left, right))
        simple = {"+": lambda: left + right, "-": lambda: left - right, "*": lambda: left * right, "<<": lambda: left << right, ">>": lambda: left >> right,
                  "&": lambda: left & right, "|": lambda: left | right, "^": lambda: left ^ right, "&&": lambda: int(bool(left and right)),
                  "||": lambda: int(bool(left or right)), "==": lambda: int(left == right), "!=": lambda: int(left != right),
                  "<": lambda: int(left < right), ">": lambda: int(left > right), "<=": lambda: int(left <= right), ">=": lambda: int(left >= right)}
        return simple[operator]()

    def _unary(self) -> Number:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self.fail("its brackets are too deep", "write a number")
        try:
            token = self._peek()
            if token in ("-", "+", "!", "~"):
                self.at += 1
                value = self._unary()
                if token == "~" and not isinstance(value, int):
                    raise self.fail("'~' of this number", "use whole numbers")
                return {"-": lambda: -value, "+": lambda: value, "!": lambda: int(not value), "~": lambda: ~value}[token]()
            if token == "(" and self._peek(1) in TYPES:
                return self._cast()
            return self._primary()
        finally:
            self.depth -= 1

    def _cast(self) -> Number:
        self.at += 1
        words = []
        while self._peek() in TYPES:
            words.append(self._peek())
            self.at += 1
        self._take(")")
        value = self._unary()
        if set(words) & REAL_TYPES:
            return float(value)
        return self._word(truncated(value), f"({' '.join(words)})") if not set(words) & LONG_TYPES else truncated(value)

    def _word(self, value: int, what: str) -> int:
        most = 1 << (WORD_BITS - 1)
        if not -most <= value < most:
            raise self.fail(f"{what} of it is {value}, which {WORD_BITS} bits do not hold", f"choose {-most} .. {most - 1}")
        return value

    def _primary(self) -> Number:
        token = self._peek()
        self.at += 1
        if token == "(":
            value = self._ternary()
            self._take(")")
            return value
        if token[:1].isdigit() or (token[:1] == "." and len(token) > 1):
            return self._number(token)
        if token in BUILT_IN and self._peek() == "(":
            self.at += 1
            value = self._ternary()
            self._take(")")
            return self._q15(value if token == "Q15" else self._share(value))
        if re.fullmatch(r"[A-Za-z_]\w*", token):
            if self.unknown is not None:
                return self.unknown
            if token in self.header.defines:
                raise self.fail(f"{token} in line {self.header.defines[token].line} leads back to itself", "write its number there")
            raise self.fail(f"{token} is not defined in this header", f"write its number, or add #define {token} with its number")
        self.at -= 1
        raise self._unexpected()

    def _share(self, ampere: Number) -> float:
        """A current over full scale: I / NORM_CURRENT_CONST / 32768."""
        name = "NORM_CURRENT_CONST"
        if name not in self.header:
            raise self.fail(f"NORM_CURRENT needs {name}", f"add #define {name} with the ampere of a count")
        constant = self.header.value(name)
        if constant == 0:
            raise UserError(f"{name} is 0", self.header.place(name), "write the ampere of a count")
        return ampere / constant / 32768.0

    def _q15(self, fraction: Number) -> int:
        """AN1292's Q15(): positive numbers times 32767, negative ones times 32768, rounded away from zero."""
        if not -1.0 <= fraction <= 1.0:
            raise self.fail(f"Q15({fraction:g}) is beyond -1 .. 1", "a current must be below full scale, 32768 * NORM_CURRENT_CONST" if "NORM_CURRENT" in
                            self.header.defines.get(self.name, Define("", "", 0)).body else "choose a fraction of full scale")
        return truncated(fraction * 32768.0 - 0.5) if fraction < 0.0 else truncated(fraction * 32767.0 + 0.5)

    def _number(self, token: str) -> Number:
        if re.fullmatch(r"0[xX][0-9a-fA-F]+[uUlL]*", token):
            return int(re.sub(r"[uUlL]+$", "", token), 16)
        digits = re.match(r"(?:\d+\.\d*|\.\d+|\d+)(?:[eE][-+]?\d+)?", token)
        assert digits
        suffix = token[digits.end():]
        whole = digits[0].isdigit()
        if not re.fullmatch(r"[uU]?[lL]{0,2}|[lL]{1,2}[uU]?" if whole else r"[fFlL]?", suffix):
            raise self.fail(f"'{token}' is no number", "write it with a decimal point and without a unit")
        if whole and len(digits[0]) > 1 and digits[0].startswith("0"):
            raise self.fail(f"'{token}' is octal in C", f"write {digits[0].lstrip('0') or '0'} without the zero in front")
        value = int(digits[0]) if whole else float(digits[0])
        if not math.isfinite(value) or abs(value) > LARGEST:
            raise self.fail(f"'{token}' is out of range", "write a smaller number")
        return value
