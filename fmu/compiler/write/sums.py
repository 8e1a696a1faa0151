"""Sums of series: products of coefficients of lower orders, which loops add up for all of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from itertools import combinations
from typing import NamedTuple

from ..graph.graph import Value
from .guards import Path, common
from .newest import Newest
from .statements import Block, Item, Operand, Place, Statement, store

FEWEST_IN_PAIRS = 2  # sums that gain by adding up two at once
FEWEST_ALIKE = 20  # sums of a form, a mean, that gain by adding up four terms at once
EACH = "int i = 1; i < k; i++"
EACH_FOURTH = "int i = 1; i + 3 < k; i += 4"
EACH_LEFT = "int i = (k - 1) / 4 * 4 + 1; i < k; i++"
EACH_SECOND = "int i = {}; i + 1 < k; i += 2"
Within = Callable[[Path, list[Item]], list[Item]]  # statements in the blocks of a path


# terms of a sum of which loops are made
WHERE = ("1", "2", "i", "i + 1", "k - 1")
FOUR = ("i", "i + 1", "i + 2", "i + 3")
BEFORE = {"1": "0", "2": "1", "i": "i - 1", "i + 1": "i", "i + 2": "i + 1", "i + 3": "i + 2"}
BEFORE |= {"k - 1": "k - 2"}


def plus(a: Operand, b: Operand) -> Operand:
    """Return the sum."""
    return "+", a, b


def rest(i: str) -> str:
    """Return k - i."""
    return "1" if i == "k - 1" else "k - " + i.replace("+", "-")


def weight(i: str) -> Operand:
    """Return i as a factor."""
    first, sign, second = i.partition(" + ") if "+" in i else i.partition(" - ")
    return (sign.strip(), first, second) if sign else i


class Term(NamedTuple):
    """x_i y_(k-i) of a sum over i, times i if it is weighted; of a rate x_(i-1)."""

    x: Value
    y: Value
    is_weighted: bool
    is_rate: bool


@dataclass
class Parts:
    """Statements of sums: at the begin, at the begin of an order, and at its end."""

    still: list[Item] = field(default_factory=list)
    start: list[Item] = field(default_factory=list)
    sums: list[Item] = field(default_factory=list)
    terms: list[Item] = field(default_factory=list)
    after: list[Item] = field(default_factory=list)
    own: list[Item] = field(default_factory=list)


class Sums:
    """Sums by their terms, each in the block of a path; `row`: where a coefficient is read."""

    def __init__(self, row: Callable[[Value, str], Place]) -> None:
        self.row = row
        self.places: dict[Term, Place] = {}
        self.paths: dict[Term, Path] = {}

    def add(self, term: Term, path: Path) -> Place:
        """Return the sum that is needed in the block of a path."""
        found = self.places.setdefault(term, Place("s", len(self.places)))
        self.paths[term] = common(self.paths.get(term, path), path)
        return found

    def sort(self, form: Mapping[Value, tuple], order: Mapping[Value, int]) -> None:
        """Put sums of one form side by side, in the order of their factors."""

        def key(term: Term) -> tuple[object, ...]:
            factors = term[:2]
            return term.is_weighted, [form[v] for v in factors], [order[v] for v in factors]

        self.places = {term: self.places[term] for term in sorted(self.places, key=key)}
        for i, to in enumerate(self.places.values()):
            to.index = i

    def in_array(self) -> Parts:
        """Return statements with an array of the sums."""
        for to in self.places.values():
            to.before, to.after = "s[", "]"
        own = [Statement((f"double s[{len(self.places)}];",))] * bool(self.places)
        return Parts(sums=[*own, *(store(to, 0.0) for to in self.places.values())])

    def terms(self, form: Mapping[Value, tuple]) -> list[Item]:
        """Return loops that add up the terms of each sum in their order.

        A sum is in memory. Where many of a form are side by side, a turn with four terms reads and
        writes it once; shorter vectors lose more by longer code.
        """
        four, one = [], []
        for term, to in self.places.items():
            four.append(store(to, reduce(plus, (self._of(term, i) for i in FOUR), to)))
            one.append(store(to, self._of(term, "i"), "+="))
        forms = {(term.is_weighted, *(form[v] for v in term[:2])) for term in self.places}
        if not one or len(one) < FEWEST_ALIKE * len(forms):
            return [Block(EACH, (one,), "for")] * bool(one)
        return [Block(EACH_FOURTH, (four,), "for"), Block(EACH_LEFT, (one,), "for")]

    def parts(self, is_array: bool, within: Within, newest: Newest | None) -> Parts:
        """Return statements that add up two terms at once: half the additions wait for others.

        newest: variables for coefficients k - 1, where sums outside of branches begin with them.
        """
        parts = self.in_array() if is_array else Parts()
        groups: dict[Path, list[Term]] = defaultdict(list)
        for term in self.places:
            groups[self.paths[term]].append(term)
        for number, path in enumerate(sorted(groups, key=len)):
            single, loop = groups[path], Loop()
            own_newest = None if path else newest
            if not is_array and len(single) >= FEWEST_IN_PAIRS:
                at = f"at_{number}" if number else "at"
                pairs = Pairs(self, single, at, len(parts.sums), own_newest)
                single, loop = pairs.single, pairs.loop
                parts.still += pairs.declared
                parts.start += within(path, pairs.begin) if pairs.begin else []
                parts.sums += pairs.sums
                parts.after += pairs.after
                parts.own += within(path, pairs.own) if pairs.own else []
            if not is_array:
                parts.sums += [Statement(("double ", self.places[t], " = 0.0;")) for t in single]
            for term in single:
                to = self.places[term]
                of = {where: self._of(term, where, own_newest) for where in WHERE}
                loop.first.append(store(to, ("+", of["1"], of["2"]), "+="))
                loop.both.append(store(to, ("+", of["i"], of["i + 1"]), "+="))
                loop.last.append(store(to, of["k - 1"], "+="))
            parts.terms += within(path, loop.blocks(own_newest is not None))
        return parts

    def _of(self, term: Term, i: str, newest: Newest | None = None) -> Operand:
        """Term i of a sum."""
        x, y = self.row(term.x, BEFORE[i] if term.is_rate else i), self.row(term.y, rest(i))
        if newest is not None and i == "1":
            y = newest.of(term.y)
        if newest is not None and i == "k - 1" and not term.is_rate:
            x = newest.of(term.x)
        if term.is_weighted:
            x = "*", weight(i), x
        return "*", x, y


@dataclass
class Loop:
    """Statements that add two terms to each sum: the first ones, and others; and the last one."""

    first: list[Item] = field(default_factory=list)
    both: list[Item] = field(default_factory=list)
    last: list[Item] = field(default_factory=list)

    def blocks(self, has_newest: bool) -> list[Item]:
        """Return the blocks; has_newest: the first terms stand in front of the loop."""
        first = [Block("k > 2", (self.first,))] if has_newest else []
        others = Block(EACH_SECOND.format(3 if has_newest else 1), (self.both,), "for")
        return [*first, others, Block("k % 2 == 0", (self.last,))]


class Pairs:
    """Two sums at once, with the same bits: their factors stand side by side in an array `at`."""

    def __init__(
        self, sums: Sums, terms: list[Term], at: str, count: int, newest: Newest | None
    ) -> None:
        columns: dict[tuple[Value, Value], int] = {}
        left = [term for term in terms if not term.is_weighted]
        self.sums: list[Item] = []
        self.after: list[Item] = []
        self.loop = Loop()

        def cost(pair: tuple[Term, Term]) -> tuple[int, bool]:
            """Count the columns that it adds; then prefer two sums with the same factor."""
            sides = [(pair[0][i], pair[1][i]) for i in (0, 1)]
            return sum(side not in columns for side in sides), all(a is not b for a, b in sides)

        while pairs := [p for p in combinations(left, 2) if p[0].is_rate == p[1].is_rate]:
            one, other = best = min(pairs, key=cost)
            left = [term for term in left if term not in best]
            a, b = (columns.setdefault((one[i], other[i]), len(columns)) for i in (0, 1))
            name = f"p{count + len(self.sums)}"

            def product(i: str, a: int = a, b: int = b, is_rate: bool = one.is_rate) -> str:
                """Term i of both."""
                x = f"{at}[{BEFORE[i] if is_rate else i}][{a}]"
                y = f"{at}[1][{b}]" if i == "k - 1" else f"to{at[2:]}[-{i.replace('+', '-')}][{b}]"
                if newest is not None and i == "1":
                    y = newest.of_pair(at, b)
                if newest is not None and i == "k - 1" and not is_rate:
                    x = newest.of_pair(at, a)
                return f"{x}.of LANE * {y}.of LANE"

            self.sums.append(Statement((f"struct pair {name} = {{{{0.0, 0.0}}}};",)))
            for to, terms_of in (
                (self.loop.first, ("1", "2")), (self.loop.both, ("i", "i + 1")),
                (self.loop.last, ("k - 1",)),
            ):  # fmt: skip
                both = " + ".join(product(i) for i in terms_of)
                to.append(Statement((f"EACH {name}.of LANE += {both};",)))
            for i, term in enumerate(best):
                of = f" = {name}.of[{i}];"
                self.after.append(Statement(("const double ", sums.places[term], of)))
        self.single = [term for term in terms if term in left or term.is_weighted]
        self.own: list[Item] = []
        self.begin: list[Item] = []
        for (a, b), i in columns.items():
            of_a, of_b = (sums.row(value, "k") for value in (a, b))
            parts = (f"{at}[k][{i}] = (struct pair){{{{", of_a, ", ", of_b, "}};")
            self.begin.append(Statement(parts))
            if newest is not None:
                newest.of(a), newest.of(b)
                parts = (newest.given_to(at, i), *parts)
            self.own.append(Statement(parts))
        self.declared: list[Item] = []
        if columns:
            width = len(columns)
            pointer = f"const struct pair(*const to{at[2:]})[{width}] = {at} + k;"
            self.sums.append(Statement((pointer,)))
            self.declared = [Statement((f"struct pair {at}[SERIES_LENGTH][{width}];",))]
            self.begin = [Block("int k = 0; k == 0 || k < first; k++", (self.begin,), "for")]
