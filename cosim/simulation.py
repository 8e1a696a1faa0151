"""Runs scenarios on co-simulation units."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from tqdm import tqdm

from cosim.errors import UserError
from cosim.scenario import Scenario
from cosim.unit import Fmu, Instance

PROGRESS_DELAY = 1.0  # s, shorter activities show nothing
PROGRESS_LINE_EVERY = 5.0  # s, where the output is not a terminal
PROGRESS_CALL_EVERY = 0.1  # s


@dataclass(frozen=True, eq=False)
class Result:
    """Recorded outputs of one run: row i is what an importer reads after the step to times[i]."""

    tolerance: float  # relative, as given to fmi2SetupExperiment
    times: np.ndarray  # (rows,) s
    names: tuple[str, ...]  # all Real outputs of the FMU
    values: np.ndarray  # (rows, len(names)) in the variables' units
    steps: int  # communication steps
    wall_time: float  # s, of the stepping loop
    solver_steps: int | None  # None: the FMU has no such variable
    solver_rhs_evaluations: int | None
    messages: tuple[str, ...]  # warnings from the FMU, the last ones


class Progress:
    """Shows on stderr how far an activity is, once it has taken about a second.

    On a terminal that is a live bar, elsewhere a line every few seconds. Call it with the number
    of steps (or of what `unit` names) done since the last call.
    """

    def __init__(self, label: str, total: int, unit: str = "steps") -> None:
        self._label, self._total, self._done = label, total, 0
        self._start = time.monotonic()
        self._next_line = self._start + PROGRESS_LINE_EVERY
        self._bar = None
        if sys.stderr.isatty():
            self._bar = tqdm(
                total=total,
                desc=label,
                unit=f" {unit}",
                unit_scale=total >= 10_000,
                delay=PROGRESS_DELAY,
                leave=False,
            )

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, steps: int) -> None:
        if self._bar is not None:
            self._bar.update(steps)
            return
        self._done += steps
        now = time.monotonic()
        if now >= self._next_line:
            self._next_line = now + PROGRESS_LINE_EVERY
            percent = 100 * self._done // max(self._total, 1)
            elapsed = now - self._start
            print(f"{self._label}: {percent} %, {elapsed:.0f} s", file=sys.stderr, flush=True)


def simulate(
    fmu: Fmu,
    scenario: Scenario,
    tolerance: float | None = None,
    progress: Callable[[int], object] | None = None,
) -> Result:
    """Run `scenario` on `fmu` and record its Real outputs.

    Parameters
    ----------
    fmu : Fmu
    scenario : Scenario
    tolerance : float, optional
        Relative tolerance for fmi2SetupExperiment; None: that of the scenario.
    progress : callable, optional
        Called now and then with the number of steps done since the last call.

    Raises
    ------
    UserError
        If the FMU lacks a variable of the scenario, or if one of its functions fails; the text
        holds the FMU's own message.
    """
    tolerance = scenario.tolerance if tolerance is None else tolerance
    _check_names(fmu, scenario)
    with Instance(fmu, scenario.name) as instance:
        instance.initialize(scenario, tolerance)
        values, wall_time = _step_through(instance, scenario, progress)
        result = Result(
            tolerance=tolerance,
            times=scenario.times[scenario.reference_rows],
            names=tuple(variable.name for variable in fmu.real_outputs),
            values=values,
            steps=len(scenario.times) - 1,
            wall_time=wall_time,
            solver_steps=instance.counter("solver_steps"),
            solver_rhs_evaluations=instance.counter("solver_rhs_evaluations"),
            messages=tuple(instance.messages),
        )
    return result


def _step_through(
    instance: Instance, scenario: Scenario, progress: Callable[[int], object] | None
) -> tuple[np.ndarray, float]:
    """All steps: recorded outputs (rows, outputs), and the seconds that the loop took."""
    slave, component = instance.slave, instance.slave.component
    in_refs, in_values, in_view = instance.buffers(list(scenario.inputs))
    outputs = [variable.name for variable in instance.fmu.real_outputs]
    out_refs, out_values, out_view = instance.buffers(outputs)
    n_in, n_out = len(in_view), len(out_view)
    held = np.column_stack([*scenario.inputs.values()]) if n_in else None

    times, lengths = scenario.times, np.diff(scenario.times)
    rows = scenario.reference_rows
    values = np.empty((len(rows), n_out))
    recorded, reported, i = 0, 0, -1
    begin = time.perf_counter()
    due = begin + PROGRESS_CALL_EVERY
    try:
        slave.fmi2GetReal(component, out_refs, n_out, out_values)
        values[0] = out_view
        for i, length in enumerate(lengths):
            if n_in:
                in_view[:] = held[i]
                slave.fmi2SetReal(component, in_refs, n_in, in_values)
            slave.fmi2DoStep(component, times[i], length, fmi2.fmi2True)
            if rows[recorded + 1] == i + 1:
                slave.fmi2GetReal(component, out_refs, n_out, out_values)
                recorded += 1
                values[recorded] = out_view
            if progress is not None and time.perf_counter() >= due:
                progress(i + 1 - reported)
                reported = i + 1
                due = time.perf_counter() + PROGRESS_CALL_EVERY
    except FMICallException as error:
        when = f"in the step from t = {float(times[max(i, 0)])!r} s"
        raise instance.failure(error, when) from error
    wall_time = time.perf_counter() - begin
    if progress is not None:
        progress(len(lengths) - reported)
    return values, wall_time


def _check_names(fmu: Fmu, scenario: Scenario) -> None:
    if not fmu.real_outputs:
        raise UserError(f"{fmu.path}: has no Real outputs, nothing can be recorded")
    for kind, causality, names in (
        ("parameter", "parameter", scenario.parameters),
        ("state with a start value", "output", scenario.initial),
        ("Real input", "input", scenario.inputs),
    ):
        for name in names:
            variable = fmu.variables.get(name)
            real = variable is not None and variable.type == "Real"
            fits = variable is not None and variable.causality == causality
            if not fits or (kind != "parameter" and not real):
                raise UserError(f"{scenario.path}: the FMU {fmu.path} has no {kind} {name!r}")
