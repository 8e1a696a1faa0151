"""Checks single operations of `prove` in rational numbers and in arb's intervals.

Operands are random, round, extreme, and such that many roundings go the same way. Each result has
to contain whatever follows from numbers in the operands, and be hardly larger than that.

    python check_operations.py PROGRAM
"""

import math
import random
import subprocess
import sys
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from pathlib import Path

import flint
from flint import arb

sys.path.insert(0, str(Path(__file__).resolve().parent))
from operands import (
    LOOSE,
    PLACES,
    Parts,
    Question,
    WrongAnswer,
    ask,
    balls,
    contains,
    is_finite,
    largest,
    number,
    operand,
    products,
    range_of,
)

BITS = 400
TERMS = 40  # of the longest convolution


# ---- Arithmetic ----------------------------------------------------------------------------------
def sums(draw: random.Random) -> Question:
    x, y = operand(draw), operand(draw)
    if draw.random() < 0.3:  # cancels, wholly or but for the last digits
        y = (-x[0], draw.choice((-1, 1)) * x[1], y[2])
        if draw.random() < 0.5:
            y = (math.nextafter(y[0], 0.0), 0.0, y[2])
    sign = draw.choice((1, -1))
    a, b = range_of(x), range_of(y)
    expected = (a[0] + b[0], a[1] + b[1]) if sign > 0 else (a[0] - b[1], a[1] - b[0])
    name = "sum" if sign > 0 else "difference"
    size = largest(x) + largest(y)
    return ask(name, (x, y), lambda z: contains(balls(z)[0], expected, size))


def product(draw: random.Random) -> Question:
    exponents = draw.choice((30, 30, 90))
    x, y = operand(draw, exponents), operand(draw, exponents)
    if draw.random() < 0.1:  # underflow
        x = tuple(math.ldexp(part, -500) for part in x)
        y = tuple(math.ldexp(part, -500) for part in y)
    expected = products(x, y)
    size = largest(x) * largest(y)
    return ask("product", (x, y), lambda z: contains(balls(z)[0], expected, size))


def quotient(draw: random.Random) -> Question:
    x, y = operand(draw), operand(draw)
    least, most = range_of(y)
    if least <= 0 <= most or abs(y[0]) * (1 - 2**-40) <= y[2]:

        def infinite(z: Sequence[float]) -> None:
            if is_finite(balls(z)[0]) and least <= 0 <= most:
                raise WrongAnswer(f"a finite quotient by {y}")

        return ask("quotient", (x, y), infinite)
    corners = [a / b for a in range_of(x) for b in (least, most)]
    expected = (min(corners), max(corners))
    size = largest(x) / min(abs(least), abs(most))

    def check(z: Sequence[float]) -> None:
        answer = balls(z)[0]
        # one bound serves both sides of a curved range: only containing is asked of wide ones
        narrow = y[2] <= abs(y[0]) * 2**-60 and x[2] <= abs(x[0])
        contains(answer, expected, size if narrow else Fraction(2) ** 200 * (size + 1))

    return ask("quotient", (x, y), check)


def convolution(draw: random.Random) -> Question:
    n = draw.choice((0, 1, 2, 7, 15, 16, 31, TERMS - 1))
    x = [operand(draw, draw.choice((2, 10))) for _ in range(n + 1)]
    y = [operand(draw, 2) for _ in range(n + 1)]
    if draw.random() < 0.5:
        x, y = [(a[0], a[1], 0.0) for a in x], [(b[0], b[1], 0.0) for b in y]
    return _convolution(x, y)


def one_sided_convolution(draw: random.Random) -> Question:
    """Terms chosen one by one such that the roundings of the lower sum add up."""
    high = low = 0.0
    exact = Fraction(0)
    x: list[Parts] = []
    y: list[Parts] = []
    for _ in range(TERMS):
        best = None
        for _ in range(60):
            a, b = draw.uniform(1, 2), draw.uniform(1, 2)
            term_error = Fraction(a) * Fraction(b) - Fraction(a * b)
            total = high + a * b
            sum_error = Fraction(high) + Fraction(a * b) - Fraction(total)
            term = float(sum_error) + float(term_error)
            lost = exact + sum_error + term_error - Fraction(low + term)
            if best is None or lost > best[0]:
                best = (lost, a, b, total, low + term, exact + sum_error + term_error)
        assert best is not None
        _, a, b, high, low, exact = best
        x.append((a, 0.0, 0.0))
        y.append((b, 0.0, 0.0))
    return _convolution(x, y[::-1])


def _convolution(x: Sequence[Parts], y: Sequence[Parts]) -> Question:
    terms = [products(a, b) for a, b in zip(x, reversed(y), strict=True)]
    expected = (sum(t[0] for t in terms), sum(t[1] for t in terms))
    size = sum((largest(a) * largest(b) for a, b in zip(x, reversed(y), strict=True)), Fraction(0))
    return ask("convolution", (*x, *y), lambda z: contains(balls(z)[0], expected, size))


def bounds(draw: random.Random) -> Question:
    x = operand(draw)

    def check(z: Sequence[float]) -> None:
        least, most = range_of(x)
        smallest = 0 if least <= 0 <= most else min(abs(least), abs(most))
        low, high = Fraction(z[0]), Fraction(z[2])
        if not low <= smallest or not largest(x) <= high:
            raise WrongAnswer(f"{z[0]} to {z[2]} for {x}")
        if smallest > largest(x) * LOOSE and low < smallest * (1 - LOOSE) - largest(x) * LOOSE:
            raise WrongAnswer(f"{z[0]} is too small for {x}")

    return ask("bounds", [x], check)


def widened(draw: random.Random) -> Question:
    x, by = operand(draw), abs(number(draw))
    least, most = range_of(x)
    expected = (least - Fraction(by), most + Fraction(by))
    return ask("widened", (x, (by, 0, 0)), lambda z: contains(balls(z)[0], expected, Fraction(by)))


def scaled(draw: random.Random) -> Question:
    x, power = operand(draw), math.ldexp(1.0, draw.randint(-20, 20))
    if draw.random() < 0.2:
        x, power = tuple(math.ldexp(part, -1020) for part in x), 0.25
    a, b = range_of(x)
    expected = (a * Fraction(power), b * Fraction(power))
    return ask("scaled", (x, (power, 0, 0)), lambda z: contains(balls(z)[0], expected, largest(x)))


def between(draw: random.Random) -> Question:
    a, b = number(draw, 40), number(draw, 40)
    exact = Fraction(b) - Fraction(a)

    def check(z: Sequence[float]) -> None:
        if z[2] != 0 or Fraction(z[0]) + Fraction(z[1]) != exact:
            raise WrongAnswer(f"{z} for {b!r} - {a!r}")

    return ask("between", ((b, 0, 0), (-a, 0, 0)), check)


# ---- Functions -----------------------------------------------------------------------------------
def encloses(answer: Parts, value: arb, width: float, rounding: float = 2.0**-96) -> None:
    """The answer contains a value, and its radius is at most `width` but for rounding."""
    if not is_finite(answer):
        raise WrongAnswer(f"is not finite: {answer}")
    distance = abs(value - arb(answer[0]) - arb(answer[1]))
    if not distance <= arb(answer[2]):
        raise WrongAnswer(f"{answer} does not contain {value.str(40)}")
    if answer[2] > width * (1 + 2.0**-40) + rounding:
        raise WrongAnswer(f"{answer} is too large")


def points_of(x: Parts) -> list[arb]:
    middle = arb(x[0]) + arb(x[1])
    return [middle + arb(x[2]) * arb(share) for share in (-1, -0.5, 0, 0.75, 1)]


def sine(draw: random.Random) -> Question:
    hi = draw.choice((0.0, draw.uniform(-0.07, 0.07), draw.uniform(-7, 7), number(draw, 12)))
    radius = draw.choice((0.0, 0.0, 1e-30, draw.random()))
    x = (hi, math.ulp(hi) * draw.uniform(-0.5, 0.5), radius)
    size = max(abs(hi), 2.0**-4)

    def check(z: Sequence[float]) -> None:
        of_sine, of_cosine = balls(z)
        for point in points_of(x):
            # every doubling of the angle enlarges errors up to threefold
            encloses(of_sine, point.sin(), radius, 2.0**-96 * max(size, size * size))
            encloses(of_cosine, point.cos(), radius, 2.0**-96 * max(1.0, size * size))

    return ask("sine", [x], check)


def versine(draw: random.Random) -> Question:
    """1 - cos of a small angle, relative to its size."""
    x = (math.ldexp(draw.uniform(0.5, 1), -draw.choice((4, 4, 5, 6, 9))), 0.0, 0.0)

    def check(z: Sequence[float]) -> None:
        of_sine, of_versine = balls(z)
        encloses(of_sine, arb(x[0]).sin(), 0.0, 2.0**-96 * x[0])
        encloses(of_versine, 1 - arb(x[0]).cos(), 0.0, 2.0**-96 * x[0] * x[0])

    return ask("versine", [x], check)


# ---- All -----------------------------------------------------------------------------------------
# how many of each, per round
KINDS = {
    sums: 400, product: 400, quotient: 300, convolution: 120, one_sided_convolution: 2, bounds: 60,
    widened: 60, scaled: 60, between: 60, sine: 150, versine: 150,
}  # fmt: skip


@cache
def questions(seed: int, rounds: int) -> Sequence[Question]:
    draw = random.Random(seed)
    return [kind(draw) for kind, count in KINDS.items() for _ in range(count * rounds)]


def check(program: Path, rounds: int = 1, seed: int = 1) -> int:
    """Ask the program and check all answers; how many. WrongAnswer names the first wrong one."""
    precision, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        asked = questions(seed, rounds)
        lines = "".join(f"{question.line}\n" for question in asked)
        text = {"input": lines, "capture_output": True, "text": True, "encoding": "utf-8"}
        run = subprocess.run([program, "--operations"], timeout=60, **text)
        answers = run.stdout.splitlines()
        if run.returncode != 0 or len(answers) != len(asked):
            raise WrongAnswer(f"{len(answers)} answers to {len(asked)} questions: {run.stderr}")
        for question, answer in zip(asked, answers, strict=True):
            first = 1 + 3 * PLACES[question.name]
            words = answer.split()[first : first + 6]
            try:
                question.check([float.fromhex(word) for word in words])
            except (WrongAnswer, OverflowError, ValueError) as error:
                text = f"{question.name}: {error}; asked: {question.line[:400]}"
                raise WrongAnswer(text) from error
        return len(asked)
    finally:
        flint.ctx.prec = precision


if __name__ == "__main__":
    try:
        print(f"{check(Path(sys.argv[1]), *map(int, sys.argv[2:]))} operations confirmed")
    except WrongAnswer as error:
        sys.exit(f"not confirmed: {error}")
