"""The largest stable step of each way to step a system: predicted from linear models, and measured.

The system rests; a small deviation dies out or grows.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rparm.linearization.largest_step import LargestStep, largest_steps
from rparm.linearization.system import SystemSubject
from rparm.systems import ssp
from rparm.systems.comparison import Rest
from rparm.systems.master import Master
from rparm.units import verdict

STEPS = 500
EARLY = 100  # first steps, before the motion is that of the slowest eigenvalues
SEEN = 1e-7  # of the largest: combinations of signals that are above rounding
WITHIN = 0.005  # of the predicted step: where growth is measured
MOVED = 1e-6  # in the unit of what is moved


@dataclass(frozen=True)
class Limit:
    """The largest stable step of a way to step."""

    way: tuple[str, str]  # order and inputs, as in `rparm.systems.master`
    predicted: float  # s
    growths: tuple[float, float]  # in a step, measured WITHIN below and above it

    @property
    def name(self) -> str:
        """As in tables."""
        order, inputs = self.way
        return f"{order.replace('_', '-').title()}, {inputs}"

    @property
    def passed(self) -> bool:
        """Whether a deviation dies out below and grows above."""
        return self.growths[0] < 1.0 < self.growths[1]

    @property
    def measured(self) -> float:
        """Where the logarithm of the growth is 0, s."""
        low, high = map(math.log, self.growths)
        return self.predicted * (1 + WITHIN * (low + high) / (low - high))


class Resting:
    """A system at rest: predicts its largest stable steps, and measures how deviations grow."""

    def __init__(self, subject: SystemSubject, rest: Rest) -> None:
        self._subject, self._rest = subject, rest
        self._sequence = rest.sequence or subject.names
        self.ways = subject.ways

    def predicted(self, way: tuple[str, str]) -> LargestStep:
        """The largest stable step of one of `ways`, from the linear models."""
        parts = self._subject.parts(self._rest.values)
        held = self._subject.held(parts)
        parts = {name: parts[name].without(held[name]) for name in self._sequence}
        (found,) = largest_steps(parts, self._subject.connections, [way])
        return found

    def growth(self, way: tuple[str, str], step: float) -> float:
        """By how much a small deviation grows in a step, s, under the master."""
        rest, subject = self._rest, self._subject
        start = subject.at(rest.values).at
        moved = {name: start[name] + MOVED for name in rest.moved}
        fmus = {name: subject.fmus[name] for name in self._sequence}
        with Master(fmus, subject.connections, *way) as master:
            master.initialize(0.0, None, subject.merged({**rest.values, **moved}))
            return growth(master, step, rest.signals)

    def limit(self, way: tuple[str, str]) -> Limit:
        """Predicted and measured."""
        step = self.predicted(way).step
        below, above = (self.growth(way, step * (1 + x)) for x in (-WITHIN, WITHIN))
        return Limit(way, step, (below, above))


@contextmanager
def resting(path: Path, rest: Rest) -> Iterator[Resting]:
    """A system from an SSP; everything is removed at the end."""
    with ExitStack() as stack:
        opened = stack.enter_context(ssp.unpacked(path))
        subject = SystemSubject(opened, rest.variant, without=rest.without)
        yield Resting(stack.enter_context(subject), rest)


def study(path: Path, rest: Rest) -> dict[str, object]:
    """Print the limits of all ways to step a system; its part of a study of the coupling."""
    with resting(path, rest) as system:
        limits = [system.limit(way) for way in system.ways]
    head = f"{f'largest stable step, {path.stem}':<34}  {'predicted':>11}  {'measured':>11}  result"
    print("", head, "-" * len(head), sep="\n")
    for x in limits:
        cells = "".join(f"  {1e3 * step:>8.3f} ms" for step in (x.predicted, x.measured))
        print(f"{x.name:<34}{cells}  {verdict(x.passed)}", flush=True)
    return {
        "predicted": {x.name: x.predicted for x in limits},
        "measured": {x.name: x.measured for x in limits},
        "passed": all(x.passed for x in limits),
    }


def growth(master: Master, step: float, signals: Sequence[str]) -> float:
    """Largest eigenvalue of what leads from two points of a run to the next, by least squares.

    Parameters
    ----------
    master : Master
        Initialized, a little out of an equilibrium.
    step : float
        s.
    signals : sequence of str
        Values that the motion shows in.
    """
    rows = master.run(master.time + np.arange(STEPS + 1) * step)[EARLY:]
    moved = np.diff(rows[:, [master.names.index(name) for name in signals]], axis=0)
    scaled = moved / np.abs(moved).max(axis=0)
    before, after = (
        np.hstack([scaled[i : len(scaled) - 2 + i], scaled[i + 1 : len(scaled) - 1 + i]])
        for i in (0, 1)
    )
    left, sizes, right = np.linalg.svd(before, full_matrices=False)
    seen = sizes > SEEN * sizes[0]
    leads = (right[seen].T / sizes[seen]) @ (left[:, seen].T @ after)
    return float(np.abs(np.linalg.eigvals(leads)).max())
