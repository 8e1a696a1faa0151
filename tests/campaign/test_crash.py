"""A run that takes its worker down is a row that says so, and the others are as without it."""

import subprocess
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from rparm.campaign import engine
from tests.campaign.files import ARM, campaign, write
from tests.campaign.runners import engine_of, rows, runner
from tests.support.paths import FMI_HEADERS, ROOT
from tests.support.rparm_project import FMUS, Console, declared
from tests.support.ssp_files import edited

CHANGES = [
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
    with runner(campaign(tmp_path, ARM, CHANGES), tmp_path) as (runs, job, points):
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
    file = write(tmp_path, changes=CHANGES)
    arguments = ("campaign", file, "--fmu", crashing, "--output", tmp_path / "o", "--replay")
    assert console(*arguments, CRASHES - 1)[0] == 0
    code, out, _ = console(*arguments, CRASHES)
    assert code == 1
    assert "m2 = 3.0" in out and out.endswith("failed: the run takes its process down\n")
