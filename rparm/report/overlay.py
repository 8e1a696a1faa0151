"""Another result drawn over a run: of another run or commit, or a log of what was measured."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rparm.errors import UserError, counted, placed
from rparm.files import is_file, missing
from rparm.report.run_data import TIME, Curve, Plot, without_rounding
from rparm.runs.comparison import SMALLEST_SCALE
from rparm.runs.inputs import EARLY, Log, Logged, read_log
from rparm.units import exponents, prefixed

FILED = 5e-12  # of a variable's scale: less is rounding of files, which have twelve digits
Others = Mapping[tuple[str, str], Log]  # by section and name of results


def read(given: Path | None, results: Mapping[tuple[str, str], Collection[str]]) -> Others:
    """Read what is given for results with these variables; UserError if it is no use.

    A folder has a result of each, as a command wrote it, or NAME.csv; a file is for one result.
    """
    if given is None:
        return {}
    with placed("--with"):
        if not given.is_dir() and len(results) > 1:
            raise UserError(f"{given} is no folder, as {counted(results, 'result')} need")
        return {result: _read(given, *result, known) for result, known in results.items()}


def _read(given: Path, section: str, name: str, known: Collection[str]) -> Log:
    places = [given / folder / f"{name}.csv" for folder in (section, "")]
    file = next(filter(is_file, places), places[0]) if given.is_dir() else given
    if not file.exists():
        raise UserError(f"{file}: {missing(file)}")
    log = read_log(file)
    common = sorted({*known} & {*log.names} - {TIME})
    log.columns(TIME, common)  # its rows are checked before anything runs
    if not common:
        raise UserError(f"{file}: has no column with the name of a variable of {name}")
    return log


def lay(
    log: Log, plots: Sequence[Plot], elapsed: np.ndarray, start: float
) -> tuple[list[Plot], dict[str, str]]:
    """Return plots with a log's values at a run's times, and how pages name and explain it.

    Times are `elapsed` seconds (rows,) since the `start` (s).
    """
    names = sorted({curve.name for plot in plots for curve in plot.curves} & {*log.names})
    found = log.columns(TIME, names, start)
    inside = elapsed[Logged(found.times, found.times, False, "").covers(elapsed)]
    if not names or not len(inside):
        missed = "time of this run" if names else "variable that a plot of this run shows"
        raise UserError(f"--with: {log.path}: has no {missed}")
    columns = {name: found.only(k) for k, name in enumerate(names)}
    after = np.minimum(np.searchsorted(found.times, elapsed - EARLY), len(found.times) - 1)
    both = np.flatnonzero(np.abs(found.times[after] - elapsed) <= EARLY)
    is_thinned = 2 * len(both) >= min(len(found.times), len(inside))  # some rows of such a run

    def laid(curve: Curve) -> Curve:
        if curve.name not in columns:
            return curve
        column = columns[curve.name]
        signal = Logged(column.times, column.values[:, 0], False, "")
        other = np.where(signal.covers(elapsed), signal.values(elapsed), np.nan)
        left = curve.values - other
        if is_thinned:  # between its rows the other result is not known
            left = np.interp(elapsed, elapsed[both], left[both]) + 0 * other
        rounding = FILED * max(np.abs(curve.values).max(), SMALLEST_SCALE)
        left = np.where(np.abs(left) < rounding, 0.0, left)
        return replace(curve, other=without_rounding(other), difference=left)

    other = {"name": str(log.path), "between": len(both) < len(inside)}
    plots = [replace(plot, curves=[*map(laid, plot.curves)]) for plot in plots]
    drawn = [(plot.unit, c) for plot in plots for c in plot.curves if c.difference is not None]
    sizes = [np.nanmax(np.abs(curve.difference)) for _, curve in drawn]
    scales = [max(np.abs(curve.values).max(), SMALLEST_SCALE) for _, curve in drawn]
    i = int(np.argmax(np.divide(sizes, scales)))
    unit, factor = prefixed(drawn[i][0], sizes[i])
    largest = f"{drawn[i][1].name} {exponents(f'{factor * sizes[i]:.3g} {unit}'.strip())}"
    return plots, other | {"largest": f"largest difference {largest} from {log.path}"}
