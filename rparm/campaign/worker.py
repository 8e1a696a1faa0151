"""What a worker of Dask gets once, also if it starts later or again, and what it then runs."""

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from distributed import Worker, WorkerPlugin, get_worker

from rparm.campaign.job import Job
from rparm.campaign.runs import Rows, Workshop


class Plugin(WorkerPlugin):
    """FMUs and job of a campaign on a worker, which may have those of others, too."""

    def __init__(self, name: str, job: Job, archives: Mapping[str, bytes]) -> None:
        self.name, self._job, self._archives = name, job, archives
        self._workshop: Workshop | None = None
        self._lock = threading.Lock()
        self._users = 0  # the worker, and threads that make runs

    def setup(self, worker: Worker) -> None:
        """Unpack the FMUs beside the worker's own files."""
        self._workshop = Workshop(self._job, self._archives, Path(worker.local_directory))
        self._users = 1

    def teardown(self, worker: Worker) -> None:
        """Remove them, after the runs that are under way."""
        if self._workshop is not None:
            self._leave()

    def rows(self, numbers: Sequence[int], points: np.ndarray) -> Rows:
        with self._lock:
            if not self._users:
                raise RuntimeError("the campaign has ended")
            self._users += 1
        try:
            return self._workshop.rows(numbers, points)
        finally:
            self._leave()

    def _leave(self) -> None:
        with self._lock:
            self._users -= 1
            is_last = not self._users
        if is_last:
            self._workshop.close()

    def __getstate__(self) -> tuple[str, Job, Mapping[str, bytes]]:
        return self.name, self._job, self._archives

    def __setstate__(self, state: tuple[str, Job, Mapping[str, bytes]]) -> None:
        self.__init__(*state)


def run_block(plugin: str, numbers: Sequence[int], points: np.ndarray) -> Rows:
    """Make runs with the values (runs, targets) of the targets of a plugin's job."""
    return get_worker().plugins[plugin].rows(numbers, points)
