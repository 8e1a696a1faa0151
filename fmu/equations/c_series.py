"""The Taylor series of the states in C (src/model/series.h).

Each value that moves has its coefficients; products, quotients and functions have sums over those
of lower orders, which one loop adds up for all of them. A function y of x has
y' = g x' with g = dy/dx, so that k y_k is the sum over i = 1 .. k of i x_i g_(k-i).
"""

from __future__ import annotations

from collections.abc import Mapping

from equations.c_code import Code, Leaves, formula
from equations.graph import DERIVATIVES, Graph, Value, unsigned, with_partials


class Series:
    """The rows of a series, and the parts of the C function that writes them.

    rates: the derivative of each state; followed: further values that need a row.
    """

    def __init__(
        self, graph: Graph, rates: Mapping[Value, Value], followed: list[Value], leaves: Leaves
    ) -> None:
        self.graph, self.leaves = graph, leaves
        roots = [*rates.values(), *followed]
        self.values = [value for value in with_partials(graph, roots) if value.moves]
        read = {*roots, *(factor for value in self.values for factor in self._read(value))}
        needed = [value for value in self.values if value in read and value not in rates]
        self.rows = {value: i for i, value in enumerate([*rates, *needed])}
        self.still = Code(leaves)  # what does not move
        self.first = Code(self._own_leaves("0"), "v", self.still)
        self.first.assign({f"row[{self.rows[value]}][0]": value for value in needed})
        self.later = Code(self._own_leaves("k"), "c", self.still)
        self.sums: list[str] = []  # term i of each
        self.integrals = ["const double h = origin->time_scale / k;"] if rates else []
        self._coefficients: dict[Value, str] = {}
        for value in self.values:
            self._coefficients[value] = self._coefficient(value)
        for i, rate in enumerate(rates.values()):
            if rate.moves:
                last = f"h * row[{self.rows[rate]}][k - 1]"
            else:
                last = f"k == 1 ? h * {self.still.of(rate)} : 0.0"
            self.integrals.append(f"row[{i}][k] = {last};")

    def parts(self) -> dict[str, list[str]]:
        """What equations.c.in has blocks for."""
        terms = [f"s{i} += {term};" for i, term in enumerate(self.sums)]
        return {
            "still": self.still.lines,
            "first": self.first.lines,
            "integrals": self.integrals,
            "sums": [f"double s{i} = 0.0;" for i in range(len(terms))],
            "terms": [
                "for (int i = 1; i < k; i++) {", *(f"    {term}" for term in terms), "}"
            ] if terms else [],
            "later": self.later.lines,
        }  # fmt: skip

    def _own_leaves(self, k: str) -> Leaves:
        """Coefficient k of all leaves."""
        inputs = [key for key in self.leaves if key[0] == "input"]
        own = {(s.op, s.name): f"row[{i}][{k}]" for s, i in self.rows.items() if s.op == "state"}
        own |= {key: f"origin->inputs[{i}][{k}]" for i, key in enumerate(inputs)}
        return {**self.leaves, **own, ("time", ""): "origin->t"}

    def _pairs(self, value: Value) -> list[tuple[Value, Value, str]]:
        """Arguments of a function that move, its derivatives by them, and the signs of these."""
        found = []
        for x, partial in zip(value.arguments, self.graph.partials(value), strict=True):
            if x.moves:
                found.append((x, unsigned(partial), "-" * (partial.op == "negative")))
        return found

    def _read(self, value: Value) -> list[Value]:
        """Of what its sum is made."""
        a, b = (*value.arguments, value, value)[:2]
        if value.op in DERIVATIVES:
            return [v for x, partial, _ in self._pairs(value) for v in (x, partial)]
        if value.op == "*" and a.moves and b.moves:
            return [a, b]
        return [b, value] if value.op == "/" and b.moves else []

    def _sum(self, term: str) -> str:
        """Name of the sum over i = 1 .. k - 1."""
        self.sums.append(term)
        return f"s{len(self.sums) - 1}"

    def _at(self, value: Value) -> str:
        """Coefficient k, in a sum or choice."""
        return self._coefficients[value] if value.moves else "0.0"

    def _start(self, value: Value) -> str:
        """Coefficient 0 of what has a row or does not move."""
        return f"row[{self.rows[value]}][0]" if value.moves else self.still.of(value)

    def _coefficient(self, value: Value) -> str:
        """C expression of coefficient k > 0; writes it to its row."""
        leaf = self.later.leaves.get((value.op, value.name), "")
        if value.op == "state":
            return leaf
        if value.op == "input":
            found = f"k < SERIES_INPUT_LENGTH ? {leaf} : 0.0"
        elif value.op == "time":
            found = "k == 1 ? origin->time_scale : 0.0"
        elif value.op in DERIVATIVES:
            found = self._of_function(value)
        else:
            found = self._of_operation(value)
        if value not in self.rows:
            return self.later.constant(found)
        target = f"row[{self.rows[value]}][k]"
        self.later.lines.append(f"{target} = {found};")
        return target

    def _of_function(self, value: Value) -> str:
        pairs, terms, ends = self._pairs(value), "", ""
        for x, g, sign in pairs:
            relative = "+" if sign == pairs[0][2] else "-"
            if g.moves:
                terms += f" {relative} i * row[{self.rows[x]}][i] * row[{self.rows[g]}][k - i]"
            ends += f" {relative} k * {self._at(x)} * {self._start(g)}"
        total = self._sum(terms.removeprefix(" + ")) if terms else ""
        return f"{pairs[0][2]}({(total + ends).removeprefix(' + ')}) / k"

    def _of_operation(self, value: Value) -> str:
        a, b = value.arguments[0], value.arguments[-1]
        rows = self.rows
        match value.op:
            case "if":
                chosen = map(self._at, value.arguments[1:])
                return formula("if", self.still.of(a), *chosen)
            case "+" | "-" if not b.moves:
                return self._at(a)
            case "+" | "-" if not a.moves:
                return f"{value.op} {self._at(b)}".removeprefix("+ ")
            case "*" if a.moves and b.moves:
                total = self._sum(f"row[{rows[b]}][i] * row[{rows[a]}][k - i]")
                ends = f"{self._start(a)} * {self._at(b)} + {self._at(a)} * {self._start(b)}"
                return f"{total} + ({ends})"
            case "/" if b.moves:
                total = self._sum(f"row[{rows[b]}][i] * row[{rows[value]}][k - i]")
                rest = f"{self._at(a)} - {total} - {self._at(b)} * {self._start(value)}"
                return f"({rest}) / {self._start(b)}"
        given = [self._at(x) if x.moves else self.still.of(x) for x in value.arguments]
        return formula(value.op, *given)
