"""What rparm asks of this folder: measures and picture of a run, and the study of the coupling.

rparm/systems/comparison.py says what each name means.
"""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from rparm.models.closed_loop.experiment import START, STEPS_PER_SECOND, STOP
from rparm.models.system_figure import draw, draw_limit, tracking_error

from rparm.models import system_figure
from rparm.report.pages import STYLE
from rparm.systems.comparison import Diagram, Outcome, Rest
from rparm.systems.structure import OpenedSystem

EFFORTS = (("tau1", "N·m"), ("f2", "N"))
ARM = "arm"  # the component
EXPERIMENT = (START, STOP, 1 / STEPS_PER_SECOND)
COUPLING_PICTURE = "coupling.png"

MEASURES = (tracking_error(ARM),)

DIAGRAMS = (
    Diagram("joint 1", ["arm.q1"], {"arm.q1": "trajectory.q1_ref"}),
    Diagram("joint 2", ["arm.q2"], {"arm.q2": "trajectory.q2_ref"}),
    Diagram("tracking error of joint 1", ["controller.q1_error"]),
    Diagram("tracking error of joint 2", ["controller.q2_error"]),
    Diagram("torque", ["controller.tau1"]),
    Diagram("force", ["controller.f2"]),
    Diagram(
        "end effector",
        ["arm.ee_x", "arm.ee_y"],
        {"arm.ee_x": "trajectory.ee_x_ref", "arm.ee_y": "trajectory.ee_y_ref"},
    ),
    Diagram("energy of the arm", ["arm.kinetic_energy", "arm.potential_energy"]),
)


# the arm waits at the start of its motion; the controller steps first, as coupling.md advises
REST = Rest(
    "nominal",
    ["arm.q1", "arm.q2"],
    ["arm.q1", "arm.q2", "arm.dq1", "arm.dq2"],
    {"trajectory.start_time": 1e4},
    sequence=["controller", "arm", "trajectory"],
)


def study_coupling(ssp: Path, report: Path) -> dict[str, dict[str, object]]:
    """Study what the coupling costs; see coupling.md."""
    from rparm.models.closed_loop.coupling.report import run  # only `coupling` needs it

    return run(report / COUPLING_PICTURE, ssp)


# ---- Picture of a run ----------------------------------------------------------------------------
def figure(ssp: OpenedSystem, outcome: Outcome) -> Figure:
    """Joints over their references, tracking errors, efforts, and the end effector's path."""
    with mpl.rc_context(fname=STYLE):
        picture = Figure(figsize=(14, 9), layout="constrained")
        picture.get_layout_engine().set(w_pad=0.08, h_pad=0.06)
        axes = picture.subplot_mosaic(
            [["q1", "q2", "path"], ["q1_error", "q2_error", "path"], ["tau1", "f2", "distance"]],
            width_ratios=[1, 1, 1.25],
        )
        is_limited = False
        controller = ssp.system.parameter_sets[outcome.variant]["controller"]
        for effort, unit in EFFORTS:
            values = outcome.column(f"controller.{effort}")
            draw(axes[effort], outcome.run.times, values, f"{effort} ({unit})")
            limit = controller.get(f"{effort}_max")
            if limit is not None:
                is_limited |= draw_limit(axes[effort], values, limit)
        system_figure.draw_motion(axes, outcome, ARM)
        for name in ("tau1", "f2", "distance"):
            axes[name].set_xlabel("time (s)")
        more = [system_figure.limit_entry("limit of the effort")] if is_limited else []
        system_figure.finish(picture, "Closed loop", outcome, ARM, more)
    return picture
