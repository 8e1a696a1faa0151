"""Runs of a scenario on an FMU. Times, start values and inputs of a program are checked here."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from numbers import Real
from typing import Any

import numpy as np

from rparm.errors import StoppedError, UserError, WrongValueError, placed
from rparm.files import difference
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import one_component, side_by_side
from rparm.fmi.model import ARE_EXACT, INITIAL, INPUTS, PARAMETERS, Experiment, Model, Value
from rparm.runs.scenario import USUAL_STEPS, Scenario, count_steps

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
) -> Result:
    """Run `scenario` on the FMU that it was checked against, and record its Real outputs.

    By default the relative tolerance is the scenario's. `progress` gets the number of steps since
    its last call. UserError with the FMU's message if it fails, in a step a `StoppedError`.
    """
    tolerance = scenario.tolerance if tolerance is None else tolerance
    if not fmu.model.real_outputs:
        raise UserError(f"{fmu.path}: has no Real outputs, nothing can be recorded")
    with fmu.instance(scenario.name) as instance:
        initialize(instance, scenario, tolerance)
        shown = dict.fromkeys(chain.from_iterable(scenario.panels))
        drawn = [name for name in shown if fmu.model.variables[name].type == "Integer"]
        run = _Run(instance, scenario, drawn)
        begin = time.perf_counter()
        failure = run.make(progress)
        wall_time = time.perf_counter() - begin
        ended = failure is None
        result = Result(
            tolerance=tolerance,
            times=scenario.times[scenario.reference_rows][: len(run.rows)],
            names=tuple(fmu.model.real_outputs),
            values=run.rows[:, : len(run.outputs)],
            steps=len(scenario.times) - 1,
            wall_time=wall_time,
            solver_steps=instance.integer("solver_steps") if ended else None,
            solver_rhs_evaluations=instance.integer("solver_rhs_evaluations") if ended else None,
            messages=tuple(instance.messages),
            are_exact=_are_exact(instance) if ended else None,
            integers=dict(zip(drawn, run.rows[:, len(run.outputs) :].astype(int).T, strict=True)),
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


class _Run:
    """The steps of a scenario; `rows` have the outputs that were recorded, and drawn Integers."""

    def __init__(self, instance: Instance, scenario: Scenario, drawn: Sequence[str]) -> None:
        self._scenario = scenario
        self.outputs = instance.fmu.model.real_outputs
        switches = [name for name, values in scenario.inputs.items() if values.dtype == bool]
        reals = [name for name in scenario.inputs if name not in switches]
        count = len(self.outputs)
        self._loop = one_component(instance, reals, switches, self.outputs)
        (component,) = self._loop.components
        component.read_for_rows({name: count + i for i, name in enumerate(drawn)})
        self._loop.record(range(count), len(drawn))
        self._loop.start(float(scenario.times[0]))
        self._driven = self._held(reals, np.float64)
        self._scheduled = self._held(switches, np.int64)
        self._loop.know_switches(self._scheduled[0])  # as initialization has left them
        self.rows = np.empty((len(scenario.reference_rows), count + len(drawn)))

    def _held(self, names: list[str], kind: type) -> np.ndarray:
        """Return inputs at all communication points, (n + 1, names)."""
        inputs, count = self._scenario.inputs, len(self._scenario.times)
        return side_by_side((inputs[name] for name in names), count, kind)

    def make(self, progress: Callable[[int], object] | None) -> UserError | None:
        """Make all steps, or those before one that fails; its error."""
        loop, times = self._loop, self._scenario.times
        has_row = np.zeros(len(times), bool)
        has_row[self._scenario.reference_rows] = True
        made = 0  # rows
        try:
            loop.read()
            loop.read_row(self.rows[0])
            made = 1
            given = self._driven[:-1], self._scheduled[:-1]
            loop.run(times[1:], *given, self.rows, has_row[1:], progress=progress)
        except UserError as error:
            self.rows = self.rows[: made + has_row[1 : 1 + loop.done].sum()]
            return error
        return None


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
    return simulate(fmu, run)


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
