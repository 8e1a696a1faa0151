"""Pictures of a campaign."""

import math
from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from cosim.campaign.analysis import Index
from cosim.campaign.campaign_file import Map
from cosim.report.style import ERRORS, MUTED, RUN, STYLE

BINS = 50
COLUMNS = 3
COLOURS = "viridis"  # in order of brightness, also for the colour-blind


def distributions(table: Mapping[str, np.ndarray]) -> Figure:
    """Histograms of columns, (runs,) each."""
    rows = math.ceil(len(table) / COLUMNS)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 2.6 * rows), layout="constrained")
        axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for place, (name, values) in zip(axes, table.items(), strict=False):
            place.hist(values[np.isfinite(values)], bins=BINS, color=RUN)
            place.set_xlabel(name)
            place.set_ylabel("runs")
        for place in axes[len(table) :]:
            place.set_visible(False)
        return figure


def indices(found: Mapping[str, Sequence[Index]]) -> Figure:
    """Sobol' indices of columns as bars, with their confidence intervals."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 2.8 * len(found)), layout="constrained")
        axes = figure.subplots(len(found), 1, squeeze=False)[:, 0]
        for place, (name, rows) in zip(axes, found.items(), strict=True):
            middle = np.arange(len(rows))
            kinds = (
                ("first order", [x.first for x in rows], [x.first_confidence for x in rows]),
                ("total", [x.total for x in rows], [x.total_confidence for x in rows]),
            )
            for i, (label, values, half) in enumerate(kinds):
                place.bar(
                    middle + 0.36 * (i - 0.5),
                    values,
                    0.34,
                    yerr=half,
                    color=(RUN, ERRORS[0])[i],
                    ecolor=MUTED,
                    capsize=4,
                    label=label,
                )
            place.set_xticks(middle, [row.parameter for row in rows])
            place.set_ylabel("Sobol' index")
            place.set_title(name)
            place.legend()
        return figure


def heat_map(drawn: Map, x: np.ndarray, y: np.ndarray, colour: np.ndarray) -> Figure:
    """Columns (runs,): a picture of cells where they make a grid, of points elsewhere."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10, 7), layout="constrained")
        axes = figure.subplots()
        xs, ys = np.unique(x), np.unique(y)
        if len(xs) > 1 and len(ys) > 1 and len(xs) * len(ys) == len(x):
            cells = np.full((len(ys), len(xs)), np.nan)
            cells[np.searchsorted(ys, y), np.searchsorted(xs, x)] = colour
            shown = axes.pcolormesh(xs, ys, cells, cmap=COLOURS, shading="nearest")
        else:
            there = np.isfinite(x) & np.isfinite(y) & np.isfinite(colour)
            shown = axes.scatter(x[there], y[there], c=colour[there], cmap=COLOURS, s=14)
        axes.grid(False)
        axes.set_xlabel(drawn.x)
        axes.set_ylabel(drawn.y)
        figure.colorbar(shown, ax=axes, label=drawn.colour)
        return figure
