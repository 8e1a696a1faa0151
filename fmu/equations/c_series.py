"""The Taylor series of the states in C (src/model/series.h).

Each value that moves has its coefficients; products, quotients and functions have sums over those
of lower orders, which one loop adds up for all of them. A function y of x has
y' = g x' with g = dy/dx, so that k y_k is the sum over i = 1 .. k of i x_i g_(k-i).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from equations.c_code import References, calculated, number, operation
from equations.graph import LEAVES, LINEAR, Graph, Value, is_function, with_partials


@dataclass
class Series:
    """What the rows of a series hold, and the statements that write them."""

    graph: Graph
    states: list[str]
    inputs: list[str]
    derivatives: list[Value]
    followed: list[Value]  # further values that need a row
    leaf: Callable[[Value], str]  # the C expression of a parameter or mode
    values: list[Value] = field(default_factory=list)  # that move, arguments first
    scalars: References = field(default_factory=dict)
    rows: dict[Value, int] = field(default_factory=dict)
    head: list[str] = field(default_factory=list)  # statements for what does not move

    def __post_init__(self) -> None:
        for index, name in enumerate(self.states):
            self.rows[self.graph.value("state", name=name)] = index
        roots = [*self.derivatives, *self.followed]
        closure = with_partials(self.graph, roots, lambda value: value.moves)
        self.values = [value for value in closure if value.moves]
        needed = {argument for value in closure for argument in value.arguments}
        still = [value for value in [*needed, *closure] if not value.moves]
        self.head, self.scalars = calculated(dict.fromkeys(still), self.leaf)
        self._place_rows()

    def _place_rows(self) -> None:
        """Rows for leaves, for what is not linear and for all that sums and integrals read."""
        read = {value for value in (*self.derivatives, *self.followed) if value.moves}
        for value in self.values:
            if value.op in LINEAR or self._is_scaled(value):
                continue
            read.add(value)
            read |= {argument for argument in value.arguments if argument.moves}
            if is_function(value):
                read |= {partial for partial in self.graph.partials(value) if partial.moves}
        for value in self.values:
            if value in read and value not in self.rows:
                self.rows[value] = len(self.rows)

    def _is_scaled(self, value: Value) -> bool:
        """A product or quotient with a factor that does not move."""
        if value.op == "*":
            return not all(argument.moves for argument in value.arguments)
        return value.op == "/" and not value.arguments[1].moves

    # ---- Text ----------------------------------------------------------------------------------

    def statements(self) -> list[str]:
        """The body of extend."""
        sums, add, orders = self._orders()
        integrals = [
            f"row[{index}][k] = {self._integral(derivative)};"
            for index, derivative in enumerate(self.derivatives)
        ]
        loop = ["for (int i = 1; i < k; i++) {", *_indented(add), "}"] if add else []
        return [
            *self.head,
            "for (int k = first; k <= last; k++) {",
            "    if (k == 0) {",
            *_indented(self._values(), 2),
            "        continue;",
            "    }",
            *_indented([*integrals, *sums, *loop, *orders]),
            "}",
            "return STATUS_OK;",
        ]

    def _integral(self, derivative: Value) -> str:
        if derivative.moves:
            return f"origin->time_scale / k * row[{self.rows[derivative]}][k - 1]"
        return f"k == 1 ? origin->time_scale * {self.scalars[derivative]} : 0.0"

    def _values(self) -> list[str]:
        """Statements for the order 0."""
        lines, at = [], dict(self.scalars)
        for count, value in enumerate(self.values):
            if value.op == "state":
                at[value] = f"row[{self.rows[value]}][0]"
                continue
            text = self._leaf_coefficient(value, "0")
            formula = text if value.op in LEAVES else operation(value, at)
            if value in self.rows:
                at[value] = f"row[{self.rows[value]}][0]"
                lines.append(f"{at[value]} = {formula};")
            else:
                at[value] = f"v{count}"
                lines.append(f"const double v{count} = {formula};")
        return lines

    def _leaf_coefficient(self, value: Value, k: str) -> str:
        if value.op == "input":
            index = self.inputs.index(value.name)
            wide = f"{k} < SERIES_INPUT_LENGTH ? origin->inputs[{index}][{k}] : 0.0"
            return f"origin->inputs[{index}][0]" if k == "0" else wide
        if value.op == "time":
            return "origin->t" if k == "0" else f"{k} == 1 ? origin->time_scale : 0.0"
        return ""

    def _orders(self) -> tuple[list[str], list[str], list[str]]:
        """Statements for an order k > 0: sums, terms of their loop, coefficients."""
        sums, add, orders = [], [], []
        at: References = {}
        for count, value in enumerate(self.values):
            if value.op == "state":
                at[value] = f"row[{self.rows[value]}][k]"
                continue
            if value.op in LEAVES:
                formula = self._leaf_coefficient(value, "k")
            elif value.op in LINEAR or self._is_scaled(value):
                formula = self._linear(value, at)
            else:
                terms = self._terms(value)
                if terms:
                    sums.append(f"double s{count} = 0.0;")
                    add.append(f"s{count} += {' + '.join(terms)};")
                formula = self._nonlinear(value, at, f"s{count}" if terms else "0.0")
            if value in self.rows:
                at[value] = f"row[{self.rows[value]}][k]"
                orders.append(f"{at[value]} = {formula};")
            else:
                at[value] = f"c{count}"
                orders.append(f"const double c{count} = {formula};")
        return sums, add, orders

    def _linear(self, value: Value, at: References) -> str:
        """Coefficient k of a sum, a choice or a multiple."""
        if value.op in ("*", "/"):
            return operation(value, self.scalars | at)
        given = [at.get(argument, "0.0") for argument in value.arguments]
        if value.op == "negative":
            return f"-{given[0]}"
        if value.op == "if":
            return f"{self.scalars[value.arguments[0]]} ? {given[1]} : {given[2]}"
        a, b = value.arguments
        if not b.moves:
            return given[0]
        if not a.moves:
            return given[1] if value.op == "+" else f"-{given[1]}"
        return f"{given[0]} {value.op} {given[1]}"

    def _pairs(self, value: Value) -> list[tuple[Value, Value]]:
        """Arguments of a function that move, with its derivatives by them."""
        pairs = zip(value.arguments, self.graph.partials(value), strict=True)
        return [pair for pair in pairs if pair[0].moves]

    def _terms(self, value: Value) -> list[str]:
        """Term i of the sum over lower orders."""
        rows = self.rows
        if value.op in ("*", "/"):
            a, b = value.arguments
            other = value if value.op == "/" else a
            return [f"row[{rows[b]}][i] * row[{rows[other]}][k - i]"]
        return [
            f"i * row[{rows[x]}][i] * row[{rows[partial]}][k - i]"
            for x, partial in self._pairs(value)
            if partial.moves
        ]

    def _nonlinear(self, value: Value, at: References, total: str) -> str:
        """Coefficient k with the sum of the terms 1 to k - 1."""
        if value.op == "*":
            a, b = value.arguments
            first, last = (self._first(argument) for argument in (a, b))
            return f"{total} + ({first} * {at[b]} + {at[a]} * {last})"
        if value.op == "/":
            a, b = value.arguments
            divided = at.get(a, "0.0")
            own = f"row[{self.rows[value]}][0]"
            return f"({divided} - {total} - {at[b]} * {own}) / {self._first(b)}"
        ends = " + ".join(
            f"k * {at[x]} * {self._first(partial)}" for x, partial in self._pairs(value)
        )
        return f"({total} + {ends}) / k"

    def _first(self, value: Value) -> str:
        """Coefficient 0."""
        if value.moves:
            return f"row[{self.rows[value]}][0]"
        return number(value.number) if value.op == "number" else self.scalars[value]


def _indented(lines: list[str], levels: int = 1) -> list[str]:
    return ["    " * levels + line for line in lines]
