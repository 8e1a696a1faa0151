"""Derivatives by the plain rules, for series, where those of src/model/slopes.h are finite."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..expressions.expression import in_order

if TYPE_CHECKING:
    from .graph import Graph, Value


def plain(graph: Graph, roots: list[Value]) -> list[Value]:
    """Return values that calculate the same, where the plain rules are defined."""
    found: dict[Value, Value] = {}
    for value in in_order(roots):
        given = [found[argument] for argument in value.arguments]
        match value.op, given:
            case "slopes_bounded", [slope]:
                found[value] = slope
            case "slopes_over", [product, b]:
                found[value] = graph.simple("/", product, b)
            case ("slopes_scaled", [a, b]) | ("slopes_product", [a, b, _]):
                found[value] = graph.simple("*", a, b)
            case "slopes_reduced", [power, x, _]:
                found[value] = graph.simple("/", power, x)
            case "slopes_logged", [power, x, _]:
                found[value] = graph.simple("*", power, graph.value("log", x))
            case "if", [condition, _, otherwise] if condition.op == "==" and condition.moves:
                found[value] = otherwise  # the corner of hypot
            case _:
                found[value] = (
                    graph.value(value.op, *given, name=value.name, number=value.number)
                    if given != [*value.arguments]
                    else value
                )
    return [found[root] for root in roots]
