"""Kills workers, the scheduler and the campaign, loses links, fills the disk: the same table.

    build/venv/bin/python -m tests.campaign.cluster.long_kills

Takes some minutes. ctest -C Long -R long_campaign_kills runs it.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.campaign.cluster.processes import (
    blocks,
    cluster,
    completed,
    finish,
    kill_group,
    registered,
    start,
    table,
    wait_for,
    workers,
)
from tests.campaign.files import write
from tests.support.hosts import LOOPBACK, Network, NotPermittedError, network

RUNS, KILLS = 2400, 20
PAUSE = 0.5  # s, between two kills
DISK = 8_000_000  # bytes: room for all, until something else takes it
STEPS = [("runs = 40", f"runs = {RUNS}"), ("block = 8", "block = 6")]
STEPS += [("time = { stop = 1.0 }\n", "")]


def kill_workers(file: Path, output: Path, undisturbed: str) -> None:
    """Kill workers at random, without end of the campaign."""
    process = start(file, output, "--workers", 2)
    killed = 0
    while killed < KILLS and process.poll() is None:
        alive = workers(process)
        if alive and blocks(output) > 0:
            os.kill(random.choice(alive), signal.SIGKILL)
            killed += 1
        time.sleep(PAUSE)
    code, out, err = finish(process)
    assert killed == KILLS, f"only {killed} workers killed, the campaign is too short"
    assert code == 0, err
    assert table(out) == undisturbed


def kill_campaign(file: Path, output: Path, undisturbed: str) -> None:
    """Kill the campaign, its scheduler and its workers, again and again until it is done."""
    killed = 0
    while True:
        process = start(file, output, "--workers", 2)
        goal = blocks(output) + 50
        wait_for(lambda goal=goal, process=process: process.poll() is not None
                 or blocks(output) >= goal)  # fmt: skip
        if process.poll() is not None:
            break
        kill_group(process)
        process.communicate()
        killed += 1
    code, out, err = finish(process)
    assert killed >= 3 and code == 0, err
    assert table(out) == undisturbed


def stop_by_signals(file: Path, output: Path, undisturbed: str) -> None:
    """End it by the signals that end programs."""
    for number in (signal.SIGINT, signal.SIGTERM):
        process = start(file, output, "--workers", 2)
        goal = blocks(output) + 5
        wait_for(lambda goal=goal: blocks(output) >= goal)
        os.kill(process.pid, number)
        code, _, err = finish(process)
        assert code == 128 + number and "stopped; the same command" in err, (code, err)
    assert completed(file, output) == undisturbed


def kill_scheduler(file: Path, output: Path, undisturbed: str) -> None:
    """Kill a scheduler that runs elsewhere; another one takes over."""
    with cluster(LOOPBACK, [LOOPBACK, LOOPBACK]) as (address, scheduler, _):
        process = start(file, output, "--scheduler", address)
        wait_for(lambda: blocks(output) >= 5)
        os.kill(scheduler.pid, signal.SIGKILL)
        code, _, err = finish(process)
        assert code == 2 and "the scheduler is gone" in err, err
    with cluster(LOOPBACK, [LOOPBACK]) as (address, *_):
        assert completed(file, output, "--scheduler", address) == undisturbed
    code, _, err = finish(start(file, output / "none", "--scheduler", "tcp://127.0.0.1:9"))
    assert code == 2 and "the scheduler cannot be reached" in err, err


def lose_links(file: Path, output: Path, undisturbed: str) -> None:
    """Lose links to a worker, to all, to the scheduler, with the time-outs of Dask."""
    try:
        with network() as made:
            _lose_links(file, output, undisturbed, made)
    except (FileNotFoundError, NotPermittedError) as error:
        print(f"  left out: {error}")


def _lose_links(file: Path, output: Path, undisturbed: str, apart: Network) -> None:
    here, there = apart.here, apart.there

    def cut_in(folder: Path, address: str) -> tuple[int, str, str]:
        """A campaign during which the link is lost."""
        process = start(file, folder, "--scheduler", address, host=here)
        wait_for(lambda: blocks(folder) >= 5)
        apart.cut()
        assert process.poll() is None
        result = finish(process)
        apart.mend()
        return result

    with cluster(here, [here, there]) as (address, _, arms):
        registered(arms[1])
        code, out, err = cut_in(output / "one", address)
        assert code == 0, err
        assert table(out) == undisturbed
    with cluster(here, [there, there]) as (address, *_):
        code, _, err = cut_in(output / "all", address)
        assert code == 2 and "has no workers any more; the same command resumes" in err, err
    with cluster(there, [there, there]) as (address, *_):
        options = ("--scheduler", address)
        assert completed(file, output / "all", *options, host=here) == undisturbed
        code, _, err = cut_in(output / "scheduler", address)
        assert code == 2 and "the scheduler is gone; the same command resumes" in err, err
        assert completed(file, output / "scheduler", *options, host=here) == undisturbed


def fill_disk(file: Path, output: Path, undisturbed: str) -> None:
    """Write to a disk that something else fills, then to one with room again."""
    output.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(output)]
    if subprocess.run(mount, check=False, capture_output=True).returncode:
        print("  left out: no file system can be mounted here")
        return
    try:
        process = start(file, output, "--workers", 2)
        wait_for(lambda: blocks(output) >= 5)
        filler = output / "filler"
        with suppress(OSError), filler.open("wb", buffering=0) as other:
            while True:
                other.write(bytes(4096))
        code, _, err = finish(process)
        assert code == 2 and "No space left on device; the same command resumes" in err, err
        there = blocks(output)
        assert 0 < there < RUNS // 6
        filler.unlink()
        code, out, err = finish(start(file, output, "--workers", 2))
        assert code == 0, err
        assert f"resumes: {there * 6} of {RUNS} runs" in out
        assert table(out) == undisturbed
    finally:
        subprocess.run(["umount", "-l", str(output)], check=False)


TRIALS: tuple[Callable[[Path, Path, str], None], ...] = (
    kill_workers,
    kill_campaign,
    stop_by_signals,
    kill_scheduler,
    lose_links,
    fill_disk,
)


def main() -> int:
    """Make all trials; 0 if they pass."""
    names = sys.argv[1:]
    with TemporaryDirectory() as name:
        folder = Path(name)
        file = write(folder, changes=STEPS)
        undisturbed = completed(file, folder / "undisturbed", "--workers", 1)
        for trial in TRIALS:
            if names and trial.__name__ not in names:
                continue
            begin = time.monotonic()
            print(f"{trial.__name__}: {trial.__doc__.splitlines()[0]}", flush=True)
            trial(file, folder / trial.__name__, undisturbed)
            print(f"  the same table, {time.monotonic() - begin:.0f} s", flush=True)
            shutil.rmtree(folder / trial.__name__, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
