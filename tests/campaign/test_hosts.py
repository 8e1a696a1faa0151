"""Scheduler and workers on different hosts, links between which are lost, too.

The hosts are network namespaces, connected by a pair of virtual devices. Where the kernel permits
none, only the process groups on loopback are left.
"""

import os
import signal
from pathlib import Path

import pytest

from tests.campaign.cluster.processes import (
    ENVIRONMENT,
    blocks,
    cluster,
    completed,
    finish,
    registered,
    start,
    table,
    wait_for,
)
from tests.campaign.files import write
from tests.support.hosts import LOOPBACK, Host, Network

CHANGES = [("runs = 40", "runs = 160"), ("block = 8", "block = 4")]
CHANGES += [("time = { stop = 1.0 }\n", "")]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("campaign"), changes=CHANGES)


@pytest.fixture(scope="module")
def undisturbed(file: Path) -> str:
    return completed(file, file.parent / "undisturbed", "--workers", 1)


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Programs that soon take a connection for dead; 11 s are the least that Dask takes."""
    monkeypatch.setitem(ENVIRONMENT, "DASK_DISTRIBUTED__COMM__TIMEOUTS__TCP", "11s")
    monkeypatch.setitem(ENVIRONMENT, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "5s")


@pytest.fixture(params=["loopback", "namespaces"])
def hosts(request: pytest.FixtureRequest) -> tuple[Host, Host]:
    """Where the campaign and the scheduler are, and where the workers are."""
    if request.param == "loopback":
        return LOOPBACK, LOOPBACK
    made = request.getfixturevalue("apart")
    return made.here, made.there


def test_two_hosts_make_the_same_table(
    file: Path, undisturbed: str, hosts: tuple[Host, Host], tmp_path: Path
) -> None:
    here, there = hosts
    with cluster(here, [there, there]) as (address, scheduler, arms):
        process = start(file, tmp_path / "apart", "--scheduler", address, host=here)
        wait_for(lambda: blocks(tmp_path / "apart") >= 3)
        os.kill(arms[0].pid, signal.SIGKILL)  # the other one continues
        code, out, err = finish(process)
        assert code == 0, err
        assert table(out) == undisturbed
        process = start(file, tmp_path / "lost", "--scheduler", address, host=here)
        wait_for(lambda: blocks(tmp_path / "lost") >= 3)
        os.kill(scheduler.pid, signal.SIGKILL)
        code, _, err = finish(process)
        assert code == 2
        assert err.splitlines()[-1].startswith("error: the scheduler is gone; the same command")
        assert "Traceback" not in err
    assert completed(file, tmp_path / "lost", "--workers", 1) == undisturbed


@pytest.mark.usefixtures("impatient")
def test_others_go_on_without_a_worker_whose_link_is_lost(
    file: Path, undisturbed: str, apart: Network, tmp_path: Path
) -> None:
    with cluster(apart.here, [apart.here, apart.there]) as (address, _, arms):
        registered(arms[1])
        process = start(file, tmp_path, "--scheduler", address, host=apart.here)
        wait_for(lambda: blocks(tmp_path) >= 3)
        apart.cut()
        assert process.poll() is None
        code, out, err = finish(process)
    assert code == 0, err
    assert table(out) == undisturbed


@pytest.mark.usefixtures("impatient")
def test_a_campaign_begins_without_a_worker_whose_link_is_lost(
    file: Path, undisturbed: str, apart: Network, tmp_path: Path
) -> None:
    with cluster(apart.here, [apart.here, apart.there]) as (address, _, arms):
        for worker in arms:
            registered(worker)
        apart.cut()
        options = ("--scheduler", address)
        assert completed(file, tmp_path, *options, host=apart.here) == undisturbed


@pytest.mark.usefixtures("impatient")
def test_a_lost_link_to_the_scheduler_ends_a_campaign(
    file: Path, undisturbed: str, apart: Network, tmp_path: Path
) -> None:
    with cluster(apart.there, [apart.there]) as (address, *_):
        options = ("--scheduler", address)
        process = start(file, tmp_path, *options, host=apart.here)
        wait_for(lambda: blocks(tmp_path) >= 3)
        apart.cut()
        code, _, err = finish(process)
        assert code == 2
        assert err.splitlines()[-1].startswith("error: the scheduler is gone; the same command")
        assert "Traceback" not in err
        apart.mend()
        assert completed(file, tmp_path, *options, host=apart.here) == undisturbed
