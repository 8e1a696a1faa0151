"""The stepping loop of a run, compiled: set inputs, step all components, read, record.

The components of a system step in Jacobi order, as in `rparm.coupling.master`: all of them make a
step, then all outputs are read. A scenario is a system of one component, whose inputs come from
its file. Values are laid out in two arrays, one of Reals and one of Booleans: first those with
zero-order hold, which the file gives, then the outputs of each component.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit

from rparm.fmi.compiled.calls import (
    DERIVATIVE,
    DISCARD,
    DO_STEP,
    GET_BOOLEAN,
    GET_INTEGER,
    GET_REAL,
    SET_BOOLEAN,
    SET_REAL,
    addresses,
    directional_derivative,
    do_step,
    move_values,
)
from rparm.fmi.fmi_instance import Instance

COLUMNS = 8  # component and addresses of its functions


@dataclass(frozen=True)
class Part:
    """What of one type a component exchanges: Reals or Booleans."""

    inputs: tuple[int, ...]  # value references
    sources: tuple[int, ...]  # of each input, among the values
    outputs: tuple[int, ...]  # value references of what is read after each step


class Wires(NamedTuple):
    """Inputs and outputs of one type of all components, as the loop takes them."""

    inputs: np.ndarray  # (inputs,) value references
    first_input: np.ndarray  # (components + 1,)
    sources: np.ndarray  # (inputs,) indices among the values
    outputs: np.ndarray  # (outputs,) value references
    first_output: np.ndarray  # (components + 1,)
    values: np.ndarray  # (held + outputs,)
    to_set: np.ndarray  # (inputs,): what each input has

    @staticmethod
    def of(parts: Sequence[Part], held: int, kind: type) -> "Wires":
        """Wires of components, after `held` values that the file gives."""
        inputs = [reference for part in parts for reference in part.inputs]
        outputs = [reference for part in parts for reference in part.outputs]
        return Wires(
            np.array(inputs, np.uint32),
            np.cumsum([0, *(len(part.inputs) for part in parts)]),
            np.array([source for part in parts for source in part.sources], np.int64),
            np.array(outputs, np.uint32),
            np.cumsum([0, *(len(part.outputs) for part in parts)]),
            np.zeros(held + len(outputs), kind),
            np.zeros(len(inputs), kind),
        )


@dataclass
class Tangent:
    """A small deviation of the states, carried along by directional derivatives.

    The exponent of its growth is that of Lyapunov over a finite time. At an event it may jump,
    which derivatives do not see: a step in which a discrete output changes has the growth nan.
    """

    derivatives: np.ndarray  # (states,) value references
    states: np.ndarray  # (states,) value references
    reals: np.ndarray  # value references of discrete outputs that are Real
    integers: np.ndarray  # of those that are Integer
    deviation: np.ndarray = field(init=False)  # (states,) of length 1

    def __post_init__(self) -> None:
        self.deviation = np.empty(len(self.states))

    @property
    def fields(self) -> tuple[np.ndarray, ...]:
        return self.derivatives, self.states, self.reals, self.integers, self.deviation

    @staticmethod
    def none() -> "Tangent":
        """No deviation is carried along."""
        return Tangent(*[np.zeros(0, np.uint32)] * 4)


def component_calls(instances: Sequence[Instance]) -> np.ndarray:
    """Component and addresses of its functions, for the loop; then what adapters need.

    (instances, 2 * COLUMNS), without a copy: an adapter is given the address of its part.
    """
    calls = np.zeros((len(instances), 2 * COLUMNS), np.int64)
    for row, instance in zip(calls, instances, strict=True):
        called, adapted = row[:COLUMNS], row[COLUMNS:]
        own = _component(instance), *addresses(instance)
        if instance.fmu.model.fmi_version == "2.0":
            called[:] = own
        else:
            from rparm.fmi.compiled.fmi3_adapters import ADDRESSES  # takes time

            called[:] = adapted.ctypes.data, *ADDRESSES
            adapted[:] = own
    return calls


def _component(instance: Instance) -> int:
    pointer = instance.fmi.component
    return pointer if isinstance(pointer, int) else pointer.value


@njit(cache=True, nogil=True)
def _set(calls, wires, component, function, always):
    """Set the inputs of a component from the values; the status of the FMU."""
    inputs, first, sources, _, _, values, to_set = wires
    begin, end = first[component], first[component + 1]
    changed = always
    for i in range(begin, end):
        value = values[sources[i]]
        changed = changed or value != to_set[i]
        to_set[i] = value
    if begin == end or not changed:
        return 0
    return move_values(
        calls[component, 1 + function],
        calls[component, 0],
        inputs.ctypes.data + begin * inputs.itemsize,
        end - begin,
        to_set.ctypes.data + begin * to_set.itemsize,
    )


@njit(cache=True, nogil=True)
def _read(calls, wires, component, function):
    """Read the outputs of a component into the values; the status of the FMU."""
    _, _, _, outputs, first, values, _ = wires
    begin, end = first[component], first[component + 1]
    if begin == end:
        return 0
    first_value = len(values) - len(outputs) + begin
    return move_values(
        calls[component, 1 + function],
        calls[component, 0],
        outputs.ctypes.data + begin * outputs.itemsize,
        end - begin,
        values.ctypes.data + first_value * values.itemsize,
    )


@njit(cache=True, nogil=True)
def set_inputs(calls, reals, switches, always):
    """Set all inputs, Booleans if they change or `always`; status, function and component."""
    for c in range(len(calls)):
        status = _set(calls, reals, c, SET_REAL, True)
        if status >= DISCARD:
            return status, SET_REAL, c
        status = _set(calls, switches, c, SET_BOOLEAN, always)
        if status >= DISCARD:
            return status, SET_BOOLEAN, c
    return 0, 0, 0


@njit(cache=True, nogil=True)
def read_outputs(calls, reals, switches):
    """Read all outputs; status, function and component."""
    for c in range(len(calls)):
        status = _read(calls, reals, c, GET_REAL)
        if status >= DISCARD:
            return status, GET_REAL, c
        status = _read(calls, switches, c, GET_BOOLEAN)
        if status >= DISCARD:
            return status, GET_BOOLEAN, c
    return 0, 0, 0


@njit(cache=True, nogil=True)
def _deviation_rate(calls, derivatives, states, deviation, rate):
    """Write the derivative by time of a deviation of the first component's states to `rate`.

    Returns the status of the FMU.
    """
    return directional_derivative(
        calls[0, 1 + DERIVATIVE],
        calls[0, 0],
        derivatives.ctypes.data,
        states.ctypes.data,
        len(states),
        deviation.ctypes.data,
        rate.ctypes.data,
    )


@njit(cache=True, nogil=True)
def _changes(calls, references, function, values, before):
    """Read discrete outputs of the first component; the FMU's status, and whether one differs."""
    if len(references) == 0:
        return 0, False
    before[:] = values
    status = move_values(
        calls[0, 1 + function],
        calls[0, 0],
        references.ctypes.data,
        len(references),
        values.ctypes.data,
    )
    return status, np.any(before != values)


@njit(cache=True, nogil=True)
def _normalize(deviation):
    """Scale to length 1; the length before."""
    total = 0.0
    for x in deviation:
        total += x * x
    length = np.sqrt(total)
    for i in range(len(deviation)):
        deviation[i] /= length
    return length


@njit(cache=True, nogil=True)
def advance(
    calls, times, held, held_switches, reals, switches, points, watched, record, tangent, growth
):
    """Make all steps from times[0], where outputs have been read.

    Parameters
    ----------
    calls : (components, 2 * COLUMNS) of component_calls
    times : (n + 1,) s
    held, held_switches : (n + 1, held values), zero-order hold: over the step from times[i]
    reals, switches : tuples of Wires
    points : (rows,)
        Where outputs are read: indices of times from 1 on, that increase. Where components are
        connected, that is everywhere.
    watched : (variables,) columns among the Reals
    record : (rows, variables)
        What an importer reads after the step to times[points[j]].
    tangent : fields of Tangent, empty if no deviation is carried along
    growth : (n,)
        By how much each step lengthens the deviation: filled if one is carried along.

    Returns
    -------
    status, function, component, step
        What failed; status 0 if nothing did.
    """
    derivatives, states, discrete_reals, discrete_integers, deviation = tangent
    carried = len(states) > 0
    numbers = np.empty((2, len(discrete_reals)))
    integers = np.empty((2, len(discrete_integers)), np.int32)
    if carried:
        status, _ = _changes(calls, discrete_reals, GET_REAL, numbers[0], numbers[1])
        if status >= DISCARD:
            return status, GET_REAL, 0, 0
        status, _ = _changes(calls, discrete_integers, GET_INTEGER, integers[0], integers[1])
        if status >= DISCARD:
            return status, GET_INTEGER, 0, 0
    before, after = np.empty_like(deviation), np.empty_like(deviation)
    values, truths = reals[5], switches[5]
    row = 0
    for i in range(len(times) - 1):
        length = times[i + 1] - times[i]
        for j in range(held.shape[1]):
            values[j] = held[i, j]
        for j in range(held_switches.shape[1]):
            truths[j] = held_switches[i, j]
        status, function, c = set_inputs(calls, reals, switches, False)
        if status >= DISCARD:
            return status, function, c, i
        if carried:
            status = _deviation_rate(calls, derivatives, states, deviation, before)
            if status >= DISCARD:
                return status, DERIVATIVE, 0, i
        for c in range(len(calls)):
            status = do_step(calls[c, 1 + DO_STEP], calls[c, 0], times[i], length)
            if status >= DISCARD:
                return status, DO_STEP, c, i
        is_read = row < len(points) and points[row] == i + 1
        if is_read:
            status, function, c = read_outputs(calls, reals, switches)
            if status >= DISCARD:
                return status, function, c, i
        if carried:  # Heun's method
            for k in range(len(deviation)):
                before[k] = deviation[k] + length * before[k]
            status = _deviation_rate(calls, derivatives, states, before, after)
            if status >= DISCARD:
                return status, DERIVATIVE, 0, i
            for k in range(len(deviation)):
                deviation[k] = 0.5 * (deviation[k] + before[k] + length * after[k])
            growth[i] = _normalize(deviation)
            status, jumps = _changes(calls, discrete_reals, GET_REAL, numbers[0], numbers[1])
            if status >= DISCARD:
                return status, GET_REAL, 0, i
            status, turns = _changes(
                calls, discrete_integers, GET_INTEGER, integers[0], integers[1]
            )
            if status >= DISCARD:
                return status, GET_INTEGER, 0, i
            if jumps or turns:
                growth[i] = np.nan
        if is_read:
            for k in range(len(watched)):
                record[row, k] = values[watched[k]]
            row += 1
    return 0, 0, 0, 0
