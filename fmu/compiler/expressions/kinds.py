"""Kinds of the parts of expressions: numbers, conditions, items of enumerations."""

from collections.abc import Mapping
from dataclasses import replace

from .expression import (
    EQUALITIES,
    RANDOM,
    RELATIONS,
    ExpressionError,
    Node,
    constant,
    in_order,
    shown_text,
)

LOGIC = ("and", "or", "not")
NUMBER, WHOLE, CONDITION, TEXT = "a number", "a whole number", "a condition", "a text"
KEEP_WHOLE = ("+", "-", "*", "negative", "abs", "min", "max", "if")  # of whole numbers
Kind = str | tuple[str, ...]  # the items of an enumeration
KIND_HINTS = {  # by what is expected and what is given
    (WHOLE, NUMBER): ": write floor(...), which rounds down",
    (NUMBER, CONDITION): ": write 1 if ... else 0",
}


def with_kinds(
    root: Node, expected: Kind = NUMBER, kinds: Mapping[str, Kind] | None = None
) -> Node:
    """Return the tree with numbers (from 1) in place of items of enumerations.

    ExpressionError where a part is of the wrong kind. `kinds` has the names that are no numbers.
    """
    nodes, found = in_order([root]), {}
    for node in nodes:
        found[node] = _kind(node, [found[argument] for argument in node.arguments], kinds or {})
    items: dict[Node, Node] = {}
    needed, pairs = {root: expected}, [(root, expected)]
    for node in reversed(nodes):
        of_arguments = [*zip(node.arguments, _needed(node, needed[node], found), strict=True)]
        pairs += of_arguments[::-1]
        needed |= of_arguments
        if node.op == "text" and node.name in needed[node]:
            items[node] = constant(node, needed[node].index(node.name) + 1)
    for node, kind in reversed(pairs):
        _check(node, found[node], kind)
    if items:
        for node in nodes:
            given = tuple(items.get(argument, argument) for argument in node.arguments)
            if given != node.arguments:
                items[node] = replace(node, arguments=given)
    return items.get(root, root)


def kind_of(root: Node, kinds: Mapping[str, Kind]) -> Kind:
    """Return the kind of an expression, of which `kinds` has the names that are no numbers."""
    found: dict[Node, Kind] = {}
    for node in in_order([root]):
        found[node] = _kind(node, [found[argument] for argument in node.arguments], kinds)
    return found[root]


def _kind(node: Node, given: list[Kind], kinds: Mapping[str, Kind]) -> Kind:
    if node.op == "name":
        return kinds.get(node.name, NUMBER)
    if node.op == "text":
        return TEXT
    if node.op in ("literal", *LOGIC, *RELATIONS, *EQUALITIES):
        return CONDITION
    if node.op == "if" and {*given[1:]} == {CONDITION}:
        return CONDITION
    if node.op == "if" and not {*given[1:]} <= {NUMBER, WHOLE, CONDITION}:
        return max(given[1:], key=lambda kind: isinstance(kind, tuple))
    if node.op == "element":
        elements = {*given[node.name.count("{}") :]}
        return elements.pop() if len(elements) == 1 else NUMBER
    is_whole = node.op == "number" and node.value.is_integer()
    if node.op == "**" and {*given} == {WHOLE}:
        exponent = node.arguments[1]
        is_whole = exponent.op == "number" and exponent.value >= 0
    if node.op == "unit" and len(given) == 2:
        return given[0]
    is_whole |= node.op in KEEP_WHOLE and {*given[node.op == "if" :]} == {WHOLE}
    return WHOLE if is_whole or node.op == "floor" else NUMBER


def _needed(node: Node, own: Kind, found: Mapping[Node, Kind]) -> list[Kind]:
    """Return the kinds that the arguments must have."""
    given = [found[argument] for argument in node.arguments]
    if node.op in LOGIC:
        return [CONDITION] * len(given)
    if node.op == "if":
        is_item = not {*given[1:]} <= {NUMBER, WHOLE, CONDITION}
        of_number = CONDITION if found[node] == CONDITION else NUMBER
        return [CONDITION, *[own if is_item else of_number] * 2]
    if node.op in RANDOM:
        return [WHOLE] * len(given)
    if node.op == "element":
        count = node.name.count("{}")
        return [WHOLE] * count + [found[node]] * (len(given) - count)
    if node.op in EQUALITIES:
        enumerations = [kind for kind in given if isinstance(kind, tuple)]
        if not enumerations and {*given} not in ({WHOLE}, {CONDITION}):
            what = "compares whole numbers, conditions and enumerations"
            raise ExpressionError(node.column, f"{node.op!r} {what}, not {given[0]} and {given[1]}")
        return [enumerations[0] if enumerations else given[0]] * 2
    return [NUMBER] * len(given)


def _check(node: Node, found: Kind, needed: Kind) -> None:
    if found == needed or (found, needed) == (WHOLE, NUMBER):
        return
    if found == TEXT and (node.op == "if" or node.name in needed) and isinstance(needed, tuple):
        return
    constants = {
        "number": "the number",
        "unit": "the number",
        "literal": "true" if node.value else "false",
    }
    what = shown_text(node.name) if node.op == "text" else node.name * (node.op != "unit")
    what = what or constants.get(node.op, repr(node.function or node.op))
    wanted, given = (
        kind if isinstance(kind, str) else f"one of {', '.join(map(shown_text, kind))}"
        for kind in (needed, found)
    )
    hint = KIND_HINTS.get((wanted, given), "")
    raise ExpressionError(node.column, f"expected {wanted}, {what} gives {given}{hint}")
