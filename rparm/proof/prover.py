"""Encloses a motion step by step: Lohner's method with a box of high order, in arb's intervals.

README.md has the theorems.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import reduce
from operator import add, le, mul

import flint
import numpy as np
from flint import arb, arb_mat, arb_series

from rparm.proof.problem import ARITHMETIC, Problem

BITS = 128
ACCURATE = 2.0**-104  # a remainder that is small enough: in units of the state,
ROUNDED = 2.0**-6  # or of this share of the state,
SHARE = 2.0**-20  # or of this share of the hull's radius
LEFT = 2.0**-30  # of what derivatives do to the set, may be left to their remainder
PARALLEL, TINY = 100.0, 2.0**-1000  # condition of the sides of a frame; a size
LAST_ORDER = 48
SHORTEST = 2.0**-40  # a step over what remains of a communication step, at least
AHEAD = 2.0**-32  # how far ahead, in what remains, the reason is looked for where none is known
CROSSINGS = [2.0**-k for k in (36, 28, 20, 12, 4)]  # lengths in which an event is looked for
LARGEST_GROWTH = 64.0  # of a state within a step: derivatives of fewer orders are good up to there
MOST_ATTEMPTS = 100_000  # within a communication step
# by which a box is larger than what was estimated: of that, and of the hull
ROOM, WIDE = 2.0**-8, 2.0**-3
# what is claimed is larger, so that another theorem can confirm it: derivatives' radii, remainders,
# and the set
LOOSENED, ALLOWED, CONFIRMED = 1.0, 8.0, 1 + arb(2) ** -16
ZERO, UNIT = arb(0), arb(0, 1)
NONE = [ZERO] * (LAST_ORDER + 8)  # coefficients of what rests


class Obstacle(Exception):
    """Why a step cannot be; one that is `factor` times as long may be possible."""

    def __init__(self, kind: str, where: int, factor: float) -> None:
        self.kind, self.where, self.factor = kind, where, factor


@contextmanager
def precision(bits: int, orders: int = LAST_ORDER) -> Iterator[None]:
    """Calculate with so many bits, in series of so many terms."""
    before = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = bits, orders
    try:
        yield
    finally:
        flint.ctx.prec, flint.ctx.cap = before


# ---- Series --------------------------------------------------------------------------------------
class Series:
    """Taylor coefficients of all nodes along a motion, times the power of the step (Moore).

    The slope of a function is a node, too: by the chain rule, y' = s x'.
    """

    def __init__(
        self, problem: Problem, states: Sequence[arb], resting: Sequence[arb], time: arb, step: arb
    ) -> None:
        self.problem, self.step, n = problem, step, len(states)
        values = problem.balls(states, resting, time, problem.of_series)
        bad = next((i for i, x in enumerate(values) if not x.is_finite()), None)
        if bad is not None:
            raise Obstacle("undefined" if bad >= n else "growth", bad, 0.5)
        self.rows = [[x] for x in values]
        for row in self.rows[n : problem.resting]:
            row += NONE
        self.orders = 1  # that are there
        moving = range(problem.resting, problem.of_series)
        self.recurrences = [(self.rows[i].append, self._recurrence(i)) for i in moving]
        self.of_states = [(self.rows[i], self.rows[rate]) for i, rate in enumerate(problem.rates)]

    def extend(self) -> list[arb]:
        """Add the next order; return that of the states."""
        k = self.orders
        share = self.step / k
        for state, rate in self.of_states:
            state.append(rate[k - 1] * share)
        for append, following in self.recurrences:
            append(following(k))
        self.orders += 1
        return [state[k] for state, _ in self.of_states]

    def _recurrence(self, place: int) -> Callable[[int], arb]:
        """Return what calculates a node's coefficient from its arguments'."""
        node, row, rows, step = self.problem.nodes[place], self.rows[place], self.rows, self.step
        if node.op == "time":
            return lambda k: step if k == 1 else ZERO
        first, second = node.arguments[0], node.arguments[-1]
        x, y = rows[first], rows[second]
        match node.op:
            case "+":
                return lambda k: x[k] + y[k]
            case "-":
                return lambda k: x[k] - y[k]
            case "negative":
                return lambda k: -x[k]
            case "*" if self._rests(first):
                return lambda k: x[0] * y[k]
            case "*" if self._rests(second):
                return lambda k: x[k] * y[0]
            case "*":
                return lambda k: sum(map(mul, x, y[::-1]), ZERO)
            case "/" if self._rests(second):
                return lambda k: x[k] / y[0]
            case "/":  # x = y q
                return lambda k: (x[k] - sum(map(mul, y[:0:-1], row), ZERO)) / y[0]
        slope, paces = rows[node.slope], []  # j x_j

        def of_function(k: int) -> arb:
            paces.append(x[k] * k)
            return sum(map(mul, paces, slope[k - 1 :: -1]), ZERO) / k

        return of_function

    def _rests(self, node: int) -> bool:
        return len(self.problem.states) <= node < self.problem.resting

    def linear(self, orders: int) -> list[arb_mat]:
        """Return the coefficients of the derivatives of the rates by the states."""
        problem, n = self.problem, len(self.problem.states)
        with precision(flint.ctx.prec, orders):
            values = [arb_series(row[:orders]) for row in self.rows]
            for node in problem.nodes[problem.of_series : problem.of_linear]:
                values.append(ARITHMETIC[node.op](*(values[i] for i in node.arguments)))
        found = [arb_mat(n, n) for _ in range(orders)]
        for at, node in problem.linear.items():
            for k, matrix in enumerate(found):
                matrix[at] = values[node][k]
        return found


def flow(linear: Sequence[arb_mat], begin: arb_mat, step: arb) -> list[arb_mat]:
    """Return the coefficients of Y in Y' = linear Y, one more than are given."""
    found = [begin]
    for k in range(len(linear)):
        found.append(reduce(add, map(mul, linear, found[::-1])) * (step / (k + 1)))
    return found


# ---- Sets ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class States:
    """A set of states: centre + frame y + spread s, with y and s in balls around 0."""

    centre: arb_mat  # columns: exact numbers
    frame: arb_mat
    y: arb_mat
    spread: arb_mat  # of starts, whose s stay the same
    s: arb_mat

    def hull(self) -> arb_mat:
        """Return intervals that contain it, as a column."""
        return self.centre + self.frame * self.y + self.spread * self.s


def column(values: Sequence[arb]) -> arb_mat:
    """Make a column of a matrix."""
    return arb_mat(len(values), 1, [*values])


def around_zero(values: arb_mat) -> arb_mat:
    """Return balls around 0 that contain these."""
    return arb_mat(values.nrows(), values.ncols(), [UNIT * x for x in sizes(values).entries()])


def sizes(values: arb_mat) -> arb_mat:
    """Return bounds of absolute values."""
    return arb_mat(values.nrows(), values.ncols(), [x.abs_upper() for x in values.entries()])


def start_of(values: Sequence[arb], radii: Sequence[float]) -> States:
    """Return the set of these starts, each of which may be off by a radius."""
    n = len(values)
    one = arb_mat(n, n, 1)
    roundings = column([x - x.mid() for x in values])
    spread = one if any(radii) else arb_mat(n, n)
    return States(
        column([x.mid() for x in values]), one, roundings, spread,
        column([UNIT * arb(r) for r in radii]),
    )  # fmt: skip


# ---- Steps ---------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Step:
    """A step, and what it claims: motions that begin in a set end in the next one, `after`."""

    length: arb  # s
    after: States
    # no claims, but of use to who checks it: coefficients of a motion, of derivatives by its start
    motion: list[list[arb]]
    flow: list[arb_mat]


@dataclass
class Stepper:
    """Takes steps from a set of states."""

    problem: Problem
    states: States
    at: arb  # s
    longest: float = math.inf  # s, of the step that is tried next

    def advance(self, end: float, resting: Sequence[arb]) -> Iterator[Step]:
        """Take steps to the next communication point; Obstacle where none is possible."""
        for _ in range(MOST_ATTEMPTS):
            remaining = arb(end) - self.at
            is_last = not self.longest < remaining
            length = remaining if is_last else arb(self.longest)
            size = float(length.mid())
            try:
                step = self.step(length, resting)
            except Obstacle as obstacle:
                self.longest = size * obstacle.factor
                if self.longest < SHORTEST * float(remaining.mid()):
                    raise self._named(obstacle, remaining, resting) from None
                continue
            orders = len(step.motion[0])
            self.longest = max(self.longest, size * (1.25 if orders < LAST_ORDER - 5 else 1.0))
            self.states, self.at = step.after, arb(end) if is_last else self.at + length
            yield step
            if is_last:
                return
        raise Obstacle("growth", 0, 0.5)

    def _named(self, obstacle: Obstacle, remaining: arb, resting: Sequence[arb]) -> Obstacle:
        """Where states grow: look for a node without bounds a little ahead, which may be why."""
        if obstacle.kind != "growth":
            return obstacle
        ahead, n = UNIT * AHEAD * remaining, len(self.problem.states)
        hull, count = self.states.hull().entries(), self.problem.of_series
        values = self.problem.balls(hull, resting, self.at, count)
        wide = [x + values[rate] * ahead for x, rate in zip(hull, self.problem.rates, strict=True)]
        values = self.problem.balls(wide, resting, self.at + ahead, count)
        bad = [i for i in range(n, count) if not values[i].is_finite()]
        return Obstacle("undefined", bad[0], 0.5) if bad else obstacle

    def crossing(self, guard: int, end: float, resting: Sequence[arb]) -> Step | None:
        """Go on as if there were no event; a step at whose end a guard has the other sign."""
        node, is_positive, _ = self.problem.guards[guard]
        for shorter in CROSSINGS:
            length = (arb(end) - self.at) * shorter
            try:
                step = self.step(length, resting, guarded=False)
            except Obstacle:
                continue
            hull, time = step.after.hull().entries(), self.at + length
            x = self.problem.balls(hull, resting, time, node + 1)[node]
            if x < 0 if is_positive else x > 0:
                return step
        return None

    def step(self, length: arb, resting: Sequence[arb], guarded: bool = True) -> Step:
        """Take a step of this length; Obstacle if it cannot be."""
        problem, before, begin = self.problem, self.states, self.at
        n, hull = len(problem.states), before.hull().entries()
        middle = self._middle(length, resting)
        half = middle.orders // 2
        near = Series(problem, hull, resting, begin, length)
        for _ in range(half):
            near.extend()
        box = self._box(middle, near, resting)
        remainder = [UNIT * (ALLOWED * x.abs_upper()) for x in self._remainder(box, middle, near)]
        motion = middle.rows[:n]
        if guarded:
            self._guard(near, box)
        # |Y - 1| is at most e^(the size of f's derivatives) - 1, for each element
        linear = box.linear(half + 1)
        most = sizes(linear[0] * length).exp()
        for i in range(n):
            if not most[i, i] < LARGEST_GROWTH:
                raise Obstacle("growth", i, 0.75)
        one = arb_mat(n, n, 1)
        wide = one + around_zero(most - one)
        radii = column([x.rad() + small_for(x) for x in hull])
        allowed = (most * radii * arb(LEFT)).entries()
        while True:
            last = flow(linear, wide, length)[-1]
            widened = (sizes(last) * radii).entries()
            if half > LAST_ORDER or all(map(le, widened, allowed)):
                break
            half += 2
            while box.orders <= half:
                box.extend()
            while near.orders < half:
                near.extend()
            linear = box.linear(half + 1)
        derivatives = flow(near.linear(half), one, length)
        jacobian = reduce(add, derivatives, last)
        jacobian = arb_mat(n, n, [x + (x - x.mid()) * LOOSENED for x in jacobian.entries()])
        try:
            after = self._moved(column([*map(sum, motion)]) + column(remainder), jacobian)
        except ZeroDivisionError:
            raise Obstacle("growth", 0, 0.5) from None
        for i, x in enumerate(after.hull().entries()):
            if not x.is_finite():
                raise Obstacle("growth", i, 0.75)
        middles = [[x.mid() for x in row] for row in motion]
        return Step(length, after, middles, [x.mid() for x in derivatives])

    def _middle(self, length: arb, resting: Sequence[arb]) -> Series:
        """Return the series of the centre: as many orders as change anything."""
        centre = self.states.centre.entries()
        small = [small_for(x) / 4 for x in centre]
        series = Series(self.problem, centre, resting, self.at, length)
        size = last = math.inf
        while size + last > 1:
            sizes = [upper(x) / s for x, s in zip(series.extend(), small, strict=True)]
            last, size = size, max(sizes)
            if series.orders >= LAST_ORDER or not size < math.inf:
                raise Obstacle("growth", sizes.index(size), 0.875)
        return series

    def _box(self, middle: Series, near: Series, resting: Sequence[arb]) -> Series:
        """Return the series of all motions from a box at all times of the step: a guess."""
        box = []
        for x, row in zip(middle.rows, near.rows[: len(self.problem.rates)], strict=False):
            later = [*row[2:], *x[len(row) :]]
            reach = sum((y.abs_upper() for y in later), row[1].abs_upper() / 2 + row[0].rad())
            radius = reach * (1 + ROOM) + row[0].rad() * WIDE + small_for(row[0])
            box.append(row[0].mid() + row[1].mid() / 2 + UNIT * radius.abs_upper())
        times = self.at + near.step * arb(0.5, 0.5)
        return Series(self.problem, box, resting, times, near.step)

    def _remainder(self, box: Series, middle: Series, near: Series) -> list[arb]:
        """Return the coefficients after the last order over the box, which holds all motions."""
        last: list[arb] = []
        for _ in range(middle.orders):
            last = box.extend()
        for i, (row, wide) in enumerate(zip(near.rows[: len(last)], box.rows, strict=False)):
            terms = [*row[2:], wide[len(row)]]
            reached = row[0] + row[1] * arb(0.5, 0.5) + UNIT * sum(y.abs_upper() for y in terms)
            if not wide[0].contains_interior(reached):
                raise Obstacle("growth", i, 0.75)
        most = [max(small_for(x[0]), SHARE * upper(x[0].rad())) for x in near.rows[: len(last)]]
        while bad := [i for i, x in enumerate(last) if not upper(x) * ALLOWED <= most[i]]:
            if middle.orders >= LAST_ORDER:
                raise Obstacle("growth", bad[0], 0.8125)
            middle.extend()
            last = box.extend()
        return last

    def _guard(self, near: Series, box: Series) -> None:
        """Refuse a step in which a guard may become 0: where it begins at 0, its slope decides."""
        for i, (node, is_positive, _) in enumerate(self.problem.guards):
            row = box.rows[node]
            x = row[1] if near.rows[node][0].is_zero() else row[0]
            if not (x > 0 if is_positive else x < 0):
                raise Obstacle("event", i, 0.5)

    def _moved(self, end: arb_mat, jacobian: arb_mat) -> States:
        """Return the set at the end, by the mean value theorem."""
        before, centre = self.states, end.mid()
        framed, spread = jacobian * before.frame, jacobian * before.spread
        middle = spread.mid()
        frame = _frame(framed, before.y)
        inverse = frame.inv()
        rest = end - centre + (spread - middle) * before.s
        y = inverse * rest + (inverse * framed) * before.y
        return States(centre, frame, around_zero(y) * CONFIRMED, middle, before.s)


def _frame(framed: arb_mat, y: arb_mat) -> arb_mat:
    """Return the next frame, which may be any invertible matrix.

    The sides as they are, which lets nothing grow, until they are nearly parallel; then their
    orthogonal factor, the longest side first.
    """
    sides = np.array([[float(x.mid()) for x in row] for row in framed.tolist()])
    largest = np.abs(sides).max(axis=1, keepdims=True) + TINY
    if np.linalg.cond(sides / largest) < PARALLEL:
        return arb_mat(sides.tolist())
    sides = sides * [upper(x) for x in y.entries()]
    longest = np.argsort(-np.linalg.norm(sides, axis=0))
    # rounded: the last digits of LAPACK depend on the processor and on where arrays lie in memory
    return arb_mat(np.linalg.qr(sides[:, longest])[0].astype(np.float32).tolist())


def upper(x: arb) -> float:
    """Return a double not below |x|, hardly above; of 0 it is 0."""
    return 0.0 if x.is_zero() else math.nextafter(float(x.abs_upper()), math.inf)


def small_for(state: arb) -> float:
    """Return what is small for a state of this size."""
    return ACCURATE * max(1.0, ROUNDED * upper(state))
