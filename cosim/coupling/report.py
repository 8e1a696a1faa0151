"""The study of the coupling as tables, a picture and verdicts.

What is measured is in cosim/coupling/study.py and cosim/coupling/doubling.py, what is expected on
the page models/closed_loop/coupling.md.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from cosim import report
from cosim.coupling import study
from cosim.coupling.doubling import LOCAL, Doubling, study_doubling
from cosim.coupling.study import Convergence, Payload, Tracking
from cosim.outputs import from_here, written

LARGEST_ERROR = 1e-3  # m, of the end effector on the circle at 1 ms in Jacobi order
PREDICTED_WITHIN = 0.1  # of the measured error
PICTURE = "coupling.png"
COLORS = ("#d1793a", "#1d4e79", "#b0435f", "#2f8f83")


def run(report_folder: Path, system: Path | None = None) -> bool:
    """Make the study, print its tables, write its picture; whether all verdicts are good.

    Raises
    ------
    UserError
        If the system or a reference is missing, an FMU fails, or the picture cannot be written.
    """
    path = Path(report_folder) / PICTURE
    with study.opened(system or study.SYSTEM) as loop:
        with written(path):  # a place that cannot be written shows before anything has run
            path.parent.mkdir(parents=True, exist_ok=True)
        convergence = study.study_convergence(loop)
        show(convergence_lines(convergence))
        tracking = study.study_tracking(loop)
        show(tracking_lines(tracking))
        payload = study.study_payload(loop)
        show(payload_lines(payload))
        doubling = study_doubling(loop)
        show(doubling_lines(doubling))
    with written(path):
        report.save(figure(convergence, tracking, doubling), path)
    print(f"\npicture: {from_here(path)}")
    return (
        all(convergence.holds(i) for i in range(len(convergence.methods)))
        and tracking_passed(tracking)
        and payload.passed
        and all(d.passed for d in doubling)
    )


def show(lines: list[str]) -> None:
    """Print a table at once, a line of space before it."""
    print("", *lines, sep="\n", flush=True)


def verdict(passed: bool) -> str:
    return "passed" if passed else "FAILED"


def convergence_lines(convergence: Convergence) -> list[str]:
    """Errors, calls and energies over the step."""
    steps = "".join(f"{1e3 * step:>8g} ms" for step in convergence.steps)
    width = max(len(method.name) for method in convergence.methods)
    blocks = (
        ("error of the arm's states", convergence.errors),
        ("energy from the coupling, J", convergence.energies),
    )
    lines = []
    for title, values in blocks:
        head = f"{title:<{width}} {steps}  slope  result"
        lines += [head, "-" * len(head)]
        for i, (method, row) in enumerate(zip(convergence.methods, values, strict=True)):
            cells = "".join(f"{value:>11.2e}" for value in row)
            slope = convergence.slopes(values)[i]
            good = abs(slope - method.power) <= study.LARGEST_DEVIATION
            lines.append(f"{method.name:<{width}}  {cells}  {slope:>5.2f}  {verdict(good)}")
        lines.append("")
    calls = "".join(f"{count:>11}" for count in convergence.calls[0])
    return [*lines, f"{'calls of fmi2DoStep':<{width}}  {calls}"]


def tracking_passed(tracking: list[Tracking]) -> bool:
    """Whether the errors are small, ordered and predicted."""
    jacobi, gauss_seidel, _ = tracking
    return (
        jacobi.largest < LARGEST_ERROR
        and gauss_seidel.largest < jacobi.largest
        and all(abs(t.deviation) <= PREDICTED_WITHIN for t in tracking)
    )


def tracking_lines(tracking: list[Tracking]) -> list[str]:
    """End effector's error by order of stepping."""
    title = f"end effector on the circle, {1e3 * tracking[0].step:g} ms"
    head = f"{title:<34}  {'measured':>11}  {'predicted':>11}  deviation  result"
    lines = [head, "-" * len(head)]
    for t in tracking:
        good = verdict(abs(t.deviation) <= PREDICTED_WITHIN)
        lines.append(
            f"{t.method.name:<34}  {t.largest:>9.3e} m  {t.predicted.max():>9.3e} m"
            f"  {100 * t.deviation:>7.1f} %  {good}"
        )
    passed = tracking_passed(tracking)
    text = f"Jacobi below {LARGEST_ERROR:g} m, Gauss-Seidel smaller, all as predicted"
    return [*lines, f"{text}: {verdict(passed)}"]


def payload_lines(payload: Payload) -> list[str]:
    """Errors with a payload that the controller does not know."""
    title = "unknown payload, 1 ms, Jacobi"
    head = f"{title:<34}  {'on circle':>11}  {'held: q1':>13}  {'q2':>13}"
    lines = [head, "-" * len(head)]
    for name, largest in payload.largest.items():
        q1, q2 = payload.held[name]
        lines.append(f"{name:<34}  {largest:>9.3e} m  {q1:>9.2e} rad  {q2:>11.2e} m")
    q1, q2 = payload.theory
    lines.append(f"{'theory without integral action':<34}  {'':>11}  {q1:>9.2e} rad  {q2:>11.2e} m")
    return [*lines, f"constant as in theory, removed: {verdict(payload.passed)}"]


def doubling_lines(doubling: list[Doubling]) -> list[str]:
    """Step doubling against fixed steps."""
    head = (
        "step doubling, tolerance  accepted  rejected  calls  largest/median local error  "
        "global error  fixed: steps   calls  fewer steps, calls  result"
    )
    lines = [head, "-" * len(head)]
    for d in doubling:
        local = d.local.max() / d.tolerance, np.median(d.local[~d.run.limited]) / d.tolerance
        fewer = d.fixed_steps / d.run.accepted, d.fixed_calls / d.run.do_steps
        ratio = f"{local[0]:.2f} / {local[1]:.2f} tolerance"
        lines.append(
            f"{report.short(d.tolerance):>24}  {d.run.accepted:>8}  {d.run.rejected:>8}"
            f"  {d.run.do_steps:>5}  {ratio:>26}  {d.error:>12.2e}"
            f"  {d.fixed_steps:>12}  {d.fixed_calls:>6}  {fewer[0]:>11.1f}, {fewer[1]:>5.1f}"
            f"  {verdict(d.passed)}"
        )
    return lines


def figure(convergence: Convergence, tracking: list[Tracking], doubling: list[Doubling]) -> Figure:
    """Errors over step and calls, energy, the delays' prediction, and the controlled steps."""
    with mpl.rc_context(report.STYLE):
        picture = Figure(figsize=(15, 8.6), layout="constrained")
        picture.get_layout_engine().set(w_pad=0.1, h_pad=0.08, hspace=0.04, wspace=0.04)
        axes = picture.subplots(2, 3)
        _by_step(axes[0, 0], convergence, convergence.errors, "Error against step")
        axes[0, 0].set_ylabel("largest relative error of the arm's states")
        _by_step(axes[0, 1], convergence, np.abs(convergence.energies), "Energy from the coupling")
        axes[0, 1].set_ylabel("|energy that the coupling adds| (J)")
        _by_calls(axes[0, 2], convergence)
        _delays(axes[1, 0], tracking)
        _lengths(axes[1, 1], doubling)
        _local_errors(axes[1, 2], doubling)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        picture.legend(handles, labels, loc="outside upper center", ncols=len(handles))
    return picture


def _title(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize=12, weight="bold")


def _by_step(axes: Axes, convergence: Convergence, values: np.ndarray, title: str) -> None:
    for i, (method, row) in enumerate(zip(convergence.methods, values, strict=True)):
        label = method.name if title.startswith("Error") else None
        axes.loglog(
            convergence.steps, row, "o-", color=COLORS[i], markeredgecolor="white", label=label
        )
        slope = convergence.slopes(values)[i]
        axes.annotate(
            f"{slope:.2f}",
            (convergence.steps[0], row[0]),
            xytext=(6, -3),
            textcoords="offset points",
            color=COLORS[i],
        )
    axes.xaxis.set_major_locator(FixedLocator(convergence.steps))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda step, _: f"{1e3 * step:g}"))
    axes.set_xlim(convergence.steps.min() / 1.2, convergence.steps.max() * 1.6)
    axes.set_xlabel("communication step (ms); slopes at the right")
    _title(axes, title)


def _by_calls(axes: Axes, convergence: Convergence) -> None:
    for i, row in enumerate(convergence.errors):
        axes.loglog(convergence.calls[i], row, "o-", color=COLORS[i], markeredgecolor="white")
    axes.xaxis.set_major_locator(FixedLocator(convergence.calls[0]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda calls, _: f"{calls:.0f}"))
    axes.set_xlabel("calls of fmi2DoStep")
    axes.set_ylabel("largest relative error of the arm's states")
    _title(axes, "Error against calls")


def _delays(axes: Axes, tracking: list[Tracking]) -> None:
    colors = (COLORS[0], COLORS[1], "#7a5195")
    for t, color in zip(tracking, colors, strict=True):
        name = t.method.name.replace(", held", ", controller first")
        name = name.replace("Gauss-Seidel", "G.-S.") if "Gauss" in name else "Jacobi"
        axes.semilogy(t.times, np.maximum(t.measured, 1e-9), color=color, label=name, linewidth=2.5)
        axes.semilogy(
            t.times, np.maximum(t.predicted, 1e-9), color=report.INK, linestyle=(0, (2, 3))
        )
    axes.plot([], [], color=report.INK, linestyle=(0, (2, 3)), label="predicted by the delays")
    axes.set_ylim(3e-8, 6e-3)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("error of the end effector (m)")
    axes.legend(loc="upper left", fontsize=8.5, ncols=2)
    _title(axes, f"Circle, inputs held, {1e3 * tracking[0].step:g} ms")


def _lengths(axes: Axes, doubling: list[Doubling]) -> None:
    speed = axes.twinx()
    speed.fill_between(
        doubling[-1].run.times, np.abs(doubling[-1].speed), color=report.GRID, linewidth=0
    )
    speed.set_ylabel("|dq1| (rad/s), shaded")
    speed.grid(False)
    axes.set_zorder(speed.get_zorder() + 1)
    axes.patch.set_visible(False)
    for d, color in zip(doubling, COLORS, strict=False):
        times, lengths = d.run.times, np.diff(d.run.times)
        label = f"tolerance {report.short(d.tolerance)}: {d.run.accepted} steps"
        axes.stairs(1e3 * lengths, times, color=color, baseline=None, linewidth=1.6, label=label)
    axes.set_yscale("log")
    axes.set_ylim(top=3e3)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("step (ms)")
    axes.legend(loc="upper right", fontsize=8.5)
    _title(axes, "Step doubling")


def _local_errors(axes: Axes, doubling: list[Doubling]) -> None:
    for d, color in zip(doubling, COLORS, strict=False):
        error = np.maximum(d.local / d.tolerance, 1e-4)
        axes.semilogy(d.run.times[1:], error, ".", color=color, markersize=5)
        axes.semilogy(
            d.run.times[1:], np.maximum(d.run.estimates / d.tolerance, 1e-4), "_", color=color,
            alpha=0.5, markersize=4,
        )  # fmt: skip
    axes.axhline(LOCAL, color=report.MUTED, linestyle=report.DASHED, label="bound")
    axes.axhline(1, color=report.INK, linewidth=1.0, label="tolerance")
    axes.plot([], [], ".", color=report.MUTED, label="measured")
    axes.plot([], [], "_", color=report.MUTED, label="estimated")
    axes.set_ylim(1e-4, 20)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("local error / tolerance")
    axes.legend(loc="lower right", fontsize=8.5, ncols=2)
    _title(axes, "Local error of the accepted steps")
