"""What the pictures of systems share: a motion over its reference, in the joints and the plane."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from rparm.report.pages import DASHED, ERROR_COLORS, MUTED, REFERENCE_COLOR, RUN_COLOR
from rparm.systems.comparison import Measure, Outcome

JOINTS = (("q1", "rad"), ("q2", "m"))
REACHED = 0.999  # share of a limit


def distance(outcome: Outcome, arm: str) -> np.ndarray:
    """Distance of the end effector of the component `arm` from its reference, (rows,) m."""
    return np.hypot(
        *(outcome.column(f"{arm}.ee_{x}") - outcome.column(f"trajectory.ee_{x}_ref") for x in "xy")
    )


def tracking_error(arm: str) -> Measure:
    """Return the largest distance of the end effector from its reference."""
    return Measure(
        "tracking error",
        "mm",
        "largest distance of the end effector from its reference",
        lambda outcome: 1e3 * float(np.max(distance(outcome, arm))),
    )


def draw_motion(axes: dict[str, Axes], outcome: Outcome, arm: str) -> None:
    """Panels q1, q2, q1_error, q2_error, distance and path."""
    times = outcome.run.times
    for joint, unit in JOINTS:
        wanted = outcome.column(f"trajectory.{joint}_ref")
        actual = outcome.column(f"{arm}.{joint}")
        axes[joint].plot(times, wanted, color=REFERENCE_COLOR, linewidth=5, solid_capstyle="round")
        draw(axes[joint], times, actual, f"{joint} ({unit})")
        label = f"tracking error of {joint} ({unit})"
        draw(axes[f"{joint}_error"], times, wanted - actual, label, ERROR_COLORS[0])
    away = 1e3 * distance(outcome, arm)
    draw(axes["distance"], times, away, "distance from the reference (mm)", ERROR_COLORS[0])
    axes["distance"].set_ylim(bottom=0.0)
    _draw_path(axes["path"], outcome, arm)
    for name, panel in axes.items():
        if name != "path":
            panel.margins(x=0.02)


def draw(
    axes: Axes, times: np.ndarray, values: np.ndarray, label: str, color: str = RUN_COLOR
) -> None:
    """One signal, (rows,)."""
    axes.plot(times, values, color=color, linewidth=1.3)
    axes.set_ylabel(label)


def draw_limit(axes: Axes, values: np.ndarray, limit: float, share: float = REACHED) -> bool:
    """Draw a limit of both signs, where `values` reach this share of it; whether they do."""
    reached = [sign for sign in (1, -1) if (sign * values).max() >= share * limit]
    for sign in reached:
        axes.axhline(sign * limit, color=MUTED, linestyle=DASHED, linewidth=1.0)
    return bool(reached)


def _draw_path(axes: Axes, outcome: Outcome, arm: str) -> None:
    wanted = [outcome.column(f"trajectory.ee_{x}_ref") for x in "xy"]
    actual = [outcome.column(f"{arm}.ee_{x}") for x in "xy"]
    axes.plot(*wanted, color=REFERENCE_COLOR, linewidth=5, solid_capstyle="round")
    axes.plot(*actual, color=RUN_COLOR, linewidth=1.3)
    start = wanted[0][0], wanted[1][0]
    axes.plot(*start, marker="o", markersize=8, color=RUN_COLOR)
    axes.annotate("start", start, (-12, 0), ha="right", va="center", textcoords="offset points")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)
    axes.set_xlabel("x0 (m)")
    axes.set_ylabel("y0 (m)")
    axes.set_title("path of the end effector", loc="left", fontsize=11)


def finish(
    picture: Figure, system: str, outcome: Outcome, arm: str, more: Sequence[Line2D | Patch]
) -> None:
    error = tracking_error(arm).value(outcome)
    picture.suptitle(
        f"{system}, {outcome.variant}: largest distance of the end effector from its reference "
        f"{error:.3g} mm",
        x=0.015,
        ha="left",
        fontsize=15,
        weight="bold",
    )
    handles = [
        Line2D([], [], color=REFERENCE_COLOR, linewidth=5, label="reference motion"),
        Line2D([], [], color=RUN_COLOR, linewidth=1.3, label=f"{arm}, in Ecos"),
        Line2D([], [], color=ERROR_COLORS[0], linewidth=1.3, label="difference of the two"),
        *more,
    ]
    picture.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9.5)


def limit_entry(label: str) -> Line2D:
    return Line2D([], [], color=MUTED, linestyle=DASHED, label=label)
