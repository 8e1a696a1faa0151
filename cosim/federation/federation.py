"""A federation: the broker, a process for each component, and the one that records."""

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cosim import project
from cosim.errors import UserError
from cosim.federation import network
from cosim.federation.network import Federate
from cosim.federation.parts import Part, parts
from cosim.system.ssp import Ssp

RECORDER = "recorder"
FOLLOWS = "federation"  # is in what processes say that others have stopped
POLL = 0.05  # s, between two looks at the processes
LEAVE = 2.0  # s, for processes to end after others have


@dataclass(frozen=True, eq=False)
class Record:
    """What the components published at each communication point."""

    names: tuple[str, ...]  # component.variable, of all Real outputs
    times: np.ndarray  # (rows,) s
    values: np.ndarray  # (rows, len(names)) in the variables' units
    wall_time: float  # s, of all steps


def free_address() -> str:
    """An address on this machine at which nothing listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"{network.LOCAL}:{probe.getsockname()[1]}"


def command(ssp: Path, variant: str, component: str, address: str) -> list[str]:
    """The command that steps a component, on this machine or on another one with the same files."""
    return ["-m", "cosim", "federate", str(ssp), variant, component, "--broker", address]


def run(
    ssp: Ssp,
    variant: str,
    address: str,
    elsewhere: Collection[str] = (),
    progress: Callable[[int], object] = lambda _: None,
) -> Record:
    """Run a variant, each component in its own process.

    Parameters
    ----------
    ssp : Ssp
    variant : str
    address : str
        Where the broker listens, as "tcp://127.0.0.1:23404".
    elsewhere : collection of str
        Components that other machines step: they are waited for.
    progress : callable, optional
        Called with the number of steps made.

    Raises
    ------
    UserError
        If a process fails; its text is the first one that one of them gave.
    """
    made = parts(ssp, variant)
    with TemporaryDirectory(prefix="cosim-") as name, network.broker(len(made) + 1, address) as end:
        folder = Path(name)
        local = {c: command(ssp.path, variant, c, address) for c in made if c not in elsewhere}
        with _processes(local, folder, end) as processes:
            try:
                return _recorded(made, address, progress)
            except UserError as error:
                _wait(processes)
                raise _first_failure(processes, folder) or error from error


def _recorded(made: Mapping[str, Part], address: str, progress: Callable[[int], object]) -> Record:
    """Follow the federation to its end, and record what is published."""
    recorder = Federate(RECORDER, address, list(made), publishes=False)
    first = next(iter(made.values()))
    names = tuple(f"{c}.{output}" for c, part in made.items() for output in part.published)
    rows = np.empty((len(first.times), len(names)))

    def read(point: int) -> None:
        published = recorder.read()
        rows[point] = [value for component in made for value in published[component]]

    recorder.enter_initialization()
    for _ in range(first.rounds):
        recorder.exchange()
    recorder.begin()
    read(0)
    begin = time.perf_counter()
    for point in range(1, len(rows)):
        recorder.go_to(point)
        read(point)
        if point % 100 == 0:
            progress(100)
    wall_time = time.perf_counter() - begin
    recorder.leave()
    return Record(names, first.times, rows, wall_time)


# ---- Processes -----------------------------------------------------------------------------------


@contextmanager
def _processes(
    commands: Mapping[str, list[str]], folder: Path, end: Callable[[str], None]
) -> Iterator[dict[str, subprocess.Popen]]:
    """Processes by component, watched: where one fails, the federation ends. None is left."""
    environment = os.environ | {"PYTHONPATH": str(project.ROOT)}
    processes: dict[str, subprocess.Popen] = {}
    is_over = threading.Event()

    def watch() -> None:
        while not is_over.wait(POLL):
            if any(process.poll() not in (None, 0) for process in processes.values()):
                end("a process has failed")
                return

    watcher = threading.Thread(target=watch, daemon=True)
    try:
        for component, arguments in commands.items():
            with (folder / component).open("wb") as log:
                processes[component] = subprocess.Popen(
                    [sys.executable, "-P", *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=environment,
                )
        watcher.start()
        yield processes
    finally:
        is_over.set()
        _wait(processes)
        for process in processes.values():
            process.kill()
            process.wait()


def _wait(processes: Mapping[str, subprocess.Popen]) -> None:
    """Wait until all processes have ended, but not for long: some may still be starting."""
    latest = time.monotonic() + LEAVE
    for process in processes.values():
        with suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, latest - time.monotonic()))


def _first_failure(processes: Mapping[str, subprocess.Popen], folder: Path) -> UserError | None:
    """What the process says that failed first: the others only say that the federation ended."""
    texts = []
    for component, process in processes.items():
        if process.returncode in (None, 0):
            continue
        lines = (folder / component).read_text(encoding="utf-8", errors="replace").splitlines()
        text = lines[-1].removeprefix("error: ") if lines else f"{component}: failed silently"
        if process.returncode < 0:
            text = f"{component}: its process was ended by signal {-process.returncode}"
        texts.append(text)
    texts.sort(key=lambda text: FOLLOWS in text)
    return UserError(texts[0]) if texts else None
