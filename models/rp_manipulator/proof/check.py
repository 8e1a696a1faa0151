"""Checks every claim of a certificate by itself: in rational numbers, and in arb's intervals.

The certificate says for each step what `prove` claims (README.md). Each claim is checked from those
before it, so that the whole is a proof if none is wrong, whatever `prove` calculated and how. It
shares nothing with `prove`.

    python check.py PROBLEM POINTS CERTIFICATE
"""

import sys
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import flint
from flint import arb, fmpq, fmpq_mat

sys.path.insert(0, str(Path(__file__).resolve().parent))
from certificate import (
    NOTHING,
    STATES,
    Problem,
    Set,
    Step,
    WrongClaim,
    balls_of,
    exactly,
    read_certificate,
    read_problem,
)
from motion_series import coefficients, outputs

BITS = 192


# ---- What the problem says -----------------------------------------------------------------------
class Start:
    """The set at the start: uncertain variables have sides of their own, forever the same ones."""

    def __init__(self, problem: Problem) -> None:
        vague = any(p.radius > 0 for p in problem.parameters)
        self.uncertain = list(range(len(problem.parameters))) if vague else []
        variables = problem.states + (problem.parameters if vague else [])
        self.radii = [x.radius for x in variables] if any(x.radius > 0 for x in variables) else []
        identity = [[fmpq(int(i == j)) for i in range(STATES)] for j in range(len(variables))]
        self.set = Set(
            [x.middle for x in problem.states],
            identity[:STATES] + identity[: len(self.radii)],
            [NOTHING] * STATES + self.radii,
        )


def hull_radius(of: Set, i: int) -> fmpq:
    """How far state i of a set is from its centre at most."""
    return sum((abs(s[i]) * r for s, r in zip(of.sides, of.radii, strict=True)), NOTHING)


def effort_series(
    derivatives: Sequence[fmpq],
    sines: Iterable[Sequence[fmpq]],
    within: arb,
    elapsed: arb,
    step: arb,
    last: int,
) -> list[arb]:
    """Return coefficients 0 to `last` of an effort at a time, or over an interval of times."""
    polynomial = [arb(u) / arb.fac_ui(k) for k, u in enumerate(derivatives)]
    found = []
    for k in range(last + 1):
        shifted = (
            arb.bin_uiui(j, k) * c * within ** (j - k) for j, c in enumerate(polynomial) if j >= k
        )
        found.append(sum(shifted, arb(0)) * step**k)
    for amplitude, frequency, phase in sines:
        turn = 2 * arb.pi() * arb(frequency)
        angle = turn * elapsed + arb(phase)
        turned = (angle.sin(), angle.cos(), -angle.sin(), -angle.cos())
        for k in range(last + 1):
            found[k] += arb(amplitude) * turned[k % 4] * (turn * step) ** k / arb.fac_ui(k)
    return found


# ---- Checks --------------------------------------------------------------------------------------
class Checker:
    """Checks the steps of one certificate in their order."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.start = Start(problem)
        self.set = self.start.set
        self.exact = [arb(p.middle) for p in problem.parameters]
        self.uncertain = [p.arb for p in problem.parameters]

    def efforts(self, index: int, step: Step, over: arb, last: int) -> list[list[arb]]:
        """Series of both efforts, `over` (s) after the begin of the step."""
        length, within, elapsed = (ball.arb for ball in step.times)
        return self.series(index, within + over, elapsed + over, length, last)

    def series(
        self, index: int, within: arb, elapsed: arb, length: arb, last: int
    ) -> list[list[arb]]:
        """Series of both efforts in a communication step; arguments as in effort_series."""
        of_sines = [[s[1:] for s in self.problem.sines if s[0] == i] for i in range(2)]
        return [
            effort_series(u, sines, within, elapsed, length, last)
            for u, sines in zip(self.problem.steps[index][1], of_sines, strict=True)
        ]

    def step(self, index: int, step: Step) -> None:
        """Check a step within a communication step; its end is then the set."""
        if step.order < 1:
            raise WrongClaim("order below 1")
        self.check_hull(step)
        inputs = self.efforts(index, step, arb(0), step.order)
        self.check_endpoint(step, inputs)
        hull = [ball.arb for ball in step.balls["hull"]]
        series = coefficients(
            hull, self.uncertain, inputs, step.times[0].arb, step.order, self.start.uncertain
        )
        self.check_jacobian(step, series)
        self.check_box(index, step, series)
        self.check_set(step)
        self.set = step.after

    def check_hull(self, step: Step) -> None:
        """The hull contains the set at the begin."""
        for i, ball in enumerate(step.balls["hull"]):
            if not ball.holds(self.set.centre[i], hull_radius(self.set, i)):
                raise WrongClaim(f"hull of state {i}")

    def check_endpoint(self, step: Step, inputs: list[list[arb]]) -> None:
        """The endpoint contains the value of the Taylor polynomial of the centre."""
        centre = [arb(x) for x in self.set.centre]
        series = coefficients(centre, self.exact, inputs, step.times[0].arb, step.order)
        for i, ball in enumerate(step.balls["endpoint"]):
            if not ball.contains(sum((x[0] for x in series[i]), arb(0))):
                raise WrongClaim(f"endpoint of state {i}")

    def check_jacobian(self, step: Step, series: list[list[list[arb]]]) -> None:
        """The Jacobian contains the derivatives of that polynomial, anywhere in the hull."""
        for i, row in enumerate(step.jacobian):
            if len(row) != STATES + len(self.start.uncertain):
                raise WrongClaim("number of directions")
            for d, ball in enumerate(row):
                if not ball.contains(sum((x[1 + d] for x in series[i]), arb(0))):
                    raise WrongClaim(f"derivative {d} of state {i}")

    def check_box(self, index: int, step: Step, series: list[list[list[arb]]]) -> None:
        """All motions from the hull stay inside the box, by its remainder, which is as claimed."""
        length = step.times[0].arb
        whole = length * arb(0.5, 0.5)  # contains all times of the step
        last = step.order + 1
        box = [ball.arb for ball in step.balls["box"]]
        inputs = self.efforts(index, step, whole, step.order)
        over = coefficients(box, self.uncertain, inputs, length, last)
        for i, ball in enumerate(step.balls["remainder"]):
            if not ball.contains(over[i][last][0]):
                raise WrongClaim(f"remainder of state {i}")
        for i, ball in enumerate(step.balls["box"]):
            terms = [x[0] for x in series[i]] + [step.balls["remainder"][i].arb]
            middle = terms[0] + terms[1] / 2 - arb(ball.middle)
            sizes = [middle, terms[1] / 2, *terms[2:]]
            if not sum((x.abs_upper() for x in sizes), arb(0)) < arb(ball.radius):
                raise WrongClaim(f"box of state {i}")

    def check_set(self, step: Step) -> None:
        """The set at the end contains all motions from the set at the begin, in rationals."""
        after = step.after
        frame = fmpq_mat(after.sides[:STATES]).transpose()
        deviation = frame.transpose() * frame
        for i in range(STATES):
            row = sum((abs(int(i == j) - deviation[i, j]) for j in range(STATES)), NOTHING)
            if not row <= step.deviation < 1:
                raise WrongClaim("deviation of the frame")
        inverse = frame.inv()
        rest = [self._rest(step, k) for k in range(STATES)]
        middles = fmpq_mat([[ball.middle for ball in row[:STATES]] for row in step.jacobian])
        before = fmpq_mat(self.set.sides[:STATES]).transpose()
        turned = inverse * middles * before
        spread = _product(
            [[ball.radius for ball in row[:STATES]] for row in step.jacobian],
            [[abs(side[k]) for side in self.set.sides[:STATES]] for k in range(STATES)],
        )
        sizes = [[abs(inverse[i, k]) for k in range(STATES)] for i in range(STATES)]
        widths = _product(sizes, spread)
        for i in range(STATES):
            needed = sum((sizes[i][k] * rest[k] for k in range(STATES)), NOTHING)
            for j in range(STATES):
                needed += (abs(turned[i, j]) + widths[i][j]) * self.set.radii[j]
            if not needed <= after.radii[i]:
                raise WrongClaim(f"radius {i} of the set")

    def _rest(self, step: Step, k: int) -> fmpq:
        """What the sides do not account for, in state k."""
        end, remainder = step.balls["endpoint"][k], step.balls["remainder"][k]
        rest = abs(end.middle + remainder.middle - step.after.centre[k])
        rest += end.radius + remainder.radius
        for j, radius in enumerate(self.start.radii):
            before, after = self.set.sides[STATES + j], step.after.sides[STATES + j]
            column = list(zip(before, step.jacobian[k], strict=False))
            if j >= STATES:
                column.append((fmpq(1), step.jacobian[k][j]))
            middle = sum((x * ball.middle for x, ball in column), NOTHING)
            error = sum((abs(x) * ball.radius for x, ball in column), NOTHING)
            rest += (abs(middle - after[k]) + error) * radius
        return rest

    def point(self, words: Sequence[str], index: int, after: fmpq) -> None:
        """Check that the printed balls contain set and outputs, by efforts `after` a begin (s)."""
        balls = balls_of(words)
        states, printed = balls[:STATES], balls[STATES:]
        if len(states) != STATES:
            raise WrongClaim(f"{len(states)} balls for {STATES} states")
        for i, ball in enumerate(states):
            if not ball.holds(self.set.centre[i], hull_radius(self.set, i)):
                raise WrongClaim(f"printed ball of state {i}")
        begin = self.problem.steps[index - 1][0] if index else self.problem.start
        efforts = self.series(index, arb(after), arb(begin - self.problem.start + after), arb(1), 0)
        found = outputs([ball.arb for ball in states], self.uncertain, [u[0] for u in efforts])
        if len(printed) != len(found):
            raise WrongClaim(f"{len(printed)} balls for {len(found)} outputs")
        for i, (ball, output) in enumerate(zip(printed, found, strict=True)):
            if not ball.contains(output):
                raise WrongClaim(f"printed ball of output {i}")


def _product(x: Sequence[Sequence[fmpq]], y: Sequence[Sequence[fmpq]]) -> list[list[fmpq]]:
    columns = list(zip(*y, strict=True))
    return [
        [sum((a * b for a, b in zip(row, column, strict=True)), NOTHING) for column in columns]
        for row in x
    ]


class Clock:
    """Whether the steps of a communication step fill it."""

    def __init__(self, problem: Problem, begin: fmpq, end: fmpq) -> None:
        self.since_start = begin - problem.start
        self.whole = end - begin
        self.within = fmpq(0)

    def check(self, step: Step, is_last: bool) -> None:
        """The step begins where the one before ended; the last one ends with the whole."""
        length, within, elapsed = step.times
        if not within.holds(self.within) or not elapsed.holds(self.since_start + self.within):
            raise WrongClaim("time of the begin")
        exact = self.whole - self.within if is_last else length.middle
        if not length.holds(exact) or exact <= 0:
            raise WrongClaim("length")
        self.within += exact


def check(
    problem_lines: Iterable[str],
    point_lines: Iterable[str],
    certificate: Iterable[str],
    progress: Callable[[int], object] | None = None,
) -> int:
    """Check all claims, and return how many steps there are; WrongClaim if one does not hold.

    `problem_lines` went to `prove`, which printed `point_lines` and wrote `certificate`. `progress`
    is called with 1 after each communication step.
    """
    precision, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        return _check(read_problem(problem_lines), point_lines, certificate, progress)
    finally:
        flint.ctx.prec = precision


def _check(
    problem: Problem,
    point_lines: Iterable[str],
    certificate: Iterable[str],
    progress: Callable[[int], object] | None,
) -> int:
    checker = Checker(problem)
    points = [line.split() for line in point_lines]
    ends = [end for end, _ in problem.steps]
    if len(points) != len(ends) + 1 or any(words[0] != "point" for words in points):
        raise WrongClaim(f"{len(points)} points for {len(ends)} communication steps")
    if exactly(points[0][1]) != problem.start:
        raise WrongClaim("time of the start")
    checker.point(points[0][2:], 0, NOTHING)
    count, begin, steps = 0, problem.start, []
    index = 0
    for claim in read_certificate(certificate, checker.start.radii):
        if isinstance(claim, Step):
            steps.append(claim)
            continue
        clock = Clock(problem, begin, ends[index])
        if claim != ends[index] or exactly(points[index + 1][1]) != claim or not steps:
            raise WrongClaim(f"communication point {index + 1}")
        for number, step in enumerate(steps):
            try:
                clock.check(step, number == len(steps) - 1)
                checker.step(index, step)
            except WrongClaim as error:
                raise WrongClaim(
                    f"step to {float(Fraction(int(claim.p), int(claim.q)))!r} s: {error}"
                ) from error
        checker.point(points[index + 1][2:], index, claim - begin)
        count, begin, steps = count + len(steps), claim, []
        index += 1
        if progress is not None:
            progress(1)
    if index != len(ends) or steps:
        raise WrongClaim("steps are missing at the end")
    return count


def main() -> int:
    """Check the files named on the command line."""
    problem, points, certificate = (
        Path(name).read_text(encoding="utf-8").splitlines() for name in sys.argv[1:]
    )
    try:
        print(f"{check(problem, points, certificate)} steps confirmed")
    except WrongClaim as error:
        print(f"not confirmed: {error}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
