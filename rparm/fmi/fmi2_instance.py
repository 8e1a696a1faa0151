"""Instances of FMUs of FMI 2.0."""

from collections.abc import Sequence
from ctypes import Array, c_double, sizeof
from functools import partial

import fmpy
import numpy as np
from fmpy import fmi2

from rparm.fmi.fmi_instance import (
    Call,
    InputPolynomials,
    Instance,
    SavedState,
    UnpackedFmu,
    doubles,
)


class Fmi2Instance(Instance):
    # the folder of FMI 3.0 first, because on Arm linux64 may be for x86-64
    PLATFORMS = (fmpy.platform_tuple, fmpy.platform)
    LIBRARY = fmi2.FMU2Slave
    INSTANTIATE = "fmi2Instantiate"
    MARKS = r"##|%%|#([ribs])(\d+)#"  # references and formats: FMI 2.0, section 2.1.5
    SETTERS = {
        "Real": "setReal",
        "Integer": "setInteger",
        "Enumeration": "setInteger",
        "Boolean": "setBoolean",
        "String": "setString",
    }

    def __init__(self, fmu: UnpackedFmu, name: str, smooth_inputs: Sequence[str] = ()) -> None:
        super().__init__(fmu, name, smooth_inputs)
        # The texts are taken as sent: fmpy's proxy, which fills in printf arguments, has one logger
        # for the whole process. The structure stays referenced for as long as the FMU uses it.
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)

    def _instantiate(self) -> None:
        self.fmi.instantiate(callbacks=self._callbacks, loggingOn=False)

    def _log(
        self, _environment: int, _instance: bytes, status: int, _category: bytes, message: bytes
    ) -> None:
        self._keep_unless_ok(status, message)

    def set_up(self, start: float, stop: float | None, tolerance: float | None = None) -> None:
        with self.explained("in initialization"):
            self.fmi.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)

    def enter_initialization(self) -> None:
        with self.explained("in initialization"):
            self.fmi.enterInitializationMode()

    def _integer(self, reference: int) -> int:
        return self.fmi.getInteger([reference])[0]

    def _real_calls(self, references: Array, values: Array) -> tuple[Call, Call]:
        fmi, arguments = self.fmi, (self.fmi.component, references, len(references), values)
        return partial(fmi.fmi2GetReal, *arguments), partial(fmi.fmi2SetReal, *arguments)

    def _derivative_call(self, references: Array, orders: Array, values: Array) -> Call:
        arguments = self.fmi.component, references, len(references), orders, values
        return partial(self.fmi.fmi2GetRealOutputDerivatives, *arguments)

    def input_polynomials(self, names: Sequence[str], order: int) -> InputPolynomials:
        fmi, count = self.fmi, len(names)
        memory, numbers = doubles(count * (order + 1))
        rows = numbers.reshape(order + 1, count)
        set_values = self.reals(names, (c_double * count).from_buffer(memory)).set
        further = count * order
        if not further:
            return InputPolynomials(rows, set_values)
        set_derivatives = partial(
            fmi.fmi2SetRealInputDerivatives,
            fmi.component,
            self._references([*names] * order),
            further,
            (fmi2.fmi2Integer * further)(*np.repeat(np.arange(1, order + 1), count).tolist()),
            (c_double * further).from_buffer(memory, count * sizeof(c_double)),
        )

        def set_all() -> None:
            set_values()
            set_derivatives()

        return InputPolynomials(rows, set_all)

    def do_step(self, start: float, length: float, goes_back: bool = False) -> None:
        final = fmi2.fmi2False if goes_back else fmi2.fmi2True
        self.fmi.fmi2DoStep(self.fmi.component, start, length, final)

    def saved_state(self) -> SavedState:
        fmi = self.fmi
        return SavedState(
            fmi.component, fmi.fmi2GetFMUstate, fmi.fmi2SetFMUstate, fmi.fmi2FreeFMUstate
        )
