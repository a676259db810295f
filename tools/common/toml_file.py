"""Strict reading of TOML files: every key is asked for by name and type, and what nobody asked for is refused with its line."""

import math
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import paths
from .errors import UserError, suggestion

REQUIRED: Any = object()


@dataclass(frozen=True)
class Asked:
    """A key as its loader asks for it; docs/files.md lists those of scenario files."""

    section: "Section"
    key: str
    what: str
    meaning: str
    default: Any = REQUIRED
    low: float = -math.inf
    high: float = math.inf
    options: tuple[str, ...] = field(default=())


class Document:
    """A TOML file: its data, and where in the text a key stands. `text`: what is going to be written there."""

    def __init__(self, path: Path, text: str | None = None) -> None:
        self.path = path
        self.label = str(paths.shown(path))
        try:
            self.text = self._read() if text is None else text
        except FileNotFoundError:
            raise UserError("no such file", self.label,
                            "check the name; `make scenarios` lists the scenarios") from None
        except OSError as error:
            raise UserError(f"cannot read the file ({error.strerror})", self.label, "give a readable TOML file") from None
        except UnicodeDecodeError:
            raise UserError("cannot read the file (it is not UTF-8 text)", self.label, "save it as UTF-8") from None
        try:
            self.data = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise UserError("TOML syntax", *self._syntax(str(error))) from None
        except (ValueError, RecursionError):
            raise UserError("a number too long or tables too deep", self.label, "write numbers as people do") from None
        self.asked: dict[tuple[str, str], Asked] = {}
        """By table and key."""
        self.root = Section(self, self.data, ())

    def _read(self) -> str:
        """The file's text; some editors begin it with a mark, and some write UTF-16."""
        content = self.path.read_bytes()
        if content[:2] in (b"\xff\xfe", b"\xfe\xff") or content[:2].count(0) == 1 < len(content):
            raise UserError("the file is UTF-16", self.label, "save it as UTF-8")
        return content.decode("utf-8-sig").replace("\r\n", "\n")

    def _syntax(self, message: str) -> tuple[str, str]:
        place = re.search(r"\(at (?:line (\d+), column (\d+)|end of document)\)", message)
        line = int(place[1]) if place and place[1] else len(self.text.splitlines())
        text = self.text.splitlines()[line - 1] if line <= len(self.text.splitlines()) else ""
        if comma := re.search(r"=\s*([-+]?\d+),(\d+)", text):
            return f"{self.label} line {line}", f"write {comma[1]}.{comma[2]}, with a decimal point"
        if message.startswith("Cannot overwrite a value") and (key := re.match(r"\s*([A-Za-z0-9_.\-\"']+)\s*=", text)):
            return f"{self.label} line {line}", f"{key[1]} stands twice in its table: remove one of the two"
        reason = re.sub(r"\s*\(at .*\)", "", message)
        reason = re.sub(r"\('([^()]*?)',?\)", lambda match: "[" + match[1].replace("', '", ".") + "]", reason)
        return f"{self.label} line {line}", reason[:1].lower() + reason[1:]

    def where(self, path: tuple) -> str:
        """File and line of a key; `path` holds table names, array indices and the key."""
        line = self._line(path)
        return self.label + (f" line {line}" if line else "")

    def _line(self, path: tuple) -> int:
        counts: dict[str, int] = {}
        here: tuple = ()
        best = 0
        for number, text in enumerate(self.text.splitlines(), 1):
            header = re.match(r"\s*\[(\[?)([^\]]+)\]", text)
            if header:
                name = header[2].strip()
                here = tuple(_key_parts(name))
                if here == path: # also [[name]] where a table [name] is expected
                    return number
                if header[1]:
                    counts[name] = counts.get(name, -1) + 1
                    here += (counts[name],)
                best = number if here == path[:len(here)] else best
                continue
            key = re.match(r"\s*([A-Za-z0-9_.\-\"' ]+?)\s*=", text)
            if key and here + tuple(_key_parts(key[1])) == path[:len(here) + len(_key_parts(key[1]))] \
                    and here == path[:len(here)]:
                return number
        return best


def _key_parts(text: str) -> list[str]:
    parts = re.findall(r"\"[^\"]*\"|'[^']*'|[^.\s\"']+", text)
    return [part.strip("\"'") for part in parts]


class Section:
    """One table of a document. Ask for every key that may be there, then close()."""

    def __init__(self, document: Document, data: dict[str, Any], path: tuple, noted: bool = True) -> None:
        """`noted`: False for a table that the file does not have, made of another"""
        self.document = document
        self.noted = noted
        self.data = data
        self.path = path
        self.asked: set[str] = set()

    def where(self, key: str | None = None) -> str:
        return self.document.where(self.path + ((key,) if key is not None else ()))

    def fail(self, key: str, what: str, remedy: str) -> UserError:
        """An error about `key`; raise the result."""
        return UserError(what, self.where(key), remedy)

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def note(self, key: str, what: str, meaning: str, default: Any = REQUIRED, **more: Any) -> None:
        """Keeps what is asked for first under a key, for docs/files.md."""
        kind = f" {self.data['kind']}" if self.path[:1] == ("expect",) and key != "kind" else ""
        if self.noted:
            self.document.asked.setdefault((".".join(map(str, self.path[:1])) + kind, key), Asked(self, key, what, meaning, default, **more))

    def _take(self, key: str, default: Any) -> Any:
        self.asked.add(key)
        if key not in self.data:
            if default is REQUIRED:
                raise UserError(f"'{key}' is missing", self.where(), "add it")
            return default
        return self.data[key]

    def text(self, key: str, default: Any = REQUIRED, meaning: str = "") -> Any:
        self.note(key, "text", meaning, default)
        value = self._take(key, default)
        if value is not default and (not isinstance(value, str) or not value.strip()):
            raise self.fail(key, f"'{key}' is not a text", "write it in quotes")
        return value

    def choice(self, key: str, options: list[str] | tuple[str, ...], default: Any = REQUIRED, meaning: str = "") -> Any:
        self.note(key, "text", meaning, default, options=tuple(options))
        value = self._take(key, default)
        if value is not default and value not in options:
            raise self.fail(key, f"'{value}' is no {key}", suggestion(str(value), options))
        return value

    def choices(self, key: str, options: list[str] | tuple[str, ...], meaning: str = "") -> list[str]:
        """One of the options, which the file itself names, or a list of them."""
        self.note(key, "text or list of texts", meaning)
        if not isinstance(self.data.get(key), list):
            return [self.choice(key, options)]
        for item in self.texts(key):
            if item not in options:
                raise self.fail(key, f"'{item}' is no {key}", suggestion(item, options))
        return self.data[key]

    def flag(self, key: str, default: Any = REQUIRED, meaning: str = "") -> Any:
        self.note(key, "true or false", meaning, default)
        value = self._take(key, default)
        if value is not default and not isinstance(value, bool):
            raise self.fail(key, f"'{key}' is neither true nor false", "write one of them, without quotes")
        return value

    def number(self, key: str, default: Any = REQUIRED, minimum: float = -math.inf, maximum: float = math.inf, meaning: str = "") -> Any:
        """A finite number within minimum .. maximum."""
        self.note(key, "number", meaning, default, low=minimum, high=maximum)
        value = self._take(key, default)
        if value is default:
            return value
        return self._checked_number(key, value, minimum, maximum)

    def integer(self, key: str, default: Any = REQUIRED, minimum: float = -math.inf, maximum: float = math.inf, meaning: str = "") -> Any:
        self.note(key, "whole number", meaning, default, low=minimum, high=maximum)
        value = self.number(key, default, minimum, maximum)
        if value is not default and value != int(value):
            raise self.fail(key, f"'{key}' = {value:g} is not a whole number", "round it")
        return value if value is default else int(value)

    def texts(self, key: str, default: Any = REQUIRED, meaning: str = "") -> Any:
        self.note(key, "list of texts", meaning, default)
        value = self._take(key, default)
        if value is not default and not (isinstance(value, list) and all(isinstance(item, str) and item for item in value)):
            raise self.fail(key, f"'{key}' is not a list of texts", f"write {key} = [\"...\", \"...\"]")
        return value

    def numbers(self, key: str, minimum: float = -math.inf, maximum: float = math.inf) -> list[float]:
        value = self._take(key, REQUIRED)
        if not isinstance(value, list) or not value:
            raise self.fail(key, f"'{key}' is not a list of numbers", f"write {key} = [1.0, 2.0]")
        return [self._checked_number(key, item, minimum, maximum) for item in value]

    def values(self, key: str, factors: bool = False, meaning: str = "") -> dict[str, Any]:
        """A table of numbers under dotted names, quoted or nested; with `factors` also { factor = number } as ("factor", number)."""
        self.note(key, "table of keys", meaning)
        table = self._take(key, REQUIRED)
        if not isinstance(table, dict):
            raise self.fail(key, f"'{key}' is not a table", f"write {key} = {{ \"name\" = 1.0 }}")
        return flatten(Section(self.document, table, self.path + (key,), noted=False), factors)

    def _checked_number(self, key: str, value: Any, minimum: float, maximum: float) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
            raise self.fail(key, f"'{key}' is not a number", "write a number, without quotes")
        if not abs(value) < 1e300: # inf, integers that no double holds
            raise self.fail(key, f"'{key}' is out of range", "choose " + _range_text(minimum, maximum))
        if not minimum <= value <= maximum:
            raise self.fail(key, f"'{key}' = {value:g} is impossible", "choose " + _range_text(minimum, maximum))
        return float(value)

    def section(self, key: str) -> "Section | None":
        """The table `key`, None if it is not there."""
        table = self._take(key, None)
        if table is not None and not isinstance(table, dict):
            raise self.fail(key, f"'{key}' is not a table", f"write [{key}]")
        return None if table is None else Section(self.document, table, self.path + (key,))

    def sections(self, key: str) -> "list[Section]":
        """The tables [[key]], in order."""
        tables = self._take(key, [])
        if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
            raise self.fail(key, f"'{key}' is not a list of tables", f"write [[{key}]]")
        return [Section(self.document, table, self.path + (key, i)) for i, table in enumerate(tables)]

    def one_of(self, keys: tuple[str, ...]) -> str:
        """Which of `keys` is there; exactly one must be."""
        self.close(set(keys))
        present = [key for key in keys if key in self.data]
        if not present:
            raise UserError("nothing to do", self.where(), "add one of " + ", ".join(keys))
        if len(present) > 1:
            raise self.fail(present[1], f"'{present[0]}' and '{present[1]}' together", "write two tables, one for each")
        return present[0]

    def close(self, also: set[str] | None = None) -> None:
        """Refuse keys that nobody has asked for."""
        known = self.asked | (also or set())
        for key in self.data:
            if key not in known:
                raise self.fail(key, f"unknown key '{key}'", suggestion(key, known))


def _range_text(minimum: float, maximum: float) -> str:
    if -minimum == maximum == math.inf:
        return "a number below 1e300"
    if maximum == math.inf:
        return f"{minimum:g} or more"
    if minimum == -math.inf:
        return f"{maximum:g} or less"
    return f"{minimum:g} .. {maximum:g}"


def flatten(section: Section, factors: bool = False) -> dict[str, Any]:
    """Numbers of a table and its sub-tables under dotted names: [motor] rs_ohm = 2 and "motor.rs_ohm" = 2 are the same."""
    result: dict[str, Any] = {}
    if len(section.path) > 20:
        raise UserError("tables too deep", section.document.where(section.path[:1]), "write \"motor.rs_ohm\" = 2 or [motor] rs_ohm = 2")
    for key, value in section.data.items():
        section.asked.add(key)
        if isinstance(value, dict) and set(value) == {"factor"} and factors:
            inner = Section(section.document, value, section.path + (key,), noted=False)
            result[key] = ("factor", inner.number("factor"))
        elif isinstance(value, dict) and value:
            inner = Section(section.document, value, section.path + (key,), noted=False)
            result.update({f"{key}.{name}": item for name, item in flatten(inner, factors).items()})
        else:
            result[key] = section.number(key)
    return result
