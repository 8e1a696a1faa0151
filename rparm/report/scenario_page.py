"""The page of a scenario's runs, with what was measured of its outputs."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from rparm import files
from rparm.fmi.model import Model, Value, Variable
from rparm.proof.enclosure import ASSUMED
from rparm.proof.errors import ProvenError, errors_of_run
from rparm.report import motion, overlay, overview
from rparm.report.overview import FAILED, PASSED, RAN, Entry
from rparm.report.pages import PageTable, RunPage
from rparm.report.run_data import Curve, Plot, RunData, result_curve, thinned
from rparm.runs.comparison import Comparison, Failure, Run, comparisons, estimated_from
from rparm.runs.inputs import Constant, Log, Logged, Signal, Sines, Switches
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from rparm.units import bits, duration, number, ordinal, rounded_up, sentence, short, unit

DIGITS = 12  # of values; the references of the project have more, users' files have none
MOST_POINTS = 8  # of a table, to be listed


def write(
    folder: Path,
    name: str,
    runs: Sequence[Run],
    again: str,
    failures: Sequence[Failure] = (),
    other: Log | None = None,
) -> Entry:
    """Write page and values, called `name`, of a scenario to a section; its line in the overview.

    The first run is drawn, over it the `other` result; `failures` did not end. The command `again`
    runs the scenario.
    """
    folder.mkdir(parents=True, exist_ok=True)
    first, scenario = runs[0], runs[0].scenario
    columns = recorded(scenario, first.fmu.model, first.result)
    digits = DIGITS if first.compared else None
    csv = _write_values(folder / f"{name}.csv", first.result, columns, digits)
    drawn, over = _plots(runs, columns), None
    if other is not None:
        elapsed = scenario.elapsed[scenario.reference_rows][: len(first.result.times)]
        drawn, over = overlay.lay(other, drawn, elapsed, scenario.start)
    rows, plots = _thinned(drawn)
    moving, times = motion.of_run(first, rows), first.result.times[rows]
    proof = errors_of_run(scenario, first.result) or {}
    page = RunPage(
        title=scenario.title,
        description=scenario.description,
        status=FAILED if failures or not all(run.passed for run in runs) else status(first),
        facts=[*_facts(first), *_proven(proof, first.fmu.model)],
        data=RunData(scenario.name, scenario.title, times, plots, motion=moving, other=over),
        tables=_tables(runs),
        notes=[*_notes(runs), *([f"The proven error assumes {ASSUMED}."] if proof else [])],
        failures=[
            *(sentence(run.violation) for run in runs if run.violation),
            *map(_described, failures),
        ],
        csv=csv,
        csv_note=_csv_note(first, len(rows)),
        again=again,
    )
    return overview.write_page(
        folder,
        name,
        page,
        _group(first.fmu.model),
        error=first.error if np.isfinite(first.error) else None,
        bound=first.bound if first.compared else None,
        detail=f"worst output: {first.worst}",
        difference=over["largest"] if over else "",
    )


def write_failed(folder: Path, name: str, failure: Failure, again: str) -> Entry:
    """Write the page of a scenario that stopped early: what was recorded until then."""
    folder.mkdir(parents=True, exist_ok=True)
    scenario, model, result = failure.scenario, failure.fmu.model, failure.result
    csv, data = "", None
    (folder / f"{name}.csv").unlink(missing_ok=True)  # of an earlier run
    facts = [*_common_facts(scenario, model), ("tolerance", short(failure.tolerance))]
    if result is not None:
        columns = recorded(scenario, model, result)
        csv = _write_values(folder / f"{name}.csv", result, columns)
        rows, plots = _thinned(_value_plots(scenario, model, result, columns))
        moving = motion.of_result(scenario, result, {}, rows)
        data = RunData(scenario.name, scenario.title, result.times[rows], plots, motion=moving)
        facts.insert(2, ("results until", f"{number(result.times[-1])} s"))
    page = RunPage(
        title=scenario.title,
        description=scenario.description,
        status=FAILED,
        facts=facts,
        data=data,
        tables=_start_tables(scenario, model),
        failures=[_described(failure)],
        csv=csv,
        again=again,
    )
    return overview.write_page(folder, name, page, _group(model), detail=failure.text)


def _described(failure: Failure) -> str:
    """Return a line that names the failed run's tolerance and the reason."""
    return f"Tolerance {short(failure.tolerance)}: {failure.text}"


def _group(model: Model) -> str:
    return f"{model.name} (FMI {model.fmi_version})"


def _write_values(
    file: Path, result: Result, columns: dict[str, np.ndarray], digits: int | None = None
) -> str:
    """Write the file of values; its name."""
    values = np.column_stack([column.astype(float) for column in columns.values()])
    files.write_trajectory(file, result.times, list(columns), values, digits, True)
    return file.name


def recorded(scenario: Scenario, model: Model, result: Result) -> dict[str, np.ndarray]:
    """Return columns (rows,) of Real outputs, Integers to draw and inputs, read after each step."""
    rows = scenario.input_rows[: len(result.times)]
    drawn = {name for panel in scenario.panels for name in panel}
    inputs = [
        name
        for name, variable in model.variables.items()
        if variable.causality == "input" and (name in scenario.inputs or name in drawn)
    ]
    return {
        **dict(zip(result.names, result.values.T, strict=True)),
        **result.integers,
        **{name: scenario.input(name)[rows] for name in inputs},
    }


def status(run: Run) -> str:
    """Return the status of a run for the overview."""
    if not run.passed:
        return FAILED
    return PASSED if run.compared else RAN


def _thinned(plots: Sequence[Plot]) -> tuple[np.ndarray, list[Plot]]:
    """Return the numbers of the rows to show, and the plots reduced to these rows."""
    rows = thinned([values for plot in plots for values in plot.columns])
    return rows, [plot.at(rows) for plot in plots]


def _plots(runs: Sequence[Run], columns: dict[str, np.ndarray]) -> list[Plot]:
    """Plot states over their references, inputs, requested variables, and errors."""
    run, references = runs[0], {}
    if run.compared:
        references = {name: run.reference.column(name) for name in run.result.names}
    values = _value_plots(run.scenario, run.fmu.model, run.result, columns, references)
    return [*values, _error_plot(runs)]


def _value_plots(
    scenario: Scenario,
    model: Model,
    result: Result,
    columns: dict[str, np.ndarray],
    references: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> list[Plot]:
    """Plot states, inputs and requested variables, over references, beside measured values."""
    variables = model.variables
    states = [name for name in model.states if name in columns]
    panels = [(name,) for name in states or model.real_outputs]
    shown = {name for panel in scenario.panels for name in panel}
    units: dict[str | None, list[str]] = {}
    for name in scenario.inputs:
        if name not in shown:
            units.setdefault(variables[name].unit, []).append(name)
    panels += [*map(tuple, units.values()), *scenario.panels]

    def curve(name: str) -> Curve:
        steps = name not in model.real_outputs
        return result_curve(name, columns[name].astype(float), references.get(name), steps)

    plots = [
        Plot(
            ", ".join(names),
            unit(variables[names[0]].unit),
            [curve(name) for name in names],
            note=meanings(variables[name] for name in names),
        )
        for names in panels
    ]
    return with_measured(plots, list(comparisons(scenario, result)), model)


def meanings(variables: Iterable[Variable]) -> str:
    """Say what the values of Integers mean, from their descriptions."""
    texts = [v.description for v in variables if v.type == "Integer" and v.description]
    return ". ".join(texts) + "." if texts else ""


def _error_plot(runs: Sequence[Run]) -> Plot:
    """Plot the largest error of all outputs at each time; one curve a run."""
    curves, levels = [], []
    for run in runs:
        scales = np.array([run.reference.scale(name) for name in run.result.names])
        expected = np.column_stack([run.reference.column(name) for name in run.result.names])
        errors = np.max(np.abs(run.result.values - expected) / scales, axis=1)
        name = f"tolerance {short(run.result.tolerance)}"
        curves.append(Curve(name, errors))
        if run.compared:
            levels.append((f"bound {short(run.bound)}", run.bound))
    return Plot("largest relative error of all outputs", "", curves, True, levels)


def _common_facts(scenario: Scenario, model: Model) -> list[tuple[str, str]]:
    time = f"{number(scenario.start)} to {number(scenario.stop)} s"
    return [("model", _group(model)), ("time", time)]


def _facts(run: Run) -> list[tuple[str, str]]:
    result, model = run.result, run.fmu.model
    bound = f" of {short(run.bound)}" if run.compared else ", estimated"
    return [
        *_common_facts(run.scenario, model),
        ("steps", f"{result.steps} {_lengths(run.scenario.steps)}"),
        ("tolerance", short(result.tolerance)),
        ("worst error", f"{short(run.error, 1)}{bound} ({run.worst})"),
    ]


def _proven(proof: Mapping[str, ProvenError], model: Model) -> list[tuple[str, str]]:
    """Say how far each state is from the exact motion at most."""
    texts = [
        f"{n} {rounded_up(e.error, 1)} {unit(model.variables[n].unit)}" for n, e in proof.items()
    ]
    return [("proven error at most", ", ".join(texts))] if texts else []


def _lengths(steps: Sequence[float]) -> str:
    return f"of {duration(steps[0])}" if len(steps) == 1 else "of varying length"


def _notes(runs: Sequence[Run]) -> list[str]:
    messages = (text for run in runs for text in run.result.messages)
    texts = [f"The FMU says: {text}" for text in dict.fromkeys(messages)]
    texts += runs[0].scenario.questions
    if not runs[0].compared:
        used = runs[0].result.tolerance, runs[0].scenario.smallest_tolerance
        texts.append(
            f"There is no reference for this scenario. Errors are estimated from a run of the same "
            f"FMU at tolerance {short(estimated_from(*used))}; they have no bound."
        )
    return texts


def _csv_note(run: Run, shown: int) -> str:
    every, count = run.scenario.reference_every, len(run.result.times)
    texts = []
    if every > 1:
        texts.append(f"The file has every {ordinal(every)} communication point.")
    if run.compared:
        texts.append(f"Its values have {DIGITS} digits.")
    if shown < count:
        rows = f"{shown} of its {count} rows"
        texts.append(f"This page shows {rows}, with the extremes of all curves.")
    return " ".join(texts)


def _tables(runs: Sequence[Run]) -> list[PageTable]:
    scenario, model, result = runs[0].scenario, runs[0].fmu.model, runs[0].result
    measured = measured_tables(list(comparisons(scenario, result)), model)
    return [*measured, *_start_tables(scenario, model), _solver(runs), _errors(runs)]


def _start_tables(scenario: Scenario, model: Model) -> list[PageTable]:
    """Return tables of parameters, initial state and inputs."""
    given = scenario.parameters | scenario.initial
    tables = []
    if given:
        tables.append(_values("Parameters and initial state of this run", model, given))
    if scenario.signals:
        rows = []
        for name, signal in scenario.signals.items():
            known = model.variables[name]
            rows.append((name, unit(known.unit), describe_signal(signal), known.description))
        note = "Sampled at communication points, each held over the step that begins there."
        tables.append(PageTable("Inputs", ("input", "unit", "course", "meaning"), rows, note))
    rest = {
        name: value
        for name, value in scenario.defaults.items()
        if name not in given
        and name not in scenario.signals
        and any(model.variables[name].is_a(kind) for kind in ("parameters", "initial", "inputs"))
    }
    if rest:
        tables.append(_values("All other start values", model, rest, folded=True))
    return tables


def _values(title: str, model: Model, values: dict, folded: bool = False) -> PageTable:
    rows = [cells(model.variables[name], value) for name, value in values.items()]
    return PageTable(title, ("name", "value", "unit", "meaning"), rows, folded=folded)


def cells(variable: Variable, value: Value) -> tuple[str, object, str, str]:
    """Name, value, unit and meaning of a variable, as tables show them."""
    shown = variable.written(value)
    text = str(shown).lower() if isinstance(shown, bool) else shown
    return variable.name, text, unit(variable.unit), variable.description


def _solver(runs: Sequence[Run]) -> PageTable:
    twin = runs[0].twin
    head = ["tolerance", "steps", "solver steps", "evaluations", "wall time", "worst error", "of"]
    rows = []
    for run in runs:
        result = run.result
        own = [result.solver_steps, result.solver_rhs_evaluations]
        row: list[object] = [short(result.tolerance), result.steps]
        row += ["–" if value is None else value for value in own]
        row += [f"{result.wall_time:.3f} s", f"{run.error:.2e}", run.worst]
        if twin is not None and run.twin is not None:
            row.append(bits(run.twin.differing))
        rows.append(row)
    if twin is not None:
        head.append(f"in FMI {twin.fmi_version}")
    return PageTable("Solver", head, rows)


def _errors(runs: Sequence[Run]) -> PageTable:
    head = ["output", "unit", *(f"tolerance {short(run.result.tolerance)}" for run in runs)]
    variables = runs[0].fmu.model.variables
    rows = [
        [name, unit(variables[name].unit), *(f"{run.errors[name]:.2e}" for run in runs)]
        for name in runs[0].errors
        if all(name in run.errors for run in runs)
    ]
    note = "Largest difference from the reference, relative to the output's largest value."
    return PageTable("Errors of all outputs", head, rows, note=note, folded=True)


def with_measured(
    plots: Sequence[Plot], comparisons: Sequence[Comparison], model: Model
) -> list[Plot]:
    """Add measured values to `plots` of their variables, in new plots if need be."""
    result = list(plots)
    for compared in comparisons:
        name = compared.name
        drawn = (i for i, plot in enumerate(result) if name in [x.name for x in plot.curves])
        index = next(drawn, len(result))
        if index == len(result):
            simulated = result_curve(name, compared.simulated)
            result.append(Plot(name, unit(model.variables[name].unit), [simulated]))
        alone = len(result[index].curves) == 1
        label = "measured" if alone else f"{name} measured"
        curve = replace(result_curve(label, compared.measured), points=True)
        result[index] = replace(result[index], curves=[*result[index].curves, curve])
    return result


def measured_tables(comparisons: Sequence[Comparison], model: Model) -> list[PageTable]:
    """Return a table of the distance from measured values; none without measurements."""
    if not comparisons:
        return []
    rows = [
        (c.name, unit(model.variables[c.name].unit), f"{c.rms:.4g}", f"{c.largest:.4g}", c.source)
        for c in comparisons
    ]
    head = ("output", "unit", "RMS", "largest", "log")
    note = "Simulated less measured, over the rows of the values that the log covers."
    return [PageTable("Difference from what was measured", head, rows, note)]


def describe_signal(signal: Signal) -> str:
    """Describe an input."""
    if isinstance(signal, Constant):
        return f"constant {number(signal.value)}"
    if isinstance(signal, Sines):
        terms = [
            f"{number(amplitude)} sin(2π {number(frequency)} Hz t"
            + (f" {'+' if phase > 0 else '−'} {number(abs(phase))})" if phase else ")")
            for amplitude, frequency, phase in signal.terms
        ]
        return " + ".join(([number(signal.offset)] if signal.offset else []) + terms)
    if isinstance(signal, Logged):
        return f"{signal.source}, {'held' if signal.is_held else 'linear in between'}"
    if isinstance(signal, Switches):
        if len(signal.points) == 1:
            return str(signal.points[0][1]).lower()
        return ", ".join(f"{str(on).lower()} from {number(time)} s" for time, on in signal.points)
    if len(signal.points) <= MOST_POINTS:
        points = (f"{number(value)} at {number(time)} s" for time, value in signal.points)
        return ", ".join(points) + (", linear in between" if len(signal.points) > 1 else "")
    low, high = (f(value for _, value in signal.points) for f in (min, max))
    begin, end = signal.points[0][0], signal.points[-1][0]
    return (
        f"table of {len(signal.points)} points from {number(begin)} to {number(end)} s, values "
        f"from {number(low)} to {number(high)}, linear in between"
    )
