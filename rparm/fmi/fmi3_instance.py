"""Instances of FMUs of FMI 3.0: without event mode and early return, which no master here uses."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from ctypes import Array, byref
from functools import partial

import fmpy
import numpy as np
from fmpy import fmi3
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError
from rparm.fmi.fmi_instance import Call, InputPolynomials, Instance, SavedState

# Without them FMUs send errors only. They cost nothing as long as all is well.
LOGGED = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")


class Fmi3Instance(Instance):
    """An instance of an FMU of FMI 3.0.

    FMI 3.0 has no derivatives of inputs: in a step, the FMU asks for the values of the inputs at
    times inside of it (intermediate update), and is given those of the polynomials or functions.
    """

    PLATFORMS = (fmpy.platform_tuple,)
    LIBRARY = fmi3.FMU3Slave
    INSTANTIATE = "fmi3InstantiateCoSimulation"
    MARKS = r"##|#()(\d+)#"  # references: FMI 3.0, section 2.2.3
    SETTERS = {
        "Real": "setFloat64",
        "Integer": "setInt32",
        "Enumeration": "setInt64",
        "Boolean": "setBoolean",
        "String": "setString",
    }

    def _instantiate(self) -> None:
        fmi, smooth = self.fmi, bool(self.smooth_inputs)
        fmi.instantiate(
            logMessage=self._log,
            intermediateUpdate=self._update if smooth else None,
            requiredIntermediateVariables=self._references(self.smooth_inputs) if smooth else None,
        )
        self._log_warnings()
        self._inputs: Callable[[float], object] | None = None  # sets those of a time in a step, s
        self._start = 0.0  # s, of the present step
        self._raised: BaseException | None = None  # in a callback, where it would be lost

        # what a step reports
        self._terminates = fmi3.fmi3Boolean()
        self._time = fmi3.fmi3Float64()  # that it has reached, s
        self._event, self._early = fmi3.fmi3Boolean(), fmi3.fmi3Boolean()
        results = (self._event, self._terminates, self._early, self._time)
        self._results = tuple(map(byref, results))

    def _log_warnings(self) -> None:
        logged = [name for name in LOGGED if name in self.fmu.log_categories]
        if logged:
            with suppress(FMICallException):  # messages are not worth a run
                self.fmi.setDebugLogging(True, logged)

    def _log(self, _environment: int, status: int, _category: bytes, message: bytes) -> None:
        self._keep_unless_ok(status, message)

    def set_up(self, start: float, stop: float | None, tolerance: float | None = None) -> None:
        self._experiment = tolerance, start, stop

    def enter_initialization(self) -> None:
        with self.explained("in initialization"):
            self.fmi.enterInitializationMode(*self._experiment)

    def _integer(self, reference: int) -> int:
        return self.fmi.getInt32([reference])[0]

    def _real_calls(self, references: Array, values: Array) -> tuple[Call, Call]:
        fmi, count = self.fmi, len(references)
        arguments = fmi.component, references, count, values, count
        return partial(fmi.fmi3GetFloat64, *arguments), partial(fmi.fmi3SetFloat64, *arguments)

    def _derivative_call(self, references: Array, orders: Array, values: Array) -> Call:
        count = len(references)
        arguments = self.fmi.component, references, count, orders, values, count
        return partial(self.fmi.fmi3GetOutputDerivatives, *arguments)

    def input_polynomials(self, names: Sequence[str], order: int) -> InputPolynomials:
        coefficients = np.zeros((order + 1, len(names)))
        inputs, powers = self.reals(names), np.arange(order + 1)
        factorials = np.array([math.factorial(power) for power in powers], dtype=float)

        def set_in_step(time: float) -> None:
            elapsed = time - self._start
            inputs.view[:] = elapsed**powers / factorials @ coefficients
            inputs.set()

        def set_all() -> None:
            set_in_step(self._start)
            self._inputs = set_in_step if order else None

        return InputPolynomials(coefficients, set_all)

    def input_functions(
        self, names: Sequence[str], values: Callable[[float], Sequence[float] | np.ndarray]
    ) -> None:
        """Let Real inputs, of `smooth_inputs`, be functions of time (s) in all further steps."""
        inputs = self.reals(names)

        def set_in_step(time: float) -> None:
            inputs.view[:] = values(time)
            inputs.set()

        self._inputs = set_in_step

    def _update(self, _environment: int, time: float, set_requested: bool, *_: object) -> None:
        """Called by the FMU within a step."""
        if not set_requested or self._inputs is None:
            return
        try:
            self._inputs(time)
        except BaseException as error:  # Ctrl-C, too
            self._raised = error

    def do_step(self, start: float, length: float, goes_back: bool = False) -> None:
        final = fmi3.fmi3False if goes_back else fmi3.fmi3True
        self._start = start
        try:
            self.fmi.fmi3DoStep(self.fmi.component, start, length, final, *self._results)
        finally:
            if self._raised is not None:
                error, self._raised = self._raised, None
                raise error
        if self._terminates.value:
            time = self._time.value
            raise UserError(f"{self.name}: the FMU ends the simulation at t = {time!r} s")

    def saved_state(self) -> SavedState:
        fmi = self.fmi
        return SavedState(
            fmi.component, fmi.fmi3GetFMUState, fmi.fmi3SetFMUState, fmi.fmi3FreeFMUState
        )
