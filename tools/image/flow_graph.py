"""The control flow graph of an interrupt: a node for each instruction, an edge for each way on, with the cycles it takes.

A called function stands in the graph once for each way to call it, so that every path of the graph is one of the program. What the core
takes depends on the instruction before (a stall), so cycles belong to edges: those of the instruction that the edge leads to."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from tools.common.errors import UserError

from . import pointers
from .facts import Flow, Op

Fetch = Callable[[int], Op | None]      # the instruction at an address
MOST_CALLS = 12


@dataclass(frozen=True)
class Core:
    """Cycles that do not stand at one instruction."""
    stall: int              # a source address that the instruction before has written
    window: int             # a word read through the PSV window
    window_inner: int       # the same in the turns of REPEAT between first and last
    entry: int              # of an interrupt

    @staticmethod
    def of(assumed: dict[str, int]) -> "Core":
        return Core(assumed["RAW_STALL_CYCLES"], assumed["PSV_READ_CYCLES"], assumed["PSV_REPEAT_INNER_CYCLES"], assumed["INTERRUPT_ENTRY_CYCLES"])


@dataclass(frozen=True)
class Node:
    """An instruction, and the calls that have led to it: addresses behind them."""
    address: int
    calls: tuple[int, ...] = ()


@dataclass
class Graph:
    start: Node
    first: int                                                              # cycles to the end of the first instruction
    edges: dict[Node, list[tuple[Node, int]]] = field(default_factory=dict) # where to, cycles of the instruction there
    ops: dict[int, Op] = field(default_factory=dict)
    turns: dict[int, int] = field(default_factory=dict)                     # address behind DO: how often its loop turns
    single: int = 0                                                         # cycles of the longest instruction: an interrupt waits for its end

    @cached_property
    def ends(self) -> set[Node]:
        """The returns from the interrupt."""
        return {node for node, ways in self.edges.items() if not ways}


class _Builder:
    def __init__(self, fetch: Fetch, core: Core, name: Callable[[int], str]) -> None:
        self.fetch, self.core, self.name = fetch, core, name
        self.known: dict[int, Op] = {}
        self.loops: dict[int, int] = {}     # last instruction of a DO loop: the first one
        self.turns: dict[int, int] = {}

    def op(self, address: int) -> Op:
        if address not in self.known:
            found = self.fetch(address)
            if found is None:
                raise UserError(f"no instruction at 0x{address:x}", self.name(address), "its longest path cannot be known")
            self.known[address] = found
        return self.known[address]

    def refuse(self, op: Op, why: str) -> UserError:
        return UserError(f"{why} at 0x{op.address:x} ({op.text})", self.name(op.address), "its longest path cannot be known")

    def cost(self, before: Op | None, op: Op, held: pointers.Held) -> int:
        """Cycles of an instruction behind another one.
        @param held what the registers hold before it"""
        stalled = before is not None and before.writes & op.stall
        turns = before.count + 1 if before is not None and before.flow is Flow.REPEAT else 1
        cycles = turns * op.cycles + (self.core.stall if stalled else 0)
        if turns > 1 and op.writes & op.stall:
            cycles += (turns - 1) * self.core.stall
        if op.window and not pointers.is_ram(op, held):
            outer = min(turns, 2)
            cycles += op.window * (outer * self.core.window + (turns - outer) * self.core.window_inner)
        return cycles

    def graph(self, start: int) -> Graph:
        first = Node(start)
        ways: dict[Node, list[tuple[Node, int]]] = {}
        todo = [first]
        while todo:
            node = todo.pop()
            if node not in ways:
                ways[node] = self.ways(node, self.op(node.address))
                todo += [to for to, _ in ways[node]]
        held = self.held(ways, first)
        edges = {node: [(to, extra + self.cost(self.op(node.address), self.op(to.address), held[to])) for to, extra in leading]
                 for node, leading in ways.items()}
        return Graph(first, self.core.entry + self.cost(None, self.op(start), held[first]), edges, self.known, self.turns,
                     max((self.single(node, to, held[to], ways[to]) for node in ways for to, _ in ways[node]), default=0))

    def single(self, node: Node, to: Node, held: pointers.Held, ways: list[tuple[Node, int]]) -> int:
        """Cycles of an instruction, or of one turn of a repeated one, and of going on from there."""
        op, before = self.op(to.address), self.op(node.address)
        return self.cost(op if before.flow is Flow.REPEAT else before, op, held) + max((extra for _, extra in ways), default=0)

    def held(self, ways: dict[Node, list[tuple[Node, int]]], first: Node) -> dict[Node, pointers.Held]:
        """What is known of the registers before each instruction."""
        result = {first: pointers.NOTHING_KNOWN}
        todo = [first]
        while todo:
            node = todo.pop()
            then = pointers.after(self.op(node.address), result[node])
            for to, _ in ways[node]:
                known = pointers.meet(result[to], then) if to in result else then
                if known != result.get(to):
                    result[to] = known
                    todo.append(to)
        return result

    def ways(self, node: Node, op: Op) -> list[tuple[Node, int]]:
        """Where the program goes on, and the cycles for going there."""
        if op.flow is Flow.RETURN:
            return [(Node(node.calls[-1], node.calls[:-1]), 0)] if node.calls else []
        if op.flow is Flow.CALL:
            return [(self.called(node, op), op.taken)]
        if op.flow in (Flow.COMPUTED, Flow.STOP) or op.flow in (Flow.BRANCH, Flow.JUMP) and op.target < 0:
            raise self.refuse(op, "a jump through a register" if op.flow is Flow.COMPUTED else "the program goes nowhere")
        ways = [] if op.flow is Flow.JUMP else self.going_on(node, op)
        if op.flow in (Flow.BRANCH, Flow.JUMP):
            ways.append((Node(op.target, node.calls), op.taken))
        elif op.flow is Flow.SKIP:
            over = self.op(op.following)
            ways.append((Node(over.following, node.calls), op.taken * over.words))
        elif op.flow in (Flow.REPEAT, Flow.DO):
            self.counted(op)
        return ways

    def called(self, node: Node, op: Op) -> Node:
        if op.following in node.calls or len(node.calls) >= MOST_CALLS:
            raise self.refuse(op, "recursion")
        return Node(op.target, (*node.calls, op.following))

    def counted(self, op: Op) -> None:
        if op.count < 0:
            raise self.refuse(op, "a register says how often something is repeated")
        if op.flow is Flow.DO:
            self.loops[op.target], self.turns[op.following] = op.following, op.count + 1

    def going_on(self, node: Node, op: Op) -> list[tuple[Node, int]]:
        """To the next instruction, and at the end of a DO loop back to its first one."""
        again = self.loops.get(op.address)
        return [(Node(op.following, node.calls), 0)] + ([] if again is None else [(Node(again, node.calls), 0)])


def build(fetch: Fetch, core: Core, start: int, name: Callable[[int], str] = hex) -> Graph:
    """The graph of the interrupt that starts at an address.
    @param name what to call an address where something cannot be followed"""
    return _Builder(fetch, core, name).graph(start)


def components(edges: dict[Node, list[tuple[Node, int]]], start: Node) -> list[list[Node]]:
    """Strongly connected components of what can be reached, each before those that lead to it (Tarjan)."""
    order: dict[Node, int] = {start: 0}
    low = {start: 0}
    waiting, held, result = [start], {start}, []
    todo = [(start, iter(edges[start]))]
    while todo:
        node, ways = todo[-1]
        for to, _ in ways:
            if to not in order:
                order[to] = low[to] = len(order)
                waiting.append(to)
                held.add(to)
                todo.append((to, iter(edges[to])))
                break
            if to in held:
                low[node] = min(low[node], order[to])
        else:
            todo.pop()
            if todo:
                low[todo[-1][0]] = min(low[todo[-1][0]], low[node])
            if low[node] == order[node]:
                result.append(_popped(waiting, node))
                held.difference_update(result[-1])
    return result


def _popped(waiting: list[Node], last: Node) -> list[Node]:
    """What has come on the stack since a node, and the node."""
    result = [waiting.pop()]
    while result[-1] != last:
        result.append(waiting.pop())
    return result
