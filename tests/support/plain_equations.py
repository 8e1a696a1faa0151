"""Equations in plain C as series in arb's intervals, by the graph of the generator's front end."""

from __future__ import annotations

import operator
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from operator import methodcaller
from pathlib import Path
from typing import Any

import flint
from flint import arb, arb_series

from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
from compiler.graph.graph import Graph, Value  # noqa: E402
from compiler.plain_c.interpreter import Interpreter  # noqa: E402
from compiler.plain_c.memory import Array, Structure, is_whole  # noqa: E402
from compiler.plain_c.text import read  # noqa: E402
from compiler.read.header import made  # noqa: E402

__all__ = [
    "ACCELERATIONS", "STATES", "Array", "Leaf", "Place", "PlainEquations", "Sized", "Structure",
    "along", "is_whole", "precision",
]  # fmt: skip

Place = tuple[str | int, ...]  # a part of an argument, from its name
BITS = 200
STATES: list[Place] = [("values", field, i) for field in ("q", "dq") for i in (0, 1)]
ACCELERATIONS: list[Place] = [("values", "ddq", i) for i in (0, 1)]


@contextmanager
def precision(order: int) -> Iterator[None]:
    """Of numbers and series."""
    before = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = BITS, order + 1
    yield
    flint.ctx.prec, flint.ctx.cap = before


class Sized:
    """A series, and a majorant of it and of its errors: how large it is if no terms cancel."""

    def __init__(self, value: arb_series, size: arb_series | None = None) -> None:
        self.value = value
        self.size = arb_series([abs(x) for x in value]) if size is None else size

    @staticmethod
    def of(*coefficients: arb | float) -> Sized:
        return Sized(arb_series([*coefficients]))

    @property
    def moving(self) -> arb_series:
        """The majorant without order 0."""
        return self.size - self.size[0]

    def __add__(self, other: Sized) -> Sized:
        return Sized(self.value + other.value, self.size + other.size)

    def __sub__(self, other: Sized) -> Sized:
        return Sized(self.value - other.value, self.size + other.size)

    def __mul__(self, other: Sized) -> Sized:
        return Sized(self.value * other.value, self.size * other.size)

    def __truediv__(self, other: Sized) -> Sized:
        share = 1 / (abs(other.value[0]) - other.moving)
        return Sized(self.value / other.value, self.size * other.size * share * share)

    def __neg__(self) -> Sized:
        return Sized(-self.value, self.size)

    def sin(self) -> Sized:
        return Sized(self.value.sin(), self.moving.exp())

    def cos(self) -> Sized:
        return Sized(self.value.cos(), self.moving.exp())

    def exp(self) -> Sized:
        largest = self.value[0].exp() * (1 + self.size[0])
        return Sized(self.value.exp(), largest * self.moving.exp())

    def integral(self) -> Sized:
        return Sized(self.value.integral(), self.size.integral())


Leaf = Callable[[Place], Sized]


def _compared(compare: Callable[[Any, Any], bool]) -> Callable[[Sized, Sized], bool]:
    return lambda a, b: compare(a.value[0], b.value[0])


OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "negative": operator.neg, "value_of": lambda x: x, "not": operator.not_,
    **{function: methodcaller(function) for function in ("sin", "cos", "exp")},
    "<": _compared(operator.lt), "<=": _compared(operator.le), ">": _compared(operator.gt),
    ">=": _compared(operator.ge), "==": _compared(operator.eq),
}  # fmt: skip


class PlainEquations:
    """What a function in a header writes, as values of a graph with the places of its leaves."""

    def __init__(self, header: Path, function: str) -> None:
        program = read(header, made=made)
        graph = Graph(has_switches=False, is_guarded=False)
        self.interpreter = Interpreter(program, graph, doubles_move=False)
        self.places: dict[Value, Place] = {}
        _, self.written = self.interpreter.run(function, self._leaf)

    def _leaf(self, place: Place, kind: Any) -> Any:
        name = ".".join(map(str, place))
        if is_whole(kind):
            table = self.interpreter.conditions.leaf(name, range(-2, 4))
            self.places[table.leaf] = place
            return table
        leaf = self.interpreter.graph.value("state", name=name)
        self.places[leaf] = place
        return leaf

    def values(self, places: Sequence[Place], leaf: Leaf) -> list[Sized]:
        """What stands there where leaves have these values; other branches are not looked at."""
        found: dict[Value, Any] = {}

        def of(value: Value) -> Any:
            if value not in found:
                found[value] = calculated(value)
            return found[value]

        def calculated(value: Value) -> Any:
            match value.op:
                case "number":
                    return Sized.of(value.number)
                case "if":
                    return of(value.arguments[1 if of(value.arguments[0]) else 2])
                case "and":
                    return all(map(of, value.arguments))
                case "or":
                    return any(map(of, value.arguments))
            if value in self.places:
                return leaf(self.places[value])
            return OPERATIONS[value.op](*map(of, value.arguments))

        return [of(self.written[place]) for place in places]

    def motion(self, leaf: Leaf, order: int, scale: float = 1.0) -> dict[Place, Sized]:
        """Series of STATES by Picard's iteration; leaf: all else, and where they start."""
        start = {place: leaf(place) for place in STATES}
        found = start
        for last in range(1, order + 1):  # each round gets an order right
            with precision(last):
                rates = [found[place] for place in STATES[2:]]
                rates += self.values(ACCELERATIONS, along(found, leaf))
                found = {
                    place: (Sized.of(scale) * rate).integral() + start[place]
                    for place, rate in zip(STATES, rates, strict=True)
                }
        return found


def along(motion: Mapping[Place, Sized], leaf: Leaf) -> Leaf:
    """Leaves along a motion."""
    return lambda place: motion[place] if place in motion else leaf(place)
