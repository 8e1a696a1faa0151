"""The runs of a campaign by plain processes: what the engine and Dask take is what they do not."""

import multiprocessing
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import Connection

import numpy as np
import psutil

from rparm.campaign.job import Job
from rparm.campaign.runs import Workshop


def _serve(connection: Connection, job: Job, archives: Mapping[str, bytes]) -> None:
    workshop = Workshop(job, archives, None)
    while (blocks := connection.recv()) is not None:
        for targets in blocks:
            rows = workshop.rows(range(len(targets)), targets)
            assert not any(rows.failures)
        connection.send("done")
    workshop.close()


class PlainProcesses:
    """Processes that make runs, each its share."""

    def __init__(self, connections: list[Connection], processes: list[psutil.Process]) -> None:
        self._connections, self._processes = connections, processes

    def run(self, targets: np.ndarray, block: int) -> tuple[float, float]:
        """Make runs (runs, targets) in blocks; wall time and processor time in s."""
        blocks = np.split(targets, range(block, len(targets), block))
        before, begin = self._processor(), time.perf_counter()
        for i, connection in enumerate(self._connections):
            connection.send(blocks[i :: len(self._connections)])
        for connection in self._connections:
            connection.recv()
        return time.perf_counter() - begin, self._processor() - before

    def _processor(self) -> float:
        return sum(sum(process.cpu_times()[:2]) for process in self._processes)


@contextmanager
def plain_processes(
    count: int, job: Job, archives: Mapping[str, bytes]
) -> Iterator[PlainProcesses]:
    """Processes that wait for work."""
    context = multiprocessing.get_context("spawn")
    pipes = [context.Pipe() for _ in range(count)]
    processes = [
        context.Process(target=_serve, args=(other, job, archives), daemon=True)
        for _, other in pipes
    ]
    for process in processes:
        process.start()
    try:
        yield PlainProcesses([end for end, _ in pipes], [psutil.Process(p.pid) for p in processes])
    finally:
        for (end, _), process in zip(pipes, processes, strict=True):
            end.send(None)
            process.join()
