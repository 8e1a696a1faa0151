"""Reference trajectories, the error of a run against them, and the bounds on it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rparm import files, project
from rparm.errors import UserError
from rparm.files import is_file, read_toml
from rparm.fmi.model import Model
from rparm.runs.simulation import Result
from rparm.scenarios.scenario import Scenario

SMALLEST_SCALE = 1e-3  # in the variable's unit; below it an error counts as absolute

ERROR_PER_TOLERANCE = 1000.0
# largest error allowed at a tolerance, and at every tighter one
BOUNDS = {1e-8: 1e-6, 1e-11: 1e-8}

# name -> names whose absolute values are summed up to the scale of its error
Summed = Mapping[str, tuple[str, ...]]


class Compared:
    """A run that has been compared: which of its variables is farthest from the reference."""

    errors: dict[str, float]  # by name, as `errors` gives them

    @property
    def worst(self) -> str:
        """The variable with the largest error; NaN counts as larger than all."""
        return list(self.errors)[int(np.argmax(list(self.errors.values())))]

    @property
    def error(self) -> float:
        """The largest error of all variables; NaN if one of them is."""
        return self.errors[self.worst]


@dataclass(frozen=True, eq=False)
class Reference:
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
    """Read and check the reference of `scenario`, which was checked against `model`.

    UserError if the file is missing, damaged, or not of this scenario; names the line and the
    command that makes references.
    """
    path = project.reference_file(scenario.path, model.name)
    folder = project.model_folder(scenario.path)
    wrong = failure(path, folder, scenario.name)
    (_, *names), table = files.read_trajectory(path, wrong)
    _check_names(names, model, wrong)
    _check_times(table[:, 0], scenario, wrong)
    return Reference(path, table[:, 0], tuple(names), table[:, 1:], read_summed(folder))


def failure(path: Path, folder: Path, name: str) -> files.Failure:
    """Makes errors of the reference `name` of a model or system, with how to make it again."""
    return files.csv_failure(path, f"; {project.making_references(folder, name)}")


def read_summed(folder: Path) -> Summed:
    """Errors of a model or system, by folder, that a sum scales; UserError if the file is wrong."""
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

    `columns` are the reference of all variables, (rows,) each; a sum of which a term is missing
    does not count.
    """
    terms = summed.get(name, ())
    if not terms or not set(terms) <= set(columns):
        terms = (name,)
    largest = float(np.max(sum(np.abs(columns[term]) for term in terms)))
    return max(largest, SMALLEST_SCALE)


def errors(result: Result, reference: Reference) -> dict[str, float]:
    """Error of each variable of `result`, relative: its largest difference over time / `scale`."""
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


def _check_names(names: Sequence[str], model: Model, wrong: files.Failure) -> None:
    """Check that every Real output is there, and nothing else: all columns are compared."""
    for name in names:
        if name not in model.variables or model.variables[name].type != "Real":
            raise wrong(f"the model has no Real variable {name!r}", 1)
        if names.count(name) > 1:
            raise wrong(f"column {name!r} is there twice", 1)
    for name in model.real_outputs:
        if name not in names:
            raise wrong(f"has no column {name!r}", 1)
    for name in names:
        if name not in model.real_outputs:
            raise wrong(f"{name!r} is not an output of the model", 1)


def _check_times(times: np.ndarray, scenario: Scenario, wrong: files.Failure) -> None:
    """Check that the times are those communication points that the scenario asks for."""
    expected = scenario.times[scenario.reference_rows]
    shared = min(len(times), len(expected))
    differing = np.flatnonzero(times[:shared] != expected[:shared])
    other = f"does not match {scenario.path}: expected"
    if len(differing):
        row = int(differing[0])
        found = f"found {float(times[row])!r} s"
        raise wrong(f"{other} time {float(expected[row])!r} s, {found}", row + 2)
    if len(times) != len(expected):
        raise wrong(f"{other} {len(expected)} rows, found {len(times)}", shared + 1)
