"""What programs use: FMUs by their names, runs as tables, scenarios and systems.

All values are in the units of their variables (SI), times in s. What is wrong raises
`rparm.errors.UserError`, whose text is one line.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np

from rparm import project, trajectory_csv
from rparm.coupling import in_process
from rparm.errors import UserError, hint, placed
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import INITIAL, INPUTS, PARAMETERS, Model, Value
from rparm.runs import reference, simulation
from rparm.scenarios import scenario as scenarios
from rparm.system import comparison, ecos, ssp

Input = float | bool | np.ndarray | Sequence[float] | tuple[Any, Any] | Callable[[float], float]
WHOLE = 1e-9  # of a step: by so much the stop time may miss a communication point


class Table(Mapping[str, np.ndarray]):
    """Columns of a run, by the names of variables; "time" is the first.

    Attributes
    ----------
    units : dict of str to str
        Of the columns that have one.
    """

    def __init__(
        self,
        times: np.ndarray,
        names: Sequence[str],
        values: np.ndarray,
        units: Mapping[str, str | None],
    ) -> None:
        self._names, self._times, self._values = tuple(names), times, values
        self._columns = {"time": times} | dict(zip(names, values.T, strict=True))
        known = {"time": "s"} | dict(units)
        self.units = {name: unit for name in self._columns if (unit := known.get(name))}

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._columns:
            raise KeyError(f"no column {name!r}{hint(name, self._columns)}")
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        columns = ", ".join(self._columns)
        return f"Table of {len(self._times)} rows: {columns}"

    def to_csv(self, path: str | Path) -> None:
        """Write all columns to a file, with 17 significant digits."""
        try:
            trajectory_csv.write(Path(path), self._times, self._names, self._values)
        except OSError as error:
            raise UserError(f"{path}: cannot be written: {error.strerror}") from error

    def to_pandas(self) -> Any:
        """The columns as a pandas.DataFrame; pandas must be installed."""
        import pandas

        return pandas.DataFrame(dict(self))


def fmu(name: str, fmi: int = 2) -> Path:
    """File of an FMU of the project.

    Parameters
    ----------
    name : str
        Of the FMU without its suffix, or of the folder of its model.
    fmi : int
        Version of FMI: 2 or 3.
    """
    return project.built(project.model(name), ".fmu", version=_version(fmi))


def simulate(
    fmu: str | Path,
    *,
    stop_time: float,
    step: float,
    start_time: float = 0.0,
    start_values: Mapping[str, Value] | None = None,
    inputs: Mapping[str, Input] | None = None,
    outputs: Sequence[str] | None = None,
    tolerance: float = 1e-8,
) -> Table:
    """Run an FMU for co-simulation, of FMI 2.0 or 3.0.

    Parameters
    ----------
    fmu : path
        Any FMU; see `fmu` for those of the project.
    stop_time, step, start_time : float
        s. `step` is the communication step; a whole number of them leads to the stop time.
    start_values : mapping, optional
        Parameters and states by name: numbers, texts with a unit ("30 deg"), items' names.
    inputs : mapping, optional
        Each a number, a function of time in s, a pair (times, values) that is interpolated, or the
        values at all communication points. It is read at the beginning of a step and held over it.
    outputs : sequence of str, optional
        Real outputs to return; default: all.
    tolerance : float
        Relative, of the integrator.

    Returns
    -------
    Table
        Row i is what is read right after the step to time i; row 0 at the start.
    """
    path = Path(fmu)
    times = _times(start_time, stop_time, step)
    if not (_is_number(tolerance) and 0 < tolerance < 1):
        raise UserError(f"tolerance: expected a number between 0 and 1, got {tolerance!r}")
    with Fmu(path) as opened:
        model = opened.model
        names = list(model.real_outputs if outputs is None else outputs)
        for name in names:
            if name not in model.real_outputs:
                raise UserError(
                    f"{path}: has no Real output {name!r}{hint(name, model.real_outputs)}"
                )
        given = _start_values(model, start_values or {})
        signals = {name: _input(model, name, x, times) for name, x in (inputs or {}).items()}
        run = scenarios.Scenario(
            name=path.stem, model=model.name, path=path, title=path.stem, description="",
            parameters=given, initial={}, start=times[0], stop=times[-1], steps=(step,),
            tolerance=tolerance, times=times, signals={}, inputs=signals, reference_every=1,
            defaults=model.start_values,
        )  # fmt: skip
        result = simulation.simulate(opened, run)
        columns = [result.names.index(name) for name in names]
        return Table(result.times, names, result.values[:, columns], _units(model))


class Scenario:
    """A scenario of the project by its name, or one of your own by its file.

    Parameters
    ----------
    name : str or path
        Of a scenario, or a path that ends with .toml.
    """

    def __init__(self, name: str | Path) -> None:
        own = Path(name).suffix.lower() == ".toml"
        self.path = Path(name) if own else project.scenario_file(str(name))
        self.title = scenarios.title(self.path)

    def run(self, *, fmi: int = 2, tolerance: float | None = None) -> Table:
        """Run it on the FMU of its model; rows are those of its reference.

        Parameters
        ----------
        fmi : int
            Version of FMI: 2 or 3.
        tolerance : float, optional
            Relative; default: that of the scenario.
        """
        with self._opened(fmi) as (opened, loaded):
            result = simulation.simulate(opened, loaded, tolerance)
            return Table(result.times, result.names, result.values, _units(opened.model))

    def errors(self, table: Table) -> dict[str, float]:
        """Largest error of each output of a run against the reference, relative to its scale."""
        with self._opened(2) as (opened, loaded):
            expected = reference.load(loaded, opened.model)
        if len(table["time"]) != len(expected.times):
            raise UserError(f"{self.path}: the reference has {len(expected.times)} rows")
        return {
            name: float(np.abs(table[name] - column).max()) / expected.scale(name)
            for name, column in expected.columns.items()
        }

    @contextmanager
    def _opened(self, fmi: int) -> Iterator[tuple[Fmu, scenarios.Scenario]]:
        folder = scenarios.folder_of(self.path)
        with Fmu(project.built(folder, ".fmu", version=_version(fmi))) as opened:
            yield opened, scenarios.load(self.path, opened.model)


class System:
    """A system of connected FMUs, by its name or the path of its SSP.

    Attributes
    ----------
    variants : tuple of str
        Names of its parameter sets.
    """

    def __init__(self, name: str | Path, *, fmi: int = 2) -> None:
        self.path = Path(name)
        if self.path.suffix.lower() != ".ssp":
            known = project.systems()
            if name not in known:
                raise UserError(f"no system {str(name)!r}{hint(str(name), known)}")
            self.path = project.built(known[str(name)], ".ssp", version=_version(fmi))
        with ssp.unpacked(self.path) as opened:
            self.variants = tuple(opened.system.parameters)

    def run(self, variant: str, *, engine: str = "master") -> Table:
        """Step a variant from its start to its stop time, in Jacobi order.

        Parameters
        ----------
        engine : str
            "master", that of rparm, or "ecos", where ecospy is installed.

        Returns
        -------
        Table
            Columns "component.variable": all Real outputs and states, read after the inputs of
            the next step have been set.
        """
        if variant not in self.variants:
            raise UserError(
                f"{self.path}: has no variant {variant!r}{hint(variant, self.variants)}"
            )
        engines = {"master": in_process.run, "ecos": ecos.run}
        if engine not in engines:
            raise UserError(f"engine: expected one of {', '.join(engines)}, got {engine!r}")
        with ssp.unpacked(self.path) as opened:
            names = comparison.recorded(opened)
            run = engines[engine](opened, variant, names)
            units = {name: opened.variable(name).unit for name in names}
        return Table(run.times, names, run.values, units)


def _version(fmi: int) -> str:
    for version in project.VERSIONS:
        if str(fmi) in (version, version[0]):
            return version
    raise UserError(f"fmi: expected 2 or 3, got {fmi!r}")


def _units(model: Model) -> dict[str, str | None]:
    return {variable.name: variable.unit for variable in model.variables.values()}


def _is_number(given: object) -> bool:
    return isinstance(given, Real) and not isinstance(given, bool) and bool(np.isfinite(given))


def _times(start: float, stop: float, step: float) -> np.ndarray:
    """Communication points in s; UserError if no whole number of steps leads to the stop time."""
    for name, value in (("start_time", start), ("stop_time", stop), ("step", step)):
        if not _is_number(value):
            raise UserError(f"{name}: expected a finite number, got {value!r}")
    if start < 0 or stop <= start or step <= 0:
        raise UserError(
            "expected 0 <= start_time < stop_time and step > 0, "
            f"got {start!r}, {stop!r} and {step!r}"
        )
    exact = (stop - start) / step
    count = round(exact)
    if not 1 <= count <= scenarios.MAX_STEPS:
        raise UserError(f"expected 1 to {scenarios.MAX_STEPS} steps, got {exact:.6g}")
    if abs(exact - count) > WHOLE * max(count, 1):
        raise UserError(f"step: expected a whole number of steps to the stop time, got {exact:.6g}")
    times = start + step * np.arange(count + 1)
    times[-1] = stop
    return times


def _start_values(model: Model, given: Mapping[str, Any]) -> dict[str, Value]:
    checked = {}
    for name, value in given.items():
        with placed(f"start_values: {name}"):
            variable = model.variables.get(name)
            kind = INITIAL if variable is not None and variable.is_a(INITIAL) else PARAMETERS
            value = value.item() if isinstance(value, np.generic) else value
            checked[name] = model.find(name, kind).checked(value)
    return checked


def _input(model: Model, name: str, given: Any, times: np.ndarray) -> np.ndarray:
    """Values of an input at all communication points."""
    with placed(f"inputs: {name}"):
        variable = model.find(name, INPUTS)
    boolean = variable.type == "Boolean"
    try:
        values = _sampled(given, times, bool if boolean else float)
    except (TypeError, ValueError) as error:
        raise UserError(f"inputs: {name}: expected numbers: {error}") from error
    if values.shape != times.shape:
        raise UserError(f"inputs: {name}: expected {len(times)} values, got {values.shape}")
    if not boolean:
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            at = float(times[bad[0]])
            raise UserError(f"inputs: {name}: is {values[bad[0]]} at t = {at!r} s, not finite")
        with placed(f"inputs: {name}"):
            variable.check_range(float(values.min()), float(values.max()))
    return values


def _sampled(given: Any, times: np.ndarray, kind: type) -> np.ndarray:
    if isinstance(given, str):
        raise TypeError(f"got the text {given!r}")
    if callable(given):
        return np.array([given(float(t)) for t in times], dtype=kind)
    if isinstance(given, tuple) and len(given) == 2:
        points, values = (np.asarray(part, dtype=float) for part in given)
        if points.ndim != 1 or points.shape != values.shape or not len(points):
            raise ValueError("times and values of a table have the same length")
        if not np.all(np.diff(points) > 0):
            raise ValueError("the times of a table increase")
        return np.interp(times, points, values).astype(kind)
    values = np.asarray(given, dtype=kind)
    return np.full(times.shape, values) if values.ndim == 0 else values
