"""The page of proven errors."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from rparm.errors import counted
from rparm.fmi.model import Model
from rparm.proof.enclosure import ASSUMED, Enclosure
from rparm.proof.errors import ProvenReference, largest_errors
from rparm.report import charts, overview
from rparm.report.charts import Chart
from rparm.report.overview import FAILED, PASSED, PROOFS
from rparm.report.pages import PageTable, RunPage
from rparm.report.run_data import Curve, Plot, RunData, thinned
from rparm.runs.scenario import Scenario
from rparm.units import SMALLEST, number, rounded_up, unit

ASSUMES = f"The proof assumes {ASSUMED}."


def write(
    report: Path,
    scenario: Scenario,
    model: Model,
    enclosure: Enclosure,
    errors: Mapping[str, np.ndarray],
    good: ProvenReference | None,
    again: str,
) -> Path:
    """Write the page of a scenario; return its path. The command `again` proves it again.

    `errors` are proven, (communication points, states), by method and tolerance; `good` is about
    the reference.
    """
    plots = [
        Plot(
            f"proven error of {name}",
            unit(model.variables[name].unit),
            # 0 where only the allowance for underflow is left, as at the start
            [Curve(x, np.where(e[:, i] < SMALLEST, 0.0, e[:, i])) for x, e in errors.items()],
            log=True,
            note=f"The exact {name} is no farther than this from the run.",
        )
        for i, name in enumerate(enclosure.names)
    ]
    rows = thinned([values for plot in plots for values in plot.columns])
    title = f"{scenario.title}: proven errors"
    shown = [plot.at(rows) for plot in plots]
    facts = [
        ("model", model.name),
        ("time", f"{number(scenario.start)} to {number(scenario.stop)} s"),
        ("communication points", str(len(enclosure.times))),
        ("widest interval", rounded_up(enclosure.radius.max(), 1)),
    ]
    if len(enclosure.starts) > 1:
        facts.append(("start", f"in {counted(enclosure.starts, 'piece')}"))
    if enclosure.stopped:
        facts.append(("proven up to", str(enclosure.stopped)))
    if good is not None:
        facts.append(("reference", f"{good.nearest} of {good.values} values are nearest doubles"))
    page = RunPage(
        title=title,
        description=scenario.description,
        status=_status([good] if good else []),
        facts=facts,
        data=RunData(scenario.name, title, enclosure.times[rows], shown),
        tables=[],
        notes=[ASSUMES],
        failures=[str(wrong) for wrong in good.wrong] if good else [],
        again=again,
    )
    answers = page, _largest(model, enclosure, errors), [_chart(enclosure, errors)], "Each state"
    entry = overview.entry_of(scenario.name, page, model.name)
    return overview.add(
        report, PROOFS, entry, lambda to, root: charts.write_page(to / entry.page, *answers, root)
    )


def _chart(enclosure: Enclosure, errors: Mapping[str, np.ndarray]) -> Chart:
    """Draw the largest error of all states by each run, relative to their largest values."""
    scales = np.abs(enclosure.high).max(axis=0)
    curves = []
    for name, each in errors.items():
        largest = (each / np.where(scales > 0, scales, 1.0)).max(axis=1)
        rows = thinned([np.log10(np.maximum(largest, SMALLEST))])
        y = np.where(largest < SMALLEST, np.nan, largest)[rows]  # a logarithmic axis has no 0
        curves.append({"name": name, "x": enclosure.times[rows], "y": y})
    text = "Proven bound of the error over time, relative to each state's largest value"
    data = {"curves": curves, "x": "time (s)", "y": "relative error"}
    return Chart(f"{text}: the largest of all states", text, "bounds", data)


def write_references(
    report: Path,
    head: Sequence[str],
    rows: Sequence,
    found: Mapping[str, ProvenReference],
    again: str,
) -> Path:
    """Write the page of the references; return its path. `head` and `rows` are of its table."""
    page = RunPage(
        title="References: proven accuracy",
        description="How many values of each reference are the doubles nearest to the exact ones.",
        status=_status(found.values()),
        facts=[("references", str(len(rows)))],
        data=None,
        tables=[PageTable("References", head, rows)],
        notes=[ASSUMES],
        failures=[str(wrong) for good in found.values() for wrong in good.wrong],
        again=again,
    )
    return overview.add_run(report, PROOFS, "references", page, "All models")


def _status(references: Iterable[ProvenReference]) -> str:
    return PASSED if all(good.passed for good in references) else FAILED


def _largest(model: Model, enclosure: Enclosure, errors: Mapping[str, np.ndarray]) -> PageTable:
    """Return the largest error of each state in each run, and its time."""
    heads = [f"{n} in {unit(model.variables[n].unit)}" for n in enclosure.names]
    rows = []
    for run, course in errors.items():
        largest = largest_errors(course, enclosure).values()
        rows.append((run, *(f"{rounded_up(e.error, 2)} at {e.at:.4g} s" for e in largest)))
    return PageTable("Largest proven errors", ("run", *heads), rows)
