"""What a worker of Dask gets once, also if it starts later or again, and what it then runs."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from distributed import Worker, WorkerPlugin, get_worker

from cosim.campaign.job import Job
from cosim.campaign.runs import Rows, Workshop

NAME = "cosim-campaign"


class Plugin(WorkerPlugin):
    """FMUs and job on a worker."""

    name = NAME

    def __init__(self, job: Job, archives: Mapping[str, bytes]) -> None:
        self._job, self._archives = job, archives
        self.workshop: Workshop | None = None

    def setup(self, worker: Worker) -> None:
        """Unpack the FMUs beside the worker's own files."""
        self.workshop = Workshop(self._job, self._archives, Path(worker.local_directory))

    def teardown(self, worker: Worker) -> None:
        """Remove them."""
        if self.workshop is not None:
            self.workshop.close()

    def __getstate__(self) -> tuple[Job, Mapping[str, bytes]]:
        return self._job, self._archives

    def __setstate__(self, state: tuple[Job, Mapping[str, bytes]]) -> None:
        self.__init__(*state)


def run_block(numbers: Sequence[int], points: np.ndarray) -> Rows:
    """Make runs with the values (runs, targets) of the job's targets."""
    return get_worker().plugins[NAME].workshop.rows(numbers, points)
