"""Runs scenarios on FMUs."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from itertools import chain

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import StoppedError, UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.scenarios.scenario import Scenario

PROGRESS_EVERY = 0.1  # s
# Steps of a process after which it pays to load the compiled loop: that takes 0.6 s, and saves
# 3.5 us a step. Nothing but the speed depends on it.
WORTH_COMPILING = 150_000

_steps_made = 0  # by this process


# recorded outputs (rows, outputs) and Integers (rows, drawn), seconds of the loop, why it ended
Steps = tuple[np.ndarray, np.ndarray, float, UserError | None]


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
    integers: dict[str, np.ndarray] = field(default_factory=dict)  # (rows,): those to be drawn


def simulate(
    fmu: Fmu,
    scenario: Scenario,
    tolerance: float | None = None,
    progress: Callable[[int], object] | None = None,
    compiled: bool = False,
) -> Result:
    """Run `scenario` on the FMU that it was checked against, and record its Real outputs.

    The relative tolerance is that of the scenario if none is given. `progress` is called now and
    then with the number of steps done since the last call. `compiled` uses the compiled loop, where
    numba is installed, even if it does not pay.

    UserError if the FMU has no Real outputs, or if one of its functions fails; the text holds the
    FMU's own message. In a step it is a `StoppedError`.
    """
    tolerance = scenario.tolerance if tolerance is None else tolerance
    if not fmu.model.real_outputs:
        raise UserError(f"{fmu.path}: has no Real outputs, nothing can be recorded")
    with fmu.instance(scenario.name) as instance:
        initialize(instance, scenario, tolerance)
        drawn = [
            name
            for name in dict.fromkeys(chain.from_iterable(scenario.panels))
            if fmu.model.variables[name].type == "Integer"
        ]
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
            integers=dict(zip(drawn, integers.T, strict=True)),
        )
        if failure is not None:
            raise StoppedError(str(failure), result) from failure
        return result


def initialize(instance: Instance, scenario: Scenario, tolerance: float) -> None:
    """From instantiated to the first communication point of `scenario`."""
    instance.set_up(scenario.start, scenario.stop, tolerance)
    for name, value in (scenario.parameters | scenario.initial).items():
        instance.set(name, value)
    instance.enter_initialization()
    for name, values in scenario.inputs.items():
        instance.set(name, values[0].item())
    instance.exit_initialization()


def _compiled_loop(wanted: bool, steps: int) -> Callable[..., Steps] | None:
    """The compiled stepping loop; None if it does not pay or cannot be loaded."""
    global _steps_made
    _steps_made += steps
    if wanted or _steps_made > WORTH_COMPILING:
        with suppress(ImportError, RuntimeError):  # no numba, or no place for what it compiles
            return import_module("rparm.runs.compiled_steps").step_through
    return None


def _step_through(
    instance: Instance,
    scenario: Scenario,
    drawn: Sequence[str],
    progress: Callable[[int], object] | None,
) -> Steps:
    """All steps, or those before one that fails."""
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
    """Boolean inputs whose value is another one at a communication point, by its index."""
    found: dict[int, list[str]] = {}
    for name, values in switches.items():
        for i in np.flatnonzero(values[1:] != values[:-1]) + 1:
            found.setdefault(int(i), []).append(name)
    return found
