"""Where conditions have no value: a side of a relation is not a number, an index has no element.

Only what decides counts: "a and b" has a value where a is false.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial, reduce
from typing import TYPE_CHECKING

from ..expressions.expression import RELATIONS, in_order

if TYPE_CHECKING:
    from .graph import Graph, Value

# operations whose results may be not a number
UNDEFINED = ("/", "sqrt", "log", "asin", "acos", "pow", "solution", "linear", "element")
CONNECTIVES = ("and", "or", "not")


def may_miss(value: Value) -> bool:
    """Return whether a number may have no value."""
    return not value.functions.isdisjoint(UNDEFINED)


def unknown(graph: Graph, condition: Value) -> Value | None:
    """Return whether a condition has no value; None: it always has one."""
    for part in in_order([condition], graph.unknowns, partial(_read, graph)):
        graph.unknowns[part] = _unknown(graph, part)
    return graph.unknowns[condition]


def unknown_without(graph: Graph, condition: Value, places: Iterable[Value]) -> None:
    """Let a condition have no value where none of its places is that of an element."""
    is_none = graph.value("not", reduce(partial(graph.value, "or"), places))
    for part in condition.arguments:
        unknown(graph, part)
    graph.unknowns[condition] = _any(graph, [is_none, _unknown(graph, condition)])


def _read(graph: Graph, condition: Value) -> Iterable[Value]:
    """Return the conditions that a condition follows from."""
    return condition.arguments if condition.op in CONNECTIVES else ()


def _unknown(graph: Graph, condition: Value) -> Value | None:
    if condition.op in CONNECTIVES:
        parts = [graph.unknowns[part] for part in condition.arguments]
        if condition.op != "not" and parts[1] is not None:  # if it is looked at
            first = condition.arguments[0]
            passes = first if condition.op == "and" else graph.value("not", first)
            parts[1] = graph.value("and", passes, parts[1])
        return _any(graph, parts)
    if condition.name in graph.relations:
        sides = graph.relations[condition.name].distance.arguments
    else:
        sides = condition.arguments if condition.op in ("==", *RELATIONS) else ()
    return _any(graph, (graph.value("isnan", side) for side in sides if may_miss(side)))


def _any(graph: Graph, conditions: Iterable[Value | None]) -> Value | None:
    found = [condition for condition in conditions if condition is not None]
    return reduce(partial(graph.value, "or"), found) if found else None
