"""Campaigns that are stopped or killed go on, and give the table of an undisturbed one.

long_kills.py kills workers and fills the disk.
"""

import os
import signal
from pathlib import Path

import pytest

from tests.campaign.files import write
from tests.campaign.processes import (
    blocks,
    completed,
    finish,
    kill_group,
    start,
    table,
    wait_for,
)

RUNS, BLOCK = 240, 6
CHANGES = [("runs = 40", f"runs = {RUNS}"), ("block = 8", f"block = {BLOCK}")]
CHANGES += [("time = { stop = 1.0 }\n", "")]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("campaign"), changes=CHANGES)


@pytest.fixture(scope="module")
def undisturbed(file: Path) -> str:
    return completed(file, file.parent / "undisturbed", "--workers", 1)


def files(folder: Path) -> dict[str, bytes]:
    """All results, by name."""
    found = [*folder.glob("blocks/*"), *folder.glob("trajectories/*")]
    return {path.name: path.read_bytes() for path in found}


def test_a_killed_campaign_goes_on(file: Path, undisturbed: str, tmp_path: Path) -> None:
    process = start(file, tmp_path, "--workers", 2)
    wait_for(lambda: blocks(tmp_path) >= 3)
    kill_group(process)
    process.communicate()
    there = blocks(tmp_path)
    assert 3 <= there < RUNS // BLOCK
    code, out, err = finish(start(file, tmp_path, "--workers", 2))
    assert code == 0, err
    assert f"goes on: {there * BLOCK} of {RUNS} runs are there" in out
    assert table(out) == undisturbed
    assert files(tmp_path) == files(file.parent / "undisturbed")
    assert not list(tmp_path.glob(".*"))  # what the killed one has left is removed


def test_a_stopped_campaign_says_so(file: Path, tmp_path: Path) -> None:
    process = start(file, tmp_path, "--workers", 1)
    wait_for(lambda: blocks(tmp_path) >= 1)
    os.kill(process.pid, signal.SIGINT)
    code, _, err = finish(process)
    assert code == 128 + signal.SIGINT
    assert "stopped; the same command goes on from what is there" in err
    assert "Traceback" not in err
    assert not list(tmp_path.glob(".*"))
