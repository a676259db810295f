"""The one kind of error that a user can cause: a line that says what is wrong, where, and what to do."""

import difflib
from collections.abc import Iterable


class UserError(Exception):
    """Bad input. `str()` is the line to print after "foc33: "."""

    def __init__(self, what: str, where: str = "", remedy: str = "") -> None:
        line = what + (f", {where}" if where else "") + (f": {remedy}" if remedy else "")
        line = " ".join(line.split())
        super().__init__("".join(c if c.isprintable() else "?" for c in line)) # a file's control characters stay off the terminal


def suggestion(word: str, known: Iterable[str]) -> str:
    """What to write instead of an unknown word."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.5) or [name for name in names if word and name.startswith(word)]
    if near:
        return f"did you mean '{near[0]}'?"
    if len(names) > 30:
        return "see the list that `python3 -m tools.bench keys` prints"
    return "use one of " + ", ".join(names) if names else "remove it"
