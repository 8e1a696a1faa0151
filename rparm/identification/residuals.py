"""Residuals of segments, and their derivatives by parameters and start states."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from rparm.errors import UserError
from rparm.identification.logs import Segment
from rparm.identification.parameters import DELAY, Parameters
from rparm.identification.simulator import Simulator

STEP, CENTRAL_STEP = 1e-6, 1e-5  # of differences, of the scale of what is changed
ROUNDING = 4 * np.finfo(float).eps  # of outputs, relative


@dataclass(frozen=True, eq=False)
class Linear:
    """Residuals of a segment, (rows,), linear in what is changed, at one point."""

    residuals: np.ndarray  # (rows,)
    by_states: np.ndarray  # (rows, states), of their scales
    by_parameters: np.ndarray  # (rows, parameters)

    @property
    def table(self) -> np.ndarray:
        """All columns: states, parameters, residuals."""
        return np.column_stack([self.by_states, self.by_parameters, self.residuals])


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be fitted.

    Numbers of a point are `z` (parameters,) and `x` (segments, states), states in their scales.
    """

    simulator: Simulator
    parameters: Parameters
    segments: Sequence[Segment]
    noise: np.ndarray  # (outputs,): one of a residual, in the outputs' units
    scales: np.ndarray  # (states,)
    delay: float = 0.0  # s, if it is not among the parameters

    def predicted(self, segment: Segment, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Outputs (rows, outputs) as they would be measured; UserError if the FMU fails."""
        values, delay = self.parameters.values(z), self.delay
        if DELAY in self.parameters.names:
            index = self.parameters.names.index(DELAY)
            values, delay = np.delete(values, index), values[index]
        outputs = self.simulator.run(segment, np.append(values, x * self.scales))
        return _late(segment.times, outputs, delay) if delay else outputs

    def residuals(self, segment: Segment, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Predicted minus measured, (rows that count * outputs,), row by row, in `noise`."""
        rows = segment.counts
        difference = self.predicted(segment, z, x)[rows] - segment.measured[rows]
        return (difference / self.noise).ravel()

    def misfit(self, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Root mean square (outputs,) of predicted minus measured, in the outputs' units."""

        def of(i: int) -> np.ndarray:
            left = self.residuals(self.segments[i], z, x[i]).reshape(-1, len(self.noise))
            return np.mean(left**2, axis=0)

        squares = self.simulator.map(of, range(len(self.segments)))
        return self.noise * np.sqrt(np.mean(squares, axis=0))

    def tried(self, z: np.ndarray, x: np.ndarray, before: np.ndarray) -> tuple[float, np.ndarray]:
        """Cost of a point, and the start states there, (segments, states).

        Where the FMU refuses a start state of `x`, what it takes of the step from `before` is left:
        a joint starts at a stop, for example. The cost is the sum of the squares of all residuals,
        infinite where nothing helps.
        """

        def of(i: int) -> tuple[float, np.ndarray]:
            for state in _shortened(x[i], before[i]):
                with suppress(UserError):
                    return float(np.sum(self.residuals(self.segments[i], z, state) ** 2)), state
            return np.inf, before[i]

        costs, states = zip(*self.simulator.map(of, range(len(self.segments))), strict=True)
        total = sum(costs)
        return (total if np.isfinite(total) else np.inf), np.array(states)

    def rounding(self) -> float:
        """Length of a column of central differences where there is no effect."""
        largest = np.abs(self.segments[0].measured[self.segments[0].counts]).max(axis=0)
        rows = sum(int(segment.counts.sum()) for segment in self.segments)
        digits = ROUNDING * np.linalg.norm(largest / self.noise)
        return float(digits * np.sqrt(rows) / CENTRAL_STEP)

    def linear(self, z: np.ndarray, x: np.ndarray, is_exact: bool = False) -> list[Linear]:
        """All segments, linear at a point.

        Parameters
        ----------
        is_exact : bool
            Whether differences are central: twice the runs, an error of the second order.
        """

        def of(i: int) -> Linear:
            return self._linear(self.segments[i], z, x[i], is_exact)

        return self.simulator.map(of, range(len(self.segments)))

    def _linear(self, segment: Segment, z: np.ndarray, x: np.ndarray, is_exact: bool) -> Linear:
        base = self.residuals(segment, z, x)
        size = CENTRAL_STEP if is_exact else STEP
        table = np.empty((len(base), len(x) + len(z)))
        for k in range(table.shape[1]):
            found = []  # differences forward and, where it is needed, backward
            for step in (size, -size):
                point = np.append(x, z)
                point[k] += step
                try:
                    moved = self.residuals(segment, point[len(x) :], point[: len(x)])
                except UserError:
                    continue  # a start beyond a limit, for example
                found.append((moved - base) / step)
                if not is_exact:
                    break
            if not found:
                raise UserError(f"{self.simulator.fmu.path}: runs on neither side of the solution")
            table[:, k] = np.mean(found, axis=0)
        return Linear(base, table[:, : len(x)], table[:, len(x) :])


def _shortened(new: np.ndarray, old: np.ndarray) -> Iterator[np.ndarray]:
    """A state (states,); if it is refused, without the step of one of them, then of all."""
    yield new
    for k in np.flatnonzero(new != old):
        yield np.where(np.arange(len(new)) == k, old, new)
    yield old


def _late(times: np.ndarray, values: np.ndarray, delay: float) -> np.ndarray:
    """Values (rows, outputs) that are seen `delay` s late."""
    return CubicSpline(times, values, axis=0)(times - delay)
