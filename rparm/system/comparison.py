"""Runs of a system's variants in Ecos, compared with their references."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rparm import files, project
from rparm.errors import UserError
from rparm.runs import comparison
from rparm.runs.comparison import Compared, Summed
from rparm.system import ecos
from rparm.system.ssp import Ssp

BOUND = 1e-7  # on the relative error of every variable


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of one variant, at some of the communication points."""

    path: Path
    steps: np.ndarray  # (rows,) the step after which each row is read, 0: the start
    columns: dict[str, np.ndarray]  # (rows,) by component.variable
    summed: Summed

    def scale(self, name: str) -> float:
        """What an error of the variable is divided by, in its unit."""
        return comparison.error_scale(self.columns, name, self.summed)


@dataclass(frozen=True, eq=False)
class Outcome(Compared):
    """A run of one variant, and how far it is from its reference."""

    variant: str
    steps: int
    run: ecos.Run
    errors: dict[str, float]  # largest of each variable, relative

    @property
    def passed(self) -> bool:
        return self.error <= BOUND

    def column(self, name: str) -> np.ndarray:
        """Values of one variable, (rows,)."""
        return self.run.values[:, self.run.names.index(name)]


def recorded(ssp: Ssp) -> list[str]:
    """All Real outputs of all components, then the continuous states that are no outputs."""
    outputs, states = [], []
    for component, model in ssp.models.items():
        outputs += [f"{component}.{name}" for name in model.real_outputs]
        states += [f"{component}.{name}" for name in model.states]
    return list(dict.fromkeys((*outputs, *states)))


def discrete(ssp: Ssp) -> list[str]:
    """All Integer and Boolean outputs of all components; references may have them or not."""
    return [
        f"{component}.{variable.name}"
        for component, model in ssp.models.items()
        for variable in model.variables.values()
        if variable.causality == "output" and variable.type in ("Integer", "Boolean")
    ]


def simulate(
    ssp: Ssp,
    variant: str,
    expected: Reference,
    engine: Callable[[Ssp, str, Sequence[str]], ecos.Run] = ecos.run,
) -> Outcome:
    """Run a variant and compare it; UserError if a component or the engine fails."""
    run = engine(ssp, variant, [*recorded(ssp), *discrete(ssp)])
    errors = {}
    for name, values in expected.columns.items():
        actual = run.values[expected.steps, run.names.index(name)]
        errors[name] = float(np.abs(actual - values).max()) / expected.scale(name)
    return Outcome(variant, ssp.system.steps, run, errors)


def reference_names(system: Path) -> list[str]:
    """Variants that the folder of a system has references of."""
    folder = project.references(system)
    return sorted(path.name for path in folder.glob("*") if path.is_dir())


def load_reference(
    ssp: Ssp, variant: str, system: Path, experiment: tuple[float, float, float]
) -> Reference:
    """Read and check the reference of a variant of the system in a folder.

    References are for `experiment`: start, stop and step in s. UserError if the file is missing,
    damaged, or not of this system; names the line and the command that makes references.
    """
    _check_experiment(ssp, experiment)
    path = project.variant_reference_file(system, variant)
    wrong = comparison.reference_failure(path, system, variant)
    (_, *names), table = files.read_trajectory(path, wrong)
    known = recorded(ssp)
    possible = {*known, *discrete(ssp)}
    for name in names:
        if name not in possible or names.count(name) > 1:
            raise wrong(f"column {name!r} is unknown or there twice", 1)
    for name in known:
        if name not in names:
            raise wrong(f"has no column {name!r}", 1)
    steps = _steps(ssp, table[:, 0], wrong)
    values = dict(zip(names, table[:, 1:].T, strict=True))
    return Reference(path, steps, values, comparison.read_summed(system))


def _steps(ssp: Ssp, times: np.ndarray, wrong: files.Failure) -> np.ndarray:
    """Numbers of the communication points at `times`, (rows,)."""
    system = ssp.system
    steps = np.rint((times - system.start) / system.step).astype(int)
    off = np.abs(times - (system.start + steps * system.step)) > 1e-6 * system.step
    off |= (steps < 0) | (steps > system.steps) | (np.diff(steps, prepend=-1) <= 0)
    if off.any():
        row = int(np.flatnonzero(off)[0])
        raise wrong(f"no communication point: {float(times[row])!r} s", row + 2)
    if steps[-1] != system.steps:
        raise wrong(f"ends before {system.stop!r} s", len(steps) + 1)
    return steps


def _check_experiment(ssp: Ssp, experiment: tuple[float, float, float]) -> None:
    """Check that the references are those of the system's times."""
    system = ssp.system
    if not np.allclose((system.start, system.stop, system.step), experiment, rtol=1e-9, atol=0.0):
        start, stop, step = experiment
        raise UserError(
            f"{ssp.path}: runs from {system.start!r} to {system.stop!r} s in steps of "
            f"{system.step!r} s; the references are for {start!r} to {stop!r} s in steps of "
            f"{step!r} s"
        )
