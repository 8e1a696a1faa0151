"""Runs of scenarios compared with their references."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from rparm import project
from rparm.errors import StoppedError, UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs import reference, simulation
from rparm.runs.reference import Compared, Reference
from rparm.runs.simulation import Result
from rparm.scenarios.scenario import Scenario
from rparm.units import short

ESTIMATE_TOLERANCE = 1e-11  # of the run that errors are estimated from, or a tighter one


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
        return reference.bound(self.result.tolerance)

    @property
    def passed(self) -> bool:
        """Whether the error is within its bound, and the twin gives the same bits."""
        return not self.violation

    @property
    def violation(self) -> str:
        """Why the run has not passed, or nothing; an error that is only estimated has no bound."""
        at = f"tolerance {short(self.result.tolerance)}:"
        if self.twin is not None and self.twin.differing:
            others = ", ".join(self.twin.differing)
            return f"{at} other bits in FMI {self.twin.fmi_version}: {others}"
        if self.compared and not self.error <= self.bound:
            bound = f"above its bound {short(self.bound)}"
            return f"{at} error {self.error:.1e} of {self.worst}, {bound}"
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
            self._references[scenario.name] = reference.load(scenario, model)
        return self._references[scenario.name]

    def steps_ahead(
        self, scenario: Scenario, tolerances: Sequence[float], compared: bool = False
    ) -> int:
        """Communication steps still to be made at `tolerances`; `compared`: by twins too."""
        missing = [t for t in tolerances if (scenario.name, t) not in self._runs]
        times = 2 if compared and scenario.model in self._twins else 1
        return times * len(missing) * (len(scenario.times) - 1)

    def run(
        self, scenario: Scenario, tolerance: float, progress: Callable[[int], object] | None = None
    ) -> Run:
        """`scenario` at `tolerance`, simulated now unless it was before."""
        key = scenario.name, tolerance
        if key not in self._runs:
            expected, fmu = self.reference(scenario), self._fmus[scenario.model]
            result = simulation.simulate(fmu, scenario, tolerance, progress)
            errors = reference.errors(result, expected)
            self._runs[key] = Run(scenario, fmu, result, expected, errors)
        return self._runs[key]

    def compared(
        self, scenario: Scenario, tolerance: float, progress: Callable[[int], object] | None = None
    ) -> Run:
        """`scenario` at `tolerance`, compared with its twin too, if there is one."""
        run, twin = self.run(scenario, tolerance, progress), self._twins.get(scenario.model)
        if twin is not None and run.twin is None:
            other = simulation.simulate(twin, scenario, tolerance, progress)
            found = Twin(twin.model.fmi_version, differing(run.result, other))
            run = replace(run, twin=found)
            self._runs[scenario.name, tolerance] = run
        return run

    def failure(self, scenario: Scenario, tolerance: float, error: UserError) -> Failure:
        """What is known of a run that ended with `error`."""
        result = error.result if isinstance(error, StoppedError) else None
        rows = result if result is not None and len(result.times) else None
        return Failure(scenario, self._fmus[scenario.model], tolerance, str(error), rows)

    def estimated(
        self, scenario: Scenario, tolerance: float, progress: Callable[[int], object] | None = None
    ) -> Run:
        """`scenario`, which has no reference, compared with itself at another tolerance."""
        fmu = self._fmus[scenario.model]
        result = simulation.simulate(fmu, scenario, tolerance, progress)
        other = estimated_from(tolerance, scenario.smallest_tolerance)
        exact = simulation.simulate(fmu, scenario, other, progress)
        folder = project.models().get(scenario.model)
        summed = {} if folder is None else reference.read_summed(folder)
        expected = Reference(scenario.path, exact.times, exact.names, exact.values, summed)
        errors = reference.errors(result, expected)
        return Run(scenario, fmu, result, expected, errors, compared=False)


def estimated_from(tolerance: float, smallest: float) -> float:
    """Tolerance of the run that a run at `tolerance` is compared with if there is no reference.

    A tighter one, unless it would be below the `smallest` that makes a difference. Then it is a
    looser one, whose own error is what the runs differ by: more than that of the run.
    """
    tighter = min(ESTIMATE_TOLERANCE, tolerance / 10)
    return tighter if tighter >= smallest else 10 * tolerance


def differing(one: Result, other: Result) -> tuple[str, ...]:
    """Outputs that are not in both, or whose values differ in a bit."""
    columns, others = (
        {name: column.tobytes() for name, column in zip(r.names, r.values.T, strict=True)}
        | {name: column.tobytes() for name, column in r.integers.items()}
        for r in (one, other)
    )
    names = dict.fromkeys((*columns, *others))
    return tuple(name for name in names if columns.get(name) != others.get(name))
