"""Campaigns that are stopped, killed or lose workers give the table of an undisturbed one."""

import os
import shutil
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
    workers,
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_campaign_says_so(number: int, file: Path, tmp_path: Path) -> None:
    process = start(file, tmp_path, "--workers", 1)
    wait_for(lambda: blocks(tmp_path) >= 1)
    os.kill(process.pid, number)
    code, _, err = finish(process)
    assert code == 128 + number
    assert "stopped; the same command goes on from what is there" in err
    assert "Traceback" not in err
    assert not list(tmp_path.glob(".*"))


def test_a_campaign_outlives_its_workers(file: Path, undisturbed: str, tmp_path: Path) -> None:
    process = start(file, tmp_path, "--workers", 2)
    for least in (1, 8):
        wait_for(lambda least=least: blocks(tmp_path) >= least and len(workers(process)) > 0)
        os.kill(workers(process)[0], signal.SIGKILL)
    code, out, err = finish(process)
    assert code == 0, err
    assert table(out) == undisturbed


def test_a_damaged_block_is_run_again(file: Path, undisturbed: str, tmp_path: Path) -> None:
    folder = tmp_path / "output"
    shutil.copytree(file.parent / "undisturbed", folder)
    first, second = sorted(folder.glob("blocks/*"))[:2]
    first.write_bytes(first.read_bytes()[:-100])
    second.unlink()
    code, out, _ = finish(start(file, folder, "--workers", 1))
    assert code == 0 and table(out) == undisturbed
    assert f"goes on: {RUNS - 2 * BLOCK} of {RUNS}" in out


def test_another_campaign_does_not_mix_in(file: Path, undisturbed: str, tmp_path: Path) -> None:
    other = write(tmp_path, changes=[*CHANGES, ("[1.0, 3.0]", "[1.0, 3.5]")])
    code, _, err = finish(start(other, file.parent / "undisturbed"))
    assert code == 2 and "has another campaign: the folder holds the results of another" in err
    assert undisturbed == completed(file, file.parent / "undisturbed")
