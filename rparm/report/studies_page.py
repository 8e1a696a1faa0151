"""Pages of the studies: error over the tolerance, and over the communication step."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rparm import project
from rparm.report import overview
from rparm.report.overview import FAILED, PASSED, Entry
from rparm.report.pages import RunPage, Table
from rparm.report.run_data import Axis, Curve, Plot, RunData
from rparm.report.sparkline import path as sparkline
from rparm.runs import comparison
from rparm.runs.comparison import Sweep
from rparm.runs.convergence import Convergence
from rparm.units import milliseconds, short, verdict

ACCURACY = "accuracy"  # name of the page over the tolerance
UPDATE = "intermediate update"
UPDATE_NOTE = (
    "With intermediate update of FMI 3.0, the FMU asks for the inputs at four times of a step and "
    "uses the cubic through them. The error then falls with the fourth power of the step, without "
    "input derivatives, and is smaller than with three of them."
)


def write_sweeps(folder: Path, sweeps: Sequence[Sweep]) -> Entry:
    """Write the page of errors over the tolerance; its line in the overview."""
    x = np.array(sweeps[0].tolerances)
    models: dict[str, list[Sweep]] = {}
    for sweep in sweeps:
        models.setdefault(sweep.scenario.model, []).append(sweep)
    limit = Curve(
        f"{comparison.ERROR_PER_TOLERANCE:g} × tolerance",
        comparison.ERROR_PER_TOLERANCE * x,
        limit=True,
    )
    plots = [
        Plot(
            f"largest error, scenarios of {model}",
            "",
            [*(Curve(sweep.scenario.name, np.asarray(sweep.errors)) for sweep in own), limit],
            log=True,
        )
        for model, own in models.items()
    ]
    rows = [
        [sweep.scenario.name, *(f"{error:.1e}" for error in sweep.errors), verdict(sweep.passed)]
        for sweep in sweeps
    ]
    passed = all(sweep.passed for sweep in sweeps)
    data = RunData(ACCURACY, "", x, plots, Axis("relative tolerance", "", log=True, reversed=True))
    page = RunPage(
        title="Error against tolerance",
        description="Each scenario at eight tolerances: the largest relative error of all outputs.",
        status=PASSED if passed else FAILED,
        facts=[("scenarios", str(len(sweeps)))],
        data=data,
        tables=[Table("Errors", ["scenario", *map(short, x), "result"], rows)],
        failures=[f"{s.scenario.name}: {text}" for s in sweeps for text in s.violations],
    )
    worst = max(sweeps, key=lambda sweep: np.nan_to_num(sweep.errors[-1], nan=np.inf))
    return _write(folder, page, worst.errors[-1], f"at {short(x[-1])}, {worst.scenario.name}")


def write_convergence(folder: Path, study: Convergence) -> Entry:
    """Write the page of errors over the communication step; its line in the overview."""
    scenario, steps = study.scenario, np.asarray(study.problem.steps, float)
    model = project.model_folder(scenario.path).name
    curves = [Curve(row.name, np.asarray(row.errors)) for row in study.rows]
    data = RunData(
        scenario.name,
        "",
        1e3 * steps,
        [Plot("error of the final state", "", curves, log=True)],
        Axis("communication step", "ms", log=True),
    )
    rows = [
        [row.name, *(f"{e:.1e}" for e in row.errors), f"{row.slope:.2f}", verdict(row.holds)]
        for row in study.rows
    ]
    updated = any(row.name == UPDATE for row in study.rows)
    page = RunPage(
        title="Error against communication step",
        description=f"{scenario.title}: {scenario.description}",
        status=PASSED if study.passed else FAILED,
        facts=[("model", model), ("tolerance", short(scenario.tolerance))],
        data=data,
        tables=[
            Table(
                "Errors",
                ["known of the inputs", *map(milliseconds, steps), "slope", "result"],
                rows,
            )
        ],
        notes=[UPDATE_NOTE] if updated else [],
        failures=study.violations,
    )
    worst = max(study.rows, key=lambda row: row.errors[-1])
    return _write(folder, page, worst.errors[-1], f"at {milliseconds(steps[-1])}, {worst.name}")


def _write(folder: Path, page: RunPage, error: float, detail: str) -> Entry:
    x, errors = page.data.x, page.data.plots[0].curves[0].values
    with np.errstate(divide="ignore"):
        line = sparkline(-np.log10(x), np.log10(errors))
    axis = f"{short(x[0])} to {short(x[-1])} {page.data.axis.unit}".strip()
    return overview.write_page(  # without error and bound: those of studies cannot be compared
        folder,
        page.data.name,
        page,
        "Errors over all scenarios",
        title=f"{page.title}: {error:.1e} {detail}",
        detail=detail,
        line=line,
        line_scale=f"{short(errors[0])} to {short(errors[-1])}, {page.data.axis.title} {axis}",
    )
