"""Scheduler and workers apart, in process groups of their own, connected by TCP on loopback."""

import os
import signal
from pathlib import Path

import pytest

from tests.campaign.files import write
from tests.campaign.processes import blocks, cluster, completed, finish, start, table, wait_for

CHANGES = [("runs = 40", "runs = 160"), ("block = 8", "block = 4")]
CHANGES += [("time = { stop = 1.0 }\n", "")]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("campaign"), changes=CHANGES)


def test_two_hosts_make_the_same_table(file: Path, tmp_path: Path) -> None:
    with cluster(2) as (address, scheduler, arms):
        process = start(file, tmp_path / "apart", "--scheduler", address)
        wait_for(lambda: blocks(tmp_path / "apart") >= 3)
        os.kill(arms[0].pid, signal.SIGKILL)  # the other one goes on
        code, out, err = finish(process)
        assert code == 0, err
        process = start(file, tmp_path / "lost", "--scheduler", address)
        wait_for(lambda: blocks(tmp_path / "lost") >= 3)
        os.kill(scheduler.pid, signal.SIGKILL)
        code, _, err = finish(process)
        assert code == 2
        assert err.splitlines()[-1].startswith("error: the scheduler is gone; the same command")
        assert "Traceback" not in err
    here = completed(file, tmp_path / "lost", "--workers", 1)
    assert table(out) == here
