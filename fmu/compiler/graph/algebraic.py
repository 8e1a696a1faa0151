"""Equations that need each other: systems whose unknowns are values of a graph.

Three operations have several results, of which "component" is one by its number:
    solution   of a system by Newton's method; arguments: what the equations read, then the guesses
    factors    of a matrix; arguments: its elements at the places that `name` has
    slopes     factors of a system's matrix; arguments: the unknowns, then what its equations read
    linear     solution of linear equations; arguments: factors, then right sides
Their derivatives follow from the implicit function theorem, and are such operations again.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ..expressions.expression import in_order

if TYPE_CHECKING:
    from .graph import Graph, Relation, Value

VECTORS = ("solution", "linear")
FACTORS = ("factors", "slopes")
SEVERAL = (*FACTORS, *VECTORS)  # with several results
FOLDED = {"+": operator.add, "-": operator.sub, "*": operator.mul, "negative": operator.neg}
UNKNOWN, GIVEN = "unknown", "given"  # leaves of a system's equations
FREE = "is free"  # a mode in them: while the unknowns are searched, all modes follow from them


@dataclass(eq=False)
class System:
    """Equations for unknowns of the file; leaves of the residuals are `unknowns` and `given`."""

    name: str
    names: list[str]  # of the unknowns
    texts: list[str]  # of the equations
    unknowns: list[Value]
    given: list[Value]
    residuals: list[Value]
    slopes: dict[tuple[int, int], Value]  # of residuals by unknowns, where they are not 0
    nominal: list[float]
    low: list[float]
    high: list[float]
    solution: Value  # where the file has it
    bends: dict[tuple[int, int], dict[Value, Value]]  # derivatives of the slopes by leaves
    free: tuple[list[Value], list[Value]] | None  # residuals and slopes in modes that follow
    at: dict[Value, Placed] = field(default_factory=dict)  # by solution


@dataclass(frozen=True)
class Linear:
    """Linear equations for unknowns of the file."""

    names: list[str]
    texts: list[str]
    vector: Value


@dataclass(eq=False)
class Placed:
    """The equations of a system where it is solved, and their slopes by what they read."""

    residuals: list[Value]
    factors: Value
    by_given: list[dict[int, Value]]  # of each residual


def places(factors: Value) -> list[tuple[int, int]]:
    """Return where the elements of a matrix stand."""
    pairs = (place.split(",") for place in factors.name.split())
    return [(int(i), int(j)) for i, j in pairs]


def matrix(graph: Graph, elements: Mapping[tuple[int, int], Value]) -> Value:
    """Return the factors of a matrix."""
    name = " ".join(f"{i},{j}" for i, j in elements)
    return graph.value("factors", *elements.values(), name=name)


def component(graph: Graph, vector: Value, number: int) -> Value:
    """Return a result of an operation that has several; of a single linear equation a quotient."""
    if vector.op == "linear" and len(vector.arguments) == 2:
        (slope,), right = vector.arguments[0].arguments, vector.arguments[1]
        return graph.over(right, slope)
    return graph.value("component", vector, name=f"{number}")


def components(graph: Graph, vector: Value, count: int) -> list[Value]:
    """Return all results of such an operation."""
    return [component(graph, vector, i) for i in range(count)]


def replaced(graph: Graph, roots: Iterable[Value], by: Mapping[Value, Value]) -> list[Value]:
    """Return values in which others stand for some of what they follow from; numbers folded."""
    roots, found = [*roots], {}
    for value in in_order(roots):
        given = [found[argument] for argument in value.arguments]
        if value in by:
            found[value] = by[value]
        elif value.op in FOLDED and given and all(new.op == "number" for new in given):
            found[value] = graph.number(FOLDED[value.op](*(new.number for new in given)))
        elif all(new is old for new, old in zip(given, value.arguments, strict=True)):
            found[value] = value
        elif value.op in ("+", "-", "*", "/"):
            found[value] = graph.simple(value.op, *given)
        else:
            found[value] = graph.value(value.op, *given, name=value.name, number=value.number)
    return [found[root] for root in roots]


def put(graph: Graph, by: Mapping[Value, Value], first: int) -> None:
    """Let relations from the `first` on, and what else is known, follow from other values."""
    for name, relation in [*graph.relations.items()][first:]:
        distance, limit = replaced(
            graph, [relation.distance, relation.limit or relation.distance], by
        )
        limit = limit if relation.limit else None
        graph.relations[name] = replace(relation, distance=distance, limit=limit)
    own = {(unknown.op, unknown.name) for unknown in by}
    for name, segment in graph.segments.items():
        if segment.argument.leaves & own:
            (argument,) = replaced(graph, [segment.argument], by)
            low, high = (graph.relations[end.name] for end in (segment.low, segment.high))
            graph.segments[name] = replace(segment, argument=argument, low=low, high=high)
    for condition, unknown in graph.unknowns.items():
        if unknown is not None and unknown.leaves & own:
            (graph.unknowns[condition],) = replaced(graph, [unknown], by)


def solved(
    graph: Graph, names: list[str], texts: list[str], unknowns: list[Value],
    residuals: list[Value], guesses: Callable[[], list[Value]],
    ranges: tuple[list[float], list[float], list[float]], relations: Sequence[Relation],
) -> tuple[list[Value], bool]:  # fmt: skip
    """Return the unknowns as values of a graph, and whether their equations are linear.

    unknowns: leaves of the residuals. ranges: nominal values, lower and upper bounds. relations:
    those whose distances may follow from the unknowns.
    """
    rows = graph.gradients(residuals, unknowns)
    slopes = {
        (i, j): replaced(graph, [row[u]], {})[0]
        for i, row in enumerate(rows)
        for j, u in enumerate(unknowns)
        if u in row
    }
    slopes = {place: slope for place, slope in slopes.items() if not _rest([slope])}
    for i, text in enumerate(texts):
        if i not in {row for row, _ in slopes}:
            raise ValueError(f"{text} does not determine {', '.join(names)}")
    for j, name in enumerate(names):
        if j not in {column for _, column in slopes}:
            raise ValueError(f"no equation determines {name}: {'; '.join(texts)}")
    own = {(u.op, u.name) for u in unknowns}
    zero = graph.number(0.0)
    if not any(slope.leaves & own for slope in slopes.values()):
        at_zero = replaced(graph, residuals, dict.fromkeys(unknowns, zero))
        right = [graph.negative(value) for value in at_zero]
        vector = graph.value("linear", matrix(graph, slopes), *right)
        graph.linear.append(Linear(names, texts, vector))
        return components(graph, vector, len(unknowns)), True
    held = [*residuals, *slopes.values()]
    followed = _followed(graph, relations, own)
    roots = [*held, *replaced(graph, held, followed)] if followed else held
    outside: dict[Value, None] = {}  # what the equations read
    for value in in_order(roots):
        if value.leaves & own:
            outside |= dict.fromkeys(
                a for a in value.arguments if not a.leaves & own and a.op != "number"
            )
    for value in roots:
        if not value.leaves & own and value.op != "number":
            outside[value] = None
    outside.pop(graph.value("mode", name=FREE), None)
    given = [graph.given(value, i) for i, value in enumerate(outside)]
    by = dict(zip(outside, given, strict=True))
    found = replaced(graph, roots, by)
    count = len(residuals)
    own_slopes = dict(zip(slopes, found[count : len(held)], strict=True))
    free = found[len(held) :]
    name = f"{len(graph.systems) + 1}"
    numbers = [leaf for leaf in given if leaf.op == GIVEN]
    bends = graph.gradients(own_slopes.values(), [*unknowns, *numbers])
    vector = graph.value("solution", *outside, *guesses(), name=name)
    graph.systems[name] = System(
        name, names, texts, unknowns, given, found[:count], own_slopes, *ranges, vector,
        dict(zip(own_slopes, bends, strict=True)), (free[:count], free[count:]) if free else None,
    )  # fmt: skip
    return components(graph, vector, len(unknowns)), False


def _followed(
    graph: Graph, relations: Iterable[Relation], own: set[tuple[str, str]]
) -> dict[Value, Value]:
    """Return modes that follow from unknowns, where modes are free: by the modes."""
    free, zero = graph.value("mode", name=FREE), graph.number(0.0)
    found: dict[Value, Value] = {}
    for relation in relations:
        (distance,) = replaced(graph, [relation.distance], found)
        if relation.time is None and distance.leaves & own:
            holds = graph.value(">=" if relation.includes_zero else ">", distance, zero)
            found[relation.mode] = graph.value("if", free, holds, relation.mode)
    return found


def placed(graph: Graph, solution: Value) -> Placed:
    """Return the equations of a system with its solution in place of the unknowns."""
    system = graph.systems[solution.name]
    if solution not in system.at:
        by = dict(zip(system.given, solution.arguments, strict=False))
        by |= zip(system.unknowns, components(graph, solution, len(system.unknowns)), strict=True)
        moving = [leaf for leaf in system.given if leaf.op == GIVEN]
        rows = graph.gradients(system.residuals, moving)
        number = {leaf: i for i, leaf in enumerate(system.given)}
        pairs = [(i, number[leaf], s) for i, row in enumerate(rows) for leaf, s in row.items()]
        roots = [*system.residuals, *(slope for *_, slope in pairs)]
        found = replaced(graph, roots, by)
        count = len(system.residuals)
        by_given: list[dict[int, Value]] = [{} for _ in system.residuals]
        for (i, k, _), slope in zip(pairs, found[count:], strict=True):
            by_given[i][k] = slope
        read = [*by.values()]
        arguments = [*read[len(system.given) :], *read[: len(system.given)]]
        factors = graph.value("slopes", *arguments, name=solution.name)
        if len(system.unknowns) == 1:
            factors = matrix(graph, {(0, 0): replaced(graph, system.slopes.values(), by)[0]})
        system.at[solution] = Placed(found[:count], factors, by_given)
    return system.at[solution]


def equations(graph: Graph, vector: Value) -> tuple[list[Value], Value]:
    """Return values that are 0 by the results of a vector, and the factors of their slopes."""
    if vector.op == "solution":
        found = placed(graph, vector)
        return found.residuals, found.factors
    factors, *right = vector.arguments
    results = components(graph, vector, len(right))
    found = [graph.negative(b) for b in right]
    for (i, j), element in zip(places(factors), factors.arguments, strict=True):
        found[i] = graph.value("+", found[i], graph.value("*", element, results[j]))
    return found, factors


def chain(graph: Graph, y: Value, d: Sequence[Value]) -> Value:
    """Derivative of one of these operations, whose arguments have the derivatives d."""
    zero = graph.number(0.0)
    if y.op == "component":
        return zero if d[0].op == "number" else component(graph, d[0], int(y.name))
    if y.op == "factors":
        return zero if _rest(d) else graph.value("factors", *d, name=y.name)
    if y.op == "slopes":
        return _bent(graph, y, d)
    if y.op == "linear":
        right = _minus_product(graph, d[1:], d[0], y)
        return _linear(graph, y.arguments[0], right)
    found = placed(graph, y)
    right = [
        _sum(graph, (graph.scaled(slope, d[k]) for k, slope in row.items()))
        for row in found.by_given
    ]
    return _linear(graph, found.factors, [graph.negative(b) for b in right])


def _bent(graph: Graph, y: Value, d: Sequence[Value]) -> Value:
    """Derivatives of the slopes of a system."""
    system = graph.systems[y.name]
    leaves = [*system.unknowns, *system.given]
    by, rates = dict(zip(leaves, y.arguments, strict=True)), dict(zip(leaves, d, strict=True))
    found = {}
    for place, row in system.bends.items():
        bends = zip(row, replaced(graph, row.values(), by), strict=True)
        rate = _sum(graph, (graph.scaled(bend, rates[leaf]) for leaf, bend in bends))
        if not _rest([rate]):
            found[place] = rate
    return matrix(graph, found) if found else graph.number(0.0)


def second(graph: Graph, y: Value, firsts, d: Sequence[Value], dd: Sequence[Value]) -> Value:
    """Second derivative of a vector along a curve; firsts: returns first derivatives of values.

    d, dd: derivatives of its arguments.
    """
    first = firsts([y])[0]
    two = graph.number(2.0)
    if y.op == "linear":
        factors = y.arguments[0]
        right = _minus_product(graph, dd[1:], dd[0], y)
        if d[0].op != "number" and first.op != "number":
            of_slopes = _minus_product(graph, [graph.number(0.0)] * len(right), d[0], first)
            right = [
                graph.simple("+", b, graph.simple("*", two, rest))
                for b, rest in zip(right, of_slopes, strict=True)
            ]
        return _linear(graph, factors, right)
    found = placed(graph, y)
    right = []
    for row in found.by_given:
        rates = firsts(row.values())
        terms = [graph.scaled(slope, dd[k]) for k, slope in row.items()]
        terms += [graph.scaled(rate, d[k]) for k, rate in zip(row, rates, strict=True)]
        right.append(graph.negative(_sum(graph, terms)))
    if first.op != "number":
        rate = firsts([found.factors])[0]
        right = _minus_product(graph, right, rate, first)
    return _linear(graph, found.factors, right)


def _rest(derivatives: Iterable[Value]) -> bool:
    return all(d.op == "number" and d.number == 0.0 for d in derivatives)


def _sum(graph: Graph, terms: Iterable[Value]) -> Value:
    total = graph.number(0.0)
    for term in terms:
        total = graph.simple("+", total, term)
    return total


def _minus_product(graph: Graph, b: Sequence[Value], slopes: Value, x: Value) -> list[Value]:
    """Return b - A' x of a matrix with these derivatives of its elements."""
    found = [*b]
    if slopes.op != "number":
        results = components(graph, x, len(found))
        for (i, j), slope in zip(places(slopes), slopes.arguments, strict=True):
            found[i] = graph.simple("-", found[i], graph.scaled(results[j], slope))
    return found


def _linear(graph: Graph, factors: Value, right: Sequence[Value]) -> Value:
    return graph.number(0.0) if _rest(right) else graph.value("linear", factors, *right)
