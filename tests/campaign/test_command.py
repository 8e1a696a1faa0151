"""The command: pages, replays, and what others do not import."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cosim import __main__ as cli
from tests.campaign.files import write
from tests.campaign.processes import ENVIRONMENT, finish, start, table
from tests.support.paths import ROOT

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
    page = (done / "output" / "index.html").read_text(encoding="utf-8")
    for name in re.findall(r'<img class="diagram" src="([^"]+)"', page):
        assert (done / "output" / name).read_bytes().startswith(b"\x89PNG")
    assert {"distributions.png", "indices.png", "map_0.png"} == set(
        re.findall(r'<img class="diagram" src="([^"]+)"', page)
    )
    assert (done / "hash").read_text() in page
    found = pq.read_table(done / "output" / "blocks")
    worst = int(np.nanargmax(found["maximum(dq1)"].to_numpy()))
    first = re.search(r"campaign (.*) --replay (\d+)</code>", page)
    assert int(first[2]) == found["run"][worst].as_py()
    failed = [run for run, why in zip(found["run"], found["failure"], strict=True) if why.as_py()]
    assert f"{len(failed)} runs failed" in page if failed else "runs failed" not in page


def test_a_replay_is_the_run_again(done: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = done / "output"
    arguments = ["campaign", str(done / "test.toml"), "--output", str(output), "--replay", "17"]
    assert cli.main(arguments) == 0
    printed = dict(
        line.split(" = ") for line in capsys.readouterr().out.splitlines() if " = " in line
    )
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
    assert (output / "assets" / "player.js").is_file()
    assert cli.main([*arguments[:-1], "32"]) == 2
    assert "the campaign has runs 0 to 31" in capsys.readouterr().err


def test_no_other_command_imports_what_campaigns_need() -> None:
    code = (
        "import sys; from cosim.__main__ import main; main(['list']);"
        "import cosim.commands.run, cosim.commands.system, cosim.commands.coupling;"
        "print(*(set(sys.modules) & {'dask', 'distributed', 'numba', 'pyarrow', 'SALib'}))"
    )
    run = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, env=ENVIRONMENT
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == ""


def test_it_says_what_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("cosim.commands.campaign.NEEDED", ("numpy", "no_such_package"))
    assert cli.main(["campaign", str(write(tmp_path))]) == 2
    error = capsys.readouterr().err
    assert error == "error: no_such_package: not installed, ./setup.sh --campaign does it\n"


def test_the_campaigns_that_ship_are_right() -> None:
    from cosim.campaign import bases, campaign_file, planning

    found = sorted(ROOT.glob("models/*/campaigns/*.toml"))
    assert {path.stem for path in found} == {"free_motion", "tolerance"}
    for path in found:
        campaign = campaign_file.read(path)
        with bases.opened(campaign, None) as base:
            assert planning.plan(campaign, base, path).measures
