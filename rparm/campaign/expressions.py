"""Values that follow from others, as a campaign's file writes them: "sqrt(2 * x / mass)"."""

import ast
import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass

FUNCTIONS = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "exp", "log")}
CONSTANTS = {"pi": math.pi}
OPERATORS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
LONGEST = 1000  # characters


@dataclass(frozen=True)
class Expression:
    """An expression of numbers, names, + - * / **, brackets and `FUNCTIONS`.

    A name may have dots: ``component.variable``.
    """

    text: str
    tree: ast.expr
    names: frozenset[str]

    def value(self, values: Mapping[str, float]) -> float:
        """The number for the values of the names.

        ArithmeticError, ValueError if it is not defined or too large.
        """
        result = _evaluated(self.tree, values)
        if isinstance(result, complex) or not math.isfinite(result):
            raise ValueError("is not a finite number")
        return result


def parsed(text: str) -> Expression:
    """Expression that a text writes; ValueError says what is wrong with it."""
    if len(text) > LONGEST:
        raise ValueError(f"has more than {LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError("is not an expression") from None
    return Expression(text, tree, frozenset(_names(tree)))


def _names(node: ast.expr) -> set[str]:
    """Names in a checked expression."""
    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            return set()
        case ast.Name() | ast.Attribute():
            name = _name(node)
            return set() if name in CONSTANTS else {name}
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            return _names(node.operand)
        case ast.BinOp() if type(node.op) in OPERATORS:
            return _names(node.left) | _names(node.right)
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            return _names(argument)
    known = ", ".join(FUNCTIONS)
    raise ValueError(f"{ast.unparse(node)!r}: expected numbers, names, + - * / ** and {known}")


def _name(node: ast.expr) -> str:
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        return f"{_name(node.value)}.{node.attr}"
    raise ValueError(f"{ast.unparse(node)!r} is no name")


def _evaluated(node: ast.expr, values: Mapping[str, float]) -> float:
    match node:
        case ast.Constant():
            return float(node.value)
        case ast.UnaryOp():
            value = _evaluated(node.operand, values)
            return -value if isinstance(node.op, ast.USub) else value
        case ast.BinOp():
            left, right = _evaluated(node.left, values), _evaluated(node.right, values)
            return OPERATORS[type(node.op)](left, right)
        case ast.Call(func=ast.Name(id=name)):
            return FUNCTIONS[name](_evaluated(node.args[0], values))
    name = _name(node)
    return CONSTANTS[name] if name in CONSTANTS else values[name]
