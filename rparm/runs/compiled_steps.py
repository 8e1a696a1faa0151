"""The steps of a scenario by the compiled loop: the bits of the plain one, in half the time."""

import time
from collections.abc import Callable

import numpy as np

from rparm.errors import UserError
from rparm.fmi.compiled_loop import Part, Stepper
from rparm.fmi.fmi_instance import Instance
from rparm.scenarios.scenario import Scenario

FIRST = 64  # steps without a look at the clock, of an FMU whose speed is not known
PAUSE = 0.02  # s, after which Ctrl-C and progress get their turn


def step_through(
    instance: Instance, scenario: Scenario, progress: Callable[[int], object] | None
) -> tuple[np.ndarray, np.ndarray, float, UserError | None]:
    """All steps of an initialized instance, or those before one that fails.

    Recorded outputs (rows, outputs), no Integers (rows, 0), seconds of the loop, why it ended.
    """
    made = _Steps(instance, scenario)
    begin = time.perf_counter()
    failure, count = made.begin(), FIRST
    while failure is None and made.done < made.count:
        started, before = time.perf_counter(), made.done
        failure = made.advance(count)
        if time.perf_counter() - started < PAUSE:
            count *= 2
        if progress is not None:
            progress(made.done - before)
    seconds, rows = time.perf_counter() - begin, made.rows()
    return rows, np.empty((len(rows), 0), int), seconds, failure


class _Steps:
    """How far a run is: `done` of `count` steps."""

    def __init__(self, instance: Instance, scenario: Scenario) -> None:
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
        """Inputs at all communication points, (n + 1, names)."""
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
        made, failure = self._stepper.advance(
            self._times[here],
            self._held[here],
            self._switches[here],
            self._points[rows] - first,
            self._watched,
            self._values[rows],
        )
        self.done += made
        self._recorded = int(np.searchsorted(self._points, self.done, side="right"))
        return failure

    def rows(self) -> np.ndarray:
        """Outputs at the recorded points that were reached, (rows, outputs)."""
        return self._values[: self._recorded]
