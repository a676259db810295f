"""Splits C source into tokens with their positions: enough of C to change one token or statement and leave the rest as it is."""
import re
from dataclasses import dataclass

PUNCTUATORS = ("<<=", ">>=", "...", "->", "++", "--", "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "+=", "-=", "*=", "/=", "%=",
               "&=", "|=", "^=", "##")

_SKIP = re.compile(r"(?:\s|\\\n|//[^\n]*|/\*.*?\*/)+", re.S)
_TOKEN = re.compile(
    r"(?P<id>[A-Za-z_]\w*)"
    r"|(?P<num>\.?\d(?:[eEpP][+-]|[\w.])*)"
    r"|(?P<chr>'(?:\\.|[^'\\\n])+')"
    r"|(?P<str>\"(?:\\.|[^\"\\\n])*\")"
    r"|(?P<punct>" + "|".join(re.escape(p) for p in PUNCTUATORS) + r"|[^\s\w])", re.S)
_DIRECTIVE = re.compile(r"[ \t]*#((?:\\\n|/\*.*?\*/|[^\n])*)", re.S)
_DEFINE = re.compile(r"[ \t]*#[ \t]*define[ \t]+(\w+)(\([^)]*\))?")

# Conditions that no host build fulfils, and those that every host build does: their dead branches are not mutated.
_ALWAYS = {"ifdef __XC16__": False, "ifndef __XC16__": True, "if __GNUC__ >= 5": True}


@dataclass(frozen=True)
class Token:
    """One token: kind is id, num, chr, str or punct; text[start:end] of the source."""
    kind: str
    text: str
    start: int
    end: int


@dataclass(frozen=True)
class Macro:
    """The body of one #define."""
    name: str
    tokens: list


def _tokens(text, start, end):
    at, result = start, []
    while at < end:
        skip = _SKIP.match(text, at, end)
        if skip:
            at = skip.end()
            continue
        match = _TOKEN.match(text, at, end)
        if not match:
            raise ValueError(f"character {text[at]!r} at offset {at} is no C token")
        result.append(Token(match.lastgroup, match.group(), match.start(), match.end()))
        at = match.end()
    return result


class _Conditions:
    """The stack of #if: says whether a line can be part of a host build."""

    def __init__(self):
        self._stack = []

    def directive(self, words):
        name = words.split(" ", 1)[0]
        if name in ("if", "ifdef", "ifndef"):
            self._stack.append(_ALWAYS.get(words))
        elif name in ("else", "elif") and self._stack:
            known = self._stack[-1]
            self._stack[-1] = None if known is None else not known
        elif name == "endif" and self._stack:
            self._stack.pop()

    def live(self):
        return all(state is not False for state in self._stack)


def split(text):
    """@return (tokens of the code, macros), without comments and without branches that are never compiled on a PC"""
    code, macros, conditions, at = [], [], _Conditions(), 0
    comment_or_string = re.compile(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])+'", re.S)
    line_start = True
    begin = 0

    def flush(end):
        if conditions.live():
            code.extend(_tokens(text, begin, end))

    while at < len(text):
        directive = _DIRECTIVE.match(text, at) if line_start else None
        if directive:
            flush(at)
            words = " ".join(re.sub(r"/\*.*?\*/|\\\n", " ", directive.group(1), flags=re.S).split())
            define = _DEFINE.match(text, at)
            if define and conditions.live():
                macros.append(Macro(define.group(1), _tokens(text, define.end(), directive.end())))
            conditions.directive(words)
            at = begin = directive.end()
            continue
        other = comment_or_string.match(text, at)
        if other:
            line_start = False
            at = other.end()
            continue
        line_start = text[at] == "\n" or (line_start and text[at] in " \t")
        at += 1
    flush(len(text))
    return code, macros
