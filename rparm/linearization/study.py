"""A study of an FMU or a system at a point, from the request to saved files."""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rparm import building, project
from rparm.errors import UserError, did_you_mean, reason
from rparm.files import whole
from rparm.fmi.fmu_file import CO_SIMULATION, MODEL_EXCHANGE, Fmu
from rparm.linearization import linear
from rparm.linearization.largest_step import LargestStep, largest_steps
from rparm.linearization.linear import FmuSubject, Linear
from rparm.linearization.margins import Margins, margins, open_loop
from rparm.linearization.system import SystemSubject
from rparm.linearization.trim import Trimmed, trim
from rparm.project import VERSIONS
from rparm.systems.opened import SUFFIXES
from rparm.systems.opened import opened as open_system
from rparm.systems.structure import OpenedSystem

Document = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Request:
    """Request for a linear model."""

    what: str | Path  # an FMU or SSP, or the name of one of the project
    # values by name, in the variables' units or with a unit: states, inputs, parameters, with
    # `free` also outputs, and first guesses
    at: Mapping[str, Any] = field(default_factory=dict)
    # s; None: the start of the FMU's default experiment, or of the system
    time: float | None = None
    free: Sequence[str] = ()  # states and inputs that are moved until the point is an equilibrium
    inputs: Sequence[str] | None = None  # None: all
    outputs: Sequence[str] | None = None  # None: all
    variant: str = ""  # of a system; "": the first
    cut: str = ""  # input of a system at which the loop is broken; "": none
    without: Sequence[str] = ()  # components of a system to take as ideal
    version: str = VERSIONS[0]  # of FMI, if `what` is a name
    # model exchange, which says when something is sampled, or co-simulation; "": the first that the
    # FMU has
    kind: str = ""


@dataclass(frozen=True, eq=False)
class Study:
    """Linear model with all that was asked for."""

    path: Path
    linear: Linear  # without held states
    units: Mapping[str, str]  # of variables that have one
    trimmed: Sequence[str] = ()  # variables that were moved until the point was an equilibrium
    variant: str = ""  # "" of an FMU
    largest: Sequence[LargestStep] = ()  # of a system that is not broken and has a loop
    loop: Linear | None = None  # L where the system is broken
    margins: Margins | None = None  # of `loop`
    python: Sequence[str] = ()  # components in Python, which sample the system
    step: float = 0.0  # s, of a system
    moving: Sequence[str] = ()  # what moves at the point; if trimmed, in a steady motion


def study(request: Request) -> Study:
    """Linearize the FMU or system of a request."""
    path = _path(request)
    if path.suffix.lower() in SUFFIXES and not building.is_equations(path):
        with open_system(path, version=request.version) as opened:
            return of_system(opened, request)
    for option, given in (
        ("--variant", request.variant), ("--break", request.cut), ("--without", request.without)
    ):  # fmt: skip
        if given:
            raise UserError(f"{option}: is for systems, and {path} is an FMU")
    with ExitStack() as stack:
        archive = stack.enter_context(building.archive(path, request.version))
        fmu = stack.enter_context(_opened(archive, path, request.kind))
        start = fmu.model.experiment.start or 0.0
        time = start if request.time is None else request.time
        subject = stack.enter_context(FmuSubject(fmu, time))
        trimmed = _point(subject, request)
        whole = subject.at(trimmed.values)
        moving = trimmed.moving if request.free else whole.moving()
        found = _chosen(subject.finished(whole), trimmed, request)
        return Study(path, found, _units(subject, found), request.free, moving=moving)


def of_system(opened: OpenedSystem, request: Request) -> Study:
    """Linearize a system that is open."""
    path = opened.path
    with ExitStack() as stack:
        variant = opened.variant(request.variant)
        made = SystemSubject(opened, variant, request.time, request.without, request.cut)
        subject = stack.enter_context(made)
        trimmed = _point(subject, request)
        parts = subject.parts(trimmed.values)
        moving = [text for name, part in parts.items() for text in part.moving(f"{name}.")]
        held = subject.held(parts)
        parts = {name: part.without(held[name]) for name, part in parts.items()}
        whole = subject.joined(parts)
        found = _chosen(whole, trimmed, request)
        units = _units(subject, found)
        limits: dict[str, Any] = {"python": tuple(subject.python), "step": opened.system.step}
        limits["moving"] = trimmed.moving if request.free else moving
        if subject.cut is not None:
            loop = open_loop(whole.select([request.cut], [subject.cut.start]))
            limits |= {"loop": loop, "margins": margins(loop)}
        else:
            steps = largest_steps(parts, subject.connections, subject.ways, subject.law)
            limits |= {"largest": steps}
        found = replace(found, **{name: limits.get(name) for name in ("loop", "margins")})
        return Study(path, found, units, request.free, variant, **limits)


def _path(request: Request) -> Path:
    path, name = Path(request.what), str(request.what)
    if path.suffix.lower() in (".fmu", *SUFFIXES):
        return path
    systems, models = project.systems(), project.models()
    for suffix, folders in ((".ssp", systems), (".fmu", models)):
        for folder in folders.values():
            if name == folder.name or project.is_built_from(name, folder):
                return project.built(folder, suffix, version=request.version)
    known = [*models, *systems]
    guess = did_you_mean(name, [*known, *project.built_names(".fmu"), *project.built_names(".ssp")])
    expected = "expected a file .fmu, .toml or .ssp, or a name"
    raise UserError(f"{name}: {expected}{guess} (known: {', '.join(known)})")


def _opened(path: Path, shown: Path, kind: str) -> Fmu:
    """Open an FMU as one of a kind, or as one for model exchange if it can be."""
    if kind:
        return Fmu(path, shown=shown, kind=kind)
    try:
        return Fmu(path, shown=shown, kind=MODEL_EXCHANGE)
    except UserError:
        return Fmu(path, shown=shown, kind=CO_SIMULATION)


def _point(subject: FmuSubject | SystemSubject, request: Request) -> Trimmed:
    values, targets = linear.checked_point(subject, request.at, bool(request.free))
    if not request.free:
        return Trimmed(values, {})
    return trim(subject, values, request.free, targets)


def _chosen(found: Linear, trimmed: Trimmed, request: Request) -> Linear:
    return replace(found.select(request.inputs, request.outputs), intervals=trimmed.intervals)


def _units(subject: FmuSubject | SystemSubject, found: Linear) -> dict[str, str]:
    units: dict[str, str] = {}
    for name in (*found.at, *found.outputs):  # all states and inputs
        with suppress(UserError):  # a number that Python saves is no variable
            units[name] = subject.variable(name).unit or ""
    return {name: unit for name, unit in units.items() if unit}


# ---- Files ---------------------------------------------------------------------------------------
def document(found: Study, step: float | None) -> Document:
    """Return all results as names, numbers and lists; with a `step` (s) also the sampled model."""
    linear = found.linear
    result: Document = {
        "states": list(linear.states),
        "inputs": list(linear.inputs),
        "outputs": list(linear.outputs),
        **{name: getattr(linear, name).tolist() for name in "ABCD"},
        "at": dict(linear.at),
        "held": list(linear.held),
        "poles": pairs(linear.poles),
        "left_out": list(linear.left_out),
        "without_slope": list(linear.flat),
        "uneven": list(linear.uneven),
        "intervals": {name: list(map(finite, ends)) for name, ends in linear.intervals.items()},
    }
    if linear.dt:
        result["dt"] = linear.dt
    if step is not None:
        zoh = linear.sampled(step)
        result["zoh"] = {"step": step, "A": zoh.A.tolist(), "B": zoh.B.tolist()}
        result["zoh"]["poles"] = pairs(np.linalg.eigvals(zoh.A))
    if found.variant:
        result["variant"] = found.variant
    if found.largest:
        result["largest_steps"] = [
            {"order": x.order, "inputs": x.inputs}
            | {"step": finite(x.step), "frequency": finite(x.frequency)}
            for x in found.largest
        ]
    if found.margins is not None:
        names = ("gain_up", "gain_down", "phase", "delay")
        numbers = {name: finite(getattr(found.margins, name)) for name in names}
        for name in ("disk", "sensitivity", "complementary"):
            numbers[name] = finite(getattr(found.margins, name).value)
        loop = found.loop or found.linear
        lost = {"dropped": list(loop.dropped), "hidden": pairs(loop.hidden)}
        result["margins"] = {"stable": found.margins.stable, **numbers, **lost}
    return result


def pairs(poles: np.ndarray) -> list[list[float]]:
    """Return real and imaginary part of each."""
    return [[float(pole.real), float(pole.imag)] for pole in poles]


def finite(number: float) -> float | None:
    """Return a number that JSON has; None if it is not finite."""
    return number if np.isfinite(number) else None


def check_file(path: Path) -> None:
    """Refuse a name that does not say what to write."""
    if path.suffix.lower() not in WRITERS:
        raise UserError(f"--save: {path}: expected a name that ends with {', '.join(WRITERS)}")


def save(path: Path, found: Study, step: float | None) -> None:
    """Write a file, whose suffix says what: .json, .mat of MATLAB and scipy, or .csv."""
    write = WRITERS[path.suffix.lower()]
    try:
        with whole(path) as temporary:
            write(temporary, document(found, step), found.linear)
    except OSError as error:
        raise UserError(f"--save: {path}: cannot be written: {reason(error)}") from error


def _save_json(path: Path, found: Document, _linear: Linear) -> None:
    text = json.dumps(found, indent=1, allow_nan=False) + "\n"
    path.write_text(text, encoding="utf-8", newline="\n")


def _save_mat(path: Path, found: Document, linear: Linear) -> None:
    from scipy.io import savemat

    names = ("states", "inputs", "outputs", "held")
    values = {name: np.array(found[name], dtype=object) for name in names}
    values |= {name: getattr(linear, name) for name in "ABCD"}
    values |= {"poles": linear.poles} | ({"dt": linear.dt} if linear.dt else {})
    if "zoh" in found:
        values["zoh"] = {name: np.array(value) for name, value in found["zoh"].items()}
    with path.open("wb") as file:
        savemat(file, values)


def _save_csv(path: Path, found: Document, linear: Linear) -> None:
    """Write the table [A B; C D], a column a state and input, a row an x' or x+ and output."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["", *linear.states, *linear.inputs])
        row = "next({})" if linear.dt else "der({})"
        for name, a, b in zip(linear.states, linear.A, linear.B, strict=True):
            writer.writerow([row.format(name), *map(repr, [*a.tolist(), *b.tolist()])])
        for name, c, d in zip(linear.outputs, linear.C, linear.D, strict=True):
            writer.writerow([name, *map(repr, [*c.tolist(), *d.tolist()])])


WRITERS: dict[str, Callable[[Path, Document, Linear], None]] = {
    ".json": _save_json,
    ".mat": _save_mat,
    ".csv": _save_csv,
}
