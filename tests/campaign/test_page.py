"""The page of a campaign in a browser, and the command that writes and replays."""

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from rparm.campaign import page
from rparm.commands.campaign import _command
from tests.campaign.cluster.processes import ENVIRONMENT, completed, finish, start, table
from tests.campaign.files import commands, write
from tests.support.browser import Browser
from tests.support.paths import ROOT
from tests.support.rparm_project import Console

RUNS = 16  # groups
CHANGES = [
    ("seed = 3", 'seed = 3\nworst = ["maximum(dq1)", "settling(a)"]'),
    ("sobol", "indices"),
    ("runs = 40", f"runs = {RUNS}"),
    ("uniform = [1.0, 3.0]", "normal = [1.0, 0.5]"),  # a negative mass is refused
    (
        "trajectories = [3, 17]",
        'trajectories = [3, 17]\n[keep.settling.a]\nvariable = "q1"\ntarget = -1.5\nband = 0.1\n'
        '[keep.settling.never]\nvariable = "q1"\ntarget = 90.0\nband = 0.1\n'
        '[[maps]]\nx = "m2"\ny = "q1"\ncolour = "settling(a)"\n'
        '[[maps]]\nx = "m2"\ny = "q1"\ncolour = "settling(never)"',
    ),
]
CLICK = """
const drawing = document.querySelector('#scatter .drawing');
drawing.scrollIntoView({ block: 'center' });
const { left, top, width, height } = drawing.querySelector('.point').getBoundingClientRect();
const target = drawing.querySelector('.nsewdrag');
const at = { clientX: left + width / 2, clientY: top + height / 2, bubbles: true, view: window };
for (const kind of ['mousemove', 'mousedown']) target.dispatchEvent(new MouseEvent(kind, at));
document.querySelector('.dragcover, body').dispatchEvent(new MouseEvent('mouseup', at));
"""
CHOOSE = """
const list = document.getElementById('result');
list.value = arguments[0];
list.dispatchEvent(new Event('change'));
"""
FAILING = [("uniform = [1.0, 3.0]", "normal = [-50.0, 0.5]")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a campaign some of whose runs fail, and some do not settle."""
    folder = tmp_path_factory.mktemp("campaign")
    code, out, err = finish(
        start(write(folder, changes=CHANGES), folder / "output", "--workers", 1)
    )
    assert code == 0, err
    assert re.search(r"dashboard: http://127\.0\.0\.1:\d+/status", out)
    (folder / "hash").write_text(table(out))
    return folder / "output"


@pytest.fixture(scope="module")
def done(folder: Path) -> Path:
    """Folder of the same campaign, with its file and its output."""
    return folder.parent


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a campaign all of whose runs fail."""
    folder = tmp_path_factory.mktemp("failing")
    completed(write(folder, changes=FAILING), folder / "output", "--workers", 1)
    return folder / "output"


def shown(browser: Browser, folder: Path, **view) -> str:
    """Text of the page, a row of a table a line."""
    browser.open(folder / "campaign.html", **view)
    browser.wait("document.documentElement.dataset.ready === 'yes'")
    return browser.run("return document.body.innerText").replace("\N{MINUS SIGN}", "-")


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [400, 900, 1400])
@pytest.mark.parametrize("name", ["folder", "failing"])
def test_it_fits_is_quiet_and_accessible(
    name: str, width: int, dark: bool, browser: Browser, request: pytest.FixtureRequest
) -> None:
    shown(browser, request.getfixturevalue(name), width=width, dark=dark)
    browser.check_quiet()
    assert browser.overflow() == 0
    assert browser.violations() == []


def test_a_clicked_point_is_a_run_and_its_command_repeats_it(
    each_browser: Browser, folder: Path, console: Console
) -> None:
    browser, name = each_browser, "maximum(dq1)"
    shown(browser, folder)
    assert browser.run("return document.getElementById('result').value") == name  # as in `worst`
    browser.run(CLICK)
    browser.wait("document.getElementById('chosen').dataset.run")
    browser.check_quiet()
    rows = browser.run(
        "return [...document.querySelectorAll('#chosen dl div')].map("
        "row => [...row.children].map(cell => cell.textContent.replace('\u2212', '-')))"
    )
    found = dict(rows)
    words = shlex.split(browser.run("return document.querySelector('#chosen code').textContent"))
    run = int(browser.run("return document.getElementById('chosen').dataset.run"))
    assert words[-3:] == ["--replay", str(run), "--open"]
    code, out, _ = console(*words[1:-1])
    printed = dict(line.split(" = ") for line in out.splitlines() if " = " in line)
    assert code == 0 and {"m2", name} <= set(printed)
    for column, value in printed.items():
        label = next((label for label in found if label.split(" [")[0] == column), None)
        if label is not None and found[label] != "–":
            assert float(found[label]) == pytest.approx(float(value), rel=1e-6), column


def test_parameters_come_in_the_order_of_their_correlation(browser: Browser, folder: Path) -> None:
    shown(browser, folder)
    table = pq.read_table(folder / "blocks").to_pandas()
    for name in ("maximum(dq1)", "final(q1)"):
        browser.run(CHOOSE, name)
        browser.wait(f"document.getElementById('scatter').dataset.result === '{name}'")
        captions = browser.run("return document.getElementById('scatter').innerText")
        found = re.findall("(m2|q1): rank correlation (.[\\d.]+)", captions)
        ranks = table[["m2", "q1"]].corrwith(table[name], method="spearman")
        assert [x for x, _ in found] == sorted(ranks.index, key=lambda x: -abs(ranks[x]))
        for x, stated in found:
            assert float(stated.replace("\N{MINUS SIGN}", "-")) == pytest.approx(ranks[x], rel=0.06)


def test_what_is_missing_is_counted_and_told_from_failed_runs(
    browser: Browser, folder: Path
) -> None:
    text = shown(browser, folder)
    found = pq.read_table(folder / "blocks")
    failed = int(np.sum(found["failure"].to_numpy() != ""))
    settles = np.isfinite(found["settling(a)"].to_numpy())
    energy = np.isfinite(found["integral(actuator_power)"].to_numpy())
    assert 0 < failed < len(settles) - settles.sum()
    assert f"{failed} of {len(settles)} runs failed." in text
    rows = [line.split() for line in text.splitlines()]
    for label, there in (("settling(a) [s]", settles), ("integral(actuator_power) [W·s]", energy)):
        row = next(row for row in rows if row[:2] == label.split() and len(row) > 3)
        assert int(row[-1]) == np.sum(~there)
    lacking = len(settles) - settles.sum() - failed
    assert f"settling(a) does not settle in {lacking} of {len(settles)} runs." in text
    assert "final(q1) does not" not in text and "final(q1) is no" not in text
    assert f"Nothing is drawn for the {np.sum(~settles)} runs that have no value there." in text
    assert "settling(never) over m2 and q1\n\nNo run has a value." in text


def test_indices_say_on_how_many_groups_they_stand(browser: Browser, folder: Path) -> None:
    text = shown(browser, folder)
    found = pq.read_table(folder / "blocks")
    complete = {
        name: np.isfinite(found[name].to_numpy()).reshape(RUNS, 4).all(axis=1).sum()
        for name in ("final(q1)", "maximum(dq1)")
    }
    rows = [line.split() for line in text.splitlines()]
    for name, count in complete.items():
        groups = [
            row[-1] for row in rows if len(row) == 7 and row[:2] in ([name, "m2"], [name, "q1"])
        ]
        assert groups == [str(count)] * 2
        assert 1 < count < RUNS
    assert f"There are {RUNS} groups of runs." in text
    assert re.search(r"No indices, as it does not vary or lacks values: .*settling\(never\)", text)
    wide = re.search("Too few runs: a ± is above 0.5 for (.*)\\.", text)
    indices = [row for row in rows if len(row) == 7 and row[1] in ("m2", "q1")]
    for row in indices:
        if max(float(row[3]), float(row[5])) > 0.51:
            assert row[0] in wide[1]
    assert any(float(row[3]) > 0.51 for row in indices)


def test_failed_runs_are_a_line_for_each_kind_of_reason(
    browser: Browser, folder: Path, failing: Path
) -> None:
    assert "No run has a value." in shown(browser, failing)
    for results in (folder, failing):
        shown(browser, results)
        rows = browser.run(
            "return [...document.querySelectorAll('#failures ~ .wide tbody tr')].map("
            "row => [...row.cells].map(cell => cell.innerText))"
        )
        reasons = pq.read_table(results / "blocks")["failure"].to_pylist()
        failed = [run for run, reason in enumerate(reasons) if reason]
        assert [row[:2] for row in rows] == [[str(len(failed)), str(failed[0])]]
        assert rows[0][3].endswith(f" --replay {failed[0]}")
    assert len(set(reasons)) == len(reasons)


# ---- The command ---------------------------------------------------------------------------------


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
    assert (code, found["exit_code"], found["runs"]) == (0, 0, 4 * RUNS)
    assert found["table"] == (done / "hash").read_text() and Path(found["page"]).is_file()
    assert err.splitlines()[-1].startswith(f"complete: {4 * RUNS} runs")
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
    numbers = {name: float(value) for name, value in printed.items()}
    np.testing.assert_equal(numbers, {name: row[name] for name in numbers})  # nan equals nan
    assert np.isfinite(list(numbers.values())).sum() > 2
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
    assert "the campaign has runs 0 to 63" in console.failed(*of(done, output, "--replay", "64"))


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
