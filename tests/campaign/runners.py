"""Runs of a campaign in this process."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from distributed import Client

from rparm.campaign import bases, campaign_file, planning
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.engine import Engine
from rparm.campaign.job import Job
from rparm.campaign.planning import Points
from rparm.campaign.results import Results
from rparm.campaign.runs import Rows, Runner, open_fmus


@contextmanager
def runner(
    given: Campaign, folder: Path, also: Sequence[str] = (), fmu: Path | None = None
) -> Iterator[tuple[Runner, Job, Points]]:
    """A runner, its job and the points of a campaign."""
    with bases.opened(given, fmu) as base:
        job = planning.plan(given, base, "test", also)
        points = Points(given, planning.constants(given, base))
        with open_fmus(base.archives, folder) as fmus, Runner(job, fmus) as runs:
            yield runs, job, points


def rows(runs: Runner, job: Job, points: Points, numbers: Sequence[int]) -> Rows:
    """Results of some runs of a campaign, in this order."""
    given = np.concatenate([points.of(range(n, n + 1)) for n in numbers])
    return runs.rows(numbers, points.targets(given, job))


@contextmanager
def engine_of(
    client: Client, file: Path, folder: Path, fmu: Path | None = None
) -> Iterator[tuple[Engine, Results]]:
    """An engine for a campaign, and the results that it will write."""
    given = campaign_file.read(file)
    with bases.opened(given, fmu) as base:
        job = planning.plan(given, base, file)
        points = Points(given, planning.constants(given, base))
        results = Results(folder, given, job, file.read_text(encoding="utf-8"))
        results.begin()
        yield Engine(client, given, job, base.archives, points, results), results
