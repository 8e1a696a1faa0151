"""Runs of a job on a worker: a runner per thread, whose instances are reset between runs.

A worker of Dask gets FMUs and job once, as a plugin, also if it starts later or again.
"""

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import numpy as np
from distributed import Worker, WorkerPlugin, get_worker

from rparm.campaign.instances import Instances, instances
from rparm.campaign.job import Archive, Job, Recorded
from rparm.errors import UserError, one_line
from rparm.fmi.fmu_file import Fmu
from rparm.systems.python_component import PythonComponent

LONGEST_REASON = 500  # characters


@dataclass(frozen=True)
class Rows:
    runs: np.ndarray  # (rows,) their numbers
    measures: np.ndarray  # (rows, measures); NaN in a run that failed
    failures: list[str]  # why each run failed, "" if it did not
    trajectories: dict[int, np.ndarray]  # (n + 1, watched) by number of the run


class Runner(AbstractContextManager["Runner"]):
    """Makes runs, and what is measured of them; a context manager that frees its instances."""

    def __init__(self, job: Job, fmus: Mapping[str, Fmu]) -> None:
        self._job, self._fmus = job, fmus
        self._instances: Instances | None = None
        self._are_used = False
        self._record = np.empty((len(job.times), len(job.watched)))
        self._growth = np.empty(0 if job.tangent is None else job.steps)
        self._integers: list[int] = []  # at the end of the last run
        column = {name: i for names in (job.watched, job.integers) for i, name in enumerate(names)}
        self._columns = [[column[name] for name in m.variables] for m in job.measures]

    def __exit__(self, *error: object) -> None:
        if self._instances is not None:
            self._instances.__exit__(*error)

    def instantiate(self) -> Instances:
        """Load the FMUs and make their instances, if there are none; UserError if that fails."""
        if self._instances is None:
            self._instances = instances(self._job, self._fmus)
        return self._instances

    def rows(self, numbers: Sequence[int], points: np.ndarray) -> Rows:
        """Make runs, with the values (runs, targets) of the job's targets."""
        job = self._job
        measures = np.full((len(numbers), len(job.measures)), np.nan)
        failures, trajectories = [], {}
        for i, (number, point) in enumerate(zip(numbers, points, strict=True)):
            failure = self._run(point)
            failures.append(failure)
            if failure:
                continue
            recorded = Recorded(job.times, self._record, self._growth, self._integers)
            for j, (measure, columns) in enumerate(zip(job.measures, self._columns, strict=True)):
                measures[i, j] = measure.value(recorded, columns)
            if number in job.trajectories:
                trajectories[number] = self._record.copy()
        return Rows(np.array(numbers, np.int64), measures, failures, trajectories)

    def _run(self, point: np.ndarray) -> str:
        """Make one run; why it failed, or an empty text."""
        if self._are_used:
            self._reset()
        self._are_used = True
        try:
            self._integers = self.instantiate().run(point, self._record, self._growth)
            return ""
        except UserError as error:
            self._drop()  # they are not used again
            return one_line(error)[:LONGEST_REASON]

    def _reset(self) -> None:
        """Reset the instances; those that cannot be reset are made anew."""
        try:
            self.instantiate().reset()
        except UserError:
            self._drop()

    def _drop(self) -> None:
        with suppress(UserError):
            self.__exit__(None, None, None)
        self._instances, self._are_used = None, False


@contextmanager
def open_fmus(archives: Mapping[str, Archive], folder: Path) -> Iterator[dict[str, Fmu]]:
    """Unpack FMUs by their hash, in a folder."""
    with ExitStack() as stack:
        fmus = {}
        for digest, content in archives.items():
            if isinstance(content, PythonComponent):
                fmus[digest] = cast(Fmu, content)
                continue
            path = _copy(folder, digest)
            path.write_bytes(content)
            fmus[digest] = stack.enter_context(Fmu(path, folder))
        yield fmus


def check(job: Job, archives: Mapping[str, Archive], path: Path) -> None:
    """Load the FMUs of a job and instantiate each; the UserError names `path` if that fails."""
    with TemporaryDirectory(prefix="rparm-") as name:
        folder = Path(name)
        try:
            with open_fmus(archives, folder) as fmus, Runner(job, fmus) as runner:
                runner.instantiate()
        except UserError as error:
            text = str(error)
            for digest in archives:
                text = text.replace(str(_copy(folder, digest)), str(path))
            raise UserError(text) from None


def _copy(folder: Path, digest: str) -> Path:
    return folder / f"{digest}.fmu"


class Workshop:
    """The FMUs of a job, unpacked on a worker, and a runner for each of its threads."""

    def __init__(self, job: Job, archives: Mapping[str, Archive], within: Path | None) -> None:
        self._job, self._local = job, threading.local()
        self._stack, self._runners = ExitStack(), []
        folder = self._stack.enter_context(TemporaryDirectory(prefix="rparm-", dir=within))
        self._fmus = self._stack.enter_context(open_fmus(archives, Path(folder)))

    def close(self) -> None:
        """Free the instances and remove the unpacked FMUs; nothing may run any more."""
        for runner in self._runners:
            with suppress(UserError):
                runner.__exit__(None, None, None)
        self._stack.close()

    def rows(self, numbers: Sequence[int], points: np.ndarray) -> Rows:
        """Make runs in this thread."""
        if not hasattr(self._local, "runner"):
            self._local.runner = Runner(self._job, self._fmus)
            self._runners.append(self._local.runner)
        return self._local.runner.rows(numbers, points)


# ---- Workers of Dask -----------------------------------------------------------------------------
class Plugin(WorkerPlugin):
    """FMUs and job of a campaign on a worker, which may serve others, too."""

    def __init__(self, name: str, job: Job, archives: Mapping[str, Archive]) -> None:
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

    def __getstate__(self) -> tuple[str, Job, Mapping[str, Archive]]:
        return self.name, self._job, self._archives

    def __setstate__(self, state: tuple[str, Job, Mapping[str, Archive]]) -> None:
        self.__init__(*state)


def run_block(plugin: str, numbers: Sequence[int], points: np.ndarray) -> Rows:
    """Make runs with the values (runs, targets) of the targets of a plugin's job."""
    return get_worker().plugins[plugin].rows(numbers, points)
