"""Reference trajectories, the error of a run against them, and the bounds on it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim import variables
from cosim.errors import UserError
from cosim.files import read_csv
from cosim.scenario import Scenario
from cosim.simulation import Result

SMALLEST_SCALE = 1e-3  # in the variable's unit; below it an error counts as absolute
# Kinetic and potential energy cancel in the total, and the zero of the potential is arbitrary:
# errors of these two are measured against what is exchanged, not against what is left.
EXCHANGED = ("kinetic_energy", "potential_energy")
SCALED_BY_EXCHANGE = ("potential_energy", "total_energy")

ERROR_PER_TOLERANCE = 1000.0
# largest error allowed at a tolerance, and at every tighter one
BOUNDS = {1e-8: 1e-6, 1e-11: 1e-8}


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference trajectory of one scenario."""

    path: Path
    times: np.ndarray  # (rows,) s
    names: tuple[str, ...]
    values: np.ndarray  # (rows, len(names)) in the variables' units

    def column(self, name: str) -> np.ndarray:
        """Values of one variable, (rows,)."""
        if name not in self.names:
            raise UserError(f"{self.path}, line 1: has no column {name!r}")
        return self.values[:, self.names.index(name)]


def model_name(scenario: Scenario) -> str:
    """Name of the FMU that a scenario's model is built into, and of its reference files."""
    path = scenario.model_folder / variables.FILE_NAME
    model = variables.read_toml(path).get("model")
    name = model.get("name") if isinstance(model, dict) else None
    if not isinstance(name, str) or not name.isidentifier():
        raise UserError(f"{path}: [model] needs a name, an identifier of C")
    return name


def load(scenario: Scenario) -> Reference:
    """Read and check the reference of `scenario`.

    Raises
    ------
    UserError
        If the file is missing, damaged, or not of this scenario; names the line and the command
        that makes references.
    """
    path = scenario.reference_folder / f"{model_name(scenario)}_ref.csv"
    reader = _Reader(path, scenario)
    names, table = read_csv(path, reader.fail)
    reader.check_names(names)
    reader.check_times(table[:, 0])
    return Reference(path, table[:, 0], names[1:], table[:, 1:])


def scales(reference: Reference) -> dict[str, float]:
    """Return what the error of each variable is divided by, in the variable's unit."""
    scale = {name: _largest(reference.column(name)) for name in reference.names}
    if set(EXCHANGED) <= set(reference.names):
        exchanged = sum(np.abs(reference.column(name)) for name in EXCHANGED)
        for name in SCALED_BY_EXCHANGE:
            scale[name] = _largest(exchanged)
    return scale


def errors(result: Result, reference: Reference) -> dict[str, float]:
    """Relative error of each variable of `result`: max |value - reference| / scale."""
    scale = scales(reference)
    return {
        name: float(np.max(np.abs(values - reference.column(name)))) / scale[name]
        for name, values in zip(result.names, result.values.T, strict=True)
    }


def bound(tolerance: float) -> float:
    """Largest error allowed of a run at a relative tolerance.

    1000 times the tolerance, and no more than 1e-6 from tolerance 1e-8 on and 1e-8 from tolerance
    1e-11 on: of these the least that applies.
    """
    applying = [error for loosest, error in BOUNDS.items() if tolerance <= loosest]
    return min([ERROR_PER_TOLERANCE * tolerance, *applying])


def _largest(values: np.ndarray) -> float:
    return max(float(np.max(np.abs(values))), SMALLEST_SCALE)


class _Reader:
    """Reads one file; errors name the file, the line and the way out."""

    def __init__(self, path: Path, scenario: Scenario) -> None:
        self.path = path
        self.scenario = scenario

    def fail(self, message: str, line: int | None = None) -> UserError:
        place = f"{self.path}, line {line}" if line else f"{self.path}"
        # relative to the project's folder, where the commands of its documentation are meant to run
        script = f"models/{self.scenario.model}/references/make_references.py {self.scenario.name}"
        return UserError(f"{place}: {message}; to make it again: build/venv/bin/python {script}")

    def check_names(self, names: tuple[str, ...]) -> None:
        """Check that every Real output is there, and nothing unknown or twice."""
        declared = variables.load(self.scenario.model_folder)
        for name in names[1:]:
            if declared.get(name, {}).get("type") != "Real":
                raise self.fail(f"the model has no Real variable {name!r}", 1)
            if names.count(name) > 1:
                raise self.fail(f"column {name!r} is there twice", 1)
        for name, variable in declared.items():
            wanted = variable["type"] == "Real" and variable.get("causality") == "output"
            if wanted and name not in names:
                raise self.fail(f"has no column {name!r}", 1)

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
