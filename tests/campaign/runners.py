"""Runs of a campaign in this process."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from cosim.campaign import bases, planning
from cosim.campaign.campaign_file import Campaign
from cosim.campaign.job import Job
from cosim.campaign.points import Points
from cosim.campaign.runs import Rows, Runner, open_fmus


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
