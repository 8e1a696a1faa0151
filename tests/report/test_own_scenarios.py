"""Scenarios of users: written by `new`, run from anywhere, refused where they are wrong."""

import json
import re
import tomllib
import webbrowser
from pathlib import Path

import numpy as np
import pytest

from rparm import project
from rparm.report.overview import Entry, forget, read, record, write
from rparm.report.scenario_page import describe_signal
from rparm.runs import scenario
from rparm.runs.inputs import Polyline
from tests.report.conftest import CONTENT, STRANGE, show
from tests.support.browser import Browser
from tests.support.rparm_project import FMUS, MISTAKES, Console, check_near, declared


@pytest.fixture(autouse=True)
def in_a_folder_of_the_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


# ---- new -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", FMUS)
def test_a_new_scenario_runs_as_written(console: Console, tmp_path: Path, model: str) -> None:
    assert console("new", "first", "--model", model)[0] == 0
    loaded = scenario.load(tmp_path / "first.toml", declared(model))
    begin = project.model(model) / project.START
    given = tomllib.loads(begin.read_text(encoding="utf-8"))["initial"] if begin.exists() else {}
    assert loaded.model == model and loaded.start_values == declared(model).start_values | given
    code, out, err = console("run", "first.toml", "--report", "out")
    assert (code, err) == (0, "") and "; out/files/first.html; open it: ./run.sh run first" in out
    if given:
        check_near(np.genfromtxt("out/files/first.csv", delimiter=",", names=True))


@pytest.mark.parametrize("model", FMUS)
def test_every_line_in_a_comment_can_be_used(console: Console, tmp_path: Path, model: str) -> None:
    assert console("new", "all", "--model", model)[0] == 0
    path = tmp_path / "all.toml"
    used = re.sub(r"(?m)^# (\w+ = )", r"\1", path.read_text(encoding="utf-8"))
    path.write_text(used, encoding="utf-8")
    loaded = scenario.load(path, declared(model))
    given = loaded.parameters | loaded.initial
    settable = {
        name for name, variable in declared(model).variables.items()
        if variable.start is not None and variable.type != "String"
        and (variable.is_a("parameters") or variable.is_a("initial"))
    }  # fmt: skip
    assert set(given) == settable and loaded.panels
    moved = {name for name in settable if given[name] != loaded.defaults[name]}
    assert moved == ({"q1"} if (project.model(model) / project.START).exists() else set())


def test_the_usual_model_has_the_most_scenarios(console: Console) -> None:
    assert console("new", "first.toml")[0] == 0
    assert 'model = "rp_manipulator"' in Path("first.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [STRANGE, "mit Leerzeichen", "a.b", 'quote " and \\ here'])
def test_strange_names(console: Console, tmp_path: Path, name: str) -> None:
    assert console("new", "--", name)[0] == 0
    assert f"{name}.toml" in {path.name for path in tmp_path.iterdir()}
    assert scenario.title(tmp_path / f"{name}.toml") == name


def test_a_file_that_exists_stays(console: Console) -> None:
    Path("mine.toml").write_text("precious", encoding="utf-8")
    for name in ("mine", "mine.toml"):
        assert "mine.toml: exists already" in console.refused("new", name)
    assert Path("mine.toml").read_text(encoding="utf-8") == "precious"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [*MISTAKES["new"]["rows"], (["x" * 300], "cannot be written: File name too long")],
)
def test_what_cannot_be_written(
    console: Console, tmp_path: Path, arguments: list[str], words: str
) -> None:
    assert words in console.refused("new", *arguments)
    assert list(tmp_path.iterdir()) == []


# ---- run FILE ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES["own_scenario"]["rows"])
def test_a_wrong_file_is_refused(console: Console, old: str, new: str, words: str) -> None:
    assert old in CONTENT
    Path("wrong.toml").write_text(CONTENT.replace(old, new), encoding="utf-8")
    error = console.refused("run", "wrong.toml", "--report", "out")
    assert "wrong.toml: " in error and error.count("wrong.toml") == 1 and words in error
    assert not Path("out").exists()


@pytest.mark.parametrize("name", ["missing.toml", ".", "folder.toml"])
def test_what_is_no_file_is_refused(console: Console, name: str) -> None:
    Path("folder.toml").mkdir()
    assert name in console.refused("run", name, "--report", "out")


STOPS = CONTENT.replace('"erk"', '"cvode_adams"').replace(
    "[initial]", "max_internal_steps = 1\n[initial]\ndq1 = 1e4"
)


def test_a_run_that_fails_is_in_the_report(console: Console, browser: Browser) -> None:
    """Its page replaces the page of an earlier run, and the files after it still run."""
    Path("a.toml").write_text(CONTENT, encoding="utf-8")
    assert console("run", "a.toml", "--report", "out")[0] == 0
    Path("a.toml").write_text(STOPS, encoding="utf-8")
    Path("b.toml").write_text(CONTENT, encoding="utf-8")
    code, out, err = console("run", "a.toml", "b.toml", "--report", "out")
    assert code == 2 and err.count("\n") == 1 and "the integrator took all" in err
    assert "FAILED" in out and "b: out/files/b.html" in out
    entries = {entry.name: entry for entry in read(Path("out"), "files")}
    assert {name: entry.status for name, entry in entries.items()} == {
        "a": "FAILED",
        "b": "completed",
    }
    browser.open(Path("out/index.html"))
    assert "1 of 2 failed" in browser.run("return document.body.innerText")
    assert err.removeprefix("error: ").strip() in entries["a"].detail
    browser.open(Path("out/files/a.html"))
    text = browser.run("return document.body.innerText")
    assert err.removeprefix("error: ").strip() in text and "dq1" in text
    browser.check_quiet()


def test_a_run_that_fails_shows_its_rows(console: Console, browser: Browser) -> None:
    late = CONTENT.replace("[0.5, 10.0]]", "[0.5, 10.0], [0.51, 1e300]]")
    Path("late.toml").write_text(late, encoding="utf-8")
    code, _, err = console("run", "late.toml", "--report", "out")
    assert code == 2 and "in the step from t = 0.5" in err
    show(browser, Path("out/files/late.html"))
    last = float(Path("out/files/late.csv").read_text("utf-8").splitlines()[-1].split(",")[0])
    assert 0.5 <= last < 0.6 and browser.run("return page.x.at(-1)") == last
    assert browser.run("return page.player.motion.q1.length") > 50
    browser.check_quiet()


def test_a_run_that_never_starts_has_a_page_without_plots(
    console: Console, browser: Browser
) -> None:
    massless = CONTENT.replace("[initial]", "m1 = 0.0\nI1z = 0.0\nI2z = 0.0\n[initial]")
    Path("x.toml").write_text(CONTENT, encoding="utf-8")
    assert console("run", "x.toml", "--report", "out")[0] == 0
    Path("x.toml").write_text(massless, encoding="utf-8")
    code, _, err = console("run", "x.toml", "--report", "out")
    assert code == 2
    browser.open(Path("out/files/x.html"))
    text = browser.run("return document.body.innerText")
    assert err.removeprefix("error: ").strip() in text and "FAILED" in text
    assert browser.run("return document.querySelector('.plot') === null")
    assert not Path("out/files/x.csv").exists()  # of the earlier run
    browser.check_quiet()


def test_two_files_of_one_name_are_refused(console: Console) -> None:
    for name in ("a", "b"):
        Path(name).mkdir()
        Path(name, "x.toml").write_text(CONTENT, encoding="utf-8")
    error = console.refused("run", "a/x.toml", "b/x.toml", "--report", "out")
    assert "b/x.toml: its page would have the same name as the page of a/x.toml" in error


def test_capitals_of_a_suffix_do_not_matter(console: Console) -> None:
    assert console("new", "Swing.TOML")[0] == 0
    assert [path.name for path in Path.cwd().iterdir()] == ["Swing.TOML"]
    code, out, _ = console("run", "Swing.TOML", "--report", "out")
    assert code == 0 and "Swing: out/files/Swing.html" in out


def test_files_of_one_name_have_pages_of_their_own(console: Console) -> None:
    for folder, speed in (("a", "0.3"), ("b", "0.4"), ("a", "0.3")):
        Path(folder).mkdir(exist_ok=True)
        text = CONTENT.replace("q1 = 0.3", f"q1 = {speed}")
        Path(folder, "x.toml").write_text(text, encoding="utf-8")
        assert console("run", f"{folder}/x.toml", "--report", "out")[0] == 0
    entries = {entry.name: entry.source for entry in read(Path("out"), "files")}
    assert entries == {
        "x": str(Path("a/x.toml").absolute()),
        "x (2)": str(Path("b/x.toml").absolute()),
    }
    starts = [
        Path(f"out/files/{name}.csv").read_text("utf-8").splitlines()[1].split(",")[1]
        for name in entries
    ]
    assert sorted(starts) == ["0.3", "0.4"]


def test_a_long_table_is_summed_up() -> None:
    points = tuple((float(i), float(i % 3)) for i in range(3))
    assert describe_signal(Polyline(points)) == "0 at 0 s, 1 at 1 s, 2 at 2 s, linear in between"
    many = tuple((i / 10, float(i % 7)) for i in range(50))
    summed = "table of 50 points from 0 to 4.9 s, values from 0 to 6, linear in between"
    assert describe_signal(Polyline(many)) == summed


def test_the_page_of_a_file_is_opened(console: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open_new_tab", lambda url: opened.append(url) or True)
    Path("x.toml").write_text(CONTENT, encoding="utf-8")
    assert console("run", "x.toml", "--open", "--report", "out")[0] == 0
    quick = ("constant_effort_single_step", "--tolerance", "1e-8")
    assert console("run", *quick, "--open", "--report", "out")[0] == 0
    pages = ("out/files/x.html", "out/index.html")
    assert opened == [Path(page).absolute().as_uri() for page in pages]


def test_without_a_browser_the_page_is_named(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(webbrowser, "open_new_tab", lambda _: False)
    code, _, err = console("new", "first", "--open")
    assert code == 0 and err.endswith(f"{Path('first.toml').absolute()}\n")


# ---- overview ------------------------------------------------------------------------------------

ENTRY = Entry("a", "A", "Model", "a.html", "passed", 1e-9, 1e-6, "worst: x", "M0 0L1 1", "text")
WRONG = (
    '{"name": "a", "title": 1, "group": "M", "page": "a.html", "status": "", "section": "system"}'
)


def written(report: Path) -> Path:
    """Two pages with entries, and the start page."""
    for section in ("scenarios", "system"):
        (report / section).mkdir()
        (report / section / "a.html").touch()
        index = record(report, section, [ENTRY])
    return index


@pytest.mark.parametrize(
    "damaged", ["", "{", "[1]", '{"name": "a"}', "null", WRONG, "\ud800", "[" * 10_000]
)
def test_damaged_entries_do_not_count(tmp_path: Path, damaged: str) -> None:
    written(tmp_path)
    file = tmp_path / "system/a.entry.json"
    file.write_text(damaged, encoding="utf-8", errors="surrogatepass")
    index = record(tmp_path, "scenarios", [ENTRY])
    assert [entry.section for entry in read(tmp_path, "scenarios")] == ["scenarios"]
    assert 'href="system/' not in index.read_text(encoding="utf-8")


def test_what_is_forgotten_is_no_longer_shown(tmp_path: Path) -> None:
    index = written(tmp_path)
    assert json.loads((tmp_path / "system/a.entry.json").read_text())["name"] == "a"
    forget(tmp_path, "system")
    page = index.read_text(encoding="utf-8")
    assert 'href="scenarios/a.html"' in page and 'href="system/' not in page
    assert not (tmp_path / "system/a.html").exists()
    (tmp_path / "scenarios/a.html").unlink()  # by the user
    assert 'href="scenarios/' not in write(tmp_path).read_text(encoding="utf-8")
    forget(tmp_path, "scenarios")
    assert not index.exists()
