"""The picture of a run: joints, errors, efforts, modes of friction, contact, path."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cosim.report.style import ERRORS, MUTED, REFERENCE, RUN, STYLE
from cosim.system.comparison import Outcome
from cosim.system.ssp import Ssp

JOINTS = (("q1", "rad", "tau1", "N·m"), ("q2", "m", "f2", "N"))
MODES = {-1: "slides back", 0: "sticks", 1: "slides forth", 2: "free"}
CARRIED = "#f4e3d3"  # while the payload is attached


def distance(outcome: Outcome) -> np.ndarray:
    """Distance of the end effector from its reference, (rows,) m."""
    return np.hypot(
        *(outcome.column(f"plant.ee_{x}") - outcome.column(f"trajectory.ee_{x}_ref") for x in "xy")
    )


def figure(ssp: Ssp, outcome: Outcome) -> Figure:
    """Joints over their references, errors, efforts, modes, wall, and the end effector's path."""
    with mpl.rc_context(STYLE):
        picture = Figure(figsize=(14, 11), layout="constrained")
        picture.get_layout_engine().set(w_pad=0.08, h_pad=0.06)
        axes = picture.subplot_mosaic(
            [
                ["q1", "q2", "path"],
                ["q1_error", "q2_error", "path"],
                ["tau1", "f2", "distance"],
                ["mode1", "mode2", "wall"],
            ],
            width_ratios=[1, 1, 1.25],
            height_ratios=[1, 1, 1, 0.8],
        )
        times = outcome.run.times
        for joint, (name, unit, effort, effort_unit) in enumerate(JOINTS, start=1):
            wanted = outcome.column(f"trajectory.{name}_ref")
            actual = outcome.column(f"plant.{name}")
            axes[name].plot(times, wanted, color=REFERENCE, linewidth=5, solid_capstyle="round")
            axes[name].plot(times, actual, color=RUN, linewidth=1.3)
            axes[name].set_ylabel(f"{name} ({unit})")
            axes[f"{name}_error"].plot(times, wanted - actual, color=ERRORS[0], linewidth=1.3)
            axes[f"{name}_error"].set_ylabel(f"tracking error of {name} ({unit})")
            axes[effort].plot(times, outcome.column(f"actuator.{effort}"), color=RUN, linewidth=1.3)
            axes[effort].set_ylabel(f"{effort} ({effort_unit})")
            _draw_mode(axes[f"mode{joint}"], times, outcome.column(f"plant.mode{joint}"), joint)
        _draw_path(axes["path"], ssp, outcome)
        axes["distance"].plot(times, 1e3 * distance(outcome), color=ERRORS[0], linewidth=1.3)
        axes["distance"].set_ylabel("distance from the reference (mm)")
        axes["distance"].set_ylim(bottom=0.0)
        axes["wall"].plot(
            times, outcome.column("environment.wall_force"), color=ERRORS[1], linewidth=1.3
        )
        axes["wall"].set_ylabel("force of the wall (N)")
        axes["wall"].set_ylim(bottom=0.0)
        attached = outcome.column("trajectory.payload_attached") != 0
        for name, panel in axes.items():
            if name != "path":
                panel.margins(x=0.02)
                _shade(panel, times, attached)
        for name in ("mode1", "mode2", "wall"):
            axes[name].set_xlabel("time (s)")
        picture.suptitle(
            f"Machine, {outcome.variant}: largest distance of the end effector from its "
            f"reference {1e3 * distance(outcome).max():.3g} mm",
            x=0.015,
            ha="left",
            fontsize=15,
            weight="bold",
        )
        handles: list[Line2D | Patch] = [
            Line2D([], [], color=REFERENCE, linewidth=5, label="reference motion"),
            Line2D([], [], color=RUN, linewidth=1.3, label="plant, in Ecos"),
            Line2D([], [], color=ERRORS[0], linewidth=1.3, label="difference of the two"),
            Line2D([], [], color=ERRORS[1], linewidth=1.3, label="wall"),
        ]
        if attached.any():
            handles.append(Patch(color=CARRIED, label="payload attached"))
        picture.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=9.5)
    return picture


def _shade(axes: Axes, times: np.ndarray, attached: np.ndarray) -> None:
    """Mark the times at which the payload is attached."""
    if attached.any():
        rows = np.flatnonzero(attached)
        axes.axvspan(times[rows[0]], times[rows[-1]], color=CARRIED, zorder=0)


def _draw_mode(axes: Axes, times: np.ndarray, mode: np.ndarray, joint: int) -> None:
    axes.step(times, mode, where="post", color=RUN, linewidth=1.0)
    axes.set_ylim(-1.4, 2.4)
    axes.set_yticks(list(MODES), list(MODES.values()))
    axes.set_title(f"friction of joint {joint}", loc="left", fontsize=11)


def _draw_path(axes: Axes, ssp: Ssp, outcome: Outcome) -> None:
    wanted = [outcome.column(f"trajectory.ee_{x}_ref") for x in "xy"]
    actual = [outcome.column(f"plant.ee_{x}") for x in "xy"]
    axes.plot(*wanted, color=REFERENCE, linewidth=5, solid_capstyle="round")
    axes.plot(*actual, color=RUN, linewidth=1.3)
    axes.plot(wanted[0][0], wanted[1][0], marker="o", markersize=8, color=RUN)
    axes.annotate(
        "start",
        (wanted[0][0], wanted[1][0]),
        (10, 0),
        ha="left",
        va="center",
        textcoords="offset points",
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.15)
    if outcome.column("environment.wall_force").any():
        _draw_wall(axes, ssp.system.parameter_sets[outcome.variant]["environment"])
    axes.set_xlabel("x0 (m)")
    axes.set_ylabel("y0 (m)")
    axes.set_title("path of the end effector", loc="left", fontsize=11)


def _draw_wall(axes: Axes, wall: dict) -> None:
    """The surface of the wall, as far as the path is wide."""
    normal = np.array([np.cos(wall["angle"]), np.sin(wall["angle"])])
    along = np.array([-normal[1], normal[0]])
    center = np.array([np.mean(axes.get_xlim()), np.mean(axes.get_ylim())])
    foot = center + (wall["position"] - normal @ center) * normal
    half = 0.5 * np.ptp(axes.get_xlim())
    ends = np.array([foot - half * along, foot + half * along])
    axes.plot(ends[:, 0], ends[:, 1], color=MUTED, linewidth=3)
