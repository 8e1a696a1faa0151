"""Sums of series: products of coefficients of lower orders, which loops add up for all of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

from ..graph.graph import Value
from .guards import Path, common
from .statements import Block, Item, Operand, Place, Statement, store

FEWEST_IN_PAIRS = 4  # sums that gain by adding up two at once
FEWEST_IN_BRANCH = 2  # likewise, in a loop of their own
EACH = "int i = 1; i < k; i++"
EACH_SECOND = "int i = 1; i + 1 < k; i += 2"
Within = Callable[[Path, list[Item]], list[Item]]  # statements in the blocks of a path


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

    def terms(self, terms: Iterable[Term]) -> list[Item]:
        """Return a loop that adds up each term."""
        body = [store(self.places[term], self._of(term), "+=") for term in terms]
        return [Block(EACH, (body,), "for")] * bool(body)

    def parts(self, is_array: bool, within: Within) -> Parts:
        """Return statements that add up two terms at once: half the additions wait for others."""
        parts = self.in_array() if is_array else Parts()
        groups: dict[Path, list[Term]] = defaultdict(list)
        for term in self.places:
            groups[self.paths[term]].append(term)
        for number, path in enumerate(sorted(groups, key=len)):
            single, loop = groups[path], Loop([], [])
            if not is_array and len(single) >= (FEWEST_IN_BRANCH if path else FEWEST_IN_PAIRS):
                pairs = Pairs(self, single, f"at_{number}" if number else "at", len(parts.sums))
                single, loop = pairs.single, pairs.loop
                parts.still += pairs.declared
                parts.start += within(path, pairs.begin) if pairs.begin else []
                parts.sums += pairs.sums
                parts.after += pairs.after
                parts.own += within(path, pairs.own) if pairs.own else []
            if not is_array:
                parts.sums += [Statement(("double ", self.places[t], " = 0.0;")) for t in single]
            for term in single:
                to, (one, two) = self.places[term], (self._of(term, further) for further in (0, 1))
                loop.terms.append(store(to, one, "+="))
                loop.both.append(store(to, ("+", one, two), "+="))
            last = Statement(("const int i = k - 1;",))
            items = [
                Block(EACH_SECOND, (loop.both,), "for"),
                Block("k % 2 == 0", ([last, *loop.terms],)),
            ]
            parts.terms += within(path, items)
        return parts

    def _of(self, term: Term, further: int = 0) -> Operand:
        """Term i of a sum, or the next one."""
        i, rest = ("i + 1", "k - i - 1") if further else ("i", "k - i")
        of_x = {"i": "i - 1", "i + 1": "i"}[i] if term.is_rate else i
        x = self.row(term.x, of_x)
        if term.is_weighted:
            x = "*", ("+", "i", "1") if further else "i", x
        return "*", x, self.row(term.y, rest)


class Loop(NamedTuple):
    """Statements that add one term to each sum, and those that add two."""

    terms: list[Item]
    both: list[Item]


class Pairs:
    """Two sums at once, with the same bits: their factors stand side by side in an array `at`."""

    def __init__(self, sums: Sums, terms: list[Term], at: str, count: int) -> None:
        columns: dict[tuple[Value, Value], int] = {}
        left = [term for term in terms if not term.is_weighted]
        self.sums: list[Item] = []
        self.after: list[Item] = []
        self.loop = Loop([], [])

        def cost(pair: tuple[Term, Term]) -> tuple[int, bool]:
            """Count the columns that it adds; then prefer two sums with the same factor."""
            sides = [(pair[0][i], pair[1][i]) for i in (0, 1)]
            return sum(side not in columns for side in sides), all(a is not b for a, b in sides)

        while pairs := [p for p in combinations(left, 2) if p[0].is_rate == p[1].is_rate]:
            one, other = best = min(pairs, key=cost)
            left = [term for term in left if term not in best]
            a, b = (columns.setdefault((one[i], other[i]), len(columns)) for i in (0, 1))
            name, before = f"p{count + len(self.sums)}", " - 1" * one.is_rate
            product = f"{at}[i{before}][{a}].of LANE * {at}[k - i][{b}].of LANE"
            next_x = f"{at}[i{'' if before else ' + 1'}][{a}].of LANE"
            after_it = f"{next_x} * {at}[k - i - 1][{b}].of LANE"
            self.sums.append(Statement((f"struct pair {name} = {{{{0.0, 0.0}}}};",)))
            self.loop.terms.append(Statement((f"EACH {name}.of LANE += {product};",)))
            self.loop.both.append(Statement((f"EACH {name}.of LANE += {product} + {after_it};",)))
            for i, term in enumerate(best):
                of = f" = {name}.of[{i}];"
                self.after.append(Statement(("const double ", sums.places[term], of)))
        self.single = [term for term in terms if term in left or term.is_weighted]
        self.own: list[Item] = []
        for (a, b), i in columns.items():
            of_a, of_b = (sums.row(value, "k") for value in (a, b))
            parts = (f"{at}[k][{i}] = (struct pair){{{{", of_a, ", ", of_b, "}};")
            self.own.append(Statement(parts))
        self.declared: list[Item] = []
        self.begin: list[Item] = []
        if columns:
            self.declared = [Statement((f"struct pair {at}[SERIES_LENGTH][{len(columns)}];",))]
            self.begin = [Block("int k = 0; k == 0 || k < first; k++", (self.own,), "for")]
