"""The picture of a run: joints, tracking errors, efforts, path of the end effector."""

import matplotlib as mpl
from matplotlib.figure import Figure
from rparm.models.system_figure import draw, draw_limit

from rparm.models import system_figure
from rparm.report.pages import STYLE
from rparm.systems.comparison import Outcome
from rparm.systems.ssp import Ssp

EFFORTS = (("tau1", "N·m"), ("f2", "N"))
ARM = "arm"  # the component


def figure(ssp: Ssp, outcome: Outcome) -> Figure:
    """Joints over their references, tracking errors, efforts, and the end effector's path."""
    with mpl.rc_context(STYLE):
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
