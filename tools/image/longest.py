"""The longest path through the graph of an interrupt: loops turn as often as is stated, parts that exclude each other are not both in it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property

from tools.common.errors import UserError

from .flow_graph import Graph, Node, components

Edges = dict[Node, list[tuple[Node, int]]]


@dataclass(frozen=True)
class Loop:
    """A loop that is entered at its head: how often that is executed at most, each time and in one interrupt, and its longest turn."""
    head: Node
    turns: int
    executions: int
    cycles: int


@dataclass(frozen=True)
class Parts:
    """What of a graph is in which named part, and which parts no path has all of."""
    of: dict[int, int] = field(default_factory=dict)    # address: bits of the parts that it is in
    forbidden: tuple[int, ...] = ()                     # sets of such bits

    def possible(self, mask: int) -> bool:
        return all(mask & parts != parts for parts in self.forbidden)


@dataclass(frozen=True)
class Path:
    cycles: int
    nodes: tuple[tuple[Node, int], ...]     # with the cycles to each one's end
    loops: dict[Node, Loop]                 # those on the path, by head


class Paths:
    """The graph without loops: each is an edge from its head to wherever it is left."""

    def __init__(self, graph: Graph, turns: Callable[[set[int]], int | None], name: Callable[[int], str] = hex) -> None:
        self.graph, self.name = graph, name
        self.turns = turns
        self.loops: dict[Node, Loop] = {}
        self.edges = self._acyclic(graph.edges, graph.start, 1)

    @cached_property
    def order(self) -> list[Node]:
        """Every node before those that it leads to."""
        return [component[0] for component in reversed(components(self.edges, self.graph.start))]

    def _acyclic(self, edges: Edges, start: Node, around: int) -> Edges:
        """@param around turns of the loops around these nodes"""
        result: Edges = {}
        for component in components(edges, start):
            head = component[0]
            if len(component) == 1 and all(to != head for to, _ in edges[head]):
                result[head] = edges[head]
            else:
                self._collapse(edges, start, set(component), around, result)
        return result

    def _collapse(self, edges: Edges, start: Node, inside: set[Node], around: int, result: Edges) -> None:
        """A loop as edges from its head."""
        heads = {to for node, ways in edges.items() if node not in inside for to, _ in ways if to in inside} | {start} & inside
        if len(heads) != 1:
            raise UserError(f"a loop with {len(heads)} ways into it", self.name(min(node.address for node in inside)), "write it with one")
        head = next(iter(heads))
        turns = self._stated(inside)
        body = self._acyclic({node: [way for way in edges[node] if way[0] in inside and way[0] != head] for node in inside}, head, around * turns)
        before = _furthest(body, head)
        cycles = max(before[node] + cost for node in body for to, cost in edges[node] if to == head)
        self.loops[head] = Loop(head, turns, turns * around, cycles)
        result[head] = [(to, (turns - 1) * cycles + before[node] + cost) for node in body for to, cost in edges[node] if to not in inside]
        if not result[head]:
            raise UserError("a loop that is never left", self.name(head.address), "its longest path cannot be known")

    def _stated(self, inside: set[Node]) -> int:
        addresses = {node.address for node in inside}
        automatic = [turns for first, turns in self.graph.turns.items() if first in addresses]
        turns = automatic[0] if len(automatic) == 1 else self.turns(addresses)
        if turns is None:
            raise UserError(f"nobody says how often the loop at 0x{min(addresses):x} turns", self.name(min(addresses)),
                            "state it in its line: /* wcet: at most 8 turns */")
        return turns

    def longest(self, parts: Parts = Parts(), to: Callable[[Node], bool] | None = None) -> Path:
        """The longest path to the end of the interrupt, or of an instruction.
        @param to which instructions; None: returns from the interrupt"""
        ends = [node for node in self.order if (node in self.graph.ends if to is None else to(node))]
        best = self._states(parts)
        found = [(state[0], node, mask) for node in ends for mask, state in best[node].items()]
        if not found:
            raise UserError("no path to its end", self.name(self.graph.start.address), "correct what is stated about it")
        cycles, node, mask = max(found, key=lambda item: item[0])
        way = []
        while node is not None:
            reached, before = best[node][mask]
            way.append((node, reached))
            node, mask = before
        return Path(cycles, tuple(reversed(way)), {node: self.loops[node] for node, _ in way if node in self.loops})

    def _states(self, parts: Parts) -> dict[Node, dict[int, tuple[int, tuple[Node | None, int]]]]:
        """Of each node and each set of parts that a path to it has been in: cycles, and where the longest such path comes from.
        A part is forgotten where nothing that it could be forbidden with can follow."""
        ahead = self._ahead(parts)
        best: dict[Node, dict[int, tuple[int, tuple[Node | None, int]]]] = {node: {} for node in self.order}
        start = self.graph.start
        best[start][parts.of.get(start.address, 0) & ahead[start]] = (self.graph.first, (None, 0))
        for node in self.order:
            for mask, (cycles, _) in best[node].items():
                for to, cost in self.edges[node]:
                    _arrive(best[to], parts, (mask | parts.of.get(to.address, 0), ahead[to]), cycles + cost, (node, mask))
        return best

    def _ahead(self, parts: Parts) -> dict[Node, int]:
        """Of each node the parts that are in a set with one which can follow."""
        following: dict[Node, int] = {}
        for node in reversed(self.order):
            following[node] = 0
            for to, _ in self.edges[node]:
                following[node] |= following[to] | parts.of.get(to.address, 0)
        sets = {mask: _union(forbidden for forbidden in parts.forbidden if forbidden & mask) for mask in set(following.values())}
        return {node: sets[mask] for node, mask in following.items()}


def _union(masks: Iterable[int]) -> int:
    result = 0
    for mask in masks:
        result |= mask
    return result


def _arrive(states: dict, parts: Parts, where: tuple[int, int], cycles: int, before: tuple[Node, int]) -> None:
    mask, ahead = where
    if parts.possible(mask) and cycles > states.get(mask & ahead, (-1,))[0]:
        states[mask & ahead] = (cycles, before)


def _furthest(edges: Edges, start: Node) -> dict[Node, int]:
    """Cycles of the longest path from a node to every other one; without loops."""
    result = {start: 0}
    for component in reversed(components(edges, start)):
        node = component[0]
        for to, cost in edges[node]:
            result[to] = max(result[node] + cost, result.get(to, 0))
    return result
