"""The job of a campaign: one picklable object with all that workers need, and what they measure.

Measures are numbers of what was recorded in a run. Sums are cumulative ones, in the order of time:
the order of numpy's sum depends on the processor.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rparm.fmi.loop import side_by_side
from rparm.fmi.model import Value
from rparm.systems.python_component import PythonComponent
from rparm.systems.structure import Connection

Archive = bytes | PythonComponent  # content of an FMU, or a component in Python
PLAIN = ("start", "final", "minimum", "maximum", "rms", "integral")  # of one variable
LYAPUNOV = "lyapunov"
FINAL_INTEGER = "final_integer"


# ---- Measures ------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Recorded:
    """Recorded values of a run."""

    times: np.ndarray  # (n + 1,) s
    values: np.ndarray  # (n + 1, variables) in their units
    growth: np.ndarray  # (n,): by how much each step lengthens a small deviation, if one is carried
    integers: Sequence[int] = ()  # (integers,) at the end


@dataclass(frozen=True)
class Measure:
    """A number of a run, and the column of the table that it is in."""

    column: str
    variables: tuple[str, ...]  # that it needs; pairs of them one after the other for tracking
    kind: str
    options: tuple[float, ...] = ()

    def value(self, recorded: Recorded, columns: Sequence[int]) -> float:
        """Return the number; `columns` of the variables, in `values` or `integers`."""
        times, rows = recorded.times, recorded.values
        if self.kind == LYAPUNOV:
            return _log_sum(recorded.growth) / (times[-1] - times[0])
        if self.kind == FINAL_INTEGER:
            return float(recorded.integers[columns[0]])
        if self.kind in ("largest_distance", "rms_distance"):
            pairs = np.array(columns).reshape(-1, 2)
            distance = _distance(rows, pairs[:, 0], pairs[:, 1])
            largest = self.kind == "largest_distance"
            return float(np.max(distance)) if largest else _rms(times, distance)
        values = rows[:, columns[0]]
        match self.kind:
            case "start" | "final":
                return float(values[0 if self.kind == "start" else -1])
            case "minimum" | "maximum":
                return float((np.min if self.kind == "minimum" else np.max)(values))
            case "rms":
                return _rms(times, values)
            case "integral":
                return _integral(times, values)
            case "settling":
                return _settling(times, values, *self.options)
            case "crossings":
                return float(_crossings(values, *self.options))
        raise AssertionError(self.kind)


def plain(kind: str, variable: str) -> Measure:
    """Measure one of `PLAIN` of a variable."""
    return Measure(f"{kind}({variable})", (variable,), kind)


def final_integer(variable: str) -> Measure:
    """Measure the value of an Integer at the end."""
    return Measure(f"final({variable})", (variable,), FINAL_INTEGER)


def _sum(terms: np.ndarray) -> float:
    return float(np.cumsum(terms)[-1]) if len(terms) else 0.0


def _integral(times: np.ndarray, values: np.ndarray) -> float:
    """Integrate over time by the trapezoidal rule."""
    return _sum(0.5 * np.diff(times) * (values[:-1] + values[1:]))


def _rms(times: np.ndarray, values: np.ndarray) -> float:
    """Return the root of the mean square over time."""
    return float(np.sqrt(_integral(times, values * values) / (times[-1] - times[0])))


def _distance(rows: np.ndarray, first: Sequence[int], second: Sequence[int]) -> np.ndarray:
    """Return the distance (n + 1,) of points whose coordinates are columns `first` and `second`."""
    total = np.zeros(len(rows))
    for one, other in zip(first, second, strict=True):
        total += (rows[:, one] - rows[:, other]) ** 2
    return np.sqrt(total)


def _settling(times: np.ndarray, values: np.ndarray, target: float, band: float) -> float:
    """Return the time since the start after which values stay in the band; NaN if none do."""
    outside = np.flatnonzero(~(np.abs(values - target) <= band))
    if not len(outside):
        return 0.0
    after = outside[-1] + 1
    return float(times[after] - times[0]) if after < len(times) else np.nan


def _crossings(values: np.ndarray, level: float) -> int:
    """Count how often the level is crossed upwards."""
    return int(np.count_nonzero((values[:-1] < level) & (level <= values[1:])))


def _log_sum(growth: np.ndarray) -> float:
    """Sum the logarithms; factors are multiplied as far as they go, which rounds less."""
    total, product = 0.0, 1.0
    for factor in growth.tolist():
        product *= factor
        if not 1e-100 < product < 1e100:
            total += float(np.log(product))
            product = 1.0
    return total + float(np.log(product))


# ---- The job -------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Component:
    """An instance of an FMU."""

    name: str
    archive: str  # hash of its FMU or code
    values: dict[str, Value]  # set before initialization


@dataclass(frozen=True)
class HeldInputs:
    """Inputs with zero-order hold, as a scenario gives them: a row for each step."""

    names: tuple[str, ...]
    values: np.ndarray  # (n + 1, names)

    @staticmethod
    def of(inputs: Mapping[str, np.ndarray], count: int, kind: type) -> "HeldInputs":
        """Return inputs by name, (count,) each."""
        return HeldInputs(tuple(inputs), side_by_side(inputs.values(), count, kind))


@dataclass(frozen=True)
class Target:
    """Variable that a parameter of the campaign sets."""

    component: int
    variable: str
    held: int | None  # column of the held inputs; None: no input


@dataclass(frozen=True)
class Wiring:
    """How the components of a system are connected and step."""

    connections: tuple[Connection, ...]
    order: str
    rates: dict[str, float]  # s


@dataclass(frozen=True)
class Job:
    """All runs of a campaign, without their parameters."""

    components: tuple[Component, ...]
    start: float  # s
    stop: float  # s
    tolerance: float | None
    times: np.ndarray  # (n + 1,) communication points in s
    reals: HeldInputs
    switches: HeldInputs
    watched: tuple[str, ...]  # recorded variables
    integers: dict[str, tuple[int, str]]  # component and variable of those read at the end
    tangent: tuple[np.ndarray, ...] | None  # what loop.Tangent takes
    targets: tuple[tuple[str, Target], ...]  # by column of the table
    measures: tuple[Measure, ...]
    trajectories: frozenset[int]  # runs of which all that is recorded is kept
    hashes: dict[str, str]  # SHA-256 of the files that determine the runs
    wiring: Wiring | None = None  # of a system

    @property
    def steps(self) -> int:
        return len(self.times) - 1
