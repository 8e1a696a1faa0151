"""Derivatives along many directions, with few operations for each.

Where all that moves a value does so by way of one other value, the derivative by that one is
calculated once, and multiplied by its derivative along each direction. That other value dominates
the first one: Lengauer and Tarjan, A Fast Algorithm for Finding Dominators in a Flowgraph (1979).
"""

from __future__ import annotations

from collections.abc import Mapping

from ..expressions.expression import in_order
from .algebraic import SEVERAL
from .graph import STILL, Graph, Value

# vectors, and values that may not be defined where another branch is taken: 0 times these is no 0
APART = (*SEVERAL, "component", "if")


class Slopes:
    """Derivatives of values by others that they follow from, each made once."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.known: dict[tuple[Value, Value], Value] = {}

    def along(self, roots: list[Value], seeds: Mapping[Value, Value]) -> list[Value]:
        """Return derivatives where each leaf has its own in `seeds`, or 0 if it is not there."""
        graph = self.graph
        zero, first = graph.number(0.0), _first_dominators(roots, seeds)
        found: dict[Value, Value] = {}
        for y in in_order(roots):
            if y not in first:
                found[y] = zero
            elif y in seeds:
                found[y] = seeds[y]
            elif first[y] is y:
                found[y] = graph.chain(y, [found[argument] for argument in y.arguments])
            else:
                slope = self._slope(y, first[y])
                found[y] = graph.scaled(slope, found[first[y]], bool(slope.functions))
        return [found[root] for root in roots]

    def _slope(self, y: Value, by: Value) -> Value:
        if (y, by) not in self.known:
            found = {by: self.graph.number(1.0)}
            for value in in_order([y], found):
                given = [found[argument] for argument in value.arguments]
                rests = value.op in STILL or not given
                found[value] = self.graph.number(0.0) if rests else self.graph.chain(value, given)
            self.known[y, by] = found[y]
        return self.known[y, by]


def _first_dominators(roots: list[Value], seeds: Mapping[Value, Value]) -> dict[Value, Value]:
    """Return, for each value that moves, the first value through which all that moves it goes.

    It is the value itself where there is no other.
    """
    first: dict[Value, Value] = {}
    for y in in_order(roots):
        if y in seeds:
            first[y] = y
        elif y.op not in STILL:
            moving = {first[argument] for argument in y.arguments if argument in first}
            is_single = len(moving) == 1 and y.op not in APART
            if moving:
                first[y] = moving.pop() if is_single else y
    return first
