"""The one kind of error that a user can cause: a line that says what is wrong, where, and what to do."""

import difflib
from collections.abc import Callable, Iterable
from typing import Any


class UserError(Exception):
    """Bad input. `str()` is the line to print after "foc33: "."""

    def __init__(self, what: str, where: str = "", remedy: str = "") -> None:
        line = what + (f", {where}" if where else "") + (f": {remedy}" if remedy else "")
        line = " ".join(line.split())
        super().__init__("".join(c if c.isprintable() else "?" for c in line)) # a file's control characters stay off the terminal
        self.lines = [str(self)]


class UserErrors(UserError):
    """Several at once; `lines` has them one by one."""

    def __init__(self, errors: "list[UserError]") -> None:
        super().__init__("; ".join(map(str, errors)))
        self.lines = [line for error in errors for line in error.lines]


class Problems:
    """Collects what is wrong, so that a user hears of all of it in one run."""

    def __init__(self) -> None:
        self.found: list[UserError] = []

    def attempt(self, work: Callable[[], Any], instead: Any = None) -> Any:
        """What `work` returns; `instead` where it is refused."""
        try:
            return work()
        except UserError as error:
            self.found.append(error)
            return instead

    def tell(self) -> None:
        """Raises what was found, if anything: one error as itself."""
        if self.found:
            raise self.found[0] if len(self.found) == 1 else UserErrors(self.found)


def suggestion(word: str, known: Iterable[str], listed: str = "") -> str:
    """What to write instead of an unknown word, small letters or capitals; `listed`: where the names stand if they are too many for a line."""
    names = {name.lower(): name for name in sorted(known, reverse=True)}
    small = word.lower()
    near = difflib.get_close_matches(small, names, n=1, cutoff=0.5) or sorted(name for name in names if small and name.startswith(small))
    if near:
        return f"did you mean '{names[near[0]]}'?"
    names = sorted(names.values())
    if listed and len(names) > 30:
        return f"{listed} lists them"
    if len(names) > 30:
        return "check its spelling"
    return "use one of " + ", ".join(names) if names else "remove it"
