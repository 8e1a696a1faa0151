"""Runs of the loop in C: components and their connections, calls, errors.

Values of a system are one array: outputs by component, then those that drive inputs from outside.
FMUs are called by the addresses of their functions; Python components give such functions, too.
"""

import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import addressof, byref, c_double, c_void_p, cast, sizeof
from typing import Any, NoReturn

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance, Reals
from rparm.loop import structures
from rparm.loop.structures import (
    ENDED,
    FUNCTIONS,
    GET_DISCRETE,
    HOST,
    NOT_FINITE,
    RAISED,
    SET_DISCRETE,
    SLOPES,
    STEP,
    TYPES,
    ComponentState,
    FmuVariable,
    Follow,
    LoopState,
    Run,
    Solve,
    Switch,
    TangentState,
)


# ---- Components ----------------------------------------------------------------------------------
class Component:
    """An instance, its place among the values, and the sources of its inputs.

    From index `first` on, `values` are those of its outputs; each input has a source, an index of
    `values`.
    """

    def __init__(
        self,
        instance: Instance,
        inputs: Sequence[str],
        sources: Sequence[int],
        outputs: Sequence[str],
        first: int,
        values: np.ndarray,
    ) -> None:
        count = len(inputs)
        self.instance, self.first, self.end = instance, first, first + len(outputs)
        self.sources = np.array(sources, np.int64)
        memory = (c_double * len(outputs)).from_buffer(values, first * sizeof(c_double))
        self.inputs = instance.reals(inputs)
        self.outputs = instance.reals(outputs, memory)
        self.on_loop = np.zeros(count, bool)  # inputs that are solved for

        self.state = ComponentState(input_count=count, output_count=len(outputs), first=first)
        self.state.point(
            inputs=self.references(inputs),
            sources=self.sources,
            ahead=np.zeros(count, bool),
            on_loop=self.on_loop,
            orders=np.ones(count, np.int32),
            input_values=self.inputs.view,
            kept=np.zeros((2, count)),
            outputs=self.references(outputs),
            before=np.zeros(len(outputs)),
        )
        self._point_to_calls()

    @property
    def name(self) -> str:
        return self.instance.name

    def references(self, names: Sequence[str]) -> np.ndarray:
        variables = self.instance.fmu.model.variables
        return np.array([variables[name].reference for name in names], np.uint32)

    def read_for_rows(self, columns: Mapping[str, int]) -> None:
        """Read variables into columns of the rows, beside those that are values."""
        variables = self.instance.fmu.model.variables
        real = [name for name in columns if variables[name].type == "Real"]
        discrete = [name for name in columns if name not in real]
        self.state.read_count, self.state.discrete_count = len(real), len(discrete)
        self.state.point(
            read=self.references(real),
            read_columns=np.array([columns[name] for name in real], np.int64),
            read_values=np.zeros(len(real)),
            discretes=(FmuVariable * len(discrete))(*map(self.variable, discrete)),
            discrete_columns=np.array([columns[name] for name in discrete], np.int64),
        )
        self.discretes = discrete

    def variable(self, name: str) -> FmuVariable:
        """Return a discrete variable as the loop refers to it."""
        found = self.instance.fmu.model.variables[name]
        return FmuVariable(found.reference, TYPES.index(found.type))

    def _point_to_calls(self) -> None:
        instance, calls = self.instance, self.state.fmu
        library, pointed = instance.fmi.dll, instance.fmi.component
        calls.instance = pointed if isinstance(pointed, int) else pointed.value
        calls.version = int(instance.fmu.model.fmi_version[0])
        for i, name in enumerate(function_names(instance)):
            own = bool(name) and hasattr(library, name)
            function = getattr(library, name) if own else structures.library().loop_missing
            calls.functions[i] = cast(function, c_void_p).value
        if instance.memory is not None:
            calls.memory, calls.memory_count = instance.memory.ctypes.data, len(instance.memory)
        if instance.polynomials is not None:
            calls.polynomials = addressof(instance.polynomials)


def function_names(instance: Instance) -> Sequence[str]:
    """Return the names of the functions that an instance is called by."""
    return FUNCTIONS[instance.fmu.model.fmi_version]


def check_finite(component: str, outputs: Reals, when: str) -> None:
    bad = np.flatnonzero(~np.isfinite(outputs.view))
    if len(bad):
        name, value = f"{component}.{outputs.names[bad[0]]}", outputs.view[bad[0]]
        raise UserError(f"{name} is {value} {when}: a finite value is expected")


def one_component(
    instance: Instance, inputs: Sequence[str], switches: Sequence[str], outputs: Sequence[str]
) -> "Loop":
    """Return a loop of one instance, whose inputs, Real and discrete, come from outside.

    What comes from outside holds over a step; its rows are the outputs at the ends of steps.
    """
    count = len(outputs)
    values = np.zeros(count + len(inputs) + 1)  # never empty
    sources = range(count, len(values) - 1)
    component = Component(instance, inputs, sources, outputs, 0, values)
    loop = Loop([component], values[:-1], len(inputs))
    loop.switch([(i, 0, name) for i, name in enumerate(switches)], len(switches))
    loop.record(range(count))
    loop.state.is_final = loop.state.reads_for_rows = loop.state.inputs_first = True
    return loop


def side_by_side(columns: Iterable[np.ndarray], count: int, kind: type) -> np.ndarray:
    """Return what comes from outside, (count, columns), of columns (count,) each."""
    found = [column.astype(kind) for column in columns]
    return np.column_stack(found) if found else np.empty((count, 0), kind)


class Tangent:
    """A small deviation of the states of a component, carried along: tangent.h.

    By value references: the derivatives of states, these states, discrete outputs that are Real and
    that are Integer.
    """

    def __init__(self, *references: np.ndarray) -> None:
        derivatives, states, reals, integers = references
        count = len(states)
        self.state = TangentState(count=count, real_count=len(reals), integer_count=len(integers))
        self.deviation = np.zeros(count)
        self.state.point(
            derivatives=derivatives, states=states, deviation=self.deviation, rate=np.zeros(count),
            predicted=np.zeros(count), reals=reals, real_values=np.zeros(2 * len(reals)),
            integers=integers, integer_values=np.zeros(len(integers), np.int64),
        )  # fmt: skip

    def start(self) -> None:
        """Begin with a deviation of all states alike."""
        self.deviation[:] = 1 / np.sqrt(max(len(self.deviation), 1))
        self.state.has_begun = False


# ---- The loop ------------------------------------------------------------------------------------
class Loop:
    """Steps components, in groups that step together, from the present time on.

    Attributes
    ----------
    state : LoopState
        What loop.h explains; flags are set there.
    done : int
        Steps of the last call of `run` that did not fail.
    """

    def __init__(
        self,
        components: Sequence[Component],
        values: np.ndarray,
        driven: int = 0,
        groups: Sequence[Sequence[int]] | None = None,
        slopes: np.ndarray | None = None,
    ) -> None:
        self._library, self.components, self.done = structures.library(), components, 0
        owners = np.full(len(values), -1, np.int64)
        for i, component in enumerate(components):
            owners[component.first : component.end] = i
            component.state.number = i
        groups = [range(len(components))] if groups is None else groups
        self.values, self.width = values, 0
        self._raised: BaseException | None = None  # in a function that the loop calls
        self.state = LoopState(
            component_count=len(components), group_count=len(groups),
            first_driven=len(values) - driven, driven_count=driven,
        )  # fmt: skip
        self.state.point(
            components=(c_void_p * len(components))(*(addressof(c.state) for c in components)),
            values=values,
            slopes=np.zeros(len(values)) if slopes is None else slopes, owners=owners,
            grouped=np.array([i for group in groups for i in group], np.int64),
            group_first=np.cumsum([0, *map(len, groups)]),
        )  # fmt: skip
        self.switch([], 0)
        self.record([])

    def switch(self, wires: Sequence[tuple[Any, int, str]], scheduled: int) -> None:
        """Connect discrete inputs: (source, component, variable).

        A source is an output (component, variable), or a column of what is `scheduled`.
        """
        switches = (Switch * len(wires))()
        for made, (source, target, variable) in zip(switches, wires, strict=True):
            made.target, made.to = target, self.components[target].variable(variable)
            if isinstance(source, int):
                made.source, made.column = -1, source
            else:
                made.source = source[0]
                made.from_ = self.components[source[0]].variable(source[1])
        self._wires = wires
        self.state.switch_count, self.state.scheduled_count = len(wires), scheduled
        self.state.point(switches=switches)
        self._switches = switches

    def call(
        self, solve: Callable[[int], object] | None, follow: Callable[[], object] | None
    ) -> None:
        """Set functions that solve algebraic loops of a group, and compute what switches change."""
        if solve is not None:
            self.state.solve = Solve(lambda group: self._called(lambda: solve(group)))
        if follow is not None:
            self.state.follow = Follow(lambda: self._called(follow))

    def _called(self, function: Callable[[], object]) -> int:
        try:
            function()
        except BaseException as error:  # no other way leads out of a call of C
            self._raised = error
            return 1
        return 0

    def carry(self, tangent: Tangent) -> None:
        """Carry a deviation of the first component's states along."""
        self.state.point(tangent=tangent.state)

    # ---- Rows ------------------------------------------------------------------------------------

    def record(self, columns: Sequence[int], further: int = 0) -> None:
        """Record values in the first columns of rows; `further` columns are the components'."""
        self.width = len(columns) + further
        self.state.row_width, self.state.column_count = self.width, len(columns)
        self.state.point(columns=np.array(columns, np.int64))

    def read_row(self, row: np.ndarray) -> None:
        """Read a row now."""
        if self._library.loop_read_row(byref(self.state), row.ctypes.data):
            self._fail()

    # ---- Steps -----------------------------------------------------------------------------------

    def start(self, time: float) -> None:
        """Begin at a time, s."""
        self.state.start = self.state.time = time
        for component in self.components:
            component.state.time, component.state.ticks, component.state.is_due = time, 0.0, True

    def leave_initialization(self, driven: np.ndarray, scheduled: np.ndarray) -> None:
        """Set all inputs, come to the first communication point, and read all outputs there."""
        self.values[self.state.first_driven :] = driven
        self.set_inputs("in initialization")
        self.set_switches(scheduled)
        for component in self.components:
            component.instance.exit_initialization()
        self.read()

    def read(self) -> None:
        """Read all outputs into the values."""
        for component in self.components:
            with component.instance.explained(f"at t = {self.state.time!r} s"):
                component.outputs.get()

    def set_inputs(self, when: str) -> None:
        """Set all Real inputs to the values."""
        for component in self.components:
            component.inputs.view[:] = self.values[component.sources]
            with component.instance.explained(when):
                component.inputs.set()

    def know_switches(self, scheduled: np.ndarray) -> None:
        """Take what discrete inputs that follow a schedule have been set to."""
        for (source, _, _), made in zip(self._wires, self._switches, strict=True):
            if isinstance(source, int):
                made.value = scheduled[source]

    def set_switches(self, scheduled: np.ndarray) -> None:
        """Set all discrete inputs that follow a schedule."""
        self.know_switches(scheduled)
        for source, target, name in self._wires:
            if isinstance(source, int):
                instance, value = self.components[target].instance, int(scheduled[source])
                is_boolean = instance.fmu.model.variables[name].type == "Boolean"
                instance.set(name, bool(value) if is_boolean else value)

    def transfer(self, scheduled: np.ndarray) -> list[str]:
        """Set the discrete inputs whose sources have another value, and return their names."""
        if self._library.loop_transfer(byref(self.state), scheduled.ctypes.data) < 0:
            self._fail()
        return [
            f"{self.components[target].name}.{variable}"
            for (_, target, variable), made in zip(self._wires, self._switches, strict=True)
            if made.is_new
        ]

    def follow_slopes(self) -> None:
        """Compute the slopes of inputs and outputs at the present time."""
        if self._library.loop_follow_slopes(byref(self.state)):
            self._fail()

    def run(
        self,
        ends: np.ndarray,
        driven: np.ndarray | None = None,
        scheduled: np.ndarray | None = None,
        rows: np.ndarray | None = None,
        has_row: np.ndarray | None = None,
        growth: np.ndarray | None = None,
        progress: Callable[[int], object] | None = None,
    ) -> None:
        """Make steps to their ends; UserError if one fails.

        Parameters
        ----------
        ends : (n,) s
        driven : (n, driven), float
            Values from outside, at the ends; at the beginnings if inputs come first.
        scheduled : (n, scheduled), int64
            Discrete values from outside, the same.
        rows : (1 + rows, width)
            Filled from the second on; the first has the values before the steps.
        has_row : (n,), bool
            Steps that end in a row; default: all.
        growth : (n,)
            Of the deviation that is carried along, by each step.
        progress : callable
            Gets the number of steps since its last call.
        """
        ends = np.ascontiguousarray(ends, float)
        given = {"ends": ends} | ({} if growth is None else {"growth": growth})
        for name, array, kind in (
            ("driven", driven, float), ("scheduled", scheduled, np.int64),
            ("has_row", has_row, bool),
        ):  # fmt: skip
            if array is not None:
                given[name] = np.ascontiguousarray(array, kind)
        counts = None if has_row is None else np.cumsum(has_row)
        self.done = 0
        with self._interruptible():
            while self.done < len(ends):
                first, here = self.done, slice(self.done, None)
                run = Run(count=len(ends) - first)
                run.point(**{name: array[here] for name, array in given.items()})
                if rows is not None:
                    made = first if counts is None or not first else counts[first - 1]
                    run.point(rows=rows[1 + made :])
                self.done += self._library.loop_advance(byref(self.state), byref(run))
                if self.state.failure.status:
                    self._fail()
                if progress is not None:
                    progress(self.done - first)

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Let what a signal raises in a function that C calls end the run: ctypes would print it.

        Signals come in the main thread only, at the first instruction of any such function.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = sys.unraisablehook

        def hook(unraisable: Any) -> None:
            is_main = threading.current_thread() is threading.main_thread()
            if is_main and "ctypes" in (unraisable.err_msg or ""):
                self._raised, self.state.stop = unraisable.exc_value, True
            else:
                before(unraisable)

        sys.unraisablehook = hook
        try:
            yield
        finally:
            sys.unraisablehook = before

    # ---- Errors ----------------------------------------------------------------------------------

    def _fail(self) -> NoReturn:
        """Raise the error of what has failed."""
        found, stopped = self.state.failure, self.state.stop
        self.state.stop = False
        if found.phase == HOST or stopped:
            for component in self.components:
                if component.instance.polynomials is not None:
                    component.instance.polynomials.status = 0
            error, self._raised = self._raised, None
            raise error or KeyboardInterrupt
        component, time = self.components[found.component], found.time
        instance, calls = component.instance, component.state.fmu
        when = f"at t = {time!r} s"
        if found.phase == NOT_FINITE:
            check_finite(component.name, component.outputs, when)
        if found.status == RAISED:
            raise instance.raised()
        if found.status == ENDED:
            raise instance.ended(f"at t = {calls.reached!r} s")
        is_discrete = found.phase in (GET_DISCRETE, SET_DISCRETE)
        if found.phase == STEP or is_discrete and self.state.inputs_first and found.item >= 0:
            when = f"in the step from t = {time!r} s"
        elif found.phase == SLOPES:
            when = f"for slopes {when}"
        elif is_discrete:
            when = self._of_discrete(component, found.phase, found.item)
        failed = FMICallException(function_names(instance)[calls.called], found.status)
        raise instance.failure(failed, when) from failed

    def _of_discrete(self, component: Component, phase: int, item: int) -> str:
        if item < 0:
            return f"({component.discretes[-1 - item]})"
        source, target, variable = self._wires[item]
        if phase == SET_DISCRETE:
            return f"({variable} = {self._switches[item].value!r})"
        is_target = component is self.components[target]
        return f"({variable if is_target else source[1]})"
