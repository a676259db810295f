"""firmware/budget.toml: what the image may take, and the module that each word and byte of it is counted with."""

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from tools.common import paths
from tools.common.toml_file import Document, Section

from .attribution import Image, Thing, Word
from .stack import plain

PATH = paths.ROOT / "firmware" / "budget.toml"
START_VALUES = "(start values)"


@dataclass(frozen=True)
class Limits:
    flash: int
    ram: int
    stack: int = 0


@dataclass(frozen=True)
class Group:
    """A part of the whole beside a figure of the note; None: the note does not have it."""
    name: str
    title: str
    note_flash: int | None


@dataclass(frozen=True)
class Module:
    name: str
    group: str
    functions: tuple[str, ...]
    objects: tuple[str, ...]
    files: tuple[str, ...]
    whole: bool          # also what is inlined into its functions
    flash_budget: int | None


UNASSIGNED = Module("not assigned", "", (), (), (), False, None)


@dataclass
class Budget:
    note: Limits
    image: Limits
    groups: list[Group]
    modules: list[Module]
    with_caller: tuple[str, ...]
    calls_nothing: tuple[str, ...]

    @staticmethod
    def read(path: Path = PATH) -> "Budget":
        document = Document(path)
        root = document.root
        budget = _required(root, "budget")
        limits = []
        for name in ("note", "image"):
            section = _required(budget, name)
            limits.append(Limits(section.integer("flash_bytes", minimum=0), section.integer("ram_bytes", minimum=0),
                                 section.integer("stack_bytes", minimum=0) if name == "image" else 0))
            section.close()
        budget.close()
        root.section("cycles") # for `make cycles`
        stack = _required(root, "stack")
        calls_nothing = tuple(stack.texts("calls_nothing"))
        stack.close()
        groups = [Group(section.text("name"), section.text("title"), section.integer("note_flash_bytes", None, minimum=0))
                  for section in root.sections("group")]
        modules = [_module(section, [group.name for group in groups]) for section in root.sections("module")]
        with_caller = tuple(root.texts("with_caller"))
        root.close()
        return Budget(*limits, groups, modules, with_caller, calls_nothing)

    def of_function(self, name: str, file: str) -> Module:
        """By name; a function that nobody names by the file it is written in."""
        return (_nearest(name, [(pattern, module) for module in self.modules for pattern in module.functions])
                or next((module for module in self.modules if file and file in module.files), UNASSIGNED))

    def of_object(self, path: str) -> Module | None:
        return _nearest(path, [(pattern, module) for module in self.modules for pattern in module.objects])

    def of_word(self, word: Word) -> tuple[Module, str, tuple[int, ...]]:
        """The module a word is counted with, the function it is shown under, and which copy of that function it is in."""
        names = [plain(f"_{frame.name}") for frame in word.chain]
        last = next((i for i in reversed(range(len(names))) if not _fits(names[i], self.with_caller)), 0)
        for index in reversed(range(last + 1)):
            module = self.of_function(names[index], word.chain[index].file)
            if module.whole:
                return module, names[index], word.copy[:index + 1]
        return self.of_function(names[last], word.chain[last].file), names[last], word.copy[:last + 1]


@dataclass
class Share:
    """What a module, function or object takes, in bytes."""
    flash: int = 0
    ram: int = 0
    copies: set[tuple[int, ...]] = field(default_factory=set)


def shares(image: Image, budget: Budget) -> dict[tuple[str, str], Share]:
    """Flash and RAM of every (module, function or object)."""
    result: dict[tuple[str, str], Share] = {}
    for word in image.words:
        module, name, copy = budget.of_word(word)
        share = result.setdefault((module.name, name), Share())
        share.flash += 3
        share.copies.add(copy)
    things = [(thing, "flash") for thing in image.constants] + [(thing, "ram") for thing in image.data]
    if image.initial_words:
        things.append((Thing(START_VALUES, 3 * image.initial_words), "flash"))
    for thing, memory in things:
        for path, module, size in _split(thing, budget):
            share = result.setdefault((module.name, path), Share())
            setattr(share, memory, getattr(share, memory) + size)
    return result


def _split(thing: Thing, budget: Budget) -> list[tuple[str, Module, int]]:
    """A structure is counted with several modules: each member that a module names, and the rest with the structure's own."""
    own = budget.of_object(thing.name) or UNASSIGNED
    parts: list[list] = [[thing.name, own, thing.size]]
    at = {thing.name: parts[0]}
    for path, size in thing.members: # outer members come before those inside them
        part = at[path.rpartition(".")[0]]
        module = budget.of_object(path)
        if module is not None and module is not part[1]:
            part[2] -= size
            part = [path, module, size]
            parts.append(part)
        at[path] = part
    return [(path, module, size) for path, module, size in parts if size]


def _module(section: Section, groups: list[str]) -> Module:
    module = Module(section.text("name"), section.choice("group", groups), tuple(section.texts("functions", [])),
                    tuple(section.texts("objects", [])), tuple(section.texts("files", [])), section.flag("whole", False),
                    section.integer("flash_bytes", None, minimum=0))
    section.close()
    return module


def _required(section: Section, key: str) -> Section:
    found = section.section(key)
    if found is None:
        raise section.fail(key, f"no table [{key}]", "add it")
    return found


def _nearest(name: str, patterns: list[tuple[str, Module]]) -> Module | None:
    """The module with the longest pattern that fits; a name written in full comes before any pattern."""
    fitting = [(pattern == name, len(pattern), -place, module) for place, (pattern, module) in enumerate(patterns) if fnmatchcase(name, pattern)]
    return max(fitting, key=lambda item: item[:3])[3] if fitting else None


def _fits(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)
