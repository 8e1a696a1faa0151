"""First and second derivatives of a graph's values along a curve.

They follow the rules of polynomials of degree 2: x, x' and x'' of a product, a quotient or a
function from x, x' and x'' of its arguments. To derive twice would give more operations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..expressions.expression import in_order
from . import algebraic
from .graph import NOTED, STILL, Graph, Value, is_number, is_runtime, is_steep
from .plain import plain

Rates = Callable[[Value], tuple[Value, Value] | None]  # of a leaf; None: it rests
LINEAR = ("+", "-", "negative", "moving_as", "element", "if", "component", "factors")


class Curve:
    """Derivatives of a graph's values, from the first and second ones of its leaves, `rates`.

    Second derivatives are those along a curve on which parameters and modes rest.
    """

    def __init__(self, graph: Graph, rates: Rates) -> None:
        self.graph, self.rates = graph, rates
        self.zero, self.two = graph.number(0.0), graph.number(2.0)
        self.firsts: dict[Value, Value] = {}
        self.seconds: dict[Value, Value] = {}
        self.resting: dict[Value, Value] = {}  # first derivatives while parameters rest

    def first(self, roots: Iterable[Value]) -> list[Value]:
        """Return the first derivatives."""
        roots = list(roots)
        for y in in_order(roots, self.firsts):
            if not y.arguments:
                rates = self.rates(y)
                self.firsts[y] = rates[0] if rates else self.zero
                self.seconds[y] = rates[1] if rates and y.moves else self.zero
            elif y.op in STILL or all(self.rests(a) for a in y.arguments):
                self.firsts[y] = self.seconds[y] = self.zero
            else:
                self.firsts[y] = self._first(y, [self.firsts[a] for a in y.arguments])
        return [self.firsts[root] for root in roots]

    def rests(self, y: Value) -> bool:
        """Return whether the derivatives of a value are 0."""
        return is_number(self.firsts[y], 0.0) and is_number(self.seconds.get(y, self.zero), 0.0)

    def second(self, roots: Iterable[Value]) -> list[Value]:
        """Return the second derivatives."""
        roots = list(roots)
        self.first(roots)
        for y in in_order(roots, self.seconds):
            self.seconds[y] = self._second(y) if y.moves else self.zero
        return [self.seconds[root] for root in roots]

    def _first_at_rest(self, roots: Iterable[Value]) -> list[Value]:
        """Return the first derivatives while parameters rest."""
        for y in in_order(roots, self.resting):
            if not y.moves or y.op in STILL:
                self.resting[y] = self.zero
            elif y in self.firsts:
                self.resting[y] = self.firsts[y]
            else:
                self.resting[y] = self._first(y, [self.resting[a] for a in y.arguments])
        return [self.resting[root] for root in roots]

    def _first(self, y: Value, d: list[Value]) -> Value:
        simple, graph = self.graph.simple, self.graph
        match y.op:
            case "sqrt":  # from x = y^2
                return graph.over(d[0], graph.value("*", self.two, y))
            case "atan2" if not graph.is_guarded:  # from (x^2 + z^2) y' = z x' - x z'
                x, z = y.arguments
                area_rate = simple("-", simple("*", z, d[0]), simple("*", x, d[1]))
                return simple("/", area_rate, self._square_sum(y))
        return graph.chain(y, d)

    def _square_sum(self, y: Value) -> Value:
        x, z = (self.graph.value("*", a, a) for a in y.arguments)
        return self.graph.value("+", z, x)

    def _twice(self, a: Value, b: Value) -> Value:
        """Return 2 a b of two derivatives, which is 0 if one of them is."""
        graph = self.graph
        may_be_infinite = (a.functions | b.functions) & NOTED and "number" not in (a.op, b.op)
        if graph.is_guarded and may_be_infinite:
            return graph.value("*", self.two, graph.value("slopes_both", a, b))
        return graph.simple("*", graph.simple("*", self.two, a), b)

    def _second(self, y: Value) -> Value:
        graph, simple = self.graph, self.graph.simple
        d, dd = self._first_at_rest(y.arguments), [self.seconds[a] for a in y.arguments]
        match y.op:
            case op if op in LINEAR:
                return graph.chain(y, dd)
            case op if op.startswith("slopes_"):  # of gradients
                return self.second(plain(graph, [y]))[0]
            case op if op in algebraic.VECTORS:
                return algebraic.second(graph, y, self._first_at_rest, d, dd)
            case "*":
                a, b = y.arguments
                first, last = graph.product(b, dd[0], d[1]), graph.product(a, dd[1], d[0])
                return simple("+", simple("+", first, self._twice(*d)), last)
            case "/":
                b = y.arguments[1]
                mixed = self._twice(self.firsts[y], d[1])
                last = graph.scaled(y, dd[1], is_runtime(dd[1]))
                return graph.over(simple("-", simple("-", dd[0], mixed), last), b)
            case "sqrt":
                mixed = self._twice(self.firsts[y], self.firsts[y])
                return graph.over(simple("-", dd[0], mixed), graph.value("*", self.two, y))
            case "atan2" if not graph.is_guarded:
                x, z = y.arguments
                half_rate = simple("+", simple("*", z, d[1]), simple("*", x, d[0]))
                area = simple("-", simple("*", z, dd[0]), simple("*", x, dd[1]))
                mixed = self._twice(self.firsts[y], half_rate)
                return simple("/", simple("-", area, mixed), self._square_sum(y))
            case "exp":
                (slope,) = graph.slopes(y)
                return simple("*", slope, simple("+", dd[0], simple("*", d[0], d[0])))
        slopes = graph.slopes(y)
        total = self.zero
        for slope, of_argument in zip(slopes, dd, strict=True):
            total = simple("+", total, graph.scaled(slope, of_argument, is_steep(y)))
        for of_slope, of_argument in zip(self._first_at_rest(slopes), d, strict=True):
            total = simple("+", total, graph.scaled(of_slope, of_argument, is_steep(y)))
        return total
