"""The largest stable step of each method: predicted from linear models, and measured.

The arm holds the start of its motion; a small deviation dies out or grows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rparm.models.closed_loop.coupling.loop import METHODS, STATES, ClosedLoop, Method

from rparm.linearization.derivatives import linear_model
from rparm.linearization.largest_step import largest_steps
from rparm.linearization.linear import Linear
from rparm.linearization.measured_growth import growth

WITHIN = 0.005  # of the predicted step
WAITING = {"trajectory": {"start_time": 1e4}}
MOVED = 1e-6  # rad, m


@dataclass(frozen=True)
class Limit:
    """The largest stable step of a method."""

    method: Method
    predicted: float  # s
    growths: tuple[float, float]  # in a step, measured WITHIN below and above it

    @property
    def passed(self) -> bool:
        """Whether a deviation dies out below and grows above."""
        return self.growths[0] < 1.0 < self.growths[1]

    @property
    def measured(self) -> float:
        """Where the logarithm of the growth is 0, s."""
        low, high = map(math.log, self.growths)
        return self.predicted * (1 + WITHIN * (low + high) / (low - high))


def study_largest_steps(loop: ClosedLoop, methods: Sequence[Method] = METHODS) -> list[Limit]:
    """Limits of methods in the nominal variant."""
    found = []
    for method in methods:
        parts, start = _linearized(loop, method)
        (limit,) = largest_steps(parts, loop.connections, [(method.order, method.inputs)])
        growths = [_growth(loop, method, limit.step * (1 + x), start) for x in (-WITHIN, WITHIN)]
        found.append(Limit(method, limit.step, (growths[0], growths[1])))
    return found


def _linearized(loop: ClosedLoop, method: Method) -> tuple[dict[str, Linear], dict[str, float]]:
    """Linear models of the components where the arm holds, and its states there."""
    with loop.master(method) as master:
        master.initialize(0.0, None, loop.parameters("nominal", WAITING))
        parts = {name: linear_model(c.instance) for name, c in master.components.items()}
    return parts, dict(parts["arm"].at)


def _growth(loop: ClosedLoop, method: Method, step: float, start: dict[str, float]) -> float:
    moved = WAITING | {"arm": {name: start[name] + MOVED for name in ("q1", "q2")}}
    with loop.master(method) as master:
        master.initialize(0.0, None, loop.parameters("nominal", moved))
        return growth(master, step, STATES)
