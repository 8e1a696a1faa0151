"""Measures and picture of the machine, by the names of rparm/systems/comparison.py."""

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rparm.models.machine.experiment import START, STEPS_PER_SECOND, STOP
from rparm.models.system_figure import draw, draw_limit, tracking_error

from rparm.models import system_figure
from rparm.report.pages import ERROR_COLORS, MUTED, RUN_COLOR, STYLE
from rparm.systems.comparison import Diagram, Measure, Outcome, Rest
from rparm.systems.structure import OpenedSystem

EFFORTS = (("tau1", "N·m"), ("f2", "N"))
MOTORS = (("current", "A"), ("voltage", "V"))
MODES = {-1: "slides back", 0: "sticks", 1: "slides forth", 2: "free"}
CARRIED = "#f4e3d3"  # while the payload is attached
NEAR = 0.3  # share of a limit of a motor; from there on the limit is drawn
ARM = "plant"  # the component
EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)


def contact_force(outcome: Outcome) -> float:
    """Return the largest force of the wall, N."""
    return float(np.max(outcome.column("environment.wall_force")))


def stuck(outcome: Outcome) -> float:
    """Share of the time for which joint 1 sticks, %."""
    return 100 * float(np.mean(outcome.column("plant.mode1") == 0))


MEASURES = (
    tracking_error(ARM),
    Measure("contact force", "N", "largest force of the wall", contact_force),
    Measure("stuck", "%", "share of the time for which friction holds joint 1", stuck),
)

# in the order in which signals flow
DIAGRAMS = (
    Diagram("joint 1", ["plant.q1"], {"plant.q1": "trajectory.q1_ref"}),
    Diagram("joint 2", ["plant.q2"], {"plant.q2": "trajectory.q2_ref"}),
    Diagram("measured velocity of joint 1", ["sensor.dq1_measured", "plant.dq1"]),
    Diagram("measured velocity of joint 2", ["sensor.dq2_measured", "plant.dq2"]),
    Diagram("tracking error of joint 1", ["controller.q1_error"]),
    Diagram("tracking error of joint 2", ["controller.q2_error"]),
    Diagram("torque: wanted, of the motor", ["controller.tau1", "actuator.tau1"]),
    Diagram("force: wanted, of the motor", ["controller.f2", "actuator.f2"]),
    Diagram("currents of the motors", ["actuator.current1", "actuator.current2"]),
    Diagram("voltages of the motors", ["actuator.voltage1", "actuator.voltage2"]),
    Diagram("modes of friction", ["plant.mode1", "plant.mode2"]),
    Diagram("force of the wall", ["environment.wall_force"]),
    Diagram("wrench at the end effector", ["environment.ee_fx", "environment.ee_fy"]),
    Diagram("payload attached", ["trajectory.payload_attached"]),
)

# friction would hold it
REST = Rest(
    "wall_contact",
    ["plant.q1", "plant.q2"],
    ["plant.q1", "plant.q2", "plant.dq1", "plant.dq2"],
    {"trajectory.start_time": 1e4}
    | {f"plant.{k}_friction{i}": 0.0 for k in ("coulomb", "breakaway") for i in (1, 2)},
    without=["sensor"],
)


# ---- Picture of a run ----------------------------------------------------------------------------
def figure(ssp: OpenedSystem, outcome: Outcome) -> Figure:
    """Joints over their references, errors, efforts, modes, motors, wall, and the path."""
    with mpl.rc_context(fname=STYLE):
        picture = Figure(figsize=(14, 14), layout="constrained")
        picture.get_layout_engine().set(w_pad=0.08, h_pad=0.06)
        axes = picture.subplot_mosaic(
            [
                ["q1", "q2", "path"],
                ["q1_error", "q2_error", "path"],
                ["tau1", "f2", "distance"],
                ["current1", "current2", "wall"],
                ["voltage1", "voltage2", "wall"],
                ["mode1", "mode2", "wall"],
            ],
            width_ratios=[1, 1, 1.25],
            height_ratios=[1, 1, 1, 0.8, 0.8, 0.8],
        )
        times = outcome.run.times
        for effort, unit in EFFORTS:
            draw(axes[effort], times, outcome.column(f"actuator.{effort}"), f"{effort} ({unit})")
        is_limited = False
        for joint in (1, 2):
            is_limited |= _draw_motor(axes, ssp, outcome, joint)
            _draw_mode(axes[f"mode{joint}"], times, outcome.column(f"plant.mode{joint}"), joint)
        force = outcome.column("environment.wall_force")
        draw(axes["wall"], times, force, "force of the wall (N)", ERROR_COLORS[1])
        axes["wall"].set_ylim(bottom=0.0)
        system_figure.draw_motion(axes, outcome, ARM)
        if force.any():
            _draw_wall(axes["path"], ssp.system.parameter_sets[outcome.variant]["environment"])
        attached = outcome.column("trajectory.payload_attached") != 0
        for name, panel in axes.items():
            if name != "path" and attached.any():
                carried = times[attached]
                panel.axvspan(carried[0], carried[-1], color=CARRIED, zorder=0)
        for name in ("mode1", "mode2", "wall"):
            axes[name].set_xlabel("time (s)")
        more: list[Line2D | Patch] = [
            Line2D([], [], color=ERROR_COLORS[1], linewidth=1.3, label="wall")
        ]
        if is_limited:
            more.append(system_figure.limit_entry("limit of the motor"))
        if attached.any():
            more.append(Patch(color=CARRIED, label="payload attached"))
        system_figure.finish(picture, "Machine", outcome, ARM, more)
    return picture


def _draw_motor(axes: dict[str, Axes], ssp: OpenedSystem, outcome: Outcome, joint: int) -> bool:
    """Current and voltage of a motor; whether one of them is near its limit."""
    is_limited = False
    values = ssp.models["actuator"].start_values
    values = values | ssp.system.parameter_sets[outcome.variant]["actuator"]
    for kind, unit in MOTORS:
        name = f"{kind}{joint}"
        shown = outcome.column(f"actuator.{name}")
        draw(axes[name], outcome.run.times, shown, f"{name} ({unit})")
        limit = float(values[f"{kind}_max{joint}"])
        is_limited |= draw_limit(axes[name], shown, limit, NEAR)
        axes[name].set_title(f"limit: ±{limit:g} {unit}", loc="left", fontsize=11)
    return is_limited


def _draw_mode(axes: Axes, times: np.ndarray, mode: np.ndarray, joint: int) -> None:
    axes.step(times, mode, where="post", color=RUN_COLOR, linewidth=1.0)
    axes.set_ylim(-1.4, 2.4)
    axes.set_yticks(list(MODES), list(MODES.values()))
    axes.set_title(f"friction of joint {joint}", loc="left", fontsize=11)


def _draw_wall(axes: Axes, wall: dict) -> None:
    """The surface of the wall, as far as the path is wide."""
    normal = np.array([np.cos(wall["angle"]), np.sin(wall["angle"])])
    along = np.array([-normal[1], normal[0]])
    center = np.array([np.mean(axes.get_xlim()), np.mean(axes.get_ylim())])
    foot = center + (wall["position"] - normal @ center) * normal
    half = 0.5 * np.ptp(axes.get_xlim())
    ends = np.array([foot - half * along, foot + half * along])
    axes.plot(ends[:, 0], ends[:, 1], color=MUTED, linewidth=3)
