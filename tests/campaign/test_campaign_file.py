"""Campaign files: what they mean, and what is refused with its place and reason."""

import re
from operator import itemgetter
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest

from rparm.campaign import bases, planning
from rparm.errors import UserError
from tests.campaign.files import FILES, HEAD, MISTAKES, campaign, write
from tests.support.rparm_project import FMUS, Console

GRID, M2 = [("sobol", "grid"), ("runs = 40\n", "")], "[1.0, 3.0]"
Q1 = "normal = [-2.0, 0.2]"


def wrong(folder: Path, mistake: dict[str, Any]) -> Path:
    changes = map(itemgetter("old", "new"), mistake.get("changes", [mistake]))
    return write(folder, changes=list(changes))


@pytest.mark.parametrize("mistake", MISTAKES["arm"], ids=itemgetter("message"))
def test_a_mistake_is_refused(mistake: dict[str, Any], tmp_path: Path, console: Console) -> None:
    path, output = wrong(tmp_path, mistake), tmp_path / "output"
    error = console.refused("campaign", path, "--output", output)
    assert str(path) in error and mistake["message"] in error
    assert not output.exists()


def test_the_file_that_the_mistakes_are_made_in_is_right(tmp_path: Path) -> None:
    given = campaign(tmp_path)
    with bases.opened(given, None) as base:
        job = planning.plan(given, base, "test")
    assert [name for name, _ in job.targets] == ["m2", "q1"]
    assert job.steps == 200 and job.stop == 1.0
    assert [m.column for m in job.measures][:2] == ["final(q1)", "final(q2)"]


SYSTEM = HEAD + FILES["SYSTEM"]


@pytest.mark.parametrize("mistake", MISTAKES["system"], ids=itemgetter("message"))
def test_a_mistake_of_a_system_is_refused(mistake: dict[str, str], tmp_path: Path) -> None:
    changes = [(mistake["old"], mistake["new"])]
    with (
        pytest.raises(UserError, match=re.escape(mistake["message"])),
        bases.opened(given := campaign(tmp_path, SYSTEM, changes), None) as base,
    ):
        planning.plan(given, base, "test")


def test_a_damaged_binary_is_that_of_the_file_of_the_user(tmp_path: Path, console: Console) -> None:
    fmu = tmp_path / "mine.fmu"
    with ZipFile(FMUS["rp_manipulator"]) as archive, ZipFile(fmu, "w") as copy:
        for name in archive.namelist():
            content = archive.read(name)
            copy.writestr(name, content[:64] + bytes(999) if name.endswith(".so") else content)
    assert console.failed("campaign", write(tmp_path), "--fmu", fmu).startswith(f"error: {fmu}: ")


def test_blocks_cover_all_runs(tmp_path: Path) -> None:
    given = campaign(tmp_path, changes=[("runs = 40", "runs = 43")])
    runs = [run for block in range(given.blocks) for run in given.block_range(block)]
    assert runs == list(range(43))


def test_a_run_is_counted_by_the_sampling(tmp_path: Path) -> None:
    assert campaign(tmp_path, changes=[("sobol", "indices"), ("40", "32")]).count == 32 * 4
    grid = [*GRID, (M2, f"{M2}\npoints = 20"), (Q1, "values = [1.0, 2.0]")]
    assert campaign(tmp_path, changes=grid).count == 40
