"""Roots that the search finds, against roots in (0, 1] by integers of any size."""

import os
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, nextafter
from pathlib import Path

import numpy as np
import pytest
from flint import ctx, fmpz_poly

from tests.support.paths import ROOT


@dataclass(frozen=True)
class Exact:
    """A polynomial with integer coefficients, those of powers of s from 0 on."""

    c: tuple[int, ...]

    @classmethod
    def of(cls, coefficients: Sequence[float]) -> "Exact":
        """Doubles times a power of 2."""
        ratios = [x.as_integer_ratio() for x in coefficients]
        common = max(below for _, below in ratios)
        return cls(tuple(above * (common // below) for above, below in ratios))

    def __call__(self, s: float) -> int:
        """Value at a double times a power of 2: it has the polynomial's sign."""
        above, below = s.as_integer_ratio()
        value, scale = 0, 1
        for c in reversed(self.c):
            value = value * above + c * scale
            scale *= below
        return value

    def size(self, s: float) -> float:
        """The value over the sum of the sizes of all terms."""
        terms = Exact(tuple(abs(c) for c in self.c))(s)
        return self(s) / terms if terms else 0.0

    def derivative(self) -> "Exact":
        return Exact(tuple(k * c for k, c in enumerate(self.c))[1:])


def isolate(p: Exact) -> list[tuple[float, float, float]]:
    """Real roots in (0, 1], and the ends of an interval about each with no other root in it.

    A root of any multiplicity is one; intervals are as long as 2 FAR, less beside others, 0 at 1.
    """
    with ctx.workprec(BITS):
        found = [root for root, _ in fmpz_poly([*p.c]).complex_roots() if root.imag == 0]
        roots = sorted(root.real for root in found if 0 < root.real < 1)
        gaps = [2 * FAR, *(b - a for a, b in pairwise(roots)), 2 * FAR]
        reach = [min(gap / 2, FAR) for gap in gaps]
        ends = [(max(x - reach[i], 0), x, min(x + reach[i + 1], 1)) for i, x in enumerate(roots)]
        isolated = [tuple(map(float, each)) for each in ends]
    return isolated + [(1.0, 1.0, 1.0)] * (sum(p.c) == 0)


LENGTH = 32
POLYNOMIALS = int(os.environ.get("ROOT_POLYNOMIALS", "7000"))  # long_random_roots has more
FALLS, RISES, TOUCHES = range(3)
U = 2.0**-53
BITS = 300  # more than tell the roots apart
FAR = 1e-6  # half of the longest interval about a root
KNOWN = 2.0**-94  # part of the sum of the sizes of all terms: a sign beyond it is known


@dataclass(frozen=True)
class Found:
    """What the search finds in a polynomial."""

    first: float
    roots: list[tuple[float, int]]  # s and kind


@pytest.fixture(scope="module")
def program() -> Path:
    default = ROOT / "build" / "RPManipulator.fmu"
    return Path(os.environ.get("RP_FMU", default)).parent / "tests" / "find_roots"


def find(program: Path, polynomials: list[np.ndarray]) -> list[Found]:
    """Call the search for each row of coefficients, with noise 0."""
    given = np.zeros((len(polynomials), 2 + LENGTH))
    for row, c in zip(given, polynomials, strict=True):
        row[0] = len(c) - 1
        row[2 : 2 + len(c)] = c
    done = subprocess.run([program], input=given.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(done.stdout).reshape(len(polynomials), 2 + 2 * LENGTH)
    return [
        Found(float(row[1]), [(float(s), int(k)) for s, k in row[2:].reshape(-1, 2)[: int(row[0])]])
        for row in found
    ]


# ---- Random polynomials --------------------------------------------------------------------------


def product(random: np.random.Generator, roots: np.ndarray, rest: int) -> np.ndarray:
    """Coefficients of a polynomial with these roots and a random factor of the degree rest."""
    factor = random.normal(size=rest + 1) * 10 ** (-random.uniform(0, 1) * np.arange(rest + 1))
    factor[0] = np.sign(factor[0]) * (np.sum(np.abs(factor[1:])) + random.uniform(0, 1))
    return np.polynomial.polynomial.polymul(np.polynomial.polynomial.polyfromroots(roots), factor)


def small(random: np.random.Generator, decades: float, count: int = 1) -> np.ndarray:
    """Numbers of both signs, down to 10^-decades."""
    return random.choice([-1, 1], count) * 10 ** -random.uniform(0, decades, count)


def smooth(random: np.random.Generator) -> np.ndarray:
    """As of an internal step: coefficients that fall, the first one too small or large enough."""
    degree = int(random.integers(1, 27))
    c = random.normal(size=degree + 1) * 10 ** (-random.uniform(0, 1.5) * np.arange(degree + 1))
    c[0] = small(random, 3)[0] * np.sum(np.abs(c[1:]))
    return c


def separate(random: np.random.Generator) -> np.ndarray:
    return product(random, random.uniform(-1, 2, random.integers(1, 9)), random.integers(0, 18))


def near_start(random: np.random.Generator) -> np.ndarray:
    return product(random, small(random, 13, random.integers(1, 4)), random.integers(0, 12))


def at_ends(random: np.random.Generator) -> np.ndarray:
    roots = np.concatenate((random.choice([0.0, 1.0], 2), 1 + small(random, 16, 2)))
    return product(random, roots[: random.integers(1, 5)], random.integers(0, 12))


def pair(random: np.random.Generator) -> np.ndarray:
    """A double root, or two roots close to each other, real or not."""
    middle, squared = random.uniform(0, 1), small(random, 20)[0]
    if random.integers(4) == 0:
        middle, squared = np.round(middle * 64) / 64, 0.0
    factor = [middle**2 + squared, -2 * middle, 1.0]
    others = product(random, random.uniform(-1, 2, random.integers(0, 4)), random.integers(0, 15))
    return np.polynomial.polynomial.polymul(factor, others)


def cluster(random: np.random.Generator) -> np.ndarray:
    roots = random.uniform(0, 1) + small(random, 8) * random.uniform(-1, 1, random.integers(3, 6))
    return product(random, roots, random.integers(0, 10))


def oscillating(random: np.random.Generator) -> np.ndarray:
    """Chebyshev polynomials of 2 s - 1 and their sums: up to 20 roots."""
    size = random.integers(2, 21)
    series = np.polynomial.Chebyshev(random.normal(size=size) * (np.arange(size) > size - 4))
    return series.convert(kind=np.polynomial.Polynomial, domain=[0, 1], window=[-1, 1]).coef


KINDS = (smooth, separate, near_start, at_ends, pair, cluster, oscillating)


def polynomials(count: int, seed: int) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [KINDS[i % len(KINDS)](random) for i in range(count)]


# ---- Comparison ----------------------------------------------------------------------------------


def rounding(c: np.ndarray) -> float:
    """What Horner's scheme rounds at most, as part of the sum of the sizes of all terms."""
    return (2 * len(c) + 2) * U


def is_near(x: float, roots: list[float]) -> bool:
    """A touch has few digits."""
    return any(abs(x - root) < 1e-4 for root in roots)


def wrong_roots(p: Exact, c: np.ndarray, found: Found) -> Iterator[str]:
    """Roots that are none, or not to the last bit."""
    s = [root for root, _ in found.roots]
    if s != sorted(set(s)) or any(not 0 < x <= 1 for x in s):
        yield "not in order"
    leading = next(x for x in c if x != 0)
    if found.first != (0 if leading < 0 else s[0] if s else inf):
        yield f"first root {found.first}"
    for root, kind in found.roots:
        if kind == TOUCHES:
            if abs(p.size(root)) > 1.01 * rounding(c):
                yield f"no touch at {root}"
        else:
            sign = 1 if kind == FALLS else -1
            if sign * p.size(nextafter(root, 0)) < -KNOWN or sign * p.size(root) > KNOWN:
                yield f"no change of sign at {root}"


def wrong_count(p: Exact, c: np.ndarray, found: Found) -> Iterator[str]:
    """Roots that are missing or invented: each is in one of the intervals."""
    left = [root for root, kind in found.roots if kind != TOUCHES]
    touches = [root for root, kind in found.roots if kind == TOUCHES]
    for low, _, high in isolate(p):
        here = [x for x in left if (low < x and nextafter(x, 0) < high) or low == x]
        if here:
            left.remove(here[0])
            continue
        # two within rounding
        for x in (low, high):
            if abs(p.size(x)) > 2 * rounding(c) and not is_near(x, touches):
                yield f"no root between {low} and {high}"
    if left:
        yield f"invented {left}"


def test_random_polynomials_have_their_exact_roots(program: Path) -> None:
    given = polynomials(POLYNOMIALS, seed=15)
    wrong = []
    for c, found in zip(given, find(program, given), strict=True):
        p = Exact.of(c)
        for mistake in (*wrong_roots(p, c, found), *wrong_count(p, c, found)):
            wrong.append((mistake, list(c), found))
    assert wrong == []


def test_extrema_within_rounding_are_roots(program: Path) -> None:
    random = np.random.default_rng(16)
    given = [pair(random) for _ in range(1500)]
    seen, missing = 0, []
    for c, found in zip(given, find(program, given), strict=True):
        p = Exact.of(c)
        slope = p.derivative()
        for _, s, _ in isolate(slope):
            if abs(p.size(s)) < 0.99 * rounding(c):
                seen += 1
                if not is_near(s, [root for root, _ in found.roots]):
                    missing.append((s, list(c), found))
    assert missing == []
    assert seen > 100
