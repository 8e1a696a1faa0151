"""Pictures of runs and a page that shows them."""

import html
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from cosim import reference
from cosim.accuracy import Run, Sweep
from cosim.files import write_csv
from cosim.outputs import whole
from cosim.scenario import Scenario

INK, MUTED, GRID = "#22303c", "#6b7885", "#e3e8ec"
REFERENCE, RUN = "#a9c5de", "#1d4e79"
ERRORS = ("#d1793a", "#2f8f83", "#7a5195", "#8a8d3f")
SWEEPS = (
    *("#1d4e79", "#d1793a", "#2f8f83", "#7a5195", "#c2a33a", "#b0435f"),
    *("#5b9bd5", "#7d6b5d", "#5f9e3e", "#d77fb0", "#3c4650", "#a9b13a"),
)
MARKERS = "osD^v"
ERROR_WIDTHS = (2.0, 1.1, 1.1, 1.1)

FLOOR_DECADE, TICK_DECADES = -18, 3
FLOOR = 10.0**FLOOR_DECADE  # errors below it, 0 among them, are drawn here; no double is that good
SMALLEST_SPAN = 1e-9  # in the state's unit; below it a state is drawn as at rest
FAR = 10.0  # start times beyond this many durations become the zero of the time axis
FEW_ROWS = 40  # up to here each point gets a marker
DASHED = (0, (5, 3))
HEAD_WIDTH, HEAD_LINES = 125, 2  # of the description below the title, in characters and lines
COLUMNS = 2

STYLE = {
    "font.size": 10,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.formatter.useoffset": False,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "legend.frameon": False,
    "figure.facecolor": "white",
    "savefig.dpi": 130,
}

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #22303c; max-width: 66rem; margin: 2rem auto;
  padding: 0 1rem; }}
table {{ border-collapse: collapse; font-size: .9rem; font-variant-numeric: tabular-nums; }}
.wide {{ overflow-x: auto; }}
th, td {{ padding: .2rem .55rem; text-align: right; white-space: nowrap;
  border-bottom: 1px solid #e3e8ec; }}
th:first-child, td:first-child, td:last-child, th:last-child {{ text-align: left; }}
.failed {{ color: #b3261e; font-weight: 600; }}
figure {{ margin: 3rem 0; }}
figcaption {{ color: #6b7885; }}
img {{ max-width: 100%; height: auto; }}
a {{ color: #1d4e79; }}
</style>
</head>
<body>
<h1>{title}</h1>
{body}
</body>
</html>
"""


@dataclass(frozen=True, eq=False)
class Section:
    """A further part of the page: a table and a picture, made elsewhere."""

    name: str  # of the picture's file
    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]  # cells in HTML
    notes: Sequence[str]  # what is wrong
    figure: Figure
    alternative: str  # text in place of the picture


def write(
    folder: Path,
    runs: Sequence[Run],
    sweeps: Sequence[Sweep],
    progress: Callable[[int], object] = lambda _: None,
    sections: Sequence[Section] = (),
) -> Path:
    """Write index.html and all pictures and results to `folder`; return the path of index.html.

    Parameters
    ----------
    folder : Path
        Made where it is missing; other files in it are left alone.
    runs : sequence of Run
        The first one of each scenario is drawn against the reference.
    sweeps : sequence of Sweep
        May be empty.
    progress : callable, optional
        Called with 1 after each of `runs`.
    sections : sequence of Section, optional
        Shown behind the sweeps.
    """
    folder.mkdir(parents=True, exist_ok=True)
    grouped: dict[str, list[Run]] = {}
    for run in runs:
        grouped.setdefault(run.scenario.name, []).append(run)
    for name, group in grouped.items():
        save(scenario_figure(group), folder / f"{name}.png")
        result = group[0].result
        write_csv(folder / f"{name}.csv", result.times, result.names, result.values)
        progress(len(group))
    if sweeps:
        save(accuracy_figure(sweeps), folder / "accuracy.png")
    for section in sections:
        save(section.figure, folder / f"{section.name}.png")
    index = folder / "index.html"
    with whole(index) as path:
        path.write_text(_page(grouped, sweeps, sections), encoding="utf-8")
    return index


def scenario_figure(runs: Sequence[Run]) -> Figure:
    """Each state of the first run over its reference, and below it the errors of all `runs`."""
    scenario = runs[0].scenario
    outputs = runs[0].result.names
    states = [name for name in runs[0].fmu.states if name in outputs] or outputs
    blocks = -(-len(states) // COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 1.9 + 3.7 * blocks), layout="constrained")
        figure.get_layout_engine().set(w_pad=0.08, h_pad=0.05, hspace=0.02, wspace=0.04)
        axes = figure.subplots(
            2 * blocks,
            min(COLUMNS, len(states)),
            sharex=True,
            squeeze=False,
            height_ratios=[2, 1.1] * blocks,
        )
        for i, name in enumerate(states):
            block, column = divmod(i, COLUMNS)
            _draw_state(axes[2 * block, column], runs[0], name)
            _draw_errors(axes[2 * block + 1, column], runs, name)
        for unused in axes.T.ravel()[len(states) * 2 :] if len(states) % COLUMNS else ():
            unused.set_axis_off()
        for bottom in axes[-1]:
            bottom.set_xlabel(_time_label(scenario))
        figure.align_ylabels(axes)
        _head(figure, runs)
    return figure


def accuracy_figure(sweeps: Sequence[Sweep]) -> Figure:
    """Error of every scenario over the tolerance, and what it has to stay below."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 6.2), layout="constrained")
        axes = figure.subplots()
        for i, sweep in enumerate(sweeps):
            axes.plot(
                sweep.tolerances,
                np.maximum(sweep.errors, FLOOR),
                color=SWEEPS[i % len(SWEEPS)],
                marker=MARKERS[i % len(MARKERS)],
                markersize=6,
                markeredgecolor="white",
                linewidth=1.6,
                label=sweep.scenario.name,
            )
        tolerances = np.array(sweeps[0].tolerances)
        axes.plot(
            tolerances,
            reference.ERROR_PER_TOLERANCE * tolerances,
            color=MUTED,
            linestyle=DASHED,
            linewidth=1.2,
            label=f"{reference.ERROR_PER_TOLERANCE:g} × tolerance",
        )
        axes.plot(
            list(reference.BOUNDS),
            list(reference.BOUNDS.values()),
            color=INK,
            linestyle="none",
            marker="_",
            markersize=26,
            markeredgewidth=2.2,
            zorder=1.5,  # below the errors
            label="bound at this tolerance",
        )
        axes.set_xscale("log")
        axes.set_xlim(tolerances.max() * 2, tolerances.min() / 2)
        axes.xaxis.set_major_locator(FixedLocator(tolerances))
        axes.xaxis.set_minor_locator(NullLocator())
        drawn = np.array([sweep.errors for sweep in sweeps])
        limit = reference.ERROR_PER_TOLERANCE * tolerances.max()
        finite = drawn[np.isfinite(drawn)]
        error_axis(axes, finite.min(initial=limit), finite.max(initial=limit))
        axes.set_xlabel("relative tolerance")
        axes.set_ylabel("largest relative error of all outputs")
        axes.set_title("Error against tolerance", loc="left", fontsize=14, weight="bold", pad=12)
        figure.legend(loc="outside right upper", labelspacing=0.6)
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
    axes.set_ylabel(f"{name} ({run.fmu.variables[name].unit})")
    axes.margins(x=0.02, y=0.12)
    if np.ptp(values) < SMALLEST_SPAN:
        axes.set_ylim(values[0] - 0.1, values[0] + 0.1)


def _draw_errors(axes: Axes, runs: Sequence[Run], name: str) -> None:
    scale = reference.scales(runs[0].reference)[name]
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


def error_axis(axes: Axes, smallest: float, largest: float) -> None:
    """Logarithmic axis to a decade above `largest`, from `smallest` or the floor, marked 0."""
    bottom, top = np.log10(max(smallest, FLOOR)) - 0.5, np.log10(largest) + 1
    if bottom < FLOOR_DECADE + TICK_DECADES:
        bottom = FLOOR_DECADE - 0.5
    decades = np.arange(FLOOR_DECADE, top, TICK_DECADES)
    axes.set_yscale("log")
    axes.set_ylim(10.0**bottom, 10.0**top)
    axes.yaxis.set_major_locator(FixedLocator(10.0**decades))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(_decade))


def _decade(value: float, _: int) -> str:
    decade = round(np.log10(value))
    return "0" if decade == FLOOR_DECADE else f"$10^{{{decade}}}$"


def _origin(scenario: Scenario) -> float:
    """Zero of the time axis, in s: the start where that is far away."""
    return scenario.start if abs(scenario.start) > FAR * (scenario.stop - scenario.start) else 0.0


def _time_label(scenario: Scenario) -> str:
    if not _origin(scenario):
        return "time (s)"
    grouped = f"{scenario.start:,.12g}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    return f"time since t = {grouped} s (s)"


def short(number: float) -> str:
    """1e-8 for 1e-08."""
    mantissa, exponent = f"{number:.3e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}"


def save(figure: Figure, path: Path) -> None:
    """Write a picture in the style of all; complete or not at all."""
    with whole(path) as temporary, mpl.rc_context(STYLE):
        figure.savefig(temporary, metadata={"Software": None})


def _page(
    grouped: dict[str, list[Run]], sweeps: Sequence[Sweep], sections: Sequence[Section]
) -> str:
    """Text of index.html."""
    models = dict.fromkeys(group[0].fmu.description.modelName for group in grouped.values())
    title = f"{', '.join(models)}: runs against their references"
    parts = [_runs_table([run for group in grouped.values() for run in group])]
    if sweeps:
        parts += ["<h2>Error against tolerance</h2>", _sweeps_table(sweeps)]
        parts.append('<figure><img src="accuracy.png" alt="Error over tolerance"></figure>')
    for section in sections:
        parts += [f"<h2>{html.escape(section.title)}</h2>", table(section.head, section.rows)]
        parts += _notes(section.notes)
        file, text = (html.escape(x, quote=True) for x in (section.name, section.alternative))
        parts.append(f'<figure><img src="{file}.png" alt="{text}"></figure>')
    for name, group in grouped.items():
        scenario, file = group[0].scenario, html.escape(name, quote=True)
        text = html.escape(f"{scenario.title}: {scenario.description}", quote=True)
        parts.append(
            f'<figure id="{file}"><img src="{file}.png" alt="{text}">\n'
            f'<figcaption>All outputs: <a href="{file}.csv">{file}.csv</a></figcaption></figure>'
        )
    return PAGE.format(title=html.escape(title), body="\n".join(parts))


def _runs_table(runs: Sequence[Run]) -> str:
    head = ["scenario", "tolerance", "steps", "error", "bound", "worst output"]
    head += ["solver steps", "evaluations", "wall time", "result"]
    rows = []
    for run in runs:
        result, name = run.result, html.escape(run.scenario.name, quote=True)
        rows.append(
            [
                f'<a href="#{name}">{name}</a>',
                short(result.tolerance),
                str(result.steps),
                f"{run.error:.2e}",
                short(run.bound),
                html.escape(run.worst),
                "" if result.solver_steps is None else str(result.solver_steps),
                "" if result.solver_rhs_evaluations is None else str(result.solver_rhs_evaluations),
                f"{result.wall_time:.3f} s",
                verdict(run.passed),
            ]
        )
    return table(head, rows)


def _sweeps_table(sweeps: Sequence[Sweep]) -> str:
    rows = [
        [
            html.escape(sweep.scenario.name),
            *(f"{error:.1e}" for error in sweep.errors),
            verdict(sweep.passed),
        ]
        for sweep in sweeps
    ]
    sweeps_table = table(["scenario", *map(short, sweeps[0].tolerances), "result"], rows)
    broken = [f"{s.scenario.name}: {text}" for s in sweeps for text in s.violations]
    return "\n".join([sweeps_table, *_notes(broken)])


def _notes(texts: Sequence[str]) -> list[str]:
    return [f'<p class="failed">{html.escape(text)}</p>' for text in texts]


def verdict(passed: bool) -> str:
    return "passed" if passed else '<span class="failed">FAILED</span>'


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """HTML table; the cells are HTML already."""
    lines = ["<tr>" + "".join(f"<th>{cell}</th>" for cell in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows]
    return '<div class="wide"><table>\n' + "\n".join(lines) + "\n</table></div>"
