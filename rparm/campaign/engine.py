"""Hands the blocks of a campaign to workers of Dask, here or elsewhere, and keeps what comes back.

A block is one task. Few are under way at a time, so that the scheduler's memory does not grow with
the campaign. Only this process writes results: workers need no common disk.

Who can talk to Dask's processes runs code as their user. Those of this machine listen on loopback,
where its other users are too, so they talk by TLS with a certificate that only they have. For a
scheduler elsewhere, certificates are the user's.
"""

import logging
import multiprocessing.resource_tracker
import os
import signal
import ssl
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from uuid import uuid4
from weakref import WeakSet

import dask
import distributed
import numpy as np
from dask.system import CPU_COUNT
from distributed.client import ClosedClientError, FutureCancelledError, WorkerStartTimeoutError
from distributed.core import Status
from distributed.scheduler import KilledWorker
from tornado.ioloop import PeriodicCallback

from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import Archive, Job
from rparm.campaign.planning import Points
from rparm.campaign.results import RESUMES, Results
from rparm.campaign.runs import Plugin, Rows, run_block
from rparm.errors import UserError, one_line, placed, reason
from rparm.files import check_regular
from rparm.interruption import uninterrupted

AHEAD = 3  # blocks under way for each thread of a worker
COUNT_EVERY = 5000  # ms, between two looks at how many threads there are
ATTEMPTS = 3  # to reach all workers: the scheduler may count one whose host is gone
PATIENCE = 120  # s, without any worker later on
FAREWELL = 5  # s, for workers to remove their files
CONNECTION = (OSError, FutureCancelledError, ClosedClientError)
GONE = "the scheduler is gone"
DIED = "the worker died in this run"
LOCAL = "127.0.0.1"
KILLS = 5  # workers that may die in a task before it counts as failed
RESTART_EVERY = 2000  # ms
WAIT = 60  # s, for workers to start
SETTINGS = {
    "distributed.scheduler.allowed-failures": KILLS,
    "distributed.comm.timeouts.connect": "20s",
    # to watch workers many times a second takes three per cent of a core, for nothing here
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.worker.memory.terminate": False,  # the system decides when memory is short
}
TLS = "tls://"
OPTIONS = ("--tls-ca", "--tls-cert", "--tls-key")
EXPECTED = "an address as tls://192.168.0.1:8786"


# ---- Blocks --------------------------------------------------------------------------------------
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
        client: distributed.Client,
        campaign: Campaign,
        job: Job,
        archives: Mapping[str, Archive],
        points: Points,
        results: Results,
    ) -> None:
        self._client, self._campaign, self._job = client, campaign, job
        self._points, self._results = points, results
        self._address = client.scheduler.address
        self._futures: WeakSet[distributed.Future] = WeakSet()
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
        tasks = distributed.as_completed()
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
        self, waiting: Iterator[int], tasks: distributed.as_completed, under_way: dict[str, _Block]
    ) -> None:
        """Submit blocks until enough are under way for all workers, later ones too."""
        ahead = AHEAD * max(self._threads, 1)
        for number in islice(waiting, max(ahead - len(under_way), 0)):
            runs = self._campaign.block_range(number)
            block = _Block(number, runs, self._points.of(runs))
            future = self._submit(list(runs), block.points)
            under_way[future.key] = block
            tasks.add(future)

    def _submit(self, runs: Sequence[int], points: np.ndarray) -> distributed.Future:
        targets = self._points.targets(points, self._job)
        future = self._client.submit(run_block, self._plugin, runs, targets, pure=False)
        self._futures.add(future)
        return future

    def _rows(self, future: distributed.Future, block: _Block) -> Rows:
        """Return the results of a task; run by run if it has killed too many workers."""
        if future.status == "finished":
            return future.result()
        error = self._error(future)
        if not isinstance(error, KilledWorker):
            raise UserError(f"block {block.number}: {one_line(error)}; {RESUMES}")
        pairs = zip(block.runs, block.points, strict=True)
        return _joined([self._alone(run, point[None]) for run, point in pairs])

    def _alone(self, run: int, point: np.ndarray) -> Rows:
        """Submit one run as a task; return a failed row if it kills workers."""
        try:
            return self._submit([run], point).result()
        except KilledWorker:
            nothing = np.full((1, len(self._job.measures)), np.nan)
            return Rows(np.array([run], np.int64), nothing, [DIED], {})

    def _error(self, future: distributed.Future) -> BaseException:
        if future.status == "cancelled" or self._client.status != "running":
            raise UserError(f"{self._lost}; {RESUMES}")
        return future.exception()


def _is_of_connection(error: Exception) -> bool:
    """Return whether an error is of Dask's connections: errors of the system have numbers, too."""
    return isinstance(error, CONNECTION) and not getattr(error, "errno", None)


def _joined(parts: Sequence[Rows]) -> Rows:
    return Rows(
        np.concatenate([part.runs for part in parts]),
        np.concatenate([part.measures for part in parts]),
        [failure for part in parts for failure in part.failures],
        {run: record for part in parts for run, record in part.trajectories.items()},
    )


# ---- The cluster ---------------------------------------------------------------------------------
@contextmanager
def opened_cluster(
    scheduler: str | None,
    workers: int | None,
    folder: Path,
    security: distributed.Security | None = None,
    dashboard: bool = False,
) -> Iterator[distributed.Client]:
    """Return a client of a cluster; UserError if the scheduler at its address cannot be reached.

    Without an address the cluster is made on this machine: `workers` processes, by default one per
    core, with files in `folder`. There Dask shows all users its pages (`dashboard`), to look at.
    """
    logging.disable(logging.CRITICAL)  # the errors that are raised here say it
    try:
        with dask.config.set(SETTINGS):
            start = (
                _connected(scheduler, security)
                if scheduler
                else _local(workers or CPU_COUNT, folder, dashboard)
            )
            with start as client:
                yield client
    finally:
        logging.disable(logging.NOTSET)


@contextmanager
def _connected(address: str, security: distributed.Security | None) -> Iterator[distributed.Client]:
    try:
        client = distributed.Client(address, timeout=20, security=security)
    except (TimeoutError, OSError, ValueError, RuntimeError) as error:
        raise UserError(f"{address}: the scheduler cannot be reached: {one_line(error)}") from None
    with client:
        yield client


# ---- On this machine -----------------------------------------------------------------------------
class _NoPages:
    """A scheduler or worker without the HTTP server that Dask always starts."""

    def start_http_server(self, *_: object, **__: object) -> None:
        pass


class _Scheduler(_NoPages, distributed.Scheduler):
    pass


class _Worker(_NoPages, distributed.Worker):
    pass


@contextmanager
def _local(count: int, folder: Path, dashboard: bool) -> Iterator[distributed.Client]:
    security = distributed.Security.temporary()
    common = {"host": LOCAL, "protocol": "tls://", "security": security}
    pages = {"dashboard": dashboard, "dashboard_address": f"{LOCAL}:0" if dashboard else None}
    kind = distributed.Scheduler if dashboard else _Scheduler
    options = {
        "worker_class": _Worker,
        "nthreads": 1,
        "memory_limit": 1 / count,  # share of the machine's memory
        "local_directory": str(folder),
        "silence_logs": logging.CRITICAL,
    }
    with ExitStack() as stack:
        with uninterrupted():  # a cluster that is half made cannot be closed
            # without workers at first: one that dies while it starts would end the cluster
            try:
                made = distributed.SpecCluster(
                    scheduler={"cls": kind, "options": common | pages},
                    worker={"cls": distributed.Nanny, "options": common | options},
                    security=security,
                    silence_logs=logging.CRITICAL,
                )
            except RuntimeError as error:  # it waits for a connection until it gives up
                text = f"the campaign's processes cannot connect at {LOCAL}"
                raise UserError(f"{text}: {one_line(error)}") from error
            client = stack.enter_context(distributed.Client(stack.enter_context(made)))
        made.sync(_keep_signals_from_children)
        keeper = PeriodicCallback(partial(_keep_workers, made, count), RESTART_EVERY)
        stack.callback(made.loop.add_callback, keeper.stop)
        made.loop.add_callback(keeper.start)
        made.scale(count)
        with suppress(TimeoutError):  # the campaign begins with those that are there
            client.wait_for_workers(count, timeout=WAIT)
        yield client


async def _keep_signals_from_children() -> None:
    """Block signals of the terminal in this thread, for all processes that it will start."""
    if hasattr(signal, "pthread_sigmask"):
        block = partial(signal.pthread_sigmask, signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
        block()
        multiprocessing.resource_tracker.ensure_running()  # unblocks SIGINT again
        block()


def _keep_workers(made: distributed.SpecCluster, count: int) -> None:
    """Replace workers that died while starting; nannies restart the others."""
    for name, nanny in list(made.workers.items()):
        if nanny.status in (Status.failed, Status.closed):
            del made.workers[name]
    made.scale(count)


# ---- Certificates --------------------------------------------------------------------------------
def security_for(
    address: str, ca: Path | None, cert: Path | None, key: Path | None
) -> distributed.Security | None:
    """Return the TLS settings of a client of the scheduler at `address`; None without certificates.

    Files in PEM form; Dask's configuration has those that are not given. UserError if they do not
    fit the address or cannot be used.
    """
    given = dict(zip(OPTIONS, (ca, cert, key), strict=True))
    named = [option for option, path in given.items() if path is not None]
    if not address.startswith(TLS):
        if named:
            raise UserError(f"{named[0]}: {address} takes no certificates, expected {EXPECTED}")
        return None
    if not named:
        return _configured_security(address)
    if len(named) < len(OPTIONS):
        missing = ", ".join(option for option in OPTIONS if option not in named)
        raise UserError(f"{missing}: missing, {address} needs {', '.join(OPTIONS)}")
    _check_credentials(ca, cert, key)
    files = {"tls_ca_file": str(ca), "tls_client_cert": str(cert), "tls_client_key": str(key)}
    return distributed.Security(require_encryption=True, **files)


def _configured_security(address: str) -> distributed.Security:
    made = distributed.Security(require_encryption=True)
    ca, cert, key = made.tls_ca_file, made.tls_client_cert, made.tls_client_key
    if not ca or not cert:
        options = f"{', '.join(OPTIONS)}, or those of Dask's configuration"
        raise UserError(f"{address}: needs certificates: {options}")
    if not any("\n" in text for text in (ca, cert, key or "")):  # else not files, but their text
        _check_credentials(Path(ca), Path(cert), Path(key or cert))
    return made


def _check_credentials(ca: Path, cert: Path, key: Path) -> None:
    """Load the files as Dask does, but never ask for a password on the terminal."""
    for path in (ca, cert, key):
        try:
            with placed(path):
                check_regular(path)
            os.close(os.open(path, os.O_RDONLY))
        except OSError as error:
            raise UserError(f"{path}: cannot be read: {reason(error)}") from None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(ca)
    except OSError:
        raise UserError(f"{ca}: is not the certificate of an authority in PEM form") from None
    try:
        context.load_cert_chain(cert, key, password=lambda: "")
    except OSError:
        expected = "a certificate and its private key without a password, in PEM form"
        raise UserError(f"{cert}, {key}: are not {expected}") from None
