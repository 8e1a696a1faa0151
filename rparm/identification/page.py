"""The page of an identification, with the picture of its residuals and correlations."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rparm.fmi.model import Model
from rparm.identification import results
from rparm.identification.fit import Whiteness
from rparm.identification.identify import Identification
from rparm.identification.request import DELAY
from rparm.report import pages
from rparm.report.overview import FAILED, RAN
from rparm.report.run_data import Curve, Plot, RunData, thinned
from rparm.units import minus, number, unit

PICTURE = "correlations.png"
TEXTS = pages.STYLE | {"text.parse_math": False}
DARK = 0.6  # cells of a larger correlation
MOST_NUMBERS = 10  # parameters, whose correlations are written into their cells


def write(
    found: Identification, folder: Path, model: Model, true: Mapping[str, float], again: str
) -> pages.RunPage:
    """Write the page MODEL.html and its picture into a folder; `again` is what makes it again."""
    folder.mkdir(parents=True, exist_ok=True)
    picture = figure_of(found.whiteness, found.known, found.covariances.scatter)
    pages.save_figure(picture, folder / PICTURE)
    logs = ", ".join(recording.path.name for recording in found.recordings)
    page = pages.RunPage(
        title=f"{found.model}: identified parameters",
        description=f"Fitted to {logs}: multiple shooting, with a start state for each segment.",
        status=RAN if found.passed else FAILED,
        facts=[
            ("model", found.model),
            ("rows", str(sum(int(segment.counts.sum()) for segment in found.segments))),
            ("segments", f"{len(found.segments)} of {number(found.request.segment)} s"),
            ("chi2", f"{found.chi2:.4g} (1: only noise is left)"),
            ("iterations", str(found.steps)),
        ],
        data=_data(found, model),
        tables=_tables(found, model, true),
        failures=found.warnings,
        diagram=(PICTURE, "Autocorrelations of the residuals, correlations of the parameters"),
        again=again,
    )
    pages.write_run(folder / f"{found.model}.html", page)
    return page


# ---- Plots ---------------------------------------------------------------------------------------
def _data(found: Identification, model: Model) -> RunData:
    """Plot residuals and measured over simulated values of the first log, and of the second."""
    shown = found.segments[: found.of_first]
    times = np.concatenate([segment.times[segment.counts] for segment in shown])
    measured = np.vstack([segment.measured[segment.counts] for segment in shown])
    predicted = np.vstack(
        [values[s.counts] for s, values in zip(shown, found.predicted, strict=False)]
    )
    plots = []
    for k, name in enumerate(found.checked.outputs):
        text = unit(model.variables[name].unit)
        both = Curve("simulated", predicted[:, k], reference=measured[:, k])
        plots.append(Plot(name, text, [both], note="Below it: what was measured."))
        left = Curve("residual", predicted[:, k] - measured[:, k])
        plots.append(Plot(f"residuals of {name}", text, [left]))
    if found.validation is not None:
        plots += _validation(found, model, times)
    kept = thinned([values for plot in plots for values in plot.columns])
    return RunData("identification", found.model, times[kept], [plot.at(kept) for plot in plots])


def _validation(found: Identification, model: Model, times: np.ndarray) -> list[Plot]:
    """Plot the second log, from its start, over the times of the first."""
    second = found.validation
    assert second is not None
    own = second.times - second.times[0] + times[0]
    plots = []
    for k, name in enumerate(found.checked.outputs):
        there = np.isfinite(second.measured[:, k])
        simulated = np.interp(times, own, second.predicted[:, k], right=np.nan)
        measured = np.interp(times, own[there], second.measured[there, k], right=np.nan)
        text = unit(model.variables[name].unit)
        curve = Curve("simulated", simulated, reference=measured)
        note = "The second log, in one go from its start. Below it: what was measured."
        plots.append(Plot(f"validation: {name}", text, [curve], note=note))
    return plots


# ---- Tables --------------------------------------------------------------------------------------
def _tables(found: Identification, model: Model, true: Mapping[str, float]) -> list[pages.Table]:
    return [
        _parameters(found, true),
        _outputs(found, model),
        *([] if found.validation is None else [_second(found, model)]),
    ]


def _parameters(found: Identification, true: Mapping[str, float]) -> pages.Table:
    head = ["parameter", "value", "low", "high", "classical low", "classical high", "start", "unit"]
    rows = []
    for parameter in found.checked.parameters.every:
        cells = results.texts(found.estimates[parameter.name])
        start = results.text(parameter.start)
        rows.append([parameter.name, *cells, start, unit(parameter.unit)])
    for each in found.combinations:
        if str(each) in found.sums:
            rows.append([str(each), *results.texts(found.sums[str(each)]), "–", ""])
    if true:
        head.insert(2, "true")
        for row in rows:
            row.insert(2, results.text(true.get(str(row[0]))))
    return pages.Table(
        "Parameters",
        head,
        rows,
        "Intervals of 95 %. The first ones follow from the scatter between segments; the classical "
        "ones take residuals for white noise.",
    )


def _outputs(found: Identification, model: Model) -> pages.Table:
    head = ["output", "noise", "residuals", "unit", "Ljung-Box", "p", "white"]
    rows = []
    differences = [
        (values - segment.measured)[segment.counts]
        for values, segment in zip(found.predicted, found.segments, strict=True)
    ]
    every = np.vstack(differences)
    for (name, test), noise, values in zip(
        found.whiteness.items(), found.noise, every.T, strict=True
    ):
        rms = float(np.sqrt(np.mean(values**2)))
        sizes = f"{noise:.3g}", f"{rms:.3g}", unit(model.variables[name].unit)
        is_white = "yes" if test.is_white else "no"
        rows.append([name, *sizes, f"{test.statistic:.4g}", f"{test.p:.2g}", is_white])
    return pages.Table(
        "Measured outputs",
        head,
        rows,
        "Noise: of what was measured, whatever it follows, from its third differences and counts. "
        f"Residuals: root mean square. Ljung-Box: over {_lags(found)} lags; p is the probability "
        "of noise to look like this, below 0.01 it is not taken for noise.",
    )


def _lags(found: Identification) -> int:
    return max(len(test.correlations) for test in found.whiteness.values())


def _second(found: Identification, model: Model) -> pages.Table:
    second = found.validation
    assert second is not None
    rows = [
        [name, f"{rms:.3g}", unit(model.variables[name].unit), f"{follows:.2f} s"]
        for name, rms, follows in zip(
            found.checked.outputs, second.rms, second.follows, strict=True
        )
    ]
    late = " and the delay" if DELAY in found.estimates else ""
    return pages.Table(
        f"Validation on {second.recording.path.name}",
        ["output", "RMS of the error", "unit", "follows for"],
        rows,
        f"Run in one go with these parameters{late}; only the start state is fitted. An "
        "unstable motion runs away after a while, however exact they are; it is followed until the "
        f"error is a tenth of the range. Its segments by themselves have chi2 = {second.chi2:.4g}.",
    )


def correlations(covariance: np.ndarray) -> np.ndarray:
    """Return the correlations of a covariance (n, n)."""
    deviations = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    return covariance / np.outer(deviations, deviations)


def figure_of(
    tests: Mapping[str, Whiteness], names: Sequence[str], covariance: np.ndarray
) -> Figure:
    """Draw both; `names` are the covariance's parameters."""
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
        colour = (pages.RUN_COLOR, *pages.ERROR_COLORS)[i % (1 + len(pages.ERROR_COLORS))]
        places = lags + (i - (len(tests) - 1) / 2) * width
        axes.bar(places, test.correlations, width, color=colour, label=name)
    bound = max((test.bound for test in tests.values()), default=0.0)
    for level in (-bound, bound):
        axes.axhline(level, color=pages.MUTED, linestyle=(0, (5, 3)), linewidth=1)
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
