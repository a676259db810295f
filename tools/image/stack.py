"""The deepest stack that the image can need, from its disassembly: frames, calls, and interrupts on top of each other."""

import re
from dataclasses import dataclass, field, replace

from tools.common.errors import UserError

ENTRY_BYTES = 4     # of a call, an interrupt and a trap: return address, and for the latter the status
TRAP_LEVELS = {"_MathError": 11, "_StackError": 12, "_AddressError": 13, "_OscillatorFail": 14}
RESET_LEVEL = 4     # priority of an interrupt whose IPC field nobody writes

_LINE = re.compile(r"\s*([0-9a-f]+):\t((?:[0-9a-f]{2} ){3})\s*(?:\t?\s*(\S.*))?$")
_LABEL = re.compile(r"([0-9a-f]+) <([^>]*)>:$")
_ADDRESS = re.compile(r"(?:^|[\s,])0x([0-9a-f]+)(?: <[^>]*>)*$")
_LITERAL = re.compile(r"#0x([0-9a-f]+)")
_POINTER = re.compile(r"\b(w15|sp)\b", re.IGNORECASE)
SKIPS = ("btsc", "btss", "cpseq", "cpsne", "cpsgt", "cpslt")
RETURNS = ("return", "retlw", "retfie")


@dataclass(frozen=True)
class Instruction:
    address: int
    mnemonic: str      # without .w, .b and .d
    operands: str
    text: str
    double: bool       # .d: two words of data
    size: int          # PC units: 2 or 4


@dataclass
class Function:
    name: str
    instructions: list[Instruction]


@dataclass
class Use:
    """Stack of one function: its own deepest point, and the depth at each call (return address not counted)."""
    own: int = 0
    calls: list[tuple[int, int, int]] = field(default_factory=list)   # address of the target, depth, 0 for a jump or ENTRY_BYTES
    errors: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Chain:
    """The deepest way into the stack from a function on: (name, bytes it adds) of each step."""
    depth: int
    steps: tuple[tuple[str, int], ...]


@dataclass
class Level:
    """What can be on the stack at one priority: the deepest of its interrupts."""
    priority: int
    chain: Chain
    others: list[str]


@dataclass
class Result:
    main: Chain
    levels: list[Level]
    errors: list[str]

    @property
    def depth(self) -> int:
        return self.main.depth + sum(level.chain.depth for level in self.levels)


def parse(listing: str) -> list[Function]:
    """Functions of a disassembly by xc16-objdump -d; a label that starts with a dot is no function."""
    functions: list[Function] = []
    into: list[Instruction] = []
    for line in listing.splitlines():
        if (label := _LABEL.match(line)) and not label[2].startswith("."):
            into = []
            functions.append(Function(label[2], into))
        if not functions or not (found := _LINE.match(line)):
            continue
        address, text = int(found[1], 16), (found[3] or "").strip()
        if not text: # the second word of the instruction before
            into[-1:] = [replace(last, size=4) for last in into[-1:]]
            continue
        if into and address != into[-1].address + into[-1].size: # another section, without a label
            into = []
        head, _, operands = text.partition(" ")
        mnemonic, _, width = head.lower().partition(".")
        into.append(Instruction(address, mnemonic, operands.strip(), " ".join(text.split()), width == "d", 2))
    return [function for function in functions if function.instructions]


class Program:
    """All functions of a disassembly, with what each of them does to the stack."""

    def __init__(self, functions: list[Function], calls_nothing: tuple[str, ...] = ()) -> None:
        self.functions = functions
        self.calls_nothing = calls_nothing
        self.at: dict[int, tuple[Function, Instruction]] = {}
        for function in functions:
            for instruction in function.instructions:
                self.at[instruction.address] = function, instruction
        self.uses: dict[int, Use] = {}
        self.errors: list[str] = []

    def named(self, name: str) -> Function | None:
        return next((function for function in self.functions if plain(function.name) == name), None)

    def deepest(self, start: int, path: tuple[int, ...] = ()) -> Chain:
        """The deepest chain of calls from the function that is entered at an address."""
        if start not in self.at:
            self._error(f"call of 0x{start:x}, where no code is")
            return Chain(0, ())
        name = plain(self.at[start][0].name)
        if start in path:
            names = [plain(self.at[entry][0].name) for entry in (*path[path.index(start):], start)]
            self._error(f"recursion: {' -> '.join(names)}")
            return Chain(0, ())
        if start not in self.uses:
            self.uses[start] = self._walk(start)
        use = self.uses[start]
        for error in use.errors:
            self._error(error)
        best = Chain(use.own, ((name, use.own),))
        for target, depth, entry in use.calls:
            below = self.deepest(target, (*path, start))
            if depth + entry + below.depth > best.depth:
                best = Chain(depth + entry + below.depth, ((name, depth + entry), *below.steps))
        return best

    def _error(self, text: str) -> None:
        if text not in self.errors:
            self.errors.append(text)

    def _walk(self, start: int) -> Use:
        """Follows every way through a function with the depth of the stack at each instruction."""
        use = Use()
        function = self.at[start][0]
        seen: dict[int, tuple[int, tuple[int, ...]]] = {}
        todo = [(start, 0, ())]
        while todo:
            address, depth, frames = todo.pop()
            if address not in self.at:
                use.errors.append(f"{plain(function.name)}: goes on at 0x{address:x}, where no code is")
                continue
            owner, instruction = self.at[address]
            if owner is not function and address == owner.instructions[0].address: # a jump or fall into another function
                use.calls.append((address, depth, 0))
                continue
            if address in seen:
                if seen[address][0] != depth:
                    use.errors.append(f"{plain(function.name)}: depth {seen[address][0]} or {depth} at 0x{address:x}: "
                                      "the stack grows in a loop, or two ways disagree")
                continue
            seen[address] = depth, frames
            use.own = max(use.own, depth)
            todo += self._step(function, instruction, depth, frames, use)
        return use

    def _step(self, function: Function, instruction: Instruction, depth: int, frames: tuple[int, ...], use: Use):
        """The instructions that can come next, with the depth there."""
        name, mnemonic = plain(function.name), instruction.mnemonic
        following, target = instruction.address + instruction.size, _target(instruction)
        body = self.at[following][1] if following in self.at else None

        def tell(problem: str, text: str = f" ({instruction.text})") -> None:
            use.errors.append(f"{name}: {problem} at 0x{instruction.address:x}{text}")

        ways = [following]
        if mnemonic in RETURNS or mnemonic == "reset":
            if depth and mnemonic != "reset":
                tell(f"returns with {depth} bytes on the stack", "")
            ways = []
        elif mnemonic in ("call", "rcall"):
            if target is not None:
                use.calls.append((target, depth, ENTRY_BYTES))
            elif name not in self.calls_nothing:
                tell("call through a pointer")
        elif mnemonic in ("goto", "bra"):
            ways = self._table(instruction, following) if target is None else [target, *(ways if _conditional(instruction) else [])]
            if not ways:
                tell("jump through a pointer")
        else:
            depth, frames, problem = _effect(instruction, depth, frames)
            if problem:
                tell(problem)
            if body and mnemonic.startswith(SKIPS):
                ways.append(following + body.size)
            moved = _effect(body, depth, frames)[0] - depth if body and mnemonic == "repeat" else 0
            if moved and (count := _LITERAL.search(instruction.operands)):
                depth, ways = depth + moved * (int(count[1], 16) + 1), [following + body.size]
            elif moved:
                tell("the stack grows by an unknown number of repetitions", "")
            use.own = max(use.own, depth)
        return [(way, depth, frames) for way in ways]

    def _table(self, instruction: Instruction, following: int) -> list[int]:
        """A switch: bra wn, followed by a branch for each case."""
        table = []
        while instruction.mnemonic == "bra" and following in self.at:
            case = self.at[following][1]
            if case.mnemonic not in ("bra", "goto") or _target(case) is None or _conditional(case):
                break
            table.append(following)
            following += case.size
        return table


def _conditional(branch: Instruction) -> bool:
    return branch.mnemonic == "bra" and "," in re.sub(r"<[^>]*>", "", branch.operands)


def _target(instruction: Instruction) -> int | None:
    if instruction.operands.strip() == "." or instruction.operands.endswith(", ."):
        return instruction.address
    found = _ADDRESS.search(instruction.operands)
    return int(found[1], 16) if found else None


def _effect(instruction: Instruction, depth: int, frames: tuple[int, ...]) -> tuple[int, tuple[int, ...], str]:
    """Depth and open frames after an instruction, and what cannot be followed."""
    mnemonic, operands = instruction.mnemonic, instruction.operands.lower()
    if mnemonic == "lnk":
        return depth + 2 + int(_LITERAL.search(operands)[1], 16), (*frames, depth), ""
    if mnemonic == "ulnk":
        return (frames[-1], frames[:-1], "") if frames else (depth, frames, "a frame is closed that is not open")
    moved = 4 if instruction.double else 2
    if mnemonic in ("push", "pop") and operands:
        return depth + (moved if mnemonic == "push" else -moved), frames, ""
    if not _POINTER.search(operands):
        return depth, frames, ""
    depth += moved * len(re.findall(r"\[(?:w15|sp)\+\+\]|\[\+\+(?:w15|sp)\]", operands))
    depth -= moved * len(re.findall(r"\[(?:w15|sp)--\]|\[--(?:w15|sp)\]", operands))
    # the last operand is the destination; a comparison has none
    parts = [part.strip() for part in operands.split(",")]
    if parts[-1] not in ("w15", "sp") or mnemonic.startswith(("cp", "btst", *SKIPS)):
        return depth, frames, ""
    literal = _LITERAL.search(operands)
    pointer_first = len(parts) < 3 or parts[0] in ("w15", "sp")
    if mnemonic in ("add", "sub") and literal and pointer_first:
        size = int(literal[1], 16)
        return depth + (size if mnemonic == "add" else -size), frames, ""
    if mnemonic in ("inc2", "dec2"):
        return depth + (2 if mnemonic == "inc2" else -2), frames, ""
    if mnemonic == "mov" and literal: # start-up: the stack begins here
        return 0, (), ""
    return depth, frames, "the stack pointer is computed"


def plain(symbol: str) -> str:
    """A symbol's name in C, without what the compiler appends to a clone's."""
    return re.sub(r"\.(clone|isra|constprop|part)\b.*", "", symbol.removeprefix("_"))


def priorities(source: str) -> dict[str, int]:
    """Handler and level of every interrupt whose IPC field the source sets: IPC3bits.AD1IP = 5, or a name for 5 that the source defines, gives
    _ADC1Interrupt."""
    named = dict(re.findall(r"^#define (BOARD_PRIORITY_\w+) (\d+)", source, re.MULTILINE))
    levels: dict[str, int] = {}
    for name, level in re.findall(r"\bIPC\d+bits\.(\w+?)IP\s*=\s*(\w+)", source):
        number = named.get(level, level)
        if not number.isdecimal():
            raise UserError(f"the priority of an interrupt is no number, {name}IP = {level}", "firmware/board",
                            "define it in include/board/mclv.h as BOARD_PRIORITY_NAME")
        levels[f"_{'ADC1' if name == 'AD1' else name}Interrupt"] = int(number)
    return levels


def analyse(listing: str, start: int, handlers: dict[str, list[str]], levels: dict[str, int], calls_nothing: tuple[str, ...] = ()) -> Result:
    """The deepest stack of a program.
    @param start address of the first instruction after reset
    @param handlers names of the interrupt functions: the vectors that go to each
    @param levels priority of a vector; another one counts as RESET_LEVEL, a trap as what the core says"""
    program = Program(parse(listing), calls_nothing)
    main = program.deepest(start)
    at: dict[int, list[Chain]] = {}
    for name, vectors in handlers.items():
        function = program.named(name)
        if function is None:
            program._error(f"{name}: no such function")
            continue
        chain = program.deepest(function.instructions[0].address)
        entry = Chain(chain.depth + ENTRY_BYTES, (("interrupt entry", ENTRY_BYTES), *chain.steps))
        for level in {TRAP_LEVELS.get(vector, levels.get(vector, RESET_LEVEL)) for vector in vectors}:
            at.setdefault(level, []).append(entry)
    result = []
    for level, chains in sorted(at.items()):
        chains.sort(key=lambda chain: -chain.depth)
        result.append(Level(level, chains[0], [f"{chain.steps[1][0]} {chain.depth}" for chain in chains[1:]]))
    return Result(main, result, program.errors)


def table(result: Result) -> list[str]:
    """The deepest chain, a line for each function: bytes it adds, bytes so far."""
    lines, total = [], 0
    for title, chain, others in [("background", result.main, []),
                                 *((f"level {level.priority}", level.chain, level.others) for level in result.levels)]:
        for name, size in chain.steps:
            total += size
            lines.append(f"{title:<12}{name:<28}{size:>5}{total:>7}")
            title = ""
        if others:
            lines.append(f"{'':<12}(instead of {', '.join(others)})")
    return lines
