"""Order of convergence in the communication step, with inputs that are smooth functions of time.

A master knows its inputs at the communication points. An FMU that holds them over a step is off by
the first power of the step; with their derivatives up to order k it is off by power
k + 1. The problems are models/<model>/convergence/<name>.toml, in the format of a
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

from cosim import project, simulation
from cosim import scenario as scenarios
from cosim.errors import UserError
from cosim.fmi_instance import Instance
from cosim.fmu_file import Fmu
from cosim.model import Model
from cosim.scenario import Scenario
from cosim.signals import Sines

FACTORS = (64, 32, 16, 8, 4, 2, 1)  # communication steps, in shortest steps of the problem
ORDERS = (0, 1, 2, 3)  # of the highest input derivative that is set; 0: inputs are held
NAMES = ("inputs held", "1st derivatives", "2nd derivatives", "3rd derivatives")
LARGEST_DEVIATION = 0.2  # of a slope from the order expected
CLEAR_OF_INTEGRATION = 100.0  # an error counts from this many times the integration's own
FEWEST_FITTED = 4  # errors that a slope needs: three halvings of the step
ALL_FITTED = 2  # up to this order, the slope is that over all steps


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

    def error(self, states: dict[str, float]) -> float:
        """Largest error of the final `states`, each relative to the largest value on the way."""
        return max(abs(states[name] - self.exact[name]) / self.largest[name] for name in self.exact)


@dataclass(frozen=True)
class Row:
    """What was found with the input derivatives up to one order."""

    name: str
    errors: tuple[float, ...]  # relative, one per step
    slope: float
    holds: bool


@dataclass(frozen=True, eq=False)
class Convergence:
    """Errors of the final state over the communication step, for each order of derivatives."""

    problem: Problem
    errors: np.ndarray  # (orders, steps) relative

    @property
    def scenario(self) -> Scenario:
        """Scenario of the problem."""
        return self.problem.scenario

    @property
    def integration_error(self) -> float:
        """Estimate of what the integrator itself leaves: the error with the best known inputs.

        With the highest derivatives and the shortest step the inputs are all but exact, and the
        integrator restarts most often: what is left there bounds its error in the other runs.
        """
        return float(self.errors[-1, -1])

    @property
    def fitted(self) -> np.ndarray:
        """Which errors the slopes are fitted to, (orders, steps): those clear of integration's."""
        return self.errors >= CLEAR_OF_INTEGRATION * self.integration_error

    @cached_property
    def slopes(self) -> tuple[float, ...]:
        """Slope of log error over log step, one per order; NaN if too few errors count."""
        return tuple(
            slope(self.problem.steps[use], errors[use]) if use.sum() >= FEWEST_FITTED else math.nan
            for errors, use in zip(self.errors, self.fitted, strict=True)
        )

    def holds(self, i: int) -> bool:
        """Whether the slope of ORDERS[i] is the one expected, from as many errors as it takes."""
        enough = bool(self.fitted[i].all()) or ORDERS[i] > ALL_FITTED
        return enough and abs(self.slopes[i] - (ORDERS[i] + 1)) <= LARGEST_DEVIATION

    @property
    def rows(self) -> list[Row]:
        """A row per order, as tables show them."""
        return [
            Row(NAMES[order], tuple(self.errors[i].tolist()), self.slopes[i], self.holds(i))
            for i, order in enumerate(ORDERS)
        ]

    @property
    def violations(self) -> list[str]:
        """What is not as it should be, one sentence each."""
        return [
            f"{NAMES[order]}: slope {self.slopes[i]:.2f} over {self.fitted[i].sum()} steps whose "
            f"error is {CLEAR_OF_INTEGRATION:g} times that of the integration, expected {order + 1}"
            for i, order in enumerate(ORDERS)
            if not self.holds(i)
        ]

    @property
    def passed(self) -> bool:
        """Whether every slope is the one expected."""
        return not self.violations


def slope(steps: np.ndarray, errors: np.ndarray) -> float:
    """Slope of the straight line through log `errors` over log `steps`, by least squares."""
    return float(np.polynomial.Polynomial.fit(np.log(steps), np.log(errors), 1).convert().coef[1])


def smooth_inputs(scenario: Scenario) -> dict[str, Sines]:
    """Inputs of `scenario` as smooth functions of time.

    Raises
    ------
    UserError
        If one of them is no sum of sines.
    """
    for name, signal in scenario.signals.items():
        if not isinstance(signal, Sines):
            raise UserError(f"{scenario.path}: [inputs.{name}]: expected sines, which are smooth")
    return scenario.signals


def load(path: Path, model: Model) -> Problem:
    """Read the problem at `path` and its exact final state.

    Raises
    ------
    UserError
        If one of the two files is missing or wrong.
    """
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


def steps_ahead(problem: Problem) -> int:
    """Communication steps that `study` makes."""
    shortest = len(problem.scenario.times) - 1
    return len(ORDERS) * sum(shortest // factor for factor in FACTORS)


def study(
    fmu: Fmu, problem: Problem, progress: Callable[[int], object] = lambda _: None
) -> Convergence:
    """Run `problem` with every order of input derivatives and every communication step.

    Raises
    ------
    UserError
        If a function of the FMU fails.
    """
    errors = np.empty((len(ORDERS), len(FACTORS)))
    for i, order in enumerate(ORDERS):
        for j, factor in enumerate(FACTORS):
            errors[i, j] = problem.error(final_state(fmu, problem, order, factor))
            progress((len(problem.scenario.times) - 1) // factor)
    return Convergence(problem, errors)


def final_state(fmu: Fmu, problem: Problem, order: int, factor: int) -> dict[str, float]:
    """States at the end of a run.

    Parameters
    ----------
    fmu : Fmu
    problem : Problem
    order : int
        Highest derivative of the inputs that is set, along with all lower ones; 0: none.
    factor : int
        Communication step, in shortest steps of the problem.
    """
    scenario = problem.scenario
    with fmu.instance(scenario.name, list(problem.inputs) if order else ()) as instance:
        simulation.initialize(instance, scenario, scenario.tolerance)
        states = instance.reals(list(problem.exact))
        try:
            _step_through(instance, problem, order, factor)
            states.get()
        except FMICallException as error:
            raise instance.failure(error, f"with steps of {factor} times the shortest") from error
        return dict(zip(states.names, states.view.tolist(), strict=True))


def _step_through(instance: Instance, problem: Problem, order: int, factor: int) -> None:
    """All steps, with the inputs' values and derivatives at the beginning of each."""
    times = problem.scenario.times[::factor]
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
