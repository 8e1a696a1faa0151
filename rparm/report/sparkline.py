"""A small picture of a curve, for one line of a table."""

import numpy as np

from rparm.report.run_data import Plot

WIDTH, HEIGHT, MARGIN = 100.0, 24.0, 2.0  # of the view box
SPACE = "\N{NO-BREAK SPACE}"  # before a unit
COLUMNS = 60  # the curve's extremes in each are drawn


def scale_of(x: np.ndarray, plot: Plot, unit: str) -> str:
    """Between which values the first curve of a plot runs, and how long `x` is (`unit`)."""
    values = plot.curves[0].values[np.isfinite(plot.curves[0].values)]
    if not len(values):
        return ""
    low, high = (f"{value:.3g}" for value in (values.min(), values.max()))
    between = low if low == high else f"{low} to {high}"
    parts = (f"{between} {plot.unit}".strip(), f"{x[-1] - x[0]:.3g} {unit}")
    return ", ".join(SPACE.join(part.rsplit(" ", 1)) for part in parts)


def path(x: np.ndarray, y: np.ndarray) -> str:
    """Path of an SVG of `WIDTH` by `HEIGHT` through points (rows,), `x` ascending; may be empty."""
    finite = np.isfinite(y)
    x, y = x[finite], y[finite]
    if not len(x):
        return ""
    column = np.zeros(len(x), int)
    length = x[-1] - x[0]
    if length > 0:
        column = np.minimum((x - x[0]) / length * COLUMNS, COLUMNS - 1).astype(int)
    rows = {0, len(x) - 1}
    for i in np.unique(column):
        members = np.flatnonzero(column == i)
        rows |= {int(members[np.argmin(y[members])]), int(members[np.argmax(y[members])])}
    kept = sorted(rows)
    across = (x[kept] - x[0]) / length if length > 0 else np.zeros(len(kept))
    height = np.ptp(y)
    up = (y[kept] - y.min()) / height if height > 0 else np.full(len(kept), 0.5)
    points = zip(
        MARGIN + across * (WIDTH - 2 * MARGIN),
        HEIGHT - MARGIN - up * (HEIGHT - 2 * MARGIN),
        strict=True,
    )
    return "M" + "L".join(f"{a:.4g} {b:.4g}" for a, b in points)
