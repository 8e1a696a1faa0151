"""Pictures of a campaign."""

import math
from collections.abc import Mapping, Sequence
from textwrap import fill

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from rparm.campaign.analysis import Index
from rparm.report.pages import ERROR_COLORS, MUTED, RUN, STYLE
from rparm.units import minus

BINS = 50
COLUMNS = 3
LONGEST_LINE = 40  # characters of a label below a column
FEWEST = 6  # of these, below many bars
COLOURS = "viridis"  # in order of brightness, also for the colour-blind
NARROW = (
    1e-3  # of a value: what varies less is drawn as a difference, which short numbers can write
)
# names are those of a user's file: no mathematics
TEXTS = STYLE | {"text.parse_math": False}


def distributions(table: Mapping[str, np.ndarray]) -> Figure:
    """Histograms of columns, (runs,) each, by their labels."""
    rows = math.ceil(len(table) / COLUMNS)
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(11, 2.6 * rows), layout="constrained")
        axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for one, (label, values) in zip(axes, table.items(), strict=False):
            _histogram(one, values[np.isfinite(values)], label)
        for one in axes[len(table) :]:
            one.set_visible(False)
        return figure


def _histogram(axes: Axes, values: np.ndarray, label: str) -> None:
    """A histogram of one number or more; a text if they do not vary, or too much to be drawn."""
    smallest, largest = float(values.min()), float(values.max())
    if 0 < largest - smallest < math.inf:
        values, label = _centred(values, label)
        axes.hist(values, bins=BINS, color=RUN)
        axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.xaxis.set_major_formatter(_tick)
        axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    else:
        ends = f"from {smallest:g} to {largest:g}" if smallest < largest else f"{smallest:g}"
        axes.text(0.5, 0.5, f"all runs: {ends}", transform=axes.transAxes, ha="center")
        axes.set_xticks([])
        axes.set_yticks([])
    axes.set_xlabel(fill(label, LONGEST_LINE))
    axes.set_ylabel("runs")


def _centred(values: np.ndarray, label: str) -> tuple[np.ndarray, str]:
    """Values as differences from one of them, rounded, if they vary little; and their label."""
    there = values[np.isfinite(values)]
    middle = float(np.median(there))
    spread = float(np.max(there) - np.min(there))
    if not 0 < spread < NARROW * abs(middle):
        return values, label
    texts = (f"{middle:.{digits}g}" for digits in range(1, 18))
    text = next(text for text in texts if abs(float(text) - middle) <= spread)
    sign = "+" if text.startswith("-") else "\N{MINUS SIGN}"
    return values - float(text), f"{label} {sign} {minus(text.lstrip('-'))}"


def _tick(value: float, _: int) -> str:
    """A number with its exponent, for which there is no room at the end of a short axis."""
    return minus(f"{value:g}")


def indices(found: Mapping[str, Sequence[Index]]) -> Figure:
    """Sobol' indices of columns as bars, with their confidence intervals, by their labels."""
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(11, 2.8 * len(found)), layout="constrained")
        axes = figure.subplots(len(found), 1, squeeze=False)[:, 0]
        for one, (label, rows) in zip(axes, found.items(), strict=True):
            middle = np.arange(len(rows))
            kinds = (
                ("first order", [x.first for x in rows], [x.first_confidence for x in rows]),
                ("total", [x.total for x in rows], [x.total_confidence for x in rows]),
            )
            for i, (kind, values, half) in enumerate(kinds):
                one.bar(
                    middle + 0.36 * (i - 0.5),
                    values,
                    0.34,
                    yerr=half,
                    color=(RUN, ERROR_COLORS[0])[i],
                    ecolor=MUTED,
                    capsize=4,
                    label=kind,
                )
            width = max(COLUMNS * LONGEST_LINE // len(rows), FEWEST)
            one.set_xticks(middle, [fill(row.parameter, width) for row in rows])
            one.set_ylabel("Sobol' index")
            one.set_title(label, loc="left")
            one.legend()
        return figure


def heat_map(labels: Sequence[str], x: np.ndarray, y: np.ndarray, colour: np.ndarray) -> Figure:
    """Columns (runs,): cells where x and y form a grid, else points; of complete runs only."""
    there = np.isfinite([x, y, colour]).all(axis=0)
    with mpl.rc_context(TEXTS):
        figure = Figure(figsize=(10, 7), layout="constrained")
        axes = figure.subplots()
        centred = (_centred(*column) for column in zip((x, y, colour), labels, strict=True))
        (x, y, colour), labels = zip(*centred, strict=True)
        xs, ys = np.unique(x), np.unique(y)
        is_grid = min(len(xs), len(ys)) > 1 and np.isfinite([*xs, *ys]).all()
        if is_grid and len(xs) * len(ys) == len(x) == len(set(zip(x, y, strict=True))):
            cells = np.full((len(ys), len(xs)), np.nan)
            cells[np.searchsorted(ys, y), np.searchsorted(xs, x)] = colour
            shown = axes.pcolormesh(xs, ys, cells, cmap=COLOURS, shading="nearest")
        else:
            shown = axes.scatter(x[there], y[there], c=colour[there], cmap=COLOURS, s=14)
        axes.grid(False)
        axes.set_xlabel(labels[0])
        axes.set_ylabel(labels[1])
        figure.colorbar(shown, ax=axes).set_label(labels[2])
        return figure
