"""A component of a running system: its instance, its place among the system's values, its rate."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from rparm.errors import UserError, placed
from rparm.fmi.fmi_instance import Instance, UnpackedFmu
from rparm.fmi.loop import Component
from rparm.fmi.model import INPUTS, Value
from rparm.systems.python_component import is_python


class ConnectedInstance(Component):
    """A component with the slopes of its values and a rate.

    `slopes` are the derivatives of the system's values with respect to time; `feeding` names the
    outputs that are connected, `solved` those of them on algebraic loops. Each input has a source
    whose component steps `ahead` of this one or not. The instance steps `every` s, or with the
    system.
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
        values: np.ndarray,
        every: float | None,
    ) -> None:
        super().__init__(instance, inputs, sources, outputs, first, values)
        state, model = self.state, instance.fmu.model
        self.kept = np.zeros((2, len(inputs)))  # their sources and slopes as its step began
        state.point(ahead=np.array(ahead, bool), kept=self.kept)
        state.has_ahead, state.every = any(ahead), every or 0.0

        # slopes: of the FMU, else of the line through the last two values
        if model.interpolates_inputs:
            state.point(lines=instance.input_polynomials(inputs, 1).view)
        moving = [
            i
            for i, name in enumerate(outputs)
            if name in feeding and model.variables[name].variability != "discrete"
        ]
        state.is_sampled = bool(feeding) and not moving
        if is_python(instance.fmu.path.name):
            moving, state.is_sampled = [], True
        given = model.gives_output_derivatives
        known = [i for i in moving if given and outputs[i] not in solved]
        drawn = [i for i in moving if i not in known]
        state.slope_count, state.difference_count = len(known), len(drawn)
        state.point(
            slope_outputs=self.references([outputs[i] for i in known]),
            slope_orders=np.ones(len(known), np.int32),
            slope_indices=first + np.array(known, np.int64),
            slope_values=np.zeros(len(known)),
            differences=np.array(drawn, np.int64),
        )

    @property
    def is_due(self) -> bool:
        """Whether the system's last step has brought it to the end of its own."""
        return bool(self.state.is_due)

    @property
    def solves(self) -> bool:
        """Whether some of its inputs are on algebraic loops."""
        return bool(self.state.solves)

    def begin(self, start: float, stop: float | None, parameters: Mapping[str, Value]) -> None:
        """Initialize it; inputs on algebraic loops have first guesses among the parameters."""
        variables = self.instance.fmu.model.variables
        for i, name in enumerate(self.inputs.names):
            if name in parameters and not self.on_loop[i]:
                raise UserError(f"{self.name}.{name}: is connected and cannot be set")
            self.inputs.view[i] = parameters.get(name, variables[name].start or 0.0)
        begin_instance(self.instance, start, stop, parameters)

    def place(self) -> tuple[float, float, np.ndarray, np.ndarray]:
        """Return where it is beside the state of its FMU, for `go_to`."""
        return self.state.time, self.state.ticks, self.kept.copy(), self.inputs.view.copy()

    def go_to(self, time: float, ticks: float, kept: np.ndarray, inputs: np.ndarray) -> None:
        self.state.time, self.state.ticks = time, ticks
        self.kept[:], self.inputs.view[:] = kept, inputs

    def set_inputs(self, values: np.ndarray) -> None:
        """Set the inputs, (inputs,), in their units."""
        self.inputs.view[:] = values
        self.inputs.set()

    def read(self) -> None:
        self.outputs.get()


def begin_instance(
    instance: Instance, start: float, stop: float | None, parameters: Mapping[str, Value]
) -> None:
    instance.set_up(start, stop)
    for name, value in parameters.items():
        instance.set(name, start_value(instance.fmu, instance.name, name, value))
    instance.enter_initialization()


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
