"""Inputs as functions of time, as scenarios give them.

`values` are those at times in s after the start, (n,).
"""

from dataclasses import dataclass

import numpy as np

EARLY = 1e-9  # s; a communication point that rounding puts this little before a switch is at it


@dataclass(frozen=True)
class Constant:
    """The same value at all times."""

    value: float

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        return np.full(len(elapsed), self.value)


@dataclass(frozen=True)
class Sines:
    """A smooth signal: offset + sum of amplitude sin(2 pi frequency t + phase)."""

    offset: float
    terms: tuple[tuple[float, float, float], ...]  # amplitude, frequency (Hz), phase (rad)

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        # numpy's sine of doubles depends on the processor; that of long doubles, rounded, does not
        t = elapsed.astype(np.longdouble)
        total = np.full(len(t), self.offset, t.dtype)
        for amplitude, frequency, phase in self.terms:
            total += amplitude * np.sin(2 * np.pi * frequency * t + phase)
        return total.astype(np.float64)

    def derivative(self, elapsed: np.ndarray, order: int) -> np.ndarray:
        """Derivative of an order at `elapsed` seconds after the start, (n,); order 0: the value.

        Exact but for one rounding, unlike `values`, whose pi is a double: what the exact final
        states of the convergence problems are compared with.
        """
        pi = np.arctan2(np.longdouble(0), np.longdouble(-1))
        t = np.asarray(elapsed, dtype=np.longdouble)
        total = np.full(t.shape, self.offset if order == 0 else 0.0, t.dtype)
        for amplitude, frequency, phase in self.terms:
            omega = 2 * pi * np.longdouble(frequency)
            total += amplitude * omega**order * np.sin(omega * t + phase + order * pi / 2)
        return total.astype(np.float64)


@dataclass(frozen=True)
class Table:
    """Linear between points, constant before the first and after the last."""

    points: tuple[tuple[float, float], ...]  # s since the start, value; in order of time

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        times, values = np.array(self.points).T
        return np.interp(elapsed, times, values)


@dataclass(frozen=True)
class Switches:
    """True or false from each time on, and before the first one as there."""

    points: tuple[tuple[float, bool], ...]  # s since the start, value; in order of time

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        times, values = zip(*self.points, strict=True)
        rows = np.searchsorted(times, elapsed + EARLY, side="right") - 1
        return np.array(values)[np.maximum(rows, 0)]


@dataclass(frozen=True, eq=False)
class Logged:
    """A column of a log: linear between its rows, or with zero-order hold."""

    times: np.ndarray  # (rows,) s since the start, in order
    numbers: np.ndarray  # (rows,) values; Booleans of a Boolean input
    is_held: bool
    source: str  # file and column

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        if self.is_held:
            rows = np.searchsorted(self.times, elapsed + EARLY, side="right") - 1
            return self.numbers[np.maximum(rows, 0)]
        return np.interp(elapsed, self.times, self.numbers)

    def covers(self, elapsed: np.ndarray) -> np.ndarray:
        """Which of the times are within the log, (n,)."""
        return (self.times[0] - EARLY <= elapsed) & (elapsed <= self.times[-1] + EARLY)


Signal = Constant | Sines | Table | Switches | Logged
