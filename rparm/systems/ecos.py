"""Runs a system in Ecos, in a child process.

Ecos continues when a component fails, says so in its log only at level debug, and leaves its
temporary files behind. So the run is a child process whose log is read and whose temporary folder
is removed: `python -m rparm.systems.ecos FOLDER` is that child.
"""

import ctypes
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from threading import Event, Thread
from typing import TYPE_CHECKING

import numpy as np

from rparm import project
from rparm.errors import StoppedError, UserError, WrongValueError, one_line
from rparm.fmi.fmi_instance import ENDS
from rparm.interruption import run_group, temporary_folder

if TYPE_CHECKING:
    from rparm.systems.structure import OpenedSystem

PLAN, ROWS, DONE, LOG = "plan.json", "rows.npy", "done.json", "ecos.log"
AT = "at"  # a byte for each hundredth of the steps that are done
PARTS, LOOK = 100, 0.2  # of a run, and s between two looks at how far it is
# of an instance: [path of its FMU] fmi2Status text, [its name] Status text in FMI 3.0
MESSAGE = re.compile(
    r"(\[(?P<fmu>[^\]]*\.fmu)\] fmi2|\[debug\] \[(?P<component>[^\]]*)\] )"
    r"(?P<status>OK|Warning|Discard|Error|Fatal) (?P<text>.*)"
)
BAD = ("Discard", "Error", "Fatal")
CRASHED = 2**31  # exit codes of Windows from here on; elsewhere they are negative
# statistics of an FMU's solver at the end of a run, and their names in tables
STATISTICS = {
    "solver_steps": "solver steps",
    "solver_rhs_evaluations": "evaluations",
    "solver_restarts": "restarts",
    "solver_failed_steps": "failed steps",
    "effective_relative_tolerance": "effective tolerance",
}
READERS = {"Real": "get_real", "Integer": "get_integer", "Boolean": "get_bool"}  # of Ecos, by type


@dataclass(frozen=True, eq=False)
class Run:
    """Results of Ecos: row i holds the values read after step i."""

    names: tuple[str, ...]  # component.variable
    times: np.ndarray  # (rows,) s
    values: np.ndarray  # (rows, len(names)) in the variables' units; Booleans are 0 or 1
    wall_time: float  # s, of the steps with the reading
    messages: tuple[str, ...]  # warnings of the components
    # of STATISTICS, if components have them, by component.variable
    statistics: Mapping[str, float] = field(default_factory=dict)


def absent() -> str:
    """Say why Ecos cannot run here, or nothing."""
    if find_spec("ecospy") is None:
        return "ecospy is not installed"
    here = sys.platform, platform.machine().lower()
    if here not in (("linux", "x86_64"), ("win32", "amd64")):
        return "ecospy has libraries for Linux and Windows on x86-64 only"
    return ""


def unsuited(ssp: "OpenedSystem") -> str:
    """Say why Ecos cannot run a system, or nothing."""
    from rparm.systems.feedthrough import longest_chain  # the child needs none of it

    system = ssp.system
    kinds = {ssp.variable(c.start).type for c in system.connections}
    odd = sorted(kinds & {"Integer", "Enumeration"})
    settings = [(c, n) for of in system.parameters.values() for c in of for n in of[c]]
    if ssp.python:
        return f"{next(iter(ssp.python))} is Python"
    if system.inputs:
        return f"{next(iter(system.inputs))} moves"
    if system.start != 0.0:
        return "Ecos starts at 0 s"
    if system.order != "jacobi":
        return f"its order is {system.order}"
    if system.rates:
        return f"{next(iter(system.rates))} has its own rate"
    if odd:
        return f"there are connections of type {odd[0]}"
    for c, name in settings:
        if ssp.models[c].variables[name].type == "Enumeration":  # left out, with a warning in a log
            return f"component {c!r}: {name!r} is an Enumeration, which Ecos does not set"
    try:
        chain = longest_chain(system.connections, ssp.models)
    except WrongValueError:
        return "its FMUs do not exclude an algebraic loop, which Ecos does not solve"
    if chain > len(system.components):  # as often Ecos passes values on at the start
        return "values pass a component more than once at the start, which Ecos does not follow"
    if name := ssp.passed_on:
        return f"what a tick at the start sets in {name} goes through another component"
    return absent()


def run(
    ssp: "OpenedSystem",
    variant: str,
    names: Sequence[str],
    progress: Callable[[int], object] = lambda _: None,
) -> Run:
    """Run a system from start to stop with a parameter set; read variables ``component.variable``.

    `progress` is called with the steps just done.
    UserError if a component fails or a value is not finite, with component, variable and time, or
    if Ecos itself fails; after the start it is a `StoppedError`.
    """
    system = ssp.system
    if variant not in system.parameters:
        raise UserError(f"{ssp.path}: has no parameter set {variant!r}")
    if why_not := unsuited(ssp):
        raise UserError(f"{ssp.path}: {why_not}")
    statistics = said_at_end(ssp)
    with temporary_folder() as folder:
        plan = {
            "ssp": str(_as_ecos_opens(ssp, variant, folder)),
            "variant": variant if any(system.parameters[variant].values()) else None,
            "variables": _to_read(ssp, names),
            "statistics": _to_read(ssp, statistics),
            "start": system.start,
            "step": system.step,
            "steps": system.steps,
        }
        (folder / PLAN).write_text(json.dumps(plan), encoding="utf-8", newline="\n")
        with _watched(folder, system.steps, progress):
            code = _start(folder)
        log = (folder / LOG).read_text(encoding="utf-8", errors="replace")
        if code != 0:
            last = next((line for line in reversed(log.splitlines()) if line.strip()), "no output")
            crashed = code < 0 or code > CRASHED
            why = (_in_python(ssp) if crashed else "") or last
            raise UserError(f"{ssp.path}: {variant}: Ecos failed (exit code {code}): {why}")
        values = np.load(folder / ROWS)
        done = json.loads((folder / DONE).read_text(encoding="utf-8"))
    times = system.start + system.step * np.arange(len(values))
    messages = [match for match in map(MESSAGE.search, log.splitlines()) if match]
    warnings = [f"{_sender(ssp, m)}: {m['text']}" for m in messages if m["status"] not in BAD]
    said = dict(zip(statistics, done["statistics"], strict=True))
    texts = tuple(dict.fromkeys(warnings))
    result = Run(tuple(names), times, values, done["wall_time"], texts, said)
    try:
        _check_values(ssp, variant, names, times, values, messages)
        _check_messages(ssp, variant, times, messages)
    except UserError as error:  # values that were read after the last step are not to be trusted
        before = replace(result, times=times[:-1], values=values[:-1], statistics={})
        raise StoppedError(str(error), before if len(times) > 1 else None) from None
    return result


def _in_python(ssp: "OpenedSystem") -> str:
    """Name components that end Ecos if they raise: PythonFMU has freed what Ecos reads then."""
    from rparm.fmi.fmu_file import describe  # the child needs none of it

    found = [
        repr(c.name)
        for c in ssp.system.components
        if (describe(ssp.fmu(c.name)).description.generationTool or "").startswith("PythonFMU")
    ]
    way_out = "run() of rparm.System names it and the time"
    return f"perhaps Python has raised an error in {' or '.join(found)}; {way_out}" if found else ""


def said_at_end(ssp: "OpenedSystem") -> list[str]:
    """Return the statistics that components have, as ``component.variable``."""
    models = ssp.models.items()
    return [f"{c}.{name}" for c, model in models for name in STATISTICS if name in model.variables]


def _check_messages(
    ssp: "OpenedSystem", variant: str, times: np.ndarray, messages: Sequence[re.Match[str]]
) -> None:
    """Refuse a run in which a component has failed, or that Ecos has stopped."""
    for match in messages:
        if match["status"] in BAD:
            where = f"{variant}: component {_sender(ssp, match)}"
            if ended := ENDS.search(match["text"]):
                raise UserError(f"{where} ends the simulation {ended[1]}")
            when = "in initialization" if len(times) == 1 else f"by t = {times[-1]:.6g} s"
            raise UserError(f"{where} failed {when} ({match['status'].lower()}): {match['text']}")
    if len(times) != ssp.system.steps + 1:
        raise UserError(f"{ssp.path}: {variant}: Ecos stopped at t = {times[-1]:.6g} s")


def _to_read(ssp: "OpenedSystem", names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the names of variables as Ecos has them, each after the name of its reader."""
    return [(READERS[ssp.variable(name).type], "::".join(ssp.split(name))) for name in names]


def _as_ecos_opens(ssp: "OpenedSystem", variant: str, folder: Path) -> Path:
    """Return the SSP, or make one in a folder: what Ecos reads, or a copy with a name in UTF-8."""
    path = ssp.path.resolve()
    if not (ssp.is_ssp and ssp.is_plain):
        from rparm.systems import ssp_writer  # the child needs none of it

        only = replace(ssp.system, parameters={variant: ssp.system.parameters[variant]})
        ssp_writer.write(folder / "system.ssp", replace(ssp, system=only), flat=True)
        return folder / "system.ssp"
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return Path(shutil.copy(path, folder / "system.ssp"))
    return path


@contextmanager
def _watched(folder: Path, steps: int, progress: Callable[[int], object]) -> Iterator[None]:
    """Tell how far the child is, until the end."""
    ended = Event()

    def watch() -> None:
        seen = 0
        while not ended.wait(LOOK):
            with suppress(OSError):  # not there yet
                parts = (folder / AT).stat().st_size
                progress((parts - seen) * steps // PARTS)
                seen = parts

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        watcher.join()


def _start(folder: Path) -> int:
    """Run the child, and return its exit code."""
    temporary = dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(folder))  # the last two: on Windows
    environment = project.child_environment() | temporary | {"PYTHONUNBUFFERED": "1"}
    if os.name == "posix" and shutil.which("unzip") is None:
        environment["PATH"] = f"{_unzip(folder)}:{environment.get('PATH', os.defpath)}"
    with (folder / LOG).open("wb") as log:
        command = [sys.executable, "-P", "-m", "rparm.systems.ecos", str(folder)]
        streams = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": subprocess.STDOUT}
        return run_group(command, env=environment, **streams).returncode


def _unzip(folder: Path) -> Path:
    """Make a folder with a command that works as Ecos calls it: unzip -o ARCHIVE -d FOLDER."""
    command = folder / "programs" / "unzip"
    command.parent.mkdir()
    python, extract = shlex.quote(sys.executable), "import sys, zipfile as z; "
    extract += "z.ZipFile(sys.argv[1]).extractall(sys.argv[2])"
    text = f'#!/bin/sh\nexec {python} -I -c "{extract}" "$2" "$4"\n'
    command.write_text(text, encoding="utf-8", newline="\n")
    command.chmod(0o755)
    return command.parent


def _sender(ssp: "OpenedSystem", message: re.Match[str]) -> str:
    """Return the name of the component that a message is of."""
    component = message["component"]
    return repr(component) if component is not None else _components(ssp, message["fmu"])


def _components(ssp: "OpenedSystem", fmu: str) -> str:
    """Name of the component whose FMU it is: of FMI 2.0, Ecos's log names only the FMU."""
    fmu = fmu.replace("\\", "/")  # a path of Windows
    names = [c.name for c in ssp.system.components if fmu.endswith("/" + c.source)]
    return " or ".join(map(repr, names)) or repr(PurePosixPath(fmu).name)


def _check_values(
    ssp: "OpenedSystem",
    variant: str,
    names: Sequence[str],
    times: np.ndarray,
    values: np.ndarray,
    messages: Sequence[re.Match[str]],
) -> None:
    """Refuse values (times, names) that are not finite, naming the first component that has one."""
    bad_rows = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if not len(bad_rows):
        return
    row = bad_rows[0]
    bad = [name for name, value in zip(names, values[row], strict=True) if not np.isfinite(value)]
    # a component passes on a bad input in the same step
    victims = {c.end_component for c in ssp.system.connections if c.start in bad}
    sources = [name for name in bad if ssp.split(name)[0] not in victims]
    component, variable = ssp.split((sources or bad)[0])
    value = values[row, list(names).index(f"{component}.{variable}")]
    where = f"{variant}: component {component!r}"
    own = (m["text"] for m in messages if m["status"] in BAD and _sender(ssp, m) == repr(component))
    said = f": {text}" if (text := next(own, "")) else ""
    raise UserError(f"{where}: {variable!r} is {value} at t = {times[row]:.6g} s{said}")


# ---- the child
def _child(folder: Path) -> None:
    """Run the plan of the folder, until a value is not finite or a component has complained."""
    _load_tbb()
    try:
        from ecospy import EcosLib, EcosSimulation
    except (ImportError, OSError) as error:
        sys.exit(f"ecospy cannot be loaded: {one_line(error)}")

    plan = json.loads((folder / PLAN).read_text(encoding="utf-8"))
    steps = plan["steps"]
    EcosLib.set_log_level("debug")
    rows = np.empty((steps + 1, len(plan["variables"])))
    flush = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None).fflush
    seen = 0

    def go_on(row: int) -> bool:
        nonlocal seen
        rows[row] = [read(name) for read, name in readers]
        flush(None)
        if os.fstat(1).st_size != seen:  # the log has grown, which is rare
            log = (folder / LOG).read_text(encoding="utf-8", errors="replace")
            seen = os.fstat(1).st_size
            if any(match["status"] in BAD for match in MESSAGE.finditer(log)):
                return False
        return bool(np.isfinite(rows[row]).all())

    with EcosSimulation(step_size=plan["step"], ssp_path=plan["ssp"]) as simulation:
        if not simulation.init(start_time=plan["start"], parameter_set=plan["variant"]):
            raise RuntimeError(EcosLib.get_last_error())
        readers = [(getattr(simulation, reader), name) for reader, name in plan["variables"]]
        row, begin = 0, time.perf_counter()
        with (folder / AT).open("wb", buffering=0) as at:
            while go_on(row) and row < steps:
                simulation.step()
                row += 1
                if row * PARTS // steps > (row - 1) * PARTS // steps:
                    at.write(b".")
        wall_time = time.perf_counter() - begin
        statistics = [getattr(simulation, reader)(name) for reader, name in plan["statistics"]]
        simulation.terminate()
    np.save(folder / ROWS, rows[: row + 1])
    done = json.dumps({"wall_time": wall_time, "statistics": statistics})
    (folder / DONE).write_text(done, encoding="utf-8", newline="\n")


def _load_tbb() -> None:
    """Load the library that Ecos links, where it is a package of Python and not of the system."""
    with suppress(PackageNotFoundError):
        for file in files("tbb") or ():
            if file.name in ("libtbb.so.12", "tbb12.dll"):
                ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)


if __name__ == "__main__":
    _child(Path(sys.argv[1]))
