"""The page of an identification: parameters, correlations, residuals, logs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rparm.errors import shortened
from rparm.fmi.model import Model
from rparm.identification import results
from rparm.identification.fit import Whiteness
from rparm.identification.identify import Identification
from rparm.identification.request import DELAY
from rparm.report import charts, pages
from rparm.report.charts import Chart
from rparm.report.overview import FAILED, RAN
from rparm.report.run_data import Curve, Plot, RunData, thinned
from rparm.units import exponents, number, unit

LONGEST = 24  # characters of a name beside the correlations
MOST_NUMBERS = 10  # parameters, whose correlations are written into their cells


def write(
    found: Identification,
    folder: Path,
    model: Model,
    true: Mapping[str, float],
    again: str,
    root: str = "",
) -> Path:
    """Write the page into a folder; its path. `again` is the command that makes it again.

    `root` leads from there to the start page, if there is one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    logs = ", ".join(recording.path.name for recording in found.recordings)
    part = "log" if found.is_one_run else "segment"
    page = pages.RunPage(
        title=f"{found.model}: identified parameters",
        description=f"Fitted to {logs}: with a start state for each {part}.",
        status=RAN if found.passed else FAILED,
        facts=[
            ("model", found.model),
            ("rows", str(sum(segment.rows for segment in found.segments))),
            ("segments", f"{found.pieces} of {number(found.request.segment)} s"),
            ("chi2", f"{found.chi2:.4g} (1: only noise is left)"),
            ("iterations", str(found.steps)),
        ],
        data=_data(found, model),
        tables=[_outputs(found, model), *([_second(found, model)] if found.validation else [])],
        failures=[*found.notes, *found.warnings],
        again=again,
    )
    known, parameters = found.known, _parameters(found, true)
    drawn = [correlations_chart(known, found.covariances.scatter)] if len(known) > 1 else []
    drawn.append(autocorrelations_chart(found.whiteness))
    if not root:
        pages.write_assets(folder)
    return charts.write_page(
        folder / pages.INDEX, page, parameters, drawn, "Residuals and logs", root
    )


# ---- Plots ---------------------------------------------------------------------------------------
def _data(found: Identification, model: Model) -> RunData:
    """Plot residuals and measured over simulated values of the first log, and of the second."""
    shown = found.segments[: found.of_first]
    rows = np.concatenate([segment.counts.any(axis=1) for segment in shown])
    times = np.concatenate([segment.times for segment in shown])[rows]
    measured = np.vstack([segment.measured for segment in shown])[rows]
    predicted = np.vstack(found.predicted[: found.of_first])[rows]
    residuals, plots = [], []
    for k, name in enumerate(found.checked.outputs):
        text = unit(model.variables[name].unit)
        both = [Curve("measured", measured[:, k], points=True), Curve("simulated", predicted[:, k])]
        plots.append(Plot(name, text, both))
        left = Curve("residual", predicted[:, k] - measured[:, k])
        residuals.append(Plot(f"residuals of {name}", text, [left]))
    plots = residuals + plots
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
        curves = [Curve("measured", measured, points=True), Curve("simulated", simulated)]
        note = "The second log, in one go from its start."
        plots.append(Plot(f"validation: {name}", text, curves, note=note))
    return plots


# ---- Tables --------------------------------------------------------------------------------------
def _parameters(found: Identification, true: Mapping[str, float]) -> pages.PageTable:
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
    return pages.PageTable(
        "Parameters",
        head,
        rows,
        "Intervals of 95 %. The first ones follow from the scatter between segments; the classical "
        "ones take residuals for white noise.",
    )


def _outputs(found: Identification, model: Model) -> pages.PageTable:
    head = ["output", "noise", "residuals", "unit", "Ljung-Box", "p", "white"]
    rows = []
    counts = np.vstack([segment.counts for segment in found.segments])
    differences = np.vstack(found.predicted) - np.vstack([s.measured for s in found.segments])
    for (name, test), noise, values, there in zip(
        found.whiteness.items(), found.noise, differences.T, counts.T, strict=True
    ):
        rms = float(np.sqrt(np.mean(values[there] ** 2)))
        sizes = exponents(f"{noise:.3g}"), exponents(f"{rms:.3g}"), unit(model.variables[name].unit)
        is_white = "yes" if test.is_white else "no"
        rows.append([name, *sizes, f"{test.statistic:.4g}", exponents(f"{test.p:.2g}"), is_white])
    return pages.PageTable(
        "Measured outputs",
        head,
        rows,
        "Noise: of what was measured, whatever it follows, from its third differences and counts. "
        f"Residuals: root mean square. Ljung-Box: over {_lags(found)} lags; p is the probability "
        "of noise to look like this, below 0.01 it is not taken for noise.",
    )


def _lags(found: Identification) -> int:
    return max(len(test.correlations) for test in found.whiteness.values())


def _second(found: Identification, model: Model) -> pages.PageTable:
    second = found.validation
    assert second is not None
    rows = [
        [name, exponents(f"{rms:.3g}"), unit(model.variables[name].unit), f"{follows:.2f} s"]
        for name, rms, follows in zip(
            found.checked.outputs, second.rms, second.follows, strict=True
        )
    ]
    late = " and the delay" if DELAY in found.estimates else ""
    return pages.PageTable(
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


# ---- Charts -------------------------------------------------------------------------------------
def autocorrelations_chart(tests: Mapping[str, Whiteness]) -> Chart:
    """Draw them as bars, and lines between which noise stays in 95 % of cases."""
    bound = max((test.bound for test in tests.values()), default=0.0)
    rows = [{"name": name, "values": test.correlations} for name, test in tests.items()]
    title = "Autocorrelation of the residuals: 95 % of noise is between the lines"
    return Chart(title, title, "autocorrelations", {"rows": rows, "bound": bound})


def correlations_chart(names: Sequence[str], covariance: np.ndarray) -> Chart:
    """Draw the correlations of parameters (n,), whose covariance (n, n) is given."""
    values = correlations(covariance)
    short = [f"{i + 1} {shortened(name, LONGEST)}" for i, name in enumerate(names)]
    data = {"names": names, "short": short, "values": values, "most": MOST_NUMBERS}
    pairs = [(abs(values[i, k]), f"{names[i]} and {names[k]} {values[i, k]:.2f}")
             for i in range(len(names)) for k in range(i)]  # fmt: skip
    text = f"Correlations of parameters; the largest: {max(pairs)[1]}" if pairs else names[0]
    return Chart("Correlations of the parameters", text, "correlations", data)
