"""Instances of FMUs for co-simulation: all that the versions of FMI have in common.

These modules, a class per version beside this one, are the only ones that call functions of an FMU.
Functions that are called in long loops raise fmpy's FMICallException, which `failure` turns into
the user's error; those that are called now and then raise the user's error themselves.
"""

import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from ctypes import Array, byref, c_double, c_uint, c_void_p
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm.errors import UserError, one_line
from rparm.fmi.model import Model, Value
from rparm.loop.structures import Polynomials
from rparm.project import check_current_folder

OK, DISCARD, ERROR, FATAL = 0, 2, 3, 4  # from DISCARD on, a status stops a run
STATUS_NAMES = ("OK", "warning", "discard", "error", "fatal", "pending")  # the last: FMI 2.0
MESSAGES_KEPT = 20
ENDS = re.compile("the simulation ends (at t = .*)")  # what FMUs of this project say
# types of the variables that messages of FMI 2.0 refer to, by a letter
REFERRED = {"r": ("Real",), "i": ("Integer", "Enumeration"), "b": ("Boolean",), "s": ("String",)}

Call = Callable[[], object]  # of a function of an FMU; FMICallException if it fails


class UnpackedFmu(Protocol):
    """FMU as instances see it: `rparm.fmi.fmu_file.Fmu`."""

    path: Path  # for messages
    folder: Path
    library: Path  # the shared object
    identifier: str  # its name
    guid: str  # in FMI 3.0, the instantiationToken
    log_categories: Sequence[str]
    model: Model


@dataclass(frozen=True, eq=False)
class Reals:
    """Real variables of an instance, moved to and from `view`; FMICallException if that fails."""

    names: list[str]
    view: np.ndarray  # (len(names),) in the variables' units
    get: Call
    set: Call


@dataclass(frozen=True, eq=False)
class InputPolynomials:
    """Polynomials of Real inputs over the next step, for `set`; FMICallException if it fails."""

    view: np.ndarray  # (order + 1, inputs): values at the beginning of the step, then derivatives
    set: Call


class Snapshot:
    """The state of an instance at some time; its functions raise FMICallException if they fail."""

    def __init__(self, component: c_void_p, *calls: Callable[..., object]) -> None:
        self._component, (self._get, self._put, self._free) = component, calls
        self._state = c_void_p()

    def take(self) -> None:
        """Save the present state, in place of the one saved before."""
        self._get(self._component, byref(self._state))

    def restore(self) -> None:
        """Bring the instance back to the saved state; may be called again."""
        self._put(self._component, self._state)

    def free(self) -> None:
        """Free the saved state, if there is one."""
        if self._state.value is not None:
            self._free(self._component, byref(self._state))


class Instance(ABC):
    """Instance of an FMU: a context manager that instantiates, terminates and frees it.

    The FMU stays open as long. `name` is for messages, `input_polynomials` for `smooth_inputs`.
    """

    # of the version of FMI
    PLATFORMS: ClassVar[Sequence[str]]  # names of this platform's folder of binaries, best first
    LIBRARY: ClassVar[type]  # fmpy's class for co-simulation
    INSTANTIATE: ClassVar[str]  # name of the function
    SETTERS: ClassVar[Mapping[str, str]]  # methods of LIBRARY, by type of the variable
    MARKS: ClassVar[str]  # regular expression of marks in messages that do not stand for themselves

    polynomials: Polynomials | None = None  # of inputs, if the FMU asks for them within a step
    # of what runs like an FMU: Real variables by their value references, not all of them perhaps
    memory: np.ndarray | None = None

    def __init__(self, fmu: UnpackedFmu, name: str, smooth_inputs: Sequence[str] = ()) -> None:
        self.fmu = fmu
        self.name = name
        self.smooth_inputs = list(smooth_inputs)
        self.messages: deque[str] = deque(maxlen=MESSAGES_KEPT)  # of the FMU, the last ones
        self._status = OK  # of the call that failed
        self._said = OK  # of the last message
        self._initialized = False
        self.fmi = self._load()

    def _load(self) -> Any:
        check_current_folder()
        try:
            with chdir("."):  # fmpy leaves the folder changed if it cannot load the library
                return self.LIBRARY(
                    guid=self.fmu.guid,
                    modelIdentifier=self.fmu.identifier,
                    unzipDirectory=str(self.fmu.folder),
                    # of a file whose name is not UTF-8, perhaps
                    instanceName=self.name.encode(errors="backslashreplace").decode(),
                    libraryPath=str(self.fmu.library),
                )
        except Exception as error:  # fmpy raises bare exceptions
            raise UserError(f"{self.fmu.path}: cannot be loaded: {one_line(error)}") from error

    def __enter__(self) -> Self:
        try:
            self._instantiate()
        except Exception as error:  # fmpy raises a bare exception for NULL
            self.fmi.freeLibrary()
            said = self._last_message()
            raise UserError(f"{self.fmu.path}: {self.INSTANTIATE} failed{said}") from error
        return self

    @abstractmethod
    def _instantiate(self) -> None:
        """Instantiate; any exception if that fails."""

    def __exit__(self, kind: type | None, *_: object) -> None:
        if self._status == FATAL:
            return  # nothing may be called any more, not even to free the instance
        try:
            if self._initialized and self._status < ERROR:
                self.fmi.terminate()
        except FMICallException as error:
            if kind is None:
                raise self.failure(error, "at the end") from error
        finally:
            if self._status != FATAL:
                self.fmi.freeInstance()

    # ---- Messages --------------------------------------------------------------------------------

    def _keep_unless_ok(self, status: int, message: bytes | None) -> None:
        """Keep a message of the FMU as one line in `messages`, but none of status OK."""
        if status != OK:
            self._said = status
            self.messages.append(self._read_text((message or b"").decode(errors="replace")))

    def _read_text(self, text: str) -> str:
        """Read a text of the FMU in one line, with the names of variables that it refers to."""

        def written(found: re.Match) -> str:
            if not found[2]:
                return found[0][0]  # it is there twice, and stands for itself
            for variable in self.fmu.model.variables.values():
                types = REFERRED.get(found[1], (variable.type,))
                if str(variable.reference) == found[2] and variable.type in types:
                    return variable.name
            return found[0]

        return one_line(re.sub(self.MARKS, written, text))

    def _last_message(self) -> str:
        return f": {self.messages[-1]}" if self.messages else " and gave no message"

    def failure(self, error: FMICallException, when: str) -> UserError:
        """Return the error to raise after a function of the FMU failed."""
        if ended := self._ended(error):
            return self.ended(ended)
        self._status = error.status
        known = error.status in range(len(STATUS_NAMES))
        name = STATUS_NAMES[error.status] if known else str(error.status)
        text = f"{error.function} {when} failed ({name}){self._last_message()}"
        return UserError(f"{self.name}: {text}")

    def _ended(self, error: FMICallException) -> str:
        """Return when the FMU has ended the simulation, if it failed for that; else nothing."""
        return ""

    def ended(self, when: str) -> UserError:
        """Return the error to raise after the FMU has ended the simulation."""
        said = self.messages[-1] if self.messages else ""
        own = ENDS.search(said)
        why = own[1] if own else f"{when}: {said}" if said else when
        return UserError(f"{self.name}: the FMU ends the simulation {why}")

    def raised(self) -> BaseException:
        """Return what a function has raised that the FMU has called in the last call."""
        raise NotImplementedError

    @contextmanager
    def explained(self, when: str) -> Iterator[None]:
        """Turn a call that fails inside into the user's error."""
        try:
            yield
        except FMICallException as error:
            raise self.failure(error, when) from error

    @contextmanager
    def explained_early(self) -> Iterator[None]:
        """Explain errors of initialization, at whose end FMUs say which parameters are wrong."""
        try:
            yield
        except FMICallException as error:
            self.exit_initialization()
            raise self.failure(error, "in initialization") from error

    # ---- Initialization --------------------------------------------------------------------------

    @abstractmethod
    def set_up(self, start: float, stop: float | None, tolerance: float | None = None) -> None:
        """Give start and stop time (s) and the relative tolerance of the experiment."""

    @abstractmethod
    def enter_initialization(self) -> None:
        """Enter initialization mode; parameters and start values are set before."""

    def exit_initialization(self) -> None:
        """Go to the first communication point; inputs are set before."""
        with self.explained("in initialization"):
            self.fmi.exitInitializationMode()
        self._initialized = True

    def reset(self) -> None:
        """Reset to the state after instantiation; messages are forgotten."""
        self.messages.clear()
        with self.explained("before the next run"):
            self.fmi.reset()
        self._initialized = False

    # ---- Values ----------------------------------------------------------------------------------

    def set(self, name: str, value: Value) -> None:
        variable = self.fmu.model.variables[name]
        try:
            getattr(self.fmi, self.SETTERS[variable.type])([variable.reference], [value])
        except FMICallException as error:
            raise self.failure(error, f"({name} = {value!r})") from error

    def integer(self, name: str) -> int | None:
        """Return the value of an Integer variable; None if the FMU has none of that name."""
        variable = self.fmu.model.variables.get(name)
        if variable is None or variable.type != "Integer":
            return None
        with self.explained(f"({name})"):
            return self._integer(variable.reference)

    @abstractmethod
    def _integer(self, reference: int) -> int: ...

    def discrete(self, name: str) -> int:
        """Return the value of a Boolean (0 or 1), Integer or Enumeration."""
        variable = self.fmu.model.variables[name]
        getter = self.SETTERS[variable.type].replace("set", "get")
        with self.explained(f"({name})"):
            return int(getattr(self.fmi, getter)([variable.reference])[0])

    def value(self, name: str) -> float:
        """Return the value of a variable that is no String."""
        if self.fmu.model.variables[name].type != "Real":
            return float(self.discrete(name))
        found = self.reals([name])
        with self.explained(f"({name})"):
            found.get()
        return float(found.view[0])

    def reals(self, names: Sequence[str], memory: Array | None = None) -> Reals:
        """Return Real variables to get or set together, many times, in `memory` if given."""
        values = (c_double * len(names))() if memory is None else memory
        calls = self._real_calls(self._references(names), values) if names else (no_call, no_call)
        return Reals(list(names), view(values), *calls)

    @abstractmethod
    def _real_calls(self, references: Array, values: Array) -> tuple[Call, Call]:
        """Return calls that get and set Real variables."""

    def partials(self, unknowns: Sequence[str], knowns: Sequence[str]) -> np.ndarray:
        """Return the partial derivatives of variables by states and inputs, (unknowns, knowns)."""
        variables = self.fmu.model.variables
        rows = [variables[name].reference for name in unknowns]
        found = np.zeros((len(unknowns), len(knowns)))
        for column, name in enumerate(knowns if rows else ()):
            with self.explained(f"({name})"):
                known = [variables[name].reference]
                found[:, column] = self.fmi.getDirectionalDerivative(rows, known, [1.0])
        return found

    @abstractmethod
    def input_polynomials(self, names: Sequence[str], order: int) -> InputPolynomials:
        """Return polynomials up to `order` of Real inputs, to set together, many times."""

    def _references(self, names: Sequence[str]) -> Array:
        variables = self.fmu.model.variables
        return (c_uint * len(names))(*(variables[name].reference for name in names))

    # ---- Steps -----------------------------------------------------------------------------------

    @abstractmethod
    def do_step(self, start: float, length: float, goes_back: bool = False) -> None:
        """Step from `start` (s), for good unless it `goes_back`; FMICallException if that fails."""

    @abstractmethod
    def snapshot(self) -> Snapshot:
        """Return an empty place for a state to go back to."""


def no_call() -> None:
    """Do nothing, in place of a call for no variables."""


def doubles(count: int) -> tuple[Array, np.ndarray]:
    """Return memory for `count` numbers, and a view of it."""
    memory = (c_double * count)()
    return memory, view(memory)


def view(memory: Array) -> np.ndarray:
    """View memory for numbers, (numbers,)."""
    return np.frombuffer(memory) if len(memory) else np.empty(0)
