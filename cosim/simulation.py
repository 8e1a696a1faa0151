"""Runs scenarios on an FMI 2.0 co-simulation unit through fmpy."""

import os
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import chdir
from ctypes import c_double
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import BadZipFile

import fmpy
import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from fmpy.model_description import ModelDescription, ModelVariable
from tqdm import tqdm

from cosim.errors import UserError
from cosim.scenario import Scenario

STATUS_NAMES = ("OK", "warning", "discard", "error", "fatal", "pending")
MESSAGES_KEPT = 20
PROGRESS_DELAY = 1.0  # s, shorter activities show nothing
PROGRESS_LINE_EVERY = 5.0  # s, where the output is not a terminal
PROGRESS_CALL_EVERY = 0.1  # s


@dataclass(frozen=True, eq=False)
class Result:
    """Recorded outputs of one run: row i is what an importer reads after the step to times[i]."""

    tolerance: float  # relative, as given to fmi2SetupExperiment
    times: np.ndarray  # (rows,) s
    names: tuple[str, ...]  # all Real outputs of the FMU
    values: np.ndarray  # (rows, len(names)) in the variables' units
    steps: int  # communication steps
    wall_time: float  # s, of the stepping loop
    solver_steps: int | None  # None: the FMU has no such variable
    solver_rhs_evaluations: int | None
    messages: tuple[str, ...]  # warnings from the FMU, the last ones


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
        except Exception as error:  # fmpy raises bare exceptions, zlib its own
            self.close()
            raise UserError(f"{self.path}: cannot be unpacked: {_one_line(error)}") from error

    def __enter__(self) -> "Fmu":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

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


class Progress:
    """Shows on stderr how far an activity is, once it has taken about a second.

    On a terminal that is a live bar, elsewhere a line every few seconds. Call it with the number
    of steps (or of what `unit` names) done since the last call.
    """

    def __init__(self, label: str, total: int, unit: str = "steps") -> None:
        self._label, self._total, self._done = label, total, 0
        self._start = time.monotonic()
        self._next_line = self._start + PROGRESS_LINE_EVERY
        self._bar = None
        if sys.stderr.isatty():
            self._bar = tqdm(
                total=total,
                desc=label,
                unit=f" {unit}",
                unit_scale=total >= 10_000,
                delay=PROGRESS_DELAY,
                leave=False,
            )

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, steps: int) -> None:
        if self._bar is not None:
            self._bar.update(steps)
            return
        self._done += steps
        now = time.monotonic()
        if now >= self._next_line:
            self._next_line = now + PROGRESS_LINE_EVERY
            percent = 100 * self._done // max(self._total, 1)
            elapsed = now - self._start
            print(f"{self._label}: {percent} %, {elapsed:.0f} s", file=sys.stderr, flush=True)


def simulate(
    fmu: Fmu,
    scenario: Scenario,
    tolerance: float | None = None,
    progress: Callable[[int], object] | None = None,
) -> Result:
    """Run `scenario` on `fmu` and record its Real outputs.

    Parameters
    ----------
    fmu : Fmu
    scenario : Scenario
    tolerance : float, optional
        Relative tolerance for fmi2SetupExperiment; None: that of the scenario.
    progress : callable, optional
        Called now and then with the number of steps done since the last call.

    Raises
    ------
    UserError
        If the FMU lacks a variable of the scenario, or if one of its functions fails; the text
        holds the FMU's own message.
    """
    tolerance = scenario.tolerance if tolerance is None else tolerance
    _check_names(fmu, scenario)
    with _Instance(fmu, scenario.name) as instance:
        instance.initialize(scenario, tolerance)
        values, wall_time = instance.step_through(scenario, progress)
        result = Result(
            tolerance=tolerance,
            times=scenario.times[scenario.reference_rows],
            names=tuple(variable.name for variable in fmu.real_outputs),
            values=values,
            steps=len(scenario.times) - 1,
            wall_time=wall_time,
            solver_steps=instance.counter("solver_steps"),
            solver_rhs_evaluations=instance.counter("solver_rhs_evaluations"),
            messages=tuple(instance.messages),
        )
    return result


def write_csv(path: Path, times: np.ndarray, names: Sequence[str], values: np.ndarray) -> None:
    """Write trajectories in the layout of the FMI cross-check, 17 significant digits.

    The file appears complete or not at all.

    Parameters
    ----------
    path : Path
        Its folder exists.
    times : ndarray, shape (rows,)
        s.
    names : sequence of str
        One name per column of `values`.
    values : ndarray, shape (rows, len(names))
        In the variables' units.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    header = ",".join(f'"{name}"' for name in ("time", *names))
    try:
        with temporary.open("w", encoding="utf-8", newline="\n") as file:
            table = np.column_stack((times, values))
            np.savetxt(file, table, fmt="%.17g", delimiter=",", header=header, comments="")
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


class _Instance:
    """One instance of an FMU: its calls, its messages; terminated and freed whatever happens."""

    def __init__(self, fmu: Fmu, label: str) -> None:
        self._fmu = fmu
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
        self._slave = self._load()

    def _load(self) -> fmi2.FMU2Slave:
        description = self._fmu.description
        try:
            with chdir("."):  # fmpy changes the folder, and not back where the library is refused
                return fmi2.FMU2Slave(
                    guid=description.guid,
                    modelIdentifier=description.coSimulation.modelIdentifier,
                    unzipDirectory=str(self._fmu.folder),
                    instanceName=self._label,
                )
        except Exception as error:  # fmpy raises bare exceptions
            raise UserError(f"{self._fmu.path}: cannot be loaded: {_one_line(error)}") from error

    def __enter__(self) -> "_Instance":
        try:
            self._slave.instantiate(callbacks=self._callbacks, loggingOn=False)
        except Exception as error:  # fmpy raises a bare exception for NULL
            self._slave.freeLibrary()
            reason = self._last_message()
            raise UserError(f"{self._fmu.path}: fmi2Instantiate failed{reason}") from error
        return self

    def __exit__(self, kind: type | None, *_: object) -> None:
        if self._status == fmi2.fmi2Fatal:
            return  # nothing may be called any more, not even fmi2FreeInstance
        try:
            if self._initialized and self._status < fmi2.fmi2Error:
                self._slave.terminate()
        except FMICallException as error:
            if kind is None:
                raise self._failure(error, "at the end") from error
        finally:
            if self._status != fmi2.fmi2Fatal:
                self._slave.freeInstance()

    def initialize(self, scenario: Scenario, tolerance: float) -> None:
        """From instantiated to the first communication point."""
        try:
            self._slave.setupExperiment(
                tolerance=tolerance, startTime=scenario.start, stopTime=scenario.stop
            )
            for name, value in {**scenario.parameters, **scenario.initial}.items():
                self._set(name, value)
            self._slave.enterInitializationMode()
            for name, values in scenario.inputs.items():
                self._set(name, float(values[0]))
            self._slave.exitInitializationMode()
        except FMICallException as error:
            raise self._failure(error, "in initialization") from error
        self._initialized = True

    def step_through(
        self, scenario: Scenario, progress: Callable[[int], object] | None
    ) -> tuple[np.ndarray, float]:
        """All steps: recorded outputs (rows, outputs), and the seconds that the loop took."""
        slave, component = self._slave, self._slave.component
        in_refs, in_values, in_view = self._buffers(list(scenario.inputs))
        outputs = [variable.name for variable in self._fmu.real_outputs]
        out_refs, out_values, out_view = self._buffers(outputs)
        n_in, n_out = len(in_view), len(out_view)
        held = np.column_stack([*scenario.inputs.values()]) if n_in else None

        times, lengths = scenario.times, np.diff(scenario.times)
        rows = scenario.reference_rows
        values = np.empty((len(rows), n_out))
        recorded, reported, i = 0, 0, -1
        begin = time.perf_counter()
        due = begin + PROGRESS_CALL_EVERY
        try:
            slave.fmi2GetReal(component, out_refs, n_out, out_values)
            values[0] = out_view
            for i, length in enumerate(lengths):
                if n_in:
                    in_view[:] = held[i]
                    slave.fmi2SetReal(component, in_refs, n_in, in_values)
                slave.fmi2DoStep(component, times[i], length, fmi2.fmi2True)
                if rows[recorded + 1] == i + 1:
                    slave.fmi2GetReal(component, out_refs, n_out, out_values)
                    recorded += 1
                    values[recorded] = out_view
                if progress is not None and time.perf_counter() >= due:
                    progress(i + 1 - reported)
                    reported = i + 1
                    due = time.perf_counter() + PROGRESS_CALL_EVERY
        except FMICallException as error:
            when = f"in the step from t = {float(times[max(i, 0)])!r} s"
            raise self._failure(error, when) from error
        wall_time = time.perf_counter() - begin
        if progress is not None:
            progress(len(lengths) - reported)
        return values, wall_time

    def counter(self, name: str) -> int | None:
        """Value of an Integer variable; None where the FMU has none of that name."""
        variable = self._fmu.variables.get(name)
        if variable is None or variable.type != "Integer":
            return None
        try:
            return self._slave.getInteger([variable.valueReference])[0]
        except FMICallException as error:
            raise self._failure(error, f"({name})") from error

    def _set(self, name: str, value: float) -> None:
        variable = self._fmu.variables[name]
        references = [variable.valueReference]
        try:
            if variable.type == "Real":
                self._slave.setReal(references, [value])
            elif variable.type == "Boolean":
                self._slave.setBoolean(references, [bool(value)])
            else:
                self._slave.setInteger(references, [int(value)])
        except FMICallException as error:
            raise self._failure(error, f"({name} = {value!r})") from error

    def _buffers(self, names: list[str]) -> tuple:
        """Value references, values and a numpy view of the values, for repeated calls."""
        references = [self._fmu.variables[name].valueReference for name in names]
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

    def _failure(self, error: FMICallException, when: str) -> UserError:
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
        description = fmpy.read_model_description(path)
        platforms = fmpy.supported_platforms(path)
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
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
    if fmpy.platform not in platforms:
        raise UserError(
            f"{path}: has no binary for {fmpy.platform} (has: {', '.join(platforms) or 'none'})"
        )
    return description


def _check_names(fmu: Fmu, scenario: Scenario) -> None:
    for kind, causality, names in (
        ("parameter", "parameter", scenario.parameters),
        ("state with a start value", "output", scenario.initial),
        ("Real input", "input", scenario.inputs),
    ):
        for name in names:
            variable = fmu.variables.get(name)
            real = variable is not None and variable.type == "Real"
            fits = variable is not None and variable.causality == causality
            if not fits or (kind != "parameter" and not real):
                raise UserError(f"{scenario.path}: the FMU {fmu.path} has no {kind} {name!r}")


def _one_line(text: object) -> str:
    return " ".join(str(text).split())
