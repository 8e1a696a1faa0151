"""Hands the blocks of a campaign to workers of Dask, and keeps what comes back.

A worker gets the FMUs and the job once, as a plugin, also if it starts later or again. A block is
one task. Few are under way at a time, so that the scheduler's memory does not grow with the
campaign. Only this process writes results: workers need no common disk.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from uuid import uuid4
from weakref import WeakSet

import numpy as np
from distributed import Client, Future, as_completed
from distributed.client import ClosedClientError, FutureCancelledError, WorkerStartTimeoutError
from distributed.scheduler import KilledWorker
from tornado.ioloop import PeriodicCallback

from rparm.campaign.campaign_file import Campaign
from rparm.campaign.cluster import WAIT
from rparm.campaign.job import Job
from rparm.campaign.points import Points
from rparm.campaign.results import RESUMES, Results
from rparm.campaign.runs import Rows
from rparm.campaign.worker import Plugin, run_block
from rparm.errors import UserError, one_line

AHEAD = 3  # blocks under way for each thread of a worker
COUNT_EVERY = 5000  # ms, between two looks at how many threads there are
ATTEMPTS = 3  # to reach all workers: the scheduler may count one whose host is gone
PATIENCE = 120  # s, without any worker later on
FAREWELL = 5  # s, for workers to remove what they have got
CONNECTION = (OSError, FutureCancelledError, ClosedClientError)
GONE = "the scheduler is gone"
DIED = "the worker died in this run"


@dataclass(frozen=True)
class _Block:
    """A block that is under way."""

    number: int
    runs: range
    points: np.ndarray  # (runs, parameters and derived values)


class Engine:
    """Runs blocks on the workers of a client."""

    def __init__(
        self,
        client: Client,
        campaign: Campaign,
        job: Job,
        archives: Mapping[str, bytes],
        points: Points,
        results: Results,
    ) -> None:
        self._client, self._campaign, self._job = client, campaign, job
        self._points, self._results = points, results
        self._address = client.scheduler.address
        self._futures: WeakSet[Future] = WeakSet()
        self._lost = GONE  # why futures are cancelled
        # workers may have other campaigns, or this one twice
        self._plugin = f"rparm-campaign-{uuid4()}"
        try:
            self._threads = self._begin(Plugin(self._plugin, job, archives))
        except BaseException:
            self._end()
            raise

    def _begin(self, plugin: Plugin) -> int:
        """Give all workers the plugin; the number of their threads."""
        for _ in range(ATTEMPTS):
            try:
                self._client.wait_for_workers(1, timeout=WAIT)
                self._client.register_plugin(plugin)
                return sum(self._client.nthreads().values())
            except WorkerStartTimeoutError:
                raise UserError(f"{self._address}: has no workers") from None
            except Exception as error:  # of a worker: any
                if not _is_of_connection(error):
                    text = one_line(error) or type(error).__name__
                    raise UserError(f"{self._address}: a worker cannot run this: {text}") from None
        raise UserError(f"{self._address}: {GONE}, or a worker cannot be reached; {RESUMES}")

    def _end(self) -> None:
        """Take the plugin from all workers, if they can be reached."""
        with suppress(*CONNECTION, ValueError):  # ValueError: it has not been registered
            self._client.sync(self._forget, callback_timeout=FAREWELL)

    async def _forget(self) -> None:
        await self._client.cancel(list(self._futures), asynchronous=True)
        await self._client.scheduler.unregister_worker_plugin(name=self._plugin)

    def run(self, blocks: Sequence[int], done: Callable[[int], object]) -> None:
        """Run blocks and keep results; `done` gets the runs of each. UserError if that fails."""
        watch = PeriodicCallback(self._watch, COUNT_EVERY)
        try:
            self._seen = time.monotonic()
            self._client.loop.add_callback(watch.start)
            self._run(blocks, done)
        except CONNECTION as error:
            if not _is_of_connection(error):
                raise
            raise UserError(f"{self._lost}; {RESUMES}") from None
        finally:
            self._client.loop.add_callback(watch.stop)
            self._end()

    async def _watch(self) -> None:
        """Count threads, in the thread of the client; give up when there have long been none."""
        self._threads = sum((await self._client.nthreads(asynchronous=True)).values())
        if self._threads:
            self._seen = time.monotonic()
        elif time.monotonic() > self._seen + PATIENCE:
            self._lost = f"{self._address}: has no workers any more"
            await self._client.cancel(list(self._futures), asynchronous=True)

    def _run(self, blocks: Sequence[int], done: Callable[[int], object]) -> None:
        waiting = iter(blocks)
        tasks = as_completed()
        under_way: dict[str, _Block] = {}
        self._fill(waiting, tasks, under_way)
        for future in tasks:
            if future.status in ("lost", "pending"):  # a worker died with the result: made again
                tasks.add(future)
                continue
            block = under_way.pop(future.key)
            self._results.write(block.number, block.points, self._rows(future, block))
            future.release()
            done(len(block.runs))
            self._fill(waiting, tasks, under_way)

    def _fill(
        self, waiting: Iterator[int], tasks: as_completed, under_way: dict[str, _Block]
    ) -> None:
        """Submit blocks until enough are under way, also for workers that have come later."""
        ahead = AHEAD * max(self._threads, 1)
        for number in islice(waiting, max(ahead - len(under_way), 0)):
            runs = self._campaign.block_range(number)
            block = _Block(number, runs, self._points.of(runs))
            future = self._submit(list(runs), block.points)
            under_way[future.key] = block
            tasks.add(future)

    def _submit(self, runs: Sequence[int], points: np.ndarray) -> Future:
        targets = self._points.targets(points, self._job)
        future = self._client.submit(run_block, self._plugin, runs, targets, pure=False)
        self._futures.add(future)
        return future

    def _rows(self, future: Future, block: _Block) -> Rows:
        """Results of a task; run by run if it has killed too many workers."""
        if future.status == "finished":
            return future.result()
        error = self._error(future)
        if not isinstance(error, KilledWorker):
            raise UserError(f"block {block.number}: {one_line(error)}; {RESUMES}")
        pairs = zip(block.runs, block.points, strict=True)
        return _joined([self._alone(run, point[None]) for run, point in pairs])

    def _alone(self, run: int, point: np.ndarray) -> Rows:
        """One run as a task; a failed row if it kills workers."""
        try:
            return self._submit([run], point).result()
        except KilledWorker:
            nothing = np.full((1, len(self._job.measures)), np.nan)
            return Rows(np.array([run], np.int64), nothing, [DIED], {})

    def _error(self, future: Future) -> BaseException:
        if future.status == "cancelled" or self._client.status != "running":
            raise UserError(f"{self._lost}; {RESUMES}")
        return future.exception()


def _is_of_connection(error: Exception) -> bool:
    """Whether an error is of Dask's connections: errors of the system have numbers, too."""
    return isinstance(error, CONNECTION) and not getattr(error, "errno", None)


def _joined(parts: Sequence[Rows]) -> Rows:
    return Rows(
        np.concatenate([part.runs for part in parts]),
        np.concatenate([part.measures for part in parts]),
        [failure for part in parts for failure in part.failures],
        {run: record for part in parts for run, record in part.trajectories.items()},
    )
