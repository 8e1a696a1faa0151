"""Indexes in expressions: elements of arrays, sums and the like, conditions on indexes."""

import math
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce

from ..units import parsed
from .expression import (
    MOST_OPERATIONS,
    OPERATIONS,
    OVER_RANGES,
    TOO_LARGE,
    ExpressionError,
    Node,
    constant,
    evaluated,
    in_order,
    names,
    written,
)
from .hints import OF_NUMBERS

# operations over a range -> those of two terms, and their value without any
TERMS: dict[str, tuple[str, float | bool | None]] = {
    OVER_RANGES["sum"]: ("+", 0.0),
    OVER_RANGES["min"]: ("min", None),
    OVER_RANGES["max"]: ("max", None),
    OVER_RANGES["any"]: ("or", False),
    OVER_RANGES["all"]: ("and", True),
}


@dataclass(frozen=True)
class Range:
    """An index with its first and last value."""

    index: str
    first: Node
    last: Node

    def values(self, indexes: Mapping[str, int]) -> range:
        """Return its values; `indexes`: sizes and other indexes."""
        first, last = (_index(at_indexes(node, indexes)) for node in (self.first, self.last))
        if last - first >= MOST_OPERATIONS:
            raise ExpressionError(self.last.column, f"more than {MOST_OPERATIONS} values")
        return range(first, last + 1)


def at_indexes(root: Node, indexes: Mapping[str, int], are_known: bool = True) -> Node:
    """Replace indexes by their values, elements by their names, and `OVER_RANGES` by terms.

    Conditions on indexes alone are decided. ExpressionError where an index is none; unless they
    `are_known`, elements stay whose indexes follow from variables.
    """
    return _AtIndexes(dict(indexes), are_known).of(root)


def with_elements(root: Node, elements: Mapping[str, Collection[tuple[int, ...]]]) -> Node:
    """Add their elements to the look-ups by indexes that follow from variables.

    elements: indexes of all elements, by the names of arrays. ExpressionError where there are none.
    """
    found: dict[Node, Node] = {}
    for node in in_order([root]):
        arguments = tuple(found[argument] for argument in node.arguments)
        new = node if arguments == node.arguments else replace(node, arguments=arguments)
        if node.op == "element":
            base = node.name.partition("[")[0]
            if base not in elements:
                text = f"there is no array {base}{_hint(arguments)}"
                raise ExpressionError(node.column, text)
            numbers = [*map(_number_of, arguments)]
            of = [
                at
                for at in elements[base]
                if len(at) == len(numbers)
                and all(n in (None, i) for n, i in zip(numbers, at, strict=True))
            ]
            if not of:
                raise ExpressionError(node.column, f"there is no {base} with such indexes")
            names = (f"{base}[{','.join(map(str, at))}]" for at in of)
            own = tuple(Node("name", node.column, name=name) for name in names)
            new = replace(node, arguments=arguments + own, of=tuple(of))
        found[node] = new
    return found[root]


def _hint(indexes: Iterable[Node]) -> str:
    """Say what has a unit, if these indexes are one."""
    with suppress(ValueError):
        parsed(",".join(map(written, indexes)).replace(" ", ""))
        return f": {OF_NUMBERS}"
    return ""


def _number_of(index: Node) -> int | None:
    """Return the value of an index; None if it follows from variables."""
    return None if names(index) else _index(index)


class _AtIndexes:
    def __init__(self, indexes: dict[str, int], are_known: bool) -> None:
        self.indexes, self.are_known = indexes, are_known
        self.count = 0  # of operations

    def of(self, root: Node) -> Node:
        found: dict[Node, Node] = {}
        decided: set[Node] = set()  # by indexes and numbers
        fixed: set[Node] = set()  # by numbers
        nodes = in_order([root])
        self.count += len(nodes)
        if self.count > MOST_OPERATIONS:
            raise ExpressionError(root.column, TOO_LARGE)
        for node in nodes:
            given = tuple(found[argument] for argument in node.arguments)
            new = node if given == node.arguments else replace(node, arguments=given)
            if node.op == "name" and node.name in self.indexes:
                new = constant(node, self.indexes[node.name])
                decided.add(new)
            elif node.op in ("number", "literal"):
                fixed.add(new)
            elif node.op == "unit" and node.of:
                pass  # what it is in would be lost
            elif node.op == "element" and not self.are_known and any(map(names, given)):
                pass  # of variables
            elif node.op == "element":
                name = node.name.format(*map(_index, given))
                new = Node("name", node.column, name=name)
            elif node.op in TERMS:
                new = self.of_terms(node, given)
            elif node.op in ("if", "and", "or") and decided.intersection(given):
                new = _decided(new, decided)
            elif node.op in OPERATIONS and {*given} <= fixed:
                fixed.add(new)
            elif node.op in OPERATIONS and {*given} <= fixed | decided:
                with suppress(ArithmeticError, ValueError):
                    new = constant(node, evaluated(new, {}))
                    decided.add(new)
            found[node] = new
        return found[root]

    def of_terms(self, node: Node, given: tuple[Node, ...]) -> Node:
        """Return the operation on all terms of a range, from the first on."""
        op, of_none = TERMS[node.op]
        if node.name in self.indexes:
            raise ExpressionError(node.column, f"index {node.name!r} has a meaning already")
        terms = []
        for value in Range(node.name, *given).values({}):
            self.indexes[node.name] = value
            terms.append(self.of(node.body))
        self.indexes.pop(node.name, None)
        if not terms and of_none is None:
            raise ExpressionError(node.column, f"{op}: the range is empty")
        if not terms:
            return constant(node, of_none)
        if op == "+":
            return reduce(lambda a, b: Node(op, node.column, (a, b)), terms)
        while len(terms) > 1:  # a tree of few levels
            pairs = zip(terms[::2], terms[1::2], strict=False)
            last = terms[-1:] if len(terms) % 2 else []
            terms = [Node(op, node.column, pair) for pair in pairs] + last
        return terms[0]


def _decided(node: Node, decided: Collection[Node]) -> Node:
    """Return the part of an operation that counts, where a condition is decided."""
    first, second, *_ = node.arguments
    if node.op == "if":
        chosen = node.arguments[1 if first.value else 2]
        return chosen if first in decided else node
    rest, known = (second, first) if first in decided else (first, second)
    return rest if known.value == (node.op == "and") else known


def _index(node: Node) -> int:
    """Return the value of an index; ExpressionError if it is not known or not whole."""
    unknown = names(node)
    if unknown:
        text = f"{min(unknown)!r} is no size and no index of for or sum"
        raise ExpressionError(node.column, text)
    try:
        has_unit = any(each.op == "unit" and each.of for each in in_order([node]))
        value = math.nan if has_unit else evaluated(node, {})
    except (KeyError, ArithmeticError, ValueError):
        value = math.nan
    if not math.isfinite(value) or value != int(value):
        raise ExpressionError(node.column, "expected a whole number as index")
    return int(value)
