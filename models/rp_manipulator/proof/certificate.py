"""Problems, answers and certificates of `prove` (README.md), read into rational numbers."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from flint import arb, fmpq

STATES = 4
NOTHING = fmpq(0)


class WrongClaim(Exception):
    """A claim that does not hold, or that cannot be confirmed."""


@dataclass(frozen=True)
class Ball:
    """All x with |x - middle| <= radius."""

    middle: fmpq
    radius: fmpq

    @property
    def arb(self) -> arb:
        """An interval that contains it."""
        return arb(self.middle) + arb(0, 1) * arb(self.radius)

    def contains(self, x: arb) -> bool:
        """Return whether all of an interval is in it."""
        return bool((x - arb(self.middle)).abs_upper() <= arb(self.radius))

    def holds(self, middle: fmpq, radius: fmpq = NOTHING) -> bool:
        """Return whether another ball is in it."""
        return abs(middle - self.middle) + radius <= self.radius


@dataclass
class Problem:
    """A question to `prove`."""

    parameters: list[Ball] = field(default_factory=list)
    states: list[Ball] = field(default_factory=list)
    # effort (0 or 1), amplitude, frequency in Hz, phase in rad
    sines: list[tuple[int, fmpq, fmpq, fmpq]] = field(default_factory=list)
    start: fmpq = NOTHING
    # end of each communication step in s; value and derivatives of each effort at its begin
    steps: list[tuple[fmpq, tuple[list[fmpq], list[fmpq]]]] = field(default_factory=list)


@dataclass
class Set:
    """States centre + sum of c_j side_j, |c_j| <= radii_j; the first four sides are a frame."""

    centre: list[fmpq]
    sides: list[list[fmpq]]
    radii: list[fmpq]


@dataclass
class Step:
    """The claims of one step."""

    order: int
    times: list[Ball]
    balls: dict[str, list[Ball]]
    jacobian: list[list[Ball]]
    deviation: fmpq
    after: Set


def exactly(text: str) -> fmpq:
    """A hexadecimal number."""
    numerator, denominator = float.fromhex(text).as_integer_ratio()
    return fmpq(numerator, denominator)


def _numbers(words: Iterable[str]) -> list[fmpq]:
    try:
        return [exactly(word) for word in words]
    except (ValueError, OverflowError) as error:
        raise WrongClaim(f"a number is not finite: {error}") from error


def balls_of(words: Sequence[str]) -> list[Ball]:
    """From hi, lo and radius of each."""
    numbers = _numbers(words)
    found = [Ball(numbers[i] + numbers[i + 1], numbers[i + 2]) for i in range(0, len(numbers), 3)]
    if any(ball.radius < 0 for ball in found):
        raise WrongClaim("a radius is negative")
    return found


def of_states(words: Sequence[str]) -> list[Ball]:
    """Return balls of all states, no more and no fewer."""
    found = balls_of(words)
    if len(found) != STATES:
        raise WrongClaim(f"{len(found)} balls for {STATES} states")
    return found


def _vector(words: Sequence[str]) -> list[fmpq]:
    found = _numbers(words)
    if len(found) != STATES:
        raise WrongClaim(f"{len(found)} numbers for {STATES} states")
    return found


def read_problem(lines: Iterable[str]) -> Problem:
    """Read what `prove` was given."""
    problem = Problem()
    for name, *words in map(str.split, lines):
        if name in ("parameters", "states"):
            setattr(problem, name, balls_of(words))
        elif name == "sine":
            effort, *numbers = words
            problem.sines.append((int(float.fromhex(effort)), *_numbers(numbers)))
        elif name == "start":
            (problem.start,) = _numbers(words)
        else:
            end, *numbers = _numbers(words)
            problem.steps.append((end, (numbers[:4], numbers[4:])))
    return problem


def read_certificate(lines: Iterable[str], start_radii: list[fmpq]) -> Iterator[Step | fmpq]:
    """Yield the steps, and after each communication step the time of its end (s).

    `start_radii` are of the sides after the frame, the same at the end of every step. WrongClaim if
    a line is missing or out of order, or a number is not finite.
    """
    rows = map(str.split, lines)

    def take(name: str) -> list[str]:
        found, *words = next(rows, [""])
        if found != name:
            raise WrongClaim(f"expected {name}, found {found!r}")
        return words

    for name, *words in rows:
        if name == "point":
            yield exactly(words[0])
            continue
        times = balls_of(take("times"))
        names = ("hull", "box", "remainder", "endpoint")
        balls = {name: of_states(take(name)) for name in names}
        jacobian = [balls_of(take("jacobian")) for _ in range(STATES)]
        (deviation,) = _numbers(take("deviation"))
        centre = of_states(take("centre"))
        if any(ball.radius != 0 for ball in centre):
            raise WrongClaim("a centre has a radius")
        sides = [_vector(take("side")) for _ in range(STATES + len(start_radii))]
        radii = _vector(take("radii"))
        after = Set([x.middle for x in centre], sides, radii + start_radii)
        yield Step(int(words[0]), times, balls, jacobian, deviation, after)
