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
from .c_code import Code, Leaves, formula, indented
from .rolled import SHORTEST, rolled

FACTORS = re.compile(r"row\[(\d+)\]\[i( - 1|)\] \* row\[(\d+)\]\[k - i\]")
FEWEST_IN_PAIRS = 4  # sums of a series that gains by adding up two at once
WIDE = 150  # values that move in a model whose series has elements side by side
VANISHING = 5  # factors of a product whose zero may have as many orders as the shortest series
FLAT = 4  # degree of divisors whose small values show in the states' own terms, not between points


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
        self.sums: dict[str, str] = {}  # by term i
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
        self.first = Code(self._own_leaves("0"), "v", self.still)
        targets = {place: value for value in needed for place in self._places(value, "0")}
        targets |= {self._row(value, "0"): value for value in self.columns if value in rates}
        self.first.assign(targets)
        self.start = Code(self._own_leaves("0"), "z", self.still)
        self.start.known |= {value: self._row(value, "0") for value in needed}
        self.later = Code(self._own_leaves("k"), "c", self.still)
        self.integrals = ["const double h = origin->time_scale / k;"] if rates else []
        self._coefficients = {value: "" for value in values if value.op in CONDITIONS}
        self._late: list[str] = []  # statements for the values of one form
        asked = [*rates, *needed]
        if self.is_wide:  # all that they follow from, too
            asked = sorted((v for v in in_order(asked) if v.moves), key=self.forms.__getitem__)
        for _, same in groupby(asked, lambda value: self.is_wide and self.forms[value]):
            for value in same:
                self._at(value)
            self.later.lines += self._late
            self._late.clear()
        for i, rate in enumerate(roots[: len(rates)]):
            if rate.moves:
                last = f"h * {self._row(rate, 'k - 1')}"
            else:
                last = f"k == 1 ? h * {self.still.of(rate)} : 0.0"
            self.integrals.append(f"row[{i}][k] = {last};")

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
            self.still.lines.insert(0, own)
        if any("over_k" in line for line in self.later.lines):
            self.integrals.insert(0, "const double over_k = 1.0 / k;")
        terms = [f"{name} += {term};" for term, name in self.sums.items()]
        parts = {
            "still": self.still.lines,
            "first": self.first.lines,
            "start": self.start.lines,
            "sums": [f"double {name} = 0.0;" for name in self.sums.values()],
            "terms": terms,
            "integrals": self.integrals,
            "later": self.later.lines,
        }
        is_short = not self.is_wide and sum(map(len, parts.values())) < SHORTEST
        if is_short and len(terms) >= FEWEST_IN_PAIRS:
            self._pair(parts)
        elif not is_short:
            for part in ("sums", "terms", "later"):
                parts[part] = [re.sub(r"\bs(\d+)\b", r"s[\1]", line) for line in parts[part]]
            own = [line.removeprefix("double ") for line in parts["sums"]]
            parts["sums"] = [f"double s[{len(self.sums) or 1}];", *own]
        found = dict(zip(parts, rolled(*parts.values()), strict=True))
        if terms:
            found["terms"] = ["for (int i = 1; i < k; i++) {", *indented(found["terms"]), "}"]
        if terms and not self.is_wide:  # two at once: half the additions wait for each other
            both = [re.sub(r"\+= (.*);$", _with_next, line) for line in found["terms"][1:-1]]
            last = ["if (k % 2 == 0) {", "    const int i = k - 1;", *found["terms"][1:]]
            found["terms"] = ["for (int i = 1; i + 1 < k; i += 2) {", *both, "}", *last]
        return found

    def _pair(self, parts: dict[str, list[str]]) -> None:
        """Add up two sums at once, with the same bits: their factors stand side by side."""
        columns: dict[tuple[str, str], int] = {}
        sums, terms, after, single = [], [], [], {name: term for term, name in self.sums.items()}
        found = ((name, FACTORS.fullmatch(term)) for name, term in single.items())
        left = {name: factors for name, factors in found if factors}

        def cost(pair: tuple[str, str]) -> tuple[int, bool]:
            """Count the columns that it adds; then prefer two sums with the same factor."""
            sides = [(left[pair[0]][i], left[pair[1]][i]) for i in (1, 3)]
            return sum(side not in columns for side in sides), all(a != b for a, b in sides)

        while both := [p for p in combinations(left, 2) if left[p[0]][2] == left[p[1]][2]]:
            best, pair = min(both, key=cost), f"p{len(sums)}"
            one, other = map(left.pop, best)
            a, b = (columns.setdefault((one[i], other[i]), len(columns)) for i in (1, 3))
            product = f"at[i{one[2]}][{a}].of LANE * at[k - i][{b}].of LANE"
            sums.append(f"struct pair {pair} = {{{{0.0, 0.0}}}};")
            terms.append(f"EACH {pair}.of LANE += {product};")
            after += [f"const double {name} = {pair}.of[{i}];" for i, name in enumerate(best)]
            single = {name: term for name, term in single.items() if name not in best}
        own = [
            f"at[k][{i}] = (struct pair){{{{row[{a}][k], row[{b}][k]}}}};"
            for (a, b), i in columns.items()
        ]
        if not columns:
            return
        parts["still"].append(f"struct pair at[SERIES_LENGTH][{len(columns)}];")
        parts["start"] += ["for (int k = 0; k == 0 || k < first; k++) {", *indented(own), "}"]
        parts["sums"] = sums + [f"double {name} = 0.0;" for name in single]
        parts["terms"] = terms + [f"{name} += {term};" for name, term in single.items()]
        parts["integrals"] = after + parts["integrals"]
        parts["later"] += own

    def _sort_sums(self) -> None:
        """Put sums of one form side by side."""
        forms = [self.forms[value] for value in self.columns]

        def place(term: str) -> tuple:
            of = [int(column) for column in re.findall(r"\[(\d+)\]", term)]
            return term.startswith("i *"), [forms[column] for column in of], of

        names = {self.sums[term]: f"s{i}" for i, term in enumerate(sorted(self.sums, key=place))}
        self.sums = {term: names[self.sums[term]] for term in sorted(self.sums, key=place)}
        self.later.lines = [
            re.sub(r"\bs\d+\b", lambda name: names[name[0]], line) for line in self.later.lines
        ]

    def _row(self, value: Value, k: str) -> str:
        """Where coefficient k is read."""
        if value in self.columns:
            return f"at[{k}][{self.columns[value]}]"
        return f"row[{self.rows[value]}][{k}]"

    def _places(self, value: Value, k: str) -> list[str]:
        """Where coefficient k is written."""
        public = f"row[{self.rows[value]}][{k}]" if value in self.rows else ""
        return list(dict.fromkeys(place for place in (self._row(value, k), public) if place))

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

    def _change(self, x: Value, g: Value) -> str:
        """The sum of i x_i g_(k-i) over i = 1 .. k - 1, over k; of a state by its rate."""
        f, moving = self._varying(x)
        rate = self.rates.get(moving)
        if rate is None or not rate.moves:
            return f"over_k * {self._sum(x, g, 'i * ')}"
        return f"h * {self._scaled_sum(self._row(rate, 'i - 1'), f, g)}"

    def _sum(self, x: Value, y: Value, weight: str = "") -> str:
        """The sum of x_i y_(k-i) over i = 1 .. k - 1, with a weight of each term."""
        (f, x), (g, y) = self._varying(x), self._varying(y)
        x, y = (x, y) if weight else sorted((x, y), key=self.order.__getitem__)
        return self._scaled_sum(f"{weight}{self._row(x, 'i')}", times(self.graph, f, g), y)

    def _scaled_sum(self, x: str, factor: Value, y: Value) -> str:
        g, y = self._varying(y)
        term = f"{x} * {self._row(y, 'k - i')}"
        name = self.sums.setdefault(term, f"s{len(self.sums)}")
        scale = self.still.of(times(self.graph, factor, g))
        return name if scale == "1.0" else f"{scale} * {name}"

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
            if value in self.columns:
                self.later.lines.append(f"{self._row(value, 'k')} = {leaf};")
            return leaf
        if value.op == "input":
            found = f"k < SERIES_INPUT_LENGTH ? {leaf} : 0.0"
        elif value.op == "time":
            found = "k == 1 ? origin->time_scale : 0.0"
        elif value.op in DERIVATIVES:
            found = self._of_function(value)
        else:
            found = self._of_operation(value)
        if value not in self.rows and value not in self.columns:
            is_plain = " " not in found and not found.startswith("-")
            return found if is_plain else self.later.constant(found)
        targets = self._places(value, "k")
        self.later.lines += [f"{target} = {found};" for target in targets]
        return targets[0]

    def _of_function(self, value: Value) -> str:
        pairs, found = self._pairs(value), ""
        for x, g, sign in pairs:
            relative = "+" if sign == pairs[0][2] else "-"
            if g.moves:
                found += f" {relative} {self._change(x, g)}"
            found += f" {relative} {self._at(x)} * {self.start.of(g)}"
        found = f"{pairs[0][2]}({found.removeprefix(' + ')})"
        if value.op not in (*STEEP, *GROWING):
            return found
        are_finite = reduce(
            partial(self.graph.value, "and"), (self.graph.value("isfinite", g) for _, g, _ in pairs)
        )
        is_known, otherwise = self.start.of(are_finite), self._where_steep(value)
        if value in self.columns and "(" in otherwise:  # then the loop has no calls
            steep = [f"    {place} = {otherwise};" for place in self._places(value, "k")]
            self._late.append("\n".join([f"if (!{is_known}) {{", *steep, "}"]))
            return found
        return f"{is_known} ? {found} : {otherwise}"

    def _where_steep(self, value: Value) -> str:
        """Return a coefficient, where a derivative is infinite, as if the function did not change.

        The method sees at the end of a step whether this fits. Some powers have a series.
        """
        x, exponent = value.arguments[0], value.arguments[-1]
        if value.op != "pow" or exponent.moves:
            return "0.0"
        factor, varying = self._varying(x)
        rows = [f"&{self._row(v, '0')}" for v in (varying, value)]
        stride = str(len(self.columns) or 1)
        given = (rows[0], self.still.of(factor), self.still.of(exponent), "k", rows[1], stride)
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
            case "*" if a is b:
                twice = self.start.of(self.graph.value("*", self.graph.number(2.0), a))
                return f"{self._sum(a, a)} + {twice} * {self._at(a)}"
            case "*" if a.moves and b.moves:  # last what is known last
                a, b = sorted((a, b), key=lambda x: self.forms[x][0])
                ends = f"{self._at(a)} * {self.start.of(b)} + {self.start.of(a)} * {self._at(b)}"
                return f"{self._sum(a, b)} + {ends}"
            case "/" if b.moves:
                end = f"{self._at(b)} * {self.start.of(value)}"
                rest, over = f"({self._at(a)} - {self._sum(b, value)} - {end})", self._over(b)
                product = f"{rest} * {self.start.of(over)}"
                if self.is_wide:  # too many conditions
                    return product
                is_known = self.start.of(self.graph.value("isfinite", over))
                return f"{is_known} ? {product} : {rest} / {self.start.of(b)}"
            case "/":
                return f"{self._at(a)} * {self.still.of(self._over(b))}"
        given = [self._at(x) if x.moves else self.still.of(x) for x in value.arguments]
        return formula(value.op, *given)


def _with_next(term: re.Match[str]) -> str:
    """The sum of a term and of the next one."""
    following = term[1].replace("i * ", "(i + 1) * ").replace("[i]", "[i + 1]")
    following = following.replace("[i - 1]", "[i]")
    return f"+= {term[1]} + {following.replace('k - i]', 'k - i - 1]')};"


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
