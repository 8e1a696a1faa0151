"""Runs one run of a campaign again, and writes all its Real outputs and a picture."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cosim import trajectory_csv
from cosim.campaign import figures
from cosim.campaign.bases import Base
from cosim.campaign.campaign_file import Campaign
from cosim.campaign.job import Job
from cosim.campaign.planning import plan
from cosim.campaign.points import Points
from cosim.campaign.runs import Runner, open_fmus
from cosim.errors import UserError
from cosim.report.style import save

FOLDER = "replays"


def replay(campaign: Campaign, base: Base, points: Points, run: int, folder: Path) -> list[str]:
    """Run again; lines that say what came out, files among them.

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
    lines = _named(points.names, values[0])
    if rows.failures[0]:
        return [*lines, f"failed: {rows.failures[0]}"]
    lines += _named([measure.column for measure in job.measures], rows.measures[0])
    return [*lines, *_write(job, rows.trajectories[run], folder / FOLDER, run)]


def _named(names: Sequence[str], values: np.ndarray) -> list[str]:
    return [f"{name} = {value!r}" for name, value in zip(names, values.tolist(), strict=True)]


def _write(job: Job, record: np.ndarray, folder: Path, run: int) -> list[str]:
    """Write what is recorded, (n + 1, watched); paths of the files."""
    folder.mkdir(parents=True, exist_ok=True)
    table, picture = folder / f"run_{run}.csv", folder / f"run_{run}.png"
    trajectory_csv.write(table, job.times, job.watched, record)
    save(figures.trajectories(job.times, job.watched, record), picture)
    return [str(table), str(picture)]
