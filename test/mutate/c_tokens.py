"""Splits C source into tokens with their positions: enough of C to change one token or statement and leave the rest as it is."""
import re
from dataclasses import dataclass

PUNCTUATORS = ("<<=", ">>=", "...", "->", "++", "--", "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "+=", "-=", "*=", "/=", "%=",
               "&=", "|=", "^=", "##")

_TOKEN = re.compile(
    r"(?P<space>(?:\s|\\\n)+)"
    r"|(?P<id>[A-Za-z_]\w*)"
    r"|(?P<num>\.?\d(?:[eEpP][+-]|[\w.])*)"
    r"|(?P<chr>'(?:\\.|[^'\\\n])+')"
    r"|(?P<str>\"(?:\\.|[^\"\\\n])*\")"
    r"|(?P<punct>" + "|".join(re.escape(p) for p in PUNCTUATORS) + r"|[^\s\w])", re.S)
_COMMENT_OR_STRING = re.compile(r"(/\*.*?\*/|//[^\n]*)|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])+'", re.S)
_DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.M)
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


def _tokens(text, start, end):
    found = _TOKEN.finditer(text, start, end)
    return [Token(m.lastgroup, m.group(), m.start(), m.end()) for m in found if m.lastgroup != "space"]


def _nested(conditions, words):
    """The stack of #if after a directive: True, False, or None for a branch that may be part of a host build."""
    name = words.split(" ", 1)[0]
    if name in ("if", "ifdef", "ifndef"):
        return [*conditions, _ALWAYS.get(words)]
    if name in ("else", "elif") and conditions:
        return [*conditions[:-1], None if conditions[-1] is None else not conditions[-1]]
    return conditions[:-1] if name == "endif" else conditions


def split(text):
    """@return (tokens of the code, [(name, tokens)] of macros), without comments and without branches that are never compiled on a PC"""
    text = _COMMENT_OR_STRING.sub(lambda m: re.sub(r"[^\n]", " ", m.group()) if m.group(1) else m.group(), text)
    code, macros, conditions, begin = [], [], [], 0
    for directive in [*_DIRECTIVE.finditer(text), None]:
        live = False not in conditions
        if live:
            code += _tokens(text, begin, directive.start() if directive else len(text))
        if directive:
            define = _DEFINE.match(directive.group())
            if define and live:
                macros.append((define.group(1), _tokens(text, directive.start() + define.end(), directive.end())))
            conditions = _nested(conditions, " ".join(directive.group().replace("\\\n", " ").replace("#", " ", 1).split()))
            begin = directive.end()
    return code, macros
