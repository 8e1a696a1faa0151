"""Kills workers at random, fills the disk: the campaign has the same table.

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
    completed,
    finish,
    start,
    table,
    wait_for,
    workers,
)
from tests.campaign.files import write

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
