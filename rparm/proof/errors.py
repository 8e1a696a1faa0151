"""Proven errors of runs and references: how far they are from the exact motion at most."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rparm import project
from rparm.errors import UserError, hint
from rparm.files import from_here
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import METHOD, SMALLEST_TOLERANCES
from rparm.proof.enclosure import Enclosure, Progress, prover_of
from rparm.runs import comparison, simulation
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from rparm.units import rounded_up

UNDERFLOW = 2.0**-800  # in SI units: above all that intervals around 0 allow for underflow
# of a scenario that is proven where nobody asks for it: communication steps, s of the processor
MOST_STEPS = 5_000
LONGEST_RUN = 10.0
SHOWN = 5  # wrong values of a reference


def is_nearest(values: np.ndarray, enclosure: Enclosure, rows: np.ndarray) -> np.ndarray:
    """Return which values (rows, names) are proven to be the doubles nearest to the exact ones.

    `rows` are their communication points. 0 is so up to `UNDERFLOW`: intervals are no narrower.
    """
    distance = distances(values, enclosure, rows)
    side = (enclosure.high[rows] - values) + enclosure.low[rows]  # where the exact value is
    gap = np.abs(np.nextafter(values, np.copysign(math.inf, side)) - values)
    return (distance < gap / 2) | ((values == 0.0) & (distance < UNDERFLOW))


def distances(values: np.ndarray, enclosure: Enclosure, rows: np.ndarray) -> np.ndarray:
    """Bound |value - exact value|, shape (rows, names); arguments as in `is_nearest`."""
    # the factor covers the roundings of these operations, far fewer than 30 of 2^-53 each
    beside = np.abs((values - enclosure.high[rows]) - enclosure.low[rows])
    return (beside + enclosure.radius[rows]) * (1 + 2.0**-48)


# ---- Proven errors -------------------------------------------------------------------------------
@dataclass(frozen=True)
class ProvenError:
    """Of one variable in one run."""

    error: float  # largest |run - exact motion| at communication points, in its unit
    at: float  # s, where
    radius: float  # of the widest interval that contains the exact value


@dataclass(frozen=True)
class WrongValue:
    """A value of a reference that is not proven to be the double nearest to the exact one."""

    file: Path
    line: int
    column: str
    value: float
    exact: float  # rounded to a double
    within: float  # how far the exact value is from that at most

    def __str__(self) -> str:
        where = f"{from_here(self.file)}, line {self.line}, column {self.column}"
        exact = f"the exact value is within {rounded_up(self.within, 1)} of {self.exact!r}"
        return f"{where}: found {self.value!r}, {exact}"


@dataclass(frozen=True)
class ProvenReference:
    """Proven error of a scenario's reference."""

    values: int  # of all columns
    nearest: int  # those that are proven to be the doubles nearest to the exact ones
    radius: float  # of the widest interval
    wrong: tuple[WrongValue, ...]  # the first ones of the others, at most `SHOWN`

    @property
    def passed(self) -> bool:
        return self.nearest == self.values


def methods_of(fmu: Fmu, chosen: str | None = None) -> list[str]:
    """List the methods of integration of an FMU, or the chosen one; UserError if it has none."""
    variable = fmu.model.variables.get(METHOD)
    known = list(variable.items) if variable is not None else []
    if chosen is not None and chosen not in known:
        raise UserError(f"--method: no method {chosen!r}{hint(chosen, known)}")
    return [chosen] if chosen is not None else known


def tolerance_of(method: str, tolerance: float) -> float:
    """Return the relative tolerance that a method integrates at if asked for one."""
    return max(tolerance, SMALLEST_TOLERANCES.get(method, 0.0))


def error_bounds(
    fmu: Fmu,
    scenario: Scenario,
    enclosure: Enclosure,
    method: str,
    tolerance: float,
    progress: Progress | None = None,
) -> np.ndarray:
    """Bound the errors in a run, (communication points, names), in the names' units.

    The run ends with the enclosure.
    """
    count = len(enclosure.times)
    if count < 2:
        return distances(enclosure.high, enclosure, np.arange(count))
    parameters = scenario.parameters | {METHOD: fmu.model.variables[METHOD].items[method]}
    run = replace(
        scenario, parameters=parameters, reference_every=1, stop=float(enclosure.times[-1]),
        times=scenario.times[:count], elapsed=scenario.elapsed[:count],
        inputs={name: values[:count] for name, values in scenario.inputs.items()},
    )  # fmt: skip
    result = simulation.simulate(fmu, run, tolerance_of(method, tolerance), progress)
    values = _columns(result.names, result.values, enclosure.names)
    return distances(values, enclosure, np.arange(len(enclosure.times)))


def errors_of_run(
    scenario: Scenario, result: Result, most_steps: int = MOST_STEPS
) -> Mapping[str, ProvenError] | None:
    """Bound the errors of a run at the points that were recorded; None: nothing is proven.

    So it is without a prover, where a proof does not come to the end or takes more than
    `LONGEST_RUN` s, and for more than `most_steps` communication steps.
    """
    if scenario.model not in project.proven() or len(scenario.times) > most_steps + 1:
        return None
    try:
        states_only = replace(prover_of(scenario.path), with_outputs=False)
        enclosure = states_only.enclose(scenario, seconds=LONGEST_RUN)
    except UserError:  # takes too long, or what proves cannot be unpacked
        return None
    if enclosure.stopped is not None:
        return None
    rows = scenario.reference_rows
    values = _columns(result.names, result.values, enclosure.names)
    rows = rows[: len(values)]
    return largest_errors(distances(values[: len(rows)], enclosure, rows), enclosure, rows)


def largest_errors(
    errors: np.ndarray, enclosure: Enclosure, rows: np.ndarray | None = None
) -> dict[str, ProvenError]:
    """Return the largest of errors (points, names) by name; `rows`: their communication points."""
    times = enclosure.times if rows is None else enclosure.times[rows]
    worst = np.argmax(errors, axis=0)
    radius = enclosure.radius.max(axis=0)
    return {
        name: ProvenError(float(errors[at, i]), float(times[at]), float(radius[i]))
        for i, (name, at) in enumerate(zip(enclosure.names, worst, strict=True))
    }


def proven_reference(fmu: Fmu, scenario: Scenario, enclosure: Enclosure) -> ProvenReference:
    """Prove the error of a scenario's reference, in all columns; UserError if it has none."""
    expected = comparison.load_reference(scenario, fmu.model)
    rows = scenario.reference_rows
    around = enclosure.of(expected.names)
    nearest = is_nearest(expected.values, around, rows)
    within = distances(around.high[rows], around, rows)
    wrong = []
    for row, i in np.argwhere(~nearest)[:SHOWN]:
        numbers = expected.values[row, i], around.high[rows[row], i], within[row, i]
        place = expected.path, int(row) + 2, expected.names[i]
        wrong.append(WrongValue(*place, *map(float, numbers)))
    radius = float(around.radius[rows].max())
    return ProvenReference(nearest.size, int(nearest.sum()), radius, tuple(wrong))


def _columns(names: Sequence[str], values: np.ndarray, wanted: Sequence[str]) -> np.ndarray:
    return values[:, [list(names).index(name) for name in wanted]]
