"""Runs of a scenario on an FMU, in Python or by the compiled loop, which gives the same bits.

The compiled loop takes half the time. Times, start values and inputs of a program are checked here.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from itertools import chain
from numbers import Real
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import StoppedError, UserError, WrongValueError, placed
from rparm.files import difference
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import ARE_EXACT, INITIAL, INPUTS, PARAMETERS, Experiment, Model, Value
from rparm.runs.scenario import USUAL_STEPS, Scenario, count_steps

PROGRESS_EVERY = 0.1  # s
# Steps of a process after which it pays to load the compiled loop: that takes 0.6 s, and saves
# 3.5 us a step. Nothing but the speed depends on it.
WORTH_COMPILING = 150_000
_steps_made = 0  # by this process
# recorded outputs (rows, outputs) and Integers (rows, drawn), seconds of the loop, why it ended
Steps = tuple[np.ndarray, np.ndarray, float, UserError | None]
FIRST_STEPS = 64  # steps without a look at the clock, of an FMU whose speed is not known
LOOK_EVERY = 0.02  # s, after which Ctrl-C and progress get their turn
Input = float | bool | np.ndarray | Sequence[float] | tuple[Any, Any] | Callable[[float], float]


@dataclass(frozen=True, eq=False)
class Result:
    """Recorded outputs of one run: row i is what an importer reads after the step to times[i]."""

    tolerance: float  # relative, as given to the FMU
    times: np.ndarray  # (rows,) s
    names: tuple[str, ...]  # all Real outputs of the FMU
    values: np.ndarray  # (rows, len(names)) in the variables' units
    steps: int  # communication steps
    wall_time: float  # s, of the stepping loop
    solver_steps: int | None  # None: the FMU has no such variable
    solver_rhs_evaluations: int | None
    messages: tuple[str, ...]  # warnings from the FMU, the last ones
    are_exact: bool | None = None  # gradients of the FMU, at the end; None: it has none
    integers: dict[str, np.ndarray] = field(default_factory=dict)  # (rows,): those to be drawn


def simulate(
    fmu: Fmu,
    scenario: Scenario,
    tolerance: float | None = None,
    progress: Callable[[int], object] | None = None,
    compiled: bool = False,
) -> Result:
    """Run `scenario` on the FMU that it was checked against, and record its Real outputs.

    By default the relative tolerance is the scenario's. `progress` gets the number of steps since
    its last call. `compiled` uses the compiled loop, where numba is installed, even if it does not
    pay. UserError with the FMU's message if it fails, in a step a `StoppedError`.
    """
    tolerance = scenario.tolerance if tolerance is None else tolerance
    if not fmu.model.real_outputs:
        raise UserError(f"{fmu.path}: has no Real outputs, nothing can be recorded")
    with fmu.instance(scenario.name) as instance:
        initialize(instance, scenario, tolerance)
        shown = dict.fromkeys(chain.from_iterable(scenario.panels))
        drawn = [name for name in shown if fmu.model.variables[name].type == "Integer"]
        step_through = None if drawn else _compiled_loop(compiled, len(scenario.times) - 1)
        if step_through is None:
            made = _step_through(instance, scenario, drawn, progress)
        else:
            made = step_through(instance, scenario, progress)
        values, integers, wall_time, failure = made
        ended = failure is None
        result = Result(
            tolerance=tolerance,
            times=scenario.times[scenario.reference_rows][: len(values)],
            names=tuple(fmu.model.real_outputs),
            values=values,
            steps=len(scenario.times) - 1,
            wall_time=wall_time,
            solver_steps=instance.integer("solver_steps") if ended else None,
            solver_rhs_evaluations=instance.integer("solver_rhs_evaluations") if ended else None,
            messages=tuple(instance.messages),
            are_exact=_are_exact(instance) if ended else None,
            integers=dict(zip(drawn, integers.T, strict=True)),
        )
        if failure is not None:
            raise StoppedError(str(failure), result) from failure
        return result


def _are_exact(instance: Instance) -> bool | None:
    known = ARE_EXACT in instance.fmu.model.variables
    return bool(instance.discrete(ARE_EXACT)) if known else None


def initialize(instance: Instance, scenario: Scenario, tolerance: float) -> None:
    """Go from instantiated to the first communication point of `scenario`."""
    instance.set_up(scenario.start, scenario.stop, tolerance)
    for name, value in (scenario.parameters | scenario.initial).items():
        instance.set(name, value)
    instance.enter_initialization()
    for name, values in scenario.inputs.items():
        instance.set(name, values[0].item())
    instance.exit_initialization()


def _compiled_loop(wanted: bool, steps: int) -> Callable[..., Steps] | None:
    """Load the compiled stepping loop; None if it does not pay or cannot be loaded."""
    global _steps_made
    _steps_made += steps
    if wanted or _steps_made > WORTH_COMPILING:
        with suppress(ImportError, RuntimeError):  # no numba, or no place for what it compiles
            import_module("rparm.fmi.compiled_loop")
            return _step_compiled
    return None


def _step_through(
    instance: Instance,
    scenario: Scenario,
    drawn: Sequence[str],
    progress: Callable[[int], object] | None,
) -> Steps:
    """Make all steps, or those before one that fails."""
    switches = {name: values for name, values in scenario.inputs.items() if values.dtype == bool}
    inputs = instance.reals([name for name in scenario.inputs if name not in switches])
    outputs = instance.reals(instance.fmu.model.real_outputs)
    columns = [scenario.inputs[name] for name in inputs.names]
    reals = np.column_stack(columns) if columns else None
    switching = _switching(switches)

    times, lengths = scenario.times, np.diff(scenario.times)
    rows = scenario.reference_rows
    values = np.empty((len(rows), len(outputs.names)))
    integers = np.empty((len(rows), len(drawn)), int)
    recorded, reported, i = -1, 0, -1
    begin = time.perf_counter()
    due = begin + PROGRESS_EVERY
    try:
        outputs.get()
        values[0] = outputs.view
        integers[0] = [instance.integer(name) for name in drawn]
        recorded = 0
        for i, length in enumerate(lengths):
            if reals is not None:
                inputs.view[:] = reals[i]
                inputs.set()
            for name in switching.get(i, ()):
                instance.set(name, bool(switches[name][i]))
            instance.do_step(times[i], length)
            if rows[recorded + 1] == i + 1:
                outputs.get()
                recorded += 1
                values[recorded] = outputs.view
                integers[recorded] = [instance.integer(name) for name in drawn]
            if progress is not None and time.perf_counter() >= due:
                progress(i + 1 - reported)
                reported = i + 1
                due = time.perf_counter() + PROGRESS_EVERY
    except (FMICallException, UserError) as error:
        failure = error
        if isinstance(error, FMICallException):
            when = f"in the step from t = {float(times[max(i, 0)])!r} s"
            failure = instance.failure(error, when)
        rows_before = slice(recorded + 1)
        return values[rows_before], integers[rows_before], time.perf_counter() - begin, failure
    wall_time = time.perf_counter() - begin
    if progress is not None:
        progress(len(lengths) - reported)
    return values, integers, wall_time, None


def _switching(switches: dict[str, np.ndarray]) -> dict[int, list[str]]:
    """Map communication points to the Boolean inputs that change there."""
    found: dict[int, list[str]] = {}
    for name, values in switches.items():
        for i in np.flatnonzero(values[1:] != values[:-1]) + 1:
            found.setdefault(int(i), []).append(name)
    return found


# ---- Compiled steps ------------------------------------------------------------------------------
def _step_compiled(
    instance: Instance, scenario: Scenario, progress: Callable[[int], object] | None
) -> tuple[np.ndarray, np.ndarray, float, UserError | None]:
    """Make all steps, or those before one that fails; Integers have the shape (rows, 0)."""
    made = _CompiledSteps(instance, scenario)
    begin = time.perf_counter()
    failure, count = made.begin(), FIRST_STEPS
    while failure is None and made.done < made.count:
        started, before = time.perf_counter(), made.done
        failure = made.advance(count)
        if time.perf_counter() - started < LOOK_EVERY:
            count *= 2
        if progress is not None:
            progress(made.done - before)
    seconds, rows = time.perf_counter() - begin, made.rows()
    return rows, np.empty((len(rows), 0), int), seconds, failure


class _CompiledSteps:
    """Run of which `done` of `count` steps are made."""

    def __init__(self, instance: Instance, scenario: Scenario) -> None:
        from rparm.fmi.compiled_loop import Part, Stepper  # numba takes long

        variables = instance.fmu.model.variables
        names = sorted(scenario.inputs, key=lambda name: variables[name].type == "Boolean")
        split = sum(variables[name].type != "Boolean" for name in names)
        outputs = [variables[name].reference for name in instance.fmu.model.real_outputs]
        inputs = [variables[name].reference for name in names]
        reals = Part(tuple(inputs[:split]), tuple(range(split)), tuple(outputs))
        switches = Part(tuple(inputs[split:]), tuple(range(len(names) - split)), ())
        self._stepper = Stepper([reals], [switches], split, len(names) - split)
        self._stepper.connect([instance])

        self._times, self._points = scenario.times, scenario.reference_rows
        self._held = self._columns(scenario, names[:split], np.float64)
        self._switches = self._columns(scenario, names[split:], np.int32)
        self._stepper.switches.to_set[:] = self._switches[0]  # as initialization has left them
        self._watched = split + np.arange(len(outputs))
        self._values = np.empty((len(self._points), len(outputs)))
        self.count, self.done = len(self._times) - 1, 0
        self._recorded = 0
        self.advance(0)  # compiles the loop

    @staticmethod
    def _columns(scenario: Scenario, names: list[str], kind: type) -> np.ndarray:
        """Return inputs at all communication points, (n + 1, names)."""
        columns = np.empty((len(scenario.times), len(names)), kind)
        for column, name in zip(columns.T, names, strict=True):
            column[:] = scenario.inputs[name]
        return columns

    def begin(self) -> UserError | None:
        """Read the outputs at the start; what failed, if it did."""
        try:
            self._stepper.read_outputs(f"in the step from t = {float(self._times[0])!r} s")
        except UserError as error:
            return error
        self._values[0] = self._stepper.reals.values[self._watched]
        self._recorded = 1
        return None

    def advance(self, count: int) -> UserError | None:
        """Make `count` steps, or those that are left; the error of one that failed."""
        first = self.done
        last = min(first + count, self.count)
        here = slice(first, last + 1)
        rows = slice(*np.searchsorted(self._points, (first, last), side="right"))
        given = self._times[here], self._held[here], self._switches[here]
        where = self._points[rows] - first, self._watched, self._values[rows]
        made, failure = self._stepper.advance(*given, *where)
        self.done += made
        self._recorded = int(np.searchsorted(self._points, self.done, side="right"))
        return failure

    def rows(self) -> np.ndarray:
        """Return outputs at the recorded points that were reached, (rows, outputs)."""
        return self._values[: self._recorded]


# ---- Values of programs --------------------------------------------------------------------------
def is_finite_number(given: object) -> bool:
    """Return whether it is a real number, neither infinite nor nan; a Boolean is none."""
    return isinstance(given, Real) and not isinstance(given, bool) and bool(np.isfinite(given))


def times_of(
    usual: Experiment, start: float | None, stop: float | None, step: float | None
) -> np.ndarray:
    """Return communication points in s; None: as in the default experiment."""
    start = usual.start or 0.0 if start is None else start
    stop = usual.stop if stop is None else stop
    if stop is None:
        raise WrongValueError("has no default experiment with a stop time: give stop_time")
    step = usual.step if step is None else step
    if step is None and is_finite_number(start) and is_finite_number(stop):
        step = difference(stop, start) / USUAL_STEPS
    return communication_points(start, stop, step)


def communication_points(start: float, stop: float, step: float) -> np.ndarray:
    """Return communication points in s; UserError if no whole number of steps leads to the stop."""
    for name, value in (("start_time", start), ("stop_time", stop), ("step", step)):
        if not is_finite_number(value):
            raise UserError(f"{name}: expected a finite number, got {value!r}")
    if stop <= start or step <= 0:
        expected = "expected start_time < stop_time and step > 0"
        raise UserError(f"{expected}, got {start!r}, {stop!r} and {step!r}")
    times = start + step * np.arange(count_steps(start, stop, step) + 1)
    times[-1] = stop
    return times


def of_program(
    fmu: Fmu,
    times: tuple[float | None, float | None, float | None],
    given: Mapping[str, Value] | None,
    inputs: Mapping[str, Input] | None,
    tolerance: float,
) -> Result:
    """Run an FMU from start to stop time by a step, `times` (s), as `rparm.simulate` explains."""
    path, model = fmu.path, fmu.model
    if not (is_finite_number(tolerance) and 0 < tolerance < 1):
        raise UserError(f"tolerance: expected a number between 0 and 1, got {tolerance!r}")
    with placed(path):
        points = times_of(model.experiment, *times)
    values = start_values(model, given or {})
    signals = {name: input_values(model, name, x, points) for name, x in (inputs or {}).items()}
    run = Scenario(
        name=path.stem, model=model.name, path=path, title=path.stem, description="",
        parameters=values, initial={}, start=points[0], stop=points[-1], steps=(times[2],),
        tolerance=tolerance, times=points, elapsed=points - points[0], signals={}, inputs=signals,
        reference_every=1, defaults=model.start_values,
    )  # fmt: skip
    return simulate(fmu, run, compiled=True)


def start_values(model: Model, given: Mapping[str, Any]) -> dict[str, Value]:
    """Check the given values and return them by name; UserError for a wrong one."""
    checked = {}
    for name, value in given.items():
        with placed(f"start_values: {name}"):
            variable = model.variables.get(name)
            kind = INITIAL if variable is not None and variable.is_a(INITIAL) else PARAMETERS
            value = value.item() if isinstance(value, np.generic) else value
            checked[name] = model.find(name, kind).checked(value)
    return checked


def input_values(model: Model, name: str, given: Any, times: np.ndarray) -> np.ndarray:
    """Sample a number, values, pair to interpolate or function at `times` (s); UserError."""
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
