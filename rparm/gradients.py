"""Gradients of runs: of FMUs that have them, or that are made from equations to have them."""

import weakref
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rparm import build_cache, project
from rparm.errors import UserError
from rparm.files import is_file
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Value, gradient_name
from rparm.runs import simulation
from rparm.runs.simulation import Input

MOST_KEPT = 16  # FMUs that stay open for the next call


@dataclass(frozen=True, eq=False)
class Gradient:
    """A run and its derivatives.

    Attributes
    ----------
    time : ndarray, (n,)
        s.
    values : ndarray, (n, len(of))
        In the units of the variables.
    gradients : ndarray, (n, len(of), len(by))
        Derivatives of the values at a fixed time, by parameters and starts of states.
    are_exact : bool
        False after an event about which gradients say nothing.
    """

    time: np.ndarray
    values: np.ndarray
    gradients: np.ndarray
    are_exact: bool


def gradient(
    model: str | Path,
    *,
    of: Sequence[str],
    by: Sequence[str],
    stop_time: float | None = None,
    step: float | None = None,
    start_time: float | None = None,
    start_values: Mapping[str, Value] | None = None,
    inputs: Mapping[str, Input] | None = None,
    tolerance: float = 1e-8,
) -> Gradient:
    """Run a model, and return how the run changes with parameters and starts of states.

    The first call builds and opens the FMU, the next ones with the same model and `by` only run it,
    unless a file of the model has changed.

    Parameters
    ----------
    model : path or str
        A file with equations, a model of the project by its name, or an FMU built with gradients.
    of : sequence of str
        States and Real outputs.
    by : sequence of str
        Parameters, and starts of states as "start(NAME)".
    stop_time, step, start_time, start_values, inputs, tolerance
        As for `simulate`.

    Returns
    -------
    Gradient
        `time`, `values`, `gradients` and `are_exact`; row i is after the step to time i.
    """
    for key, names in (("of", of), ("by", by)):
        if isinstance(names, str) or not names:
            raise UserError(f"{key}: expected a list of names, got {names!r}")
    path = Path(model)
    if not path.suffix and not is_file(path):
        path = project.equations_of_model(project.model(str(model))) or path
    fmu = _kept(path, tuple(by))
    wanted = [*of, *(gradient_name(name, each) for name in of for each in by)]
    check(fmu, of, by)
    times = start_time, stop_time, step
    run = simulation.of_program(fmu, times, start_values, inputs, tolerance)
    columns = run.values[:, [run.names.index(name) for name in wanted]]
    values, slopes = np.split(columns, [len(of)], axis=1)
    slopes = slopes.reshape(len(values), len(of), len(by))
    return Gradient(run.times, values, slopes, bool(run.are_exact))


def opened(fmu: Fmu, of: Sequence[str], by: Sequence[str], stack: ExitStack) -> Fmu | None:
    """Return an FMU of the same model with gradients, which `stack` closes; None if it has none.

    UserError if a file has the equations, and they do not give the gradients.
    """
    if not _missing(fmu, of, by):
        return fmu
    equations = project.equations(fmu.path)
    if equations is None:
        return None
    version = fmu.model.fmi_version
    made = stack.enter_context(Fmu(equations, version=version, gradients=by))
    check(made, of, by)
    return made


def check(fmu: Fmu, of: Sequence[str], by: Sequence[str]) -> None:
    """Refuse an FMU that lacks a variable or one of its derivatives: UserError."""
    for name in _missing(fmu, of, by):
        raise UserError(f"{fmu.path}: has no Real output {name!r}, which gradients need")


def _missing(fmu: Fmu, of: Sequence[str], by: Sequence[str]) -> list[str]:
    wanted = [*of, *(gradient_name(name, each) for name in of for each in by)]
    known = {*fmu.model.real_outputs}
    return [name for name in wanted if name not in known]


# ---- FMUs that stay open -------------------------------------------------------------------------
class _Kept:
    """An open FMU, and when the files that it is made from were last changed."""

    def __init__(self, path: Path, by: Sequence[str]) -> None:
        equations = project.equations(path)
        source = equations or path
        files = [file for file, *_ in build_cache.files_of(source)] if equations else [path]
        self._changes = {file: _changed(file) for file in files}
        stack = ExitStack()
        weakref.finalize(self, stack.close)
        self.fmu = stack.enter_context(Fmu(source, gradients=by))

    @property
    def is_current(self) -> bool:
        return all(_changed(file) == then for file, then in self._changes.items())


def _changed(file: Path) -> int:
    return file.stat().st_mtime_ns if is_file(file) else 0


_all_kept: dict[tuple[Path, tuple[str, ...]], _Kept] = {}


def _kept(path: Path, by: tuple[str, ...]) -> Fmu:
    key = path.absolute(), by
    found = _all_kept.pop(key, None)
    if found is None or not found.is_current:
        found = _Kept(path, by)
    _all_kept[key] = found  # as the last one
    for oldest in [*_all_kept][:-MOST_KEPT]:
        _all_kept.pop(oldest, None)
    return found.fmu
