"""Runs of a system's variants compared with references, or with runs at smaller steps.

Here is also what study.py in the folder of a system must define.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np

from rparm import building, files, project
from rparm.errors import UserError
from rparm.files import is_file
from rparm.fmi.fmu_file import Fmu, read_model
from rparm.interruption import temporary_folder
from rparm.project import VERSIONS
from rparm.runs import comparison
from rparm.runs.comparison import Compared, Summed
from rparm.systems import ecos
from rparm.systems.master import master_of, run_in_master
from rparm.systems.structure import WAYS, Component, Connector, OpenedSystem

WHOLE = "whole"  # the name of a system as one component
ROUNDING = 1e-9  # of an error that no order improves
PARTS = 32  # of a step, over which the whole system holds an input
BOUND = 1e-7  # on the relative error of every variable


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of one variant, at some of the communication points."""

    path: Path
    steps: np.ndarray  # (rows,) the step after which each row is read, 0: the start
    columns: dict[str, np.ndarray]  # (rows,) by component.variable
    summed: Summed

    def scale(self, name: str) -> float:
        """Return the divisor of a variable's error, in its unit."""
        return comparison.error_scale(self.columns, name, self.summed)


@dataclass(frozen=True, eq=False)
class Outcome(Compared):
    """A run of one variant, and how far it is from its reference, or is estimated to be."""

    variant: str
    steps: int
    run: ecos.Run
    errors: dict[str, float]  # largest of each variable, relative
    why: str = ""  # there are no errors, in an estimate
    is_estimate: bool = False
    cheaper: tuple[str, float] | None = None  # an order that would halve the error, and its error
    exact: np.ndarray | None = None  # (rows, names): the same system as one FMU
    exact_errors: dict[str, float] = field(default_factory=dict)  # likewise, from that

    @property
    def passed(self) -> bool:
        return self.is_estimate or self.error <= BOUND

    def column(self, name: str) -> np.ndarray:
        """Return the values of one variable, (rows,)."""
        return self.run.values[:, self.run.names.index(name)]


Engine = Callable[..., ecos.Run]  # of system, variant, names and progress


def kept(ssp: OpenedSystem) -> list[str]:
    """Return what the file of a system wants to be recorded; all outputs and states without it."""
    return list(ssp.system.keep or [*recorded(ssp), *discrete(ssp)])


def run_alone(
    ssp: OpenedSystem,
    variant: str,
    names: Sequence[str],
    engine: Engine,
    progress: Callable[[int], object] = lambda _: None,
) -> Outcome:
    """Run a variant that has no reference; estimate the coupling error by half the step.

    Inputs that are held over a step are late by half of it, on the average: an error of first
    order, twice the difference between both runs. Both lead to a limit, which the other orders of
    steps are compared with.
    """
    run = engine(ssp, variant, names, progress)
    errors, cheaper, why = {}, None, why_no_estimate(ssp)
    if not why:
        half = replace(ssp, system=ssp.system.with_step(ssp.system.step / 2))
        real = [name for name in kept(ssp) if ssp.variable(name).type == "Real"]
        columns = [names.index(name) for name in real]
        try:
            finer = engine(half, variant, names, progress).values[::2, columns]
            power = 2.0 ** order_of(WAYS[ssp.system.order][1])
            limit = finer + (finer - run.values[:, columns]) / (power - 1)
            sizes = _sizes(ssp, real, finer)
            found = np.abs(run.values[:, columns] - limit).max(axis=0) / sizes
            errors = dict(zip(real, found.tolist(), strict=True))
            cheaper = _cheaper(ssp, variant, real, limit, sizes, float(found.max()), progress)
        except UserError as error:  # an FMU may allow one step only
            why = f"half the step fails, {error}"
    return Outcome(
        variant, ssp.system.steps, run, errors, why, is_estimate=True, cheaper=cheaper
    )  # fmt: skip


def _cheaper(
    ssp: OpenedSystem,
    variant: str,
    names: Sequence[str],
    limit: np.ndarray,
    sizes: np.ndarray,
    error: float,
    progress: Callable[[int], object],
) -> tuple[str, float] | None:
    """Return the order whose error is smallest, if that is at most half of this one's."""
    errors = {}
    for order in WAYS.keys() - {ssp.system.order}:
        other = replace(ssp, system=replace(ssp.system, order=order))
        with suppress(UserError):
            values = run_in_master(other, variant, names, progress).values
            errors[order] = float((np.abs(values - limit).max(axis=0) / sizes).max())
    best = min(sorted(errors), key=errors.__getitem__, default="")
    halves = best and error > ROUNDING and errors[best] <= error / 2
    return (best, errors[best]) if halves else None


def with_exact(outcome: Outcome, ssp: OpenedSystem, names: Sequence[str]) -> Outcome:
    """Compare a run with one of the same files as one FMU, which has no communication step.

    Inputs from outside are held over steps in both; there over parts of these.
    """
    parts = PARTS if ssp.system.inputs else 1
    with temporary_folder() as folder:
        fmu = building.build(ssp.path, output=folder, lock=False)[VERSIONS.index(ssp.version)]
        whole = _as_one(ssp, outcome.variant, fmu, folder)
        whole = replace(whole, system=replace(whole.system, step=ssp.system.step / parts))
        whole_names = [f"{WHOLE}.{name}" for name in names]
        exact = run_in_master(whole, outcome.variant, whole_names).values[::parts]
    real = [name for name in kept(ssp) if ssp.variable(name).type == "Real"]
    columns = [names.index(name) for name in real]
    apart = np.abs(outcome.run.values[:, columns] - exact[:, columns]).max(axis=0)
    errors = dict(zip(real, (apart / _sizes(ssp, real, exact[:, columns])).tolist(), strict=True))
    return replace(outcome, exact=exact, exact_errors=errors)


def _as_one(ssp: OpenedSystem, variant: str, fmu: Path, folder: Path) -> OpenedSystem:
    """Return the system with one component: its FMU, whose names begin with the components'."""
    model, system = read_model(fmu), ssp.system
    ends = [v for v in model.variables.values() if v.causality in ("input", "output")]
    connectors = {v.name: Connector(v.name, v.causality, v.type, v.unit) for v in ends}
    values = {
        f"{component}.{name}": value
        for component, own in system.parameters[variant].items()
        for name, value in own.items()
    }
    one = replace(
        system,
        components=(Component(WHOLE, fmu.relative_to(folder).as_posix(), connectors),),
        connections=(),
        parameters={variant: {WHOLE: values}},
        inputs={f"{WHOLE}.{name}": signal for name, signal in system.inputs.items()},
        keep=None,
    )
    files, models = {WHOLE: fmu}, {WHOLE: model}
    return replace(ssp, folder=folder, system=one, models=models, files=files, python={})


def why_no_estimate(ssp: OpenedSystem) -> str:
    """Say why half the step tells nothing about the coupling error, or nothing."""
    for name in ssp.python:
        return f"{name} is Python, whose law changes with the step"
    for c in ssp.system.connections:
        if ssp.variable(c.start).type == "Real" and ssp.variable(c.start).variability == "discrete":
            return f"{c.start} is sampled"
    if not any(ssp.variable(name).type == "Real" for name in kept(ssp)):
        return "no Real is recorded"
    return "" if ssp.system.connections else "there are no connections"


def _sizes(ssp: OpenedSystem, names: Sequence[str], values: np.ndarray) -> np.ndarray:
    """Return the largest of all values (rows, names) in the unit of each name; 1 where it is 0."""
    units = [ssp.variable(name).unit for name in names]
    sizes: dict[str | None, float] = {}
    for unit, largest in zip(units, np.abs(values).max(axis=0).tolist(), strict=True):
        sizes[unit] = max(sizes.get(unit, 0.0), largest)
    return np.array([sizes[unit] or 1.0 for unit in units])


def recorded(ssp: OpenedSystem) -> list[str]:
    """Return all Real outputs of all components, then the continuous states that are no outputs."""
    outputs, states = [], []
    for component, model in ssp.models.items():
        outputs += [f"{component}.{name}" for name in model.real_outputs]
        states += [f"{component}.{name}" for name in model.states]
    return list(dict.fromkeys((*outputs, *states)))


def discrete(ssp: OpenedSystem) -> list[str]:
    """Return all Integer and Boolean outputs of all components; references may have them or not."""
    return [
        f"{component}.{variable.name}"
        for component, model in ssp.models.items()
        for variable in model.variables.values()
        if variable.causality == "output" and variable.type in ("Integer", "Boolean")
    ]


def simulate(
    ssp: OpenedSystem,
    variant: str,
    expected: Reference,
    engine: Engine = ecos.run,
    progress: Callable[[int], object] = lambda _: None,
) -> Outcome:
    """Run a variant and compare it; UserError if a component or the engine fails."""
    run = engine(ssp, variant, [*recorded(ssp), *discrete(ssp)], progress)
    errors = {}
    for name, values in expected.columns.items():
        actual = run.values[expected.steps, run.names.index(name)]
        errors[name] = float(np.abs(actual - values).max()) / expected.scale(name)
    return Outcome(variant, ssp.system.steps, run, errors)


def reference_names(system: Path) -> list[str]:
    """Return the variants that the folder of a system has references of."""
    folder = project.references(system)
    return sorted(path.name for path in folder.glob("*") if path.is_dir())


def load_reference(
    ssp: OpenedSystem, variant: str, system: Path, experiment: tuple[float, float, float]
) -> Reference:
    """Read and check the reference of a variant of the system in a folder.

    `experiment` is its start, stop and step in s. UserError if it is missing, damaged or another's;
    names the line and the command that makes it.
    """
    _check_experiment(ssp, experiment)
    path = project.variant_reference_file(system, variant)
    wrong = comparison.reference_failure(path, system, variant)
    (_, *names), table = files.read_trajectory(path, wrong)
    known = recorded(ssp)
    possible = {*known, *discrete(ssp)}
    for name in names:
        if name not in possible or names.count(name) > 1:
            raise wrong(f"column {name!r} is unknown or there twice", 1)
    for name in known:
        if name not in names:
            raise wrong(f"has no column {name!r}", 1)
    steps = _steps(ssp, table[:, 0], wrong)
    values = dict(zip(names, table[:, 1:].T, strict=True))
    return Reference(path, steps, values, comparison.read_summed(system))


def _steps(ssp: OpenedSystem, times: np.ndarray, wrong: files.Failure) -> np.ndarray:
    """Return the numbers of the communication points at `times`, (rows,)."""
    system = ssp.system
    steps = np.rint((times - system.start) / system.step).astype(int)
    off = np.abs(times - (system.start + steps * system.step)) > 1e-6 * system.step
    off |= (steps < 0) | (steps > system.steps) | (np.diff(steps, prepend=-1) <= 0)
    if off.any():
        row = int(np.flatnonzero(off)[0])
        raise wrong(f"no communication point: {float(times[row])!r} s", row + 2)
    if steps[-1] != system.steps:
        raise wrong(f"ends before {system.stop!r} s", len(steps) + 1)
    return steps


def _check_experiment(ssp: OpenedSystem, experiment: tuple[float, float, float]) -> None:
    """Check that the references are for the system's times."""
    system = ssp.system
    if not np.allclose((system.start, system.stop, system.step), experiment, rtol=1e-9, atol=0.0):
        start, stop, step = experiment
        raise UserError(
            f"{ssp.path}: runs from {system.start!r} to {system.stop!r} s in steps of "
            f"{system.step!r} s; the references are for {start!r} to {stop!r} s in steps of "
            f"{step!r} s"
        )


# ---- By halving the step -------------------------------------------------------------------------
HALVINGS = 4  # of the communication step


@dataclass(frozen=True, eq=False)
class Halved:
    """What the coupling costs in one way to step, by runs at steps that are halved."""

    order: str  # as in `rparm.systems.master`
    inputs: str
    steps: np.ndarray  # (runs,) s
    # (runs,) largest distance of an output from the limit that the last two runs lead to, relative
    # to the largest value of outputs in its unit
    errors: np.ndarray
    orders: np.ndarray  # (runs - 2,) by differences of three runs each
    worst: str  # output with the largest error at the first step


def order_of(inputs: str) -> int:
    """Return the power of the step by which errors of smooth systems fall."""
    return 2 if inputs == "extrapolated" else 1


def halve(
    ssp: OpenedSystem,
    variant: str,
    way: tuple[str, str],
    progress: Callable[[int], object] = lambda _: None,
) -> Halved:
    """Run a variant at its step and at smaller ones, in one of `master.ways`; compare the runs.

    UserError for `why_no_estimate`.
    """
    if why_not := why_no_estimate(ssp):
        raise UserError(f"{ssp.path}: halves of the step show no error of the coupling: {why_not}")
    system = ssp.system
    names = [
        f"{component}.{name}"
        for component, model in ssp.models.items()
        for name in model.real_outputs
    ]
    with ssp.unpacked_fmus() as fmus:
        values = np.array([
            _rows_at_whole_steps(fmus, ssp, variant, way, names, 2**halvings, progress)
            for halvings in range(HALVINGS + 1)
        ])  # fmt: skip
    values = values / _sizes(ssp, names, values[-1])
    limit = values[-1] + (values[-1] - values[-2]) / (2 ** order_of(way[1]) - 1)
    errors = np.abs(values - limit)
    differences = np.abs(np.diff(values, axis=0)).max(axis=(1, 2), initial=0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        orders = np.log2(differences[:-1] / differences[1:])
    place = int(errors[0].max(axis=0).argmax())
    steps = system.step / 2.0 ** np.arange(len(values))
    return Halved(*way, steps, errors.max(axis=(1, 2)), orders, names[place])


def _rows_at_whole_steps(
    fmus: Mapping[str, Fmu],
    ssp: OpenedSystem,
    variant: str,
    way: tuple[str, str],
    names: Sequence[str],
    parts: int,
    progress: Callable[[int], object],
) -> np.ndarray:
    """Run with steps in `parts`; return rows (steps + 1, names) of outputs at the whole ones."""
    system = ssp.system
    parted = replace(ssp, system=system.with_step(system.step / parts))
    with master_of(parted, fmus, way) as master:
        master.initialize(system.start, system.stop, system.parameter_sets[variant])
        columns = [master.names.index(name) for name in names]
        count = np.arange(system.steps * parts + 1)
        times = system.start + count * system.step / parts
        return master.watch(times, columns, count[1:] % parts == 0, progress)


# ---- study.py of a system ------------------------------------------------------------------------
@dataclass(frozen=True)
class Measure:
    """A number that a run is measured by, for the tables."""

    name: str
    unit: str
    meaning: str  # explains it on the page, after its name and a colon
    value: Callable[[Outcome], float]


@dataclass(frozen=True)
class Diagram:
    """Variables of one unit to draw together, each ``component.variable``."""

    title: str
    curves: Sequence[str]
    references: Mapping[str, str] = field(default_factory=dict)  # reference of a curve


@dataclass(frozen=True)
class Rest:
    """State of rest, to find the largest stable steps; names are ``component.variable``."""

    variant: str
    moved: Sequence[str]  # states to begin a little off
    signals: Sequence[str]  # that show whether the deviation dies out
    values: Mapping[str, float] = field(default_factory=dict)  # besides the variant's
    without: Sequence[str] = ()  # components to take as ideal
    sequence: Sequence[str] = ()  # order of stepping; default: as in the SSP


class Study(Protocol):
    """The module study.py of a system's folder."""

    EXPERIMENT: tuple[float, float, float]  # start, stop and step in s that the references are for
    MEASURES: Sequence[Measure]
    DIAGRAMS: Sequence[Diagram]  # of the page of a variant


class CouplingStudy(Study, Protocol):
    """The module of a system that has a study of what the coupling costs."""

    COUPLING_PICTURE: str  # file name of its picture

    def study_coupling(self, ssp: Path, report: Path) -> dict[str, dict[str, object]]:
        """Print tables, write the picture; numbers by part, whether all is well is ``passed``."""
        ...


def load_study(folder: Path) -> Study:
    """Import the module of a system's folder; UserError if there is none."""
    file = folder / f"{project.STUDY}.py"
    if not is_file(file):
        where = "rparm/systems/comparison.py"
        raise UserError(f"{file}: no such file, {where} says what belongs in it")
    return cast(Study, import_module(f"rparm.models.{folder.name}.{project.STUDY}"))


def coupling_study() -> tuple[Path, CouplingStudy]:
    """Return folder and module of the system with a coupling study; UserError if not one."""
    found = _studies_with("study_coupling")
    if len(found) != 1:
        names = ", ".join(folder.name for folder in found) or "none"
        raise UserError(f"expected one system with a study of its coupling, found {names}")
    (folder, known), *_ = found.items()
    return folder, cast(CouplingStudy, known)


def rests() -> dict[Path, Rest]:
    """Return where systems rest, by folder, of those that define ``REST``."""
    return {folder: cast(Rest, known.REST) for folder, known in _studies_with("REST").items()}


def _studies_with(name: str) -> dict[Path, Any]:
    """Return the modules of systems that have this name, by folder."""
    loaded = {folder: load_study(folder) for folder in project.systems().values()}
    return {folder: known for folder, known in loaded.items() if hasattr(known, name)}
