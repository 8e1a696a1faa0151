"""How all pictures look."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from cosim.output_files import whole

INK, MUTED, GRID = "#22303c", "#6b7885", "#e3e8ec"
REFERENCE, RUN = "#a9c5de", "#1d4e79"
ERRORS = ("#d1793a", "#2f8f83", "#7a5195", "#8a8d3f")
LINES = (
    ("#1d4e79", "#a9c5de"),
    ("#d1793a", "#f0cfb4"),
    ("#2f8f83", "#b5dad5"),
    ("#7a5195", "#d5c3df"),
)
DASHED = (0, (5, 3))

FLOOR_DECADE, TICK_DECADES = -18, 3
FLOOR = 10.0**FLOOR_DECADE  # errors below it, 0 among them, are drawn here; no double is that good

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


def save(figure: Figure, path: Path) -> None:
    """Write a picture in the style of all; complete or not at all."""
    with whole(path) as temporary, mpl.rc_context(STYLE):
        figure.savefig(temporary, metadata={"Software": None})


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
