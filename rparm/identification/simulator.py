"""Runs segments of logs on all cores, and guesses their start states."""

import os
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import TypeVar

import fmpy
import numpy as np

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance, Reals
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import one_component
from rparm.fmi.model import ARE_EXACT, INITIAL, Value, gradient_name
from rparm.identification.logs import Segment
from rparm.identification.request import Parameters

Task, Answer = TypeVar("Task"), TypeVar("Answer")
CORES = os.cpu_count() or 1
LOADING = threading.Lock()  # fmpy changes the current folder for a moment
WINDOW = 0.15  # of a segment, at its start, that a polynomial is fitted to
DEGREE = 3
FEWEST = 12  # rows of it
SHIFTS = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5)  # towards the middle of all states, if a start fails


@dataclass(frozen=True, eq=False)
class _Wiring:
    """An FMU, and what its runs take and give, by name."""

    fmu: Fmu
    inputs: Sequence[str]  # Reals
    switches: Sequence[str]  # Booleans
    outputs: Sequence[str]


class Simulator:
    """Instances of an FMU, one for each thread; a context manager that frees them.

    `parameters` and `states` differ between runs, `settings` do not; `inputs` are Reals, `switches`
    Booleans; `outputs` are read. The `tolerance` is relative. `with_gradients` is the same model
    with gradients of the outputs by parameters and starts of states, if there is one.
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
        with_gradients: Fmu | None = None,
    ) -> None:
        self.fmu, self.names = fmu, (*parameters, *states)
        self.settings, self.tolerance = settings, tolerance
        self._outputs = len(outputs)
        self._wirings = [_Wiring(fmu, inputs, switches, outputs)]
        if with_gradients is not None:
            by = [*parameters, *map("start({})".format, states)]
            slopes = [gradient_name(name, each) for name in outputs for each in by]
            self._wirings.append(_Wiring(with_gradients, inputs, switches, [*outputs, *slopes]))
        self._own, self._runners = threading.local(), list[_Runner]()
        self._pool = ThreadPoolExecutor(CORES)

    def __enter__(self) -> "Simulator":
        return self

    def __exit__(self, *error: object) -> None:
        self._pool.shutdown(cancel_futures=True)  # then no instance is in use
        for runner in self._runners:
            runner.close()

    def map(self, function: Callable[[Task], Answer], tasks: Iterable[Task]) -> list[Answer]:
        """Return answers to tasks, worked on by all cores."""
        return list(self._pool.map(function, tasks))

    def run(self, segment: Segment, values: np.ndarray) -> np.ndarray:
        """Run with values of parameters and states; outputs (rows, outputs), or UserError."""
        return self._runner(self._wirings[0]).run(segment, values)

    def run_with_gradients(self, segment: Segment, values: np.ndarray) -> np.ndarray | None:
        """Run; outputs and their derivatives (rows, outputs, 1 + values), None if not exact."""
        if len(self._wirings) < 2:
            return None
        runner = self._runner(self._wirings[1])
        with suppress(UserError):
            record = runner.run(segment, values)
            if runner.are_exact:
                outputs, slopes = np.split(record, [self._outputs], axis=1)
                return np.dstack([outputs, slopes.reshape(*outputs.shape, len(values))])
        return None

    def _runner(self, wiring: _Wiring) -> "_Runner":
        """Return this thread's instance of an FMU."""
        found = vars(self._own).setdefault("runners", {})
        if wiring not in found:
            found[wiring] = _Runner(self, wiring)
            self._runners.append(found[wiring])
        return found[wiring]


class _Runner:
    """One instance, whose runs begin with a reset."""

    def __init__(self, simulator: Simulator, wiring: _Wiring) -> None:
        self._simulator, self._wiring = simulator, wiring
        self._stack = ExitStack()
        self._instance: Instance | None = None

    @property
    def are_exact(self) -> bool:
        """Whether gradients of the last run are exact, of an FMU that has some."""
        assert self._instance is not None
        return bool(self._instance.discrete(ARE_EXACT))

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
            self.close()  # a failed instance is not used again
            raise

    def _fresh(self) -> tuple[Instance, Reals]:
        """Return the instance, as new, and what is set in it."""
        if self._instance is not None:
            self._instance.reset()
            return self._instance, self._given
        wiring = self._wiring
        with LOADING:
            instance = self._stack.enter_context(wiring.fmu.instance(wiring.fmu.model.name))
        self._instance = instance
        self._given = instance.reals(self._simulator.names)
        inputs, switches, outputs = wiring.inputs, wiring.switches, wiring.outputs
        self._loop = one_component(instance, inputs, switches, outputs)
        return instance, self._given

    def _initialize(self, segment: Segment, values: np.ndarray) -> None:
        """Initialize up to the first row, inputs set and outputs read."""
        simulator, (instance, given) = self._simulator, self._fresh()
        instance.set_up(segment.times[0], segment.times[-1], simulator.tolerance)
        for name, value in simulator.settings.items():
            instance.set(name, value)
        given.view[:] = values
        with instance.explained("(parameters and start)"):
            given.set()
        instance.enter_initialization()
        loop = self._loop
        loop.start(float(segment.times[0]))
        loop.leave_initialization(segment.inputs[0], segment.switches[0])

    def _advance(self, segment: Segment) -> np.ndarray:
        loop = self._loop
        rows = np.empty((len(segment.times), loop.width))
        rows[0] = loop.values[: loop.width]
        loop.run(segment.times[1:], segment.inputs[:-1], segment.switches[:-1], rows)
        return rows


# ---- Start states --------------------------------------------------------------------------------
def state_names(fmu: Fmu) -> list[str]:
    """Return the names of the states; UserError if one cannot be set."""
    names = fmu.model.own_states
    for name in names:
        if not fmu.model.variables[name].is_a(INITIAL):
            raise UserError(f"{fmu.path}: state {name!r} cannot be set where a segment starts")
    return names


def start_rates(fmu: Fmu) -> dict[str, str]:
    """Map states to the state that they are the derivative of, by name."""
    description = fmpy.read_model_description(fmu.folder, validate=False)
    variables = fmu.model.variables
    of_reference = {variables[name].reference: name for name in fmu.model.states}
    found = {}
    for unknown in description.derivatives:
        rate, state = unknown.variable, unknown.variable.derivative
        if state is not None and rate.valueReference in of_reference:
            found[of_reference[rate.valueReference]] = state.name
    return found


def guess_start(
    fmu: Fmu, segments: Sequence[Segment], outputs: Sequence[str], given: Mapping[str, float]
) -> np.ndarray:
    """Guess states (segments, states): measured ones, their derivatives, else start values."""
    model, of = fmu.model, start_rates(fmu)
    names = state_names(fmu)
    found = np.full((len(segments), len(names)), np.nan)
    for row, segment in zip(found, segments, strict=True):
        smooth = _polynomials(segment)
        for k, name in enumerate(names):
            if name in outputs:
                row[k] = smooth[0, outputs.index(name)]
            elif of.get(name) in outputs:
                row[k] = smooth[1, outputs.index(of[name])]
    for name, column in zip(names, found.T, strict=True):
        known = np.isfinite(column)
        if known.any():  # elsewhere from the nearest segments in which it was measured
            column[:] = np.interp(np.arange(len(column)), np.flatnonzero(known), column[known])
        else:
            column[:] = given.get(name, model.variables[name].start or 0.0)
    variables = [model.variables[name] for name in names]
    return np.clip(found, [v.least for v in variables], [v.greatest for v in variables])


def _polynomials(segment: Segment) -> np.ndarray:
    """Fit polynomials to the first rows; return value and derivative (2, outputs) at the start.

    NaN where an output has less than two values.
    """
    outputs = segment.measured.shape[1]
    found, elapsed = np.full((2, outputs), np.nan), segment.times - segment.times[0]
    for k, values in enumerate(segment.measured.T):
        there = np.flatnonzero(np.isfinite(values))
        rows = there[: max(FEWEST, int(WINDOW * len(there)))]
        if len(rows) > 1:
            degree, span = min(DEGREE, len(rows) - 1), elapsed[rows[-1]]
            powers = (elapsed[rows] / span)[:, None] ** np.arange(degree + 1)
            fitted = np.linalg.lstsq(powers, values[rows], rcond=None)[0]
            found[:, k] = fitted[0], fitted[1] / span
    return found


def start_scales(states: np.ndarray) -> np.ndarray:
    """Return the scales (states,) of guessed states (segments, states)."""
    largest = np.abs(states).max(axis=0)
    return np.where(largest > 0, largest, 1.0)


def admitted_start(
    simulator: Simulator, segments: Sequence[Segment], parameters: Parameters, states: np.ndarray
) -> np.ndarray:
    """Move `states` (segments, states) inward until the FMU starts there; UserError if never."""
    values = parameters.values(np.zeros(len(parameters)))
    values = values[: len(simulator.names) - states.shape[1]]
    middle = (states.min(axis=0) + states.max(axis=0)) / 2

    def moved(i: int) -> np.ndarray:
        reason = UserError("")
        for shift in SHIFTS:
            tried = states[i] + shift * (middle - states[i])
            try:
                simulator.run(segments[i], np.append(values, tried))
            except UserError as error:
                reason = error
            else:
                return tried
        raise UserError(f"{simulator.fmu.path}: no segment runs with these starts: {reason}")

    return np.array(simulator.map(moved, range(len(segments))))
