"""The folder of a campaign's results: what it refuses, repairs and keeps."""

import dataclasses
import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cosim.campaign.results import Results
from cosim.campaign.runs import Rows
from cosim.errors import UserError
from tests.campaign.files import campaign
from tests.campaign.runners import runner


class Folder:
    """Results of a campaign whose rows are made up."""

    def __init__(self, given, job, points, folder: Path) -> None:
        self.given, self.points = given, points
        self.results = Results(folder, given, job, "text")

    def write(self, block: int) -> None:
        runs = self.given.block_range(block)
        numbers = np.arange(4.0) + np.array(runs)[:, None]
        record = {run: np.full((201, 4), float(run)) for run in (3, 17) if run in runs}
        rows = Rows(np.array(runs), numbers, ["why" if r == 5 else "" for r in runs], record)
        self.results.write(block, self.points.of(runs), rows)


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Folder]:
    given = campaign(tmp_path)
    with runner(given, tmp_path) as (_, job, points):
        made = Folder(given, job, points, tmp_path / "output")
        made.results.begin()
        yield made


def test_a_table_is_in_the_order_of_the_runs(folder: Folder) -> None:
    for block in (4, 0, 3, 1, 2):
        folder.write(block)
    found = folder.results.table(["run", "final(q2)", "m2", "failure"])
    assert found["run"].tolist() == list(range(40))
    assert np.array_equal(found["final(q2)"], np.arange(40) + 1.0)
    assert np.array_equal(found["m2"], folder.points.of(range(40))[:, 0])
    assert [i for i, text in enumerate(found["failure"]) if text] == [5]
    assert folder.results.failed() == 1
    kept = pq.read_table(folder.results.trajectory_path(17))
    assert kept.column_names == ["time", "q1", "q2", "dq1", "actuator_power"]
    assert np.array_equal(kept["q2"].to_numpy(), np.full(201, 17.0))


def test_the_hash_is_that_of_all_values(folder: Folder) -> None:
    for block in range(5):
        folder.write(block)
    before = folder.results.digest()
    folder.write(2)
    assert folder.results.digest() == before
    path = folder.results.block_path(2)
    table = pq.read_table(path)
    for name in ("m2", "failure", "run", "maximum(dq1)"):
        values = table[name].to_pylist()
        values[3] = "x" if name == "failure" else values[3] + 1
        place = table.column_names.index(name)
        pq.write_table(table.set_column(place, table.schema.field(name), [values]), path)
        assert folder.results.digest() != before


def test_what_is_missing_or_damaged_is_run_again(folder: Folder) -> None:
    assert folder.results.missing() == [0, 1, 2, 3, 4]
    for block in (0, 2, 3, 4):
        folder.write(block)
    path = folder.results.block_path(3)
    path.write_bytes(path.read_bytes()[:-40])
    pq.write_table(folder.results.block(2).slice(0, 7), folder.results.block_path(2))
    assert folder.results.missing() == [1, 2, 3]


@pytest.mark.parametrize("key", ["campaign", "seed", "fmu_sha256", "versions"])
def test_results_of_another_campaign_are_refused(key: str, folder: Folder) -> None:
    path = folder.results.folder / "manifest.json"
    manifest = json.loads(path.read_text())
    assert manifest["seed"] == 3 and manifest["versions"]["numpy"] == np.__version__
    path.write_text(json.dumps(manifest | {key: "other"}))
    with pytest.raises(UserError, match=f"has another {key}"):
        folder.results.begin()
    path.write_text("{")
    with pytest.raises(UserError, match="cannot be read"):
        folder.results.begin()


def test_leftovers_of_killed_processes_are_removed(folder: Folder) -> None:
    gone, here = 2**22 + 1, os.getpid()  # above the largest number of a process in Linux
    left = [folder.results.folder / "blocks" / f".{gone}.block_0000001.parquet"]
    left.append(folder.results.folder / f".{gone}.workers" / "file")
    used = folder.results.folder / "blocks" / f".{here}.block_0000001.parquet"
    for path in (*left, used):
        path.parent.mkdir(exist_ok=True)
        path.touch()
    folder.results.begin()
    assert not any(path.exists() for path in left) and not left[1].parent.exists()
    assert used.exists()


def test_a_full_disk_leaves_no_part_of_a_file(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.write(0)
    written = pq.write_table

    def fill(table, file, **options) -> None:
        file.write(b"PAR1 and then")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pq, "write_table", fill)
    with pytest.raises(UserError, match="No space left on device; the same command goes on"):
        folder.write(1)
    there = [path.name for path in (folder.results.folder / "blocks").iterdir()]
    assert there == ["block_0000000.parquet"]
    monkeypatch.setattr(pq, "write_table", written)
    folder.write(1)
    assert folder.results.missing() == [2, 3, 4]


def test_too_many_runs_for_the_disk_are_refused(tmp_path: Path) -> None:
    given = campaign(tmp_path)
    with runner(given, tmp_path) as (_, job, _points):
        many = given.model_copy(update={"runs": 10**9, "sampling": "random"})
        long = dataclasses.replace(job, times=np.linspace(0, 1, 10**6))
        long = dataclasses.replace(long, trajectories=frozenset(range(10**6)))
        for campaign_, job_ in ((many, long), (given, long)):
            with pytest.raises(UserError, match="need about .* GB, the disk has"):
                Results(tmp_path / "output", campaign_, job_, "text").begin()
    assert not (tmp_path / "output").exists()
