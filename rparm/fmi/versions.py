"""Instances of FMUs of FMI 2.0 and 3.0, for co-simulation and at a point for model exchange.

Masters here use neither event mode nor early return of FMI 3.0. Instances for model exchange are
initialized and read, not integrated: what an FMU answers at one time, either kind answers.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from ctypes import POINTER, Array, byref, c_double, c_void_p, cast, sizeof
from functools import partial
from pathlib import Path

import fmpy
import numpy as np
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError
from rparm.fmi.fmi_instance import (
    DISCARD,
    ERROR,
    Call,
    InputPolynomials,
    Instance,
    Snapshot,
    UnpackedFmu,
    doubles,
)
from rparm.loop.structures import Host, Polynomials, library

# Without them FMUs send errors only. They cost nothing as long as all is well.
LOGGED = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
MOST_UPDATES = 100  # of the discrete states at one time


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
        logged = [name for name in LOGGED[1:] if name in self.fmu.log_categories]
        if logged:  # PythonFMU says nothing without
            with suppress(FMICallException):  # messages are not worth a run
                self.fmi.setDebugLogging(True, logged)

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

    def _ended(self, error: FMICallException) -> str:
        is_discarded = error.function == "fmi2DoStep" and error.status == DISCARD
        if is_discarded and self._said < ERROR:  # PythonFMU says the same of what Python raises
            with suppress(FMICallException, AttributeError):  # unless it cannot say so
                if self.fmi.getBooleanStatus(fmi2.fmi2Terminated):
                    return f"at t = {self.fmi.getRealStatus(fmi2.fmi2LastSuccessfulTime)!r} s"
        return ""

    def snapshot(self) -> Snapshot:
        calls = (getattr(self.fmi, f"fmi2{name}FMUstate") for name in ("Get", "Set", "Free"))
        return Snapshot(self.fmi.component, *calls)


class Fmi3Instance(Instance):
    """Instance of an FMU of FMI 3.0.

    It has no derivatives of inputs: in a step the FMU asks for the inputs at times inside of it
    (intermediate update), and gets them from the polynomials or functions.
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
        fmi = self.fmi
        self.polynomials = Polynomials(order=-1)
        self._raised: BaseException | None = None  # in a callback, where it would be lost
        fmi.logMessage = fmi3.fmi3LogMessageCallback(self._log)
        update = fmi3.fmi3IntermediateUpdateCallback()
        if self.smooth_inputs:
            update = cast(library().loop_update_inputs, fmi3.fmi3IntermediateUpdateCallback)
        required = self._references(self.smooth_inputs)
        environment = cast(byref(self.polynomials), c_void_p)
        fmi.component = fmi.fmi3InstantiateCoSimulation(
            fmi.instanceName.encode(), fmi.guid.encode(),
            f"{Path(fmi.unzipDirectory, 'resources')}{os.sep}".encode(), False, False, False, False,
            required, len(required), environment, fmi.logMessage, update,
        )  # fmt: skip
        if not fmi.component:
            raise Exception  # as fmpy does; Instance says what the FMU has said
        self.polynomials.instance = fmi.component
        self.polynomials.set = cast(fmi.dll.fmi3SetFloat64, c_void_p)
        self._log_warnings()

        # results of a step
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

    def input_polynomials(self, names: Sequence[str], order: int) -> InputPolynomials:
        coefficients, inputs = np.zeros((order + 1, len(names))), self.reals(names)
        assert self.polynomials is not None
        self.polynomials.count = len(names)
        self.polynomials.order = order if order else -1  # then they hold without being asked for
        self.polynomials.point(
            references=np.array(self._references(names), np.uint32),
            coefficients=coefficients,
            values=inputs.view,
        )

        def set_all() -> None:
            inputs.view[:] = coefficients[0]
            inputs.set()

        return InputPolynomials(coefficients, set_all)

    def input_functions(
        self, names: Sequence[str], values: Callable[[float], Sequence[float] | np.ndarray]
    ) -> None:
        """Let Real inputs, of `smooth_inputs`, be functions of time (s) in all further steps."""
        inputs = self.reals(names)

        def set_in_step(time: float) -> int:
            try:
                inputs.view[:] = values(time)
                inputs.set()
            except BaseException as error:  # Ctrl-C, too
                self._raised = error
                return 1
            return 0

        assert self.polynomials is not None
        self.polynomials.order, self.polynomials.host = -1, Host(set_in_step)

    def raised(self) -> BaseException:
        assert self._raised is not None and self.polynomials is not None
        error, self._raised, self.polynomials.status = self._raised, None, 0
        return error

    def do_step(self, start: float, length: float, goes_back: bool = False) -> None:
        final = fmi3.fmi3False if goes_back else fmi3.fmi3True
        assert self.polynomials is not None
        self.polynomials.start = start
        try:
            self.fmi.fmi3DoStep(self.fmi.component, start, length, final, *self._results)
        finally:
            if self._raised is not None:
                raise self.raised()
        if status := self.polynomials.status:
            self.polynomials.status = 0
            raise FMICallException("fmi3SetFloat64", status)
        if self._terminates.value:
            raise self.ended(f"at t = {self._time.value!r} s")

    def snapshot(self) -> Snapshot:
        calls = (getattr(self.fmi, f"fmi3{name}FMUState") for name in ("Get", "Set", "Free"))
        return Snapshot(self.fmi.component, *calls)


class _ModelExchange(Instance):
    """Ends initialization in continuous-time mode, after all events of the start."""

    next_event: float | None = None  # s, of the next time event

    def exit_initialization(self) -> None:
        super().exit_initialization()
        self._update()

    def set_states(self, values: Mapping[str, float]) -> None:
        """Move some states and discrete variables, by name, and pass the events of that."""
        states = self.reals(self.fmu.model.states)
        with self.explained("at its states"):
            states.get()
            for name in values.keys() & set(states.names):
                states.view[states.names.index(name)] = values[name]
            x = states.view.ctypes.data_as(POINTER(c_double))
            self.fmi.setContinuousStates(x, len(states.names))
            self.fmi.enterEventMode()
        for name in values.keys() - set(states.names):
            self.set(name, values[name])
        self._update()

    def _update(self) -> None:
        with self.explained("at the events of the start"):
            for _ in range(MOST_UPDATES):
                needed, terminates, _, _, has_next, time = self._update_discrete_states()
                if terminates:
                    raise self.ended("at its start")
                if not needed:
                    break
            else:
                raise UserError(f"{self.name}: its discrete states do not settle at the start")
            self.fmi.enterContinuousTimeMode()
        self.next_event = time if has_next else None


class Fmi2ModelExchange(_ModelExchange, Fmi2Instance):
    LIBRARY = fmi2.FMU2Model

    def _update_discrete_states(self) -> tuple:
        return self.fmi.newDiscreteStates()


class Fmi3ModelExchange(_ModelExchange, Fmi3Instance):
    LIBRARY = fmi3.FMU3Model
    INSTANTIATE = "fmi3InstantiateModelExchange"

    def _instantiate(self) -> None:
        self.fmi.instantiate(logMessage=self._log)
        self._log_warnings()

    def _update_discrete_states(self) -> tuple:
        return self.fmi.updateDiscreteStates()
