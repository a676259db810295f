"""firmware/budget.toml: what the image may take, and the module that each word and byte of it is counted with.

A module is a list of files: a function or object is counted with the module that has the file it is written in. Names are exceptions:
members of a structure, and what belongs to another module than the rest of its file. A name that matches nothing is an error."""

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from tools.common import paths
from tools.common.toml_file import Document, Section

from .attribution import Image, Thing, Word
from .sources import Sources
from .stack import plain

PATH = paths.ROOT / "firmware" / "budget.toml"
START_VALUES, TEXTS, ALIGNMENT = "(start values)", "(texts)", "(alignment)"
SPECIAL = (START_VALUES, TEXTS, ALIGNMENT)


@dataclass(frozen=True)
class Limits:
    flash: int
    ram: int
    stack: int = 0
    goal: int | None = None     # flash that it is to come down to
    header: int | None = None   # cksum of the userparams.h that they are for


@dataclass(frozen=True)
class CycleLimits:
    """[cycles]: of the control interrupt, and the scenarios to find them with."""
    isr_max: int
    isr_mean: int
    period_max: int         # both interrupts of a period
    period_mean: int
    latency_max: int
    isr_bound: int          # of the longest paths, from entry to return and to the third duty
    duty_bound: int
    slow_bound: int
    duty_deadline: int      # of any image: to the third duty
    both_deadline: int      # and both interrupts, entry to return
    scenarios: tuple[str, ...]


@dataclass(frozen=True)
class Group:
    """A part of the whole beside a figure of AN1292; None: AN1292 does not have it."""
    name: str
    title: str
    note_flash: int | None
    counted: bool = True         # in the whole image


@dataclass(frozen=True)
class Module:
    name: str
    group: str
    files: tuple[str, ...] = ()
    functions: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    whole: bool = False          # also what is inlined into its functions
    flash_budget: int | None = None


@dataclass(frozen=True)
class Name:
    """A name in the file, to be looked for: kind is file, function, object, compiler or scenario."""
    kind: str
    text: str
    where: str


UNASSIGNED = Module("not assigned", "")


@dataclass
class Budget:
    note: Limits
    image: Limits
    cycles: CycleLimits
    groups: list[Group]
    modules: list[Module]
    with_caller: tuple[str, ...]
    calls_nothing: tuple[str, ...]
    names: list[Name]

    @staticmethod
    def read(path: Path = PATH) -> "Budget":
        root = Document(path).root
        names: list[Name] = []

        def listed(section: Section, key: str, kind: str, required: bool = False) -> tuple[str, ...]:
            texts = section.texts(key) if required else section.texts(key, [])
            names.extend(Name("file" if "/" in text else kind, text, section.where(key)) for text in texts)
            return tuple(texts)

        budget = _required(root, "budget")
        limits = []
        for name in ("note", "image"):
            section = _required(budget, name)
            limits.append(Limits(section.integer("flash_bytes", minimum=0), section.integer("ram_bytes", minimum=0),
                                 section.integer("stack_bytes", minimum=0) if name == "image" else 0,
                                 section.integer("goal_flash_bytes", None, minimum=0) if name == "note" else None,
                                 section.integer("header_cksum", None, minimum=0) if name == "image" else None))
            section.close()
        budget.close()
        section = _required(root, "cycles")
        cycles = CycleLimits(*(section.integer(f"{name}_cycles", minimum=1) for name in (
            "isr_max", "isr_mean", "period_max", "period_mean", "latency_max", "isr_bound", "duty_bound", "slow_bound", "duty_deadline", "both_deadline")),
                             listed(section, "scenarios", "scenario", required=True))
        section.close()
        stack = _required(root, "stack")
        calls_nothing = listed(stack, "calls_nothing", "compiler", required=True)
        stack.close()
        groups, modules = [], []
        for section in root.sections("group"):
            group = Group(section.text("name"), section.text("title"), section.integer("note_flash_bytes", None, minimum=0), section.flag("counted", True))
            groups.append(group)
            for part in section.sections("module"):
                modules.append(Module(part.text("name"), group.name, listed(part, "files", "file"),
                                      listed(part, "functions", "function") + listed(part, "compiler", "compiler"),
                                      listed(part, "objects", "object"), part.flag("whole", False), part.integer("flash_bytes", None, minimum=0)))
                part.close()
            section.close()
        with_caller = listed(root, "with_caller", "function", required=True)
        root.close()
        return Budget(*limits, cycles, groups, modules, with_caller, calls_nothing, names)

    def uncounted(self, found: "Shares") -> int:
        """Bytes of flash in groups that the budget does not count."""
        left_out = {group.name for group in self.groups if not group.counted}
        modules = {module.name for module in self.modules if module.group in left_out}
        return sum(share.flash for (module, _), share in found.items() if module in modules)

    # ---- what belongs to what --------------------------------------------------------------------------------------------
    def of_function(self, name: str, file: str) -> Module:
        return next((module for module in self.modules if fits(name, module.functions)), self._of_file(file))

    def of_object(self, path: str, file: str) -> Module:
        return next((module for module in self.modules if fits(path, module.objects)), self._of_file(file))

    def _of_file(self, file: str) -> Module:
        return next((module for module in self.modules if fits(file, module.files)), UNASSIGNED)

    def of_word(self, word: Word) -> tuple[Module, str, tuple[int, ...]]:
        """The module a word is counted with, the function it is shown under, and which copy of that function it is in."""
        names = [plain(f"_{frame.name}") for frame in word.chain]
        last = self.counted_at(word)
        for index in reversed(range(last + 1)):
            module = self.of_function(names[index], word.chain[index].file)
            if module.whole:
                return module, names[index], word.copy[:index + 1]
        return self.of_function(names[last], word.chain[last].file), names[last], word.copy[:last + 1]

    def counted_at(self, word: Word) -> int:
        """Place in the word's chain of the innermost function that is not counted with its caller."""
        return next((i for i in reversed(range(len(word.chain)))
                     if word.chain[i].file not in self.with_caller and not fits(word.chain[i].name, self.with_caller)), 0)

    # ---- names that match nothing ----------------------------------------------------------------------------------------
    def unmatched(self, sources: Sources, image: Image | None = None, root: Path = paths.ROOT) -> list[str]:
        """A line for every name that matches nothing or is given twice, and for every file with functions that is in no module.
        @param image for the names of the compiler's start-up code, which is in no source"""
        functions = {name for known in sources.functions.values() for name in known}
        known = {"function": functions, "object": sources.objects() | set(SPECIAL), "scenario": set(paths.names(paths.SCENARIOS)),
                 "compiler": image.labels if image else None}
        lines, seen = [], set()
        for name in self.names:
            if name.kind == "file":
                found = any(path.is_file() for path in root.glob(name.text))
            else:
                found = known[name.kind] is None or any(fnmatchcase(item, name.text) for item in known[name.kind])
            if not found:
                what = {"compiler": "function of the compiler's start-up code in the image", "object": "variable or member",
                        "scenario": "scenario in tools/bench/scenarios"}.get(name.kind, f"{name.kind} of the firmware")
                lines.append(f"'{name.text}' is no {what}, {name.where}: correct it or take it out")
            if (name.kind, name.text) in seen:
                lines.append(f"'{name.text}' is named twice, {name.where}: leave it in one place")
            if name.kind not in ("compiler", "scenario"):
                seen.add((name.kind, name.text))
        listed = tuple(name.text for name in self.names if name.kind == "file")
        return lines + [f"'{file}' is in no module: add it to the files of one in firmware/budget.toml"
                        for file, defined in sources.functions.items() if not fits(file, listed) and (defined or sources.variables[file])]


def fits(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


@dataclass
class Share:
    """What a module, function or object takes, in bytes."""
    flash: int = 0
    ram: int = 0
    copies: set[tuple[int, ...]] = field(default_factory=set)


Shares = dict[tuple[str, str], Share]   # by module, and function or object


def shares(image: Image, budget: Budget) -> Shares:
    """Flash and RAM of everything in the image."""
    result: Shares = {}
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
    own = budget.of_object(thing.name, thing.file)
    parts: list[list] = [[thing.name, own, thing.size]]
    at = {thing.name: parts[0]}
    for path, size in thing.members: # outer members come before those inside them
        part = at[path.rpartition(".")[0]]
        module = budget.of_object(path, "")
        if module is not UNASSIGNED and module is not part[1]:
            part[2] -= size
            part = [path, module, size]
            parts.append(part)
        at[path] = part
    return [(path, module, size) for path, module, size in parts if size]


def _required(section: Section, key: str) -> Section:
    found = section.section(key)
    if found is None:
        raise section.fail(key, f"no table [{key}]", "add it")
    return found
