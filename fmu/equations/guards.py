"""When a relation matters: under which modes and parameters a value that is needed reads it."""

from __future__ import annotations

from collections.abc import Iterable

from equations.graph import Graph, Value
from rparm.expressions.tree import in_order


def guards(graph: Graph, roots: Iterable[Value]) -> dict[Value, Value | None]:
    """Condition under which each switch is read, of those that are; None: always."""
    roots = list(roots)
    found: dict[Value, Value | None] = dict.fromkeys(roots)
    for value in reversed(in_order(roots)):
        own = found[value]
        if value.op == "if":
            condition, chosen, otherwise = value.arguments
            _widen(graph, found, condition, own)
            _widen(graph, found, chosen, _both(graph, own, condition))
            _widen(graph, found, otherwise, _both(graph, own, graph.value("not", condition)))
        else:
            for argument in value.arguments:
                _widen(graph, found, argument, own)
    return {value: guard for value, guard in found.items() if value.name in graph.relations}


def _both(graph: Graph, guard: Value | None, condition: Value) -> Value:
    return condition if guard is None else graph.value("and", guard, condition)


def _widen(
    graph: Graph, found: dict[Value, Value | None], value: Value, guard: Value | None
) -> None:
    """Let a value matter under this condition, too."""
    if value not in found:
        found[value] = guard
    elif found[value] is not None and found[value] is not guard:
        found[value] = None if guard is None else graph.value("or", found[value], guard)
