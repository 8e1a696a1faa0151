"""Reference trajectories, the error of a run against them, and the bounds on it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cosim import project, trajectory_csv
from cosim.errors import UserError
from cosim.fmi.model import Model
from cosim.input_files import is_file, read_toml
from cosim.runs.simulation import Result
from cosim.scenarios.scenario import Scenario

SMALLEST_SCALE = 1e-3  # in the variable's unit; below it an error counts as absolute

ERROR_PER_TOLERANCE = 1000.0
# largest error allowed at a tolerance, and at every tighter one
BOUNDS = {1e-8: 1e-6, 1e-11: 1e-8}

# name -> names whose absolute values are summed up to the scale of its error
Summed = Mapping[str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference trajectory of one scenario."""

    path: Path
    times: np.ndarray  # (rows,) s
    names: tuple[str, ...]
    values: np.ndarray  # (rows, len(names)) in the variables' units
    summed: Summed = field(default_factory=dict)

    def column(self, name: str) -> np.ndarray:
        """Values of one variable, (rows,)."""
        if name not in self.names:
            raise UserError(f"{self.path}, line 1: has no column {name!r}")
        return self.values[:, self.names.index(name)]

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Values of all variables, (rows,) each."""
        return dict(zip(self.names, self.values.T, strict=True))

    def scale(self, name: str) -> float:
        """What an error of a variable is divided by, in its unit."""
        return scale(self.columns, name, self.summed)


def load(scenario: Scenario, model: Model) -> Reference:
    """Read and check the reference of `scenario`.

    Parameters
    ----------
    scenario : Scenario
    model : Model
        What the scenario was checked against.

    Raises
    ------
    UserError
        If the file is missing, damaged, or not of this scenario; names the line and the command
        that makes references.
    """
    path = project.reference_file(scenario.path, model.name)
    reader = _Reader(path, scenario)
    names, table = trajectory_csv.read(path, reader.fail)
    reader.check_names(names[1:], model)
    reader.check_times(table[:, 0])
    summed = read_summed(project.model_folder(scenario.path))
    return Reference(path, table[:, 0], names[1:], table[:, 1:], summed)


def read_summed(folder: Path) -> Summed:
    """Which errors of a model or system, by its folder, have the scale of a sum; maybe none.

    Raises
    ------
    UserError
        If the file is wrong.
    """
    path = project.scales_file(folder)
    if not is_file(path):
        return {}
    content = read_toml(path)
    for name, terms in content.items():
        if not (isinstance(terms, list) and terms and all(isinstance(x, str) for x in terms)):
            raise UserError(f"{path}: {name}: expected a list of variables")
    return {name: tuple(terms) for name, terms in content.items()}


def scale(columns: Mapping[str, np.ndarray], name: str, summed: Summed) -> float:
    """What an error of a variable is divided by, in its unit: its largest value, or that of a sum.

    Parameters
    ----------
    columns : mapping of str to ndarray
        Reference of all variables, (rows,) each.
    name : str
    summed : mapping
        As `read_summed` gives it; a sum of which a term is missing does not count.
    """
    terms = summed.get(name, ())
    if not terms or not set(terms) <= set(columns):
        terms = (name,)
    largest = float(np.max(sum(np.abs(columns[term]) for term in terms)))
    return max(largest, SMALLEST_SCALE)


def errors(result: Result, reference: Reference) -> dict[str, float]:
    """Relative error of each variable of `result`: max |value - reference| / scale."""
    return {
        name: float(np.max(np.abs(values - reference.column(name)))) / reference.scale(name)
        for name, values in zip(result.names, result.values.T, strict=True)
    }


def bound(tolerance: float) -> float:
    """Largest error allowed of a run at a relative tolerance.

    1000 times the tolerance, and no more than 1e-6 from tolerance 1e-8 on and 1e-8 from tolerance
    1e-11 on: of these the least that applies.
    """
    applying = [error for loosest, error in BOUNDS.items() if tolerance <= loosest]
    return min([ERROR_PER_TOLERANCE * tolerance, *applying])


class _Reader:
    """Checks one file; errors name the file, the line and the way out."""

    def __init__(self, path: Path, scenario: Scenario) -> None:
        self.path = path
        self.scenario = scenario

    def fail(self, message: str, line: int | None = None) -> UserError:
        place = f"{self.path}, line {line}" if line else f"{self.path}"
        folder = project.model_folder(self.scenario.path)
        return UserError(
            f"{place}: {message}; {project.making_references(folder, self.scenario.name)}"
        )

    def check_names(self, names: tuple[str, ...], model: Model) -> None:
        """Check that every Real output is there, and nothing else: all columns are compared."""
        for name in names:
            if name not in model.variables or model.variables[name].type != "Real":
                raise self.fail(f"the model has no Real variable {name!r}", 1)
            if names.count(name) > 1:
                raise self.fail(f"column {name!r} is there twice", 1)
        for name in model.real_outputs:
            if name not in names:
                raise self.fail(f"has no column {name!r}", 1)
        for name in names:
            if name not in model.real_outputs:
                raise self.fail(f"{name!r} is not an output of the model", 1)

    def check_times(self, times: np.ndarray) -> None:
        """Check that the times are those communication points that the scenario asks for."""
        expected = self.scenario.times[self.scenario.reference_rows]
        shared = min(len(times), len(expected))
        wrong = np.flatnonzero(times[:shared] != expected[:shared])
        if len(wrong):
            row = wrong[0]
            raise self.fail(
                f"does not match {self.scenario.path}: expected time {float(expected[row])!r} s, "
                f"found {float(times[row])!r} s",
                int(row) + 2,
            )
        if len(times) != len(expected):
            raise self.fail(
                f"does not match {self.scenario.path}: expected {len(expected)} rows, "
                f"found {len(times)}",
                shared + 1,
            )
