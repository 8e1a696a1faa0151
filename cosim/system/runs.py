"""Runs the closed loop in Ecos, variant by variant, and compares with the references."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fmpy import read_model_description

from cosim import reference
from cosim.errors import UserError, did_you_mean
from cosim.files import read_csv
from cosim.system import ecos
from cosim.system.ssp import Ssp

ROOT = Path(__file__).resolve().parents[2]
SYSTEM = ROOT / "build" / "ClosedLoop.ssp"
REFERENCES = ROOT / "models" / "closed_loop" / "references"
REFERENCE = "ecos.csv"  # of Jacobi stepping, read after inputs are set
START, STOP = 0.0, 6.0  # s, of the references
STEPS_PER_SECOND = 1000  # that the references are made for
BOUND = 1e-7  # on the relative error of every variable
END_EFFECTOR = (("trajectory.ee_x_ref", "arm.ee_x"), ("trajectory.ee_y_ref", "arm.ee_y"))


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of one variant, at some of the communication points."""

    path: Path
    steps: np.ndarray  # (rows,) the step after which each row is read, 0: the start
    columns: dict[str, np.ndarray]  # (rows,) by component.variable

    def scale(self, name: str) -> float:
        """What an error of the variable is divided by, in its unit; see cosim.reference."""
        component, _, variable = name.partition(".")
        exchanged = [f"{component}.{energy}" for energy in reference.EXCHANGED]
        values = np.abs(self.columns[name])
        if variable in reference.SCALED_BY_EXCHANGE and set(exchanged) <= set(self.columns):
            values = sum(np.abs(self.columns[energy]) for energy in exchanged)
        return max(float(values.max()), reference.SMALLEST_SCALE)


@dataclass(frozen=True, eq=False)
class Outcome:
    """A run of one variant, and how far it is from its reference."""

    variant: str
    run: ecos.Run
    errors: dict[str, float]  # largest of each variable, relative

    @property
    def worst(self) -> str:
        """Variable with the largest error."""
        return max(self.errors, key=self.errors.__getitem__)

    @property
    def error(self) -> float:
        """Largest error of all variables."""
        return self.errors[self.worst]

    @property
    def passed(self) -> bool:
        """Whether all errors are within the bound."""
        return self.error <= BOUND

    def column(self, name: str) -> np.ndarray:
        """Values of one variable, (rows,)."""
        return self.run.values[:, self.run.names.index(name)]

    @property
    def distance(self) -> np.ndarray:
        """Distance of the end effector from its reference, (rows,) m."""
        return np.hypot(*(self.column(actual) - self.column(ref) for ref, actual in END_EFFECTOR))


def choose(ssp: Ssp, names: Sequence[str]) -> list[str]:
    """Variants called `names`, or all of them; UserError for an unknown one."""
    known = list(ssp.system.parameters)
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known)
            raise UserError(f"no variant {name!r}{hint} (there are: {', '.join(known)})")
    return list(dict.fromkeys(names)) or known


def recorded(ssp: Ssp) -> list[str]:
    """All Real outputs of all components, then the continuous states that are no outputs."""
    outputs, states = [], []
    for component in ssp.system.components:
        description = read_model_description(ssp.fmu(component.name), validate=False)
        variables = description.modelVariables
        of_component = [v for v in variables if v.causality == "output" and v.type == "Real"]
        outputs += [f"{component.name}.{variable.name}" for variable in of_component]
        unknowns = [unknown.variable.derivative for unknown in description.derivatives]
        states += [f"{component.name}.{state.name}" for state in unknowns if state is not None]
    return list(dict.fromkeys((*outputs, *states)))


def simulate(ssp: Ssp, variant: str, expected: Reference) -> Outcome:
    """Run a variant and compare it; UserError where a component or Ecos fails."""
    run = ecos.run(ssp, variant, recorded(ssp))
    errors = {}
    for name, values in expected.columns.items():
        actual = run.values[expected.steps, run.names.index(name)]
        errors[name] = float(np.abs(actual - values).max()) / expected.scale(name)
    return Outcome(variant, run, errors)


def load_reference(ssp: Ssp, variant: str, folder: Path = REFERENCES) -> Reference:
    """Read and check the reference of a variant.

    Raises
    ------
    UserError
        If the file is missing, damaged, or not of this system; names the line and the command
        that makes references.
    """
    _check_experiment(ssp)
    path = folder / variant / REFERENCE
    columns, table = read_csv(path, lambda message, line: _wrong(path, variant, message, line))
    names = columns[1:]
    known = recorded(ssp)
    for name in names:
        if name not in known or names.count(name) > 1:
            raise _wrong(path, variant, f"column {name!r} is unknown or there twice", 1)
    for name in known:
        if name not in names:
            raise _wrong(path, variant, f"has no column {name!r}", 1)
    system = ssp.system
    steps = np.rint((table[:, 0] - system.start) / system.step).astype(int)
    off = np.abs(table[:, 0] - (system.start + steps * system.step)) > 1e-6 * system.step
    off |= (steps < 0) | (steps > system.steps) | (np.diff(steps, prepend=-1) <= 0)
    if off.any():
        row = int(np.flatnonzero(off)[0])
        time = float(table[row, 0])
        raise _wrong(path, variant, f"no communication point: {time!r} s", row + 2)
    if steps[-1] != system.steps:
        raise _wrong(path, variant, f"ends before {system.stop!r} s", len(steps) + 1)
    return Reference(path, steps, dict(zip(names, table[:, 1:].T, strict=True)))


def _check_experiment(ssp: Ssp) -> None:
    """Check that the references are those of the system's times."""
    system = ssp.system
    given = (system.start, system.stop, system.step)
    expected = (START, STOP, 1 / STEPS_PER_SECOND)
    if not np.allclose(given, expected, rtol=1e-9, atol=0.0):
        raise UserError(
            f"{ssp.path}: runs from {system.start!r} to {system.stop!r} s in steps of "
            f"{system.step!r} s; the references are for {START!r} to {STOP!r} s in steps of "
            f"{1 / STEPS_PER_SECOND!r} s"
        )


def _wrong(path: Path, variant: str, message: str, line: int | None = None) -> UserError:
    place = f"{path}, line {line}" if line else f"{path}"
    script = f"models/closed_loop/references/make_references.py {variant}"
    return UserError(f"{place}: {message}; to make it again: build/venv/bin/python {script}")
