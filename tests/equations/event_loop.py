"""An event loop that shares nothing with the FMUs it judges: scipy's DOP853, Python's expressions.

A motion is known up to its horizon: where an impact is too weak or too near to another, a limit is
nearly touched, or a disturbance has grown too much, no method could be judged any more.
"""

import ast
import math
import random
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

SAMPLES = 16  # of each step, where conditions are looked at
LONGEST_STEP = 0.025  # s; 40 rad/s make 1 rad of it
SHORTEST_FLIGHT = 2e-3  # s
SLOWEST_IMPACT = 0.1  # units of the condition by s
NEAREST_MISS = 4e-3  # units of the condition
DISTURBANCE = 1e-7  # units of length
LARGEST_GROWTH = 300.0

Numbers = np.ndarray


@dataclass
class Condition:
    """The condition of an event, and what the event does."""

    name: str
    distance: Callable[..., float]  # of (time, x): above 0 while it does not hold
    reinit: Callable[..., list[float]]  # all states after it, of (time, x)
    unit: float  # of the distance


@dataclass
class Impact:
    """An event at its time (s)."""

    t: float
    event: str
    speed: float  # at which the limit is approached, units of the condition by s


@dataclass
class Motion:
    """What happens up to the horizon (s), with the states at the times that were asked for."""

    times: Numbers
    x: Numbers  # (times, states); NaN behind the horizon
    horizon: float
    reason: str  # for it
    impacts: list[Impact] = field(default_factory=list)
    growth: Numbers = field(default_factory=lambda: np.ones(0))  # of a disturbance, up to each time
    lateness: Numbers = field(default_factory=lambda: np.zeros(0))  # error by late impacts, a unit

    def count(self, t: float) -> int:
        """Number of impacts before a time."""
        return sum(impact.t < t for impact in self.impacts)

    def away(self, t: float, error: float) -> bool:
        """True if no impact is so near to a time that an error of the states may move it there."""
        return all(abs(t - i.t) > max(1e-3, 4 * error / i.speed) for i in self.impacts)


class EventLoop:
    """The motion of a file with states and events whose right sides are plain expressions.

    Parameters
    ----------
    text : str
        The file.
    unit : float
        What the states are measured in.
    inputs : mapping
        Expressions of time for the inputs.
    units : mapping
        Those of conditions that are not lengths, by the names of their events.
    """

    def __init__(
        self,
        text: str,
        unit: float = 1.0,
        inputs: Mapping[str, str] | None = None,
        units: Mapping[str, float] | None = None,
    ) -> None:
        file = tomllib.loads(text)
        self.unit, self.states = unit, list(file["states"])
        self.inputs = dict(inputs or {})
        self.start = np.array([float(v.get("start", 0.0)) for v in file["states"].values()])
        self.known = {k: float(v["start"]) for k, v in file.get("parameters", {}).items()}
        self.rates = self._function([v["derivative"] for v in file["states"].values()])
        self.conditions = [
            Condition(
                name,
                self._distance(event["when"]),
                self._function([event["reinit"].get(state, state) for state in self.states]),
                (units or {}).get(name, unit),
            )
            for name, event in file["events"].items()
        ]

    def _function(self, expressions: Sequence[str], library: object = math) -> Callable[..., list]:
        """A function of (time, x) whose results are the expressions."""
        lines = [f"def function(time, x):\n    {', '.join(self.states)}, = x"]
        lines += [f"    {name} = {expression}" for name, expression in self.inputs.items()]
        lines += [f"    return [{', '.join(expressions)}]"]
        names = {**vars(library), "abs": abs, "min": min, "max": max, **self.known}
        exec("\n".join(lines), names)
        return names["function"]

    def _distance(self, when: str) -> Callable[..., float]:
        """How far a relation is from coming true; arguments may be arrays."""
        relation = ast.parse(when, mode="eval").body
        assert isinstance(relation, ast.Compare)
        left, right = (ast.unparse(part) for part in (relation.left, relation.comparators[0]))
        if isinstance(relation.ops[0], (ast.Gt, ast.GtE)):
            left, right = right, left
        distance = self._function([f"({left}) - ({right})"], np)
        return lambda time, x: distance(time, x)[0]

    def run(self, times: Numbers, start: Numbers | None = None, late: float = 0.0) -> Motion:
        """The motion from time 0 to the last of the times; late: beyond each limit, units of it."""
        self.late = late
        motion = Motion(times, np.full((len(times), len(self.start)), np.nan), times[-1], "end")
        t, x = 0.0, np.array(self.start if start is None else start, dtype=float)
        if any(c.distance(t, x) < 20 * NEAREST_MISS * c.unit for c in self.conditions):
            motion.horizon, motion.reason = 0.0, "starts at a limit"
        motion.x[times <= 0.0] = x
        while t < motion.horizon:
            t, x = self._fly(motion, t, x)
        motion.x[times > motion.horizon] = np.nan
        motion.impacts = [i for i in motion.impacts if i.t < motion.horizon]
        return motion

    def _fly(self, motion: Motion, begin: float, x: Numbers) -> tuple[float, Numbers]:
        """Fly to the next impact, and through it; what ends the motion shortens the horizon."""
        solver = DOP853(
            lambda t, x: np.array(self.rates(t, x)),
            begin, x, motion.times[-1], rtol=1e-12, atol=1e-14 * self.unit,
            max_step=LONGEST_STEP,
        )  # fmt: skip
        seen = [np.array([c.distance(begin, x) / c.unit]) for c in self.conditions]
        sampled, hit, shape = [begin], None, np.linspace(0.0, 1.0, SAMPLES + 1)[1:]
        while hit is None and solver.status == "running":
            if solver.step() is not None:
                motion.horizon, motion.reason = begin, "diverges"
                return motion.times[-1], x
            dense, t = solver.dense_output(), solver.t_old + shape * (solver.t - solver.t_old)
            at = dense(t)
            hit = self._first_hit(dense, solver.t_old, t, at)
            end = solver.t if hit is None else hit[0]
            wanted = (motion.times > solver.t_old) & (motion.times <= end)
            if wanted.any():
                motion.x[wanted] = dense(motion.times[wanted]).T
            sampled += list(t[t <= end])
            for k, condition in enumerate(self.conditions):
                distance = condition.distance(t, at) / condition.unit
                seen[k] = np.append(seen[k], distance[t <= end])
        for distance in seen:
            inner = distance[1:-1]
            is_near = (inner < distance[:-2]) & (inner <= distance[2:]) & (inner < NEAREST_MISS)
            if is_near.any():
                near = sampled[1 + int(np.argmax(is_near))]
                motion.horizon = min(motion.horizon, near - 0.02)
                motion.reason = f"nearly touches at {near}"
        if hit is None:
            return motion.times[-1], x
        return self._collide(motion, begin, hit[0], hit[1], dense)

    def _first_hit(
        self, dense: Callable, begin: float, t: Numbers, at: Numbers
    ) -> tuple[float, Condition] | None:
        """The earliest time at which a condition comes true within a step."""
        found = []
        for condition in self.conditions:
            late = self.late * condition.unit
            past = condition.distance(t, at) + late < 0.0
            if past.any():
                k = int(np.argmax(past))
                before = t[k - 1] if k else begin
                root = before
                if condition.distance(before, dense(before)) + late > 0.0:
                    root = brentq(
                        lambda s, c=condition, d=late: c.distance(s, dense(s)) + d, before, t[k],
                        xtol=1e-15, rtol=1e-15,
                    )  # fmt: skip
                found.append((root, condition))
        return min(found, key=lambda hit: hit[0]) if found else None

    def _collide(
        self, motion: Motion, begin: float, t: float, condition: Condition, dense: Callable
    ) -> tuple[float, Numbers]:
        before = dense(t)
        after = np.array(condition.reinit(t, before))
        speeds = [self._speed(c, t, before) / c.unit for c in self.conditions]
        others = [c.distance(t, after) / c.unit for c in self.conditions if c is not condition]
        speed = -self._speed(condition, t, before) / condition.unit
        ends = {
            "two impacts at once": min(others, default=1.0) < NEAREST_MISS,
            "a weak impact": speed < SLOWEST_IMPACT,
            "leaves slowly": self._speed(condition, t, after) < SLOWEST_IMPACT * condition.unit,
            "impacts follow closely": t - begin < SHORTEST_FLIGHT,
            "fast": max(map(abs, speeds)) > 1e4,
        }
        reasons = [reason for reason, is_so in ends.items() if is_so]
        if reasons:
            motion.horizon = min(motion.horizon, begin if t - begin < 0.02 else t - 0.01)
            motion.reason = reasons[0]
            return motion.times[-1], after
        motion.impacts.append(Impact(t, condition.name, speed))
        return t, after

    def _speed(self, condition: Condition, t: float, x: Numbers) -> float:
        """Derivative of a distance by the time."""
        moved = 1e-7 * np.array(self.rates(t, x))
        difference = condition.distance(t + 1e-7, x + moved)
        return (difference - condition.distance(t - 1e-7, x - moved)) / 2e-7

    def judged(self, times: Numbers, chance: random.Random) -> Motion:
        """The motion with the growth of disturbances of its start, which shorten the horizon."""
        motion = self.run(times)
        times = times[times <= motion.horizon]
        motion.times, motion.x = times, motion.x[: len(times)]
        motion.growth = np.ones(len(times))
        if not motion.impacts:
            return motion
        away = [DISTURBANCE * self.unit * chance.choice((-1, 1)) for _ in self.states]
        other = self.run(times, self.start + away)
        for k, t in enumerate(times):
            if k and motion.horizon < t:
                break
            near = [i for m in (motion, other) for i in m.impacts if abs(i.t - t) < 1e-3]
            size = np.max(np.abs(other.x[k] - motion.x[k])) / (DISTURBANCE * self.unit)
            size = motion.growth[max(k - 1, 0)] if near else size
            same = other.count(t) == motion.count(t) or near
            if t > other.horizon or not same or not size < LARGEST_GROWTH:
                motion.horizon, motion.reason = times[max(k - 1, 0)], "a disturbance grows"
                break
            motion.growth[k] = max(motion.growth[k], size)
        kept = times <= motion.horizon
        motion.times, motion.x = times[kept], motion.x[kept]
        motion.growth = np.maximum.accumulate(motion.growth[kept])
        # in a limit's distance a disturbance of the start may cancel, but not what impacts are late
        late = np.abs(self.run(motion.times, late=DISTURBANCE).x - motion.x).max(axis=1)
        late[[not motion.away(t, 0.0) for t in motion.times]] = 0.0
        motion.lateness = np.maximum.accumulate(late) / (DISTURBANCE * self.unit)
        motion.impacts = [i for i in motion.impacts if i.t < motion.horizon]
        return motion
