"""Pictures of the closed loop's runs and a page that shows them."""

import html
from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cosim.files import write_csv
from cosim.outputs import whole
from cosim.report import (
    DASHED,
    ERRORS,
    MUTED,
    PAGE,
    REFERENCE,
    RUN,
    STYLE,
    save,
    short,
    table,
    verdict,
)
from cosim.system.runs import BOUND, Outcome
from cosim.system.ssp import Ssp

JOINTS = (("q1", "rad"), ("q2", "m"))
EFFORTS = (("tau1", "N·m"), ("f2", "N"))
REACHED = 0.999  # of a limit; from there on the limit is drawn


def remove(folder: Path, variants: Sequence[str]) -> None:
    """Remove what an earlier run left of these variants, and the page that shows it."""
    (folder / "index.html").unlink(missing_ok=True)
    for variant in variants:
        for suffix in (".csv", ".png"):
            (folder / f"{variant}{suffix}").unlink(missing_ok=True)


def write_run(folder: Path, ssp: Ssp, outcome: Outcome) -> None:
    """Write the picture and all recorded values of a run; a file is complete or not there."""
    folder.mkdir(parents=True, exist_ok=True)
    run = outcome.run
    save(figure(ssp, outcome), folder / f"{outcome.variant}.png")
    write_csv(folder / f"{outcome.variant}.csv", run.times, run.names, run.values)


def write_page(folder: Path, ssp: Ssp, outcomes: Sequence[Outcome]) -> Path:
    """Write index.html over the runs of `write_run`; return its path."""
    index = folder / "index.html"
    with whole(index) as path:
        path.write_text(_page(ssp, outcomes), encoding="utf-8")
    return index


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
        axes["distance"].plot(times, 1e3 * outcome.distance, color=ERRORS[0], linewidth=1.3)
        axes["distance"].set_ylabel("distance from the reference (mm)")
        axes["distance"].set_ylim(bottom=0.0)
        for name, panel in axes.items():
            if name != "path":
                panel.margins(x=0.02)
        for name in ("tau1", "f2", "distance"):
            axes[name].set_xlabel("time (s)")
        picture.suptitle(
            f"Closed loop, {outcome.variant}: largest distance of the end effector from its "
            f"reference {1e3 * outcome.distance.max():.3g} mm",
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


def _page(ssp: Ssp, outcomes: Sequence[Outcome]) -> str:
    system = ssp.system
    head = ["variant", "steps", "error", "bound", "worst variable", "tracking error"]
    head += ["wall time", "result"]
    rows, figures = [], []
    for outcome in outcomes:
        name = html.escape(outcome.variant, quote=True)
        rows.append(
            [
                f'<a href="#{name}">{name}</a>',
                str(system.steps),
                f"{outcome.error:.2e}",
                short(BOUND),
                html.escape(outcome.worst),
                f"{1e3 * outcome.distance.max():.3g} mm",
                f"{outcome.run.wall_time:.3f} s",
                verdict(outcome.passed),
            ]
        )
        figures.append(
            f'<figure id="{name}"><img src="{name}.png" alt="{name}: joints, tracking errors, '
            f'efforts, path of the end effector">\n<figcaption>All values: '
            f'<a href="{name}.csv">{name}.csv</a></figcaption></figure>'
        )
    intro = (
        f"<p>Run by Ecos with steps of {1e3 * system.step:g} ms. Error: largest difference of any "
        "variable from the reference of Ecos's order, relative to the variable's largest value. "
        "Tracking error: largest distance of the end effector from its reference.</p>"
    )
    return PAGE.format(
        title=html.escape(f"{ssp.path.stem}: runs against their references"),
        body="\n".join([intro, table(head, rows), *figures]),
    )
