"""Whether each part of an expression is a number or a condition, as its operator needs it."""

from collections.abc import Collection

from rparm.expressions.tree import RELATIONS, ExpressionError, Node, in_order

NUMBER, CONDITION = "a number", "a condition"
LOGIC = ("and", "or", "not")


def check_kinds(root: Node, expected: str = NUMBER, conditions: Collection[str] = ()) -> None:
    """Raise ExpressionError where a part is of the wrong kind.

    Parameters
    ----------
    expected : str
        `NUMBER` or `CONDITION`: kind of the whole.
    conditions : collection of str
        Names of Booleans; all others are numbers.
    """
    for node in in_order([root]):
        for number, argument in enumerate(node.arguments):
            is_condition = node.op in LOGIC or (node.op == "if" and number == 0)
            _check(argument, CONDITION if is_condition else NUMBER, conditions)
    _check(root, expected, conditions)


def _check(node: Node, expected: str, conditions: Collection[str]) -> None:
    is_condition = node.op in (*LOGIC, *RELATIONS) or (
        node.op == "name" and node.name in conditions
    )
    found = CONDITION if is_condition else NUMBER
    if found != expected:
        what = node.name or ("the number" if node.op == "number" else repr(node.op))
        raise ExpressionError(node.column, f"expected {expected}, {what} gives {found}")
