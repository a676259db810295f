"""Parameters of userparams.h, changed in the running firmware over its serial line.

A change is compiled as a build would compile it: a build's checks refuse what cannot work, and what differs in board_params is written to the board. What the
rest of the firmware knows as a constant, or what scales the page's numbers, needs a build: it goes into the saved header alone."""

import contextlib
import re
import shutil
import tempfile
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

from tools.bench import build
from tools.common import board_file, paths
from tools.common.errors import UserError, suggestion
from tools.common.param_rows import parameters, texts_of, with_values
from tools.image.program import contents, reading

from .lnet import Lnet
from .symbols import Symbols

try:
    from elftools.elf.elffile import ELFFile
except ImportError:
    pass # program.reading() says so

BASE = "board_params"
FIXED = "The parameters are constants of this firmware. DEFINES=-DPARAMS_IN_RAM makes them variables here; an image needs DEFINES=\"-DPARAMS_IN_RAM -DSCOPE=1\"."
BOARD, LATER, NOWHERE = "board", "build", "unused"
"""Where a changed value is: in the board; in the saved header alone, for it needs a build; there alone, for this build does not ask for it."""
LOOK_S = 1.0
"""How often it looks whether the board still has the values."""
NUMBER = re.compile(r"[-+]?(0[xX][0-9a-fA-F]+|(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?)")
MADE_FROM = re.compile(r"Made from (.+\.toml) and (.+\.toml) by: make tune ")
"""The files of a header that the tuner has written."""
REFUSED = re.compile(r"^foc33: .*?userparams\.h:\d+: (.*?)(: correct it)?$", re.MULTILINE)


@dataclass(frozen=True)
class Built:
    """What the compiler makes of a userparams.h."""

    params: bytes
    scales: bytes
    rest: int
    """checksum of the firmware without its parameters"""


class Compiler:
    """Builds the parameters of changed headers, in a folder of its own, until it is closed."""

    def __init__(self, text: str, defines: list[str]) -> None:
        self.text, self.defines = text, defines
        self.known: dict[frozenset[tuple[str, str]], Built] = {}
        base = paths.ROOT / "build" / "live"
        with _written(base):
            base.mkdir(parents=True, exist_ok=True)
            self.folder = Path(tempfile.mkdtemp(prefix="tuned-", dir=base))
        self.results = paths.ROOT / "build" / f"host-{build.variant_name(defines, self.folder)}"

    def close(self) -> None:
        """Removes what it has built."""
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.rmtree(self.results, ignore_errors=True)

    def build(self, values: dict[str, str]) -> Built:
        """The header with these values; refused in one line if it cannot work."""
        key = frozenset(values.items())
        if key not in self.known:
            self.known[key] = self._build(values)
        return self.known[key]

    def _build(self, values: dict[str, str]) -> Built:
        with _written(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True) # somebody may have cleaned up
            (self.folder / build.HEADER).write_bytes(_bytes(with_values(self.text, values)))
        result = build.make("live-params", self.defines, self.folder)
        if result.returncode != 0:
            said = REFUSED.search(result.stderr)
            raise UserError(said[1] if said else "the firmware does not build with it", "parameters", "nothing has changed")
        found = _objects(self.results / "tuned.o", ("tuned_params", "tuned_scales"))
        return Built(found["tuned_params"], found["tuned_scales"], zlib.crc32((self.results / "rest.i").read_bytes()))


def files_of(header: str) -> tuple[Path, Path] | None:
    """Motor file and board file as the header's head names them."""
    found = MADE_FROM.search(header)
    return (paths.ROOT / found[1], paths.ROOT / found[2]) if found else None


def others_of(header: str) -> dict[str, str]:
    """What a header defines that is no parameter: modes, and constants of its own."""
    found = re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+)[ \t]*((?:(?!/\*|//)\S)*)", header, re.MULTILINE)
    return {name: text for name, text in found if name not in parameters() and name != "USERPARAMS_H"}


def _bytes(text: str) -> bytes:
    """A header's text as its file has it, whatever its comments are written in."""
    return text.encode("utf-8", "surrogateescape")


@contextlib.contextmanager
def _written(folder: Path) -> Iterator[None]:
    """A disk that is full or may not be written is told in one line."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{error.strerror}, {folder}", "parameters", "make room there; nothing has changed") from None


def _objects(path: Path, names: tuple[str, ...]) -> dict[str, bytes]:
    """The bytes of constants in an object file."""
    with reading("ELF", path):
        elf = ELFFile(BytesIO(contents("ELF", path)))
        found = {}
        for symbol in elf.get_section_by_name(".symtab").iter_symbols():
            if symbol.name in names:
                data = elf.get_section(symbol["st_shndx"]).data()
                found[symbol.name] = data[symbol["st_value"]:symbol["st_value"] + symbol["st_size"]]
        return found


def tuned(tuning: "Tuning | None") -> "Tuning":
    """Refused where parameters are constants."""
    if tuning is None:
        raise UserError("no parameter can change", "page", FIXED)
    return tuning


class Tuning:
    """For one board. beat() belongs to the link's thread; ask() may take seconds and belongs to a thread of its own.

    `layout`: symbols of the PC's firmware with the same header and modes; `symbols`: those of the board's firmware."""

    def __init__(self, header: Path, defines: list[str], layout: Symbols, symbols: Symbols, files: tuple[Path, Path] | None = None) -> None:
        self.header = header.read_bytes().decode("utf-8", "surrogateescape")
        self.defines, self.layout, self.symbols = defines, layout, symbols
        self.files = files or files_of(self.header)
        """motor file and board file"""
        self.publish: Callable[[dict[str, Any]], None] = lambda message: None
        self.lock = threading.Lock()
        self.changed: dict[str, tuple[str, str]] = {}
        """text and place of each"""
        self.before: list[tuple[str, str]] = []
        """what undo brings back"""
        self.wanted: dict[str, int] = {}
        """members of board_params that are not the header's"""
        self.todo: deque[dict[str, int]] = deque()
        self.news: deque[str] = deque()
        """lines for the log"""
        self.lost = False
        self.foreign: int | None = None
        """values of the board that were not this header's before anybody changed one; None: nobody has looked"""
        self.looked_s = 0.0

    @staticmethod
    def of(header: Path, defines: list[str], layout: Symbols, symbols: Symbols, files: tuple[Path, Path] | None = None) -> "Tuning | None":
        """None of a firmware whose parameters are constants. `files`: motor and board; by default those that the header names"""
        return Tuning(header, defines, layout, symbols, files) if all(f"{BASE}.minimum_erpm" in each.variables for each in (layout, symbols)) else None

    @cached_property
    def compiler(self) -> Compiler:
        """Starts with the first change, ends with end()."""
        return Compiler(self.header, self.defines)

    @cached_property
    def built(self) -> Built:
        """The header as it is."""
        return self.compiler.build({})

    @cached_property
    def texts(self) -> dict[str, str]:
        """The value of each parameter that the header has, as it is written."""
        return texts_of(self.header)

    def end(self) -> None:
        """Nobody asks any more."""
        with self.lock:
            if "compiler" in self.__dict__:
                self.compiler.close()

    # ---- what somebody asks for --------------------------------------------------------------------------------------------
    def ask(self, wish: Any) -> None:
        """[name, value], "undo", or "again": the values once more, to a board that has lost them."""
        with self.lock:
            try:
                if wish == "undo":
                    self._undo()
                elif wish == "again":
                    self.todo.append(dict(self.wanted))
                elif isinstance(wish, list) and len(wish) == 2 and all(isinstance(word, str) for word in wish):
                    name, text = wish[0], self._read(*wish)
                    before = self._text(name)
                    if text != before:
                        self._change(name, text)
                        self.before.append((name, before))
                else:
                    raise UserError("no such change", "parameters", 'send ["NAME", "value"], "undo" or "again"')
            finally:
                self.publish({"tuning": self.told()}) # a page that was refused has the old value again

    def _read(self, name: str, text: str) -> str:
        if name not in self.texts:
            raise UserError(f"no parameter '{name}'", "parameters", suggestion(name, self.texts))
        text = text.strip()
        if text != self.texts[name] and not NUMBER.fullmatch(text):
            raise UserError(f"{name}: '{text}' is no number", "parameters", f"its unit is {parameters()[name].unit}")
        return text

    def _text(self, name: str) -> str:
        return self.changed[name][0] if name in self.changed else self.texts[name]

    def _undo(self) -> None:
        if not self.before:
            raise UserError("nothing to undo", "parameters", "change a value first")
        self._change(*self.before[-1])
        self.before.pop()

    def _change(self, name: str, text: str) -> None:
        """Compiles it; writes what it changes."""
        others = {other: value for other, value in self.changed.items() if other != name}
        live = {other: value for other, (value, place) in others.items() if place != LATER}
        place, built = "", self.compiler.build(live)
        if text != self.texts[name]:
            whole = {other: value for other, (value, _) in others.items()} | {name: text}
            tried = self.compiler.build(whole)
            if len(whole) > len(live) + 1: # some need a build: does this one, too?
                tried = self.compiler.build(live | {name: text})
            if (tried.rest, tried.scales) != (self.built.rest, self.built.scales):
                place = LATER
            else:
                place, built = (BOARD if tried.params != built.params else NOWHERE), tried
        self.changed = others | ({name: (text, place)} if place else {})
        self._want(built)
        told = {LATER: ": needs a build", NOWHERE: ": this build does not ask for it"}.get(place, "")
        self.news.append(f"{name} {text}{told}")

    def _want(self, built: Built) -> None:
        """Members that differ from what the board has."""
        new = {name: value for name, value in self.members(built).items() if value != self.members(self.built)[name]}
        changes = {name: new.get(name, self.members(self.built)[name]) for name in self.wanted | new if self.wanted.get(name) != new.get(name)}
        self.wanted = new
        if changes:
            self.todo.append(changes)

    def members(self, built: Built) -> dict[str, int]:
        """Numbers of board_params by name, as the firmware's variables have them."""
        items = {name: item for name, item in self.layout.variables.items() if name.startswith(f"{BASE}.")}
        first = min(item.address for item in items.values())
        return {name: item.value(built.params[item.address - first:]) for name, item in items.items()}

    # ---- the link's thread -------------------------------------------------------------------------------------------------
    def beat(self, link: Lnet) -> None:
        """Writes what is to be written; looks whether the board still has it."""
        if self.todo and self.foreign is None:
            header = self.members(self.built)
            self.foreign = sum(value != there for value, there in zip(header.values(), self.read_back(link, list(header))))
            self.publish({"tuning": self.told()})
        while self.todo:
            for name, value in self.todo[0].items():
                variable = self.symbols.find(name)
                link.write(variable.address, variable.data(value))
            self.todo.popleft()
            self.looked_s = 0.0
        now_s = time.monotonic()
        if now_s >= self.looked_s + LOOK_S:
            self.looked_s = now_s
            self._look(link)

    def _look(self, link: Lnet) -> None:
        wanted = dict(self.wanted)
        lost = bool(wanted) and self.read_back(link, list(wanted)) != list(wanted.values())
        if lost != self.lost and not self.todo:
            self.lost = lost
            self.news.append("the board has lost the changed parameters" if lost else "the board has the changed parameters")
            self.publish({"tuning": self.told()})

    def read_back(self, link: Lnet, names: list[str]) -> list[int]:
        """What the board has in these members; for the link's thread."""
        items = [self.symbols.find(name) for name in names]
        first = min(item.address for item in items)
        memory = link.read(first, max(item.address + item.bytes for item in items) - first)
        return [item.value(memory[item.address - first:]) for item in items]

    # ---- the page ----------------------------------------------------------------------------------------------------------
    def hello(self) -> dict[str, Any]:
        """Every parameter by subject, and what is changed."""
        subjects: dict[str, list[dict[str, str]]] = {}
        for name, text in self.texts.items():
            row = parameters()[name]
            subjects.setdefault(row.section, []).append({"name": name, "unit": row.unit, "low": row.low, "high": row.high, "header": text, "meaning": row.meaning})
        return {"subjects": subjects, **self.told()}

    def told(self) -> dict[str, Any]:
        """How things stand."""
        return {"changed": {name: {"text": text, "place": place} for name, (text, place) in self.changed.items()}, "undo": len(self.before),
                "lost": self.lost, "foreign": self.foreign or 0}

    def on_board(self) -> dict[str, int]:
        """Members of board_params that are not the header's, and whether the board has lost them."""
        return dict(self.wanted) | ({"lost": 1} if self.lost else {})

    def saved(self) -> bytes:
        """The header with the changed values, else to the last byte as its file is."""
        return _bytes(with_values(self.header, {name: text for name, (text, _) in self.changed.items()}))

    def motor(self) -> tuple[str, str]:
        """Name and text of a motor file of which `make tune` makes the same header; takes seconds."""
        if self.files is None:
            raise UserError("the header names no motor file", "motor file", "start make live with MOTOR=name, or save userparams.h")
        try:
            from tuning.motor_export import motor_text
        except ImportError:
            raise UserError("tomlkit is missing", "motor file", "start by make live, which installs it") from None
        motor, board = self.files
        for file in self.files:
            if not file.is_file():
                raise UserError("the header's file is not there", str(paths.shown(file)), "start make live with MOTOR=name, or save userparams.h")
        changed = {name: text for name, (text, _) in list(self.changed.items())}
        text, left = motor_text(motor, board_file.load(str(board)), self.texts | changed, others_of(self.header))
        self.news.extend(f"not in the motor file: {each}" for each in left)
        return motor.name, text
