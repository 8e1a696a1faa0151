"""The cluster that runs a campaign: of this machine's cores, or of a scheduler elsewhere.

Who can talk to Dask's processes runs code as their user. Those of this machine listen on loopback,
where its other users are too, so they talk by TLS with a certificate that only they have.
"""

import logging
import multiprocessing.resource_tracker
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

import dask
from dask.system import CPU_COUNT
from distributed import Client, Nanny, Scheduler, Security, SpecCluster, Worker
from distributed.core import Status
from tornado.ioloop import PeriodicCallback

from rparm.errors import UserError, one_line
from rparm.interruption import uninterrupted

LOCAL = "127.0.0.1"
KILLS = 5  # workers that may die in a task before it counts as failed
RESTART_EVERY = 2000  # ms
WAIT = 60  # s, for workers to start

SETTINGS = {
    "distributed.scheduler.allowed-failures": KILLS,
    "distributed.comm.timeouts.connect": "20s",
    # what watches workers many times a second takes three per cent of a core, for nothing here
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.worker.memory.terminate": False,  # the system decides when memory is short
}


@contextmanager
def opened(
    scheduler: str | None,
    workers: int | None,
    folder: Path,
    security: Security | None = None,
    dashboard: bool = False,
) -> Iterator[Client]:
    """A cluster's client; UserError if the scheduler cannot be reached.

    Without the address of a scheduler that runs elsewhere, and certificates for it, the cluster is
    made on this machine: `workers` processes, by default one per core, with their files in
    `folder`. There, Dask shows its pages (`dashboard`) to all users, who can change nothing.
    """
    logging.disable(logging.CRITICAL)  # what is wrong is said by the errors that are raised here
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
def _connected(address: str, security: Security | None) -> Iterator[Client]:
    try:
        client = Client(address, timeout=20, security=security)
    except (TimeoutError, OSError, ValueError, RuntimeError) as error:
        raise UserError(f"{address}: the scheduler cannot be reached: {one_line(error)}") from None
    with client:
        yield client


# ---- On this machine -----------------------------------------------------------------------------


class _NoPages:
    """A scheduler or worker without the HTTP server that Dask always starts."""

    def start_http_server(self, *_: object, **__: object) -> None:
        pass


class _Scheduler(_NoPages, Scheduler):
    pass


class _Worker(_NoPages, Worker):
    pass


@contextmanager
def _local(count: int, folder: Path, dashboard: bool) -> Iterator[Client]:
    security = Security.temporary()
    common = {"host": LOCAL, "protocol": "tls://", "security": security}
    scheduler = {
        "cls": Scheduler if dashboard else _Scheduler,
        "options": {
            **common,
            "dashboard": dashboard,
            "dashboard_address": f"{LOCAL}:0" if dashboard else None,
        },
    }
    worker = {
        "cls": Nanny,
        "options": {
            **common,
            "worker_class": _Worker,
            "nthreads": 1,
            "memory_limit": 1 / count,  # share of the machine's memory
            "local_directory": str(folder),
            "silence_logs": logging.CRITICAL,
        },
    }
    with ExitStack() as stack:
        with uninterrupted():  # a cluster that is half made cannot be closed
            # without workers at first: one that dies while it starts would end the cluster
            try:
                made = SpecCluster(
                    scheduler=scheduler,
                    worker=worker,
                    security=security,
                    silence_logs=logging.CRITICAL,
                )
            except RuntimeError as error:  # it waits for a connection until it gives up
                raise UserError(
                    f"the campaign's processes cannot connect at {LOCAL}: {one_line(error)}"
                ) from error
            client = stack.enter_context(Client(stack.enter_context(made)))
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


def _keep_workers(made: SpecCluster, count: int) -> None:
    """Replace workers that died while starting; nannies restart the others."""
    for name, nanny in list(made.workers.items()):
        if nanny.status in (Status.failed, Status.closed):
            del made.workers[name]
    made.scale(count)
