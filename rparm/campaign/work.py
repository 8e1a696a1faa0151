"""A campaign, checked, with all that its runs need: what the command and programs share."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rparm import project
from rparm.campaign import bases, campaign_file, planning, quantities, runs
from rparm.campaign.bases import Base
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import Job
from rparm.campaign.planning import FAILURE, RUN
from rparm.campaign.points import Points
from rparm.campaign.results import Results

if TYPE_CHECKING:
    from distributed import Client


@dataclass(frozen=True)
class Work:
    """A campaign, its job, and the folder of its results."""

    campaign: Campaign
    base: Base
    job: Job
    points: Points
    results: Results

    def begin(self) -> list[int]:
        """Blocks whose results are not there, after a check that they can be made and kept."""
        runs.check(self.job, self.base.archives, self.base.path)
        self.results.begin()
        return self.results.missing()

    def run(
        self,
        client: "Client",
        blocks: Sequence[int],
        progress: Callable[[int], object] = lambda _: None,
    ) -> None:
        """Make the runs of some blocks; `progress` is called with the number of those made."""
        from rparm.campaign.engine import Engine  # takes long

        engine = Engine(
            client, self.campaign, self.job, self.base.archives, self.points, self.results
        )
        engine.run(blocks, progress)

    def table(self) -> dict[str, np.ndarray]:
        """All columns of all runs, (runs,) each: parameters, what is kept, why a run failed."""
        return self.results.table([RUN, *self.results.columns, FAILURE])


@contextmanager
def opened(
    file: Path,
    fmu: Path | None = None,
    output: Path | None = None,
    ask: Callable[[Sequence[str]], object] = lambda _: None,
) -> Iterator[Work]:
    """The work of a campaign's file; UserError if anything in it is wrong.

    By default, the FMU or SSP is the built one, and results go to the folder that the file names,
    or else to the project's. `ask` is called with questions to the user: values that are hardly
    meant so.
    """
    given = campaign_file.read(file)
    with bases.opened(given, fmu, file) as base:
        ask([*base.questions, *quantities.questions(given, base)])
        campaign = quantities.in_si(given, base, file)
        job = planning.plan(campaign, base, file)
        points = Points(campaign, planning.constants(campaign, base))
        if output is None:
            own = campaign.output
            output = project.campaign_folder(file.stem) if own is None else file.parent / own
        results = Results(output, campaign, job, file.read_text(encoding="utf-8"))
        yield Work(campaign, base, job, points, results)
