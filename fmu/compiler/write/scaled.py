"""Factors that do not move, taken out of what a series has sums for."""

from functools import partial, reduce

from ..expressions.expression import in_order
from ..graph.graph import Graph, Value, unsigned


def times(graph: Graph, a: Value, b: Value) -> Value:
    """The product of a factor that does not move and a value, with their signs in front."""
    product = graph.simple("*", unsigned(a), unsigned(b))
    return product if (a.op == "negative") == (b.op == "negative") else graph.negative(product)


def scaled(graph: Graph, roots: list[Value], is_wide: bool) -> list[Value]:
    """The roots with factors that do not move in front of products: (a x) y as a (x y).

    is_wide: signs and factors of quotients are in front, too, and of two differences x - y and
    y - x there is one.
    """
    found: dict[Value, tuple[Value, Value]] = {}  # factor and what it is the factor of
    differences: dict[tuple[Value, Value], Value] = {}
    one = graph.number(1.0)
    product = partial(times, graph) if is_wide else partial(graph.simple, "*")
    for value in in_order(roots):
        given = [found[argument] for argument in value.arguments]
        moving = [pair for pair, x in zip(given, value.arguments, strict=True) if x.moves]
        if value.op == "*" and moving:
            factors = [
                f if x.moves else x for (f, _), x in zip(given, value.arguments, strict=True)
            ]
            bases = [base for _, base in moving]
            found[value] = product(*factors), reduce(partial(graph.value, "*"), bases)
        elif value.op == "negative" and moving:
            found[value] = graph.negative(given[0][0]), given[0][1]
        elif moving:
            op, sign = value.op, one
            if is_wide and op == "/" and value.arguments[0].moves:
                sign, given[0] = given[0][0], (one, given[0][1])
            whole = [product(*pair) for pair in given]
            if op == "if" and (common_term := _common_term(*whole[1:])) is not None:
                rest = graph.value("if", whole[0], *(x.arguments[0] for x in whole[1:]))
                found[value] = one, graph.value("+", rest, common_term)
                continue
            last = whole[-1]
            if is_wide and op in ("+", "-") and last.op == "negative" and last.moves:
                op, whole[-1] = "-" if op == "+" else "+", last.arguments[0]
            if is_wide and op == "-" and all(x.moves for x in whole):
                if (*reversed(whole),) in differences:
                    sign, whole = graph.negative(one), [*reversed(whole)]
                differences[*whole] = last
            found[value] = sign, graph.value(op, *whole, name=value.name)
        else:
            found[value] = one, value
    return [product(*found[root]) for root in roots]


def _common_term(first: Value, second: Value) -> Value | None:
    """Return what moves in two sums whose other terms rest."""
    is_same = first.op == second.op == "+" and first.arguments[1] is second.arguments[1]
    rests = [value.arguments[0] for value in (first, second)] if is_same else []
    return first.arguments[1] if is_same and not any(rest.moves for rest in rests) else None
