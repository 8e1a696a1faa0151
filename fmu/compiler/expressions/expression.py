"""Expressions that users write: their tree, its text and its values.

Nothing of the text is ever executed as Python.
"""

import math
import operator
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from operator import attrgetter
from typing import Any, TypeVar

# functions, with the number of their arguments; None: two or more
FUNCTIONS: dict[str, int | None] = dict.fromkeys(
    ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"]
    + ["exp", "log", "sqrt", "abs"],
    1,
) | {"atan2": 2, "min": None, "max": None}
RANDOM = ("noise", "uniform")  # functions of whole numbers
RELATIONS = ("<", "<=", ">", ">=")
EQUALITIES = ("==", "!=")  # of what is counted or named
CONSTANTS = ("pi",)
MOST_OPERATIONS = 100_000  # that functions and sums make of an expression: they multiply
TOO_LARGE = f"functions and sums make more than {MOST_OPERATIONS} operations of this expression"
# functions over a range -> the operations that they are until `at_indexes` has replaced them
OVER_RANGES = {name: f"{name} over" for name in ("sum", "min", "max", "any", "all")}
DERIVATIVE = "der"  # of a state, in front of a bracket
PARTIAL = "partial"  # derivative of an expression by a name
SHOWN = 30  # characters of the text in a message
# how tightly operators bind
CONDITIONAL, OR, AND, NOT, RELATION, SUM, PRODUCT, SIGN, POWER = range(1, 10)
BINDING = {"if": CONDITIONAL, "or": OR, "and": AND, "+": SUM, "-": SUM, "*": PRODUCT, "/": PRODUCT}
BINDING |= {"**": POWER} | dict.fromkeys((*RELATIONS, *EQUALITIES), RELATION)
Item = TypeVar("Item", bound=Any)  # hashable; its `arguments` are of the same type
OPERATIONS: dict[str, Callable[..., float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": math.pow,
    "negative": operator.neg,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
    "unit": lambda a, *_: a,
}


def hypot(x: float, y: float) -> float:
    """Return the root of x**2 + y**2 with the bits of slopes_hypot (src/model/slopes.h)."""
    largest = max(abs(x), abs(y))
    scale = 2.0**600 if largest > 2.0**500 else 2.0**-600 if largest < 2.0**-500 else 1.0
    a, b = x / scale, y / scale
    return math.sqrt(a * a + b * b) * scale


BUILT_IN = {"abs": abs, "min": min, "max": max, "floor": math.floor, "hypot": hypot}
OPERATIONS |= {
    name: BUILT_IN.get(name) or getattr(math, name) for name in (*FUNCTIONS, "floor", "hypot")
}


class ExpressionError(ValueError):
    """A mistake in an expression, in one line that begins with the column (from 1)."""

    def __init__(self, column: int, text: str) -> None:
        super().__init__(f"column {column}: {text}")


@dataclass(frozen=True, eq=False, slots=True)
class Node:
    """An operation, a number or a name.

    op is "number" (then `value` counts), "literal" (a condition: whether `value` is 1), "name"
    (then `name`), "text" (`name`, an item of an enumeration), "table" (a look-up in the table
    `name`), "call" (of the function `name`), "unit" (its first argument, in the unit `name`), an
    operator of `RELATIONS` or `EQUALITIES`, + - * / **, "negative", "and", "or", "not", "if"
    (arguments: condition, value if true, otherwise), "floor", "hypot", `PARTIAL` (arguments: what
    is derived, by which name), or a name of `FUNCTIONS`. min and max have two arguments here.
    "element" of an array by indexes that follow from variables (arguments: the indexes; `name` has
    {} where they come; behind them, once `with_elements` has added them, the elements in `of`).
    Until `at_indexes` has replaced them: other elements, and `OVER_RANGES` of the `body` over the
    index `name` (arguments: first and last).
    `function`: of `FURTHER`, of whose expression it is. `of` of a "unit" that stands in the text:
    its exponents, in the order of `BASE`.
    """

    op: str
    column: int
    arguments: tuple["Node", ...] = ()
    value: float = 0.0
    name: str = ""
    body: "Node | None" = None
    function: str = ""
    of: tuple[tuple[int | Fraction, ...], ...] = ()


def in_order(
    roots: Iterable[Item],
    known: Container[Item] = (),
    read: Callable[[Item], Iterable[Item]] = attrgetter("arguments"),
) -> list[Item]:
    """List all below and with `roots` that are not `known`, each once after what it reads."""
    done: dict[Item, None] = {}
    todo = [root for root in roots if root not in known][::-1]
    while todo:
        left = [a for a in read(todo[-1]) if a not in done and a not in known]
        if left:
            todo += left[::-1]
        else:
            done.setdefault(todo.pop())
    return list(done)


def names(root: Node) -> frozenset[str]:
    """Return the names of variables in an expression."""
    found = {node.name for node in in_order([root]) if node.op == "name"}
    return frozenset(found.difference(CONSTANTS))


def written(root: Node) -> str:
    """Return the text of an expression, with the brackets that it needs."""
    found: dict[Node, tuple[str, int]] = {}  # with how tightly it binds
    for node in in_order([root]):
        own = {"negative": SIGN, "not": NOT, "if": CONDITIONAL, **BINDING}.get(node.op, POWER + 1)
        given = [found[argument] for argument in node.arguments]
        texts = [text for text, _ in given]
        inner = [  # from the left, operators of one kind need no brackets
            text if part > own or (part == own and i == 0 and own != POWER) else f"({text})"
            for i, (text, part) in enumerate(given)
        ]
        match node.op:
            case "number":
                text = f"{node.value:.12g}"
                text = text if float(text) == node.value else repr(node.value)
            case "literal":
                text = "true" if node.value else "false"
            case "name":
                text = node.name
            case "unit":
                text, own = given[0]
                text += node.name if node.of else ""
            case "negative" | "not":
                text = f"{'-' if node.op == 'negative' else 'not '}{inner[0]}"
            case "if":
                text = f"{inner[1]} if {inner[0]} else {texts[2]}"
            case "element":
                text = node.name.format(*texts)
            case op if op in BINDING:
                text = f" {op} ".join(inner)
            case op:
                text = f"{node.name if op in ('table', 'call') else op}({', '.join(texts)})"
        found[node] = text, own
    return found[root][0]


def constant(node: Node, value: float | bool) -> Node:
    """Return a number or a literal in the place of a node."""
    return Node("literal" if type(value) is bool else "number", node.column, value=float(value))


def with_names(root: Node, known: Mapping[str, Node], column: int = 0, function: str = "") -> Node:
    """Return an expression with others in the place of names; a column counts for all of it."""
    found: dict[Node, Node] = {}
    for node in in_order([root]):
        if node.op == "name" and node.name in known:
            found[node] = known[node.name]
        else:
            found[node] = replace(
                node,
                column=column or node.column,
                arguments=tuple(found[argument] for argument in node.arguments),
                function=function or node.function,
            )
    return found[root]


def shown_text(text: str) -> str:
    """Return a text as expressions have it."""
    return f'"{text:.{SHOWN}}"'


def derivative_of(state: str) -> str:
    """Return the name that expressions have for the derivative of a state."""
    return f"{DERIVATIVE}({state})"


def finite_number(given: Any) -> float:
    """Return `given` as a float; ValueError says what was expected if it is not a finite number."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise ValueError("expected a number")
    try:
        number = float(given)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("expected a finite number")
    return number


# ---- Values --------------------------------------------------------------------------------------
def evaluated(root: Node, values: Mapping[str, float]) -> float:
    """Evaluate a tree of right kinds, not its branches that are not taken; errors as in `value`."""
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
    if node.op == "literal":
        return node.value > 0.0
    if node.op == "name":
        return math.pi if node.name == "pi" else values[node.name]
    return OPERATIONS[node.op](*arguments)
