"""The study of the coupling: run, printed as tables with verdicts, and drawn.

../coupling.md says what is expected.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from rparm.models.closed_loop.coupling.loop import (
    LARGEST_ERROR,
    Tracking,
    opened,
    study_tracking,
    tracking_passed,
)
from rparm.models.closed_loop.coupling.study import (
    LOCAL,
    Doubling,
    StepErrors,
    study_doubling,
    study_step_errors,
)
from rparm.models.closed_loop.study import REST

from rparm.console import PrintedTable
from rparm.files import from_here, written
from rparm.linearization import largest_step
from rparm.report.pages import DASHED, GRID, INK, MUTED, STYLE, save_figure
from rparm.units import short, verdict

COLORS = ("#d1793a", "#1d4e79", "#b0435f", "#2f8f83")


def run(path: Path, ssp: Path) -> dict[str, dict[str, object]]:
    """Make the study, print its tables, draw its picture to `path`; the numbers of each part."""
    with opened(ssp) as loop:
        with written(path):  # a place that cannot be written shows before anything has run
            path.parent.mkdir(parents=True, exist_ok=True)
        step_errors = study_step_errors(loop)
        print_step_errors(step_errors)
        tracking = study_tracking(loop)
        print_tracking(tracking)
        doubling = study_doubling(loop)
        print_doubling(doubling)
        limits = largest_step.study_steps(ssp, REST)
    with written(path):
        save_figure(figure(step_errors, tracking, doubling), path)
    print(f"\npicture: {from_here(path)}")
    return {
        "step errors": {
            "steps": step_errors.steps.tolist(),
            "errors": _by_method(step_errors, step_errors.errors),
            "energies": _by_method(step_errors, step_errors.energies),
            "passed": step_errors.passed,
        },
        "tracking": {
            "errors": {t.method.name: t.largest for t in tracking},
            "predicted": {t.method.name: float(t.predicted.max()) for t in tracking},
            "passed": tracking_passed(tracking),
        },
        "step doubling": {
            "tolerances": [d.tolerance for d in doubling],
            "errors": [d.error for d in doubling],
            "steps": [d.run.accepted for d in doubling],
            "fixed_steps": [d.fixed_steps for d in doubling],
            "passed": all(d.passed for d in doubling),
        },
        "largest steps": limits,
    }


def _by_method(study: StepErrors, values: np.ndarray) -> dict[str, list[float]]:
    names = (method.name for method in study.methods)
    return dict(zip(names, values.tolist(), strict=True))


# ---- Tables --------------------------------------------------------------------------------------
def print_step_errors(study: StepErrors) -> None:
    """Print errors and energies by method and step, with their slopes."""
    names = [method.name for method in study.methods]
    columns = {f"{1e3 * step:g} ms": 7 for step in study.steps} | {"slope": 5}
    for title, values in (
        ("error of the arm's states", study.errors),
        ("energy of the coupling, J", study.energies),
    ):
        print()
        table = PrintedTable(title, names, columns, gap=1)
        for method, row, slope in zip(study.methods, values, study.slopes(values), strict=True):
            cells = [*(short(value, 1) for value in row), f"{slope:.2f}"]
            table.row(method.name, cells, verdict(method.expects(slope)))
    table.row("calls of DoStep", [*map(str, study.calls[0]), ""])


def print_tracking(tracking: Sequence[Tracking]) -> None:
    """Print the errors of the end effector, as measured and as predicted."""
    print()
    title = f"end effector on the circle, {1e3 * tracking[0].step:g} ms"
    columns = {"measured": 11, "predicted": 11, "deviation": 9}
    table = PrintedTable(title, [t.method.name for t in tracking], columns)
    for t in tracking:
        errors = (f"{error:.3e} m" for error in (t.largest, t.predicted.max()))
        table.row(t.method.name, [*errors, f"{100 * t.deviation:.1f} %"], verdict(t.predicts))
    text = f"Jacobi below {LARGEST_ERROR:g} m, Gauss-Seidel smaller, all as predicted"
    print(f"{text}: {verdict(tracking_passed(tracking))}", flush=True)


def print_doubling(doubling: Sequence[Doubling]) -> None:
    """Print what controlled steps cost and reach, and the fixed steps with the same error."""
    names = [short(d.tolerance) for d in doubling]
    print("\nlocal errors in tolerances")
    columns = {"accepted": 8, "rejected": 8, "calls": 6, "largest local error": 11}
    table = PrintedTable(
        "step doubling", names, {**columns, "median": 6, "global error": 8}, result=0
    )
    for name, d in zip(names, doubling, strict=True):
        local = d.local.max() / d.tolerance, np.median(d.local[~d.run.limited]) / d.tolerance
        counts = map(str, (d.run.accepted, d.run.rejected, d.run.do_steps))
        table.row(name, [*counts, *(f"{x:.2f}" for x in local), f"{d.error:.2e}"])
    print("\nwith the same error")
    columns = {"steps": 6, "calls": 6, "times the steps": 9, "times the calls": 9}
    table = PrintedTable("fixed steps", names, columns)
    for name, d in zip(names, doubling, strict=True):
        more = d.fixed_steps / d.run.accepted, d.fixed_calls / d.run.do_steps
        counts = map(str, (d.fixed_steps, d.fixed_calls))
        table.row(name, [*counts, *(f"{x:.1f}" for x in more)], verdict(d.passed))


# ---- Picture -------------------------------------------------------------------------------------
def figure(study: StepErrors, tracking: Sequence[Tracking], doubling: Sequence[Doubling]) -> Figure:
    """Errors over step and calls, energy, the delays' prediction, and the controlled steps."""
    with mpl.rc_context(fname=STYLE):
        picture = Figure(figsize=(15, 8.6), layout="constrained")
        picture.get_layout_engine().set(w_pad=0.1, h_pad=0.08, hspace=0.04, wspace=0.04)
        axes = picture.subplots(2, 3)
        _by_step(axes[0, 0], study, study.errors, "Error against step")
        axes[0, 0].set_ylabel("largest relative error of the arm's states")
        _by_step(axes[0, 1], study, np.abs(study.energies), "Energy from the coupling")
        axes[0, 1].set_ylabel("|energy that the coupling adds| (J)")
        _by_calls(axes[0, 2], study)
        _delays(axes[1, 0], tracking)
        _lengths(axes[1, 1], doubling)
        _local_errors(axes[1, 2], doubling)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        picture.legend(handles, labels, loc="outside upper center", ncols=len(handles))
    return picture


def _title(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize=12, weight="bold")


def _by_step(axes: Axes, study: StepErrors, values: np.ndarray, title: str) -> None:
    for i, (method, row) in enumerate(zip(study.methods, values, strict=True)):
        label = method.name if title.startswith("Error") else None
        axes.loglog(study.steps, row, "o-", color=COLORS[i], markeredgecolor="white", label=label)
        slope = study.slopes(values)[i]
        style = {"xytext": (6, -3), "textcoords": "offset points", "color": COLORS[i]}
        axes.annotate(f"{slope:.2f}", (study.steps[0], row[0]), **style)
    axes.xaxis.set_major_locator(FixedLocator(study.steps))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda step, _: f"{1e3 * step:g}"))
    axes.set_xlim(study.steps.min() / 1.2, study.steps.max() * 1.6)
    axes.set_xlabel("communication step (ms); slopes at the right")
    _title(axes, title)


def _by_calls(axes: Axes, study: StepErrors) -> None:
    for i, row in enumerate(study.errors):
        axes.loglog(study.calls[i], row, "o-", color=COLORS[i], markeredgecolor="white")
    axes.xaxis.set_major_locator(FixedLocator(study.calls[0]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda calls, _: f"{calls:.0f}"))
    axes.set_xlabel("calls of DoStep")
    axes.set_ylabel("largest relative error of the arm's states")
    _title(axes, "Error against calls")


def _delays(axes: Axes, tracking: Sequence[Tracking]) -> None:
    colors = (COLORS[0], COLORS[1], "#7a5195")
    for t, color in zip(tracking, colors, strict=True):
        name = t.method.name.replace(", held", ", controller first")
        name = name.replace("Gauss-Seidel", "G.-S.") if "Gauss" in name else "Jacobi"
        axes.semilogy(t.times, np.maximum(t.measured, 1e-9), color=color, label=name, linewidth=2.5)
        axes.semilogy(t.times, np.maximum(t.predicted, 1e-9), color=INK, linestyle=(0, (2, 3)))
    axes.plot([], [], color=INK, linestyle=(0, (2, 3)), label="predicted by the delays")
    axes.set_ylim(3e-8, 6e-3)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("error of the end effector (m)")
    axes.legend(loc="upper left", fontsize=8.5, ncols=2)
    _title(axes, f"Circle, inputs held, {1e3 * tracking[0].step:g} ms")


def _lengths(axes: Axes, doubling: Sequence[Doubling]) -> None:
    speed = axes.twinx()
    speed.fill_between(doubling[-1].run.times, np.abs(doubling[-1].speed), color=GRID, linewidth=0)
    speed.set_ylabel("|dq1| (rad/s), shaded")
    speed.grid(False)
    axes.set_zorder(speed.get_zorder() + 1)
    axes.patch.set_visible(False)
    for d, color in zip(doubling, COLORS, strict=False):
        times, lengths = d.run.times, np.diff(d.run.times)
        label = f"tolerance {short(d.tolerance)}: {d.run.accepted} steps"
        axes.stairs(1e3 * lengths, times, color=color, baseline=None, linewidth=1.6, label=label)
    axes.set_yscale("log")
    axes.set_ylim(top=3e3)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("step (ms)")
    axes.legend(loc="upper right", fontsize=8.5)
    _title(axes, "Step doubling")


def _local_errors(axes: Axes, doubling: Sequence[Doubling]) -> None:
    for d, color in zip(doubling, COLORS, strict=False):
        error = np.maximum(d.local / d.tolerance, 1e-4)
        axes.semilogy(d.run.times[1:], error, ".", color=color, markersize=5)
        axes.semilogy(
            d.run.times[1:], np.maximum(d.run.estimates / d.tolerance, 1e-4), "_", color=color,
            alpha=0.5, markersize=4,
        )  # fmt: skip
    axes.axhline(LOCAL, color=MUTED, linestyle=DASHED, label="bound")
    axes.axhline(1, color=INK, linewidth=1.0, label="tolerance")
    axes.plot([], [], ".", color=MUTED, label="measured")
    axes.plot([], [], "_", color=MUTED, label="estimated")
    axes.set_ylim(1e-4, 20)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("local error / tolerance")
    axes.legend(loc="lower right", fontsize=8.5, ncols=2)
    _title(axes, "Local error of the accepted steps")
