"""Instances of FMUs of FMI 2.0 for co-simulation: the only file that calls functions of an FMU.

Functions that are called in long loops raise fmpy's FMICallException, which `failure` turns into
the user's error; those that are called now and then raise the user's error themselves.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import chdir, contextmanager
from ctypes import Array, byref, c_double
from typing import TYPE_CHECKING

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException

from cosim.errors import UserError, one_line
from cosim.model import Value

if TYPE_CHECKING:
    from cosim.fmu_file import Fmu

STATUS_NAMES = ("OK", "warning", "discard", "error", "fatal", "pending")
MESSAGES_KEPT = 20


class Fmi2Instance:
    """One instance of an FMU: a context manager that instantiates, terminates and frees it.

    Parameters
    ----------
    fmu : Fmu
        Stays open as long as the instance.
    name : str
        Of the instance, for messages.
    """

    def __init__(self, fmu: "Fmu", name: str) -> None:
        self.fmu = fmu
        self.name = name
        self.messages: deque[str] = deque(maxlen=MESSAGES_KEPT)  # of the FMU, the last ones
        self._status = fmi2.fmi2OK  # of the call that failed
        self._initialized = False
        # The texts are taken as sent: fmpy's proxy, which fills in printf arguments, has one logger
        # for the whole process. The structure stays referenced for as long as the FMU uses it.
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.fmi = self._load()

    def _load(self) -> fmi2.FMU2Slave:
        try:
            with chdir("."):  # fmpy leaves the folder changed if it cannot load the library
                return fmi2.FMU2Slave(
                    guid=self.fmu.guid,
                    modelIdentifier=self.fmu.identifier,
                    unzipDirectory=str(self.fmu.folder),
                    instanceName=self.name,
                    libraryPath=str(self.fmu.library),
                )
        except Exception as error:  # fmpy raises bare exceptions
            raise UserError(f"{self.fmu.path}: cannot be loaded: {one_line(error)}") from error

    def __enter__(self) -> "Fmi2Instance":
        try:
            self.fmi.instantiate(callbacks=self._callbacks, loggingOn=False)
        except Exception as error:  # fmpy raises a bare exception for NULL
            self.fmi.freeLibrary()
            said = self._last_message()
            raise UserError(f"{self.fmu.path}: fmi2Instantiate failed{said}") from error
        return self

    def __exit__(self, kind: type | None, *_: object) -> None:
        if self._status == fmi2.fmi2Fatal:
            return  # nothing may be called any more, not even fmi2FreeInstance
        try:
            if self._initialized and self._status < fmi2.fmi2Error:
                self.fmi.terminate()
        except FMICallException as error:
            if kind is None:
                raise self.failure(error, "at the end") from error
        finally:
            if self._status != fmi2.fmi2Fatal:
                self.fmi.freeInstance()

    # ---- Messages --------------------------------------------------------------------------------

    def _log(
        self, _environment: int, _instance: bytes, status: int, _category: bytes, message: bytes
    ) -> None:
        if status != fmi2.fmi2OK:
            self.messages.append(one_line((message or b"").decode("utf-8", errors="replace")))

    def _last_message(self) -> str:
        return f": {self.messages[-1]}" if self.messages else " and gave no message"

    def failure(self, error: FMICallException, when: str) -> UserError:
        """What to raise after a function of the FMU failed."""
        self._status = error.status
        name = STATUS_NAMES[error.status] if error.status in range(6) else str(error.status)
        return UserError(
            f"{self.name}: {error.function} {when} failed ({name}){self._last_message()}"
        )

    @contextmanager
    def explained(self, when: str) -> Iterator[None]:
        """Turn a call that fails inside into the user's error."""
        try:
            yield
        except FMICallException as error:
            raise self.failure(error, when) from error

    # ---- Initialization --------------------------------------------------------------------------

    def set_up(self, start: float, stop: float | None, tolerance: float | None = None) -> None:
        """Give start and stop time (s) and the relative tolerance of the experiment."""
        with self.explained("in initialization"):
            self.fmi.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)

    def enter_initialization(self) -> None:
        """Into initialization mode; parameters and start values are set before."""
        with self.explained("in initialization"):
            self.fmi.enterInitializationMode()

    def exit_initialization(self) -> None:
        """To the first communication point; inputs are set before."""
        with self.explained("in initialization"):
            self.fmi.exitInitializationMode()
        self._initialized = True

    # ---- Values ----------------------------------------------------------------------------------

    def set(self, name: str, value: Value) -> None:
        """Set one variable."""
        variable = self.fmu.model.variables[name]
        function = {
            "Real": self.fmi.setReal,
            "Boolean": self.fmi.setBoolean,
            "String": self.fmi.setString,
        }.get(variable.type, self.fmi.setInteger)
        try:
            function([variable.reference], [value])
        except FMICallException as error:
            raise self.failure(error, f"({name} = {value!r})") from error

    def integer(self, name: str) -> int | None:
        """Value of an Integer variable; None if the FMU has none of that name."""
        variable = self.fmu.model.variables.get(name)
        if variable is None or variable.type != "Integer":
            return None
        with self.explained(f"({name})"):
            return self.fmi.getInteger([variable.reference])[0]

    def reals(self, names: Sequence[str], memory: Array | None = None) -> "Reals":
        """The Real variables `names`, to get or set at once, many times.

        Parameters
        ----------
        names : sequence of str
        memory : ctypes array of double, optional
            Memory for their values; made if it is not given.
        """
        return Reals(self, names, memory)

    def derivatives(self, names: Sequence[str], orders: Sequence[int]) -> "Derivatives":
        """Derivatives of Real inputs to set, or of Real outputs to get, at once, many times."""
        return Derivatives(self, names, orders)

    # ---- Steps -----------------------------------------------------------------------------------

    def do_step(self, start: float, length: float, goes_back: bool = False) -> None:
        """Make a step from `start` (s); `goes_back`: it may be undone by a saved state.

        Raises
        ------
        FMICallException
        """
        final = fmi2.fmi2False if goes_back else fmi2.fmi2True
        self.fmi.fmi2DoStep(self.fmi.component, start, length, final)

    def saved_state(self) -> "SavedState":
        """An empty place for a state to go back to."""
        return SavedState(self)


class Reals:
    """Some Real variables of an instance; `get` and `set` move their values from and to `view`.

    Attributes
    ----------
    names : list of str
    view : ndarray, shape (len(names),)
        In the variables' units.
    """

    def __init__(
        self, instance: Fmi2Instance, names: Sequence[str], memory: Array | None = None
    ) -> None:
        self.names = list(names)
        self._fmi = instance.fmi
        self._count = len(self.names)
        variables = instance.fmu.model.variables
        references = [variables[name].reference for name in self.names]
        self._references = (fmi2.fmi2ValueReference * self._count)(*references)
        self._values = (c_double * self._count)() if memory is None else memory
        self.view = np.frombuffer(self._values) if self._count else np.empty(0)

    def get(self) -> None:
        """Values from the instance; FMICallException if that fails."""
        if self._count:
            fmi = self._fmi
            fmi.fmi2GetReal(fmi.component, self._references, self._count, self._values)

    def set(self) -> None:
        """Values to the instance; FMICallException if that fails."""
        if self._count:
            fmi = self._fmi
            fmi.fmi2SetReal(fmi.component, self._references, self._count, self._values)


class Derivatives(Reals):
    """Derivatives of Real variables with respect to time, in their units per power of s."""

    def __init__(self, instance: Fmi2Instance, names: Sequence[str], orders: Sequence[int]) -> None:
        super().__init__(instance, names)
        self._orders = (fmi2.fmi2Integer * self._count)(*orders)

    def get(self) -> None:
        """Derivatives of outputs from the instance; FMICallException if that fails."""
        if self._count:
            fmi = self._fmi
            fmi.fmi2GetRealOutputDerivatives(
                fmi.component, self._references, self._count, self._orders, self._values
            )

    def set(self) -> None:
        """Derivatives of inputs to the instance; FMICallException if that fails."""
        if self._count:
            fmi = self._fmi
            fmi.fmi2SetRealInputDerivatives(
                fmi.component, self._references, self._count, self._orders, self._values
            )


class SavedState:
    """The state of an instance at some time; its functions raise FMICallException if they fail."""

    def __init__(self, instance: Fmi2Instance) -> None:
        self._fmi = instance.fmi
        self._state = fmi2.fmi2FMUstate()

    def take(self) -> None:
        """Keep the present state, in place of the one kept before."""
        self._fmi.fmi2GetFMUstate(self._fmi.component, byref(self._state))

    def restore(self) -> None:
        """Bring the instance back to the state kept, as often as wanted."""
        self._fmi.fmi2SetFMUstate(self._fmi.component, self._state)

    def free(self) -> None:
        """Free the state, if one is kept."""
        if self._state.value is not None:
            self._fmi.fmi2FreeFMUstate(self._fmi.component, byref(self._state))
