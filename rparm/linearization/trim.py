"""Equilibria by Newton's method on directional derivatives, and the intervals of dry friction.

An equilibrium is where ticks of samplers change nothing, all derivatives of states are 0, but those
that are a velocity which is given, and outputs have the values that they are to have. Some states
and inputs are free. Where nothing rests and a velocity is free, it is a steady motion: that of a
motor under a voltage.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rparm.errors import UserError, WrongValueError, hint
from rparm.fmi.model import Value
from rparm.linearization.linear import Linear, Subject

MOST_STEPS = 60
MOST_HALVINGS = 30
EXACT = 1e-10  # of the terms that cancel in an equation: a smaller rest counts as 0
SINGULAR = 1e-10  # of the largest singular value
PROBE = 1e-6  # by so much of itself, or of 1, a free variable is moved to see whether it matters
DOUBLINGS = 60
BISECTIONS = 100
GUESS = "; --at NAME=VALUE begins elsewhere"


@dataclass(frozen=True, eq=False)
class Trimmed:
    """An equilibrium."""

    values: dict[str, Value]  # of all that is set, with the free variables
    # of free variables that may lie anywhere in between; their value is the middle, if the ends are
    # finite
    intervals: dict[str, tuple[float, float]]


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
    intervals: dict[str, tuple[float, float]] = {}
    for _ in free:  # the middle of one may matter to the next
        for i, name in enumerate(free):
            found = problem.interval(point, i)
            if found is not None:
                intervals[name] = found
                point[i] = sum(found) / 2 if all(map(math.isfinite, found)) else point[i]
    problem.check_determined(point, [i for i, name in enumerate(free) if name not in intervals])
    return Trimmed(problem.set_to(point), intervals)


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

    def evaluated(self, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the rest of each equation, its derivatives by the free variables, its size."""
        self.check_range(point)
        found = self.subject.at(self.set_to(point))
        wanted = np.array([*self.targets.values()])
        _, left, responses = found.balance
        aims = np.concatenate([0 * left, np.abs(wanted)])
        left = np.concatenate([left, found.y[self.rows] - wanted])
        responses = np.vstack([responses, np.hstack([found.C, found.D])[self.rows]])
        size = np.abs(responses) @ np.abs([*found.x, *found.u]) + aims
        unbound = np.flatnonzero(self._is_given_velocity(found))
        left[unbound] = responses[unbound] = 0.0
        return left, responses[:, self.columns], np.maximum(size, 1.0)

    def _is_given_velocity(self, found: Linear) -> np.ndarray:
        """Return which derivatives are a given or free velocity: no equation binds them.

        No sampler may read a position that moves: it would not rest.
        """
        n = len(found.states)
        is_read = np.any([t.partials[:, :n].any(axis=0) for t in found.ticks] or [[False]], axis=0)
        given = np.ones(n, bool)
        given[[column for column in self.columns if column < n]] = self.is_moving
        return found.are_positions & found.A[:, given].any(axis=1) & ~is_read

    def is_equilibrium(self, point: np.ndarray) -> bool:
        left, _, size = self.evaluated(point)
        return bool(np.all(np.abs(left) <= EXACT * size))

    def solved(self) -> np.ndarray:
        """Solve by Newton's method with steps that are halved until less is left."""
        point = self.start
        left, responses, size = self.evaluated(point)
        for _ in range(MOST_STEPS):
            if np.all(np.abs(left) <= EXACT * size):
                return point
            step = -np.linalg.lstsq(responses, left, rcond=SINGULAR)[0]
            for _ in range(MOST_HALVINGS):
                tried = self.evaluated(point + step)
                if np.linalg.norm(tried[0]) < np.linalg.norm(left):
                    break
                step = step / 2
            else:
                break
            point = point + step
            left, responses, size = tried
        worst = int(np.argmax(np.abs(left) / size))
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
            moved = point.copy()
            moved[i] += side * distance
            try:
                return self.is_equilibrium(moved)
            except UserError:  # beyond the range of the variable
                return False

        far = PROBE * max(1.0, abs(point[i]))
        if not holds(far):
            return float(point[i])
        near = far
        for _ in range(DOUBLINGS):
            far *= 2
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
        responses = self.evaluated(point)[1][:, columns]
        if not len(columns):
            return
        _, sizes, directions = np.linalg.svd(responses)
        rank = int(np.sum(sizes > SINGULAR * max(sizes.max(initial=0.0), 1e-300)))
        if rank < len(columns):
            open_ones = np.abs(directions[rank:]).max(axis=0) > 1e-6
            names = [self.free[columns[i]] for i in np.flatnonzero(open_ones)]
            raise UserError(f"--trim: the equilibrium leaves {', '.join(names)} open: free fewer")
