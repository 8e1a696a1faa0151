"""First and second derivatives along a curve, by the rules of polynomials of degree 2.

The rules give x, x' and x'' of a product, a quotient and a function from x, x' and x'' of its
arguments. To derive twice would give more operations, and other rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from equations.graph import STILL, Graph, Value, is_number
from rparm.expressions.expression import in_order

Rates = Callable[[Value], tuple[Value, Value] | None]  # of a leaf; None: it rests


class Curve:
    """Derivatives of a graph's values, from the derivatives of its leaves, `rates`."""

    def __init__(self, graph: Graph, rates: Rates) -> None:
        self.graph, self.rates = graph, rates
        self.zero, self.two = graph.number(0.0), graph.number(2.0)
        self.firsts: dict[Value, Value] = {}
        self.seconds: dict[Value, Value] = {}

    def first(self, roots: Iterable[Value]) -> list[Value]:
        """First derivatives."""
        roots = list(roots)
        for y in in_order(roots, self.firsts):
            if not y.arguments:
                rates = self.rates(y)
                self.firsts[y] = rates[0] if rates else self.zero
                self.seconds[y] = rates[1] if rates else self.zero
            elif y.op in STILL or all(self.rests(a) for a in y.arguments):
                self.firsts[y] = self.seconds[y] = self.zero
            else:
                self.firsts[y] = self._first(y, [self.firsts[a] for a in y.arguments])
        return [self.firsts[root] for root in roots]

    def rests(self, y: Value) -> bool:
        """Whether the derivatives of a value are 0."""
        return is_number(self.firsts[y], 0.0) and is_number(self.seconds.get(y, self.zero), 0.0)

    def second(self, roots: Iterable[Value]) -> list[Value]:
        """Second derivatives."""
        roots = list(roots)
        self.first(roots)
        for y in in_order(roots, self.seconds):
            self.seconds[y] = self._second(y)
        return [self.seconds[root] for root in roots]

    def _first(self, y: Value, d: list[Value]) -> Value:
        simple = self.graph.simple
        match y.op:
            case "sqrt":  # from x = y^2
                return simple("/", d[0], self.graph.value("*", self.two, y))
            case "atan2":  # from (x^2 + z^2) y' = z x' - x z'
                x, z = y.arguments
                area_rate = simple("-", simple("*", z, d[0]), simple("*", x, d[1]))
                return simple("/", area_rate, self._square_sum(y))
        return self.graph.chain(y, d)

    def _square_sum(self, y: Value) -> Value:
        x, z = (self.graph.value("*", a, a) for a in y.arguments)
        return self.graph.value("+", z, x)

    def _second(self, y: Value) -> Value:
        simple = self.graph.simple
        d = [self.firsts[a] for a in y.arguments]
        dd = [self.seconds[a] for a in y.arguments]
        match y.op:
            case "*":
                a, b = y.arguments
                mixed = simple("*", simple("*", self.two, d[0]), d[1])
                return simple("+", simple("+", simple("*", dd[0], b), mixed), simple("*", a, dd[1]))
            case "/":
                b = y.arguments[1]
                mixed = simple("*", simple("*", self.two, self.firsts[y]), d[1])
                rest = simple("-", simple("-", dd[0], mixed), simple("*", y, dd[1]))
                return simple("/", rest, b)
            case "sqrt":
                mixed = simple("*", simple("*", self.two, self.firsts[y]), self.firsts[y])
                return simple("/", simple("-", dd[0], mixed), self.graph.value("*", self.two, y))
            case "atan2":
                x, z = y.arguments
                half_rate = simple("+", simple("*", z, d[1]), simple("*", x, d[0]))
                area = simple("-", simple("*", z, dd[0]), simple("*", x, dd[1]))
                mixed = simple("*", simple("*", self.two, self.firsts[y]), half_rate)
                return simple("/", simple("-", area, mixed), self._square_sum(y))
            case "exp":
                return simple("*", y, simple("+", dd[0], simple("*", d[0], d[0])))
            case "+" | "-" | "negative" | "moving_as" | "if":
                return self.graph.chain(y, dd)
        slopes = self.graph.slopes(y)
        total = self.zero
        for slope, of_argument in zip(slopes, dd, strict=True):
            total = simple("+", total, simple("*", slope, of_argument))
        for of_slope, of_argument in zip(self.first(slopes), d, strict=True):
            total = simple("+", total, simple("*", of_slope, of_argument))
        return total
