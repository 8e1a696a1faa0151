"""Instances of the built FMU as fmpy drives them: variables by name, messages kept."""

import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import fmpy
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription, ModelVariable
from fmpy.simulation import instantiate_fmu

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
STATES = ("q1", "q2", "dq1", "dq2")
INPUTS = ("tau1", "f2")


class Message(NamedTuple):
    """One call of the logger."""

    status: int
    category: str
    text: str


class LoadedFmu:
    """An unpacked FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        if path.is_file():
            fmpy.extract(path, folder)
        self.folder = folder
        self.description = fmpy.read_model_description(folder)
        variables = self.description.modelVariables
        self.references = {variable.name: variable.valueReference for variable in variables}
        self.reals = [v.valueReference for v in variables if v.type == "Real"]
        self.integers = [v.valueReference for v in variables if v.type == "Integer"]


class Instance:
    """One instance; a context manager that frees it. `fmi` is fmpy's object."""

    def __init__(
        self,
        loaded: LoadedFmu,
        kind: type = fmi2.FMU2Slave,
        logging_on: bool = False,
        calls: Callable[[str], object] | None = None,
    ) -> None:
        self.loaded = loaded
        self.messages: list[Message] = []
        element = loaded.description.coSimulation or loaded.description.modelExchange
        self.fmi = kind(
            guid=loaded.description.guid,
            modelIdentifier=element.modelIdentifier,
            unzipDirectory=str(loaded.folder),
            instanceName="arm",
            fmiCallLogger=calls,
        )
        # as sent: fmpy's own logger has one proxy for the whole process
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.fmi.instantiate(callbacks=callbacks, loggingOn=logging_on)

    def __enter__(self) -> "Instance":
        return self

    def __exit__(self, *_: object) -> None:
        self.fmi.freeInstance()

    def _log(
        self, _environment: int, _name: bytes, status: int, category: bytes, text: bytes
    ) -> None:
        self.messages.append(Message(status, category.decode(), text.decode()))

    def begin(
        self,
        start: float = 0.0,
        stop: float | None = None,
        tolerance: float | None = None,
        **values: float,
    ) -> "Instance":
        """From instantiated into initialization."""
        self.fmi.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)
        self.set(**values)
        self.fmi.enterInitializationMode()
        return self

    def initialize(self, *experiment: float | None, **values: float | None) -> "Instance":
        """From instantiated to the first communication point, or the first event mode."""
        self.begin(*experiment, **values).fmi.exitInitializationMode()
        return self

    def set(self, **values: float) -> None:
        """Set Real variables."""
        if values:
            self.fmi.setReal([self.loaded.references[name] for name in values], values.values())

    def set_input_derivatives(self, **values: Iterable[float]) -> None:
        """Set derivatives of inputs, each from order 1 on."""
        rows = [
            (self.loaded.references[name], order, value)
            for name, derivatives in values.items()
            for order, value in enumerate(derivatives, start=1)
        ]
        if rows:
            self.fmi.setRealInputDerivatives(*zip(*rows, strict=True))

    def get(self, *names: str) -> list[float]:
        """Values of Real variables."""
        return self.fmi.getReal([self.loaded.references[name] for name in names])

    def count(self, name: str) -> int:
        """Value of an Integer variable."""
        return self.fmi.getInteger([self.loaded.references[name]])[0]

    def everything(self) -> bytes:
        """All Real and all Integer variables, bit for bit."""
        reals = self.fmi.getReal(self.loaded.reals)
        integers = self.fmi.getInteger(self.loaded.integers)
        return struct.pack(f"<{len(reals)}d{len(integers)}i", *reals, *integers)

    def step(self, t: float, h: float) -> float:
        """Make a step from `t`; return the time at its end."""
        self.fmi.doStep(t, h)
        return t + h


@contextmanager
def instantiated(path: Path, kind: str, **options: bool) -> Iterator[tuple[Any, ModelDescription]]:
    """An instance of either version as fmpy has it, with the description of its FMU.

    `kind`: "CoSimulation" or "ModelExchange"; `options`: those of fmpy's instantiate_fmu.
    """
    description = fmpy.read_model_description(path)
    with TemporaryDirectory() as folder:
        fmpy.extract(path, folder)
        fmu = instantiate_fmu(folder, description, kind, **options)
        try:
            yield fmu, description
        finally:
            fmu.freeInstance()


def set_value(fmu: Any, variable: ModelVariable, value: float) -> None:
    """Set a variable of any type, in either version."""
    integer = "Integer" if isinstance(fmu, fmi2._FMU2) else "Int64"
    kind = integer if variable.type == "Enumeration" else variable.type
    getattr(fmu, f"set{kind}")([variable.valueReference], [value])


def serialized(instance: Any) -> bytes:
    """The state of an instance of either version, by fmpy or rparm, as bytes."""
    state = instance.fmi.getFMUState()
    content = instance.fmi.serializeFMUState(state)
    instance.fmi.freeFMUState(state)
    return content


def restore(instance: Any, content: bytes) -> None:
    """Put an instance into a serialized state."""
    state = instance.fmi.deserializeFMUState(content)
    instance.fmi.setFMUState(state)
    instance.fmi.freeFMUState(state)


def status_of(call: Callable, *arguments: object) -> int:
    """Status of a call through fmpy, which raises where it is not OK."""
    try:
        call(*arguments)
    except FMICallException as error:
        return error.status
    return OK
