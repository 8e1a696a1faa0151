"""The fit: parameters, a start state of each segment, intervals, and what cannot be known.

Parameters and start states are fitted by Levenberg and Marquardt's method. Segments share the
parameters only. So the equations of a step are an arrow: orthogonal transformations take the start
states out, segment by segment.

The classical covariance trusts that the residuals are white noise on the measured values. Where
inputs are noisy or the model is not quite right, the residuals of a segment belong together, and it
is too small. How much independent segments pull the parameters in different directions shows the
covariance whatever happens within them: the "sandwich" of robust statistics. As there are few
segments, it has the corrections that Bell and McCaffrey proposed (Survey Methodology 28, 2002): it
is unbiased for white noise, and each parameter has its own degrees of freedom.

The singular values of the residuals' derivatives show how many combinations of parameters have no
effect on the measured values. They are named by as few parameters as possible: sets of columns that
depend on each other, of which no column can be left out.
"""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.interpolate import CubicSpline

from rparm.errors import UserError
from rparm.identification import logs
from rparm.identification.logs import Segment
from rparm.identification.request import DELAY, Parameters
from rparm.identification.simulator import Simulator

STEP, CENTRAL_STEP = 1e-6, 1e-5  # of differences, relative to the scale of the changed number
ROUNDING = 4 * np.finfo(float).eps  # of outputs, relative
MOST_STEPS = 60
LONGEST = 1.0  # step of a parameter: e times its distance from a limit, or once its scale
FIRST_RIDGE, LEAST_RIDGE, MOST_RIDGE = 1e-3, 1e-10, 1e8
NEGLIGIBLE = 1e-3  # gain that a step may still have, in standard deviations squared
ROUGH = 0.01  # of the cost: gain of a step at which the first steps end
FLAT = 0.05  # of the cost: a smaller gain of a step ends the fit
SPREAD = 0.5  # of the parameters' numbers before all of a run is fitted
SHARES = tuple((2 / 3) ** k for k in range(12, 0, -1))  # of a run, that are fitted before all of it
UNKNOWN = 1e-6  # singular value of a direction that the fit cannot know
SMALLEST = 1e-3  # of the largest effect of a state: its weight in the ridge where it has none
LEVEL = 0.95
SUSPICIOUS = 1.5  # ratio of the standard deviations
SMALL = 1e-8  # of the largest singular value of the states' columns: such a state has no effect
FULL = 1 - 1e-9  # share of a segment in all knowledge: it cannot be checked by others
NOTHING = 3e-6  # singular value of columns of length 1; differences leave 1e-7 where there is none
COARSE = 1e-3  # the same at most, where rounding is seen
EQUAL = 1e-3  # of two effects a unit, so that a sum of parameters is known
MOST = 6  # parameters in a combination that is looked for
TAKES_PART = 1e-4  # weight of a column in a combination of columns of length 1
LAGS = 20
REJECTED = 0.01  # probability below which residuals are not taken for noise


# ---- Residuals -----------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Linear:
    """Residuals of a segment, (rows,), linear in the changes, at one point."""

    segment: Segment
    residuals: np.ndarray  # (rows,), one of each measured value that counts
    by_states: np.ndarray  # (rows, states), of their scales
    by_parameters: np.ndarray  # (rows, parameters)

    @property
    def table(self) -> np.ndarray:
        """All columns: states, parameters, residuals."""
        return np.column_stack([self.by_states, self.by_parameters, self.residuals])


@dataclass(frozen=True, eq=False)
class Problem:
    """Segments and parameters to fit; `x` (segments, states) are states in their scales."""

    simulator: Simulator
    parameters: Parameters
    segments: Sequence[Segment]
    noise: np.ndarray  # (outputs,): one of a residual, in the outputs' units
    scales: np.ndarray  # (states,)
    delay: float = 0.0  # s, if it is not among the parameters
    near: np.ndarray | None = None  # (parameters,): numbers that they stay near to, SPREAD away

    def values(self, z: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the values of the FMU's parameters, and the delay."""
        values = self.parameters.values(z)
        if DELAY not in self.parameters.names:
            return values, self.delay
        index = self.parameters.names.index(DELAY)
        return np.delete(values, index), float(values[index])

    def predicted(self, segment: Segment, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Predict the measured outputs (rows, outputs); UserError if the FMU fails."""
        values, delay = self.values(z)
        outputs = self.simulator.run(segment, np.append(values, x * self.scales))
        seen = CubicSpline(segment.times, outputs, axis=0) if delay else None  # late by it
        return outputs if seen is None else seen(segment.times - delay)

    def residuals(self, segment: Segment, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return predicted minus measured in `noise`, (values that count,), by rows."""
        difference = self.predicted(segment, z, x) - segment.measured
        return (difference / self.noise)[segment.counts]

    def _with_near(self, segment: Segment, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the residuals, and those of the parameters from where they stay near to."""
        left = self.residuals(segment, z, x)
        return left if self.near is None else np.append(left, (z - self.near) / SPREAD)

    def misfit(self, z: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return the RMS (outputs,) of predicted minus measured, in the outputs' units."""

        def of(i: int) -> np.ndarray:
            counts = self.segments[i].counts
            squares = np.zeros(counts.shape)
            squares[counts] = self.residuals(self.segments[i], z, x[i]) ** 2
            return squares.sum(axis=0)

        squares = sum(self.simulator.map(of, range(len(self.segments))))
        counts = sum(segment.counts.sum(axis=0) for segment in self.segments)
        return self.noise * np.sqrt(squares / np.maximum(counts, 1))

    def tried(self, z: np.ndarray, x: np.ndarray, before: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the cost of a point, and the start states there, (segments, states).

        Where the FMU refuses a start state of `x`, at a stop for example, the rest of the step from
        `before` is taken. The cost is the sum of the residuals' squares, inf where nothing helps.
        """

        def of(i: int) -> tuple[float, np.ndarray]:
            for state in _shortened(x[i], before[i]):
                with suppress(UserError):
                    return float(np.sum(self._with_near(self.segments[i], z, state) ** 2)), state
            return np.inf, before[i]

        costs, states = zip(*self.simulator.map(of, range(len(self.segments))), strict=True)
        total = sum(costs)
        return (total if np.isfinite(total) else np.inf), np.array(states)

    def rounding(self) -> float:
        """Return the length of a column of central differences where there is no effect."""
        sizes = [np.where(s.counts, np.abs(s.measured), 0.0).max(axis=0) for s in self.segments]
        largest = np.max(sizes, axis=0)
        rows = sum(segment.rows for segment in self.segments)
        digits = ROUNDING * np.linalg.norm(largest / self.noise)
        return float(digits * np.sqrt(rows) / CENTRAL_STEP)

    def linear(self, z: np.ndarray, x: np.ndarray, is_exact: bool = False) -> list[Linear]:
        """Return segments, linear at a point.

        `is_exact` takes central differences, which need more runs, where there are no gradients.
        """

        def of(i: int) -> Linear:
            return self._linear(self.segments[i], z, x[i], is_exact)

        return self.simulator.map(of, range(len(self.segments)))

    def _linear(self, segment: Segment, z: np.ndarray, x: np.ndarray, is_exact: bool) -> Linear:
        found = self._by_gradients(segment, z, x)
        base, table = self._by_differences(segment, z, x, is_exact) if found is None else found
        return Linear(segment, base, table[:, : len(x)], table[:, len(x) :])

    def _by_gradients(
        self, segment: Segment, z: np.ndarray, x: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Return residuals and derivatives (rows, states + parameters) of one run, if it has them.

        There are none where an event leaves the run without exact gradients.
        """
        values, delay = self.values(z)
        seen = self.simulator.run_with_gradients(segment, np.append(values, x * self.scales))
        if seen is None:
            return None
        if delay or DELAY in self.parameters.names:
            curve = CubicSpline(segment.times, seen, axis=0)
            seen, rates = curve(segment.times - delay), curve(segment.times - delay, 1)
        outputs, by_values, by_starts = np.split(seen, [1, 1 + len(values)], axis=2)
        if DELAY in self.parameters.names:
            index = self.parameters.names.index(DELAY)
            by_values = np.insert(by_values, index, -rates[..., 0], axis=2)
        by = np.dstack([by_starts * self.scales, by_values @ self.parameters.slopes(z)])
        base = ((outputs[..., 0] - segment.measured) / self.noise)[segment.counts]
        table = (by / self.noise[:, None])[segment.counts]
        if self.near is not None:
            base = np.append(base, (z - self.near) / SPREAD)
            table = np.vstack([table, np.eye(len(z), table.shape[1], len(x)) / SPREAD])
        return base, table

    def _by_differences(
        self, segment: Segment, z: np.ndarray, x: np.ndarray, is_exact: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return residuals and difference quotients (rows, states + parameters)."""
        base = self._with_near(segment, z, x)
        size = CENTRAL_STEP if is_exact else STEP
        table = np.empty((len(base), len(x) + len(z)))
        for k in range(table.shape[1]):
            found = []  # differences forward and, where it is needed, backward
            for step in (size, -size):
                point = np.append(x, z)
                point[k] += step
                try:
                    moved = self._with_near(segment, point[len(x) :], point[: len(x)])
                except UserError:
                    continue  # a start beyond a limit, for example
                found.append((moved - base) / step)
                if not is_exact:
                    break
            if not found:
                raise UserError(f"{self.simulator.fmu.path}: runs on neither side of the solution")
            table[:, k] = np.mean(found, axis=0)
        return base, table


def _shortened(new: np.ndarray, old: np.ndarray) -> Iterator[np.ndarray]:
    """Yield a state (states,), then without the step of one state, then of all."""
    yield new
    for k in np.flatnonzero(new != old):
        yield np.where(np.arange(len(new)) == k, old, new)
    yield old


# ---- The fit -------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Solution:
    """Result of a fit."""

    z: np.ndarray  # (parameters,)
    x: np.ndarray  # (segments, states), of their scales
    cost: float  # sum of the squares of the residuals
    steps: int
    has_converged: bool


def fit(problem: Problem, x: np.ndarray, z: np.ndarray) -> Solution:
    """Fit from the parameters `z` (parameters,) and the states `x` (segments, states).

    An output that is measured much more exactly than others would lead the first steps astray: at
    first each is weighted by how far it is off.
    """
    rough = replace(problem, noise=np.maximum(problem.noise, problem.misfit(z, x)))
    near = _descended(rough, z, x, ROUGH)
    found = _descended(problem, near.z, near.x)
    return replace(found, steps=near.steps + found.steps)


def fit_growing(problem: Problem, x: np.ndarray, z: np.ndarray) -> Solution:
    """Fit as `fit`, from the begin of the segments on: what a long run shows has many solutions.

    An oscillation that is a cycle ahead at its end looks right there. As a short run may tell
    little, parameters stay near their starts at first.
    """
    steps, near = 0, z
    for share in SHARES:
        shorter = [logs.begin(segment, share) for segment in problem.segments]
        found = fit(replace(problem, segments=shorter, near=near), x, z)
        x, z, steps = found.x, found.z, steps + found.steps
    found = fit(problem, x, z)
    return replace(found, steps=steps + found.steps)


def _descended(problem: Problem, z: np.ndarray, x: np.ndarray, enough: float = 0.0) -> Solution:
    """Step from a point until steps gain no more; or less than a share `enough` of the cost."""
    (cost, x), ridge = problem.tried(z, x, x), FIRST_RIDGE
    refused = np.zeros(x.shape)  # direction in which the FMU refuses a step of a state, or 0
    rows = max(sum(int(s.counts.sum()) for s in problem.segments), 1)
    for step in range(MOST_STEPS):
        arrow = _Arrow(problem.linear(z, x), refused)
        if arrow.gain() <= NEGLIGIBLE * cost / rows:
            return Solution(z, x, cost, step, True)
        while True:
            to_x, to_z = arrow.step(ridge)
            to_z *= LONGEST / max(LONGEST, np.abs(to_z).max(initial=0.0))
            new_z = problem.parameters.kept(z + to_z)
            new_cost, new_x = problem.tried(new_z, x + to_x, x)
            refused = np.where((new_x == x) & (to_x != 0), np.sign(to_x), arrow.refused)
            if new_cost < cost:
                break
            if ridge > MOST_RIDGE:  # nothing is to be gained
                return Solution(z, x, cost, step, arrow.gain() < rows * 1e-6 * cost)
            ridge *= 10
        gained, z, x, cost = cost - new_cost, new_z, new_x, new_cost
        ridge = max(ridge / 10, LEAST_RIDGE)
        if gained < max(FLAT / rows, enough) * cost:
            return Solution(z, x, cost, step + 1, True)
    return Solution(z, x, cost, MOST_STEPS, False)


class _Arrow:
    """The linear least squares problem of a step, each segment as a triangle."""

    def __init__(self, linear: Sequence[Linear], refused: np.ndarray) -> None:
        self.states = linear[0].by_states.shape[1]
        # a state stays where it is if it would again go where the FMU refuses it
        downhill = -np.array([each.by_states.T @ each.residuals for each in linear])
        self.refused = np.where(downhill * refused > 0, refused, 0.0)
        tables = [each.table for each in linear]
        for table, held in zip(tables, self.refused != 0, strict=True):
            table[:, : self.states][:, held] = 0.0
        self.triangles = np.stack([np.linalg.qr(table, mode="r") for table in tables])
        squares = np.sum(self.triangles**2, axis=1)  # (segments, columns)
        of_states = squares[:, : self.states]
        least = SMALLEST**2 * of_states.max(axis=0)
        self.state_weights = np.sqrt(np.maximum(of_states, np.where(least > 0, least, 1.0)))
        of_parameters = squares[:, self.states : -1].sum(axis=0)
        self.weights = np.sqrt(np.where(of_parameters > 0, of_parameters, 1.0))

    def _eliminated(self, ridge: float) -> tuple[np.ndarray, np.ndarray]:
        """Return triangles with damped states, and what they leave: rows (n, parameters + 1)."""
        n, (count, _, columns) = self.states, self.triangles.shape
        damped = np.zeros((count, n, columns))
        damped[:, range(n), range(n)] = np.sqrt(ridge) * self.state_weights
        triangles = np.linalg.qr(np.concatenate([self.triangles, damped], axis=1), mode="r")
        return triangles, triangles[:, n:, n:].reshape(-1, columns - n)

    def step(self, ridge: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the steps of states (segments, states) and parameters (parameters,)."""
        n = self.states
        triangles, rest = self._eliminated(ridge)
        damped = np.sqrt(ridge) * np.diag(self.weights)
        rows = np.vstack([rest[:, :-1], damped])
        right = np.append(rest[:, -1], np.zeros(len(damped)))
        to_z = -np.linalg.lstsq(rows, right)[0] if len(damped) else np.empty(0)
        left = triangles[:, :n, -1] + triangles[:, :n, n:-1] @ to_z
        to_x = -np.linalg.solve(triangles[:, :n, :n], left[..., None])[..., 0]
        return to_x, to_z

    def gain(self) -> float:
        """Return by how much the cost would fall by a step without ridge, if all were linear."""
        n = self.states
        triangles, rest = self._eliminated(LEAST_RIDGE)
        left, values, _ = np.linalg.svd(rest[:, :-1] / self.weights, full_matrices=False)
        kept = left[:, values > UNKNOWN]
        return float(np.sum((kept.T @ rest[:, -1]) ** 2) + np.sum(triangles[:, :n, -1] ** 2))


# ---- Intervals -----------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Reduced:
    """A piece of a segment whose start state is as good as can be, whatever the parameters."""

    by_parameters: np.ndarray  # (rows, parameters)
    residuals: np.ndarray  # (rows,)
    basis: np.ndarray  # (rows, n): residuals that the states can explain, orthonormal in a segment
    outputs: np.ndarray  # (rows,): which output each residual is of


def reduced(linear: Linear) -> list[Reduced]:
    """Take the start state out of a segment's equations, and cut it into its pieces."""
    left, values, _ = np.linalg.svd(linear.by_states, full_matrices=False)
    basis = left[:, values > SMALL * max(values.max(initial=0.0), 1e-300)]
    rest, residuals = linear.by_parameters, linear.residuals
    rows, outputs = np.nonzero(linear.segment.counts)
    whole = rest - basis @ (basis.T @ rest), residuals - basis @ (basis.T @ residuals)
    cuts = np.searchsorted(rows, linear.segment.cuts)
    pieces = zip(*(np.split(each, cuts) for each in (*whole, basis, outputs)), strict=True)
    return [Reduced(*piece) for piece in pieces if len(piece[0])]


@dataclass(frozen=True, eq=False)
class Covariances:
    """Of the fit's numbers of the parameters that are known."""

    scatter: np.ndarray  # (known, known)
    classical: np.ndarray  # (known, known)
    degrees: np.ndarray  # (known,) of freedom, of the scatter; 0: there is one segment
    variance: float  # of the residuals, as multiples of their noise

    @property
    def ratio(self) -> float:
        """Ratio of the standard deviations, scatter to classical: root mean square of all."""
        ratios = np.diag(self.scatter) / np.diag(self.classical)
        return float(np.sqrt(ratios.mean())) if len(ratios) else 1.0

    @property
    def is_suspicious(self) -> bool:
        """Whether the classical intervals would be too small."""
        return self.ratio > SUSPICIOUS

    @property
    def halves(self) -> np.ndarray:
        """Half the width (known,) of the intervals by scatter."""
        factors = stats.t.ppf((1 + LEVEL) / 2, np.maximum(self.degrees, 1.0))
        return factors * np.sqrt(np.diag(self.scatter))

    @property
    def classical_halves(self) -> np.ndarray:
        """Half the width (known,) of the classical intervals."""
        return stats.norm.ppf((1 + LEVEL) / 2) * np.sqrt(np.diag(self.classical))


def covariances(segments: Sequence[Reduced], known: np.ndarray) -> Covariances:
    """Return the covariances of the parameters at the indices `known`, the others as given."""
    n = len(known)
    tables = [segment.by_parameters[:, known] for segment in segments]
    inverse = np.linalg.inv(sum(table.T @ table for table in tables)) if n else np.empty((0, 0))
    rows = sum(len(s.residuals) - float(np.sum(s.basis**2)) for s in segments) - n
    variance = sum(float(s.residuals @ s.residuals) for s in segments) / max(rows, 1)
    classical = variance * inverse
    if len(segments) < 2:
        return Covariances(classical, classical, np.zeros(n), variance)
    root = np.linalg.cholesky(inverse) if n else inverse  # inverse = root root'
    moves = np.empty((len(segments), n))
    norms = np.empty((len(segments), n))
    overlaps = np.empty((len(segments), n, n))
    for i, (segment, table) in enumerate(zip(segments, tables, strict=True)):
        # in coordinates where the sum of all shares is the unit matrix
        scaled = table @ root
        shares, axes = np.linalg.eigh(scaled.T @ scaled)
        shares = np.clip(shares, 0.0, FULL)
        weight = (axes / np.sqrt(1 - shares)) @ axes.T
        moves[i] = root @ weight @ scaled.T @ segment.residuals
        overlaps[i] = (axes * shares / np.sqrt(1 - shares)) @ axes.T @ root.T
        norms[i] = np.sum((root @ axes) ** 2 * shares / (1 - shares), axis=1)
    return Covariances(moves.T @ moves, classical, _degrees(norms, overlaps), variance)


def _degrees(norms: np.ndarray, overlaps: np.ndarray) -> np.ndarray:
    """Return degrees of freedom (known,): two moments are a chi-squared number's.

    `norms` (segments, known) are variances of the move by a segment, if segments were independent;
    `overlaps` (segments, known, known) what they share, the last axis is the parameter.
    """
    found = np.empty(norms.shape[1])
    for k in range(len(found)):
        shared = overlaps[:, :, k]
        matrix = np.diag(norms[:, k]) - shared @ shared.T
        found[k] = np.trace(matrix) ** 2 / np.sum(matrix**2)
    return found


# ---- Combinations without effect -----------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Combination:
    """Parameters of which the log shows the joint effect only, or one without effect."""

    names: tuple[str, ...]
    effects: np.ndarray | None  # (names,) of each a unit, relative: their sum is known; or None

    def __str__(self) -> str:
        if len(self.names) == 1:
            return f"{self.names[0]} has no effect"
        if self.effects is None:
            return f"{', '.join(self.names)} together"
        first, *others = self.names
        signs = [" + " if effect > 0 else " - " for effect in self.effects[1:]]
        return first + "".join(map("".join, zip(signs, others, strict=True)))


class Effects:
    """Effects (rows, parameters) on the residuals of numbers of order 1; some depend on others.

    A column without effect has a length up to `rounding`.
    """

    def __init__(self, effects: np.ndarray, rounding: float) -> None:
        self.table = np.linalg.qr(effects, mode="r")
        self.lengths = np.linalg.norm(self.table, axis=0)
        self.units = self.table / np.where(self.lengths > 0, self.lengths, 1.0)
        self.there = self.lengths > max(rounding, NOTHING * self.lengths.max(initial=0.0))
        self._rounding = rounding

    def depend(self, columns: Sequence[int]) -> bool:
        """Return whether columns depend on each other, to the precision that they have."""
        return self._smallest(self.units[:, columns]) <= self.precision(columns)

    def precision(self, columns: Sequence[int]) -> float:
        """Return the smallest singular value of columns of length 1 that is not rounding."""
        shortest = self.lengths[list(columns)].min(initial=np.inf)
        return min(max(NOTHING, self._rounding / max(shortest, 1e-300)), COARSE)

    @staticmethod
    def _smallest(table: np.ndarray) -> float:
        if table.shape[1] > table.shape[0]:
            return 0.0
        return float(np.linalg.svd(table, compute_uv=False)[-1])

    @property
    def basis(self) -> np.ndarray:
        """Indices of as many parameters as can be known if the others are."""
        found: list[int] = []
        # the strongest first: those with clear effects are chosen before weak ones
        for i in sorted(np.flatnonzero(self.there), key=lambda i: -self.lengths[i]):
            if not self.depend([*found, int(i)]):
                found.append(int(i))
        return np.array(sorted(found), int)


def combinations(effects: Effects, slopes: np.ndarray, names: Sequence[str]) -> list[Combination]:
    """Name what cannot be known; `slopes`: parameters' derivatives by the numbers of `effects`."""
    found = [Combination((names[i],), None) for i in np.flatnonzero(~effects.there)]
    classes = _classes(effects)
    found += [_sum(effects.table, slopes, names, group) for group in classes if len(group) > 1]
    found += [
        Combination(tuple(names[i] for i in circuit), None)
        for circuit in _circuits(effects, classes)
    ]
    return found


def _classes(effects: Effects) -> list[list[int]]:
    """Return the columns that are multiples of each other, together."""
    found: list[list[int]] = []
    for column in np.flatnonzero(effects.there).tolist():
        for group in found:
            if effects.depend([group[0], column]):
                group.append(column)
                break
        else:
            found.append([column])
    return found


def _sum(
    table: np.ndarray, slopes: np.ndarray, names: Sequence[str], group: Sequence[int]
) -> Combination:
    """Return the parameters whose effects are multiples of each other."""
    by_unit = table[:, group] / slopes[list(group)]
    relative = by_unit.T @ by_unit[:, 0] / (by_unit[:, 0] @ by_unit[:, 0])
    is_sum = np.allclose(np.abs(relative), 1.0, atol=EQUAL)
    return Combination(tuple(names[i] for i in group), relative if is_sum else None)


def _circuits(effects: Effects, classes: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the sets of three columns or more, one of a class, that depend, small ones first."""
    columns = [group[0] for group in classes]
    if len(columns) < 3:
        return []
    values, right = np.linalg.svd(effects.units[:, columns])[1:]
    values = np.append(values, np.zeros(len(columns) - len(values)))
    null = right[values <= effects.precision(columns)]
    weights = np.abs(null).max(axis=0, initial=0.0)
    part = [column for column, weight in zip(columns, weights, strict=True) if weight > TAKES_PART]
    found: list[list[int]] = []
    vectors = np.empty((0, len(part)))
    for size in range(3, min(len(part), MOST) + 1):
        for places in itertools.combinations(range(len(part)), size):
            if len(found) == len(null):
                return found
            chosen = [part[i] for i in places]
            vector = np.zeros((1, len(part)))
            vector[0, list(places)] = np.linalg.svd(effects.units[:, chosen])[2][-1]
            is_smallest = np.abs(vector[0, list(places)]).min() > TAKES_PART
            both = np.vstack([vectors, vector])
            is_new = np.linalg.svd(both, compute_uv=False)[-1] > TAKES_PART
            if effects.depend(chosen) and is_smallest and is_new:
                found.append(chosen)
                vectors = both
    return found if len(found) == len(null) else [*found, part]  # of more than is looked through


# ---- Whiteness of the residuals ------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Whiteness:
    """Of the residuals of one output."""

    correlations: np.ndarray  # (lags,): of 1, 2, ... rows
    bound: float  # 95 % of the correlations of noise are smaller
    statistic: float
    p: float  # the probability of one as large, if the residuals were noise

    @property
    def is_white(self) -> bool:
        """Whether they may be noise."""
        return self.p >= REJECTED


def whiteness(segments: Sequence[Reduced], outputs: int) -> list[Whiteness]:
    """Test the residuals of each output in segments, without what start states correlate."""
    return [_of_output(segments, k) for k in range(outputs)]


def _of_output(segments: Sequence[Reduced], k: int) -> Whiteness:
    residuals = [segment.residuals[segment.outputs == k] for segment in segments]
    bases = [segment.basis[segment.outputs == k] for segment in segments]
    count = sum(map(len, residuals))
    kept = sum(len(r) - float(np.sum(b**2)) for r, b in zip(residuals, bases, strict=True))
    power = sum(float(r @ r) for r in residuals)
    variance = power / max(kept, 1.0)
    lags = min(LAGS, int(np.median([len(r) for r in residuals])) - 2)
    found = np.zeros(max(lags, 0))
    pairs = np.zeros(len(found))
    for lag in range(1, lags + 1):
        for r, b in zip(residuals, bases, strict=True):
            found[lag - 1] += r[lag:] @ r[:-lag] + variance * np.sum(b[lag:] * b[:-lag])
            pairs[lag - 1] += max(len(r) - lag, 0)
    found /= power or 1.0
    statistic = float(np.sum(found**2 * count**2 / np.maximum(pairs, 1)))
    p = float(stats.chi2.sf(statistic, max(len(found), 1)))
    return Whiteness(found, 1.96 / np.sqrt(max(count, 1)), statistic, p)
