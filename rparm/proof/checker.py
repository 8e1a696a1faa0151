"""Checks every step of a proof by another theorem, which README.md has.

The prover solves the equations. Nothing is solved here: the polynomials that it found are put into
the equations, and by how much they fail bounds how far motions are from them. Series are flint's.
"""

import operator
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import reduce
from typing import Any

from flint import arb, arb_mat, arb_poly, arb_series

from rparm.proof.problem import Problem, Start
from rparm.proof.prover import States, Step, column, precision

BITS = 192
PARTS = 16  # of a step, in which derivatives are inverted
TINY = arb(2) ** -2000  # so that what must be inside something has room
UNIT, WHOLE = arb(0, 1), arb(0.5, 0.5)
Series = Any  # arb_series, or arb of what rests


def _exponential(x: Series) -> Series:
    """e^x, of series by their first number: flint's own are wide where that is."""
    return x.exp() if isinstance(x, arb) else x[0].exp() * (x - x[0]).exp()


def _sqrt(x: Series) -> Series:
    """By log x, whose slope is x' / x."""
    if isinstance(x, arb):
        return x.sqrt()
    return x[0].sqrt() * ((x.derivative() / x).integral() / 2).exp()


def _tanh(x: Series) -> Series:
    return x.tanh() if isinstance(x, arb) else 1 - 2 / (_exponential(2 * x) + 1)


OPERATIONS: dict[str, Callable[..., Series]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "negative": operator.neg, "sin": lambda x: x.sin(), "cos": lambda x: x.cos(),
    "exp": _exponential, "log": lambda x: x.log(), "atan": lambda x: x.atan(), "sqrt": _sqrt,
    "tanh": _tanh,
}  # fmt: skip
# of the value z, by each argument
SLOPES: dict[str, Callable[..., tuple[Series, ...]]] = {
    "+": lambda x, y, z: (arb(1), arb(1)), "-": lambda x, y, z: (arb(1), arb(-1)),
    "*": lambda x, y, z: (y, x), "/": lambda x, y, z: (1 / y, -z / y),
    "negative": lambda x, z: (arb(-1),), "sin": lambda x, z: (x.cos(),),
    "cos": lambda x, z: (-x.sin(),), "exp": lambda x, z: (z,), "log": lambda x, z: (1 / x,),
    "sqrt": lambda x, z: (1 / (2 * z),), "atan": lambda x, z: (1 / (1 + x * x),),
    "tanh": lambda x, z: (1 - z * z,),
}  # fmt: skip


class WrongClaim(Exception):
    """A claim that does not hold, or that cannot be confirmed."""


class Checker:
    """Checks the steps of one proof in their order.

    Attributes
    ----------
    steps : int
        How many are confirmed.
    """

    def __init__(self, problem: Problem, start: Start) -> None:
        self.problem, self.steps, n = problem, 0, len(start)
        with precision(BITS):
            none = [arb(0)] * n, problem.held()[0], arb(problem.scenario.times[0])
            values = self._values(*none, len(problem.nodes))
            known = [arb(value) for value, _ in start.values()]
            for i, name in enumerate(start):
                if name in problem.starts and start[name][0] == problem.known[name]:
                    known[i] = values[problem.starts[name]]
            centre, one = column([x.mid() for x in known]), arb_mat(n, n, 1)
            off = column([UNIT * radius for _, radius in start.values()])
            self.set = States(centre, one, column(known) - centre, one, off)

    # ---- The equations -----------------------------------------------------------------------

    def _values(
        self, states: Sequence[Series], inputs: Sequence[arb], time: Series, count: int
    ) -> list[Series]:
        """Return the values of the first nodes, of numbers or of series."""
        found = [*states]
        for node in self.problem.nodes[len(found) : count]:
            if node.op == "number":
                found.append(node.number)
            elif node.op in ("input", "time"):
                found.append(inputs[node.arguments[0]] if node.op == "input" else time)
            else:
                found.append(OPERATIONS[node.op](*(found[j] for j in node.arguments)))
        return found

    def _rates(self, states: Sequence[Series], inputs: Sequence[arb], time: Series) -> list[Series]:
        values = self._values(states, inputs, time, self.problem.of_rates)
        return [values[node] for node in self.problem.rates]

    def _slopes(self, values: Sequence[Series], along: Sequence[Series]) -> list[Series]:
        """Return the derivatives of the rates along a direction."""
        problem, slopes, n = self.problem, [*along], len(along)
        for node, z in zip(problem.nodes[n : problem.of_rates], values[n:], strict=True):
            slope = arb(0)
            # what is 0 needs no slope
            if node.op in SLOPES and any(not _is_zero(slopes[j]) for j in node.arguments):
                by = SLOPES[node.op](*(values[j] for j in node.arguments), z)
                slope = _sum(x * slopes[j] for x, j in zip(by, node.arguments, strict=True))
            slopes.append(slope)
        return [slopes[node] for node in problem.rates]

    # ---- Steps -------------------------------------------------------------------------------

    def step(
        self, step: Step, begin: arb, length: arb, inputs: Sequence[arb], guarded: bool = True
    ) -> None:
        """Check that motions from the set are in the next one at the end, without an event."""
        with precision(BITS):
            tube = _Tube(self, step, begin, length, inputs)
            if guarded:
                self._guard(tube, inputs)
            self._moved(step.after, tube)
        self.set = step.after
        self.steps += 1

    def _guard(self, tube: "_Tube", inputs: Sequence[arb]) -> None:
        states, time = tube.states(), tube.begin + tube.length * WHOLE
        count = self.problem.of_series
        at = self._values(_hull(self.set).entries(), inputs, tube.begin, count)
        rates = self._rates(states, inputs, time)
        moving = [arb_series([x, rate]) for x, rate in zip(states, rates, strict=True)]
        values = self._values(moving, inputs, arb_series([time, 1]), count)
        for node, is_positive, name in self.problem.guards:
            x = arb_series([1]) * values[node]
            decides = x[1] if at[node].is_zero() else x[0]  # from 0 on the slope
            if not (decides > 0 if is_positive else decides < 0):
                raise WrongClaim(f"no {name}")

    def _moved(self, after: States, tube: "_Tube") -> None:
        before, n = self.set, len(self.problem.states)
        exact = *after.centre.entries(), *after.frame.entries(), *after.spread.entries()
        if not all(x.is_exact() for x in exact):
            raise WrongClaim("a centre or side that is not exact")
        try:
            inverse = after.frame.inv()
        except ZeroDivisionError:
            raise WrongClaim("a frame without an inverse") from None
        end, flow, off = tube.end(inverse)
        found = inverse * (end - after.centre) + off + (flow * before.frame) * before.y
        found += (flow * before.spread - inverse * after.spread) * before.s
        for i in range(n):
            if not after.y[i, 0].contains(found[i, 0]):
                raise WrongClaim(f"radius {i} of the set")
            if not after.s[i, 0].contains(before.s[i, 0]):
                raise WrongClaim(f"start {i} of the set")

    def crossing(
        self, step: Step, begin: arb, length: arb, inputs: Sequence[arb], guard: int
    ) -> None:
        """Check that motions, if they went on without an event, would pass it within the step."""
        self.step(step, begin, length, inputs, guarded=False)
        node, is_positive, name = self.problem.guards[guard]
        with precision(BITS):
            hull = _hull(self.set).entries()
            x = self._values(hull, inputs, begin + length, node + 1)[node]
        if not (x < 0 if is_positive else x > 0):
            raise WrongClaim(f"{name} within the step")

    def point(self, balls: Sequence[Sequence[float]], inputs: Sequence[arb], time: float) -> None:
        """Check that balls (high, low, radius) contain the set and the outputs there."""
        with precision(BITS):
            hull = _hull(self.set).entries()
            values = self._values(hull, inputs, arb(time), len(self.problem.nodes))
            nodes = self.problem.outputs[: len(balls)]
            for (high, low, radius), node in zip(balls, nodes, strict=True):
                if not arb(0, radius).contains(values[node] - arb(high) - arb(low)):
                    raise WrongClaim(f"value {node} at {time!r} s")


class _Tube:
    """Polynomials p and Y over a step; motions are in p(t) + Y(t) (w + [-off, off])."""

    def __init__(
        self, checker: Checker, step: Step, begin: arb, length: arb, inputs: Sequence[arb]
    ) -> None:
        self.checker, self.begin, self.length, self.inputs = checker, begin, length, inputs
        before, n = checker.set, len(step.motion)
        self.p = [
            arb_poly([x, *row[1:]])
            for x, row in zip(before.centre.entries(), step.motion, strict=True)
        ]
        self.flow = [
            [arb_poly([int(i == j), *(y[i, j] for y in step.flow[1:])]) for j in range(n)]
            for i in range(n)
        ]
        self.orders = len(step.motion[0]) - 1, len(step.flow) - 1
        reach = [x.abs_upper() for x in (_hull(before) - before.centre).entries()]
        self.inverses = [*self._inverses()]
        defect, off = self._defect(), [arb(0)] * n
        for factor in (1, 1, 2):
            more = [factor * x + TINY for x in off]
            self.room = [x + y for x, y in zip(reach, more, strict=True)]
            self.fails = self._deviation(defect)
            found = [self._off(0, 1, inverse).entries() for inverse in self.inverses]
            off = [reduce(arb.max, column) for column in zip(*found, strict=True)]
        if not all(x < y for x, y in zip(off, more, strict=True)):
            raise WrongClaim("a motion that may be anywhere")

    def _off(self, since: float, until: float, by: arb_mat) -> arb_mat:
        """Bound the integral of |by (f(x) - p' - Y' w)| from one part of the step to another."""
        balls = []
        for sizes in self.fails:
            parts = ((arb(until) ** k - arb(since) ** k) / k for k in range(1, len(sizes) + 1))
            balls.append(UNIT * _sum(map(operator.mul, sizes, parts)).abs_upper())
        return column([x.abs_upper() for x in (by * column(balls)).entries()])

    def _at(self, poly: arb_poly, orders: int, over: bool) -> arb_series:
        """Its coefficients from the begin, or from any time of the step."""
        if over:
            poly = poly(arb_poly([WHOLE, 1]))
        return arb_series(poly.coeffs()[: orders + 1])

    def _around(self, orders: int, over: bool) -> list[arb_series]:
        """Return the series of states in the tube."""
        room = [UNIT * x.abs_upper() for x in self.room]
        return [
            self._at(p, orders, over)
            + _sum(self._at(y, orders, over) * w for y, w in zip(row, room, strict=True))
            for p, row in zip(self.p, self.flow, strict=True)
        ]

    def _time(self, over: bool) -> arb_series:
        return arb_series([self.begin + self.length * WHOLE if over else self.begin, self.length])

    def states(self) -> list[arb]:
        """Return where motions are over the whole step."""
        return [x[0] for x in self._around(0, over=True)]

    def _defect(self) -> list[list[arb]]:
        """Bound the coefficients of f(p) - p': Taylor's theorem with its remainder."""
        orders = self.orders[0]
        found = []
        with precision(BITS, orders + 1):
            for over in (False, True):
                states = [self._at(p, orders, over) for p in self.p]
                rates = self.checker._rates(states, self.inputs, self._time(over))
                found.append([
                    arb_series([1]) * rate * self.length - self._at(p.derivative(), orders, over)
                    for rate, p in zip(rates, self.p, strict=True)
                ])  # fmt: skip
        return [_sizes(x, y, orders) for x, y in zip(*found, strict=True)]

    def _deviation(self, defect: list[list[arb]]) -> list[list[arb]]:
        """Add bounds of (Df Y - Y') w in the tube."""
        orders, n, found = self.orders[1], len(self.p), []
        added = [[*x, *[arb(0)] * (orders + 1 - len(x))] for x in defect]
        count = self.checker.problem.of_rates
        with precision(BITS, orders + 1):
            for over in (False, True):
                states, time = self._around(orders, over), self._time(over)
                values = self.checker._values(states, self.inputs, time, count)
                for flow in zip(*self.flow, strict=True):
                    along = [self._at(y, orders, over) for y in flow]
                    for slope, y in zip(self.checker._slopes(values, along), flow, strict=True):
                        rate = self._at(y.derivative(), orders, over)
                        found.append(slope * self.length - rate)
        for ji, (x, y) in enumerate(zip(found[: n * n], found[n * n :], strict=True)):
            for k, size in enumerate(_sizes(x, y, orders)):
                added[ji % n][k] += size * self.room[ji // n]
        return added

    def _inverses(self) -> Iterator[arb_mat]:
        """Yield Y^-1 in each part of the step."""
        for k in range(PARTS):
            middle, part = arb_poly([arb(k + 0.5) / PARTS, 1]), UNIT / (2 * PARTS)
            try:
                yield arb_mat([[y(middle)(part) for y in row] for row in self.flow]).inv()
            except ZeroDivisionError:
                raise WrongClaim("derivatives without an inverse") from None

    def end(self, inverse: arb_mat) -> tuple[arb_mat, arb_mat, arb_mat]:
        """Return p and `inverse` Y at the end, and what is off there, times `inverse`."""
        flow = inverse * arb_mat([[y(arb(1)) for y in row] for row in self.flow])
        off = column([arb(0)] * len(self.p))
        for k, part in enumerate(self.inverses):
            off += self._off(k / PARTS, (k + 1) / PARTS, flow * part)
        return column([p(arb(1)) for p in self.p]), flow, off * UNIT


def _sizes(begin: arb_series, over: arb_series, orders: int) -> list[arb]:
    return [begin[k].abs_upper() for k in range(orders)] + [over[orders].abs_upper()]


def _hull(of: States) -> arb_mat:
    """Return intervals that contain a set."""
    return of.centre + of.frame * of.y + of.spread * of.s


def _sum(terms: Iterable[Series]) -> Series:
    return sum(terms, arb(0))


def _is_zero(x: Series) -> bool:
    return isinstance(x, arb) and x.is_zero()
