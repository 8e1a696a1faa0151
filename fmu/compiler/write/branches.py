"""Branches in series: rows that only one branch needs are calculated there, in all orders.

Conditions stay as they are at the origin.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from functools import reduce
from typing import TYPE_CHECKING

from ..expressions.expression import in_order
from ..graph.coefficients import read_in_series
from ..graph.graph import CONDITIONS, DERIVATIVES, Graph, Value, unsigned
from .blocks import Writer
from .c_code import Code
from .guards import CostOf, Path, Plan, choices_in_blocks, common, paths
from .statements import Block, Constant, Item, Operand, store

if TYPE_CHECKING:
    from .c_series import Series


def partials_of(graph: Graph, value: Value) -> list[Value]:
    """Return the derivatives of a function, whose rows its own series reads."""
    if not value.moves or value.op not in DERIVATIVES:
        return []
    slopes = zip(value.arguments, graph.partials(value), strict=True)
    return [unsigned(slope) for x, slope in slopes if x.moves]


def plan_with_partials(graph: Graph, roots: Iterable[Value], cost_of: CostOf) -> Plan:
    """Return the plan for values and for the derivatives that their series read."""
    roots, order = list(roots), []
    while new := in_order([*roots, *(g for y in order for g in partials_of(graph, y))], {*order}):
        order += new
    beside: dict[Value, Path] = {}  # functions with a derivative
    while True:
        found = paths(in_order([*order]), {**beside, **dict.fromkeys(roots, ())})
        before, beside = beside, {}
        for value in order:
            for slope in partials_of(graph, value) if value in found else ():
                beside[slope] = common(beside.get(slope, found[value]), found[value])
        if beside == before:
            return Plan(roots, order, found, choices_in_blocks(order, found, cost_of))


class Opened:
    """Paths that have blocks, and what is calculated in them before the orders."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.conditions = {(plan.paths[v], v.arguments[0]) for v in plan.choices}
        self.variables: dict[Value, tuple[Constant, Path]] = {}

    def path(self, value: Value) -> Path:
        """Return the part of a value's path that has blocks."""
        path = self.plan.paths.get(value, ())
        for i, (condition, _) in enumerate(path):
            if (path[:i], condition) not in self.conditions:
                return path[:i]
        return path

    def variable(self, value: Value, path: Path) -> Constant:
        """Return what holds a value in a branch."""
        is_condition = value.op in CONDITIONS
        new = Constant(
            "0" if is_condition else 0.0, "int" if is_condition else "double",
            is_kept=True, is_variable=True,
        )  # fmt: skip
        if not value.moves:  # it is known before conditions that move
            path = path[: next((i for i, (c, _) in enumerate(path) if c.moves), len(path))]
        variable, known = self.variables.get(value, (new, path))
        self.variables[value] = variable, common(known, path)
        return variable

    def write(self, code: Code, condition: Callable[[Value, Path], Operand], moves: bool) -> None:
        """Calculate the variables that move, or those that do not."""
        groups: dict[Path, list[Value]] = defaultdict(list)
        for value, (variable, path) in self.variables.items():
            if value.moves is moves:
                groups[path].append(value)
                code.statements.append(variable)
        for path in sorted(groups, key=len):
            inner = Code(code.leaves)
            inner.known = dict(code.known)
            if code.outer:
                inner.known |= code.outer.known
            for value, (variable, known) in self.variables.items():
                if common(known, path) == known and value not in groups[path]:
                    inner.known.setdefault(value, variable)
            stores = [store(self.variables[v][0], inner.of(v)) for v in groups[path]]
            code.statements += within(path, [*inner.statements, *stores], condition)


def within(
    path: Path, items: list[Item], condition: Callable[[Value, Path], Operand]
) -> list[Item]:
    """Return statements in a block where all conditions of a path are met."""
    heads = [condition(of, path[:i]) for i, (of, _) in enumerate(path)]
    met = [head if holds else ("not", head) for head, (_, holds) in zip(heads, path, strict=True)]
    return [Block(reduce(lambda a, b: ("and", a, b), met), (items,))] if met else items


class AtOrigin(Code):
    """Values at the origin, which rows get as coefficients 0."""

    def __init__(self, series: Series, stored: Iterable[Value]) -> None:
        super().__init__(series.leaves_at("0"))
        self.series, self.stored = series, frozenset(stored)

    def beside(self, value: Value) -> Sequence[Value]:
        """The derivatives of a function."""
        return partials_of(self.series.graph, value)

    def operand(self, value: Value, given: Sequence[Operand], name: str = "") -> Operand:
        """Calculate a value, and keep it."""
        found = super().operand(value, given, name)
        self.chosen(value, found)
        return found

    def chosen(self, value: Value, variable: Operand) -> None:
        """Write the row of a value."""
        places = self.series.places(value, "0") if value in self.stored else []
        self.statements += [store(place, variable) for place in places]


class OfOrder(Writer):
    """Coefficients k > 0 of a series."""

    def __init__(self, series: Series) -> None:
        self.series, self.names, self.known = series, {}, {}

    @property
    def statements(self) -> list[Item]:
        """Where the series writes."""
        return self.series.later.statements

    @statements.setter
    def statements(self, items: list[Item]) -> None:
        self.series.later.statements = items

    def read(self, value: Value) -> Sequence[Value]:
        """Those whose coefficients of the same order are read."""
        return read_in_series(value)

    def beside(self, value: Value) -> Sequence[Value]:
        """The derivatives of a function."""
        return partials_of(self.series.graph, value)

    def operand(self, value: Value, given: Sequence[Operand], _name: str = "") -> Operand:
        """Return a coefficient, or a condition."""
        series = self.series
        path = series.opened.path(value)
        if value.op in CONDITIONS:
            return series.condition(value, path)
        return series.coefficient_in(path, value, zip(self.read(value), given, strict=True))

    def chosen(self, value: Value, variable: Constant) -> None:
        """Write the row of a choice."""
        self.statements += [store(place, variable) for place in self.series.places(value, "k")]
