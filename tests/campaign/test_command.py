"""The command: pages, replays, and what others do not import."""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from rparm.campaign import page
from rparm.commands.campaign import _command
from tests.campaign.cluster.processes import ENVIRONMENT, finish, start, table
from tests.campaign.files import commands, write
from tests.support.paths import ROOT
from tests.support.rparm_project import Console

PAGE = [
    ("seed = 3", 'seed = 3\nworst = ["maximum(dq1)"]'),
    ("sobol", "indices"),
    ("runs = 40", "runs = 8"),
    ("[keep]", '[[maps]]\nx = "m2"\ny = "q1"\ncolour = "maximum(dq1)"\n'
     '[derived]\ndq1 = "sqrt(q1 + 2.3)"\n[keep]'),
]  # fmt: skip


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a campaign with its file and its output."""
    folder = tmp_path_factory.mktemp("campaign")
    code, out, err = finish(start(write(folder, changes=PAGE), folder / "output", "--workers", 1))
    assert code == 0, err
    assert re.search(r"dashboard: http://127\.0\.0\.1:\d+/status", out)
    (folder / "hash").write_text(table(out))
    return folder


def test_the_page_shows_it_all(done: Path) -> None:
    page = text_of(done / "output" / "campaign.html")
    assert page.count('"kind":"map"') == 1 and page.count('"kind":"indices"') == 4
    assert (done / "hash").read_text() in page
    found = pq.read_table(done / "output" / "blocks")
    worst = int(np.nanargmax(found["maximum(dq1)"].to_numpy()))
    assert commands(page)[0][-2:] == ["--replay", str(found["run"][worst].as_py())]
    failed = [run for run, why in zip(found["run"], found["failure"], strict=True) if why.as_py()]
    assert f"{len(failed)} of 32 runs failed" in page if failed else "runs failed" not in page


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def of(done: Path, output: Path, *options: str) -> tuple[object, ...]:
    """Arguments of the campaign in a folder, with its results in another one."""
    return "campaign", done / "test.toml", "--output", output, *options


def copied(done: Path, folder: Path) -> Path:
    return Path(shutil.copytree(done / "output", folder / "output"))


def test_its_commands_work_in_the_projects_folder(tmp_path: Path) -> None:
    folder = tmp_path / "John's runs"
    folder.mkdir()
    changes = [("runs = 40", 'runs = 2\nworst = ["m2"]'), ("[3, 17]", "[0]")]
    write(folder, changes=changes)
    program = [sys.executable, "-P", "-m", "rparm"]
    arguments = ["campaign", "test.toml", "--output", "the output", "--workers", "1"]
    subprocess.run([*program, *arguments], cwd=folder, env=ENVIRONMENT, check=True)
    page = folder / "the output" / "campaign.html"
    first, *_, last = commands(text_of(page))
    page.unlink()
    for command in (first, last):
        subprocess.run([*program, *command[1:]], cwd=ROOT, env=ENVIRONMENT, check=True)
    assert page.exists() and len(list(page.parent.glob("replays/run_?.csv"))) == 1


def test_its_folder_may_have_any_name(tmp_path: Path) -> None:
    """Dask gives workers their folder, and Parquet takes the names of files, in UTF-8 only."""
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this system has no such names")
    file = write(folder, changes=[("runs = 40", "runs = 2"), ("[3, 17]", "[0]")])
    for there in ("2 runs in", "complete: 2 runs"):  # the second time it reads what is there
        code, out, err = finish(start(file, folder / "output", "--workers", 1))
        assert code == 0 and there in out, err


def test_commands_of_files_of_the_project_have_short_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT / "models")
    given = {"file": Path("machine/campaigns/tolerance.toml"), "fmu": None}
    options = argparse.Namespace(**given, output=ROOT / "build" / "a b")
    assert _command(options) == (
        "./run.sh campaign models/machine/campaigns/tolerance.toml --output 'build/a b'"
    )


def test_an_error_of_the_page_loses_no_results(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    output = copied(done, tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr("rparm.campaign.page.bars", lambda _: 1 / 0)
        code, _, error = console(*of(done, output))
    assert code == 2 and "the page cannot be written: ZeroDivisionError" in error
    assert "the results are complete" in error
    code, out, _ = console(*of(done, output))
    assert code == 0 and table(out) == (done / "hash").read_text()


def test_it_is_a_document(done: Path, tmp_path: Path, console: Console) -> None:
    output = copied(done, tmp_path)
    code, out, err = console(*of(done, output, "--json"))
    found = json.loads(out)
    assert (code, found["exit_code"], found["runs"]) == (0, 0, 32)
    assert found["table"] == (done / "hash").read_text() and Path(found["page"]).is_file()
    assert err.splitlines()[-1].startswith("complete: 32 runs")
    code, out, err = console(*of(done, output, "--json", "--quiet", "--replay", "17"))
    found = json.loads(out)
    assert (
        (code, err) == (0, "")
        and set(found["parameters"]) >= {"m2", "q1"}
        and found["failure"] == ""
    )
    assert all(Path(file).is_file() for file in found["files"])


def test_pictures_have_so_many_columns_at_most(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    monkeypatch.setattr(page, "DRAWN", 2)
    output = copied(done, tmp_path)
    assert console(*of(done, output))[0] == 0
    text = text_of(output / "campaign.html")
    assert "Charts leave out maximum(dq1) and what is below it in the table." in text
    assert text.count('"kind":"indices"') == 2


def test_a_replay_is_the_run_again(done: Path, console: Console) -> None:
    output = done / "output"
    code, out, _ = console(*of(done, output, "--replay", "17"))
    assert code == 0
    printed = dict(line.split(" = ") for line in out.splitlines() if " = " in line)
    row = pq.read_table(output / "blocks", filters=[("run", "=", 17)]).to_pylist()[0]
    for name, value in printed.items():
        assert float(value) == row[name]
    kept = pq.read_table(output / "trajectories" / "run_0000000017.parquet")
    file = output / "replays" / "run_17.csv"
    names = file.read_text().splitlines()[0].replace('"', "").split(",")
    values = np.loadtxt(file, delimiter=",", skiprows=1)
    assert len(names) == values.shape[1] > len(kept.column_names)
    for name in kept.column_names[1:]:
        column = values[:, names.index(name)]
        assert np.array_equal(column, kept[name].to_numpy())
    page = (output / "replays" / "run_17.html").read_text(encoding="utf-8")
    assert 'src="../assets/player.js"' in page
    moving = json.loads(
        re.search(r'<script type="application/json" id="run">(.*?)</script>', page)[1]
    )
    assert moving["motion"]["arm"]["l1"] > 0
    assert '<a href="../index.html">' in page
    assert (output / "assets" / "player.js").is_file()
    assert "the campaign has runs 0 to 31" in console.failed(*of(done, output, "--replay", "32"))


def test_a_replay_leaves_the_results_of_another_campaign_alone(
    done: Path, tmp_path: Path, console: Console
) -> None:
    output = copied(done, tmp_path)
    assert console(*of(done, output, "--replay", "3"))[0] == 0
    before = {path: path.read_bytes() for path in (output / "replays").iterdir()}
    (tmp_path / "test.toml").write_text(text_of(done / "test.toml").replace("seed = 3", "seed = 4"))
    assert "has another campaign" in console.failed(*of(tmp_path, output, "--replay", "3"))
    assert before == {path: path.read_bytes() for path in (output / "replays").iterdir()}


def test_the_replay_of_a_failed_run_fails(tmp_path: Path, console: Console) -> None:
    write(tmp_path, changes=[("uniform = [1.0, 3.0]", "normal = [-50.0, 0.5]")])
    code, out, _ = console(*of(tmp_path, tmp_path / "output", "--replay", "3"))
    assert code == 1 and "failed: hanging_swing" in out and "is refused" in out
    assert not (tmp_path / "output").exists()


def test_it_says_what_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    monkeypatch.setattr("rparm.commands.campaign.NEEDED", ("numpy", "no_such_package"))
    error = console.refused("campaign", write(tmp_path))
    assert error == "error: no_such_package: not installed, ./setup.sh --campaign does it\n"


def test_the_campaigns_that_ship_are_right() -> None:
    from rparm.campaign import bases, campaign_file, planning

    found = sorted(ROOT.glob("models/*/campaigns/*.toml"))
    assert {path.stem for path in found} == {"free_motion", "tolerance"}
    for path in found:
        campaign = campaign_file.read(path)
        with bases.opened(campaign, None) as base:
            assert planning.plan(campaign, base, path).measures
