"""Lists the mutants of a C file: one small, wrong change each, of the kinds that make a control law fail."""
import random
import re
from dataclasses import dataclass, replace

import c_tokens

# Files whose macros are computations or register values; elsewhere a macro is a name or a table.
SCALING_FILES = (*(f"include/drive/scaling/{name}.h" for name in ("controllers", "current_voltage", "estimator", "machine")),
                 "include/drive/param_init.h")
MACRO_FILES = (*SCALING_FILES, "include/board/mclv.h")
# A constant of a long table is one of many alike: this many of a table are enough, and more would flatter the score.
TABLE_SITES = 8
TABLE_LENGTH = 16

BINARY = {"+": ["-"], "-": ["+"], "<": ["<=", ">="], "<=": ["<", ">"], ">": [">=", "<="], ">=": [">", "<"], "==": ["!="], "!=": ["=="],
          "&": ["|"], "|": ["&"], "^": ["|"], "<<": [">>"], ">>": ["<<"], "&&": ["||"], "||": ["&&"],
          "+=": ["-="], "-=": ["+="], "&=": ["|="], "|=": ["&="], "^=": ["|="], "++": ["--"], "--": ["++"]}
COMPONENT = {"alpha": "beta", "beta": "alpha", "d": "q", "q": "d", "sin": "cos", "cos": "sin", "a": "b", "b": "c", "c": "a",
             "i_a_q13": "i_b_q13", "i_b_q13": "i_c_q13", "i_c_q13": "i_a_q13"}
PRODUCTS = re.compile(r"qm_(mul\w*|hi)$")
TYPE_WORDS = {"void", "char", "short", "int", "long", "float", "double", "signed", "unsigned", "const", "volatile", "static", "extern",
              "struct", "enum", "union", "inline", "register"}
STATEMENT_WORDS = {"if", "for", "while", "switch", "do", "else", "return", "break", "continue", "case", "default", "goto", "sizeof"}


@dataclass(frozen=True)
class Mutant:
    """text[start:end] of the file becomes `new`. `operator` names the kind, `key` survives a change of line numbers."""
    file: str
    line: int
    function: str
    operator: str
    start: int
    end: int
    new: str
    diff: str
    number: int = 1 # of several with the same diff in one function

    @property
    def key(self):
        return f"{self.file} {self.function}: {self.diff}" + (f" #{self.number}" if self.number > 1 else "")

    def apply(self, text):
        old = text[self.start:self.end]
        return text[:self.start] + self.new + "\n" * old.count("\n") + text[self.end:]


def _is_type(token):
    return token.kind == "id" and (token.text in TYPE_WORDS or token.text.endswith("_t") or token.text in ("INLINE", "QM_INLINE", "QM_WRAPS"))


OPENS = {"(": ")", "[": "]", "{": "}"}


def _partners(tokens):
    """Index of the other bracket for the index of each bracket."""
    found, open_brackets = {}, []
    for i, token in enumerate(tokens):
        if token.kind == "punct" and token.text in OPENS:
            open_brackets.append(i)
        elif token.kind == "punct" and token.text in OPENS.values():
            found[i] = open_brackets.pop()
            found[found[i]] = i
    return found


def _number(text):
    """Value and suffix of a number, and whether it is hexadecimal; or None."""
    match = re.fullmatch(r"(0[xX][0-9a-fA-F]+|\d+)([uUlL]*)", text)
    if match:
        return int(match.group(1), 0), match.group(2), match.group(1)[:2].lower() == "0x"
    match = re.fullmatch(r"((?:\d+\.\d*|\.\d+|\d+)(?:[eE][+-]?\d+)?)([fF]?)", text)
    return (float(match.group(1)), match.group(2), False) if match else None


def _other_numbers(text):
    """The constants that replace a constant: +1, -1, *2, 0."""
    parsed = _number(text)
    if parsed is None:
        return []
    value, suffix, is_hex = parsed

    def written(other):
        if is_hex:
            return f"0x{other:X}{suffix}"
        digits = f"{other:.9g}" if isinstance(value, float) else str(other)
        if isinstance(value, float) and not re.search(r"[.e]", digits):
            digits += ".0"
        return f"({digits}{suffix})" if other < 0 else f"{digits}{suffix}"
    return [written(other) for other in dict.fromkeys((value + 1, value - 1, value * 2, value * 0))
            if other != value and not (other < 0 and "u" in suffix.lower())]


class _Region:
    """A run of tokens that belong together: a function's body, an initialiser or a macro."""

    def __init__(self, file, text, name, kind, tokens):
        self.file, self.text, self.name, self.kind, self.tokens = file, text, name, kind, tokens
        self.partner = _partners(tokens)
        self.found = []
        self.declared_dimension = set()

    # ---- one mutant ----
    def add(self, operator, start, end, new):
        first = self.text.rfind("\n", 0, start) + 1
        last = self.text.find("\n", end)
        last = len(self.text) if last < 0 else last
        shown = f"{self.text[first:start]}[-{self.text[start:end]}-]{{+{new}+}}{self.text[end:last]}"
        shown = re.sub(r"/\*.*?(\*/|$)", " ", shown)
        shown = " ".join(shown.replace("\\\n", " ").split()).removesuffix("\\").strip()
        self.found.append(Mutant(self.file, self.text.count("\n", 0, start) + 1, self.name, operator, start, end, new, shown))

    def is_operand_end(self, i):
        """Does an operand end at token i, so that a following + - & * has two operands?"""
        if i < 0:
            return False
        token = self.tokens[i]
        if token.kind in ("num", "chr") or token.text == "]":
            return True
        if token.kind == "id":
            return token.text not in STATEMENT_WORDS and not _is_type(token)
        if token.text in ("++", "--"):
            return self.is_operand_end(i - 1)
        return token.text == ")" and not self.is_cast(i)

    def is_cast(self, i):
        """Is the parenthesis that closes at token i a cast?"""
        k = self.partner[i]
        inside = self.tokens[k + 1:i]
        return bool(inside) and all(_is_type(t) or t.text == "*" for t in inside) and not (k > 0 and self.tokens[k - 1].text == "sizeof")

    def operand_end(self, i):
        """Index after the postfix expression (or cast, or parenthesis) that starts at token i."""
        tokens = self.tokens
        if tokens[i].text == "(":
            i = self.partner[i]
            if self.is_cast(i):
                return self.operand_end(i + 1)
            i += 1
        elif tokens[i].text in ("-", "~", "!", "*", "&"):
            return self.operand_end(i + 1)
        else:
            i += 1
        while i < len(tokens) and tokens[i].text in ("->", ".", "(", "["):
            i = i + 2 if tokens[i].text in ("->", ".") else self.partner[i] + 1
        return i

    # ---- kinds ----
    def operators(self):
        tokens = self.tokens
        for i, token in enumerate(tokens):
            if token.kind != "punct" or token.text not in BINARY and token.text not in ("~", "!"):
                continue
            binary = self.is_operand_end(i - 1)
            if token.text in ("~", "!"):
                self.add("negation", token.start, token.end, "")
            elif token.text in ("++", "--"):
                self.add("operator", token.start, token.end, BINARY[token.text][0])
            elif binary:
                for other in BINARY[token.text]:
                    self.add("operator", token.start, token.end, other)
            elif token.text == "-":
                self.add("sign", token.start, token.end, "")
            if token.text in ("<<", ">>") and binary and tokens[i + 1].kind != "num":
                end = self.operand_end(i + 1)
                count = self.text[tokens[i + 1].start:tokens[end - 1].end]
                for change in ("+", "-"):
                    self.add("shift", tokens[i + 1].start, tokens[end - 1].end, f"({count} {change} 1)")

    def signs(self):
        """A minus before each product that is used as a value."""
        for i, (before, token) in enumerate(zip(self.tokens, self.tokens[1:]), 1):
            if token.kind == "id" and PRODUCTS.match(token.text) and self.tokens[i + 1].text == "(" \
                    and before.text not in ("+", "-", "+=", "-=") and (before.text != ")" or self.is_cast(i - 1)):
                self.add("sign", token.start, token.start, "-")

    def constants(self):
        table = set()
        if self.kind == "init":
            numbers = [i for i, t in enumerate(self.tokens) if t.kind == "num"]
            if len(numbers) > TABLE_LENGTH:
                table = set(numbers) - set(random.Random(self.name).sample(numbers, TABLE_SITES))
        for i, token in enumerate(self.tokens):
            if i in table or i in self.declared_dimension:
                continue
            shift = i > 0 and self.tokens[i - 1].text in ("<<", ">>")
            if token.kind == "num":
                for other in _other_numbers(token.text):
                    self.add("shift" if shift else "constant", token.start, token.end, other)
            elif token.kind == "chr" and not token.text.startswith("'\\0"):
                self.add("constant", token.start, token.end, f"({token.text} + 1)")

    def components(self):
        """The other axis or phase, where a value is read."""
        for i, (before, token) in enumerate(zip(self.tokens, self.tokens[1:]), 1):
            following = self.tokens[i + 1].text if i + 1 < len(self.tokens) else ";"
            initialiser = before.text == "." and i > 1 and self.tokens[i - 2].text in (",", "{") # a designated one
            if token.kind == "id" and before.text in (".", "->") and token.text in COMPONENT and not initialiser \
                    and following not in ("=", "+=", "-=", "[", "("):
                self.add("component", token.start, token.end, COMPONENT[token.text])

    def clamps(self):
        for i, token in enumerate(self.tokens):
            if token.text != "qm_clamp" or self.tokens[i + 1].text != "(" or self.name == "qm_clamp":
                continue
            arguments, k, first, close = [], i + 2, i + 2, self.partner[i + 1]
            while k <= close:
                if self.tokens[k].text == "," or k == close:
                    arguments.append((self.tokens[first].start, self.tokens[k - 1].end))
                    first = k + 1
                k = self.partner[k] + 1 if self.tokens[k].text in OPENS else k + 1
            if len(arguments) != 3:
                continue
            low, high = (self.text[a:b] for a, b in arguments[1:])
            start, end = arguments[1][0], arguments[2][1]
            for new in (f"{high}, {low}", f"INT16_MIN, {high}", f"{low}, INT16_MAX"):
                self.add("limit", start, end, " ".join(new.split()))

    def conditions(self):
        tokens = self.tokens
        for i, token in enumerate(tokens):
            if token.text in ("if", "while") and tokens[i + 1].text == "(":
                self.negate(i + 2, self.partner[i + 1])
            elif token.text == "?" and tokens[i - 1].text == ")":
                k = self.partner[i - 1]
                if tokens[k - 1].kind != "id" or tokens[k - 1].text in STATEMENT_WORDS:
                    self.negate(k + 1, i - 1)
            elif token.text == "?":
                k = i - 1
                while k > 0 and (tokens[k - 1].text in ("->", ".") or tokens[k].text in ("->", ".")):
                    k -= 1
                self.negate(k, i)

    def negate(self, first, after):
        inside = self.tokens[first:after]
        joined = any(t.text in ("&&", "||") for t in inside)
        comparisons = [t for t in inside if t.text in ("<", "<=", ">", ">=", "==", "!=")]
        if not joined and (len(comparisons) == 1 or inside and inside[0].text == "!"):
            return # the operator's own mutants contain the negation
        start, end = inside[0].start, inside[-1].end
        self.add("condition", start, end, "!(" + " ".join(self.text[start:end].split()) + ")")

    def statements(self):
        """Removes each expression statement, break and continue; changes each returned value."""
        tokens, i, start = self.tokens, 0, True
        while i < len(tokens):
            text = tokens[i].text
            if not start or text in (";", "{", "}", "else", "do"):
                start = text in (";", "{", "}", "else", "do")
                i += 1
            elif text in ("if", "while", "switch", "for") and tokens[i + 1].text == "(":
                i = self.partner[i + 1] + 1
            elif text in ("case", "default"):
                while tokens[i].text != ":":
                    i += 1
                i += 1
            else:
                end = i
                while tokens[end].text != ";":
                    end = self.partner[end] + 1 if tokens[end].text in OPENS else end + 1
                self.statement(i, end)
                i = end + 1

    def statement(self, first, semicolon):
        tokens = self.tokens
        start, end = tokens[first].start, tokens[semicolon].end
        if tokens[first].text == "return":
            if semicolon > first + 1: # what returns a structure does not compile, and does not count
                value = " ".join(self.text[tokens[first + 1].start:tokens[semicolon].start].split())
                self.add("return", tokens[first + 1].start, tokens[semicolon].start, "1" if value == "0" else "0")
                if _number(value) is None:
                    self.add("return", tokens[first + 1].start, tokens[semicolon].start, f"({value}) + 1")
            else:
                self.add("statement", start, end, ";")
        elif _is_type(tokens[first]):
            for i in range(first, semicolon - 1):
                if tokens[i].text == "[" and tokens[i - 1].kind == "id" and not any(t.text == "=" for t in tokens[first:i]):
                    self.declared_dimension.update(range(i, self.partner[i]))
        elif not (tokens[first].text == "(" and tokens[first + 1].text == "void" and semicolon == first + 4):
            self.add("statement", start, end, ";")

    def mutants(self):
        if self.kind == "function":
            self.statements()
            self.conditions()
        self.operators()
        self.signs()
        self.constants()
        self.components()
        self.clamps()
        return self.found


def _regions(file, text):
    tokens, macros = c_tokens.split(text)
    partner = _partners(tokens)
    i, begin = 0, 0
    while i < len(tokens):
        token = tokens[i]
        if token.text == "{":
            close = partner[i]
            before = tokens[i - 1].text if i else ""
            if before == ")":
                yield _Region(file, text, tokens[partner[i - 1] - 1].text, "function", tokens[i + 1:close])
                begin = close + 1
            elif before == "=":
                name = next(t.text for t in tokens[begin:i] if t.kind == "id" and not _is_type(t))
                yield _Region(file, text, name, "init", tokens[i:close + 1])
            i = close + 1
            continue
        if token.text == ";":
            begin = i + 1
        i += 1
    if file in MACRO_FILES:
        for name, body in macros:
            if body:
                yield _Region(file, text, name, "macro", body)


def of_file(file, text):
    """All mutants of one file, in the order of the text; a change that appears twice is listed once."""
    found = []
    for region in _regions(file, text):
        found.extend(region.mutants())
    found.sort(key=lambda m: (m.start, m.end, m.operator, m.new))
    unique, seen, counts = [], set(), {}
    for mutant in found:
        change = (mutant.start, mutant.end, mutant.new)
        if change in seen:
            continue
        seen.add(change)
        counts[mutant.key] = counts.get(mutant.key, 0) + 1
        unique.append(replace(mutant, number=counts[mutant.key]))
    return unique
