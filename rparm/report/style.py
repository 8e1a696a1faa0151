"""How all pictures look."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from rparm.files import whole

INK, MUTED, GRID = "#22303c", "#6b7885", "#e3e8ec"
REFERENCE, RUN = "#a9c5de", "#1d4e79"
ERRORS = ("#d1793a", "#2f8f83", "#7a5195", "#8a8d3f")
DASHED = (0, (5, 3))

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
