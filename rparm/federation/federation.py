"""A federation: the broker, a process for each component, and the one that records."""

import itertools
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rparm import project
from rparm.errors import UserError
from rparm.federation import SILENCE
from rparm.federation.component import LEAVE, POLL, Part, Silence, parts, run_watched
from rparm.federation.network import ABSENT, ANSWER, ENDED, Broker, Federate
from rparm.interruption import temporary_folder, uninterrupted
from rparm.project import VERSIONS
from rparm.systems.structure import OpenedSystem

RECORDER = "recorder"


@dataclass(frozen=True, eq=False)
class Record:
    """Published values of the components at each communication point."""

    names: tuple[str, ...]  # component.variable, of all Real outputs
    times: np.ndarray  # (rows,) s
    values: np.ndarray  # (rows, len(names)) in the variables' units
    wall_time: float  # s, of all steps


def arguments(
    ssp: Path, variant: str, component: str, address: str, fmi: str = VERSIONS[0]
) -> list[str]:
    """Return the arguments that step a component on this machine or on another one."""
    names = [ssp.as_posix(), variant, component]
    return ["federate", *names, "--fmi", fmi, "--broker", address]


def run(
    ssp: OpenedSystem,
    variant: str,
    address: str,
    elsewhere: Collection[str] = (),
    silence: float = SILENCE,
    progress: Callable[[int], object] = lambda _: None,
    connected: Callable[[], object] = lambda: None,
) -> Record:
    """Run a variant, each component in its own process, with the broker at `address`.

    Components `elsewhere` are stepped by other machines. A process that is silent for `silence` s
    ends the federation. `progress` gets the number of steps made; `connected` is called before the
    first step. UserError if a process fails, with the first text that one of them gave.
    """
    made = parts(ssp, variant)
    whole = next(iter(made.values())).system
    local = [component for component in made if component not in elsewhere]
    further = ["--silence", str(silence), "--owned"]
    started = {c: [*arguments(ssp.path, variant, c, address, ssp.version), *further] for c in local}
    recorder = Federate(RECORDER, address, list(made), publishes=False)
    with (
        temporary_folder() as folder,
        _opened(len(made) + 1, address, whole, recorder, silence) as broker,
        _processes(started, folder) as processes,
    ):
        still, stuck = Silence(recorder, silence), Silence(recorder, 2.0 * silence)
        ended = itertools.count()  # looks since a process here has failed, perhaps at the end

        def look() -> None:
            failure = _failure(processes, folder)
            texts = _texts(processes, folder)
            if texts and not failure and next(ended) * POLL > ANSWER:
                failure = UserError(texts[0])  # it has not
            if failure:
                raise failure
            if still.too_long():
                # one without inputs may be far ahead, and at the end
                there = [c for c in made if c in elsewhere or processes[c].poll() is None]
                silent = broker.silent(there, () if recorder.all_here else elsewhere)
                if silent:
                    verb = "have" if len(silent) > 1 else "has"
                    names = ", ".join(silent)
                    raise UserError(f"{names} {verb} been silent for {silence:g} s (--silence)")
            if stuck.too_long() and recorder.all_here:
                raise UserError(f"all answer, but nothing has moved for {2.0 * silence:g} s")

        def end(error: BaseException) -> None:
            broker.end(str(error) if isinstance(error, UserError) else "it was interrupted")

        try:
            return run_watched(lambda: _recorded(recorder, made, progress, connected), look, end)
        except UserError as error:
            _wait(processes)
            raise _failure(processes, folder) or error from error


@contextmanager
def _opened(
    count: int, address: str, system: str, recorder: Federate, silence: float
) -> Iterator[Broker]:
    """Open a federation that the recorder has joined, so that nobody else steps it."""
    still = Silence(recorder, silence)

    def work() -> Broker:
        with ExitStack() as stack:
            broker = stack.enter_context(Broker(count, address))
            with broker.shielded():
                recorder.join()
            broker.announce(system)
            stack.pop_all()
            return broker

    def look() -> None:
        if still.too_long():
            raise UserError(f"no broker at {address}: HELICS has not returned for {silence:g} s")

    with run_watched(work, look, lambda _: None) as broker:
        yield broker


def _recorded(
    recorder: Federate,
    made: Mapping[str, Part],
    progress: Callable[[int], object],
    connected: Callable[[], object],
) -> Record:
    """Follow the federation to its end, and record what is published."""
    first = next(iter(made.values()))
    names = tuple(f"{c}.{output}" for c, part in made.items() for output in part.published)
    rows = np.empty((len(first.times), len(names)))

    def read(point: int) -> None:
        published = recorder.read()
        rows[point] = [value for component in made for value in published[component]]

    recorder.enter_initialization()
    for _ in range(2 * first.rounds):  # before and after the end of initialization
        recorder.exchange()
    recorder.begin()
    read(0)
    connected()
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
    commands: Mapping[str, list[str]], folder: Path
) -> Iterator[dict[str, subprocess.Popen]]:
    """Start processes by component, texts in files of `folder`; they end as their input closes."""
    places = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))
    environment = project.child_environment() | places
    processes: dict[str, subprocess.Popen] = {}
    try:
        for component, command in commands.items():
            with (folder / str(len(processes))).open("wb") as log, uninterrupted():
                streams = {"stdin": subprocess.PIPE, "stdout": log, "stderr": subprocess.STDOUT}
                whole = [sys.executable, "-P", "-m", "rparm", *command]
                processes[component] = subprocess.Popen(whole, env=environment, **streams)
        yield processes
    finally:
        for process in processes.values():
            process.stdin.close()
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


def _failure(processes: Mapping[str, subprocess.Popen], folder: Path) -> UserError | None:
    """Return the error of a local process, but not that the federation has ended."""
    texts = _texts(processes, folder)
    causes = (text for text in texts if ENDED not in text and ABSENT not in text)
    return next(map(UserError, causes), None)


def _texts(processes: Mapping[str, subprocess.Popen], folder: Path) -> list[str]:
    """Return the last texts of processes that have failed."""
    texts = []
    for number, (component, process) in enumerate(processes.items()):
        if process.poll() in (None, 0):
            continue
        lines = (folder / str(number)).read_text(encoding="utf-8", errors="replace").splitlines()
        text = lines[-1].removeprefix("error: ") if lines else f"{component}: failed silently"
        if process.returncode < 0:
            text = f"{component}: its process was ended by signal {-process.returncode}"
        texts.append(text)
    return texts
