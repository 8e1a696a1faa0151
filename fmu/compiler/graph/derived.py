"""Derivatives that expressions ask for: partial(E, NAME)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..expressions.expression import PARTIAL, ExpressionError, Node, in_order
from .algebraic import UNKNOWN

if TYPE_CHECKING:
    from .graph import Graph, Value

NAMED = ("parameter", "input", "state", "discrete", "time")  # leaves by which values are derived


def derived(graph: Graph, node: Node, y: Value, x: Value) -> Value:
    """Return the derivative of y by x; ExpressionError if x is no leaf."""
    if x.op not in NAMED:
        wanted = "expected a state, an input, a parameter, a discrete variable or time"
        raise ExpressionError(node.arguments[1].column, f"{wanted}, got {x.name or x.op}")
    if unknown := sorted(name for op, name in y.leaves if op == UNKNOWN):
        text = f"cannot derive what is solved together with {unknown[0]}"
        raise ExpressionError(node.column, f"{PARTIAL}: {text}")
    return _without_guards(graph, graph.derivative(y, x))


def _without_guards(graph: Graph, root: Value) -> Value:
    """Return a derivative by plain operations, which have derivatives themselves."""
    found: dict[Value, Value] = {}
    for v in in_order([root]):
        given = [found[argument] for argument in v.arguments]
        match v.op:
            case "slopes_scaled" | "slopes_product" | "slopes_both":
                found[v] = graph.simple("*", *given[:2])
            case "slopes_over" | "slopes_reduced":
                found[v] = graph.simple("/", *given[:2])
            case "slopes_bounded":
                found[v] = given[0]
            case "slopes_logged":
                found[v] = graph.simple("*", given[0], graph.value("log", given[1]))
            case _ if all(new is old for new, old in zip(given, v.arguments, strict=True)):
                found[v] = v
            case _:
                found[v] = graph.value(v.op, *given, name=v.name, number=v.number)
    return found[root]
