"""Order of convergence in the communication step, with inputs that are smooth functions of time.

A master knows its inputs at the communication points. With zero-order hold, the error of an FMU
falls with the first power of the step, with derivatives up to order k with power k + 1. If an FMU
of FMI 3.0 asks for the inputs at four times of a step (intermediate update), it falls with power 4.
The problems are models/<model>/convergence/<name>.toml, in the format of a
scenario; the exact final state of each is models/<model>/references/<name>/exact.json.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from fmpy.fmi1 import FMICallException

from rparm import project
from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import Model
from rparm.fmi.versions import Fmi3Instance
from rparm.runs import scenario as scenarios
from rparm.runs import simulation
from rparm.runs.inputs import Sines
from rparm.runs.scenario import Scenario

FACTORS = (64, 32, 16, 8, 4, 2, 1)  # communication steps, in shortest steps of the problem
ORDERS = (0, 1, 2, 3)  # of the highest input derivative that is set; 0: zero-order hold
INTERMEDIATE_UPDATE = len(ORDERS)  # the case after the orders
# of the cases
NAMES = (
    "inputs held", "1st derivatives", "2nd derivatives", "3rd derivatives", "intermediate update",
)  # fmt: skip
POWERS = (1, 2, 3, 4, 4)  # of the step, which the error follows in each case
LARGEST_DEVIATION = 0.2  # of a slope from the order expected
CLEAR_OF_INTEGRATION = 100.0  # an error counts from this many times the integration's own
FEWEST_FITTED = 4  # errors that a slope needs: three halvings of the step
ALL_FITTED = 3  # up to this power, the slope is that over all steps


@dataclass(frozen=True, eq=False)
class Problem:
    """A motion with smooth inputs and its exact final state."""

    scenario: Scenario
    inputs: dict[str, Sines]
    exact: dict[str, float]  # final states
    largest: dict[str, float]  # largest absolute value of each state on the way, its scale

    @property
    def steps(self) -> np.ndarray:
        """Communication steps that are run, s, longest first."""
        return self.scenario.steps[0] * np.array(FACTORS)

    def final_error(self, states: dict[str, float]) -> float:
        """Return the largest difference of final `states`, relative to their largest values."""
        return max(abs(states[name] - self.exact[name]) / self.largest[name] for name in self.exact)


@dataclass(frozen=True)
class Row:
    """Result of one case."""

    name: str
    errors: tuple[float, ...]  # relative, one per step
    slope: float
    holds: bool


@dataclass(frozen=True, eq=False)
class Convergence:
    """Errors of the final state over the communication step, in the first cases of `NAMES`."""

    problem: Problem
    errors: np.ndarray  # (cases, steps) relative

    @property
    def scenario(self) -> Scenario:
        return self.problem.scenario

    @property
    def integration_error(self) -> float:
        """Estimate of what the integrator itself leaves: the error with the best known inputs.

        With the highest derivatives and the shortest step the inputs are all but exact, restarts
        most frequent. With intermediate update, errors of inputs and integrator may cancel there:
        the second shortest step counts, too.
        """
        shortest = 2 if len(self.errors) > INTERMEDIATE_UPDATE else 1
        return float(self.errors[-1, -shortest:].max())

    @property
    def fitted(self) -> np.ndarray:
        """Which errors the slopes are fitted to, (cases, steps): those clear of integration's."""
        return self.errors >= CLEAR_OF_INTEGRATION * self.integration_error

    @cached_property
    def slopes(self) -> tuple[float, ...]:
        """Slope of log error over log step, one per case; NaN if too few errors count."""
        return tuple(
            slope(self.problem.steps[use], errors[use]) if use.sum() >= FEWEST_FITTED else math.nan
            for errors, use in zip(self.errors, self.fitted, strict=True)
        )

    def holds(self, i: int) -> bool:
        """Return whether case i has the expected slope, from as many errors as it takes."""
        enough = bool(self.fitted[i].all()) or POWERS[i] > ALL_FITTED
        return enough and abs(self.slopes[i] - POWERS[i]) <= LARGEST_DEVIATION

    @property
    def rows(self) -> list[Row]:
        """A row per case, as tables show them."""
        return [
            Row(NAMES[i], tuple(errors.tolist()), self.slopes[i], self.holds(i))
            for i, errors in enumerate(self.errors)
        ]

    @property
    def violations(self) -> list[str]:
        """Broken rules, one sentence each."""
        return [
            f"{NAMES[i]}: slope {self.slopes[i]:.2f} over {self.fitted[i].sum()} steps whose "
            f"error is {CLEAR_OF_INTEGRATION:g} times the integration's, expected {POWERS[i]}"
            for i in range(len(self.errors))
            if not self.holds(i)
        ]

    @property
    def passed(self) -> bool:
        return not self.violations


def slope(steps: np.ndarray, errors: np.ndarray) -> float:
    """Fit a straight line through log `errors` over log `steps`; return its slope."""
    return float(np.polynomial.Polynomial.fit(np.log(steps), np.log(errors), 1).convert().coef[1])


def smooth_inputs(scenario: Scenario) -> dict[str, Sines]:
    """Return the inputs as smooth functions; UserError if one of them is no sum of sines."""
    for name, signal in scenario.signals.items():
        if not isinstance(signal, Sines):
            raise UserError(f"{scenario.path}: [inputs.{name}]: expected sines, which are smooth")
    return scenario.signals


def load(path: Path, model: Model) -> Problem:
    """Read a problem and its exact final state; UserError if a file is missing or wrong."""
    scenario = scenarios.load(path, model)
    if len(scenario.steps) != 1 or (len(scenario.times) - 1) % FACTORS[0]:
        raise UserError(f"{path}: [time] step: {FACTORS[0]} of it do not divide the duration")
    inputs = smooth_inputs(scenario)
    file = project.exact_state_file(path)
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        exact, largest = content["final"], content["largest"]
        usable = content["time"] == scenario.stop and exact.keys() == largest.keys()
        usable = usable and exact.keys() <= model.variables.keys()
        usable = usable and all(math.isfinite(x) for x in exact.values())
        usable = usable and all(x > 0 for x in largest.values())
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UserError(f"{file}: cannot be used: {error!r}") from error
    if not usable:
        raise UserError(f"{file}: does not belong to {path}")
    return Problem(scenario, inputs, exact, largest)


def steps_ahead(problem: Problem, with_updates: bool) -> int:
    """Count the communication steps of `study`, with intermediate update or without."""
    cases = len(ORDERS) + with_updates
    shortest = len(problem.scenario.times) - 1
    return cases * sum(shortest // factor for factor in FACTORS)


def study(
    fmu: Fmu,
    problem: Problem,
    progress: Callable[[int], object] = lambda _: None,
    updated: Fmu | None = None,
) -> Convergence:
    """Run `problem` in every case and with every communication step; UserError if an FMU fails.

    `fmu` takes all orders of input derivatives, `updated` intermediate update, if its case is
    wanted. `progress` is called with the number of steps that each run has made.
    """
    fmus = [fmu] * len(ORDERS) + ([] if updated is None else [updated])
    errors = np.empty((len(fmus), len(FACTORS)))
    for i, of_case in enumerate(fmus):
        for j, factor in enumerate(FACTORS):
            errors[i, j] = problem.final_error(final_state(of_case, problem, i, factor))
            progress((len(problem.scenario.times) - 1) // factor)
    return Convergence(problem, errors)


def final_state(fmu: Fmu, problem: Problem, case: int, factor: int) -> dict[str, float]:
    """Return the states after steps of `factor` shortest ones; case: order, or intermediate."""
    scenario = problem.scenario
    step_through = _with_updates if case == INTERMEDIATE_UPDATE else _with_derivatives
    with fmu.instance(scenario.name, list(problem.inputs) if case else ()) as instance:
        simulation.initialize(instance, scenario, scenario.tolerance)
        states = instance.reals(list(problem.exact))
        try:
            step_through(instance, problem, case, scenario.times[::factor])
            states.get()
        except FMICallException as error:
            raise instance.failure(error, f"with steps of {factor} times the shortest") from error
        return dict(zip(states.names, states.view.tolist(), strict=True))


def _with_derivatives(instance: Instance, problem: Problem, order: int, times: np.ndarray) -> None:
    """Step through, with the inputs' values and derivatives at the beginning of each step."""
    elapsed = (times - problem.scenario.start)[:-1]
    sines, names = list(problem.inputs.values()), list(problem.inputs)

    # (steps, orders, inputs)
    known = np.array([[s.derivative(elapsed, i) for s in sines] for i in range(order + 1)])
    known = known.reshape(order + 1, len(names), -1).transpose(2, 0, 1)
    inputs = instance.input_polynomials(names, order)
    for t, h, rows in zip(times, np.diff(times), known, strict=False):
        inputs.view[:] = rows
        inputs.set()
        instance.do_step(t, h)


def _with_updates(instance: Fmi3Instance, problem: Problem, _: int, times: np.ndarray) -> None:
    """Step through, with the inputs' values at the times that the FMU asks for."""
    start, sines = problem.scenario.start, list(problem.inputs.values())
    instance.input_functions(
        list(problem.inputs), lambda time: [s.derivative(time - start, 0) for s in sines]
    )
    for t, h in zip(times, np.diff(times), strict=False):
        instance.do_step(t, h)
