"""The page of a campaign in a browser: it fits, is quiet and readable, and says what is missing."""

import re
import shlex
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.campaign.cluster.processes import completed
from tests.campaign.files import write
from tests.support.browser import Browser
from tests.support.rparm_project import Console

RUNS = 16  # groups
CHANGES = [
    ("seed = 3", 'seed = 3\nworst = ["maximum(dq1)", "settling(a)"]'),
    ("sobol", "indices"),
    ("runs = 40", f"runs = {RUNS}"),
    ("uniform = [1.0, 3.0]", "normal = [1.0, 0.5]"),  # a negative mass is refused
    (
        "trajectories = [3, 17]",
        '[keep.settling.a]\nvariable = "q1"\ntarget = -1.5\nband = 0.1\n'
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
    completed(write(folder, changes=CHANGES), folder / "output", "--workers", 1)
    return folder / "output"


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
