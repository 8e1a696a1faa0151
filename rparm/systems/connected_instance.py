"""A component of a running system: its instance, its place among the system's values, its rate."""

from collections.abc import Collection, Mapping, Sequence
from ctypes import Array, c_double, sizeof

import numpy as np

from rparm.errors import UserError, placed
from rparm.fmi.fmi_instance import Instance, Reals, UnpackedFmu
from rparm.fmi.model import INPUTS, Value
from rparm.systems.python_component import is_python

ROUNDING = 1e-9  # of a step: two times closer than that are equal


class ConnectedInstance:
    """An instance, its place among the system's values, and the sources of its inputs.

    From index `first` on, `values` and `slopes`, their derivatives with respect to time, are those
    of its outputs; `feeding` names the outputs that are connected, `solved` those of them on
    algebraic loops. Each input has a source, an index of `values`, whose component steps `ahead`
    of this one or not. The instance steps `every` s, or with the system.
    """

    def __init__(
        self,
        instance: Instance,
        inputs: Sequence[str],
        outputs: Sequence[str],
        first: int,
        feeding: Collection[str],
        solved: Collection[str],
        sources: Sequence[int],
        ahead: Sequence[bool],
        values: Array,
        slopes: np.ndarray,
        every: float | None,
    ) -> None:
        self.instance, self.every = instance, every
        self.time, self.ticks = 0.0, 0.0  # of its last communication point, s, and their number
        self.sources = np.array(sources, dtype=int)
        self.ahead, self.has_ahead = np.array(ahead, dtype=bool), any(ahead)
        self.first, self.end = first, first + len(outputs)  # among the values
        memory = (c_double * len(outputs)).from_buffer(values, first * sizeof(c_double))
        self.outputs = instance.reals(outputs, memory)
        self.inputs = instance.reals(inputs)
        self.kept = np.zeros((2, len(inputs)))  # their sources and slopes as its step began
        self.on_loop, self.solves = np.zeros(len(inputs), dtype=bool), False  # solved for by loops

        # slopes: of the FMU, else of the line through the last two values
        model = instance.fmu.model
        self._takes_slopes = model.interpolates_inputs
        self._lines = instance.input_polynomials(inputs, 1) if self._takes_slopes else None
        moving = [
            i
            for i, name in enumerate(outputs)
            if name in feeding and model.variables[name].variability != "discrete"
        ]
        self._is_sampled = bool(feeding) and not moving
        if is_python(instance.fmu.path.name):
            moving, self._is_sampled = [], True
        given = model.gives_output_derivatives
        known = [i for i in moving if given and outputs[i] not in solved]
        self._output_slopes = instance.output_derivatives([outputs[i] for i in known], 1)
        self._slopes = slopes
        self._slope_indices = first + np.array(known, dtype=int)
        self._differences = np.array([i for i in moving if i not in known], dtype=int)

    @property
    def name(self) -> str:
        return self.instance.name

    def begin(self, start: float, stop: float | None, parameters: Mapping[str, Value]) -> None:
        """Initialize it; inputs on algebraic loops have first guesses among the parameters."""
        variables = self.instance.fmu.model.variables
        for i, name in enumerate(self.inputs.names):
            if name in parameters and not self.on_loop[i]:
                raise UserError(f"{self.name}.{name}: is connected and cannot be set")
            self.inputs.view[i] = parameters.get(name, variables[name].start or 0.0)
        self.start = self.time = start
        begin_instance(self.instance, start, stop, parameters)

    # ---- Its rate --------------------------------------------------------------------------------

    def is_due(self, end: float, length: float) -> bool:
        """Whether its own step ends with the system's step of this length, at `end`, in s.

        The end is the system's point nearest to a multiple of `every`, the earlier of two.
        """
        if self.every is None or self.every <= length:
            return True
        due = self.start + (self.ticks + 1) * self.every - length / 2
        return due <= end + ROUNDING * length

    def ended(self, end: float, length: float) -> None:
        """Note that its step has ended with the system's step of this length."""
        self.time = end
        if self.every is not None:
            passed = (end - self.start + (0.5 + ROUNDING) * length) / self.every
            self.ticks = max(self.ticks, np.floor(passed))

    def place(self) -> tuple[float, float, np.ndarray, np.ndarray]:
        """Return where it is beside the state of its FMU, for `go_to`."""
        return self.time, self.ticks, self.kept.copy(), self.inputs.view.copy()

    def go_to(self, time: float, ticks: float, kept: np.ndarray, inputs: np.ndarray) -> None:
        self.time, self.ticks = time, ticks
        self.kept[:], self.inputs.view[:] = kept, inputs

    # ---- Values ----------------------------------------------------------------------------------

    def keep(self, values: np.ndarray, slopes: np.ndarray | None) -> None:
        """Keep what feeds it at the beginning of its step: the system's values and slopes."""
        self.kept[0] = values[self.sources]
        if slopes is not None:
            self.kept[1] = slopes[self.sources]

    def renew(self, values: np.ndarray, slopes: np.ndarray) -> None:
        """Keep the newest of the sources ahead, in place of what they were."""
        newer = self.sources[self.ahead]
        self.kept[:, self.ahead] = values[newer], slopes[newer]

    def set_inputs(self, values: np.ndarray) -> None:
        """Set the inputs, (inputs,), in their units."""
        self.inputs.view[:] = values
        self.inputs.set()

    def follow(self, values: np.ndarray) -> None:
        """Set the inputs to the system's values, those on algebraic loops as they are solved for.

        Their sources are equal but for rounding, which the gain of a loop would amplify.
        """
        fed = values[self.sources]
        if self.solves:
            fed[self.on_loop] = self.inputs.view[self.on_loop]
        self.set_inputs(fed)

    def set_lines(self, length: float) -> None:
        """Set the inputs over a step as the lines that are kept.

        An FMU that takes no slopes gets the mean of each, or the beginning if it is sampled.
        """
        values, slopes = self.kept
        if self._lines is None:
            self.set_inputs(values if self._is_sampled else values + length / 2 * slopes)
            return
        self.inputs.view[:] = values
        self._lines.view[:] = self.kept
        self._lines.set()

    def end_lines(self, length: float) -> None:
        """Set where these lines end, for an FMU that takes no slopes and for algebraic loops."""
        if len(self.sources) and (self._lines is None or self.solves):
            values, slopes = self.kept
            self.set_inputs(values + length * slopes)

    def read(self) -> None:
        self.outputs.get()

    def read_slopes(self) -> None:
        self._output_slopes.get()
        self._slopes[self._slope_indices] = self._output_slopes.view

    def draw_slopes(self, before: np.ndarray, length: float) -> None:
        """Let outputs that have no other slopes be lines from `before`, (outputs,), a step ago."""
        if len(moved := self._differences):
            risen = self.outputs.view[moved] - before[moved]
            self._slopes[self.first + moved] = risen / length

    def level_slopes(self) -> None:
        """Begin such lines anew, level."""
        self._slopes[self.first + self._differences] = 0.0


def begin_instance(
    instance: Instance, start: float, stop: float | None, parameters: Mapping[str, Value]
) -> None:
    instance.set_up(start, stop)
    for name, value in parameters.items():
        instance.set(name, start_value(instance.fmu, instance.name, name, value))
    instance.enter_initialization()


def check_finite(component: str, outputs: Reals, when: str) -> None:
    bad = np.flatnonzero(~np.isfinite(outputs.view))
    if len(bad):
        name, value = f"{component}.{outputs.names[bad[0]]}", outputs.view[bad[0]]
        raise UserError(f"{name} is {value} {when}: a finite value is expected")


def start_value(fmu: UnpackedFmu, component: str, name: str, value: Value) -> Value:
    """Return the value to set before initialization, an item as its number; else UserError."""
    variable = fmu.model.variables.get(name)
    if variable is None or not (variable.can_start or variable.is_a(INPUTS)):
        raise UserError(f"{component}: {fmu.path} has no parameter {name!r}")
    is_item = variable.type == "Enumeration" and isinstance(value, str)
    if not is_item and variable.type != "Boolean":
        return value
    with placed(f"{component}.{name}"):
        return variable.checked(value)
