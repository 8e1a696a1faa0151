"""A component of a system, as a master drives it."""

from collections.abc import Mapping
from ctypes import c_double, sizeof

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from cosim.errors import UserError
from cosim.unit import Fmu, Instance


class Part(Instance):
    """A component: its instance, its place among the system's values, its inputs' sources."""

    def __init__(self, fmu: Fmu, name: str) -> None:
        super().__init__(fmu, name)
        self.name = name
        self.outputs: list[str] = []  # read after each step: all Real outputs and what is asked for
        self.inputs: list[str] = []
        self.sources = np.empty(0, dtype=int)  # of each input, in the system's values
        self.ahead = np.empty(0, dtype=bool)  # inputs whose sources step before this component
        self.sloped: list[int] = []  # which of `outputs` are connected

    def attach(self, values: "c_double[int]", first: int, slopes: np.ndarray) -> None:
        """Buffers for repeated calls; values of the outputs go to `values` from `first` on."""
        n, m, k = len(self.outputs), len(self.inputs), len(self.sloped)
        self.out_references = self.buffers(self.outputs)[0]
        self.out_values = (c_double * n).from_buffer(values, first * sizeof(c_double))
        self.out_view = np.frombuffer(self.out_values) if n else np.empty(0)
        self.in_references, self.in_values, self.in_view = self.buffers(self.inputs)
        self.line_values, self.line_view = self.buffers(self.inputs)[1:]
        self.in_orders = (fmi2.fmi2Integer * m)(*[1] * m)
        connected = [self.outputs[i] for i in self.sloped]
        self.slope_references, self.slope_values, self.slope_view = self.buffers(connected)
        self.slope_orders = (fmi2.fmi2Integer * k)(*[1] * k)
        self.slopes, self.slope_places = slopes, first + np.array(self.sloped, dtype=int)

    def set_parameters(self, parameters: Mapping[str, float | str]) -> None:
        for name, value in parameters.items():
            variable = self.fmu.variables.get(name)
            known = variable is not None and (
                variable.causality == "parameter"
                or (variable.initial == "exact" and variable.causality in ("output", "local"))
            )
            if not known:
                raise UserError(f"{self.name}: {self.fmu.path} has no parameter {name!r}")
            if variable.type == "Enumeration" and isinstance(value, str):
                items = {item.name: item.value for item in variable.declaredType.items}
                if value not in items:
                    expected = ", ".join(items)
                    raise UserError(f"{self.name}.{name}: expected {expected}, got {value!r}")
                value = int(items[value])
            self._set(name, value)

    def set_inputs(self, values: np.ndarray) -> None:
        if len(self.inputs):
            self.in_view[:] = values
            self.slave.fmi2SetReal(
                self.slave.component, self.in_references, len(self.inputs), self.in_values
            )

    def set_slopes(self, slopes: np.ndarray) -> None:
        if len(self.inputs):
            self.line_view[:] = slopes
            self.slave.fmi2SetRealInputDerivatives(
                self.slave.component,
                self.in_references,
                len(self.inputs),
                self.in_orders,
                self.line_values,
            )

    def read(self) -> None:
        """Values of the outputs."""
        if len(self.outputs):
            self.slave.fmi2GetReal(
                self.slave.component, self.out_references, len(self.outputs), self.out_values
            )

    def read_slopes(self) -> None:
        """Derivatives with respect to time of the outputs that are connected."""
        if self.sloped:
            self.slave.fmi2GetRealOutputDerivatives(
                self.slave.component,
                self.slope_references,
                len(self.sloped),
                self.slope_orders,
                self.slope_values,
            )
            self.slopes[self.slope_places] = self.slope_view

    def begin(self, start: float, stop: float | None, parameters: Mapping[str, float]) -> None:
        """From instantiated into initialization mode."""
        try:
            self.slave.setupExperiment(startTime=start, stopTime=stop)
            self.set_parameters(parameters)
            self.slave.enterInitializationMode()
        except FMICallException as error:
            raise self.failure(error, "in initialization") from error

    def end(self) -> None:
        """Out of initialization mode."""
        try:
            self.slave.exitInitializationMode()
        except FMICallException as error:
            raise self.failure(error, "in initialization") from error
        self._initialized = True
