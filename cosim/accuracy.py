"""Runs compared with their references, and how the error follows the tolerance."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim import reference, simulation
from cosim.errors import UserError
from cosim.reference import Reference
from cosim.scenario import Scenario
from cosim.simulation import Result
from cosim.unit import Fmu

TOLERANCES = tuple(float(f"1e-{exponent}") for exponent in range(4, 12))  # loosest first
TIGHTEST = TOLERANCES[-1]

LARGEST_RISE = 3.0  # of the error, from one tolerance to the next tighter one
SMALLEST_GAIN = 1000.0  # by which the tightest tolerance beats the loosest
SMALL_ENOUGH = 1e-10  # an error that no gain is asked of


@dataclass(frozen=True, eq=False)
class Run:
    """One scenario at one tolerance, compared with its reference."""

    scenario: Scenario
    fmu: Fmu
    result: Result
    reference: Reference
    errors: dict[str, float]  # relative, per Real output

    @property
    def worst(self) -> str:
        """The variable with the largest error."""
        return list(self.errors)[int(np.argmax(list(self.errors.values())))]

    @property
    def error(self) -> float:
        """The largest relative error of all Real outputs; NaN where one of them is."""
        return self.errors[self.worst]

    @property
    def bound(self) -> float:
        """The largest error allowed at this tolerance."""
        return reference.bound(self.result.tolerance)

    @property
    def passed(self) -> bool:
        """Whether the error is within its bound."""
        return self.error <= self.bound


class Runs:
    """Runs scenarios on the FMUs of their models, each at a tolerance only once."""

    def __init__(self, fmus: Mapping[str, Fmu]) -> None:
        self._fmus = fmus  # by name of the model's folder
        self._runs: dict[tuple[str, float], Run] = {}
        self._references: dict[str, Reference] = {}

    def reference(self, scenario: Scenario) -> Reference:
        """Return the reference of `scenario`, read once."""
        if scenario.name not in self._references:
            self._references[scenario.name] = reference.load(scenario)
        return self._references[scenario.name]

    def steps_ahead(self, scenario: Scenario, tolerances: Sequence[float]) -> int:
        """Communication steps that runs at `tolerances` still have to make."""
        missing = [t for t in tolerances if (scenario.name, t) not in self._runs]
        return len(missing) * (len(scenario.times) - 1)

    def run(
        self,
        scenario: Scenario,
        tolerance: float,
        progress: Callable[[int], object] | None = None,
    ) -> Run:
        """`scenario` at `tolerance`, simulated now unless it was before."""
        key = scenario.name, tolerance
        if key not in self._runs:
            expected = self.reference(scenario)
            fmu = self._fmus[scenario.model]
            _check_outputs(fmu, expected)
            result = simulation.simulate(fmu, scenario, tolerance, progress)
            errors = reference.errors(result, expected)
            self._runs[key] = Run(scenario, fmu, result, expected, errors)
        return self._runs[key]


def _check_outputs(fmu: Fmu, expected: Reference) -> None:
    """An FMU that lacks an output must not pass for want of a comparison."""
    for name in expected.names:
        if name not in fmu.variables:
            raise UserError(f"{fmu.path}: has no variable {name!r}, which is in {expected.path}")


@dataclass(frozen=True, eq=False)
class Sweep:
    """Errors of one scenario over the tolerances."""

    scenario: Scenario
    tolerances: tuple[float, ...]  # loosest first
    errors: tuple[float, ...]  # relative, one per tolerance
    violations: list[str]

    @property
    def passed(self) -> bool:
        """Whether the errors keep all rules."""
        return not self.violations


def sweep(
    runs: Runs,
    scenario: Scenario,
    progress: Callable[[int], object] | None = None,
    tolerances: Sequence[float] = TOLERANCES,
) -> Sweep:
    """`scenario` at all `tolerances`, loosest first, and what breaks the rules."""
    errors = tuple(runs.run(scenario, tolerance, progress).error for tolerance in tolerances)
    return Sweep(scenario, tuple(tolerances), errors, violations(tolerances, errors))


def violations(tolerances: Sequence[float], errors: Sequence[float]) -> list[str]:
    """Rules that errors over tolerances (loosest first) break, one sentence each.

    An error stays within its bound; it never grows to more than 3 times that of the next looser
    tolerance; at the tightest it is at most 1/1000 of that at the loosest, or below 1e-10. The
    comparisons are such that NaN breaks them.
    """
    texts = []
    for tolerance, error in zip(tolerances, errors, strict=True):
        largest = reference.bound(tolerance)
        if not error <= largest:
            texts.append(
                f"error {error:.2e} at tolerance {tolerance:g} is above its bound {largest:.0e}"
            )
    for i in range(1, len(errors)):
        if not errors[i] <= LARGEST_RISE * errors[i - 1]:
            texts.append(
                f"error {errors[i]:.2e} at tolerance {tolerances[i]:g} is more than "
                f"{LARGEST_RISE:g} times the {errors[i - 1]:.2e} at {tolerances[i - 1]:g}"
            )
    if not (errors[-1] <= errors[0] / SMALLEST_GAIN or errors[-1] < SMALL_ENOUGH):
        texts.append(
            f"error {errors[-1]:.2e} at tolerance {tolerances[-1]:g} is above 1/{SMALLEST_GAIN:g} "
            f"of the {errors[0]:.2e} at {tolerances[0]:g}"
        )
    return texts
