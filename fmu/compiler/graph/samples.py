"""Values with numbers in the place of their leaves: whether two are equal, as samples show it."""

from __future__ import annotations

import math
import operator
import zlib
from fractions import Fraction
from typing import TYPE_CHECKING

from ..expressions.expression import in_order

if TYPE_CHECKING:
    from .graph import Value

SAMPLES = 8
CALCULATED = {
    **dict(zip("+-*/", (operator.add, operator.sub, operator.mul, operator.truediv), strict=True)),
    **dict(
        zip(
            ("<", "<=", ">", ">=", "=="),
            (operator.lt, operator.le, operator.gt, operator.ge, operator.eq),
            strict=True,
        )
    ),
    "negative": operator.neg,
    "not": operator.not_,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "if": lambda condition, a, b: a if condition else b,
}


def exact(factor: Value) -> Fraction:
    """Return a factor as an exact number, with any number for each leaf."""
    if factor.op == "number":
        return Fraction(factor.number)
    given = [exact(argument) for argument in factor.arguments]
    match factor.op:
        case "+":
            return given[0] + given[1]
        case "-":
            return given[0] - given[1]
        case "*":
            return given[0] * given[1]
        case "/" if given[1]:
            return given[0] / given[1]
        case "negative":
            return -given[0]
    text = f"{factor.op} {factor.name} {' '.join(map(str, given))}"
    return Fraction(1 + zlib.crc32(text.encode()), 2**30)


def are_equal(a: Value, b: Value) -> bool:
    """Return whether two values are equal wherever their leaves are, as far as samples show it."""
    if a is b:
        return True
    for sample in range(SAMPLES):
        found: dict[Value, float] = {}
        for value in in_order([a, b]):
            given = [found[argument] for argument in value.arguments]
            try:
                found[value] = _at(value, given, sample)
            except (ArithmeticError, ValueError):
                found[value] = math.nan
            except KeyError:  # tables and systems
                return False
        x, y = found[a], found[b]
        if math.isfinite(x) and math.isfinite(y) and abs(x - y) > 1e-9 * (abs(x) + abs(y)):
            return False
    return True


def _at(value: Value, given: list[float], sample: int) -> float:
    """Return a value from those of its arguments, of a leaf one that its name gives."""
    if value.op in CALCULATED:
        return CALCULATED[value.op](*given)
    if value.op == "number":
        return value.number
    if value.arguments:
        return getattr(math, value.op)(*given) if hasattr(math, value.op) else {}[value.op]
    text = f"{sample} {value.op} {value.name}"
    return 1 + zlib.crc32(text.encode()) / 2**31 if value.op != "mode" else sample % 2
