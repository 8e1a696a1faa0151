"""A component of a system, as a master drives it."""

from collections.abc import Collection, Mapping, Sequence
from ctypes import Array, c_double, sizeof

import numpy as np

from rparm.errors import UserError, placed
from rparm.fmi.fmi_instance import Instance, Reals, UnpackedFmu
from rparm.fmi.model import INPUTS, Value


class ConnectedInstance:
    """An instance, its place among the system's values, and the sources of its inputs.

    Of `values` and their derivatives with respect to time, `slopes`, those from `first` on belong
    to its outputs, of which some are `feeding` inputs. Each input has a source, an index among
    them, which steps `ahead` of this component or not.
    """

    def __init__(
        self,
        instance: Instance,
        inputs: Sequence[str],
        outputs: Sequence[str],
        first: int,
        feeding: Collection[str],
        sources: Sequence[int],
        ahead: Sequence[bool],
        values: Array,
        slopes: np.ndarray,
    ) -> None:
        self.instance = instance
        self.sources = np.array(sources, dtype=int)
        self.ahead = np.array(ahead, dtype=bool)
        memory = (c_double * len(outputs)).from_buffer(values, first * sizeof(c_double))
        self.outputs = instance.reals(outputs, memory)
        self.inputs = instance.reals(inputs)
        self._lines = instance.input_polynomials(inputs, 1)
        connected = [i for i, name in enumerate(outputs) if name in feeding]
        self._output_slopes = instance.output_derivatives([outputs[i] for i in connected], 1)
        self._slopes = slopes
        self._slope_indices = first + np.array(connected, dtype=int)

    @property
    def name(self) -> str:
        return self.instance.name

    def begin(self, start: float, stop: float | None, parameters: Mapping[str, Value]) -> None:
        for name in self.inputs.names:
            if name in parameters:
                raise UserError(f"{self.name}.{name}: is fed by a connection, which says its value")
        begin(self.instance, start, stop, parameters)

    def set_inputs(self, values: np.ndarray) -> None:
        """Set the inputs, (inputs,), in their units."""
        self.inputs.view[:] = values
        self.inputs.set()

    def set_lines(self, values: np.ndarray, slopes: np.ndarray) -> None:
        """Set the inputs and their derivatives with respect to time, (inputs,) each."""
        self._lines.view[:] = values, slopes
        self._lines.set()

    def read(self) -> None:
        self.outputs.get()

    def read_slopes(self) -> None:
        self._output_slopes.get()
        self._slopes[self._slope_indices] = self._output_slopes.view


def begin(
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
    """Value to set before initialization, an item as its number; UserError if it cannot be set."""
    variable = fmu.model.variables.get(name)
    if variable is None or not (variable.can_start or variable.is_a(INPUTS)):
        raise UserError(f"{component}: {fmu.path} has no parameter {name!r}")
    is_item = variable.type == "Enumeration" and isinstance(value, str)
    if not is_item and variable.type != "Boolean":
        return value
    with placed(f"{component}.{name}"):
        return variable.checked(value)
