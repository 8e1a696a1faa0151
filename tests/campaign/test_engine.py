"""Campaigns that were stopped, killed or cut off give the table of an undisturbed one."""

import errno
import os
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from zipfile import ZipFile

import numpy as np
import pytest
from distributed import Client

from rparm.campaign import engine
from rparm.campaign.runs import Plugin
from rparm.errors import UserError
from tests.campaign.cluster import processes
from tests.campaign.cluster.processes import (
    ENVIRONMENT,
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
from tests.campaign.files import ARM, campaign, write
from tests.campaign.runners import engine_of, rows, runner
from tests.support.hosts import LOOPBACK, Host, Network
from tests.support.paths import FMI_HEADERS, ROOT
from tests.support.rparm_project import FMUS, Console, declared
from tests.support.ssp_files import edited

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
    for path in sorted(tmp_path.glob("blocks/block_*"))[RUNS // BLOCK - 1 :]:
        path.unlink()  # it was quicker than this process
    there = blocks(tmp_path)
    assert there >= 3
    code, out, err = finish(start(file, tmp_path, "--workers", 2))
    assert code == 0, err
    assert f"resumes: {there * BLOCK} of {RUNS} runs are there" in out
    assert table(out) == undisturbed
    assert files(tmp_path) == files(file.parent / "undisturbed")
    assert not list(tmp_path.glob(".*"))  # what the killed one has left is removed


def test_a_stopped_campaign_says_so(tmp_path: Path) -> None:
    endless = write(tmp_path, changes=[("runs = 40", "runs = 100000")])
    process = start(endless, tmp_path / "output", "--workers", 1)
    wait_for(lambda: blocks(tmp_path / "output") >= 1)
    os.kill(process.pid, signal.SIGINT)
    code, _, err = finish(process)
    assert code == 128 + signal.SIGINT
    assert "stopped; the same command resumes it" in err
    assert "Traceback" not in err
    assert not list((tmp_path / "output").glob(".*"))


def test_a_campaign_whose_workers_are_gone_ends(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "PATIENCE", 1)
    monkeypatch.setattr(engine, "COUNT_EVERY", 100)
    with (
        processes.cluster(LOOPBACK, [LOOPBACK]) as (address, _, arms),
        engine.opened_cluster(address, None, tmp_path) as client,
    ):
        registered(arms[0])
        with (
            engine_of(client, file, tmp_path) as (made, _),
            pytest.raises(UserError, match="has no workers any more; the same command resumes"),
        ):
            made.run(range(RUNS // BLOCK), lambda _: kill_group(arms[0]))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two short campaigns over the same model, which keep different variables of it."""
    other = [("seed = 3", "seed = 4"), ('final = ["q1", "q2"]', 'final = ["q2", "q1"]')]
    folders = (tmp_path_factory.mktemp(name) for name in ("first", "second"))
    return tuple(write(folder, changes=c) for folder, c in zip(folders, ([], other), strict=True))


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Client, Path]]:
    """A cluster of one worker, and the folder of its files."""
    folder = tmp_path_factory.mktemp("workers")
    with engine.opened_cluster(None, 1, folder) as client:
        yield client, folder


def remains(folder: Path) -> list[str]:
    """List the folders of campaigns; os.walk bears it that workers remove files meanwhile."""
    return [name for _, names, _ in os.walk(folder) for name in names if name.startswith("rparm-")]


def test_campaigns_share_workers(
    small: tuple[Path, Path], local: tuple[Client, Path], tmp_path: Path
) -> None:
    client, folder = local
    tables = []
    for i, file in enumerate(small):
        with engine_of(client, file, tmp_path / f"alone_{i}") as (made, results):
            made.run(range(5), lambda _: None)
            tables.append(results.digest())
    with (
        engine_of(client, small[0], tmp_path / "first") as (first, first_results),
        engine_of(client, small[0], tmp_path / "same") as (same, same_results),
        engine_of(client, small[1], tmp_path / "other") as (other, other_results),
    ):
        first.run(range(2), lambda _: None)
        first_results.block(1)
        # each run takes only what is its own from the worker
        other.run(range(3), lambda _: None)
        same.run(range(5), lambda _: None)
        assert same_results.digest() == tables[0]
    for name, file in (("first", small[0]), ("other", small[1])):
        with engine_of(client, file, tmp_path / name) as (again, results):
            again.run(results.missing(), lambda _: None)
    assert [first_results.digest(), other_results.digest()] == tables
    assert not remains(folder)


def test_a_stopped_campaign_leaves_nothing_on_workers(
    small: tuple[Path, Path], local: tuple[Client, Path], tmp_path: Path
) -> None:
    client, folder = local

    def stop(_: int) -> None:
        assert remains(folder)
        raise KeyboardInterrupt

    with engine_of(client, small[0], tmp_path) as (made, _), pytest.raises(KeyboardInterrupt):
        made.run(range(5), stop)
    wait_for(lambda: not remains(folder))


def test_an_error_of_the_system_is_not_one_of_the_scheduler(
    small: tuple[Path, Path], local: tuple[Client, Path], tmp_path: Path
) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with (
        engine_of(local[0], small[0], tmp_path) as (made, _),
        pytest.raises(OSError, match=re.escape(os.strerror(errno.ENOSPC))),
    ):
        made.run(range(5), fail)


def test_what_is_wrong_at_a_worker_is_said(
    small: tuple[Path, Path], local: tuple[Client, Path], tmp_path: Path
) -> None:
    client, folder = local
    (there,) = (path for path in folder.glob("dask-scratch-space/*worker-*") if path.is_dir())
    away = there.rename(folder / "away")
    try:
        with (
            pytest.raises(UserError, match="a worker cannot run this: .*No such file"),
            engine_of(client, small[0], tmp_path),
        ):
            pass
    finally:
        away.rename(there)


def test_a_worker_that_is_killed_as_it_starts_is_made_again(
    small: tuple[Path, Path], tmp_path: Path
) -> None:
    process = start(small[0], tmp_path, "--workers", 2)
    wait_for(lambda: workers(process))
    os.kill(workers(process)[0], signal.SIGKILL)
    code, _, err = finish(process)
    assert code == 0, err
    assert "Traceback" not in err


def test_a_cluster_that_cannot_start_is_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(**_: object) -> None:
        raise RuntimeError("Cluster failed to start:\nno loopback")  # as distributed says it

    monkeypatch.setattr(engine.distributed, "SpecCluster", refuse)
    expected = "cannot connect at 127.0.0.1: Cluster failed to start: no loopback$"
    with pytest.raises(UserError, match=expected), engine.opened_cluster(None, 1, tmp_path):
        pass


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_campaign_that_is_stopped_as_it_starts_says_only_so(
    ending: signal.Signals, small: tuple[Path, Path], tmp_path: Path
) -> None:
    process = start(small[0], tmp_path, "--workers", 2)
    wait_for(lambda: workers(process))
    # a terminal sends these to all processes of the group
    (os.kill if ending == signal.SIGTERM else os.killpg)(process.pid, ending)
    code, _, err = finish(process)
    assert code == 128 + ending
    assert err.splitlines()[0] == "stopped; the same command resumes it"
    assert err.splitlines()[1:] == (["interrupted"] if ending == signal.SIGINT else [])
    assert not list(tmp_path.glob(".*"))


class Shop:
    """Stands for the FMUs of a worker."""

    closed = False

    def __init__(self, *_: object) -> None:
        pass

    def rows(self, plugin: Plugin, _: object) -> bool:
        """End the campaign during the runs; whether the FMUs are still there."""
        plugin.teardown(None)
        return not self.closed

    def close(self) -> None:
        """Remove the FMUs."""
        self.closed = True


def test_fmus_stay_until_runs_under_way_have_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shop = Shop()
    monkeypatch.setattr("rparm.campaign.runs.Workshop", lambda *_: shop)
    plugin = Plugin("name", None, {})
    plugin.setup(SimpleNamespace(local_directory=tmp_path))
    assert plugin.rows(plugin, None)
    assert shop.closed
    with pytest.raises(RuntimeError, match="the campaign has ended"):
        plugin.rows(plugin, None)


# ---- A run that takes its worker down ------------------------------------------------------------


CRASHING_RUNS = [
    ("sobol", "grid"),
    ("runs = 40\nblock = 8", "block = 3"),
    ("uniform = [1.0, 3.0]", "values = [0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]"),
    ("normal = [-2.0, 0.2]", "values = [-2.0]"),
    ("trajectories = [3, 17]\n", ""),
]
CRASHES = 3  # run with m2 = 3


@pytest.fixture
def crashing(tmp_path: Path) -> Path:
    """The arm's FMU, with another shared object before its own."""
    name = "binaries/linux64/RPManipulator.so"
    own, library = tmp_path / "own.so", tmp_path / "RPManipulator.so"
    with ZipFile(FMUS["rp_manipulator"]) as archive:
        own.write_bytes(archive.read(name))
    reference = declared("rp_manipulator").variables["m2"].reference
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-DM2={reference}"]
    flags += ["-isystem", str(FMI_HEADERS), "-L", str(tmp_path), "-Wl,-rpath,$ORIGIN"]
    source = ROOT / "tests" / "campaign" / "crashing.c"
    subprocess.run(["gcc", *flags, source, "-l:own.so", "-o", library], check=True)
    change = {name: lambda _: library.read_bytes()}
    path = edited(FMUS["rp_manipulator"], tmp_path / "Crashing.fmu", change)
    with ZipFile(path, "a") as archive:
        archive.write(own, f"{Path(name).parent}/own.so")
    return path


def test_a_run_that_takes_its_worker_down(
    crashing: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(engine.SETTINGS, "distributed.scheduler.allowed-failures", 1)
    with runner(campaign(tmp_path, ARM, CRASHING_RUNS), tmp_path) as (runs, job, points):
        expected = rows(runs, job, points, range(8)).measures[:, 0]
    with (
        engine.opened_cluster(None, 1, tmp_path / "workers") as client,
        engine_of(client, tmp_path / "test.toml", tmp_path / "output", crashing) as (made, results),
    ):
        made.run(range(3), lambda _: None)
    table = results.table(["final(q1)", "failure"])
    assert [run for run, failure in enumerate(table["failure"]) if failure] == [CRASHES]
    assert table["failure"][CRASHES] == engine.DIED
    expected[CRASHES] = np.nan
    np.testing.assert_array_equal(table["final(q1)"], expected)


def test_its_replay_ends_with_a_message(crashing: Path, tmp_path: Path, console: Console) -> None:
    file = write(tmp_path, changes=CRASHING_RUNS)
    arguments = ("campaign", file, "--fmu", crashing, "--output", tmp_path / "o", "--replay")
    assert console(*arguments, CRASHES - 1)[0] == 0
    code, out, _ = console(*arguments, CRASHES)
    assert code == 1
    assert "m2 = 3.0" in out and out.endswith("failed: the run takes its process down\n")


# ---- Scheduler and workers on different hosts ----------------------------------------------------


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Programs that soon take a connection for dead; 11 s are the least that Dask takes."""
    monkeypatch.setitem(ENVIRONMENT, "DASK_DISTRIBUTED__COMM__TIMEOUTS__TCP", "11s")
    monkeypatch.setitem(ENVIRONMENT, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "10s")


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
