"""Co-simulation units and their instances, through fmpy."""

import re
from collections import deque
from collections.abc import Sequence
from contextlib import chdir
from ctypes import c_double
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import BadZipFile

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription, ModelVariable

from cosim.errors import UserError
from cosim.files import UnreadableError, check_archive, check_library
from cosim.outputs import reason
from cosim.scenario import Scenario

STATUS_NAMES = ("OK", "warning", "discard", "error", "fatal", "pending")
MESSAGES_KEPT = 20
LIBRARY_SUFFIX = fmpy.sharedLibraryExtension  # of this platform


class Fmu:
    """A co-simulation unit: checked and unpacked once, for any number of runs.

    A context manager; the unpacked copy is removed at its end. Raises UserError where the file is
    not an FMI 2.0 co-simulation unit that runs on this platform.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.description = _read_description(self.path)
        self.variables: dict[str, ModelVariable] = {
            variable.name: variable for variable in self.description.modelVariables
        }
        self._unpacked = TemporaryDirectory(prefix="cosim-")
        self.folder = Path(self._unpacked.name)
        try:
            fmpy.extract(self.path, self.folder)
        except OSError as error:
            self.close()
            raise UserError(f"{self.path}: cannot be unpacked: {reason(error)}") from error
        except Exception as error:  # fmpy raises bare exceptions, zlib its own
            self.close()
            raise UserError(f"{self.path}: cannot be unpacked: {_one_line(error)}") from error
        library = self.folder / "binaries" / fmpy.platform / f"{self.identifier}{LIBRARY_SUFFIX}"
        try:
            check_library(library)
        except (OSError, UnreadableError) as error:
            self.close()
            text = error if isinstance(error, UnreadableError) else reason(error)
            raise UserError(f"{self.path}: {library.name}: {text}") from error

    def __enter__(self) -> "Fmu":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def identifier(self) -> str:
        """Name of the shared object without its suffix."""
        return self.description.coSimulation.modelIdentifier

    def close(self) -> None:
        """Remove the unpacked copy."""
        self._unpacked.cleanup()

    @property
    def real_outputs(self) -> list[ModelVariable]:
        """All outputs of type Real, in the order of the model description."""
        return [v for v in self.variables.values() if v.causality == "output" and v.type == "Real"]

    @property
    def states(self) -> list[str]:
        """Names of the continuous states, in the order of the model description."""
        derivatives = [unknown.variable for unknown in self.description.derivatives]
        return [variable.derivative.name for variable in derivatives if variable.derivative]


class Instance:
    """One instance of an FMU: its calls, its messages; terminated and freed whatever happens.

    `slave` is fmpy's. Its functions that are called in long loops are called there directly, with
    `buffers`, and FMICallException becomes the user's error by `failure`.
    """

    def __init__(self, fmu: Fmu, label: str) -> None:
        self.fmu = fmu
        self._label = label
        self._status = fmi2.fmi2OK  # of the call that failed
        self._initialized = False
        self.messages: deque[str] = deque(maxlen=MESSAGES_KEPT)
        # The texts are taken as sent: fmpy's proxy, which fills in printf arguments, has one logger
        # for the whole process. The structure stays referenced for as long as the FMU uses it.
        self._callbacks = fmi2.fmi2CallbackFunctions()
        self._callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        self._callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.slave = self._load()

    def _load(self) -> fmi2.FMU2Slave:
        description = self.fmu.description
        try:
            with chdir("."):  # fmpy changes the folder, and not back where the library is refused
                return fmi2.FMU2Slave(
                    guid=description.guid,
                    modelIdentifier=self.fmu.identifier,
                    unzipDirectory=str(self.fmu.folder),
                    instanceName=self._label,
                )
        except Exception as error:  # fmpy raises bare exceptions
            raise UserError(f"{self.fmu.path}: cannot be loaded: {_one_line(error)}") from error

    def __enter__(self) -> "Instance":
        try:
            self.slave.instantiate(callbacks=self._callbacks, loggingOn=False)
        except Exception as error:  # fmpy raises a bare exception for NULL
            self.slave.freeLibrary()
            reason = self._last_message()
            raise UserError(f"{self.fmu.path}: fmi2Instantiate failed{reason}") from error
        return self

    def __exit__(self, kind: type | None, *_: object) -> None:
        if self._status == fmi2.fmi2Fatal:
            return  # nothing may be called any more, not even fmi2FreeInstance
        try:
            if self._initialized and self._status < fmi2.fmi2Error:
                self.slave.terminate()
        except FMICallException as error:
            if kind is None:
                raise self.failure(error, "at the end") from error
        finally:
            if self._status != fmi2.fmi2Fatal:
                self.slave.freeInstance()

    def initialize(self, scenario: Scenario, tolerance: float) -> None:
        """From instantiated to the first communication point."""
        try:
            self.slave.setupExperiment(
                tolerance=tolerance, startTime=scenario.start, stopTime=scenario.stop
            )
            for name, value in {**scenario.parameters, **scenario.initial}.items():
                self._set(name, value)
            self.slave.enterInitializationMode()
            for name, values in scenario.inputs.items():
                self._set(name, float(values[0]))
            self.slave.exitInitializationMode()
        except FMICallException as error:
            raise self.failure(error, "in initialization") from error
        self._initialized = True

    def counter(self, name: str) -> int | None:
        """Value of an Integer variable; None where the FMU has none of that name."""
        variable = self.fmu.variables.get(name)
        if variable is None or variable.type != "Integer":
            return None
        try:
            return self.slave.getInteger([variable.valueReference])[0]
        except FMICallException as error:
            raise self.failure(error, f"({name})") from error

    def _set(self, name: str, value: float) -> None:
        variable = self.fmu.variables[name]
        references = [variable.valueReference]
        try:
            if variable.type == "Real":
                self.slave.setReal(references, [value])
            elif variable.type == "Boolean":
                self.slave.setBoolean(references, [bool(value)])
            else:
                self.slave.setInteger(references, [int(value)])
        except FMICallException as error:
            raise self.failure(error, f"({name} = {value!r})") from error

    def buffers(self, names: Sequence[str]) -> tuple:
        """Value references, values and a numpy view of the values, for repeated calls."""
        references = [self.fmu.variables[name].valueReference for name in names]
        values = (c_double * len(names))()
        return (
            (fmi2.fmi2ValueReference * len(names))(*references),
            values,
            np.frombuffer(values, dtype=np.float64) if names else np.empty(0),
        )

    def _log(
        self, _environment: int, _instance: bytes, status: int, _category: bytes, message: bytes
    ) -> None:
        if status != fmi2.fmi2OK:
            self.messages.append(_one_line((message or b"").decode("utf-8", errors="replace")))

    def _last_message(self) -> str:
        return f": {self.messages[-1]}" if self.messages else " and gave no message"

    def failure(self, error: FMICallException, when: str) -> UserError:
        """What to raise where a function of the FMU failed."""
        self._status = error.status
        name = STATUS_NAMES[error.status] if error.status in range(6) else str(error.status)
        return UserError(
            f"{self._label}: {error.function} {when} failed ({name}){self._last_message()}"
        )


def _read_description(path: Path) -> ModelDescription:
    """Model description of an FMU that can be run here."""
    if path.is_dir():
        raise UserError(f"{path}: is a folder, expected an FMU")
    try:
        check_archive(path)
        description = fmpy.read_model_description(path)
        platforms = fmpy.supported_platforms(path)
    except UnreadableError as error:
        raise UserError(f"{path}: {error}") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror or error}") from error
    except BadZipFile:
        raise UserError(f"{path}: not an FMU, which is a zip archive") from None
    except KeyError:
        raise UserError(f"{path}: not an FMU, it has no modelDescription.xml") from None
    except Exception as error:  # fmpy, lxml and zlib raise what they like for damaged content
        raise UserError(f"{path}: wrong modelDescription.xml: {_one_line(error)}") from error
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        kinds = [("model exchange", description.modelExchange)]
        found = f"FMI {description.fmiVersion}" + "".join(f" for {k}" for k, v in kinds if v)
        raise UserError(f"{path}: expected an FMU of FMI 2.0 for co-simulation, found {found}")
    identifier = description.coSimulation.modelIdentifier
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
        raise UserError(f"{path}: expected a C identifier as modelIdentifier, found {identifier!r}")
    if fmpy.platform not in platforms:
        raise UserError(
            f"{path}: has no binary for {fmpy.platform} (has: {', '.join(platforms) or 'none'})"
        )
    return description


def _one_line(text: object) -> str:
    return " ".join(str(text).split())
