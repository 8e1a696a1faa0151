"""The Taylor series of the states in C (src/model/model.h).

Each value that moves has its coefficients; products, quotients and functions have sums over those
of lower orders, which one loop adds up for all of them. A function y of x has
y' = g x' with g = dy/dx, so that k y_k is the sum over i = 1 .. k of i x_i g_(k-i). What does not
move is taken out of the sums, so that more of them are the same.
"""

import re
from collections.abc import Mapping
from functools import partial, reduce

from equations.c_code import Code, Leaves, formula, indented
from equations.graph import (
    CONDITIONS,
    DERIVATIVES,
    GROWING,
    STEEP,
    Graph,
    Value,
    is_unknown,
    unsigned,
    with_partials,
)
from equations.rolled import SHORTEST, rolled
from rparm.expressions.expression import in_order


class Series:
    """Rows of a series: of states by their `rates` and of `followed`, and C that writes them."""

    def __init__(
        self, graph: Graph, rates: Mapping[Value, Value], followed: list[Value], leaves: Leaves
    ) -> None:
        self.graph, self.leaves = graph, leaves
        roots = scaled(graph, [*rates.values(), *followed])
        values = [value for value in with_partials(graph, roots) if value.moves]
        self.sums: dict[str, str] = {}  # by term i
        read = {*roots, *(factor for value in values for factor in self._read(value))}
        needed = [value for value in values if value in read and value not in rates]
        self.rows = {value: i for i, value in enumerate([*rates, *needed])}
        self.row_of_followed = [self.rows.get(value, 0) for value in roots[len(rates) :]]
        self.still = Code(leaves)  # what does not move
        self.first = Code(self._own_leaves("0"), "v", self.still)
        self.first.assign({f"row[{self.rows[value]}][0]": value for value in needed})
        self.start = Code(self._own_leaves("0"), "z", self.still)
        self.start.known |= {value: f"row[{self.rows[value]}][0]" for value in needed}
        self.later = Code(self._own_leaves("k"), "c", self.still)
        self.integrals = ["const double h = origin->time_scale / k;"] if rates else []
        self._coefficients = {value: "" for value in values if value.op in CONDITIONS}
        for value in self.rows:
            self._at(value)
        for i, rate in enumerate(roots[: len(rates)]):
            if rate.moves:
                last = f"h * row[{self.rows[rate]}][k - 1]"
            else:
                last = f"k == 1 ? h * {self.still.of(rate)} : 0.0"
            self.integrals.append(f"row[{i}][k] = {last};")

    def parts(self) -> dict[str, list[str]]:
        """What equations.c.in has blocks for."""
        terms = [f"{name} += {term};" for term, name in self.sums.items()]
        parts = {
            "still": self.still.lines,
            "first": self.first.lines,
            "start": self.start.lines,
            "integrals": self.integrals,
            "sums": [f"double {name} = 0.0;" for name in self.sums.values()],
            "terms": terms,
            "later": self.later.lines,
        }
        if sum(map(len, parts.values())) >= SHORTEST:
            for part in ("sums", "terms", "later"):
                parts[part] = [re.sub(r"\bs(\d+)\b", r"s[\1]", line) for line in parts[part]]
            parts["sums"] = [line.removeprefix("double ") for line in parts["sums"]]
            parts["integrals"] = [f"double s[{len(self.sums) or 1}];", *parts["integrals"]]
        found = dict(zip(parts, rolled(*parts.values()), strict=True))
        if terms:
            found["terms"] = ["for (int i = 1; i < k; i++) {", *indented(found["terms"]), "}"]
        return found

    def _own_leaves(self, k: str) -> Leaves:
        """Coefficient k of all leaves."""
        inputs = [key for key in self.leaves if key[0] == "input"]
        own = {(s.op, s.name): f"row[{i}][{k}]" for s, i in self.rows.items() if s.op == "state"}
        own |= {key: f"origin->inputs[{i}][{k}]" for i, key in enumerate(inputs)}
        return {**self.leaves, **own, ("time", ""): "origin->t"}

    def _pairs(self, value: Value) -> list[tuple[Value, Value, str]]:
        """Arguments of a function that move, its derivatives by them, and the signs of these."""
        found = []
        for x, g in zip(value.arguments, self.graph.partials(value), strict=True):
            if x.moves:
                found.append((x, unsigned(g), "-" * (g.op == "negative")))
        return found

    def _read(self, value: Value) -> list[Value]:
        """Of what its sum is made."""
        a, b = (*value.arguments, value, value)[:2]
        read = []
        if value.op in DERIVATIVES:
            read = [v for x, g, _ in self._pairs(value) for v in (x, g)]
            read += [value] * (value.op == "pow")
        elif value.op == "*" and a.moves and b.moves:
            read = [a, b]
        elif value.op == "/" and b.moves:
            read = [b, value]
        return [self._varying(v)[1] for v in read if v.moves]

    def _varying(self, value: Value) -> tuple[Value, Value]:
        """A factor that does not move, and what it is the factor of in all orders above 0."""
        graph, factor = self.graph, self.graph.number(1.0)
        while value.op in ("negative", "+", "-", "*"):
            a, b = value.arguments[0], value.arguments[-1]
            if value.op != "negative" and a.moves and b.moves:
                break
            if value.op == "negative" or (value.op == "-" and b.moves):
                factor = graph.negative(factor)
            if value.op == "*":
                factor = graph.simple("*", factor, b if a.moves else a)
            value = a if a.moves else b
        return factor, value

    def _sum(self, x: Value, y: Value, weight: str = "") -> str:
        """The sum of x_i y_(k-i) over i = 1 .. k - 1, with a weight of each term."""
        (f, x), (g, y) = self._varying(x), self._varying(y)
        rows = (self.rows[x], self.rows[y]) if weight else sorted((self.rows[x], self.rows[y]))
        term = f"{weight}row[{rows[0]}][i] * row[{rows[1]}][k - i]"
        name = self.sums.setdefault(term, f"s{len(self.sums)}")
        factor = self.still.of(self.graph.simple("*", f, g))
        return name if factor == "1.0" else f"{factor} * {name}"

    def _at(self, value: Value) -> str:
        """Coefficient k > 0."""
        for needed in in_order([value], self._coefficients):
            self._coefficients[needed] = self._coefficient(needed)
        return self._coefficients[value]

    def _coefficient(self, value: Value) -> str:
        """Return the C expression of coefficient k > 0, without operators; writes it to its row."""
        if not value.moves:
            return "0.0"
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
            is_plain = " " not in found and not found.startswith("-")
            return found if is_plain else self.later.constant(found)
        target = f"row[{self.rows[value]}][k]"
        self.later.lines.append(f"{target} = {found};")
        return target

    def _of_function(self, value: Value) -> str:
        pairs, found = self._pairs(value), ""
        for x, g, sign in pairs:
            relative = "+" if sign == pairs[0][2] else "-"
            if g.moves:
                found += f" {relative} {self._sum(x, g, 'i * ')}"
            found += f" {relative} k * {self._at(x)} * {self.start.of(g)}"
        found = f"{pairs[0][2]}({found.removeprefix(' + ')}) / k"
        if value.op not in (*STEEP, *GROWING):
            return found
        are_finite = reduce(
            partial(self.graph.value, "and"), (self.graph.value("isfinite", g) for _, g, _ in pairs)
        )
        return f"{self.start.of(are_finite)} ? {found} : {self._where_steep(value)}"

    def _where_steep(self, value: Value) -> str:
        """Return a coefficient, where a derivative is infinite, as if the function did not change.

        The method sees at the end of a step whether this fits. Some powers have a series.
        """
        x, exponent = value.arguments[0], value.arguments[-1]
        if value.op != "pow" or exponent.moves:
            return "0.0"
        factor, varying = self._varying(x)
        rows = [f"row[{self.rows[v]}]" for v in (varying, value)]
        given = (rows[0], self.still.of(factor), self.still.of(exponent), "k", rows[1])
        return formula("slopes_power", *given)

    def _of_operation(self, value: Value) -> str:
        a, b = value.arguments[0], value.arguments[-1]
        match value.op:
            case "if":
                chosen = [self._at(x) for x in value.arguments[1:]]
                return chosen[1] if is_unknown(value) else formula("if", self.still.of(a), *chosen)
            case "+" | "-" if not b.moves:
                return self._at(a)
            case "+" | "-" if not a.moves:
                return self._at(b) if value.op == "+" else f"-{self._at(b)}"
            case "*" if a.moves and b.moves:
                ends = f"{self.start.of(a)} * {self._at(b)} + {self._at(a)} * {self.start.of(b)}"
                return f"{self._sum(a, b)} + ({ends})"
            case "/" if b.moves:
                end = f"{self._at(b)} * {self.start.of(value)}"
                return f"({self._at(a)} - {self._sum(b, value)} - {end}) / {self.start.of(b)}"
        given = [self._at(x) if x.moves else self.still.of(x) for x in value.arguments]
        return formula(value.op, *given)


def scaled(graph: Graph, roots: list[Value]) -> list[Value]:
    """The roots with factors that do not move in front of products: (a x) y as a (x y)."""
    found: dict[Value, tuple[Value, Value]] = {}  # factor and what it is the factor of
    one = graph.number(1.0)
    for value in in_order(roots):
        given = [found[argument] for argument in value.arguments]
        moving = [pair for pair, x in zip(given, value.arguments, strict=True) if x.moves]
        if value.op == "*" and moving:
            factors = [
                f if x.moves else x for (f, _), x in zip(given, value.arguments, strict=True)
            ]
            bases = [base for _, base in moving]
            found[value] = graph.simple("*", *factors), reduce(partial(graph.value, "*"), bases)
        elif value.op == "negative" and moving:
            found[value] = graph.negative(given[0][0]), given[0][1]
        elif moving:
            whole = [graph.simple("*", *pair) for pair in given]
            found[value] = one, graph.value(value.op, *whole, name=value.name)
        else:
            found[value] = one, value
    return [graph.simple("*", *found[root]) for root in roots]
