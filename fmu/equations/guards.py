"""When a relation matters: under which modes and parameters a value that is needed reads it."""

from collections.abc import Iterable

from equations.graph import Graph, Value, is_unknown
from rparm.expressions.expression import in_order

Guards = dict[Value, Value | None]  # conditions; None: always


def guards(graph: Graph, roots: Iterable[tuple[Value, Value | None]]) -> Guards:
    """Condition under which each mode is read, of those that are.

    roots: what is needed, with the condition under which it is.
    """
    found: Guards = {}
    modes: dict[Value, list[Value]] = {}  # by the distance that they follow from
    for relation in graph.relations.values():
        modes.setdefault(relation.distance, []).append(relation.mode)
    for value, guard in roots:
        _widen(graph, found, value, guard)
    for value in reversed(in_order([*modes, *found])):  # each before what it reads
        for mode in modes.get(value, []):
            if mode in found:
                _widen(graph, found, value, found[mode])
        if value not in found:
            continue
        conditions = [found[value]] * len(value.arguments)
        if value.op == "if" and not is_unknown(value):
            condition = value.arguments[0]
            for i, chosen in enumerate((condition, graph.value("not", condition)), 1):
                own = found[value]
                conditions[i] = _both(graph, own, chosen)
        if value.op in ("and", "or"):  # the second one decides where the first one does not
            first = value.arguments[0]
            open_ = first if value.op == "and" else graph.value("not", first)
            conditions[1] = _both(graph, found[value], open_)
        for argument, guard in zip(value.arguments, conditions, strict=True):
            _widen(graph, found, argument, guard)
    return {value: guard for value, guard in found.items() if value.op == "mode"}


def _both(graph: Graph, guard: Value | None, condition: Value) -> Value:
    return condition if guard is None else graph.value("and", guard, condition)


def _widen(graph: Graph, found: Guards, value: Value, guard: Value | None) -> None:
    """Let a value matter under this condition, too."""
    if value not in found:
        found[value] = guard
    elif found[value] is not None and found[value] is not guard:
        found[value] = None if guard is None else graph.value("or", found[value], guard)
