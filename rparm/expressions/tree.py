"""What an expression consists of, in the order of operations of its text."""

from collections.abc import Container, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

# functions, with the number of their arguments; None: two or more
FUNCTIONS: dict[str, int | None] = dict.fromkeys(
    ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
    + ["exp", "log", "sqrt", "abs"],
    1,
) | {"atan2": 2, "min": None, "max": None}
RELATIONS = ("<", "<=", ">", ">=")
CONSTANTS = ("pi",)
# what cannot be a name: operators, and words that other languages execute or give a value
WORDS = ("and", "or", "not", "if", "else")
NO_NAMES = (*WORDS, "True", "False", "None", "lambda")


Item = TypeVar("Item", bound=Any)  # hashable, with `arguments` of its own kind


class ExpressionError(ValueError):
    """What is wrong with an expression, in one line that begins with the column (from 1)."""

    def __init__(self, column: int, text: str) -> None:
        super().__init__(f"column {column}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class Node:
    """An operation, a number or a name.

    op is "number" (then `value` counts), "name" (then `name`), an operator of `RELATIONS`, + - * /
    **, "negative", "and", "or", "not", "if" (arguments: condition, value if true, otherwise), or a
    name of `FUNCTIONS`. min and max have two arguments here.
    """

    op: str
    column: int
    arguments: tuple["Node", ...] = ()
    value: float = 0.0
    name: str = ""


def in_order(roots: Iterable[Item], known: Container[Item] = ()) -> list[Item]:
    """All below and with `roots` that are not `known`, each once, arguments first."""
    done: dict[Item, None] = {}
    todo = [root for root in roots if root not in known][::-1]
    while todo:
        left = [a for a in todo[-1].arguments if a not in done and a not in known]
        if left:
            todo += left[::-1]
        else:
            done.setdefault(todo.pop())
    return list(done)


def names(root: Node) -> frozenset[str]:
    """Names of variables in an expression."""
    found = {node.name for node in in_order([root]) if node.op == "name"}
    return frozenset(found.difference(CONSTANTS))
