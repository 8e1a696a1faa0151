"""The Taylor series of the states in C (src/model/model.h).

Each value that moves has its coefficients; products, quotients and functions have sums over those
of lower orders, which one loop adds up for all of them. A function y of x has
y' = g x' with g = dy/dx, so that k y_k is the sum over i = 1 .. k of i x_i g_(k-i). What does not
move is taken out of the sums, so that more of them are the same.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial, reduce
from itertools import groupby

from ..expressions.expression import in_order
from ..graph import algebraic
from ..graph.coefficients import read_in_series, with_partials
from ..graph.graph import (
    CONDITIONS,
    DERIVATIVES,
    GROWING,
    STEEP,
    Graph,
    Value,
    unsigned,
)
from ..graph.stribeck import REACHED
from ..plain_c.values import Conditions
from .blocks import Blocks
from .branches import AtOrigin, OfOrder, Opened, plan_with_partials, within
from .c_code import WITHOUT_DERIVATIVES, Code, Leaves, called
from .guards import Path, Plan, cost, with_guards
from .loops import OF_MODELS, SHORTEST, printed
from .newest import Newest
from .scaled import scaled, times
from .statements import Block, Item, Operand, Place, Statement, store
from .sums import Sums, Term

WIDE = 150  # values that move in a model whose series has elements side by side
ALIKE = 2  # such values of a form; models with fewer gain more by blocks for their choices
VANISHING = 5  # factors of a product whose zero may have as many orders as the shortest series
COST_OF_SUM = 10  # of products in a coefficient
WORTH_BRANCHES = 200  # cost of coefficients in branches, below which all are calculated
FEWEST_PRODUCTS = 4  # with inputs, that are worth a branch
ORDERS = 4  # of inputs: SERIES_INPUT_LENGTH
USED = "inputs that values are multiplied by are used"
FLAT = 4  # degree of divisors whose small values show in the states' own terms, not between points


OWN = ("row", "origin", "last", "before", "i", "k", "h", "at", "to", "s", "over_k")
OF_SERIES = OF_MODELS.union(OWN)


class Series:
    """Rows of a series: of states by their `rates` and of `followed`, and C that writes them."""

    def __init__(
        self,
        graph: Graph,
        rates: Mapping[Value, Value],
        followed: list[Value],
        leaves: Leaves,
        is_limited: bool = False,
    ) -> None:
        self.graph, self.leaves = graph, leaves
        self.is_limited = is_limited  # elsewhere, to how far it holds
        roots = [*rates.values(), *followed]
        self.is_wide = is_wide(roots, leaves.conditions)
        roots = scaled(graph, roots, self.is_wide)
        roots, plan, used = self._in_branches(roots)
        if used:
            self.leaves = leaves.but({("mode", USED): "are_used"})
        self.rates = dict(zip(rates, roots, strict=False))
        values = [value for value in with_partials(graph, roots) if value.moves]
        self.sums = Sums(self._row)
        factors = {factor for value in values for factor in self._read(value)}
        needed = [
            v for v in values
            if (v in factors or v in roots or v.op == "component") and v not in rates
        ]  # fmt: skip
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
        self.still = Code(self.leaves)  # what does not move
        if used:
            self.still.statements.append(self._are_used(used))
        self.first = Code(self.leaves_at("0"), self.still)
        self.start = Code(self.leaves_at("0"), self.still)
        self.start.known |= {value: self._row(value, "0") for value in needed}
        self.later = Code(self.leaves_at("k"), self.still)
        self.has_over_k = False  # whether coefficients need 1 / k
        self._coefficients: dict[Value, Operand] = {}
        self._late: list[Item] = []  # statements for the values of one form
        self._is_trial = False  # results of systems are 0 for now
        self._path: Path = ()  # of the value whose coefficient is written
        self.opened = Opened(plan)
        if plan.choices:
            self._write_branches(plan, needed)
        else:
            self._write_all(needed)
        self.integrals = self._integrals(None)

    def _in_branches(self, roots: list[Value]) -> tuple[list[Value], Plan, list[Value]]:
        """Return roots, the plan of those that move, and inputs whose products are in a branch."""
        if not (self.is_wide or _has_systems(roots)):
            used = inputs_in_products(roots)
            guarded = where_used(self.graph, used, roots) if used else roots
            became = with_guards(guarded, self.leaves.conditions, self._cost)
            guarded = [became[root] for root in guarded]
            plan = plan_with_partials(self.graph, [r for r in guarded if r.moves], self._cost)
            if sum(self._cost(v) for v in plan.order if plan.paths.get(v)) >= WORTH_BRANCHES:
                return guarded, plan, used
        return roots, Plan(roots, [], {}, []), []

    def _are_used(self, used: list[Value]) -> Statement:
        """Say whether inputs that factors are multiplied by are 0 in all orders."""
        keys = [key for key in self.leaves if key[0] == "input"]
        numbers = [keys.index((u.op, u.name)) for u in used]
        orders = [f"origin->inputs[{i}][{k}] != 0.0" for i in numbers for k in range(ORDERS)]
        return Statement((f"const bool are_used = {' || '.join(orders)};",))

    def _write_all(self, needed: list[Value]) -> None:
        """Write all rows in the order of the values."""
        targets = {place: value for value in needed for place in self.places(value, "0")}
        targets |= {self._row(value, "0"): value for value in self.columns if value in self.rates}
        self.first.assign(targets)
        asked = [*self.rates, *needed]
        if self.is_wide:  # all that they follow from, too
            asked = in_order(asked, read=read_in_series)
            asked = sorted((v for v in asked if v.moves), key=self.forms.__getitem__)
        for _, same in groupby(asked, lambda value: self.is_wide and self.forms[value]):
            for value in same:
                self._at(value)
            self.later.statements += self._late
            self._late.clear()

    def _write_branches(self, plan: Plan, needed: list[Value]) -> None:
        """Write rows in the branches that need them."""
        self.first = AtOrigin(self, needed)
        # elsewhere functions are lines, which hide nothing: 0 could mean that they begin to grow
        hidden = dict.fromkeys(v for pair in self._inner() for v in pair if self.opened.path(v))
        line = {"0": 0.0, "k": ("if", ("==", "k", "1"), 1.0, 0.0)}
        lines = {k: [store(self._row(v, k), of) for v in hidden] for k, of in line.items()}
        self.first.statements = [*lines["0"], *Blocks(self.first, plan).written()[1]]
        moving = replace(plan, choices=[choice for choice in plan.choices if choice.moves])
        self.later.statements = [*lines["k"], *Blocks(OfOrder(self), moving).written()[1]]
        self.opened.write(self.still, self.condition, moves=False)
        self.opened.write(self.start, self.condition, moves=True)

    def _divisions(self) -> list[Item]:
        """Divide by k in front of the sums, which need not wait for it."""
        texts = ["const double over_k = 1.0 / k;"] * self.has_over_k
        texts += ["const double h = origin->time_scale / k;"] * bool(self.rates)
        return [Statement((text,)) for text in texts]

    def _integrals(self, newest: Newest | None) -> list[Item]:
        """Write coefficients of states; newest: variables for those before."""
        found: list[Item] = []
        for i, rate in enumerate(self.rates.values()):
            if rate.moves:
                is_new = rate in self.rates and self.rows[rate] < i  # has coefficient k already
                is_kept = newest is not None and not is_new
                last = "*", "h", newest.of(rate) if is_kept else self._row(rate, "k - 1")
            else:
                last = "if", ("==", "k", "1"), ("*", "h", self.still.of(rate)), 0.0
            found.append(store(Place("row[", i, "][k]"), last))
        return found

    def _cost(self, value: Value) -> int:
        """Estimate how long a coefficient takes."""
        return (COST_OF_SUM if self._read(value) else cost(value)) if value.moves else 0

    def coefficient_in(
        self, path: Path, value: Value, given: Iterable[tuple[Value, Operand]]
    ) -> Operand:
        """Return the coefficient of a value in a block, from those that it reads."""
        self._path = path
        self._coefficients.update(given)
        found = self._coefficient(value)
        self._path = ()
        return found

    def condition(self, value: Value, path: Path) -> Operand:
        """Return the operand of a condition, which stays as it is at the origin."""
        before, self._path = self._path, path
        found = self._known(value)
        self._path = before
        return found

    def _known(self, value: Value) -> Operand:
        """Return the operand of what is the same for all orders."""
        code = self.start if value.moves else self.still
        is_simple = not value.arguments or value in code.known
        is_cheap = not value.moves and value.op in CONDITIONS
        if is_simple or is_cheap or not self._path:
            return code.of(value)
        return self.opened.variable(value, self._path)

    def inner(self) -> list[str]:
        """What may be nothing at the begin of a step and large within, and its argument."""
        return [f"{{{self._place(value)}, {self._place(x)}}}" for value, x in self._inner()]

    def solutions(self) -> dict[int, float]:
        """Rows of unknowns that Newton's method finds, and their nominal values."""
        systems = self.graph.systems
        return {
            i: systems[value.arguments[0].name].nominal[int(value.name)]
            for value, i in self.rows.items()
            if value.op == "component" and value.arguments[0].op == "solution"
        }

    def _inner(self) -> list[tuple[Value, Value]]:
        if self.is_limited:
            return []
        values = (value for value in self.columns or self.rows)
        inner = (value for value in values if value.name != REACHED)
        return [(value, argument) for value in inner for argument in self._arguments(value)]

    @property
    def may_vanish(self) -> bool:
        """All terms of a state's series may be 0, though it does not rest."""
        return not self.is_limited and any(_zeros(r) >= VANISHING for r in self.rates.values())

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
            self.sums.sort(self.forms, self.order)
            width = len(self.columns)
            own = f"double(*const at)[{width}] = (double(*)[{width}])(void *)row[{len(self.rows)}];"
            self.still.statements.insert(0, Statement((own,)))
        parts = {
            "still": self.still.statements,
            "first": self.first.statements,
            "start": self.start.statements,
            "sums": [*self.sums.places],
            "terms": [*self.sums.places],
            "integrals": self.integrals,
            "later": self.later.statements,
        }
        is_long = not self.opened.conditions and sum(map(len, parts.values())) >= SHORTEST
        if self.is_wide:
            found = self.sums.in_array()
            found.terms = self.sums.terms(self.forms)
        else:
            newest = None if is_long else Newest(self._row)
            found = self.sums.parts(
                is_long, lambda path, items: within(path, items, self.condition), newest
            )
            if newest is not None:
                parts["integrals"] = newest.through(self._integrals(newest))
                parts["later"] = newest.through(parts["later"])
                found.own = newest.through(found.own)
                found.start += newest.begin()
        parts["sums"], parts["terms"] = [*self._divisions(), *found.sums], found.terms
        for name, before, behind in (
            ("still", [], found.still),
            ("start", [], found.start),
            ("integrals", found.after, []),
            ("later", [], found.own),
        ):
            parts[name] = [*before, *parts[name], *behind]
        count = 2 * len(self.sums.places) + len(self.rows)
        names = ("s", "p", "e", "n", "at_", "to_")
        taken = OF_SERIES.union(f"{name}{i}" for name in names for i in range(count))
        # a place's name would be a load in each turn, where an operation can read memory
        lines = printed(*parts.values(), taken=taken, is_long=is_long, has_named_places=False)
        return dict(zip(parts, lines, strict=True))

    def _row(self, value: Value, k: str) -> Place:
        """Where coefficient k is read."""
        if value in self.columns:
            return Place(f"at[{k}][", self.columns[value], "]")
        return Place("row[", self.rows[value], f"][{k}]")

    def places(self, value: Value, k: str) -> list[Place]:
        """Where coefficient k is written; it is read from the first place."""
        public = [Place("row[", self.rows[value], f"][{k}]")] if value in self.rows else []
        return [*([self._row(value, k)] if value in self.columns else []), *public]

    def leaves_at(self, k: str) -> Leaves:
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
        found = self.sums.add(term, self._path)
        scale = self._known(times(self.graph, factor, g))
        return found if scale == 1.0 else ("*", scale, found)

    def _at(self, value: Value) -> Operand:
        """Coefficient k > 0."""
        for needed in in_order([value], self._coefficients, read_in_series):
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
        elif value.op in algebraic.VECTORS:
            return self._of_system(value)
        elif value.op == "component":
            found = self._at(value.arguments[0])[int(value.name)]
        elif value.op == "factors":
            return 0.0
        else:
            found = self._of_operation(value)
        if self._is_trial:
            return without_zeros(found)
        targets = self.places(value, "k")
        if not targets:
            return self.later.constant(found) if isinstance(found, tuple) else found
        self.later.statements += [store(target, found) for target in targets]
        return targets[0]

    def _of_system(self, vector: Value) -> list[Operand]:
        """Return the coefficients of a system's results.

        They make up for the residuals that the equations have with 0 in their place.
        """
        equations, factors = algebraic.equations(self.graph, vector)
        results = algebraic.components(self.graph, vector, len(equations))
        before, self._is_trial = self._coefficients, True
        self._coefficients = {**before, **dict.fromkeys(results, 0.0)}
        right = [negated(self._at(equation)) for equation in equations]
        self._coefficients, self._is_trial = before, False
        if len(right) == 1:
            (slope,) = factors.arguments
            return [self.later.constant(("*", *right, self._known(self._over(slope))))]
        name = self.later.linear([self._known(factors), *right])
        return [Place(f"{name}[", i, "]") for i in range(len(right))]

    def _of_function(self, value: Value) -> Operand:
        pairs, terms = self._pairs(value), []
        for x, g, sign in pairs:
            relative = "+" if sign == pairs[0][2] else "-"
            if g.moves:
                terms.append((relative, self._change(x, g)))
            terms.append((relative, ("*", self._at(x), self._known(g))))
        found = terms[0][1]
        for relative, term in terms[1:]:
            found = relative, found, term
        found = ("negative", found) if pairs[0][2] else found
        if value.op not in (*STEEP, *GROWING):
            return found
        are_finite = reduce(
            partial(self.graph.value, "and"), (self.graph.value("isfinite", g) for _, g, _ in pairs)
        )
        is_known, otherwise = self._known(are_finite), self._where_steep(value)
        if value in self.columns and otherwise != 0.0:  # then the loop has no calls
            steep = [store(place, otherwise) for place in self.places(value, "k")]
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
        given = (rows[0], self._known(factor), self._known(exponent), "k", rows[1])
        return "slopes_power", *given, str(len(self.columns) or 1)

    def _of_operation(self, value: Value) -> Operand:
        a, b = value.arguments[0], value.arguments[-1]
        match value.op:
            case "if":
                chosen = [self._at(x) for x in read_in_series(value)]
                return ("if", self._known(a), *chosen) if len(chosen) == 2 else chosen[0]
            case op if op in WITHOUT_DERIVATIVES:
                return self._at(b)
            case "+" | "-" if not b.moves:
                return self._at(a)
            case "+" | "-" if not a.moves:
                return self._at(b) if value.op == "+" else ("negative", self._at(b))
            case "*" if a is b:
                twice = self._known(self.graph.value("*", self.graph.number(2.0), a))
                return "+", self._sum(a, a), ("*", twice, self._at(a))
            case "*" if a.moves and b.moves:  # last what is known last
                a, b = sorted((a, b), key=lambda x: self.forms[x][0])
                rest = "+", self._sum(a, b), ("*", self._at(a), self._known(b))
                return "+", rest, ("*", self._known(a), self._at(b))
            case "/" if b.moves:
                end = "*", self._at(b), self._known(value)
                rest = "-", ("-", self._at(a), self._sum(b, value)), end
                over = self._over(b)
                product = "*", rest, self._known(over)
                if self.is_wide:  # too many conditions
                    return product
                is_known = self._known(self.graph.value("isfinite", over))
                return "if", is_known, product, ("/", rest, self._known(b))
            case "/":
                return "*", self._at(a), self._known(self._over(b))
        given = [self._at(x) if x.moves else self._known(x) for x in value.arguments]
        return called(value.op, *given)


def is_wide(roots: list[Value], conditions: Conditions) -> bool:
    """Return whether so many values move that elements stand side by side."""
    moving = [value for value in in_order(roots) if value.moves]
    if len(moving) < WIDE or _has_systems(roots):
        return False
    found = forms(moving)
    if len(moving) >= ALIKE * len({found[value] for value in moving}):
        return True
    became = with_guards(roots, conditions)
    return not Plan.of([became[root] for root in roots]).choices


def without_zeros(term: Operand) -> Operand:
    """The operand without terms and factors that are 0."""
    if not isinstance(term, tuple) or term[0] not in ("+", "-", "*", "negative"):
        return term
    op, *given = [term[0], *map(without_zeros, term[1:])]
    a, b = given[0], given[-1]
    if 0.0 not in (a, b):
        return (op, *given)
    if op in ("*", "negative") or a == b:
        return 0.0
    return a if b == 0.0 else negated(b) if op == "-" else b


def negated(term: Operand) -> Operand:
    """The operand with the opposite sign."""
    if isinstance(term, tuple) and term[0] == "negative":
        return term[1]
    return 0.0 if term == 0.0 else ("negative", term)


def _has_systems(roots: Iterable[Value]) -> bool:
    return any(value.op in algebraic.VECTORS for value in in_order(roots))


def inputs_in_products(roots: Iterable[Value]) -> list[Value]:
    """Return inputs by which values that move are multiplied, if many products have them."""
    products = [
        [x for x in value.arguments if x.op == "input"]
        for value in in_order(roots)
        if value.op == "*" and all(x.moves for x in value.arguments)
    ]
    found = [x for inputs in products for x in inputs]
    return [*dict.fromkeys(found)] if len(found) >= FEWEST_PRODUCTS else []


def where_used(graph: Graph, used: Iterable[Value], roots: list[Value]) -> list[Value]:
    """Leave out products with inputs where these are 0 in all orders."""
    are_used, zero, found = graph.value("mode", name=USED), graph.number(0.0), {}
    for value in in_order(roots):
        given = [found[x] for x in value.arguments]
        new = graph.value(value.op, *given, name=value.name, number=value.number)
        if value.op == "*" and all(x.moves for x in given) and {*given} & {*used}:
            new = graph.value("if", are_used, new, zero)
        found[value] = new
    return [found[root] for root in roots]


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


def _zeros(root: Value) -> int:
    """Return of how many orders its zero may be where its factors have simple ones."""
    orders: dict[Value, int] = {}
    for value in in_order([root]):
        below = [orders[argument] for argument in value.arguments]
        if value.op in CONDITIONS or value.name == REACHED:
            orders[value] = 0
        elif value.op in ("*", "/"):
            orders[value] = sum(below[: 1 + (value.op == "*")])
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
