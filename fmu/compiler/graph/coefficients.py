"""What the series of values read: coefficients of their arguments and of their derivatives."""

from __future__ import annotations

from collections.abc import Iterable

from ..expressions.expression import in_order
from . import algebraic
from .graph import CONDITIONS, DERIVATIVES, Graph, Value, is_unknown, unsigned


def read_in_series(value: Value) -> tuple[Value, ...]:
    """Those of which the series of a value reads coefficients of the same order."""
    if not value.moves or value.op in CONDITIONS:
        return ()
    if value.op == "solution":
        return tuple(v for v in value.arguments if v.op not in CONDITIONS)
    if value.op == "if":
        return value.arguments[2:] if is_unknown(value) else value.arguments[1:]
    return value.arguments[1:] if value.op == "moving_as" else value.arguments


def with_partials(graph: Graph, roots: Iterable[Value]) -> list[Value]:
    """All values that the series of the roots follow from."""
    done: dict[Value, None] = {}
    todo = list(roots)
    while todo:
        new = in_order(todo, done, read_in_series)
        done |= dict.fromkeys(new)
        todo = [
            unsigned(partial)
            for value in new if value.moves and value.op in DERIVATIVES
            for x, partial in zip(value.arguments, graph.partials(value), strict=True) if x.moves
        ]  # fmt: skip
        for value in new:
            if value.moves and value.op in algebraic.VECTORS:
                todo += algebraic.equations(graph, value)[0]
    return list(done)
