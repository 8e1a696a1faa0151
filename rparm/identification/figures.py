"""Picture of a page: autocorrelations of the residuals, and correlations of the parameters."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rparm.identification.whiteness import Whiteness
from rparm.report.pages import ERROR_COLORS, MUTED, RUN, STYLE
from rparm.units import minus

TEXTS = STYLE | {"text.parse_math": False}
DARK = 0.6  # cells of a larger correlation
MOST_NUMBERS = 10  # parameters, whose correlations are written into their cells


def correlations(covariance: np.ndarray) -> np.ndarray:
    """Correlations of a covariance (n, n)."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return covariance / np.outer(deviations, deviations)


def figure(tests: Mapping[str, Whiteness], names: Sequence[str], covariance: np.ndarray) -> Figure:
    """Draw both; `names` are those of the covariance's parameters."""
    with mpl.rc_context(TEXTS):
        made = Figure(figsize=(11, 4.2), layout="constrained")
        left, right = made.subplots(1, 2)
        _autocorrelations(left, tests)
        _correlations(right, names, correlations(covariance))
        return made


def _autocorrelations(axes: Axes, tests: Mapping[str, Whiteness]) -> None:
    width = 0.8 / max(len(tests), 1)
    for i, (name, test) in enumerate(tests.items()):
        lags = np.arange(1, len(test.correlations) + 1)
        colour = (RUN, *ERROR_COLORS)[i % (1 + len(ERROR_COLORS))]
        places = lags + (i - (len(tests) - 1) / 2) * width
        axes.bar(places, test.correlations, width, color=colour, label=name)
    bound = max((test.bound for test in tests.values()), default=0.0)
    for level in (-bound, bound):
        axes.axhline(level, color=MUTED, linestyle=(0, (5, 3)), linewidth=1)
    axes.set_title("autocorrelation of the residuals; 95 % of noise is between the lines", size=9)
    axes.set_xlabel("lag in rows")
    axes.legend()


def _correlations(axes: Axes, names: Sequence[str], values: np.ndarray) -> None:
    axes.set_title("correlations of the parameters", size=9)
    axes.grid(False)
    if not names:
        axes.set_axis_off()
        return
    shown = axes.imshow(values, cmap="RdBu", vmin=-1, vmax=1)
    axes.set_xticks(range(len(names)), names, rotation=40, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.figure.colorbar(shown, ax=axes)
    if len(names) <= MOST_NUMBERS:
        for (i, k), value in np.ndenumerate(values):
            colour = "white" if abs(value) > DARK else "black"
            middle = {"ha": "center", "va": "center", "size": 8}
            axes.text(k, i, minus(f"{value:.2f}"), color=colour, **middle)
