"""The names that programs use: runs as tables, studies, and FMUs of own equations.

All values are in the units of their variables (SI), times in s. Mistakes raise
`rparm.errors.UserError`, whose text is one line.
"""

import html
import weakref
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rparm import files, project
from rparm.building import build as build
from rparm.errors import UserError, hint, placed
from rparm.federation import federation, network
from rparm.files import written
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Model, Value
from rparm.gradients import Gradient as Gradient
from rparm.gradients import gradient as gradient
from rparm.proof import errors as proof
from rparm.proof.enclosure import prover_of
from rparm.runs import scenario as scenarios
from rparm.runs import simulation
from rparm.runs.comparison import load_reference
from rparm.runs.simulation import Input
from rparm.systems import comparison, ecos, master, opened
from rparm.systems.structure import OpenedSystem
from rparm.units import SECONDS, quantity, unit

if TYPE_CHECKING:
    from rparm.identification.identify import Identification
    from rparm.linearization.linear import Linear

MOST_DRAWN = 10  # columns of a table in a notebook


# ---- Runs ----------------------------------------------------------------------------------------
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
        with written(path):
            files.write_trajectory(Path(path), self._times, self._names, self._values)

    def to_pandas(self) -> Any:
        """Return the columns as a pandas.DataFrame; needs pandas, as the extra `campaign`."""
        with _needing("campaign"):
            import pandas

        return pandas.DataFrame(dict(self))

    def plot(self, *names: str, output: str | Path | None = None, show: bool = True) -> Path:
        """Plot columns over time on a page, a diagram for each unit; return its path.

        Parameters
        ----------
        names : str
            Of columns; default: all.
        output : path, optional
            Folder for the page; default: "plots" among the reports.
        show : bool
            Open the page in a browser.
        """
        from rparm.report import overview, pages, run_data  # take long to import

        curves: dict[str, list[run_data.Curve]] = {}
        for name in names or self._names:
            curve = run_data.result_curve(name, self[name])
            curves.setdefault(unit(self.units.get(name)), []).append(curve)
        plots = [
            run_data.Plot(", ".join(curve.name for curve in drawn), of_all, drawn)
            for of_all, drawn in curves.items()
        ]
        rows = run_data.thinned([values for plot in plots for values in plot.columns])
        drawn = [plot.at(rows) for plot in plots]
        data = run_data.RunData("table", "Run", self._times[rows], drawn)
        about = "Run", f"{self._size}.", overview.RAN
        page = pages.RunPage(*about, facts=(), data=data, tables=())
        folder = Path(output or project.report_folder("plots"))
        with written(folder):
            path = pages.write_alone(folder, page)
        if show:
            webbrowser.open_new_tab(path.absolute().as_uri())
        return path

    @property
    def _size(self) -> str:
        span = f"{self._times[0]:g} to {self._times[-1]:g} s"
        return f"{len(self._times)} rows from {span}, {len(self)} columns"

    def _repr_html_(self) -> str:
        """Draw the first columns for notebooks, without scripts."""
        from rparm.report.overview import sparkline_svg

        shown = self._names[:MOST_DRAWN]
        more = f", {len(shown)} drawn" if len(shown) < len(self._names) else ""
        rows = []
        for name in shown:
            finite = self[name][np.isfinite(self[name])]
            range_of = f"{finite.min():.4g} to {finite.max():.4g}" if len(finite) else "not finite"
            texts = html.escape(name), html.escape(f"{range_of} {unit(self.units.get(name))}")
            picture = sparkline_svg(self._times, self[name])
            rows.append(f"<tr><th>{texts[0]}</th><td>{picture}</td><td>{texts[1]}</td></tr>")
        return f"<table><caption>{self._size}{more}</caption>{''.join(rows)}</table>"


def fmu(name: str, fmi: int = 2) -> Path:
    """Return the file of an FMU of the project.

    Parameters
    ----------
    name : str
        Of the FMU without its suffix, or of the folder of its model.
    fmi : int
        Version of FMI: 2 or 3.
    """
    return project.built(project.model(name), ".fmu", version=version(fmi))


def simulate(
    fmu: str | Path,
    *,
    stop_time: float | None = None,
    step: float | None = None,
    start_time: float | None = None,
    start_values: Mapping[str, Value] | None = None,
    inputs: Mapping[str, Input] | None = None,
    outputs: Sequence[str] | None = None,
    tolerance: float = 1e-8,
) -> Table:
    """Run an FMU for co-simulation, of FMI 2.0 or 3.0.

    Parameters
    ----------
    fmu : path
        Any FMU; see `fmu` for the project's.
    stop_time, step, start_time : float
        s; default: those of the FMU's default experiment, else from 0, in 200 steps. `step`
        is the communication step; a whole number of them leads to the stop time.
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
    with Fmu(path) as opened:
        model = opened.model
        names = list(model.real_outputs if outputs is None else outputs)
        for name in names:
            if name not in model.real_outputs:
                raise UserError(
                    f"{path}: has no Real output {name!r}{hint(name, model.real_outputs)}"
                )
        times = start_time, stop_time, step
        result = simulation.of_program(opened, times, start_values, inputs, tolerance)
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
        self.path = project.scenario_file(name)
        self.title = scenarios.title(self.path)

    def run(self, *, fmi: int = 2, tolerance: float | None = None) -> Table:
        """Run it on the FMU of its model, or that its file names; rows are its reference's.

        Parameters
        ----------
        fmi : int
            Version of FMI: 2 or 3; an FMU that the file names has its own.
        tolerance : float, optional
            Relative; default: the scenario's.
        """
        with self._opened(fmi) as (opened, loaded):
            loaded = replace(loaded, panels=())  # Integers, which only pages draw, cost time
            result = simulation.simulate(opened, loaded, tolerance)
            return Table(result.times, result.names, result.values, _units(opened.model))

    def errors(self, table: Table) -> dict[str, float]:
        """Return each output's largest error against the reference, relative to its scale."""
        with self._opened(2) as (opened, loaded):
            expected = load_reference(loaded, opened.model)
        if len(table["time"]) != len(expected.times):
            raise UserError(f"{self.path}: the reference has {len(expected.times)} rows")
        return {
            name: float(np.abs(table[name] - column).max()) / expected.scale(name)
            for name, column in expected.columns.items()
        }

    def proven_errors(
        self, *, method: str | None = None, tolerance: float | None = None
    ) -> dict[str, float]:
        """Bound each state's distance from the exact motion by validated integration.

        Assumed are the equations of motion, exact parameters and inputs as given, and IEEE doubles.

        Parameters
        ----------
        method : str, optional
            Of integration; default: the scenario's.
        tolerance : float, optional
            Relative; default: the scenario's.

        Returns
        -------
        dict of str to float
            Largest distance at communication points, by the name of the state, in its unit.
        """
        program = prover_of(self.path)
        with self._opened(2) as (opened, loaded):
            enclosure = program.enclose(loaded).of(program.states)
            if enclosure.stopped is not None:
                raise UserError(f"{self.path}: {enclosure.stopped}")
            used = method or opened.model.method(loaded.parameters)
            (used,) = proof.methods_of(opened, used)
            found = proof.error_bounds(
                opened, loaded, enclosure, used, tolerance or loaded.tolerance
            )
        return dict(zip(enclosure.names, found.max(axis=0).tolist(), strict=True))

    @contextmanager
    def _opened(self, fmi: int) -> Iterator[tuple[Fmu, scenarios.Scenario]]:
        subject = scenarios.subject_of(self.path)
        with Fmu(project.fmu_of(subject, version=version(fmi))) as opened:
            yield opened, scenarios.load(self.path, opened.model)


class System:
    """A system of connected components: a loop file, an SSP, or one of the project by its name.

    It is opened once, which builds files with equations, and again when a file has changed.

    Attributes
    ----------
    variants : tuple of str
        Names of its parameter sets; "default" if it has none.
    notes : tuple of str
        What was chosen where its file says nothing: times, values of inputs that nothing feeds.
    """

    def __init__(self, name: str | Path, *, fmi: int = 2) -> None:
        self._version = version(fmi)
        self.path = opened.system_file(name, self._version, "")
        self._stack = ExitStack()
        weakref.finalize(self, self._stack.close)
        self._opened: OpenedSystem | None = None
        self._open()

    def _open(self) -> OpenedSystem:
        system = self._opened
        if system is None or self._files != _changes(system):
            self._stack.close()
            self._opened = None  # while opening may fail
            system = self._stack.enter_context(opened.opened(self.path, version=self._version))
            self._opened, self._files = system, _changes(system)
            self.variants, self.notes = tuple(system.system.parameters), tuple(system.notes)
        return system

    def run(
        self,
        variant: str | None = None,
        *,
        parameters: Mapping[str, Value] | None = None,
        step: float | str | None = None,
        engine: str = "master",
    ) -> Table:
        """Step a variant from its start to its stop time, in its file's order.

        Parameters
        ----------
        variant : str, optional
            Default: "default" if there is one, else the first.
        parameters : mapping, optional
            Values in place of the variant's by "component.variable": of parameters, states at the
            start, inputs that nothing feeds; numbers, or texts with a unit ("12 kg").
        step : float or str, optional
            s, or a text with a unit ("10 ms"); communication step in place of the file's.
        engine : str
            "master", rparm's own; "ecos", where ecospy is installed; "helics", each FMU in its
            own process, where helics is installed. These two take neither parameters nor step.

        Returns
        -------
        Table
            Columns "component.variable": what the file keeps, else all outputs and states,
            read after the inputs of the next step have been set. With "helics": all Real outputs,
            read after the step.
        """
        system = self._open()
        variant = system.variant(variant)
        engines = {
            "master": master.run_in_master,
            "ecos": ecos.run,
            "helics": lambda ssp, variant, _: federation.run(ssp, variant, network.free_address()),
        }
        if engine not in engines:
            raise UserError(f"engine: expected one of {', '.join(engines)}, got {engine!r}")
        if engine != "master" and (parameters or step is not None):
            raise UserError(f"engine: {engine!r} takes neither parameters nor step")
        changed = system.with_values(variant, parameters or {})
        if step is not None:
            with placed("step"):
                step = quantity(step, SECONDS)
            times = changed.system.start, changed.system.stop, step
            with placed(self.path):
                simulation.communication_points(*times)  # checks them
            changed = replace(changed, system=replace(changed.system, step=step))
        names = comparison.kept(changed)
        run = engines[engine](changed, variant, names)
        units = {name: changed.variable(name).unit for name in run.names}
        return Table(run.times, run.names, run.values, units)

    def study_coupling(self, output: str | Path) -> dict[str, dict[str, object]]:
        """Study what the coupling costs, if the system has such a study; prints its tables.

        Parameters
        ----------
        output : path
            Folder for its picture.

        Returns
        -------
        dict of str to dict
            Numbers of each part of the study; "passed" says whether they are as expected.
        """
        folder, known = comparison.coupling_study()
        if not project.is_built_from(self.path.stem, folder):
            raise UserError(f"{self.path}: has no study of its coupling, {folder.name} has one")
        return known.study_coupling(self.path, Path(output))


def _changes(system: OpenedSystem) -> dict[Path, int]:
    """Return when each file of a system was last changed."""
    known = {system.path, *system.files.values(), *system.read}
    return {file: file.stat().st_mtime_ns for file in known if files.is_file(file)}


def version(fmi: int) -> str:
    """Return the version of FMI by its first digit; UserError if it is unknown."""
    found = project.fmi_version(fmi)
    if found is None:
        raise UserError(f"fmi: expected 2 or 3, got {fmi!r}")
    return found


def _units(model: Model) -> dict[str, str | None]:
    return {variable.name: variable.unit for variable in model.variables.values()}


# ---- Studies -------------------------------------------------------------------------------------
def linearize(
    fmu_or_ssp: str | Path,
    *,
    at: Mapping[str, Value] | None = None,
    time: float | None = None,
    trim: Sequence[str] = (),
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    variant: str = "",
    break_at: str = "",
    without: Sequence[str] = (),
    fmi: int = 2,
) -> "Linear":
    """Return the linear model of an FMU or system; docs/linear-models.md explains.

    Parameters
    ----------
    fmu_or_ssp : path or str
        A file, or a name of the project; a name is taken from version `fmi` of FMI.
    at : mapping, optional
        States, inputs and parameters by name, as numbers or texts with a unit ("30 deg"); with
        `trim` also outputs, and first guesses of what is moved. In a system names are
        "component.variable".
    time : float, optional
        s; default: the start of the FMU's default experiment, or of the system.
    trim : sequence of str
        States and inputs to move until the point is an equilibrium.
    inputs, outputs : sequence of str, optional
        Those of the model; default: all.
    variant, break_at, without
        Of a system: its parameter set (default: as for System.run), an input whose connection is
        cut, and components that are taken as ideal.

    Returns
    -------
    Linear
        `A`, `B`, `C`, `D`; `states`, `inputs`, `outputs`, `held`; `dt`, in s, if samplers make it
        discrete; `ss()` and `zoh(step)` give them to python-control. With `break_at` also `loop`
        and `margins`, whose `disk`, `sensitivity` and `complementary` have `value` and `frequency`.
    """
    with _needing("control"):
        from rparm.linearization.study import Request, study
    asked = Request(
        fmu_or_ssp, at or {}, time, tuple(trim), inputs, outputs, variant, break_at, tuple(without),
        version=version(fmi),
    )  # fmt: skip
    return study(asked).linear


def identify(
    fmu: str | Path,
    logs: str | Path | Sequence[str | Path],
    *,
    parameters: Sequence[str],
    inputs: Sequence[str],
    measured: Sequence[str],
    settings: Mapping[str, Value] | None = None,
    start: Mapping[str, Value] | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    delay: bool = False,
    validate: str | Path | None = None,
    segment: float = 0.4,
    tolerance: float = 1e-8,
) -> "Identification":
    """Fit parameters of an FMU to logs of a machine; needs the extra `control`.

    Parameters
    ----------
    fmu : path
        Any FMU for co-simulation whose states can be set, or a file with equations; see `fmu` for
        the project's.
    logs : path or sequence of path
        CSV files with a row of names; "time" in s. Cells may be empty.
    parameters : sequence of str
        To be estimated. "name>other" stays above another parameter.
    inputs, measured : sequence of str
        Inputs and Real outputs that the logs have.
    settings, start : mapping, optional
        Values of other parameters; where the fit begins, of parameters and of states.
    columns, units : mapping, optional
        Names and units of columns, by variable, where they differ from its own.
    delay : bool
        Estimate by how much the measured values are late, too.
    validate : path, optional
        A log to run with the result.
    segment, tolerance : float
        Length of a segment in s; relative tolerance of the integrator.

    Returns
    -------
    Identification
        `estimates` by name, each with `value`, `low` and `high` (95 %, by the scatter between
        segments) and `classical`; `combinations` that cannot be known; `chi2`, `whiteness`,
        `validation`, `warnings`.
    """
    with _needing("control"):
        from rparm.identification import identify as identification
        from rparm.identification.request import Request
    files = [logs] if isinstance(logs, str | Path) else logs
    request = Request(
        logs=[Path(log) for log in files], parameters=parameters, inputs=inputs,
        measured=measured, settings=settings or {}, starts=start or {}, columns=columns or {},
        units=units or {}, with_delay=delay, segment=segment, tolerance=tolerance,
        validation=None if validate is None else Path(validate),
    )  # fmt: skip
    with Fmu(Path(fmu)) as opened:
        return identification.identify(opened, request)


def run_campaign(
    file: str | Path,
    *,
    output: str | Path | None = None,
    fmu: str | Path | None = None,
    workers: int | None = None,
) -> dict[str, np.ndarray]:
    """Make all runs of a campaign that are missing, in processes of this machine.

    The processes import your program: call this under ``if __name__ == "__main__":``.

    Parameters
    ----------
    file : path or str
        The campaign, as the command takes it.
    output : path, optional
        Folder for the results; default: the file's, or the command's.
    fmu : path, optional
        The FMU or SSP; default: the project's.
    workers : int, optional
        Number of processes; default: one a core.

    Returns
    -------
    dict of str to ndarray
        A value a run, (runs,), in SI units: "run", parameters, what is kept, and "failure", why a
        run failed, else empty.
    """
    with _needing("campaign"):
        from rparm.campaign import engine, work
    with work.opened(
        project.campaign_file(file), fmu and Path(fmu), output and Path(output)
    ) as made:
        if blocks := made.begin():
            with (
                made.results.workers_folder() as files,
                engine.opened_cluster(None, workers, files) as client,
            ):
                made.run(client, blocks)
        return made.table()


@contextmanager
def _needing(extra: str) -> Iterator[None]:
    """Say how to install what an extra of the distribution has, if an import finds it missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise project.not_installed(str(error.name), extra) from error
