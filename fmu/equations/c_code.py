"""Values of a graph as statements in C: a constant for each operation, in the order of the text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from equations.graph import LEAVES, Graph, Value, is_function, ordered
from rparm.expressions.tree import RELATIONS

CONDITIONS = ("mode", "and", "or", "not", *RELATIONS)
ZERO = "0.0"  # derivative of what never changes
OPERATORS = {"and": "&&", "or": "||"}

References = dict[Value, str]  # C expressions without operators, by value


def number(value: float) -> str:
    """A double that reads back as the same."""
    return f"({value!r})" if value < 0 else repr(value)


def text(value: str) -> str:
    """A string of C with any characters."""
    return '"' + "".join(_character(byte) for byte in value.encode()) + '"'


def _character(byte: int) -> str:
    plain = 32 <= byte < 127 and chr(byte) not in '"\\?%'
    return chr(byte) if plain else f"\\{byte:03o}"


def operation(value: Value, references: Mapping[Value, str]) -> str:
    """The operation on its arguments."""
    given = [references[argument] for argument in value.arguments]
    if value.op == "negative":
        return f"-{given[0]}"
    if value.op == "not":
        return f"!{given[0]}"
    if value.op == "if":
        return f"{given[0]} ? {given[1]} : {given[2]}"
    if is_function(value):
        return f"{value.op}({', '.join(given)})"
    return f"{given[0]} {OPERATORS.get(value.op, value.op)} {given[1]}"


def calculated(
    roots: Iterable[Value], leaf: Callable[[Value], str]
) -> tuple[list[str], References]:
    """Statements that calculate the roots, and how to refer to each value.

    leaf: the C expression of a leaf.
    """
    lines: list[str] = []
    references: References = {}
    for value in ordered(roots):
        if value.op == "number":
            references[value] = number(value.number)
        elif value.op in LEAVES:
            references[value] = leaf(value)
        else:
            references[value] = f"n{len(lines)}"
            c_type = "int" if value.op in CONDITIONS else "double"
            lines.append(f"const {c_type} n{len(lines)} = {operation(value, references)};")
    return lines, references


def along_curve(
    graph: Graph,
    values: list[Value],
    references: Mapping[Value, str],
    lower: Mapping[Value, str],
    leaf: Callable[[Value], str],
    order: int,
) -> tuple[list[str], References]:
    """Statements for the first or second derivative of values along a curve.

    Parameters
    ----------
    values : list
        With the partial derivatives of all functions among them, arguments first.
    references : mapping
        The values.
    lower : mapping
        Their first derivatives, if order is 2.
    leaf : function
        The C expression of a leaf's derivative.
    order : int
        1 or 2.
    """
    lines: list[str] = []
    found: References = {}
    for value in values:
        if value.op in CONDITIONS:
            continue
        if value.op in LEAVES:
            found[value] = leaf(value)
        elif not value.leaves:
            found[value] = ZERO
        else:
            found[value] = f"{'fs'[order - 1]}{len(lines)}"
            formula = _rule(graph, value, references, found, lower if order == 2 else None)
            lines.append(f"const double {found[value]} = {formula};")
    return lines, found


def _rule(
    graph: Graph,
    value: Value,
    at: Mapping[Value, str],
    d: Mapping[Value, str],
    first: Mapping[Value, str] | None,
) -> str:
    """Derivative of an operation; first: where it is the second one."""
    arguments = value.arguments
    if value.op == "negative":
        return f"-{d[arguments[0]]}"
    if value.op in ("+", "-"):
        return f"{d[arguments[0]]} {value.op} {d[arguments[1]]}"
    if value.op == "if":
        return f"{at[arguments[0]]} ? {d[arguments[1]]} : {d[arguments[2]]}"
    if value.op in ("*", "/"):
        return _rule_of_product(value, at, d, first)
    terms = []
    for partial, x in zip(graph.partials(value), arguments, strict=True):
        if not x.leaves:
            continue
        terms.append(f"{at[partial]} * {d[x]}")
        if first:
            terms.append(f"{first[partial]} * {first[x]}")
    return " + ".join(terms) or ZERO


def _rule_of_product(
    value: Value,
    at: Mapping[Value, str],
    d: Mapping[Value, str],
    first: Mapping[Value, str] | None,
) -> str:
    a, b = value.arguments
    if not b.leaves:
        return f"{d[a]} {value.op} {at[b]}"
    if value.op == "*":
        if not a.leaves:
            return f"{at[a]} * {d[b]}"
        between = f" + 2.0 * {first[a]} * {first[b]}" if first else ""
        return f"{d[a]} * {at[b]}{between} + {at[a]} * {d[b]}"
    between = f" - 2.0 * {first[value]} * {first[b]}" if first else ""
    return f"({d[a]}{between} - {at[value]} * {d[b]}) / {at[b]}"
