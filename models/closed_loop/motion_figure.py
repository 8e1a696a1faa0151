"""The picture of a run: joints, tracking errors, efforts, path of the end effector."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cosim.report.style import DASHED, ERRORS, MUTED, REFERENCE, RUN, STYLE
from cosim.system.comparison import Outcome
from cosim.system.ssp import Ssp

JOINTS = (("q1", "rad"), ("q2", "m"))
EFFORTS = (("tau1", "N·m"), ("f2", "N"))
REACHED = 0.999  # of a limit; from there on the limit is drawn


def distance(outcome: Outcome) -> np.ndarray:
    """Distance of the end effector from its reference, (rows,) m."""
    return np.hypot(
        *(outcome.column(f"arm.ee_{x}") - outcome.column(f"trajectory.ee_{x}_ref") for x in "xy")
    )


def figure(ssp: Ssp, outcome: Outcome) -> Figure:
    """Joints over their references, tracking errors, efforts, and the end effector's path."""
    with mpl.rc_context(STYLE):
        picture = Figure(figsize=(14, 9), layout="constrained")
        picture.get_layout_engine().set(w_pad=0.08, h_pad=0.06)
        axes = picture.subplot_mosaic(
            [["q1", "q2", "path"], ["q1_error", "q2_error", "path"], ["tau1", "f2", "distance"]],
            width_ratios=[1, 1, 1.25],
        )
        times = outcome.run.times
        for joint, unit in JOINTS:
            wanted = outcome.column(f"trajectory.{joint}_ref")
            actual = outcome.column(f"arm.{joint}")
            _draw_over(axes[joint], times, wanted, actual)
            axes[joint].set_ylabel(f"{joint} ({unit})")
            axes[f"{joint}_error"].plot(times, wanted - actual, color=ERRORS[0], linewidth=1.3)
            axes[f"{joint}_error"].set_ylabel(f"tracking error of {joint} ({unit})")
        for effort, unit in EFFORTS:
            _draw_effort(axes[effort], ssp, outcome, effort, unit)
        _draw_path(axes["path"], outcome)
        axes["distance"].plot(times, 1e3 * distance(outcome), color=ERRORS[0], linewidth=1.3)
        axes["distance"].set_ylabel("distance from the reference (mm)")
        axes["distance"].set_ylim(bottom=0.0)
        for name, panel in axes.items():
            if name != "path":
                panel.margins(x=0.02)
        for name in ("tau1", "f2", "distance"):
            axes[name].set_xlabel("time (s)")
        picture.suptitle(
            f"Closed loop, {outcome.variant}: largest distance of the end effector from its "
            f"reference {1e3 * distance(outcome).max():.3g} mm",
            x=0.015,
            ha="left",
            fontsize=15,
            weight="bold",
        )
        handles = [
            Line2D([], [], color=REFERENCE, linewidth=5, label="reference motion"),
            Line2D([], [], color=RUN, linewidth=1.3, label="arm, in Ecos"),
            Line2D([], [], color=ERRORS[0], linewidth=1.3, label="difference of the two"),
            Line2D([], [], color=MUTED, linestyle=DASHED, label="limit of the effort"),
        ]
        picture.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=9.5)
    return picture


def _draw_over(axes: Axes, x: np.ndarray, wanted: np.ndarray, actual: np.ndarray) -> None:
    axes.plot(x, wanted, color=REFERENCE, linewidth=5, solid_capstyle="round")
    axes.plot(x, actual, color=RUN, linewidth=1.3)


def _draw_effort(axes: Axes, ssp: Ssp, outcome: Outcome, effort: str, unit: str) -> None:
    values = outcome.column(f"controller.{effort}")
    axes.plot(outcome.run.times, values, color=RUN, linewidth=1.3)
    axes.set_ylabel(f"{effort} ({unit})")
    limit = ssp.system.parameter_sets[outcome.variant]["controller"].get(f"{effort}_max")
    if limit is not None:
        for sign in (1, -1):
            if (sign * values).max() >= REACHED * limit:
                axes.axhline(sign * limit, color=MUTED, linestyle=DASHED, linewidth=1.0)


def _draw_path(axes: Axes, outcome: Outcome) -> None:
    wanted = [outcome.column(f"trajectory.ee_{x}_ref") for x in "xy"]
    actual = [outcome.column(f"arm.ee_{x}") for x in "xy"]
    axes.plot(*wanted, color=REFERENCE, linewidth=5, solid_capstyle="round")
    axes.plot(*actual, color=RUN, linewidth=1.3)
    axes.plot(wanted[0][0], wanted[1][0], marker="o", markersize=8, color=RUN)
    axes.annotate(
        "start",
        (wanted[0][0], wanted[1][0]),
        (-12, 0),
        ha="right",
        va="center",
        textcoords="offset points",
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.1)
    axes.set_xlabel("x0 (m)")
    axes.set_ylabel("y0 (m)")
    axes.set_title("path of the end effector", loc="left", fontsize=11)
