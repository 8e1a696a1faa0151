"""How the error of a scenario follows the tolerance, and the rules for that."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rparm.runs import reference
from rparm.runs.comparison import Runs
from rparm.scenarios.scenario import Scenario

TOLERANCES = tuple(float(f"1e-{exponent}") for exponent in range(4, 12))  # loosest first
TIGHTEST = TOLERANCES[-1]

LARGEST_RISE = 3.0  # of the error, from one tolerance to the next tighter one
SMALLEST_GAIN = 1000.0  # by which the tightest tolerance beats the loosest
SMALL_ENOUGH = 1e-10  # an error below it needs no gain


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
