"""Runs compared: with references, with logs, over tolerances, and of FMI 2.0 with 3.0."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from rparm import files, project
from rparm.errors import StoppedError, UserError
from rparm.files import is_file, read_toml
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Model
from rparm.runs import simulation
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from rparm.units import short

SMALLEST_SCALE = 1e-3  # in the variable's unit; below it an error counts as absolute
ERROR_PER_TOLERANCE = 1000.0
# largest error allowed at a tolerance, and at every tighter one
BOUNDS = {1e-8: 1e-6, 1e-11: 1e-8}
# name -> names whose absolute values are summed up to the scale of its error
Summed = Mapping[str, tuple[str, ...]]
ESTIMATE_TOLERANCE = 1e-11  # of the run that errors are estimated from, or a tighter one
TOLERANCES = tuple(float(f"1e-{exponent}") for exponent in range(4, 12))  # loosest first
TIGHTEST = TOLERANCES[-1]
LARGEST_RISE = 3.0  # of the error, from one tolerance to the next tighter one
SMALLEST_GAIN = 1000.0  # by which the tightest tolerance beats the loosest
SMALL_ENOUGH = 1e-10  # an error below it needs no gain


# ---- References ----------------------------------------------------------------------------------
class Compared:
    """A run that has been compared: which of its variables is farthest from the reference."""

    errors: dict[str, float]  # by name, as `errors` gives them

    @property
    def worst(self) -> str:
        """The variable with the largest error; NaN counts as larger than all."""
        return list(self.errors)[int(np.argmax(list(self.errors.values())))]

    @property
    def error(self) -> float:
        """The largest error of all variables; NaN if one of them is."""
        return self.errors[self.worst]


@dataclass(frozen=True, eq=False)
class Reference:
    path: Path
    times: np.ndarray  # (rows,) s
    names: tuple[str, ...]
    values: np.ndarray  # (rows, len(names)) in the variables' units
    summed: Summed = field(default_factory=dict)

    def column(self, name: str) -> np.ndarray:
        """Return the values of one variable, (rows,)."""
        if name not in self.names:
            raise UserError(f"{self.path}, line 1: has no column {name!r}")
        return self.values[:, self.names.index(name)]

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """Values of all variables, (rows,) each."""
        return dict(zip(self.names, self.values.T, strict=True))

    def scale(self, name: str) -> float:
        """Return the divisor of a variable's error, in its unit."""
        return error_scale(self.columns, name, self.summed)


def load_reference(scenario: Scenario, model: Model) -> Reference:
    """Read and check the reference of `scenario`, which was checked against `model`.

    UserError if it is missing, damaged or another's; names line and command that makes it.
    """
    path = project.reference_file(scenario.path, model.name)
    folder = project.model_folder(scenario.path)
    wrong = reference_failure(path, folder, scenario.name)
    (_, *names), table = files.read_trajectory(path, wrong)
    _check_names(names, model, wrong)
    _check_times(table[:, 0], scenario, wrong)
    return Reference(path, table[:, 0], tuple(names), table[:, 1:], read_summed(folder))


def reference_failure(path: Path, folder: Path, name: str) -> files.Failure:
    """Return a function that makes errors of a reference, with how to make it again."""
    return files.csv_failure(path, f"; {project.making_references(folder, name)}")


def read_summed(folder: Path) -> Summed:
    """Read which errors a sum scales, by variable; UserError if the file is wrong."""
    path = project.scales_file(folder)
    if not is_file(path):
        return {}
    content = read_toml(path)
    for name, terms in content.items():
        if not (isinstance(terms, list) and terms and all(isinstance(x, str) for x in terms)):
            raise UserError(f"{path}: {name}: expected a list of variables")
    return {name: tuple(terms) for name, terms in content.items()}


def error_scale(columns: Mapping[str, np.ndarray], name: str, summed: Summed) -> float:
    """Return the divisor of a variable's error: its largest value, or a complete sum's."""
    terms = summed.get(name, ())
    if not terms or not set(terms) <= set(columns):
        terms = (name,)
    largest = float(np.max(sum(np.abs(columns[term]) for term in terms)))
    return max(largest, SMALLEST_SCALE)


def errors_against(result: Result, reference: Reference) -> dict[str, float]:
    """Return each variable's relative error: its largest difference over time / `error_scale`."""
    return {
        name: float(np.max(np.abs(values - reference.column(name)))) / reference.scale(name)
        for name, values in zip(result.names, result.values.T, strict=True)
    }


def error_bound(tolerance: float) -> float:
    """Return 1000 tolerances, at most 1e-6 from tolerance 1e-8 on and 1e-8 from 1e-11 on."""
    applying = [error for loosest, error in BOUNDS.items() if tolerance <= loosest]
    return min([ERROR_PER_TOLERANCE * tolerance, *applying])


def _check_names(names: Sequence[str], model: Model, wrong: files.Failure) -> None:
    """Check that every Real output is there, and nothing else: all columns are compared."""
    for name in names:
        if name not in model.variables or model.variables[name].type != "Real":
            raise wrong(f"the model has no Real variable {name!r}", 1)
        if names.count(name) > 1:
            raise wrong(f"column {name!r} is there twice", 1)
    for name in model.real_outputs:
        if name not in names:
            raise wrong(f"has no column {name!r}", 1)
    for name in names:
        if name not in model.real_outputs:
            raise wrong(f"{name!r} is not an output of the model", 1)


def _check_times(times: np.ndarray, scenario: Scenario, wrong: files.Failure) -> None:
    """Check that the times are those communication points that the scenario asks for."""
    expected = scenario.times[scenario.reference_rows]
    shared = min(len(times), len(expected))
    differing = np.flatnonzero(times[:shared] != expected[:shared])
    other = f"does not match {scenario.path}: expected"
    if len(differing):
        row = int(differing[0])
        found = f"found {float(times[row])!r} s"
        raise wrong(f"{other} time {float(expected[row])!r} s, {found}", row + 2)
    if len(times) != len(expected):
        raise wrong(f"{other} {len(expected)} rows, found {len(times)}", shared + 1)


# ---- Runs ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Twin:
    """The same run on an FMU of another version of FMI."""

    fmi_version: str
    differing: tuple[str, ...]  # outputs that only one of both has, or whose values differ in a bit


@dataclass(frozen=True, eq=False)
class Run(Compared):
    """One scenario at one tolerance, compared with its reference."""

    scenario: Scenario
    fmu: Fmu
    result: Result
    reference: Reference
    errors: dict[str, float]  # of each Real output, as `reference.errors` gives them
    twin: Twin | None = None
    compared: bool = True  # False: the reference is the same FMU at another tolerance

    @property
    def bound(self) -> float:
        """The largest error allowed at this tolerance."""
        return error_bound(self.result.tolerance)

    @property
    def passed(self) -> bool:
        """Whether the error is within its bound, and the twin gives the same bits."""
        return not self.violation

    @property
    def violation(self) -> str:
        """Reason of a failure, or nothing; an error that is only estimated has no bound."""
        at = f"tolerance {short(self.result.tolerance)}:"
        if self.twin is not None and self.twin.differing:
            others = ", ".join(self.twin.differing)
            return f"{at} other bits in FMI {self.twin.fmi_version}: {others}"
        if self.compared and not self.error <= self.bound:
            bound = f"above its bound {short(self.bound)}"
            return f"{at} error {short(self.error, 1)} of {self.worst}, {bound}"
        return ""


@dataclass(frozen=True, eq=False)
class Failure:
    """A run that an FMU did not finish."""

    scenario: Scenario
    fmu: Fmu
    tolerance: float
    text: str  # with the FMU's own message
    result: Result | None  # up to the failure, if it has rows


class Runs:
    """Runs scenarios on FMUs by `Scenario.model`, once at a tolerance; twins give the same bits."""

    def __init__(self, fmus: Mapping[str, Fmu], twins: Mapping[str, Fmu] | None = None) -> None:
        self._fmus = fmus
        self._twins = twins or {}
        self._runs: dict[tuple[str, float], Run] = {}
        self._references: dict[str, Reference] = {}

    def reference(self, scenario: Scenario) -> Reference:
        """Return the reference of `scenario`, read once."""
        if scenario.name not in self._references:
            model = self._fmus[scenario.model].model
            self._references[scenario.name] = load_reference(scenario, model)
        return self._references[scenario.name]

    def steps_ahead(
        self, scenario: Scenario, tolerances: Sequence[float], compared: bool = False
    ) -> int:
        """Count communication steps still to be made at `tolerances`; `compared`: by twins too."""
        missing = [t for t in tolerances if (scenario.name, t) not in self._runs]
        times = 2 if compared and scenario.model in self._twins else 1
        return times * len(missing) * (len(scenario.times) - 1)

    def run(
        self, scenario: Scenario, tolerance: float, progress: Callable[[int], object] | None = None
    ) -> Run:
        """Run `scenario` at `tolerance`, unless it was before."""
        key = scenario.name, tolerance
        if key not in self._runs:
            expected, fmu = self.reference(scenario), self._fmus[scenario.model]
            result = simulation.simulate(fmu, scenario, tolerance, progress)
            errors = errors_against(result, expected)
            self._runs[key] = Run(scenario, fmu, result, expected, errors)
        return self._runs[key]

    def compared(
        self, scenario: Scenario, tolerance: float, progress: Callable[[int], object] | None = None
    ) -> Run:
        """Run `scenario` at `tolerance`; compare it with its twin too, if there is one."""
        run, twin = self.run(scenario, tolerance, progress), self._twins.get(scenario.model)
        if twin is not None and run.twin is None:
            other = simulation.simulate(twin, scenario, tolerance, progress)
            found = Twin(twin.model.fmi_version, differing(run.result, other))
            run = replace(run, twin=found)
            self._runs[scenario.name, tolerance] = run
        return run

    def failure(self, scenario: Scenario, tolerance: float, error: UserError) -> Failure:
        """Return the failure of a run that ended with `error`."""
        result = error.result if isinstance(error, StoppedError) else None
        rows = result if result is not None and len(result.times) else None
        return Failure(scenario, self._fmus[scenario.model], tolerance, str(error), rows)

    def estimated(
        self, scenario: Scenario, tolerance: float, progress: Callable[[int], object] | None = None
    ) -> Run:
        """Run `scenario`, which has no reference; compare it with itself at another tolerance."""
        fmu = self._fmus[scenario.model]
        result = simulation.simulate(fmu, scenario, tolerance, progress)
        other = estimated_from(tolerance, scenario.smallest_tolerance)
        exact = simulation.simulate(fmu, scenario, other, progress)
        folder = project.models().get(scenario.model)
        summed = {} if folder is None else read_summed(folder)
        expected = Reference(scenario.path, exact.times, exact.names, exact.values, summed)
        errors = errors_against(result, expected)
        return Run(scenario, fmu, result, expected, errors, compared=False)


def estimated_from(tolerance: float, smallest: float) -> float:
    """Choose the tolerance to compare a run at `tolerance` with if there is no reference.

    A tighter one, or if it would be below the `smallest` that makes a difference, a looser one,
    whose own error is then the difference: more than the run's.
    """
    tighter = min(ESTIMATE_TOLERANCE, tolerance / 10)
    return tighter if tighter >= smallest else 10 * tolerance


def differing(one: Result, other: Result) -> tuple[str, ...]:
    """Return outputs that are not in both, or whose values differ in a bit."""
    columns, others = (
        {name: column.tobytes() for name, column in zip(r.names, r.values.T, strict=True)}
        | {name: column.tobytes() for name, column in r.integers.items()}
        for r in (one, other)
    )
    names = dict.fromkeys((*columns, *others))
    return tuple(name for name in names if columns.get(name) != others.get(name))


# ---- Logs ----------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Comparison:
    """An output that was measured, at the times of a run's rows."""

    name: str
    source: str  # file and column of the log
    measured: np.ndarray  # (rows,); NaN where the log has no values
    simulated: np.ndarray  # (rows,)

    @property
    def rms(self) -> float:
        """Root of the mean square of the differences, in the variable's unit."""
        # scaled, so that no square overflows
        largest = self.largest
        return largest * float(np.sqrt(np.mean((self._differences / (largest or 1.0)) ** 2)))

    @property
    def largest(self) -> float:
        """Largest difference, in the variable's unit."""
        return float(np.max(np.abs(self._differences)))

    @property
    def _differences(self) -> np.ndarray:
        rows = ~np.isnan(self.measured)
        return self.simulated[rows] - self.measured[rows]


def comparisons(scenario: Scenario, result: Result) -> Iterator[Comparison]:
    """Compare a run with the logs of a scenario."""
    elapsed = scenario.elapsed[scenario.reference_rows][: len(result.times)]
    for name, log in scenario.measured.items():
        measured = np.where(log.covers(elapsed), log.values(elapsed), np.nan)
        simulated = result.values[:, result.names.index(name)]
        yield Comparison(name, log.source, measured, simulated)


# ---- Tolerances ----------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Sweep:
    """Errors of one scenario over the tolerances."""

    scenario: Scenario
    tolerances: tuple[float, ...]  # loosest first
    errors: tuple[float, ...]  # relative, one per tolerance
    violations: list[str]

    @property
    def passed(self) -> bool:
        return not self.violations


def sweep(
    runs: Runs,
    scenario: Scenario,
    progress: Callable[[int], object] | None = None,
    tolerances: Sequence[float] = TOLERANCES,
) -> Sweep:
    """Run `scenario` at all `tolerances`, loosest first; return errors and broken rules."""
    errors = tuple(runs.run(scenario, tolerance, progress).error for tolerance in tolerances)
    return Sweep(scenario, tuple(tolerances), errors, sweep_violations(tolerances, errors))


def sweep_violations(tolerances: Sequence[float], errors: Sequence[float]) -> list[str]:
    """Return rules that errors over tolerances (loosest first) break, one sentence each.

    An error stays within its bound, grows to 3 times the next looser one's at most, and falls to
    1/1000 of the loosest or below 1e-10. The comparisons are such that NaN breaks them.
    """
    texts = []
    for tolerance, error in zip(tolerances, errors, strict=True):
        largest = error_bound(tolerance)
        if not error <= largest:
            found = f"error {short(error, 2)} at tolerance {short(tolerance)}"
            texts.append(f"{found} is above its bound {short(largest, 0)}")
    e, t = [short(error, 2) for error in errors], [*map(short, tolerances)]
    for i in range(1, len(errors)):
        if not errors[i] <= LARGEST_RISE * errors[i - 1]:
            texts.append(
                f"error {e[i]} at tolerance {t[i]} is more than {LARGEST_RISE:g} times the "
                f"{e[i - 1]} at {t[i - 1]}"
            )
    if not (errors[-1] <= errors[0] / SMALLEST_GAIN or errors[-1] < SMALL_ENOUGH):
        above = f"is above 1/{SMALLEST_GAIN:g} of the {e[0]} at {t[0]}"
        texts.append(f"error {e[-1]} at tolerance {t[-1]} {above}")
    return texts
