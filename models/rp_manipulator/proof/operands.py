"""Operands for single operations of `prove`, and what its answers have to satisfy."""

import math
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

Parts = tuple[float, float, float]  # hi, lo, radius
Range = tuple[Fraction, Fraction]  # least and largest value

LOOSE = Fraction(1, 2**40)  # relative: by which a radius may exceed the least one
ROUNDING = Fraction(1, 2**97)  # of the largest operand or result
SMALLEST = Fraction(1, 2**880)
# the first ball of each operation's result in an answer, which has those of all operations
PLACES = {
    "sum": 0, "difference": 1, "product": 2, "quotient": 3, "convolution": 4, "widened": 5,
    "scaled": 6, "between": 7, "bounds": 8, "sine": 9, "versine": 11,
}  # fmt: skip


class WrongAnswer(Exception):
    """An operation whose result is not what it has to be."""


@dataclass(frozen=True)
class Question:
    """A line for `prove --operations`, and a check of its answer."""

    name: str  # of the operation
    line: str  # number of operands, and operands
    # raises WrongAnswer; gets the numbers of two balls, from the operation's result on
    check: Callable[[Sequence[float]], None]


# ---- Operands ------------------------------------------------------------------------------------
def number(draw: random.Random, exponents: int = 30) -> float:
    """Return a double of any digits, or a round one."""
    kind = draw.random()
    if kind < 0.2:
        return draw.choice((-1, 1)) * draw.choice((0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 10.0, 1024.0))
    size = math.ldexp(draw.uniform(0.5, 1.0), draw.randint(-exponents, exponents))
    return draw.choice((-1, 1)) * size


def operand(draw: random.Random, exponents: int = 30) -> Parts:
    """A double or double-double; without radius, or with one from tiny to larger than itself."""
    hi = number(draw, exponents)
    half = math.ulp(hi) / 2
    lo = draw.choice((0.0, half, -half / 2, half * draw.uniform(-1, 1)))
    if hi + lo != hi:
        lo = 0.0
    sizes = (0.0, 0.0, math.ldexp(abs(hi), -draw.randint(90, 106)), draw.random() * abs(hi), 2.0)
    return hi, lo, draw.choice(sizes) * draw.uniform(0.5, 1.0)


def range_of(x: Parts) -> Range:
    middle = Fraction(x[0]) + Fraction(x[1])
    return middle - Fraction(x[2]), middle + Fraction(x[2])


def ask(name: str, operands: Sequence[Parts], check: Callable[[Sequence[float]], None]) -> Question:
    """A question about an operation on some operands."""
    given = [*operands, (0.0, 0.0, 0.0)] if len(operands) == 1 else operands
    parts = (float(part).hex() for one in given for part in one)
    return Question(name, " ".join((str(len(given)), *parts)), check)


# ---- What answers have to satisfy ----------------------------------------------------------------
def balls(answer: Sequence[float]) -> list[Parts]:
    found = [tuple(answer[i : i + 3]) for i in range(0, len(answer), 3)]
    return [(hi, lo, radius) for hi, lo, radius in found]


def is_finite(x: Parts) -> bool:
    return all(map(math.isfinite, x))


def contains(answer: Parts, expected: Range, size: Fraction) -> None:
    """The answer contains a range, and is hardly larger; `size` is that of the operands."""
    if not is_finite(answer):
        raise WrongAnswer(f"is not finite: {answer}")
    least, largest = range_of(answer)
    if not (least <= expected[0] and expected[1] <= largest):
        raise WrongAnswer(f"{answer} does not contain {tuple(map(float, expected))}")
    half = max(expected[1] - least, largest - expected[0]) / 2
    if Fraction(answer[2]) > half * (1 + LOOSE) * 2 + size * ROUNDING + SMALLEST:
        raise WrongAnswer(f"{answer} is too large")
    if abs(answer[1]) > math.ulp(answer[0]) / 2:
        raise WrongAnswer(f"{answer}: the parts overlap")


def products(x: Parts, y: Parts) -> Range:
    corners = [a * b for a in range_of(x) for b in range_of(y)]
    return min(corners), max(corners)


def largest(x: Parts) -> Fraction:
    return max(map(abs, range_of(x)))
