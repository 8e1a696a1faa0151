"""The stepping loop of a run, compiled by numba: set inputs, step all components, read, record.

The components of a system step in Jacobi order, as in `rparm.systems.master`: all of them make a
step, then all outputs are read. A scenario is a system of one component, whose inputs come from
its file. Values lie in two arrays, Reals and Booleans: first those with zero-order hold, which the
file gives, then the outputs of each component.

The functions of FMUs are called by their addresses, which are arguments: one compiled loop serves
every FMU, and numba keeps it on disk. All pointers are integers. A call takes microseconds less
than by ctypes. FMUs of FMI 3.0 are called through `rparm.fmi.compiled_fmi3`.
"""

from collections.abc import Sequence
from ctypes import c_void_p, cast
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from fmpy.fmi1 import FMICallException
from numba import njit

from rparm.errors import UserError
from rparm.fmi.compiled_call import call
from rparm.fmi.fmi_instance import DISCARD, TERMINATED, Instance

FUNCTIONS = {
    "2.0": (
        "fmi2SetReal", "fmi2GetReal", "fmi2SetBoolean", "fmi2GetBoolean", "fmi2DoStep",
        "fmi2GetDirectionalDerivative", "fmi2GetInteger",
    ),
    "3.0": (
        "fmi3SetFloat64", "fmi3GetFloat64", "fmi3SetBoolean", "fmi3GetBoolean", "fmi3DoStep",
        "fmi3GetDirectionalDerivative", "fmi3GetInt32",
    ),
}  # fmt: skip
SET_REAL, GET_REAL, SET_BOOLEAN, GET_BOOLEAN, DO_STEP, DERIVATIVE, GET_INTEGER = range(7)
FINAL = np.int32(1)  # no step is ever undone
COLUMNS = 8  # component and addresses of its functions


# ---- Calls of an FMU -----------------------------------------------------------------------------
def function_names(instance: Instance) -> tuple[str, ...]:
    """Return the names of the functions that an instance is called by."""
    return FUNCTIONS[instance.fmu.model.fmi_version]


def function_addresses(instance: Instance) -> list[int]:
    """Return the addresses of its functions in the loaded library; 0 for one that is not there."""
    library = instance.fmi.dll
    return [
        cast(getattr(library, name), c_void_p).value or 0 if hasattr(library, name) else 0
        for name in function_names(instance)
    ]


# ---- Values --------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Part:
    """Variables of one type, Real or Boolean, that a component exchanges."""

    inputs: tuple[int, ...]  # value references
    sources: tuple[int, ...]  # of each input, among the values
    outputs: tuple[int, ...]  # value references, read after each step


class Wires(NamedTuple):
    """Inputs and outputs of one type of all components, as the loop takes them."""

    inputs: np.ndarray  # (inputs,) value references
    first_input: np.ndarray  # (components + 1,)
    sources: np.ndarray  # (inputs,) indices among the values
    outputs: np.ndarray  # (outputs,) value references
    first_output: np.ndarray  # (components + 1,)
    values: np.ndarray  # (held + outputs,)
    to_set: np.ndarray  # (inputs,): the value of each input

    @staticmethod
    def of(parts: Sequence[Part], held: int, kind: type) -> "Wires":
        """Wire components, after `held` values that the file gives."""
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

    The exponent of its growth is Lyapunov's over a finite time. At an event the deviation may jump,
    which derivatives do not see: a step in which a discrete output changes has the growth nan.
    """

    derivatives: np.ndarray  # (states,) value references
    states: np.ndarray  # (states,) value references
    reals: np.ndarray  # value references of discrete outputs that are Real
    integers: np.ndarray  # value references of discrete outputs that are Integer
    deviation: np.ndarray = field(init=False)  # (states,) of length 1

    def __post_init__(self) -> None:
        self.deviation = np.empty(len(self.states))

    @property
    def fields(self) -> tuple[np.ndarray, ...]:
        return self.derivatives, self.states, self.reals, self.integers, self.deviation

    @staticmethod
    def none() -> "Tangent":
        """Return an empty deviation: none is carried along."""
        return Tangent(*[np.zeros(0, np.uint32)] * 4)


# ---- The loop ------------------------------------------------------------------------------------
def component_calls(instances: Sequence[Instance]) -> np.ndarray:
    """Return a row per component: its functions' addresses, then a part that adapters refer to."""
    calls = np.zeros((len(instances), 2 * COLUMNS), np.int64)
    for row, instance in zip(calls, instances, strict=True):
        called, adapted = row[:COLUMNS], row[COLUMNS:]
        own = _component(instance), *function_addresses(instance)
        if instance.fmu.model.fmi_version == "2.0":
            called[:] = own
        else:
            from rparm.fmi.compiled_fmi3 import ADDRESSES  # takes time

            called[:] = adapted.ctypes.data, *ADDRESSES
            adapted[:] = own
    return calls


def _component(instance: Instance) -> int:
    pointer = instance.fmi.component
    return pointer if isinstance(pointer, int) else pointer.value


@njit(cache=True, nogil=True)
def _set(calls, wires, component, function, always):
    """Set the inputs of a component from the values; return the FMU's status."""
    inputs, first, sources, _, _, values, to_set = wires
    begin, end = first[component], first[component + 1]
    changed = always
    for i in range(begin, end):
        value = values[sources[i]]
        changed = changed or value != to_set[i]
        to_set[i] = value
    if begin == end or not changed:
        return 0
    references = inputs.ctypes.data + begin * inputs.itemsize
    place = to_set.ctypes.data + begin * to_set.itemsize
    return call(
        calls[component, 1 + function], (calls[component, 0], references, end - begin, place)
    )


@njit(cache=True, nogil=True)
def _read(calls, wires, component, function):
    """Read the outputs of a component into the values; return the FMU's status."""
    _, _, _, outputs, first, values, _ = wires
    begin, end = first[component], first[component + 1]
    if begin == end:
        return 0
    references = outputs.ctypes.data + begin * outputs.itemsize
    place = values.ctypes.data + (len(values) - len(outputs) + begin) * values.itemsize
    return call(
        calls[component, 1 + function], (calls[component, 0], references, end - begin, place)
    )


@njit(cache=True, nogil=True)
def set_inputs(calls, reals, switches, always):
    """Set all inputs, Booleans if they change or `always`; return status, function, component."""
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
    """Read all outputs; return status, function and component."""
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
    """Write the rate of a deviation of the first component's states; return the FMU's status."""
    unknowns, knowns, count = derivatives.ctypes.data, states.ctypes.data, len(states)
    given = calls[0, 0], unknowns, count, knowns, count, deviation.ctypes.data, rate.ctypes.data
    return call(calls[0, 1 + DERIVATIVE], given)


@njit(cache=True, nogil=True)
def _changes(calls, references, function, values, before):
    """Read discrete outputs of the first component; return the status, and whether one differs."""
    if len(references) == 0:
        return 0, False
    before[:] = values
    given = calls[0, 0], references.ctypes.data, len(references), values.ctypes.data
    status = call(calls[0, 1 + function], given)
    return status, np.any(before != values)


@njit(cache=True, nogil=True)
def _normalize(deviation):
    """Scale to length 1; return the length before."""
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

    Returns status, function, component and step of the call that failed; status 0 if none did.

    Parameters
    ----------
    calls : (components, 2 * COLUMNS) of component_calls
    times : (n + 1,) s
    held, held_switches : (n + 1, held values), zero-order hold: over the step from times[i]
    reals, switches : tuples of Wires
    points : (rows,)
        Indices of times, from 1 on, at which outputs are read: all, if components are connected.
    watched : (variables,) columns among the Reals
    record : (rows, variables) read after the step to times[points[j]]
    tangent : fields of Tangent, empty if no deviation is carried along
    growth : (n,) factor by which each step lengthens the deviation, if there is one
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
            status = call(calls[c, 1 + DO_STEP], (calls[c, 0], times[i], length, FINAL))
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
            old, new = integers[0], integers[1]
            status, turns = _changes(calls, discrete_integers, GET_INTEGER, old, new)
            if status >= DISCARD:
                return status, GET_INTEGER, 0, i
            if jumps or turns:
                growth[i] = np.nan
        if is_read:
            for k in range(len(watched)):
                record[row, k] = values[watched[k]]
            row += 1
    return 0, 0, 0, 0


# ---- For its callers -----------------------------------------------------------------------------
class Stepper:
    """Steps components whose Reals and Booleans are wired to each other and to held inputs."""

    def __init__(
        self, reals: Sequence[Part], switches: Sequence[Part], held_reals: int, held_switches: int
    ) -> None:
        self.reals = Wires.of(reals, held_reals, np.float64)
        self.switches = Wires.of(switches, held_switches, np.int32)
        self._instances: Sequence[Instance] = ()
        self.calls = np.zeros((0, 2 * COLUMNS), np.int64)

    def connect(self, instances: Sequence[Instance]) -> None:
        """Take the instances of all components; they stay open as long as they are used."""
        self._instances, self.calls = instances, component_calls(instances)

    def set_inputs(self, when: str) -> None:
        """Set all inputs from the values; UserError, which says `when`, if that fails."""
        self._check(set_inputs(*self._state(), True), when)

    def read_outputs(self, when: str) -> None:
        """Read all outputs into the values; UserError, which says `when`, if that fails."""
        self._check(read_outputs(*self._state()), when)

    def advance(
        self,
        times: np.ndarray,
        held: np.ndarray,
        held_switches: np.ndarray,
        points: np.ndarray,
        watched: np.ndarray,
        record: np.ndarray,
        tangent: Tangent | None = None,
        growth: np.ndarray | None = None,
    ) -> tuple[int, UserError | None]:
        """Make steps as `advance` explains; return how many were made, and why not all of them."""
        tangent = Tangent.none() if tangent is None else tangent
        calls, *wires = self._state()
        found = record, tangent.fields, np.empty(0) if growth is None else growth
        given = calls, times, held, held_switches, *wires, points, watched
        *failed, step = advance(*given, *found)
        try:
            self._check(failed, f"in the step from t = {float(times[step])!r} s")
        except UserError as error:
            return step, error
        return len(times) - 1, None

    def _state(self) -> tuple:
        return self.calls, tuple(self.reals), tuple(self.switches)

    def _check(self, failed: Sequence[int], when: str) -> None:
        """Raise the user's error if the loop says that a function failed."""
        status, function, component = failed
        if status < DISCARD:
            return
        instance = self._instances[component]
        if status == TERMINATED:
            raise instance.ended(when)
        raise instance.failure(FMICallException(function_names(instance)[function], status), when)
