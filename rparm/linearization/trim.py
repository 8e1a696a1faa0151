"""Equilibria by Newton's method on directional derivatives, and the intervals of dry friction.

An equilibrium is where ticks of samplers change nothing, all derivatives of states are 0, but those
that are a velocity which is given, and outputs have the values that they are to have. Some states
and inputs are free. Where nothing rests and a velocity is free, it is a steady motion, as of a
motor under a voltage.

What is left of an equation is compared with its terms, and Newton's step with the variable that it
moves, or its nominal value: units decide nothing.
"""

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rparm.errors import UserError, WrongValueError, hint
from rparm.fmi.model import Value
from rparm.linearization.linear import ROUNDING, Linear, Subject, negligible

MOST_STEPS = 200
MOST_HALVINGS = 30
# of the terms that cancel in an equation, and of a variable: a smaller rest or step counts as 0
EXACT = 1e-10
SETTLED = 1e-7  # of a variable: a step that rounding hides, as where two solutions meet
SINGULAR = 1e-10  # of the largest singular value
PROBE = 1e-6  # by so much of itself a free variable is moved to see whether it matters
NEAREST = 1e-30  # to 0 that it is moved there
TINY = 1e-200  # 0 but for underflow, whatever the units
FARTHER, FARTHEST = 16.0, 1e12  # ratio of distances that are tried, and the last, of it or of 1
BISECTIONS = 100
GUESS = "; --at NAME=VALUE begins elsewhere"


@dataclass(frozen=True, eq=False)
class Trimmed:
    """An equilibrium."""

    values: dict[str, Value]  # of all that is set, with the free variables
    # of free variables that may lie anywhere in between; their value is the middle, if the ends are
    # finite
    intervals: dict[str, tuple[float, float]]
    moving: Sequence[str] = ()  # positions of a steady motion, and their rates


def trim(
    subject: Subject, values: Mapping[str, Value], free: Sequence[str], targets: Mapping[str, float]
) -> Trimmed:
    """Move the variables `free`, from `values` or start values, to an equilibrium; UserError."""
    problem = _Problem(subject, values, free, targets)
    try:
        point = problem.solved()
    except UserError:
        if not problem.may_move():
            raise
        point = problem.solved()
    point = np.where(np.abs(point) > TINY, point, 0.0)
    intervals: dict[str, tuple[float, float]] = {}
    for _ in free:  # the middle of one may matter to the next
        before = point.copy()
        for i, name in enumerate(free):
            found = problem.interval(point, i)
            if found is not None:
                intervals[name] = found
                point[i] = sum(found) / 2 if all(map(math.isfinite, found)) else point[i]
        if np.allclose(point, before, rtol=EXACT, atol=0.0):
            break
    problem.check_determined(point, [i for i, name in enumerate(free) if name not in intervals])
    return Trimmed(problem.set_to(point), intervals, problem.moving(point))


@dataclass(frozen=True, eq=False)
class _Rest:
    """What is left of k equations at a point of f free variables."""

    found: Linear
    left: np.ndarray  # (k,)
    responses: np.ndarray  # (k, f) derivatives by the free variables
    terms: np.ndarray  # (k,) sizes of the terms that cancel
    least: np.ndarray  # (k,) a smaller rest counts as 0
    sizes: np.ndarray  # (f,) of the free variables, or their nominal values

    @cached_property
    def units(self) -> np.ndarray:
        """Change of each free variable (f,) that is as large as all terms of some equation."""
        sizes = np.maximum(self.terms, np.abs(self.left))
        most = np.abs(self.responses[sizes > TINY]) / sizes[sizes > TINY, None]
        most = most.max(axis=0, initial=0.0)
        return 1 / np.where(most > TINY, most, 1.0)

    @cached_property
    def weights(self) -> np.ndarray:
        """Factors of equations (k,) that make their terms, or their rest, 1."""
        sizes = np.maximum(self.terms, np.abs(self.left))
        sizes = np.where(sizes > TINY, sizes, np.abs(self.responses) @ self.units)
        return 1 / np.where(sizes > TINY, sizes, 1.0)

    @property
    def scaled(self) -> np.ndarray:
        """The derivatives (k, f) without units."""
        return self.weights[:, None] * self.responses * self.units

    @cached_property
    def step(self) -> np.ndarray:
        """Newton's step (f,)."""
        right = self.weights * self.left
        return -self.units * np.linalg.lstsq(self.scaled, right, rcond=SINGULAR)[0]

    def settled(self, steps: np.ndarray) -> bool:
        """Return whether Newton's step is below `steps` (f,) and leaves nothing."""
        left = np.abs(self.left + self.responses @ self.step)
        return bool(np.all(np.abs(self.step) <= steps + TINY) and np.all(left <= self.least + TINY))

    @property
    def is_rounding(self) -> bool:
        return bool(np.all(np.abs(self.left) <= ROUNDING * self.terms))


class _Problem:
    """The equations, as functions of the free variables."""

    def __init__(
        self,
        subject: Subject,
        values: Mapping[str, Value],
        free: Sequence[str],
        targets: Mapping[str, float],
    ) -> None:
        self.subject, self.fixed = subject, dict(values)
        self.free, self.targets = list(free), dict(targets)
        first = subject.at(values)
        known = (*first.states, *first.inputs)
        for i, name in enumerate(free):
            if name not in known:
                raise UserError(f"--trim: {name} is no state and no input{hint(name, known)}")
            if name in free[:i]:
                raise UserError(f"--trim: {name} is given twice")
        self.columns = [known.index(name) for name in free]
        self.is_moving = False
        self.rows = [first.outputs.index(name) for name in targets]
        self.texts, _, responses = first.balance
        unbound = ~responses.any(axis=1)
        unbound[: len(first.states)] |= self._is_given_velocity(first)
        self.count = len(targets) + np.count_nonzero(~unbound)
        self.start = np.array([*first.x, *first.u])[self.columns]

    def may_move(self) -> bool:
        """Let velocities that are free be what they will; whether there are any."""
        found = self.subject.at(self.fixed)
        before = np.count_nonzero(self._is_given_velocity(found))
        self.is_moving = True
        return np.count_nonzero(self._is_given_velocity(found)) > before

    def set_to(self, point: np.ndarray) -> dict[str, Value]:
        return self.fixed | dict(zip(self.free, map(float, point), strict=True))

    def check_range(self, point: np.ndarray) -> None:
        for name, value in zip(self.free, point, strict=True):
            try:
                self.subject.variable(name).check_range(value, value)
            except WrongValueError as error:
                raise UserError(f"--trim: {name} leaves its range: {error}") from error

    def evaluated(self, point: np.ndarray) -> _Rest:
        self.check_range(point)
        found = self.subject.at(self.set_to(point))
        wanted = np.array([*self.targets.values()])
        _, left, responses = found.balance
        aims = np.concatenate([0 * left, np.abs(wanted)])
        left = np.concatenate([left, found.y[self.rows] - wanted])
        responses = np.vstack([responses, np.hstack([found.C, found.D])[self.rows]])
        sizes = found.sizes
        terms, least = np.abs(responses) @ sizes + aims, negligible(responses, sizes, EXACT)
        unbound = np.flatnonzero(self._is_given_velocity(found))
        left[unbound] = responses[unbound] = terms[unbound] = 0.0
        columns = self.columns
        return _Rest(
            found, left, responses[:, columns], terms, least + EXACT * aims, sizes[columns]
        )

    def moving(self, point: np.ndarray) -> list[str]:
        """Say which positions move, with their rates: not by velocities that are rounding."""
        rest = self.evaluated(point)
        found, n = rest.found, len(rest.found.states)
        resting = np.zeros(n, bool)
        for i, column in enumerate(self.columns):
            if column < n and abs(point[i]) <= EXACT * rest.units[i]:
                resting[column] = True
        moved = self._is_given_velocity(found) & found.A[:, ~resting].any(axis=1)
        rates = zip(found.states, found.rates, moved, strict=True)
        return [f"{name}' = {rate:.6g}" for name, rate, moves in rates if moves and rate]

    def _is_given_velocity(self, found: Linear) -> np.ndarray:
        """Return which derivatives are a given or free velocity: no equation binds them.

        No sampler may read a position that moves: it would not rest.
        """
        n = len(found.states)
        is_read = np.any([t.partials[:, :n].any(axis=0) for t in found.ticks] or [[False]], axis=0)
        given = np.ones(n, bool)
        given[[column for column in self.columns if column < n]] = self.is_moving
        return found.are_positions & found.A[:, given].any(axis=1) & ~is_read

    def solved(self) -> np.ndarray:
        """Solve by Newton's method with steps that are halved until less is left."""
        point, rest = self.start, self.evaluated(self.start)
        for _ in range(MOST_STEPS):
            if rest.settled(EXACT * rest.sizes) or rest.is_rounding:
                return point
            step, before = rest.step, np.linalg.norm(rest.weights * rest.left)
            for _ in range(MOST_HALVINGS):
                tried = self.evaluated(point + step)
                if np.linalg.norm(rest.weights * tried.left) < before:
                    break
                step = step / 2
            else:
                break
            point, rest = point + step, tried
        sizes = np.maximum(np.maximum(rest.sizes, rest.units), np.abs(self.start))
        if rest.settled(SETTLED * sizes):
            return point
        left = rest.left
        worst = int(np.argmax(np.abs(left) / np.maximum(rest.terms, sys.float_info.min)))
        if worst < len(self.texts):
            what = f"{self.texts[worst]} {left[worst]:.6g}"
        else:
            name = list(self.targets)[worst - len(self.texts)]
            what = f"{name} stays {left[worst]:+.6g} off its value"
        few = f"; free at most {self.count} variables" if len(self.free) > self.count else ""
        names = ", ".join(self.free)
        raise UserError(f"--trim: no equilibrium found by {names}: {what}{few or GUESS}")

    def interval(self, point: np.ndarray, i: int) -> tuple[float, float] | None:
        """Return where a free variable may be, if it is not one value; UserError if anywhere."""
        ends = tuple(self._end(point, i, side) for side in (-1.0, 1.0))
        if all(map(math.isinf, ends)):
            raise UserError(f"--trim: {self.free[i]} has no effect on the equilibrium")
        return None if ends[0] == ends[1] else ends

    def _end(self, point: np.ndarray, i: int, side: float) -> float:
        """Find where the equilibrium ends on one side."""

        def holds(distance: float) -> bool:
            """Return whether nothing drives the variable back from there."""
            moved = point.copy()
            moved[i] += side * distance
            try:
                rest = self.evaluated(moved)
            except UserError:  # beyond the range of the variable
                return False
            is_met = np.all(np.abs(rest.left) <= rest.least)
            return bool(is_met and not rest.responses[:, i].any())

        size = self.evaluated(point).sizes[i]
        far = max(PROBE * size, NEAREST)
        if not holds(far):
            return float(point[i])
        near = far
        while far < FARTHEST * (size or 1.0):
            far *= FARTHER
            if not holds(far):
                break
            near = far
        else:
            return side * math.inf
        for _ in range(BISECTIONS):
            middle = (near + far) / 2
            if middle in (near, far):
                break
            near, far = (middle, far) if holds(middle) else (near, middle)
        return float(point[i] + side * near)

    def check_determined(self, point: np.ndarray, columns: Sequence[int]) -> None:
        """Refuse an equilibrium that stays one if free variables change together."""
        responses = self.evaluated(point).scaled[:, columns]
        if not len(columns):
            return
        _, sizes, directions = np.linalg.svd(responses)
        rank = int(np.sum(sizes > SINGULAR * max(sizes.max(initial=0.0), 1e-300)))
        if rank < len(columns):
            open_ones = np.abs(directions[rank:]).max(axis=0) > 1e-6
            names = [self.free[columns[i]] for i in np.flatnonzero(open_ones)]
            raise UserError(f"--trim: the equilibrium leaves {', '.join(names)} open: free fewer")
