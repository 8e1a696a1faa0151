"""Checks every claim of a certificate by itself, in arb's intervals.

The certificate says for each step of `prove` where motions are over the step, and in what set they
are at its end. Both are derived here again from what is claimed of the step before, so that the
whole is a proof if no claim is wrong, whatever `prove` calculated and how. README.md has the
theorems. Neither arithmetic nor recurrences are shared: series are flint's, by Picard's iteration,
and derivatives solve the linear equation along a motion.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import reduce
from operator import add, mul, sub, truediv
from typing import Any

import flint
from flint import arb, arb_mat, arb_series

BITS = 192
UNDERFLOW = 2.0**-800  # what is 0, but for underflow
Series = Any  # arb_series, or arb of what rests
ARITHMETIC = {"+": add, "-": sub, "*": mul, "/": truediv}
FUNCTIONS: dict[str, Callable[[Series], Series]] = {
    "sin": lambda x: x.sin(), "cos": lambda x: x.cos(), "exp": lambda x: x.exp(),
    "log": lambda x: x.log(), "sqrt": lambda x: x.sqrt(), "atan": lambda x: x.atan(),
    "tanh": lambda x: x.tanh(), "negative": lambda x: -x,
}  # fmt: skip
INTEGRATED = ("sqrt", "tanh")  # of series, by their slopes: flint's would be far too wide
# of the value, by each argument
SLOPES: dict[str, Callable[..., tuple[Series, ...]]] = {
    "sin": lambda x, z: (x.cos(),), "cos": lambda x, z: (-x.sin(),), "exp": lambda x, z: (z,),
    "log": lambda x, z: (1 / x,), "sqrt": lambda x, z: (1 / (2 * z),),
    "atan": lambda x, z: (1 / (1 + x * x),), "tanh": lambda x, z: (1 - z * z,),
    "negative": lambda x, z: (arb(-1),), "+": lambda x, y, z: (arb(1), arb(1)),
    "-": lambda x, y, z: (arb(1), arb(-1)), "*": lambda x, y, z: (y, x),
    "/": lambda x, y, z: (1 / y, -z / y),
}  # fmt: skip


class WrongClaim(Exception):
    """A claim that does not hold, or that cannot be confirmed."""


# ---- The problem ---------------------------------------------------------------------------------
class Model:
    """The operations of a problem."""

    def __init__(self, lines: Iterator[list[str]]) -> None:
        counts = [int(word) for word in next(lines)[1:]]
        self.count, self.of_rates, self.of_series, self.states, self.inputs, *_ = counts
        self.nodes = [next(lines) for _ in range(self.count)]
        self.rates, self.outputs, guards, self.starts = (
            [int(word) for word in next(lines)[1:]] for _ in range(4)
        )
        half = len(guards) // 2
        self.guards = list(zip(guards[:half], guards[half:], strict=True))

    def values(
        self,
        states: Sequence[Series],
        inputs: Sequence[arb],
        time: Series,
        count: int,
        before: Sequence[Series] = (),
    ) -> list[Series]:
        """Return the values of the first nodes; of series, `before` are those of an order less."""
        found: list[Series] = []
        for k, (op, *words) in enumerate(self.nodes[:count]):
            match op:
                case "number":
                    value = arb(float.fromhex(words[0]))
                case "state":
                    value = states[int(words[0])]
                case "input":
                    value = inputs[int(words[0])]
                case "time":
                    value = time
                case _ if op in INTEGRATED and isinstance(x := found[int(words[0])], arb_series):
                    value = arb_series([FUNCTIONS[op](x[0])])
                    if before:
                        (slope,) = SLOPES[op](x, before[k])
                        value += (slope * x.derivative()).integral()
                case _ if op in FUNCTIONS:
                    value = FUNCTIONS[op](found[int(words[0])])
                case _:
                    value = ARITHMETIC[op](*(found[int(word)] for word in words))
            found.append(value)
        return found

    def derivatives(self, found: Sequence[Series], state: int) -> list[Series]:
        """Return the derivatives of the rates by a state, where the nodes have these values."""
        slopes: list[Series] = []  # None: 0
        for k, (op, *words) in enumerate(self.nodes[: self.of_rates]):
            terms = [arb(1)] if op == "state" and int(words[0]) == state else []
            if op in SLOPES:
                given = [int(word) for word in words[: 1 if op in FUNCTIONS else 2]]
                if any(slopes[i] is not None for i in given):
                    by = SLOPES[op](*(found[i] for i in given), found[k])
                    pairs = zip(by, (slopes[i] for i in given), strict=True)
                    terms = [slope * d for slope, d in pairs if d is not None]
            slopes.append(sum(terms[1:], terms[0]) if terms else None)
        return [arb(0) if slopes[node] is None else slopes[node] for node in self.rates]


@dataclass
class Set:
    """States centre + sum of c_j side_j, |c_j| <= radii_j; the first sides are a frame."""

    centre: list[arb]
    sides: list[list[arb]]
    radii: list[arb]

    def reach(self) -> list[arb]:
        """Return how far each state is from the centre at most."""
        rows = zip(*self.sides, strict=True)
        return [_sum(abs(x) * r for x, r in zip(row, self.radii, strict=True)) for row in rows]

    def hull(self) -> list[arb]:
        """Return intervals that contain it."""
        return [x + around(r) for x, r in zip(self.centre, self.reach(), strict=True)]


@dataclass
class Step:
    """The claims of one step."""

    order: int
    length: float  # s; 0: up to the communication point
    box: list[tuple[float, ...]]
    after: Set


def around(radius: arb) -> arb:
    """All numbers up to a radius."""
    return arb(0, 1) * radius.abs_upper()


def _sum(terms: Iterable[arb]) -> arb:
    return sum(terms, arb(0))


def _numbers(words: Iterable[str]) -> list[float]:
    try:
        found = [float.fromhex(word) for word in words]
    except (ValueError, OverflowError) as error:
        raise WrongClaim(f"no number: {error}") from error
    if not all(abs(number) < float("inf") for number in found):
        raise WrongClaim("a number is not finite")
    return found


def _balls(words: Sequence[str]) -> list[tuple[float, ...]]:
    numbers = _numbers(words)
    found = [tuple(numbers[i : i + 3]) for i in range(0, len(numbers), 3)]
    if any(len(ball) != 3 or ball[2] < 0 for ball in found):
        raise WrongClaim("a radius is negative or missing")
    return found


def distance(x: arb, ball: tuple[float, ...]) -> arb:
    """Bound how far an interval is from the middle of a ball."""
    return (x - arb(ball[0]) - arb(ball[1])).abs_upper()


# ---- Series --------------------------------------------------------------------------------------
@contextmanager
def _orders(count: int) -> Iterator[None]:
    before, flint.ctx.cap = flint.ctx.cap, count
    yield
    flint.ctx.cap = before


@dataclass
class Motion:
    """Series of motions from these states, in the time since the begin over the length."""

    model: Model
    start: list[arb]
    inputs: list[arb]
    begin: arb  # s
    length: arb  # s
    values: list[Series] = field(default_factory=list)  # of all nodes, by the round before

    def states(self, order: int) -> list[arb_series]:
        """Return their coefficients by Picard's iteration: each round gets an order right."""
        found = [arb_series([x]) for x in self.start]
        self.values = []
        for k in range(1, order + 1):
            with _orders(k + 1):
                self.values = self._values(found)
                found = [
                    (arb_series([1]) * self.values[rate] * self.length).integral() + x
                    for rate, x in zip(self.model.rates, self.start, strict=True)
                ]
        return found

    def _values(self, states: Sequence[arb_series]) -> list[Series]:
        time = arb_series([self.begin, self.length])
        count = self.model.of_series
        return self.model.values(states, self.inputs, time, count, self.values)

    def jacobian(self, states: Sequence[arb_series], order: int) -> arb_mat:
        """Return the derivatives of the polynomials' values at the end: Y' = J Y, Y(0) = 1."""
        n = self.model.states
        with _orders(order):
            values = self._values(states)
            columns = [self.model.derivatives(values, j) for j in range(n)]
        by_time = [[arb_series([1]) * x * self.length for x in column] for column in columns]
        linear = [
            arb_mat(n, n, [by_time[j][i][k] for i in range(n) for j in range(n)])
            for k in range(order)
        ]
        found = [arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])]
        for k in range(order):
            terms = [linear[j] * found[k - j] for j in range(k + 1)]
            found.append(reduce(arb_mat.__add__, terms) * (arb(1) / (k + 1)))
        return reduce(arb_mat.__add__, found)


# ---- Checks --------------------------------------------------------------------------------------
class Checker:
    """Checks the steps of one certificate in their order."""

    def __init__(self, model: Model, start: list[str]) -> None:
        time, *radii = _numbers(start)
        n, self.model, self.time, self.inputs = model.states, model, time, [arb(0)] * model.inputs
        values = model.values([arb(0)] * n, self.inputs, arb(time), model.count)
        known = [values[node] for node in model.starts]
        centre = [x.mid() for x in known]
        roundings = [x.rad() for x in known]
        frame = [[arb(int(i == j)) for i in range(n)] for j in range(n)]
        uncertain = [arb(r) for r in radii] if any(radii) else []
        self.set = Set(centre, frame * (2 if uncertain else 1), roundings + uncertain)

    def step(self, step: Step, begin: arb, length: arb) -> None:
        """Check a step; its end is then the set."""
        if step.order < 1 or not length > 0:
            raise WrongClaim("order or length")
        model, n = self.model, self.model.states
        hull = Motion(model, self.set.hull(), self.inputs, begin, length)
        series = hull.states(step.order)
        remainder = self._remainder(step, begin, length)
        for i, (x, r) in enumerate(zip(series, remainder, strict=True)):
            half = x[1] / 2
            sizes = [half, *(x[k] for k in range(2, step.order + 1)), r]
            reached = x[0] + half + around(_sum(y.abs_upper() for y in sizes))
            if not distance(reached, step.box[i]) < step.box[i][2]:
                raise WrongClaim(f"box of state {i}")
        centre = Motion(model, self.set.centre, self.inputs, begin, length)
        ends = [_sum(x.coeffs()) for x in centre.states(step.order)]
        slopes, after = hull.jacobian(series, step.order), step.after
        frame, before = (
            arb_mat([[side[i] for side in of.sides[:n]] for i in range(n)])
            for of in (after, self.set)
        )
        try:
            inverse = frame.inv()
        except ZeroDivisionError:
            raise WrongClaim("the frame has no inverse") from None
        rest = [x + r - c for x, r, c in zip(ends, remainder, after.centre, strict=True)]
        parts = [inverse * arb_mat([[x] for x in rest])]
        parts += [_columns(inverse * slopes * before, self.set.radii[:n])]
        if (uncertain := self.set.radii[n:]) != []:
            old, new = (
                arb_mat([[side[i] for side in of.sides[n:]] for i in range(n)])
                for of in (self.set, after)
            )
            parts += [_columns(inverse * (slopes * old - new), uncertain)]
        for i in range(n):
            needed = _sum(x.abs_upper() for part in parts for x in part.tolist()[i])
            if not needed <= after.radii[i]:
                raise WrongClaim(f"radius {i} of the set")
        self.set = Set(after.centre, after.sides, after.radii[:n] + uncertain)

    def _remainder(self, step: Step, begin: arb, length: arb) -> list[arb]:
        """Return the coefficients after the last order over the box, where no event is."""
        box = [arb(high) + arb(low) + around(arb(r)) for high, low, r in step.box]
        whole = begin + length * arb(0.5, 0.5)
        over = Motion(self.model, box, self.inputs, whole, length)
        found = over.states(step.order + 1)
        at = self.model.values(self.set.hull(), self.inputs, begin, self.model.of_series)
        for i, (node, is_positive) in enumerate(self.model.guards):
            x = arb_series([1]) * over.values[node]
            decides = x[1] if at[node].abs_upper() <= UNDERFLOW else x[0]  # from 0 on the slope
            if not (decides > 0 if is_positive else decides < 0):
                raise WrongClaim(f"guard {i}")
        return [x[step.order + 1] for x in found]

    def point(self, words: Sequence[str], time: float) -> None:
        """Check that the printed balls contain the set, and the outputs of all states in them."""
        balls, model = _balls(words), self.model
        if len(balls) != len(model.outputs):
            raise WrongClaim(f"{len(balls)} balls for {len(model.outputs)} variables")
        states = [arb(high) + arb(low) + around(arb(r)) for high, low, r in balls[: model.states]]
        values = model.values(states, self.inputs, arb(time), model.count)
        found = [*self.set.centre, *(values[node] for node in model.outputs[model.states :])]
        reach = self.set.reach() + [arb(0)] * (len(found) - model.states)
        for i, (ball, x, more) in enumerate(zip(balls, found, reach, strict=True)):
            if not distance(x, ball) + more <= ball[2]:
                raise WrongClaim(f"printed ball {i}")


def _columns(matrix: arb_mat, radii: Sequence[arb]) -> arb_mat:
    """Scale each column."""
    return arb_mat([[x * r for x, r in zip(row, radii, strict=True)] for row in matrix.tolist()])


# ---- Certificates --------------------------------------------------------------------------------
def _claims(lines: Iterable[str], n: int, sides: int) -> Iterator[Step | float]:
    """Yield the steps, and after each communication step the time of its end (s)."""
    rows = map(str.split, lines)

    def take(name: str, count: int) -> list[str]:
        found, *words = next(rows, [""])
        if found != name or len(words) != count:
            raise WrongClaim(f"expected {name} of {count} numbers, got {found!r}, {len(words)}")
        return words

    for name, *words in rows:
        if name == "point":
            yield _numbers(words)[0]
            continue
        box, centre = _balls(take("box", 3 * n)), _balls(take("centre", 3 * n))
        vectors = [[arb(x) for x in _numbers(take("side", n))] for _ in range(sides)]
        radii = [arb(x) for x in _numbers(take("radii", sides))]
        after = Set([arb(high) + arb(low) for high, low, _ in centre], vectors, radii)
        yield Step(int(words[0]), _numbers(words[1:])[0], box, after)


def check(
    problem: Iterable[str],
    points: Iterable[str],
    certificate: Iterable[str],
    progress: Callable[[int], object] | None = None,
) -> int:
    """Check all claims, and return how many steps there are; WrongClaim if one does not hold.

    `problem` went to `prove`, which printed `points` and wrote `certificate`, in lines. `progress`
    is called with 1 after each communication step.
    """
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        return _check(map(str.split, problem), points, certificate, progress)
    finally:
        flint.ctx.prec = before


def _check(
    problem: Iterator[list[str]],
    points: Iterable[str],
    certificate: Iterable[str],
    progress: Callable[[int], object] | None,
) -> int:
    model = Model(problem)
    checker = Checker(model, next(problem)[1:])
    printed = map(str.split, points)
    claims = _claims(certificate, model.states, len(checker.set.sides))
    begin, count = checker.time, 0
    for index, (_, *numbers) in enumerate(problem):
        end, *inputs = _numbers(numbers)
        checker.inputs = [arb(x) for x in inputs]
        if index == 0:
            checker.point(_printed(printed, "point", begin), begin)
        at, is_last = arb(begin), False
        for claim in claims:
            if not isinstance(claim, Step):
                if claim != end or not is_last:
                    raise WrongClaim(f"communication point {index + 1}")
                break
            is_last = claim.length == 0
            length = arb(end) - at if is_last else arb(claim.length)
            try:
                checker.step(claim, at, length)
            except WrongClaim as error:
                raise WrongClaim(f"step to {end!r} s: {error}") from error
            at, count = at + length, count + 1
        else:  # no more: up to there it must hold
            (name, time, *_), *more = [*printed] or [["", ""]]
            if more or name != "stopped" or not arb(float.fromhex(time)) <= at:
                raise WrongClaim("steps are missing at the end")
            return count
        checker.point(_printed(printed, "point", end), end)
        begin = end
        if progress is not None:
            progress(1)
    if [*printed, *claims]:
        raise WrongClaim("there is more at the end")
    return count


def _printed(printed: Iterator[list[str]], name: str, time: float) -> list[str]:
    """Return the next line's balls."""
    found, *words = next(printed, [""])
    if found != name or _numbers(words[:1]) != [time]:
        raise WrongClaim(f"{time!r} s: expected a {name} there")
    return words[1:]
