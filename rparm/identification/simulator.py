"""Runs segments of logs with the compiled loop, on all cores."""

import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from typing import TypeVar

import numpy as np

from rparm.errors import UserError
from rparm.fmi.compiled_loop import Part, Stepper
from rparm.fmi.fmi_instance import Instance, Reals
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Value
from rparm.identification.logs import Segment

Task, Answer = TypeVar("Task"), TypeVar("Answer")
CORES = os.cpu_count() or 1
LOADING = threading.Lock()  # fmpy changes the current folder for a moment


class Simulator:
    """Instances of an FMU, one for each thread; a context manager that frees them.

    Parameters
    ----------
    parameters, states, inputs, outputs : sequence of str
        What differs between runs, and what is read; of the inputs, the Real ones.
    switches : sequence of str
        The Boolean inputs.
    settings : mapping
        Values of other variables, the same in all runs.
    tolerance : float
        Relative, of the integrator.
    """

    def __init__(
        self,
        fmu: Fmu,
        parameters: Sequence[str],
        states: Sequence[str],
        inputs: Sequence[str],
        switches: Sequence[str],
        outputs: Sequence[str],
        settings: Mapping[str, Value],
        tolerance: float,
    ) -> None:
        self.fmu, self.names = fmu, (*parameters, *states)
        self.settings, self.tolerance = settings, tolerance
        variables = fmu.model.variables

        def references(names: Sequence[str]) -> tuple[int, ...]:
            return tuple(variables[name].reference for name in names)

        sources = tuple(range(len(inputs)))
        self.reals = Part(references(inputs), sources, references(outputs))
        self.switches = Part(references(switches), tuple(range(len(switches))), ())
        self._own, self._runners = threading.local(), list[_Runner]()
        self._pool = ThreadPoolExecutor(CORES)

    def __enter__(self) -> "Simulator":
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(cancel_futures=True)  # then no instance is in use
        for runner in self._runners:
            runner.close()

    def map(self, function: Callable[[Task], Answer], tasks: Iterable[Task]) -> list[Answer]:
        """Answers to tasks, worked on by all cores."""
        return list(self._pool.map(function, tasks))

    def run(self, segment: Segment, values: np.ndarray) -> np.ndarray:
        """Outputs (rows, outputs) at the rows of a segment.

        UserError if the FMU refuses `values`, those of parameters and states, or fails.
        """
        if not hasattr(self._own, "runner"):
            self._own.runner = _Runner(self)
            self._runners.append(self._own.runner)
        return self._own.runner.run(segment, values)


class _Runner:
    """One instance, whose runs begin with a reset."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        reals, switches = simulator.reals, simulator.switches
        self._stepper = Stepper([reals], [switches], len(reals.inputs), len(switches.inputs))
        self._watched = len(reals.inputs) + np.arange(len(reals.outputs))
        self._stack = ExitStack()
        self._instance: Instance | None = None

    def close(self) -> None:
        """Free the instance."""
        with suppress(UserError):  # of one that has failed
            self._stack.close()
        self._instance = None

    def run(self, segment: Segment, values: np.ndarray) -> np.ndarray:
        try:
            self._initialize(segment, values)
            return self._advance(segment)
        except UserError:
            self.close()  # what has failed is not used again
            raise

    def _fresh(self) -> tuple[Instance, Reals]:
        """The instance, as new, and what is set in it."""
        if self._instance is not None:
            self._instance.reset()
            return self._instance, self._given
        fmu = self._simulator.fmu
        with LOADING:
            instance = self._stack.enter_context(fmu.instance(fmu.model.name))
        self._instance = instance
        self._given = instance.reals(self._simulator.names)
        self._stepper.connect([instance])
        return instance, self._given

    def _initialize(self, segment: Segment, values: np.ndarray) -> None:
        """To the first row, inputs set and outputs read."""
        simulator, (instance, given) = self._simulator, self._fresh()
        instance.set_up(segment.times[0], segment.times[-1], simulator.tolerance)
        for name, value in simulator.settings.items():
            instance.set(name, value)
        given.view[:] = values
        with instance.explained("(parameters and start)"):
            given.set()
        instance.enter_initialization()
        self._stepper.reals.values[: segment.inputs.shape[1]] = segment.inputs[0]
        self._stepper.switches.values[:] = segment.switches[0]
        self._stepper.set_inputs("in initialization")
        instance.exit_initialization()
        self._stepper.read_outputs(f"at the start, t = {float(segment.times[0])!r} s,")

    def _advance(self, segment: Segment) -> np.ndarray:
        record = np.empty((len(segment.times), len(self._watched)))
        record[0] = self._stepper.reals.values[self._watched]
        _, failure = self._stepper.advance(
            segment.times,
            segment.inputs,
            segment.switches,
            np.arange(1, len(segment.times)),
            self._watched,
            record[1:],
        )
        if failure is not None:
            raise failure
        return record
