"""The Taylor series of the states in C (src/model/model.h).

Each value that moves has its coefficients; products, quotients and functions have sums over those
of lower orders, which one loop adds up for all of them. A function y of x has
y' = g x' with g = dy/dx, so that k y_k is the sum over i = 1 .. k of i x_i g_(k-i). What does not
move is taken out of the sums, so that more of them are the same.
"""

import re
from collections.abc import Iterable, Mapping
from functools import partial, reduce
from itertools import combinations, groupby
from typing import NamedTuple

from ..expressions.expression import in_order
from ..graph.graph import (
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
from .c_code import WITHOUT_DERIVATIVES, Code, Leaves, called
from .c_text import indented
from .loops import OF_MODELS, SHORTEST, printed
from .statements import Block, Item, Operand, Place, Statement, store

FEWEST_IN_PAIRS = 4  # sums of a series that gains by adding up two at once
WIDE = 150  # values that move in a model whose series has elements side by side
VANISHING = 5  # factors of a product whose zero may have as many orders as the shortest series
FLAT = 4  # degree of divisors whose small values show in the states' own terms, not between points


OF_SERIES = OF_MODELS | {"row", "origin", "last", "i", "k", "h", "at", "s", "over_k"}


class Term(NamedTuple):
    """x_i y_(k-i) of a sum over i, times i if it is weighted; of a rate x_(i-1)."""

    x: Value
    y: Value
    is_weighted: bool
    is_rate: bool


class Series:
    """Rows of a series: of states by their `rates` and of `followed`, and C that writes them."""

    def __init__(
        self, graph: Graph, rates: Mapping[Value, Value], followed: list[Value], leaves: Leaves
    ) -> None:
        self.graph, self.leaves = graph, leaves
        roots = [*rates.values(), *followed]
        self.is_wide = sum(value.moves for value in in_order(roots)) >= WIDE
        roots = scaled(graph, roots, self.is_wide)
        self.rates = dict(zip(rates, roots, strict=False))
        values = [value for value in with_partials(graph, roots) if value.moves]
        self.sums: dict[Term, Place] = {}
        factors = {factor for value in values for factor in self._read(value)}
        needed = [v for v in values if (v in factors or v in roots) and v not in rates]
        self.order = {value: i for i, value in enumerate([*rates, *needed])}  # in products
        self.rows = self.order
        self.columns: dict[Value, int] = {}
        self.forms = forms([*rates, *values])
        if self.is_wide:
            needed.sort(key=self.forms.__getitem__)
            public = [*rates, *(v for v in needed if v in roots[len(rates) :])]
            self.rows = {value: i for i, value in enumerate(public)}
            own = [v for v in (*rates, *needed) if v in factors or v not in self.rows]
            self.columns = {value: i for i, value in enumerate(own)}
        self.row_count = len(self.rows) + len(self.columns)
        self.row_of_followed = [self.rows.get(value, 0) for value in roots[len(rates) :]]
        self.still = Code(leaves)  # what does not move
        self.first = Code(self._own_leaves("0"), self.still)
        targets = {place: value for value in needed for place in self._places(value, "0")}
        targets |= {self._row(value, "0"): value for value in self.columns if value in rates}
        self.first.assign(targets)
        self.start = Code(self._own_leaves("0"), self.still)
        self.start.known |= {value: self._row(value, "0") for value in needed}
        self.later = Code(self._own_leaves("k"), self.still)
        self.has_over_k = False  # whether coefficients need 1 / k
        self._coefficients: dict[Value, Operand] = {v: 0.0 for v in values if v.op in CONDITIONS}
        self._late: list[Item] = []  # statements for the values of one form
        asked = [*rates, *needed]
        if self.is_wide:  # all that they follow from, too
            asked = sorted((v for v in in_order(asked) if v.moves), key=self.forms.__getitem__)
        for _, same in groupby(asked, lambda value: self.is_wide and self.forms[value]):
            for value in same:
                self._at(value)
            self.later.statements += self._late
            self._late.clear()
        self.integrals: list[Item] = []
        if self.has_over_k:
            self.integrals.append(Statement(("const double over_k = 1.0 / k;",)))
        if rates:
            self.integrals.append(Statement(("const double h = origin->time_scale / k;",)))
        for i, rate in enumerate(roots[: len(rates)]):
            if rate.moves:
                last = "*", "h", self._row(rate, "k - 1")
            else:
                last = "if", ("==", "k", "1"), ("*", "h", self.still.of(rate)), 0.0
            self.integrals.append(store(Place("row[", i, "][k]"), last))

    def inner(self) -> list[str]:
        """What may be nothing at the begin of a step and large within, and its argument."""
        values = (value for value in self.columns or self.rows)
        pairs = [(value, argument) for value in values for argument in self._arguments(value)]
        return [f"{{{self._place(value)}, {self._place(x)}}}" for value, x in pairs]

    @property
    def may_vanish(self) -> bool:
        """All terms of a state's series may be 0, though it does not rest."""
        return any(_zeros(rate) >= VANISHING for rate in self.rates.values())

    @property
    def is_of_time(self) -> bool:
        """A rate follows from the time itself."""
        return any(op == "time" for rate in self.rates.values() for op, _ in rate.leaves)

    def _arguments(self, value: Value) -> list[Value]:
        """Of a function other than sine and cosine, or a quotient by a divisor of high degree."""
        if value.op == "/" and _degree(value.arguments[1]) > FLAT:
            return [self._varying(value.arguments[1])[1]]
        if value.op not in DERIVATIVES or value.op in ("sin", "cos"):
            return []
        return [self._varying(x)[1] for x in value.arguments if x.moves]

    def _place(self, value: Value) -> str:
        """Where coefficient 0 stands behind the first row's."""
        if self.columns:
            return f"{len(self.rows)} * SERIES_LENGTH + {self.columns[value]}"
        return f"{self.rows[value]} * SERIES_LENGTH"

    def parts(self) -> dict[str, list[str]]:
        """What equations.c.in has blocks for."""
        if self.is_wide:
            self._sort_sums()
            width = len(self.columns)
            own = f"double(*const at)[{width}] = (double(*)[{width}])(void *)row[{len(self.rows)}];"
            self.still.statements.insert(0, Statement((own,)))
        parts = {
            "still": self.still.statements,
            "first": self.first.statements,
            "start": self.start.statements,
            "sums": [Statement(("double ", to, " = 0.0;")) for to in self.sums.values()],
            "terms": [store(to, self._of_term(term), "+=") for term, to in self.sums.items()],
            "integrals": self.integrals,
            "later": self.later.statements,
        }
        is_long = sum(map(len, parts.values())) >= SHORTEST
        parts["both"] = [  # two terms at once: half the additions wait for each other
            store(to, ("+", self._of_term(term), self._of_term(term, 1)), "+=")
            for term, to in self.sums.items()
        ]
        if is_long or self.is_wide:
            for to in self.sums.values():
                to.before, to.after = "s[", "]"
            own = [Statement((f"double s[{len(self.sums)}];",))] * bool(self.sums)
            parts["sums"] = [*own, *(store(to, 0.0) for to in self.sums.values())]
        elif len(self.sums) >= FEWEST_IN_PAIRS:
            self._pair(parts)
        taken = OF_SERIES.union(*({f"s{i}", f"p{i}"} for i in range(len(self.sums))))
        # a place's name would be a load in each turn, where an operation can read memory
        lines = printed(*parts.values(), taken=taken, is_long=is_long, has_named_places=False)
        found = dict(zip(parts, lines, strict=True))
        both, terms = found.pop("both"), found["terms"]
        if self.is_wide and terms:
            found["terms"] = ["for (int i = 1; i < k; i++) {", *indented(terms), "}"]
        elif terms:
            last = ["if (k % 2 == 0) {", *indented(["const int i = k - 1;", *terms]), "}"]
            each = ["for (int i = 1; i + 1 < k; i += 2) {", *indented(both), "}"]
            found["terms"] = [*each, *last]
        return found

    def _of_term(self, term: Term, further: int = 0) -> Operand:
        """Term i of a sum, or the next one."""
        i, rest = ("i + 1", "k - i - 1") if further else ("i", "k - i")
        of_x = {"i": "i - 1", "i + 1": "i"}[i] if term.is_rate else i
        x = self._row(term.x, of_x)
        if term.is_weighted:
            x = "*", ("+", "i", "1") if further else "i", x
        return "*", x, self._row(term.y, rest)

    def _pair(self, parts: dict[str, list[Item]]) -> None:
        """Add up two sums at once, with the same bits: their factors stand side by side."""
        columns: dict[tuple[Value, Value], int] = {}
        left = [term for term in self.sums if not term.is_weighted]
        sums, terms, both, after = [], [], [], []

        def cost(pair: tuple[Term, Term]) -> tuple[int, bool]:
            """Count the columns that it adds; then prefer two sums with the same factor."""
            sides = [(pair[0][i], pair[1][i]) for i in (0, 1)]
            return sum(side not in columns for side in sides), all(a is not b for a, b in sides)

        while pairs := [p for p in combinations(left, 2) if p[0].is_rate == p[1].is_rate]:
            one, other = best = min(pairs, key=cost)
            left = [term for term in left if term not in best]
            a, b = (columns.setdefault((one[i], other[i]), len(columns)) for i in (0, 1))
            name, before = f"p{len(sums)}", " - 1" * one.is_rate
            product = f"at[i{before}][{a}].of LANE * at[k - i][{b}].of LANE"
            after_it = f"at[i{'' if before else ' + 1'}][{a}].of LANE * at[k - i - 1][{b}].of LANE"
            sums.append(Statement((f"struct pair {name} = {{{{0.0, 0.0}}}};",)))
            terms.append(Statement((f"EACH {name}.of LANE += {product};",)))
            both.append(Statement((f"EACH {name}.of LANE += {product} + {after_it};",)))
            for i, term in enumerate(best):
                after.append(Statement(("const double ", self.sums[term], f" = {name}.of[{i}];")))
        if not columns:
            return
        single = [i for i, term in enumerate(self.sums) if term in left or term.is_weighted]
        for part, found in (("sums", sums), ("terms", terms), ("both", both)):
            parts[part] = [*found, *(parts[part][i] for i in single)]
        own = [
            Statement((f"at[k][{i}] = (struct pair){{{{{row_a}, {row_b}}}}};",))
            for (a, b), i in columns.items()
            for row_a, row_b in [[f"row[{self.rows[value]}][k]" for value in (a, b)]]
        ]
        parts["still"].append(Statement((f"struct pair at[SERIES_LENGTH][{len(columns)}];",)))
        each = [Statement(("    ", *item.parts)) for item in own]
        head = Statement(("for (int k = 0; k == 0 || k < first; k++) {",))
        parts["start"] = [*parts["start"], head, *each, Statement(("}",))]
        parts["integrals"] = [*after, *parts["integrals"]]
        parts["later"] = [*parts["later"], *own]

    def _sort_sums(self) -> None:
        """Put sums of one form side by side."""

        def place(term: Term) -> tuple:
            of = [term.x, term.y]
            return term.is_weighted, [self.forms[v] for v in of], [self.order[v] for v in of]

        self.sums = {term: self.sums[term] for term in sorted(self.sums, key=place)}
        for i, to in enumerate(self.sums.values()):
            to.index = i

    def _row(self, value: Value, k: str) -> Place:
        """Where coefficient k is read."""
        if value in self.columns:
            return Place(f"at[{k}][", self.columns[value], "]")
        return Place("row[", self.rows[value], f"][{k}]")

    def _places(self, value: Value, k: str) -> list[Place]:
        """Where coefficient k is written; it is read from the first place."""
        public = [Place("row[", self.rows[value], f"][{k}]")] if value in self.rows else []
        return [*([self._row(value, k)] if value in self.columns else []), *public]

    def _own_leaves(self, k: str) -> Leaves:
        """Coefficient k of all leaves."""
        own: dict[tuple[str, str], Operand] = {("time", ""): "origin->t"}
        for s, i in self.rows.items():
            if s.op == "state":
                own[s.op, s.name] = Place("row[", i, f"][{k}]")
        for i, key in enumerate(key for key in self.leaves if key[0] == "input"):
            own[key] = Place("origin->inputs[", i, f"][{k}]")
        return self.leaves.but(own)

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
        while value.op in ("negative", "+", "-", "*", "/"):
            a, b = value.arguments[0], value.arguments[-1]
            if value.op != "negative" and b.moves and (a.moves or value.op == "/"):
                break
            if value.op == "negative" or (value.op == "-" and b.moves):
                factor = graph.negative(factor)
            if value.op in ("*", "/"):
                still = self._over(b) if value.op == "/" else b if a.moves else a
                factor = graph.simple("*", factor, still)
            value = a if a.moves else b
        return factor, value

    def _over(self, value: Value) -> Value:
        """1 over it: a division for a step, not for each order, where others wait for it."""
        return self.graph.simple("/", self.graph.number(1.0), value)

    def _change(self, x: Value, g: Value) -> Operand:
        """The sum of i x_i g_(k-i) over i = 1 .. k - 1, over k; of a state by its rate."""
        f, moving = self._varying(x)
        rate = self.rates.get(moving)
        if rate is None or not rate.moves:
            self.has_over_k = True
            return multiplied("over_k", self._sum(x, g, is_weighted=True))
        return multiplied("h", self._scaled_sum(rate, f, g, is_rate=True))

    def _sum(self, x: Value, y: Value, is_weighted: bool = False) -> Operand:
        """The sum of x_i y_(k-i) over i = 1 .. k - 1."""
        (f, x), (g, y) = self._varying(x), self._varying(y)
        x, y = (x, y) if is_weighted else sorted((x, y), key=self.order.__getitem__)
        return self._scaled_sum(x, times(self.graph, f, g), y, is_weighted)

    def _scaled_sum(
        self, x: Value, factor: Value, y: Value, is_weighted: bool = False, is_rate: bool = False
    ) -> Operand:
        g, y = self._varying(y)
        term = Term(x, y, is_weighted, is_rate)
        found = self.sums.setdefault(term, Place("s", len(self.sums)))
        scale = self.still.of(times(self.graph, factor, g))
        return found if scale == 1.0 else ("*", scale, found)

    def _at(self, value: Value) -> Operand:
        """Coefficient k > 0."""
        for needed in in_order([value], self._coefficients):
            self._coefficients[needed] = self._coefficient(needed)
        return self._coefficients[value]

    def _coefficient(self, value: Value) -> Operand:
        """Return the operand of coefficient k > 0; writes it to its row."""
        if not value.moves:
            return 0.0
        leaf = self.later.leaves.get((value.op, value.name))
        if value.op == "state":
            if value in self.columns:
                self.later.statements.append(store(self._row(value, "k"), leaf))
            return leaf
        if value.op == "input":
            found = "if", ("<", "k", "SERIES_INPUT_LENGTH"), leaf, 0.0
        elif value.op == "time":
            found = "if", ("==", "k", "1"), "origin->time_scale", 0.0
        elif value.op in DERIVATIVES:
            found = self._of_function(value)
        else:
            found = self._of_operation(value)
        targets = self._places(value, "k")
        if not targets:
            return self.later.constant(found) if isinstance(found, tuple) else found
        self.later.statements += [store(target, found) for target in targets]
        return targets[0]

    def _of_function(self, value: Value) -> Operand:
        pairs, terms = self._pairs(value), []
        for x, g, sign in pairs:
            relative = "+" if sign == pairs[0][2] else "-"
            if g.moves:
                terms.append((relative, self._change(x, g)))
            terms.append((relative, ("*", self._at(x), self.start.of(g))))
        found = terms[0][1]
        for relative, term in terms[1:]:
            found = relative, found, term
        found = ("negative", found) if pairs[0][2] else found
        if value.op not in (*STEEP, *GROWING):
            return found
        are_finite = reduce(
            partial(self.graph.value, "and"), (self.graph.value("isfinite", g) for _, g, _ in pairs)
        )
        is_known, otherwise = self.start.of(are_finite), self._where_steep(value)
        if value in self.columns and otherwise != 0.0:  # then the loop has no calls
            steep = [store(place, otherwise) for place in self._places(value, "k")]
            self._late.append(Block(("not", is_known), (steep,)))
            return found
        return "if", is_known, found, otherwise

    def _where_steep(self, value: Value) -> Operand:
        """Return a coefficient, where a derivative is infinite, as if the function did not change.

        The method sees at the end of a step whether this fits. Some powers have a series.
        """
        x, exponent = value.arguments[0], value.arguments[-1]
        if value.op != "pow" or exponent.moves:
            return 0.0
        factor, varying = self._varying(x)
        rows = [self._row(v, "0") for v in (varying, value)]
        for row in rows:
            row.before = f"&{row.before}"
        given = (rows[0], self.still.of(factor), self.still.of(exponent), "k", rows[1])
        return "slopes_power", *given, str(len(self.columns) or 1)

    def _of_operation(self, value: Value) -> Operand:
        a, b = value.arguments[0], value.arguments[-1]
        match value.op:
            case "if":
                chosen = [self._at(x) for x in value.arguments[1:]]
                return chosen[1] if is_unknown(value) else ("if", self.still.of(a), *chosen)
            case op if op in WITHOUT_DERIVATIVES:
                return self._at(b)
            case "+" | "-" if not b.moves:
                return self._at(a)
            case "+" | "-" if not a.moves:
                return self._at(b) if value.op == "+" else ("negative", self._at(b))
            case "*" if a is b:
                twice = self.start.of(self.graph.value("*", self.graph.number(2.0), a))
                return "+", self._sum(a, a), ("*", twice, self._at(a))
            case "*" if a.moves and b.moves:  # last what is known last
                a, b = sorted((a, b), key=lambda x: self.forms[x][0])
                rest = "+", self._sum(a, b), ("*", self._at(a), self.start.of(b))
                return "+", rest, ("*", self.start.of(a), self._at(b))
            case "/" if b.moves:
                end = "*", self._at(b), self.start.of(value)
                rest = "-", ("-", self._at(a), self._sum(b, value)), end
                over = self._over(b)
                product = "*", rest, self.start.of(over)
                if self.is_wide:  # too many conditions
                    return product
                is_known = self.start.of(self.graph.value("isfinite", over))
                return "if", is_known, product, ("/", rest, self.start.of(b))
            case "/":
                return "*", self._at(a), self.still.of(self._over(b))
        given = [self._at(x) if x.moves else self.still.of(x) for x in value.arguments]
        return called(value.op, *given)


def multiplied(factor: Operand, term: Operand) -> Operand:
    """The product of a factor and a sum with its scale, from the left."""
    if isinstance(term, Place):
        return "*", factor, term
    _, scale, of = term
    return "*", ("*", factor, scale), of


def forms(values: Iterable[Value]) -> dict[Value, tuple[int, int]]:
    """How deep values are in the graph, and a number of their form, which elements share."""
    numbers: dict[tuple, int] = {}
    found: dict[Value, tuple[int, int]] = {}
    for value in in_order(values):
        given = [found[argument] for argument in value.arguments]
        form = (value.op, re.sub(r"\[.*|\d+$", "", value.name), *(number for _, number in given))
        moving = (x[0] for x, v in zip(given, value.arguments, strict=True) if v.moves)
        found[value] = 1 + max(moving, default=0), numbers.setdefault(form, len(numbers))
    return found


def times(graph: Graph, a: Value, b: Value) -> Value:
    """The product of a factor that does not move and a value, with their signs in front."""
    product = graph.simple("*", unsigned(a), unsigned(b))
    return product if (a.op == "negative") == (b.op == "negative") else graph.negative(product)


def scaled(graph: Graph, roots: list[Value], is_wide: bool) -> list[Value]:
    """The roots with factors that do not move in front of products: (a x) y as a (x y).

    is_wide: signs and factors of quotients are in front, too, and of two differences x - y and
    y - x there is one.
    """
    found: dict[Value, tuple[Value, Value]] = {}  # factor and what it is the factor of
    differences: dict[tuple[Value, Value], Value] = {}
    one = graph.number(1.0)
    product = partial(times, graph) if is_wide else partial(graph.simple, "*")
    for value in in_order(roots):
        given = [found[argument] for argument in value.arguments]
        moving = [pair for pair, x in zip(given, value.arguments, strict=True) if x.moves]
        if value.op == "*" and moving:
            factors = [
                f if x.moves else x for (f, _), x in zip(given, value.arguments, strict=True)
            ]
            bases = [base for _, base in moving]
            found[value] = product(*factors), reduce(partial(graph.value, "*"), bases)
        elif value.op == "negative" and moving:
            found[value] = graph.negative(given[0][0]), given[0][1]
        elif moving:
            op, sign = value.op, one
            if is_wide and op == "/" and value.arguments[0].moves:
                sign, given[0] = given[0][0], (one, given[0][1])
            whole = [product(*pair) for pair in given]
            last = whole[-1]
            if is_wide and op in ("+", "-") and last.op == "negative" and last.moves:
                op, whole[-1] = "-" if op == "+" else "+", last.arguments[0]
            if is_wide and op == "-" and all(x.moves for x in whole):
                if (*reversed(whole),) in differences:
                    sign, whole = graph.negative(one), [*reversed(whole)]
                differences[*whole] = last
            found[value] = sign, graph.value(op, *whole, name=value.name)
        else:
            found[value] = one, value
    return [product(*found[root]) for root in roots]


def _zeros(root: Value) -> int:
    """Return of how many orders its zero may be where its factors have simple ones."""
    orders: dict[Value, int] = {}
    for value in in_order([root]):
        below = [orders[argument] for argument in value.arguments]
        if value.op == "*":
            orders[value] = sum(below)
        elif value.op == "/":
            orders[value] = below[0]
        elif value.op == "pow":
            orders[value] = VANISHING * below[0]
        else:
            orders[value] = max(below, default=int(value.moves))
    return orders[root]


def _degree(root: Value) -> int:
    """Return how many moving factors its products have; a function's value counts as one."""
    degrees: dict[Value, int] = {}
    for value in in_order([root]):
        below = [degrees[argument] for argument in value.arguments]
        if value.op in ("*", "/"):
            degrees[value] = sum(below)
        elif value.op in ("+", "-", "negative", "if"):
            degrees[value] = max(below)
        else:
            degrees[value] = int(value.moves)
    return degrees[root]
