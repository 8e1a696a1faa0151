"""Campaigns that are stopped or killed go on, and give the table of an undisturbed one.

long_kills.py kills workers and fills the disk.
"""

import os
import signal
from pathlib import Path

import pytest

from cosim.campaign import bases, campaign_file, engine, planning
from cosim.campaign.points import Points
from cosim.campaign.results import Results
from cosim.errors import UserError
from tests.campaign.files import write
from tests.campaign.hosts import LOOPBACK
from tests.campaign.processes import (
    blocks,
    cluster,
    completed,
    finish,
    kill_group,
    registered,
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


def test_a_campaign_whose_workers_are_gone_ends(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "PATIENCE", 1)
    monkeypatch.setattr(engine, "COUNT_EVERY", 100)
    campaign = campaign_file.read(file)
    with (
        bases.opened(campaign, None) as base,
        cluster(LOOPBACK, [LOOPBACK]) as (address, _, arms),
        engine.cluster(address, None, tmp_path) as client,
    ):
        registered(arms[0])
        job = planning.plan(campaign, base, file)
        points = Points(campaign, planning.constants(campaign, base))
        results = Results(tmp_path, campaign, job, "")
        results.begin()
        made = engine.Engine(client, campaign, job, base.archives, points, results)
        with pytest.raises(UserError, match="has no workers any more; the same command goes on"):
            made.run(range(campaign.blocks), lambda _: kill_group(arms[0]))
