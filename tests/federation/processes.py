"""Processes of federations, as users start them."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from tests.support.hosts import LOOPBACK, Host
from tests.support.paths import ROOT
from tests.support.ssp_files import SSP, edited, replace

LIMIT = 120.0  # s, far above what an end takes
SILENCE = "30"  # s, above what processes take to start on a busy machine
Process = subprocess.Popen
Start = Callable[..., Process]  # by arguments of the command line, and the host


@contextmanager
def starting(temporary: Path) -> Iterator[Start]:
    """Starts commands in sessions of their own, here or on another host; none is left.

    Their temporary files are in the folder `temporary`.
    """
    temporary.mkdir()
    started: list[Process] = []

    def start(*arguments: str, host: Host = LOOPBACK) -> Process:
        made = subprocess.Popen(
            [*host.enter, sys.executable, "-m", "rparm", *arguments],
            cwd=ROOT,
            env=os.environ | {"TMPDIR": str(temporary)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        started.append(made)
        return made

    try:
        yield start
    finally:
        for process in started:
            with _left_of(process) as children:
                process.kill()
                process.wait()
                process.stdout.close()
            for child in children:
                child.kill()


@contextmanager
def _left_of(process: Process) -> Iterator[list[psutil.Process]]:
    """Children of a process, of which the list keeps those that are still there at the end."""
    try:
        children = psutil.Process(process.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        children = []
    yield children
    children[:] = [c for c in children if c.is_running() and c.status() != psutil.STATUS_ZOMBIE]


def federation(start: Start, *arguments: str, system: Path = SSP, host: Host = LOOPBACK) -> Process:
    """The nominal variant, with its broker."""
    return start("federation", "nominal", "--ssp", str(system), *arguments, host=host)


def long(folder: Path) -> Path:
    """The same system, whose run does not end before something else ends it."""
    change = {"SystemStructure.ssd": replace('stopTime="6"', 'stopTime="600"')}
    return edited(SSP, folder / "Long.ssp", change)


def wait_for_steps(process: Process) -> None:
    """Read what a federation with components elsewhere prints, until it steps them."""
    assert any(line.startswith("connected: ") for line in process.stdout), "no steps"


def ended(process: Process, code: int = 0) -> str:
    """What a process prints that ends by itself, with this code."""
    text, _ = process.communicate(timeout=LIMIT)
    assert process.returncode == code, text
    return text
