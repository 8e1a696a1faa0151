"""Proven errors: of runs of an FMU with each method of integration, and of references."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rparm.errors import UserError, hint
from rparm.files import from_here
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import METHOD, SMALLEST_TOLERANCES
from rparm.proof import prover
from rparm.proof.prover import Enclosure, distances
from rparm.runs import comparison, simulation
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from rparm.units import rounded_up

# of a scenario that is proven where nobody asks for it: communication steps, time that it takes
MOST_STEPS = 20_000
SECONDS = 10.0
SHOWN = 5  # wrong values of a reference
ASSUMED = "the equations of motion, exact parameters and inputs as given, and IEEE doubles"


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
    """How good the reference of a scenario is."""

    values: int  # of all columns
    nearest: int  # those that are proven to be the doubles nearest to the exact ones
    radius: float  # of the widest interval
    wrong: tuple[WrongValue, ...]  # the first ones of the others, at most `SHOWN`

    @property
    def passed(self) -> bool:
        return self.nearest == self.values


def methods(fmu: Fmu, chosen: str | None = None) -> list[str]:
    """Methods of integration of an FMU, or the chosen one; UserError if it is not one of them."""
    variable = fmu.model.variables.get(METHOD)
    known = list(variable.items) if variable is not None else []
    if chosen is not None and chosen not in known:
        raise UserError(f"--method: no method {chosen!r}{hint(chosen, known)}")
    return [chosen] if chosen is not None else known


def tolerance_of(method: str, tolerance: float) -> float:
    """The relative tolerance that a method integrates at if asked for one."""
    return max(tolerance, SMALLEST_TOLERANCES.get(method, 0.0))


def bounds(
    fmu: Fmu,
    scenario: Scenario,
    enclosure: Enclosure,
    method: str,
    tolerance: float,
    progress: Callable[[int], object] | None = None,
) -> np.ndarray:
    """Proven errors in a run, (communication points, names of the enclosure), in their units."""
    run = replace(
        scenario,
        parameters=scenario.parameters | {METHOD: fmu.model.variables[METHOD].items[method]},
        reference_every=1,
    )
    result = simulation.simulate(fmu, run, tolerance_of(method, tolerance), progress)
    values = _columns(result.names, result.values, enclosure.names)
    return distances(values, enclosure, np.arange(len(enclosure.times)))


def of_run(
    scenario: Scenario, result: Result, most_steps: int = MOST_STEPS
) -> Mapping[str, ProvenError] | None:
    """Proven errors of a run at the points that were recorded; None: nothing is proven.

    That is so of models without a prover, where the proof does not come to the end, and of
    scenarios of more than `most_steps` communication steps or that take more than `SECONDS`.
    """
    program = prover.provers().get(scenario.model)
    if program is None or len(scenario.times) > most_steps + 1:
        return None
    try:
        enclosure = program.enclose(scenario, seconds=SECONDS)
    except UserError:  # takes too long, or is not there, as in an installed package
        return None
    if enclosure.stopped is not None:
        return None
    enclosure = enclosure.of(program.states)
    rows = scenario.reference_rows
    values = _columns(result.names, result.values, enclosure.names)
    rows = rows[: len(values)]
    return largest(distances(values[: len(rows)], enclosure, rows), enclosure, rows)


def largest(
    errors: np.ndarray, enclosure: Enclosure, rows: np.ndarray | None = None
) -> dict[str, ProvenError]:
    """Largest proven errors of all variables of an enclosure, by name.

    Parameters
    ----------
    errors : ndarray, shape (points, names)
    rows : ndarray of int, shape (points,), optional
        Communication points of the errors; default: all.
    """
    times = enclosure.times if rows is None else enclosure.times[rows]
    worst = np.argmax(errors, axis=0)
    return {
        name: ProvenError(
            float(errors[worst[i], i]), float(times[worst[i]]), float(enclosure.radius[:, i].max())
        )
        for i, name in enumerate(enclosure.names)
    }


def of_reference(fmu: Fmu, scenario: Scenario, enclosure: Enclosure) -> ProvenReference:
    """How good the reference of a scenario is, in all columns; UserError if it has none."""
    expected = comparison.load_reference(scenario, fmu.model)
    rows = scenario.reference_rows
    around = enclosure.of(expected.names)
    nearest = prover.is_nearest(expected.values, around, rows)
    within = distances(around.high[rows], around, rows)
    wrong = tuple(
        WrongValue(
            expected.path,
            int(row) + 2,
            expected.names[i],
            float(expected.values[row, i]),
            float(around.high[rows[row], i]),
            float(within[row, i]),
        )
        for row, i in np.argwhere(~nearest)[:SHOWN]
    )
    radius = float(around.radius[rows].max())
    return ProvenReference(nearest.size, int(nearest.sum()), radius, wrong)


def _columns(names: Sequence[str], values: np.ndarray, wanted: Sequence[str]) -> np.ndarray:
    return values[:, [list(names).index(name) for name in wanted]]
