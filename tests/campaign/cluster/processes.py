"""Campaigns in processes of their own, to be killed; schedulers and workers apart."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

from tests.support.hosts import LOOPBACK, Host
from tests.support.paths import ROOT

PATIENCE = 900  # s; a busy machine is slow
WITH_PARENT = ("setpriv", "--pdeathsig", "KILL")  # nothing is left of tests that are killed
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}


def python(*arguments: object, host: Host = LOOPBACK, input: bool = False) -> subprocess.Popen:
    """A Python program in another process group, which ends with this program."""
    return subprocess.Popen(
        [*host.enter, *WITH_PARENT, sys.executable, "-P", "-m", *map(str, arguments)],
        stdin=subprocess.PIPE if input else None,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
        start_new_session=True,
        preexec_fn=_heed_signals,
    )


def _heed_signals() -> None:
    """Undo what shells do to programs in the background: they ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start(file: Path, output: Path, *options: object, host: Host = LOOPBACK) -> subprocess.Popen:
    """Begin a campaign."""
    return python("rparm", "campaign", file, "--output", output, *options, host=host)


def finish(process: subprocess.Popen) -> tuple[int, str, str]:
    """Exit code and output of a program that ends by itself."""
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        kill_group(process)
        out, err = process.communicate()
        raise AssertionError(f"did not end: {out}\n{err}") from None
    return process.returncode, out, err


def kill_group(process: subprocess.Popen) -> None:
    """Kill a program and all that it started."""
    os.killpg(process.pid, signal.SIGKILL)


def table(out: str) -> str:
    """Hash of the table that a campaign prints."""
    return re.search(r"^table: ([0-9a-f]{64})$", out, re.MULTILINE)[1]


def completed(file: Path, output: Path, *options: object, host: Host = LOOPBACK) -> str:
    """Run a campaign to its end; the hash of its table."""
    code, out, err = finish(start(file, output, *options, host=host))
    assert code == 0, err
    return table(out)


def wait_for(condition: Callable[[], bool]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


def blocks(output: Path) -> int:
    """Blocks whose results are there."""
    return len(list(output.glob("blocks/block_*.parquet")))


def workers(process: subprocess.Popen) -> list[int]:
    """Workers of a local cluster."""
    found = []
    for child in psutil.Process(process.pid).children():
        with suppress(psutil.NoSuchProcess):
            found += [child.pid] * any("spawn_main" in word for word in child.cmdline())
    return found


@contextmanager
def cluster(
    scheduler: Host, workers: Sequence[Host], certificates: Sequence[Path] = ()
) -> Iterator[tuple[str, subprocess.Popen, list[subprocess.Popen]]]:
    """Address of a scheduler, its process and those of workers, a process group each.

    They talk by TLS if there are `certificates`: files of the authority's, their own, and its key.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    protocol = "tls" if certificates else "tcp"
    address = f"{protocol}://{scheduler.address}:{port}"
    common = ["--no-dashboard", "--protocol", protocol]
    for name, path in zip(("ca-file", "cert", "key"), certificates, strict=False):
        common += [f"--tls-{name}", path]
    place = ("--host", scheduler.address, "--port", port)
    made = [python("dask", "scheduler", *place, *common, host=scheduler)]
    options = (address, "--nthreads", 1, "--no-nanny", *common)
    made += [python("dask", "worker", *options, host=host) for host in workers]
    try:
        yield address, made[0], made[1:]
    finally:
        for process in made:
            if process.poll() is None:
                kill_group(process)
            process.communicate()


def registered(worker: subprocess.Popen) -> None:
    """Wait until a worker of a cluster has found its scheduler."""
    assert any("Registered to" in line for line in worker.stderr), "the worker has ended"
