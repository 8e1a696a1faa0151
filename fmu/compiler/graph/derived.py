"""Derivatives that expressions ask for: partial(E, NAME)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..expressions.expression import PARTIAL, ExpressionError, Node
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
    return graph.derivative(y, x)
