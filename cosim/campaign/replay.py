"""Runs one run of a campaign again, and writes all its Real outputs and a page with its motion."""

import dataclasses
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cosim import trajectory_csv
from cosim.campaign.bases import Base
from cosim.campaign.campaign_file import Campaign
from cosim.campaign.job import Job
from cosim.campaign.planning import plan
from cosim.campaign.points import Points
from cosim.campaign.runs import Runner, open_fmus
from cosim.errors import UserError
from cosim.report import assets, motion, pages
from cosim.report.motion import Recorded
from cosim.report.overview import RAN
from cosim.report.pages import RunPage, Table
from cosim.report.run_data import Curve, Plot, RunData, thinned

FOLDER = "replays"


def replay(
    campaign: Campaign, base: Base, points: Points, run: int, folder: Path, command: str
) -> list[str]:
    """Run again; lines that say what came out, files among them. `command` does it again.

    Raises
    ------
    UserError
        If there is no such run.
    """
    if run >= campaign.count:
        raise UserError(f"no run {run}: the campaign has runs 0 to {campaign.count - 1}")
    job = plan(campaign, base, "replay", base.real_outputs())
    job = dataclasses.replace(job, trajectories=frozenset([run]))
    values = points.of(range(run, run + 1))
    with (
        TemporaryDirectory(prefix="cosim-") as temporary,
        open_fmus(base.archives, Path(temporary)) as fmus,
        Runner(job, fmus) as runner,
    ):
        rows = runner.rows([run], points.targets(values, job))
    given = dict(zip(points.names, values[0].tolist(), strict=True))
    if rows.failures[0]:
        return [*_lines(given), f"failed: {rows.failures[0]}"]
    columns = [measure.column for measure in job.measures]
    kept = dict(zip(columns, rows.measures[0].tolist(), strict=True))
    record = rows.trajectories[run]
    table = folder / FOLDER / f"run_{run}.csv"
    table.parent.mkdir(parents=True, exist_ok=True)
    trajectory_csv.write(table, job.times, job.watched, record)
    assets.write(folder)
    page = RunPage(
        title=f"{campaign.title}: run {run}",
        description="One run of a campaign, made again.",
        status=RAN,
        facts=[("runs of the campaign", str(campaign.count)), ("steps", str(job.steps))],
        data=_data(base, job, given, record),
        tables=[
            Table("Parameters of this run", ("parameter", "value"), list(given.items())),
            Table("Kept of it", ("measure", "value"), list(kept.items())),
        ],
        csv=table.name,
        csv_note="It has all Real outputs.",
        again=command,
    )
    written = pages.write_run(table.with_suffix(".html"), page)
    return [*_lines(given), *_lines(kept), str(table), str(written)]


def _lines(named: dict[str, float]) -> list[str]:
    return [f"{name} = {value!r}" for name, value in named.items()]


def _data(base: Base, job: Job, given: dict[str, float], record: np.ndarray) -> RunData:
    """Plots of the states, and the motion; record: (n + 1, watched)."""
    rows = thinned(len(job.times))
    outputs = dict(zip(job.watched, record.T, strict=True))
    shown = base.states() or list(outputs)
    plots = [
        Plot(name, base.variable(name)[1].unit or "", [Curve(name, outputs[name][rows])])
        for name in shown
    ]
    moving = motion.of_recorded(base.folder, _recorded(base, job, given, outputs), rows)
    return RunData("run", "", job.times[rows], plots, motion=moving)


def _recorded(
    base: Base, job: Job, given: dict[str, float], outputs: dict[str, np.ndarray]
) -> Recorded:
    """Outputs and held inputs of each row: those of the step that ends there."""
    held = np.maximum(np.arange(len(job.times)) - 1, 0)
    inputs = {
        name: values[held]
        for group in (job.reals, job.switches)
        for name, values in zip(group.names, group.values.T, strict=True)
    }
    varied = {name: np.full(len(job.times), given[name]) for name in given if name in inputs}
    return Recorded(job.times, outputs | inputs | varied, {}, _values(base, job, given))


def _values(base: Base, job: Job, given: dict[str, float]) -> dict[str, object]:
    """Start values of all variables in this run."""
    is_system = len(job.components) > 1
    fixed = {
        f"{component.name}.{name}" if is_system else name: value
        for component in job.components
        for name, value in component.values.items()
    }
    return base.start_values() | fixed | given
