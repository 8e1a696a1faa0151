"""The picture of a scenario: states on their references, errors below, then what it asks for."""

import textwrap
from collections.abc import Sequence
from itertools import cycle

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from cosim.comparison import Run
from cosim.report.style import (
    DASHED,
    ERRORS,
    FLOOR,
    LINES,
    MUTED,
    REFERENCE,
    RUN,
    STYLE,
    error_axis,
)
from cosim.scenario import Scenario
from cosim.texts import short

ERROR_WIDTHS = (2.0, 1.1, 1.1, 1.1)
SMALLEST_SPAN = 1e-9  # in the state's unit; below it a state is drawn as at rest
FAR = 10.0  # start times beyond this many durations become the zero of the time axis
FEW_ROWS = 40  # up to here each point gets a marker
HEAD_WIDTH, HEAD_LINES = 125, 2  # of the description below the title, in characters and lines
COLUMNS = 2


def scenario_figure(runs: Sequence[Run]) -> Figure:
    """Each state of the first run over its reference, and below it the errors of all `runs`.

    Below them are the scenario's own panels.
    """
    scenario = runs[0].scenario
    outputs = runs[0].result.names
    states = [name for name in runs[0].fmu.model.states if name in outputs] or outputs
    blocks = -(-len(states) // COLUMNS)
    panels = scenario.panels
    panel_rows = -(-len(panels) // COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 1.9 + 3.7 * blocks + 2.3 * panel_rows), layout="constrained")
        figure.get_layout_engine().set(w_pad=0.08, h_pad=0.05, hspace=0.02, wspace=0.04)
        axes = figure.subplots(
            2 * blocks + panel_rows,
            COLUMNS if panels else min(COLUMNS, len(states)),
            sharex=True,
            squeeze=False,
            height_ratios=[2, 1.1] * blocks + [1.9] * panel_rows,
        )
        for i, name in enumerate(states):
            block, column = divmod(i, COLUMNS)
            _draw_state(axes[2 * block, column], runs[0], name)
            _draw_errors(axes[2 * block + 1, column], runs, name)
        for i, names in enumerate(panels):
            _draw_panel(axes[2 * blocks + i // COLUMNS, i % COLUMNS], runs[0], names)
        if len(states) % COLUMNS:
            for unused in axes[2 * (blocks - 1) : 2 * blocks, len(states) % COLUMNS :].flat:
                unused.set_axis_off()
        if len(panels) % COLUMNS:
            axes[-1, -1].set_axis_off()
        for bottom in axes[-1]:
            bottom.set_xlabel(_time_label(scenario))
        figure.align_ylabels(axes)
        _head(figure, runs)
    return figure


def _head(figure: Figure, runs: Sequence[Run]) -> None:
    """Title, description and one legend for the whole picture."""
    scenario, first = runs[0].scenario, runs[0].result
    steps = f"{first.steps} step" + ("s" if first.steps > 1 else "")
    lines = textwrap.wrap(
        f"{scenario.description} ({steps})", HEAD_WIDTH, max_lines=HEAD_LINES, placeholder=" …"
    )
    # the empty lines keep the place of the description
    title = scenario.title + "\n" * (len(lines) + 1)
    figure.suptitle(title, x=0.015, ha="left", fontsize=15, weight="bold", linespacing=1.15)
    figure.text(
        0.015,
        1 - 0.44 / figure.get_figheight(),
        "\n".join(lines),
        va="top",
        color=MUTED,
        linespacing=1.4,
    )
    handles = [
        Line2D([], [], color=REFERENCE, linewidth=5, label="reference"),
        Line2D([], [], color=RUN, linewidth=1.3, label=f"FMU, tolerance {short(first.tolerance)}"),
    ]
    for run, color in zip(runs, ERRORS, strict=False):
        tolerance = short(run.result.tolerance)
        handles.append(
            Line2D([], [], color=color, linewidth=1.3, label=f"error, tolerance {tolerance}")
        )
    handles.append(Line2D([], [], color=MUTED, linestyle=DASHED, label="its bound"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=9.5)


def _draw_state(axes: Axes, run: Run, name: str) -> None:
    times = run.result.times - _origin(run.scenario)
    values = run.result.values[:, run.result.names.index(name)]
    few = len(times) <= FEW_ROWS
    axes.plot(
        times,
        run.reference.column(name),
        color=REFERENCE,
        linewidth=1.5 if few else 5,
        linestyle="dotted" if few else "solid",
        marker="o" if few else None,
        markersize=10,
        solid_capstyle="round",
    )
    axes.plot(
        times,
        values,
        color=RUN,
        linewidth=1.3,
        linestyle="none" if few else "solid",
        marker="o" if few else None,
        markersize=5,
    )
    axes.set_ylabel(f"{name} ({run.fmu.model.variables[name].unit})")
    axes.margins(x=0.02, y=0.12)
    if np.ptp(values) < SMALLEST_SPAN:
        axes.set_ylim(values[0] - 0.1, values[0] + 0.1)


def _draw_panel(axes: Axes, run: Run, names: Sequence[str]) -> None:
    """Variables of one unit: outputs over their references, Integers and inputs as steps."""
    scenario, variables = run.scenario, run.fmu.model.variables
    times = run.result.times - _origin(scenario)
    for name, (color, light) in zip(names, cycle(LINES), strict=False):
        style = {"color": color, "linewidth": 1.3, "label": name}
        if name in run.result.integers:
            # each row ends a step: so was the value there
            axes.step(times, run.result.integers[name], where="pre", **style)
            axes.yaxis.set_major_locator(MaxNLocator(integer=True))
        elif name in run.result.names:
            axes.plot(times, run.reference.column(name), color=light, linewidth=4.5)
            axes.plot(times, run.result.values[:, run.result.names.index(name)], **style)
        else:
            held = scenario.times - _origin(scenario)
            axes.step(held, scenario.input(name), where="post", linestyle=DASHED, **style)
    unit = variables[names[0]].unit
    label = names[0] if len(names) == 1 else ""
    axes.set_ylabel(f"{label} ({unit})".strip() if unit else label)
    if len(names) > 1:
        axes.legend(loc="best", fontsize=9.5, ncols=len(names))
    axes.margins(x=0.02, y=0.14)


def _draw_errors(axes: Axes, runs: Sequence[Run], name: str) -> None:
    scale = runs[0].reference.scale(name)
    largest = 0.0
    for run, color, width in zip(runs, ERRORS, ERROR_WIDTHS, strict=False):
        times = run.result.times - _origin(run.scenario)
        values = run.result.values[:, run.result.names.index(name)]
        error = np.abs(values - run.reference.column(name)) / scale
        few = len(times) <= FEW_ROWS
        axes.plot(
            times,
            np.maximum(error, FLOOR),
            color=color,
            linewidth=width,
            linestyle="none" if few else "solid",
            marker="o" if few else None,
            markersize=4 * width,
        )
        axes.axhline(run.bound, color=color, linestyle=DASHED, linewidth=1.0, alpha=0.8)
        largest = max(largest, run.bound, error[np.isfinite(error)].max(initial=0.0))
    error_axis(axes, 0.0, largest)
    axes.set_ylabel(f"error of {name}")
    axes.margins(x=0.02)


def _origin(scenario: Scenario) -> float:
    """Zero of the time axis, in s: the start, if that is far away."""
    return scenario.start if abs(scenario.start) > FAR * (scenario.stop - scenario.start) else 0.0


def _time_label(scenario: Scenario) -> str:
    if not _origin(scenario):
        return "time (s)"
    grouped = f"{scenario.start:,.12g}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    return f"time since t = {grouped} s (s)"
