"""The picture of errors over the tolerance."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from cosim import reference
from cosim.report.style import DASHED, FLOOR, INK, MUTED, STYLE, error_axis
from cosim.tolerance_sweep import Sweep

COLORS = (
    *("#1d4e79", "#d1793a", "#2f8f83", "#7a5195", "#c2a33a", "#b0435f"),
    *("#5b9bd5", "#7d6b5d", "#5f9e3e", "#d77fb0", "#3c4650", "#a9b13a"),
)
MARKERS = "osD^v"


def tolerance_figure(sweeps: Sequence[Sweep]) -> Figure:
    """Error of every scenario over the tolerance, and what it has to stay below."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11, 6.2), layout="constrained")
        axes = figure.subplots()
        for i, sweep in enumerate(sweeps):
            axes.plot(
                sweep.tolerances,
                np.maximum(sweep.errors, FLOOR),
                color=COLORS[i % len(COLORS)],
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
