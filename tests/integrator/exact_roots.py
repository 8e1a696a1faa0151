"""Roots of polynomials in (0, 1] by integers of any size: nothing is rounded."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate


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
        """Value at a double times a power of 2: its sign is that of the polynomial."""
        above, below = s.as_integer_ratio()
        value, scale = 0, 1
        for c in reversed(self.c):
            value = value * above + c * scale
            scale *= below
        return value

    def sign(self, s: float) -> int:
        """-1, 0 or 1."""
        value = self(s)
        return (value > 0) - (value < 0)

    def size(self, s: float) -> float:
        """The value over the sum of the sizes of all terms."""
        terms = Exact(tuple(abs(c) for c in self.c))(s)
        return self(s) / terms if terms else 0.0

    def derivative(self) -> "Exact":
        return Exact(tuple(k * c for k, c in enumerate(self.c))[1:])

    def closer(self, low: float, high: float) -> float:
        """Where between two doubles the sign changes, to 10^-9."""
        before = self.sign(low) or -self.sign(high)
        while high - low > 1e-9:
            middle = (low + high) / 2
            if self.sign(middle) == before:
                low = middle
            else:
                high = middle
        return high


def changes(c: Sequence[int]) -> int:
    """How often the coefficients of s^k (1 - s)^(n - k) change their sign."""
    row, ends = list(c), []
    while row:
        row = list(accumulate(row))
        ends.append(row.pop())
    signs = [end > 0 for end in ends if end]
    return sum(a != b for a, b in zip(signs, signs[1:], strict=False))


def right_half(c: Sequence[int]) -> list[int]:
    """p(s + 1)."""
    row, shifted = list(reversed(c)), []
    while row:
        row = list(accumulate(row))
        shifted.append(row.pop())
    return shifted


def isolate(p: Exact, deepest: int = 120) -> list[tuple[float, float]]:
    """Intervals with one root each, in their order: open ones, or the root twice.

    Vincent, Collins and Akritas: halves are halved until Descartes' rule leaves one root or none.
    An interval of width 2^-deepest counts as a root, too: that of a multiple one.
    """
    found = []
    c = list(p.c)
    while c and c[0] == 0:
        c.pop(0)
    todo = [(c, 0, 0)]  # polynomial on (0, 1) for k 2^-depth + 2^-depth (0, 1)
    while todo:
        c, k, depth = todo.pop()
        most = changes(c)
        if most == 1 or (most > 1 and depth >= deepest):
            found.append((k / 2**depth, (k + 1) / 2**depth))
        elif most > 1:
            n = len(c) - 1
            left = [x << (n - i) for i, x in enumerate(c)]
            right = right_half(left)
            if right[0] == 0:
                found.append(((2 * k + 1) / 2 ** (depth + 1),) * 2)
            todo.append((left, 2 * k, depth + 1))
            todo.append((right, 2 * k + 1, depth + 1))
    if sum(p.c) == 0:
        found.append((1.0, 1.0))
    return sorted(found)
