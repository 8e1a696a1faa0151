"""Order of convergence in the communication step, with inputs that are smooth functions of time.

A master knows its inputs at the communication points. A unit that holds them over a step is off by
the first power of the step; with their derivatives up to order k (fmi2SetRealInputDerivatives) it
is off by power k + 1. The problems are models/<model>/convergence/<name>.toml, in the format of a
scenario; the exact final state of each is models/<model>/references/<name>/exact.json.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import matplotlib as mpl
import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from cosim import report, variables
from cosim import scenario as scenarios
from cosim.errors import UserError
from cosim.report import Section
from cosim.scenario import Scenario
from cosim.unit import Fmu, Instance

FACTORS = (64, 32, 16, 8, 4, 2, 1)  # communication steps, in shortest steps of the problem
ORDERS = (0, 1, 2, 3)  # of the highest input derivative that is set; 0: inputs are held
LARGEST_DEVIATION = 0.2  # of a slope from the order expected
CLEAR_OF_INTEGRATION = 100.0  # an error counts from this many times the integration's own
FEWEST_FITTED = 4  # errors that a slope needs: three halvings of the step
ALL_FITTED = 2  # up to this order, the slope is that over all steps

COLORS = ("#b0435f", "#d1793a", "#2f8f83", "#1d4e79")
NAMES = ("inputs held", "1st derivatives", "2nd derivatives", "3rd derivatives")


@dataclass(frozen=True)
class Sines:
    """A smooth input: offset + sum of amplitude sin(2 pi frequency t + phase)."""

    offset: float
    terms: tuple[tuple[float, float, float], ...]  # amplitude, frequency (Hz), phase (rad)

    def derivative(self, times: np.ndarray, order: int) -> np.ndarray:
        """Derivative of an order (0: the value) at `times`, s since the start; rounded once."""
        pi = np.arctan2(np.longdouble(0), np.longdouble(-1))
        t = np.asarray(times, dtype=np.longdouble)
        total = np.full(t.shape, self.offset if order == 0 else 0.0, t.dtype)
        for amplitude, frequency, phase in self.terms:
            omega = 2 * pi * np.longdouble(frequency)
            total += amplitude * omega**order * np.sin(omega * t + phase + order * pi / 2)
        return total.astype(np.float64)


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
        """Slope of log error over log step, one per order; NaN where too few errors count."""
        return tuple(
            slope(self.problem.steps[use], errors[use]) if use.sum() >= FEWEST_FITTED else math.nan
            for errors, use in zip(self.errors, self.fitted, strict=True)
        )

    def holds(self, i: int) -> bool:
        """Whether the slope of ORDERS[i] is the one expected, from as many errors as it takes."""
        enough = bool(self.fitted[i].all()) or ORDERS[i] > ALL_FITTED
        return enough and abs(self.slopes[i] - (ORDERS[i] + 1)) <= LARGEST_DEVIATION

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


def find_all(root: Path) -> list[Path]:
    """All problems below `root`/models."""
    return sorted(Path(root).glob("models/*/convergence/*.toml"))


def read_inputs(scenario: Scenario) -> dict[str, Sines]:
    """Inputs of `scenario` as functions of time.

    Raises
    ------
    UserError
        If one of them is no sum of sines.
    """
    inputs = {}
    for name, table in variables.read_toml(scenario.path)["inputs"].items():
        if "sines" not in table:
            raise UserError(f"{scenario.path}: [inputs.{name}]: expected sines, which are smooth")
        terms = ((s["amplitude"], s["frequency"], s.get("phase", 0.0)) for s in table["sines"])
        inputs[name] = Sines(table.get("offset", 0.0), tuple(terms))
    return inputs


def load(path: Path) -> Problem:
    """Read the problem at `path` and its exact final state.

    Raises
    ------
    UserError
        If one of the two files is missing or wrong.
    """
    scenario = scenarios.load(path)
    if len(scenario.steps) != 1 or (len(scenario.times) - 1) % FACTORS[0]:
        raise UserError(f"{path}: [time] step: {FACTORS[0]} of it do not divide the duration")
    inputs = read_inputs(scenario)
    file = scenario.reference_folder / "exact.json"
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        exact, largest = content["final"], content["largest"]
        usable = content["time"] == scenario.stop and exact.keys() == largest.keys()
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
    names = list(problem.exact)
    with Instance(fmu, problem.scenario.name) as instance:
        instance.initialize(problem.scenario, problem.scenario.tolerance)
        references, values, view = instance.buffers(names)
        try:
            _step_through(instance, problem, order, factor)
            instance.slave.fmi2GetReal(instance.slave.component, references, len(names), values)
        except FMICallException as error:
            raise instance.failure(error, f"with steps of {factor} times the shortest") from error
        return dict(zip(names, view.tolist(), strict=True))


def _step_through(instance: Instance, problem: Problem, order: int, factor: int) -> None:
    """All steps, with the inputs' values and derivatives at the beginning of each."""
    slave, component, scenario = instance.slave, instance.slave.component, problem.scenario
    times = scenario.times[::factor]
    elapsed = (times - scenario.start)[:-1]
    sines = list(problem.inputs.values())
    names = list(problem.inputs)
    n, k = len(names), len(names) * order

    # by order, and within an order by input
    known = np.array([[s.derivative(elapsed, i) for s in sines] for i in range(order + 1)])
    known = known.reshape(n * (order + 1), -1).T
    references, values, view = instance.buffers(names)
    references_of_derivatives, derivatives, view_of_derivatives = instance.buffers(names * order)
    orders = (fmi2.fmi2Integer * k)(*np.repeat(np.arange(1, order + 1), n).tolist())
    for t, h, row in zip(times, np.diff(times), known, strict=False):
        view[:] = row[:n]
        slave.fmi2SetReal(component, references, n, values)
        if k:
            view_of_derivatives[:] = row[n:]
            slave.fmi2SetRealInputDerivatives(
                component, references_of_derivatives, k, orders, derivatives
            )
        slave.fmi2DoStep(component, t, h, fmi2.fmi2True)


# ---- What is printed, and what the report shows ------------------------------------------------


def lines(convergence: Convergence) -> list[str]:
    """Table of the errors as text, and what is wrong with them."""
    width = max(map(len, (convergence.scenario.name, *NAMES)))
    head = convergence.scenario.name.ljust(width)
    head += "".join(f" {_milliseconds(step):>8}" for step in convergence.problem.steps)
    head += "   slope  result"
    rows = [
        NAMES[order].ljust(width)
        + "".join(f" {error:>8.1e}" for error in convergence.errors[i])
        + f"  {convergence.slopes[i]:>6.2f}  "
        + ("passed" if convergence.holds(i) else "FAILED")
        for i, order in enumerate(ORDERS)
    ]
    notes = [f"{convergence.scenario.name}: {text}" for text in convergence.violations]
    return [head, "-" * len(head), *rows, *notes]


def section(convergence: Convergence, name: str = "convergence") -> Section:
    """Table and picture, `name`.png, for the report."""
    steps = [_milliseconds(step) for step in convergence.problem.steps]
    rows = [
        [
            NAMES[order],
            *(f"{error:.1e}" for error in convergence.errors[i]),
            f"{convergence.slopes[i]:.2f}",
            report.verdict(convergence.holds(i)),
        ]
        for i, order in enumerate(ORDERS)
    ]
    return Section(
        name=name,
        title="Error against communication step",
        head=["known of the inputs", *steps, "slope", "result"],
        rows=rows,
        notes=convergence.violations,
        figure=figure(convergence),
        alternative="Error of the final state over the communication step",
    )


def figure(convergence: Convergence) -> Figure:
    """Error of the final state over the communication step, with the slopes fitted."""
    problem, steps = convergence.problem, convergence.problem.steps
    with mpl.rc_context(report.STYLE):
        picture = Figure(figsize=(11, 6.8), layout="constrained")
        axes = picture.subplots()
        for i, order in enumerate(ORDERS):
            used = convergence.fitted[i]
            style = {"color": COLORS[i], "markersize": 7, "linewidth": 1.8}
            errors = np.maximum(convergence.errors[i], report.FLOOR)
            label = f"{NAMES[order]}: slope {convergence.slopes[i]:.2f}"
            marked = {"marker": "o", "markeredgecolor": "white", "label": label}
            axes.plot(steps[used], errors[used], **style, **marked)
            rest = {"marker": "o", "markerfacecolor": "white", "linestyle": "none"}
            rest["label"] = None if used.all() else f"{NAMES[order]}: not fitted"
            axes.plot(steps[~used], errors[~used], **style, **rest)
            if used.sum() >= FEWEST_FITTED:
                _triangle(axes, steps[used], errors[used], order + 1, COLORS[i])
        _integration(axes, convergence)
        axes.set_xscale("log")
        axes.set_xlim(steps.min() / 1.3, steps.max() * 1.3)
        axes.xaxis.set_major_locator(FixedLocator(steps))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda step, _: _milliseconds(step)))
        finite = convergence.errors[np.isfinite(convergence.errors)]
        report.error_axis(axes, finite.min(initial=1.0), finite.max(initial=1e-3))
        axes.set_xlabel("communication step")
        axes.set_ylabel("largest relative error of the final state")
        title = problem.scenario.title + f", tolerance {report.short(problem.scenario.tolerance)}"
        axes.set_title(title, loc="left", fontsize=14, weight="bold", pad=12)
        picture.legend(loc="outside right upper", labelspacing=0.8)
    return picture


def _triangle(axes: Axes, steps: np.ndarray, errors: np.ndarray, order: int, color: str) -> None:
    """A triangle with the slope `order` below the third and second last of the errors fitted."""
    right, left = steps[-3], steps[-2]
    bottom = errors[-2] / 4
    top = bottom * (right / left) ** order
    axes.plot([left, right, right, left], [bottom, bottom, top, bottom], color=color, linewidth=1.0)
    axes.annotate(
        f"{order}",
        (right, math.sqrt(bottom * top)),
        xytext=(5, 0),
        textcoords="offset points",
        va="center",
        color=color,
    )


def _integration(axes: Axes, convergence: Convergence) -> None:
    """The integration's own error, and from where on errors count."""
    level = convergence.integration_error * CLEAR_OF_INTEGRATION
    text = f"{CLEAR_OF_INTEGRATION:g} × error of the integration"
    axes.axhline(level, color=report.MUTED, linestyle=report.DASHED, linewidth=1.2, label=text)


def _milliseconds(step: float) -> str:
    return f"{1e3 * step:.6g} ms"
