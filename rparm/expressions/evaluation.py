"""Values of expressions."""

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from rparm.expressions.kinds import check_kinds
from rparm.expressions.parser import parse
from rparm.expressions.tree import FUNCTIONS, Node, names

LONGEST = 1000  # characters
OPERATIONS: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": math.pow,
    "negative": operator.neg,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
}
BUILT_IN = {"abs": abs, "min": min, "max": max}
OPERATIONS |= {name: BUILT_IN.get(name) or getattr(math, name) for name in FUNCTIONS}


@dataclass(frozen=True)
class Expression:
    """A number that follows from others. A name may have dots: ``component.variable``."""

    text: str
    tree: Node

    @cached_property
    def names(self) -> frozenset[str]:
        """What must be known for its value."""
        return names(self.tree)

    def value(self, values: Mapping[str, float]) -> float:
        """The number for the values of the names.

        ArithmeticError, ValueError if it is not defined or too large.
        """
        result = evaluated(self.tree, values)
        if not math.isfinite(result):
            raise ValueError("is not a finite number")
        return result


def parsed(text: str) -> Expression:
    """Expression that a text writes; ValueError says what is wrong with it."""
    if len(text) > LONGEST:
        raise ValueError(f"has more than {LONGEST} characters")
    tree = parse(text)
    check_kinds(tree)
    return Expression(text, tree)


def evaluated(root: Node, values: Mapping[str, float]) -> float:
    """Value of a tree whose kinds are right; a branch that is not taken need not have one.

    ArithmeticError, ValueError if it has none.
    """
    known: dict[Node, float] = {}
    todo = [root]
    while todo:
        node = todo[-1]
        needed = node.arguments
        if node.op == "if" and needed[0] in known:
            needed = (needed[0], needed[1] if known[needed[0]] else needed[2])
        elif node.op == "if":
            needed = needed[:1]
        left = [argument for argument in needed if argument not in known]
        if left:
            todo += left
            continue
        if node.op == "if":
            known[node] = known[needed[1]]
        else:
            known[node] = _operation(node, [known[argument] for argument in needed], values)
        todo.pop()
    return known[root]


def _operation(node: Node, arguments: list[float], values: Mapping[str, float]) -> float:
    if node.op == "number":
        return node.value
    if node.op == "name":
        return math.pi if node.name == "pi" else values[node.name]
    return OPERATIONS[node.op](*arguments)
