"""The largest stable communication step of a system, from the linear models of its components.

A master's step is linear, too: it takes states, outputs and slopes of outputs at one communication
point to those at the next. The system is stable at a step if all eigenvalues of this map are
inside the unit circle. What `rparm.systems.master` does is done here with matrices.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from rparm.linearization.connections import connected, looped
from rparm.linearization.linear import Linear, hold
from rparm.systems.master import INPUT_MODES, ORDERS
from rparm.systems.ssp import Connection

FASTEST, SLOWEST = 1e-3, 1e2  # of the time scales of fastest and slowest pole: steps to try
RATIO = 1.04  # of a step to the next one that is tried
BISECTIONS = 60


Held = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class LargestStep:
    """The limit of one way to step.

    Attributes
    ----------
    order, inputs : str
        As in `rparm.systems.master`.
    step : float
        s; 0: unstable at every step; inf: stable at all that were tried.
    frequency : float
        Hz, of the motion that neither grows nor dies out at this step; nan if there is none.
    """

    order: str
    inputs: str
    step: float
    frequency: float


def largest_steps(
    parts: Mapping[str, Linear],
    connections: Sequence[Connection],
    ways: Sequence[tuple[str, str]] = tuple((o, i) for o in ORDERS for i in INPUT_MODES),
) -> list[LargestStep]:
    """The limit of each way to step; empty if no signal comes back through connections.

    Parameters
    ----------
    parts : mapping of str to Linear
        Components by name, in the order of stepping.
    ways : sequence of (str, str)
        Orders and inputs.
    """
    loop = looped(parts, connections)
    if not loop.parts:
        return []
    poles = connected(loop.parts, loop.connections).poles
    rates = np.abs(poles[poles != 0])
    rates = rates if len(rates) else np.ones(1)
    tried = np.geomspace(
        FASTEST / rates.max(),
        SLOWEST / rates.min(),
        1 + math.ceil(math.log(SLOWEST / FASTEST * rates.max() / rates.min(), RATIO)),
    )
    held = cache(lambda name, step: hold(loop.parts[name].A, loop.parts[name].B, step))

    def eigenvalues(step: float, way: tuple[str, str]) -> np.ndarray:
        return np.linalg.eigvals(transition(loop.parts, loop.connections, step, *way, held))

    return [_largest(partial(eigenvalues, way=way), way, tried.tolist()) for way in ways]


def _largest(
    eigenvalues: Callable[[float], np.ndarray], way: tuple[str, str], tried: Sequence[float]
) -> LargestStep:
    def growth(step: float) -> float:
        return float(np.abs(eigenvalues(step)).max())

    low = 0.0
    for high in tried:
        if growth(high) >= 1.0:
            break
        low = high
    else:
        return LargestStep(*way, math.inf, math.nan)
    if low == 0.0:
        return LargestStep(*way, 0.0, math.nan)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if growth(middle) < 1.0 else (low, middle)
    found = eigenvalues(low)
    angle = abs(np.angle(found[np.abs(found).argmax()]))
    return LargestStep(*way, low, float(angle / (2 * math.pi * low)))


def transition(
    parts: Mapping[str, Linear],
    connections: Sequence[Connection],
    step: float,
    order: str = "jacobi",
    inputs: str = "held",
    held: Callable[[str, float], Held] | None = None,
) -> np.ndarray:
    """Matrix from one communication point to the next, shape (n, n).

    It acts on the deviations of all states, then all outputs, then, if inputs are extrapolated, the
    slopes of all outputs; each by component. `held` gives `hold` of a component, at a step.
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
    before = y.copy(), dy.copy()
    stepped: list[str] = []
    for name, part in parts.items():
        rows, own = slices[name]
        fed = sources[name]
        ahead = np.array([[c in stepped and order != "jacobi"] for c, _ in fed], float)
        y_fed, dy_fed = before if order == "jacobi" else (y, dy)
        places = [place for _, place in fed]
        slope = dy_fed[places]
        u = y_fed[places] - step * ahead.reshape(-1, 1) * slope
        free, forced, ramped = held(name, step)
        x[rows] = free @ x[rows] + forced @ u + ramped @ slope
        end = u + step * slope
        y[own] = part.C @ x[rows] + part.D @ end
        if sloped:
            dy[own] = part.C @ (part.A @ x[rows] + part.B @ end) + part.D @ slope
        stepped.append(name)
    return np.vstack([x, y, dy] if sloped else [x, y])


Source = tuple[str, int]  # component, and place among all outputs


def _layout(
    parts: Mapping[str, Linear], connections: Sequence[Connection]
) -> tuple[dict[str, tuple[slice, slice]], dict[str, list[Source]]]:
    """Places of each component's states and outputs; the source of each of its inputs."""
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
