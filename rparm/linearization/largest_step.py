"""The largest stable communication step of a system, predicted from linear models and measured.

A step of a master is linear, too: it takes states, outputs and slopes of outputs at one
communication point to those at the next. The system is stable at a step if all eigenvalues of this
map are inside the unit circle. Matrices do here what `rparm.systems.master` does. To measure, a
small deviation from rest is watched: it dies out or grows.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, partial, reduce
from pathlib import Path

import numpy as np

from rparm.console import PrintedTable
from rparm.linearization.linear import Linear, closure, scales
from rparm.linearization.sampling import Tick, by_steps, hold, period
from rparm.linearization.system import SystemSubject, connected, looped
from rparm.systems import ssp
from rparm.systems.comparison import Rest
from rparm.systems.master import INPUT_MODES, ORDERS, Master, together
from rparm.systems.structure import Connection
from rparm.units import duration, verdict

FASTEST, SLOWEST = 1e-3, 1e2  # of the time scales of fastest and slowest pole: steps to try
RATIO = 1.04  # of a step to the next one that is tried
BISECTIONS = 60
NEAR, ROUNDING = 1 - 1e-6, 1e-15  # of an eigenvalue that may be 1, and of entries
MOST_STEPS = 20  # in a period of samplers
MOST_TICKS = 2000  # in a step
Way = tuple[str, str]  # order and inputs, as in `rparm.systems.master`
Held = tuple[np.ndarray, np.ndarray, np.ndarray]
Source = tuple[str, int]  # component, and place among all outputs
STEPS = 500
EARLY = 100  # first steps, before the slowest eigenvalues dominate the motion
SEEN = 1e-7  # of the largest: combinations of signals that are above rounding
WITHIN = 0.005  # of the predicted step: where growth is measured
MOVED = 1e-6  # in the unit of the moved variable


@dataclass(frozen=True)
class LargestStep:
    """Limit of one way to step; `order` and `inputs` as in `rparm.systems.master`."""

    order: str
    inputs: str
    step: float  # s; 0: unstable at every step; inf: stable at all that were tried
    frequency: float  # Hz, of the motion that neither grows nor dies out at this step; nan: none


def largest_steps(
    parts: Mapping[str, Linear],
    connections: Sequence[Connection],
    ways: Sequence[Way] = tuple((o, i) for o in ORDERS for i in INPUT_MODES),
    law: Callable[[str, float], Linear] | None = None,
) -> list[LargestStep]:
    """Find the limit of each way to step `parts`, in their order; empty if there is no loop.

    `law` gives the model of a part in Python, which is called once a step, at another step. With
    samplers only steps are tried that divide their common period, or are multiples of it.
    """
    loop = looped(parts, connections)
    if not loop.parts:
        return []
    ticking = {name: part.ticks for name, part in loop.parts.items()}
    every = [tick for own in ticking.values() for tick in own]
    times = [part.dt for part in loop.parts.values() if part.dt] + [tick.every for tick in every]
    if times:
        own = [part.poles for part in loop.parts.values() if not part.dt]
        poles = np.concatenate([*own, 1 / np.array(times)])
    else:
        poles = connected(loop.parts, loop.connections).poles
    rates = np.abs(poles[poles != 0])
    rates = rates if len(rates) else np.ones(1)
    count = 1 + math.ceil(math.log(SLOWEST / FASTEST * rates.max() / rates.min(), RATIO))
    tried = np.geomspace(FASTEST / rates.max(), SLOWEST / rates.min(), count)
    if every:
        ratios = np.round(tried / (length := period(every)))
        most = MOST_TICKS / sum(length / tick.every for tick in every)
        several = np.unique(ratios[(ratios > 1) & (ratios < most)])
        whole = [*(1 / np.arange(MOST_STEPS, 0, -1.0)), *several]
        tried = length * np.array(whole)

    steps = cache(lambda step: by_steps(ticking, step)[1])

    @cache
    def held(name: str, step: float, k: int) -> Held:
        part = loop.parts[name]
        if not part.dt or law is None:
            return hold(part.A, part.B, step, steps(step)[k][name])
        found = law(name, step)
        found = found.without(set(found.states).difference(part.states))
        found = found.select(part.inputs, part.outputs)
        return found.A, found.B, np.zeros_like(found.B)

    def whole(step: float, way: Way) -> np.ndarray:
        maps = (
            transition(loop.parts, loop.connections, step, *way, partial(held, k=k))
            for k in range(len(steps(step)))
        )
        return reduce(lambda before, one: one @ before, maps)

    return [_largest(partial(whole, way=way), way, tried.tolist(), every) for way in ways]


def factor(whole: np.ndarray) -> float:
    """Return the size of the largest eigenvalue, 1 if only rounding says that it is less."""
    from scipy.linalg import eig

    found = float(np.abs(np.linalg.eigvals(whole)).max())
    if not NEAR < found < 1.0:
        return found
    scale = scales(whole)
    whole = whole * scale / scale[:, None]
    values, left, right = eig(whole, left=True)
    with np.errstate(divide="ignore"):
        rounding = ROUNDING * np.linalg.norm(whole) / np.abs((left.conj() * right).sum(axis=0))
    sizes = np.abs(values)  # of a chain of zeros the bound is infinite, but none comes near 1
    return 1.0 if ((sizes > NEAR) & (sizes + rounding >= 1.0)).any() else found


def _largest(
    whole: Callable[[float], np.ndarray], way: Way, tried: list[float], every: list[Tick]
) -> LargestStep:
    def growth(step: float) -> float:
        return factor(whole(step))

    low = 0.0
    for high in tried:
        if growth(high) >= 1.0:
            break
        low = high
    else:
        return LargestStep(*way, math.inf, math.nan)
    if low == 0.0:
        return LargestStep(*way, 0.0, math.nan)
    for _ in range(0 if every else BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) < 1.0 else (low, middle)
    found = np.linalg.eigvals(whole(low))
    angle = abs(np.angle(found[np.abs(found).argmax()]))
    return LargestStep(*way, low, float(angle / (2 * math.pi * period(every, low))))


def transition(
    parts: Mapping[str, Linear],
    connections: Sequence[Connection],
    step: float,
    order: str = "jacobi",
    inputs: str = "held",
    held: Callable[[str, float], Held] | None = None,
) -> np.ndarray:
    """Return the matrix from one communication point to the next, shape (n, n).

    It acts on the deviations of all states, all outputs, and slopes of outputs, if inputs are
    extrapolated; each by component. `held` gives `hold` of a component, at a step.
    """
    held = held or (lambda name, step: hold(parts[name].A, parts[name].B, step))
    sloped = inputs == "extrapolated"
    slices, sources = _layout(parts, connections)
    states = sum(len(part.states) for part in parts.values())
    outputs = sum(len(part.outputs) for part in parts.values())
    whole = np.eye(states + outputs * (1 + sloped))
    x, y, dy = np.split(whole, [states, states + outputs])
    dy = dy if sloped else np.zeros_like(y)
    x, y, dy = x.copy(), y.copy(), dy.copy()
    circles = _circles(parts, connections, slices, sources)
    stepped: set[str] = set()
    for group in together(list(parts), circles, order == "jacobi"):
        y_fed, dy_fed = y.copy(), dy.copy()
        for name in group:
            part, (rows, own) = parts[name], slices[name]
            ahead = np.array([[c in stepped] for c, _ in sources[name]], float)
            places = [place for _, place in sources[name]]
            slope = dy_fed[places]
            u = y_fed[places] - step * ahead.reshape(-1, 1) * slope
            free, forced, ramped = held(name, step)
            x[rows] = free @ x[rows] + forced @ u + ramped @ slope
            end = u + step * slope
            y[own] = part.C @ x[rows] + part.D @ end
            if sloped:
                dy[own] = part.C @ (part.A @ x[rows] + part.B @ end) + part.D @ slope
        stepped.update(group)
        for circle in circles:
            if circle[0].end_component not in group:
                continue
            on_loop = _solve(circle, parts, slices, sources, x, y)
            if sloped:
                dy[on_loop] = (y[on_loop] - y_fed[on_loop]) / step
    return np.vstack([x, y, dy] if sloped else [x, y])


def _circles(
    parts: Mapping[str, Linear],
    connections: Sequence[Connection],
    slices: Mapping[str, tuple[slice, slice]],
    sources: Mapping[str, Sequence[Source]],
) -> list[list[Connection]]:
    """Return the connections of each algebraic loop."""
    outputs = sum(len(part.outputs) for part in parts.values())
    direct = np.zeros((outputs, outputs), bool)  # an output follows another
    for name, part in parts.items():
        for column, (_, place) in zip(part.D.T, sources[name], strict=True):
            direct[slices[name][1], place] |= column != 0
    follows = closure(direct)
    found: dict[bytes, list[Connection]] = {}
    for c in connections:
        part = parts.get(c.end_component)
        if part is None or c.end_connector not in part.inputs:
            continue
        i = part.inputs.index(c.end_connector)
        place, own = sources[c.end_component][i][1], slices[c.end_component][1]
        if (follows[place, own] & (part.D[:, i] != 0)).any():
            loop = (follows[place] & follows[:, place]).tobytes()
            found.setdefault(loop, []).append(c)
    return list(found.values())


def _solve(
    circle: Sequence[Connection],
    parts: Mapping[str, Linear],
    slices: Mapping[str, tuple[slice, slice]],
    sources: Mapping[str, Sequence[Source]],
    x: np.ndarray,
    y: np.ndarray,
) -> list[int]:
    """Solve a loop for the outputs of its components, in y; return places of those that feed it."""
    ends = [(c.end_component, parts[c.end_component].inputs.index(c.end_connector)) for c in circle]
    fed = [sources[name][i][1] for name, i in ends]
    names = {name for name, _ in ends}
    fixed, by_loop = y.copy(), np.zeros((len(y), len(ends)))
    for name in names:
        part, (rows, own) = parts[name], slices[name]
        others = y[[place for _, place in sources[name]]]
        for k, (end, i) in enumerate(ends):
            if end == name:
                others[i] = 0.0
                by_loop[own, k] = part.D[:, i]
        fixed[own] = part.C @ x[rows] + part.D @ others
    u = np.linalg.solve(np.eye(len(ends)) - by_loop[fed], fixed[fed])
    for name in names:
        own = slices[name][1]
        y[own] = fixed[own] + by_loop[own] @ u
    return fed


def _layout(
    parts: Mapping[str, Linear], connections: Sequence[Connection]
) -> tuple[dict[str, tuple[slice, slice]], dict[str, list[Source]]]:
    """Place each component's states and outputs; find the source of each of its inputs."""
    slices, first_state, first_output = {}, 0, 0
    for name, part in parts.items():
        n, p = len(part.states), len(part.outputs)
        slices[name] = slice(first_state, first_state + n), slice(first_output, first_output + p)
        first_state, first_output = first_state + n, first_output + p
    found = {(c.end_component, c.end_connector): c for c in connections}
    sources: dict[str, list[Source]] = {}
    for name, part in parts.items():
        sources[name] = []
        for fed in part.inputs:
            c = found[name, fed]
            place = parts[c.start_component].outputs.index(c.start_connector)
            first = slices[c.start_component][1].start
            sources[name].append((c.start_component, first + place))
    return slices, sources


# ---- Measured ------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Limit:
    """The largest stable step of a way to step."""

    way: Way
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
        """Step at which the logarithm of the growth is 0, s."""
        low, high = map(math.log, self.growths)
        return self.predicted * (1 + WITHIN * (low + high) / (low - high))


class Resting:
    """A system at rest: predicts its largest stable steps, and measures how deviations grow."""

    def __init__(self, subject: SystemSubject, rest: Rest) -> None:
        self._subject, self._rest = subject, rest
        self._sequence = rest.sequence or subject.names
        self.ways = subject.ways

    def predicted(self, way: Way) -> LargestStep:
        """Predict the largest stable step of one of `ways`, from the linear models."""
        parts = self._subject.parts(self._rest.values)
        held = self._subject.held(parts)
        parts = {name: parts[name].without(held[name]) for name in self._sequence}
        (found,) = largest_steps(parts, self._subject.connections, [way])
        return found

    def growth(self, way: Way, step: float) -> float:
        """Measure by how much a small deviation grows in a step, s, under the master."""
        rest, subject = self._rest, self._subject
        start = subject.at(rest.values).at
        moved = {name: start[name] + MOVED for name in rest.moved}
        fmus = {name: subject.fmus[name] for name in self._sequence}
        with Master(fmus, subject.connections, *way) as master:
            master.initialize(0.0, None, subject.merged({**rest.values, **moved}))
            return growth(master, step, rest.signals)

    def limit(self, way: Way) -> Limit:
        """Predict and measure the limit."""
        step = self.predicted(way).step
        below, above = (self.growth(way, step * (1 + x)) for x in (-WITHIN, WITHIN))
        return Limit(way, step, (below, above))


@contextmanager
def resting(path: Path, rest: Rest) -> Iterator[Resting]:
    """Open a system from an SSP; everything is removed at the end."""
    with ExitStack() as stack:
        opened = stack.enter_context(ssp.unpacked(path))
        subject = SystemSubject(opened, rest.variant, without=rest.without)
        yield Resting(stack.enter_context(subject), rest)


def study_steps(path: Path, rest: Rest) -> dict[str, object]:
    """Print the limits of all ways to step a system; its part of a study of the coupling."""
    with resting(path, rest) as system:
        limits = [system.limit(way) for way in system.ways]
    print()
    columns = {"predicted": 11, "measured": 11}
    table = PrintedTable(f"largest stable step, {path.stem}", [x.name for x in limits], columns)
    for x in limits:
        table.row(x.name, [*map(duration, (x.predicted, x.measured))], verdict(x.passed))
    return {
        "predicted": {x.name: x.predicted for x in limits},
        "measured": {x.name: x.measured for x in limits},
        "passed": all(x.passed for x in limits),
    }


def growth(master: Master, step: float, signals: Sequence[str]) -> float:
    """Fit the largest eigenvalue of the map over `step` s, by signals of a run near equilibrium."""
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
