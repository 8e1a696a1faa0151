"""The folder of a campaign's results: what it refuses, repairs and keeps."""

import dataclasses
import errno
import json
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from rparm import project
from rparm.campaign import bases
from rparm.campaign.campaign_file import MAX_RUNS
from rparm.campaign.results import Results
from rparm.campaign.runs import Rows
from rparm.errors import UserError
from tests.campaign.files import campaign
from tests.campaign.runners import runner
from tests.support.rparm_project import FMUS


class Folder:
    """Results of a campaign whose rows are made up."""

    def __init__(self, given, job, points, folder: Path) -> None:
        self.given, self.job, self.points = given, job, points
        self.results = Results(folder, given, job, "text")

    def write_all(self) -> None:
        """Write the five blocks."""
        for block in range(5):
            self.write(block)

    def write(self, block: int, changed: str = "") -> None:
        """Write a block, with a change in what is given by name."""
        runs = self.given.block_range(block)
        points, numbers = self.points.of(runs), np.arange(4.0) + np.array(runs)[:, None]
        failures = ["why" if run == 5 else "" for run in runs]
        if changed == "failure":
            failures[3] = "x"
        elif changed:
            {"points": points, "measures": numbers}[changed][3, 1] += 1
        record = {run: np.full((201, 4), float(run)) for run in (3, 17) if run in runs}
        rows = Rows(np.array(runs), numbers, failures, record)
        self.results.write(block, points, rows)


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
    folder.write_all()
    before = folder.results.digest()
    folder.write(2)
    assert folder.results.digest() == before
    for changed in ("points", "measures", "failure"):
        folder.write(2, changed)
        assert folder.results.digest() != before


def test_what_is_missing_or_another_block_is_run_again(folder: Folder) -> None:
    assert folder.results.missing() == [0, 1, 2, 3, 4]
    for block in (0, 2, 3, 4):
        folder.write(block)
    path = folder.results.block_path(3)
    path.write_bytes(path.read_bytes()[:-40])
    pq.write_table(folder.results.block(2).slice(0, 7), folder.results.block_path(2))
    assert folder.results.missing() == [1, 2, 3]
    shutil.copy(folder.results.block_path(0), folder.results.block_path(1))
    assert folder.results.missing() == [1, 2, 3]
    with pytest.raises(UserError, match=r"block_0000000001\.parquet: is missing or damaged"):
        folder.results.table(["m2"])


def test_damage_is_found_by_each_reading(folder: Folder) -> None:
    folder.write_all()
    right = folder.results.block(2)
    path = folder.results.block_path(2)
    content = path.read_bytes()
    places = range(4, len(content) - 8, 61)  # between the magic numbers of the format
    found = 0
    for place in places:
        changed = bytearray(content)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        if folder.results.missing() == [2]:
            found += 1
            with pytest.raises(UserError, match=re.escape(f"{path}: is missing or damaged")):
                folder.results.digest()
        else:
            assert folder.results.block(2).equals(right)
    assert found > len(places) / 2
    path.write_bytes(bytes(~byte & 0xFF for byte in content))
    folder.results.begin()
    assert folder.results.missing() == [2]


def test_a_block_without_its_trajectories_is_run_again(folder: Folder) -> None:
    folder.write_all()
    assert folder.results.missing() == []
    folder.results.trajectory_path(3).unlink()
    path = folder.results.trajectory_path(17)
    path.write_bytes(path.read_bytes()[:-1])
    assert folder.results.missing() == [0, 2]
    folder.write(0)
    folder.write(2, "failure")  # of run 19
    assert folder.results.missing() == []


def test_failed_runs_have_no_trajectories(tmp_path: Path) -> None:
    given = campaign(tmp_path, changes=[("trajectories = [3, 17]", "trajectories = [5]")])
    with runner(given, tmp_path) as (_, job, points):
        made = Folder(given, job, points, tmp_path / "output")
        made.results.begin()
        made.write(0)
    assert made.results.missing() == [1, 2, 3, 4]


def test_blocks_of_another_campaign_are_refused(folder: Folder) -> None:
    folder.write(0)
    given, job = folder.given, folder.job
    manifest = folder.results.folder / "manifest.json"
    content = manifest.read_bytes()
    manifest.unlink()
    other = Results(folder.results.folder, given, job, "another text")
    with pytest.raises(UserError, match=r"block_0000000000\.parquet: is a block of another"):
        other.begin()
    assert not manifest.exists()
    folder.results.begin()  # those of its own are taken
    assert manifest.read_bytes() == content
    assert folder.results.missing() == [1, 2, 3, 4]
    pq.write_table(folder.results.block(0).replace_schema_metadata(), other.block_path(7))
    with pytest.raises(UserError, match="is a block of another"):
        folder.results.begin()


@pytest.mark.parametrize("has_links", [True, False])
def test_of_two_campaigns_that_begin_at_once_one_gets_the_folder(
    has_links: bool, folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    new = folder.results.folder.parent / "new"
    given, job = folder.given, folder.job
    first, same, other = (Results(new, given, job, text) for text in ("text", "text", "other"))
    link, is_first = os.link, iter([True])

    def meanwhile(source: Path, target: Path) -> None:
        """The first begins just before the other one writes its manifest."""
        if not has_links:
            raise PermissionError
        if next(is_first, False):
            with monkeypatch.context() as process:
                process.setattr(os, "getpid", lambda: 1)
                first.begin()
        link(source, target)

    monkeypatch.setattr(os, "link", meanwhile)
    if has_links:
        with pytest.raises(UserError, match="has another campaign"):
            other.begin()
    first.begin()
    same.begin()
    with pytest.raises(UserError, match="has another campaign"):
        other.begin()
    assert json.loads((new / "manifest.json").read_text())["campaign"] == "text"
    assert not list(new.glob(".*"))


@pytest.mark.parametrize("place", ["file", "/proc/x"])
def test_a_folder_that_cannot_be_written_is_said_as_it_is(
    place: str, folder: Folder, tmp_path: Path
) -> None:
    if place == "/proc/x" and not Path("/proc/self").exists():
        pytest.skip("no such file system here")
    (tmp_path / "file").touch()
    results = Results(tmp_path / place, folder.given, folder.job, "text")
    with pytest.raises(UserError, match="cannot be written: (Not a dir|No such file)") as caught:
        results.begin()
    assert "resumes" not in str(caught.value)


def test_names_are_in_the_order_of_the_runs(folder: Folder) -> None:
    numbers = [0, 9, 10, 10**7 - 1, 10**7, MAX_RUNS - 1]
    for path in (folder.results.block_path, folder.results.trajectory_path):
        names = [path(number).name for number in numbers]
        assert names == sorted(names)


@pytest.mark.parametrize("key", ["campaign", "seed", "sha256", "versions"])
def test_results_of_another_campaign_are_refused(key: str, folder: Folder) -> None:
    path = folder.results.folder / "manifest.json"
    manifest = json.loads(path.read_text())
    assert manifest["seed"] == 3 and manifest["versions"]["numpy"] == np.__version__
    path.write_text(json.dumps(manifest | {key: "other"}))
    with pytest.raises(UserError, match=f"has another {key}"):
        folder.results.begin()
    for damaged in ("{", "[" * 10**5, "[]"):
        path.write_text(damaged)
        with pytest.raises(UserError, match=r"manifest\.json: .* give another folder by --output"):
            folder.results.begin()


@pytest.mark.parametrize("is_log", [False, True])
def test_results_of_an_edited_scenario_or_log_are_refused(
    is_log: bool, folder: Folder, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    known = project.scenario_file(folder.given.scenario)
    scenario = tmp_path / known.name
    monkeypatch.setattr(project, "scenario_file", lambda *_: scenario)
    text = f'model = "rp_manipulator"\n{known.read_text(encoding="utf-8")}'
    assert "tau1" not in text
    scenario.write_text(f"{text}\n[inputs.tau1]\nfile = 'log.csv'\n", encoding="utf-8")
    log = tmp_path / "log.csv"
    log.write_text("time,tau1\n0,1\n1,2\n", encoding="utf-8")

    def begin() -> None:
        with bases.opened(folder.given, FMUS["rp_manipulator"]) as base:
            job = dataclasses.replace(folder.job, hashes=base.hashes)
        Results(tmp_path / "edited", folder.given, job, "text").begin()

    begin()
    begin()
    edited, added = (log, "2,2\n") if is_log else (scenario, "# edited\n")
    edited.write_text(edited.read_text(encoding="utf-8") + added, encoding="utf-8")
    with pytest.raises(UserError, match="has another sha256"):
        begin()


def test_leftovers_of_killed_processes_are_removed(folder: Folder) -> None:
    gone, here = 2**22 + 1, os.getpid()  # above the largest number of a process in Linux
    left = [folder.results.folder / "blocks" / f".{gone}.block_0000000001.parquet"]
    left.append(folder.results.folder / f".{gone}.workers" / "file")
    used = folder.results.folder / "blocks" / f".{here}.block_0000000001.parquet"
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
    with pytest.raises(UserError, match="No space left on device; the same command resumes"):
        folder.write(1)
    there = [path.name for path in (folder.results.folder / "blocks").iterdir()]
    assert there == ["block_0000000000.parquet"]
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
