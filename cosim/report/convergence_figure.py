"""The picture of errors over the communication step."""

import math

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from cosim.convergence import CLEAR_OF_INTEGRATION, FEWEST_FITTED, NAMES, POWERS, Convergence
from cosim.report.style import DASHED, FLOOR, MUTED, STYLE, error_axis
from cosim.texts import milliseconds, short

COLORS = ("#b0435f", "#d1793a", "#2f8f83", "#1d4e79", "#7a4fa3")


def convergence_figure(convergence: Convergence) -> Figure:
    """Error of the final state over the communication step, with the slopes fitted."""
    problem, steps = convergence.problem, convergence.problem.steps
    with mpl.rc_context(STYLE):
        picture = Figure(figsize=(11, 6.8), layout="constrained")
        axes = picture.subplots()
        for i in range(len(convergence.errors)):
            used = convergence.fitted[i]
            style = {"color": COLORS[i], "markersize": 7, "linewidth": 1.8}
            errors = np.maximum(convergence.errors[i], FLOOR)
            label = f"{NAMES[i]}: slope {convergence.slopes[i]:.2f}"
            marked = {"marker": "o", "markeredgecolor": "white", "label": label}
            axes.plot(steps[used], errors[used], **style, **marked)
            rest = {"marker": "o", "markerfacecolor": "white", "linestyle": "none"}
            rest["label"] = None if used.all() else f"{NAMES[i]}: not fitted"
            axes.plot(steps[~used], errors[~used], **style, **rest)
            if used.sum() >= FEWEST_FITTED:
                _triangle(axes, steps[used], errors[used], POWERS[i], COLORS[i])
        _integration(axes, convergence)
        axes.set_xscale("log")
        axes.set_xlim(steps.min() / 1.3, steps.max() * 1.3)
        axes.xaxis.set_major_locator(FixedLocator(steps))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda step, _: milliseconds(step)))
        finite = convergence.errors[np.isfinite(convergence.errors)]
        error_axis(axes, finite.min(initial=1.0), finite.max(initial=1e-3))
        axes.set_xlabel("communication step")
        axes.set_ylabel("largest relative error of the final state")
        title = problem.scenario.title + f", tolerance {short(problem.scenario.tolerance)}"
        axes.set_title(title, loc="left", fontsize=14, weight="bold", pad=12)
        picture.legend(loc="outside right upper", labelspacing=0.8)
    return picture


def _triangle(axes: Axes, steps: np.ndarray, errors: np.ndarray, power: int, color: str) -> None:
    """A triangle with the slope `power` below the third and second last of the errors fitted."""
    right, left = steps[-3], steps[-2]
    bottom = errors[-2] / 4
    top = bottom * (right / left) ** power
    axes.plot([left, right, right, left], [bottom, bottom, top, bottom], color=color, linewidth=1.0)
    axes.annotate(
        f"{power}",
        (right, math.sqrt(bottom * top)),
        xytext=(5, 0),
        textcoords="offset points",
        va="center",
        color=color,
    )


def _integration(axes: Axes, convergence: Convergence) -> None:
    """The level above which errors count, by the integration's own error."""
    level = convergence.integration_error * CLEAR_OF_INTEGRATION
    text = f"{CLEAR_OF_INTEGRATION:g} × error of the integration"
    axes.axhline(level, color=MUTED, linestyle=DASHED, linewidth=1.2, label=text)
