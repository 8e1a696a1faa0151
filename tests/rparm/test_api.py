"""rparm for programs: runs are those of the commands and of physics, its page has all names."""

import inspect
import re
import shutil
import sys
import tomllib
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from lxml import etree

import rparm
from rparm import files, project
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu, read_model
from rparm.runs import scenario as scenarios
from rparm.systems import comparison
from rparm.systems.opened import opened
from tests.support.paths import ROOT
from tests.support.programs import python
from tests.support.rparm_project import MISTAKES, Console, check_near, repacked
from tests.support.ssp_files import SSP, edited, replace

RUN = {"stop_time": 1.0, "step": 0.01}
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def arm() -> Path:
    return rparm.fmu("RPManipulator")


# ---- runs


@pytest.mark.parametrize("fmi", [2, 3])
def test_free_motion_keeps_its_energy(fmi: int) -> None:
    start = {"q1": 0.5, "dq1": 2.0, "q2": 0.1, "dq2": -0.3}
    table = rparm.simulate(
        rparm.fmu("rp_manipulator", fmi=fmi), **RUN, start_values=start, tolerance=1e-11
    )
    energy = table["total_energy"]
    assert np.ptp(energy) < 1e-9 * np.abs(table["kinetic_energy"]).max()
    assert len(table["time"]) == 101 and table["time"][-1] == 1.0
    assert [table[name][0] for name in start] == list(start.values())


def test_a_run_has_the_bits_of_the_scenario(arm: Path) -> None:
    with Fmu(arm) as opened:
        loaded = scenarios.load(project.scenario_file("sine_efforts"), opened.model)
    table = rparm.simulate(
        arm,
        stop_time=loaded.stop,
        step=loaded.steps[0],
        start_values=loaded.parameters | loaded.initial,
        inputs=loaded.inputs,
        tolerance=loaded.tolerance,
    )
    by_scenario = rparm.Scenario("sine_efforts").run()
    assert set(by_scenario) == set(table)
    for name, column in by_scenario.items():
        assert np.array_equal(table[name][loaded.reference_rows], column), name


def test_inputs_may_be_given_in_four_ways(arm: Path) -> None:
    times = np.linspace(0.0, 1.0, 101)
    ways = (2.0 * times, lambda t: 2.0 * t, ((0.0, 1.0), (0.0, 2.0)), list(2.0 * times))
    runs = [rparm.simulate(arm, **RUN, inputs={"tau1": way}, outputs=["q1"]) for way in ways]
    for other in runs[1:]:
        assert other["q1"] == pytest.approx(runs[0]["q1"], abs=1e-13)
    held = rparm.simulate(arm, **RUN, inputs={"tau1": 2.0}, outputs=["q1"])
    assert np.array_equal(
        held["q1"], rparm.simulate(arm, **RUN, inputs={"tau1": np.full(101, 2.0)})["q1"]
    )


def test_a_table_is_a_mapping_with_units(arm: Path, tmp_path: Path) -> None:
    table = rparm.simulate(arm, **RUN, outputs=["q2", "q1"])
    assert list(table) == ["time", "q2", "q1"] and len(table) == 3
    assert table.units == {"time": "s", "q2": "m", "q1": "rad"}
    assert repr(table) == "Table of 101 rows: time, q2, q1"
    with pytest.raises(KeyError, match="did you mean 'q1'"):
        table["q11"]
    table.to_csv(tmp_path / "run.csv")
    names, values = files.read_trajectory(tmp_path / "run.csv", lambda text, _: ValueError(text))
    assert names == tuple(table)
    assert np.array_equal(values, np.column_stack(list(table.values())))
    with pytest.raises(UserError, match="cannot be written"):
        table.to_csv(tmp_path / "none" / "run.csv")


def test_the_default_experiment_is_the_usual_run(arm: Path, tmp_path: Path) -> None:
    usual = fmpy.read_model_description(arm).defaultExperiment
    table = rparm.simulate(arm, outputs=["q1"])
    assert np.diff(table["time"]) == pytest.approx(float(usual.stepSize))
    assert table["time"][[0, -1]].tolist() == [float(usual.startTime), float(usual.stopTime)]
    none = repacked(arm, tmp_path / "none.fmu", lambda x: re.sub("<DefaultExp[^>]*>", "", x))
    with pytest.raises(UserError, match=r"none\.fmu: .* give stop_time$"):
        rparm.simulate(none)


def test_a_table_draws_itself_and_its_page(
    arm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = rparm.simulate(arm, **RUN, start_values={"q1": 0.5})
    picture = etree.fromstring(table._repr_html_())
    assert picture.findtext("caption") == f"101 rows from 0 to 1 s, {len(table)} columns, 10 drawn"
    assert len(picture.findall(".//path")) == 10 and picture.find(".//script") is None
    shown: list[str] = []
    monkeypatch.setattr(webbrowser, "open_new_tab", shown.append)
    page = table.plot("q2", "q1", "ee_x", output=tmp_path)
    assert shown == [page.as_uri()]
    captions = re.findall("<figcaption>(.*)</figcaption>", page.read_text(encoding="utf-8"))
    assert captions == ["q2, ee_x", "q1"]
    loaded = re.findall('(?:src|href)="(assets/[^"]*)"', page.read_text(encoding="utf-8"))
    assert loaded and all((tmp_path / file).is_file() for file in loaded)


def test_a_scenario_is_within_its_bound() -> None:
    scenario = rparm.Scenario("free_fall")
    errors = scenario.errors(scenario.run(fmi=3))
    assert 0 < max(errors.values()) < 1e-7
    exact = scenario.errors(scenario.run(tolerance=1e-11))
    assert max(exact.values()) < 1e-2 * max(errors.values())


# ---- systems of files

LOOP = MISTAKES["api"]["pushed"]


def test_a_system_of_a_file_runs_with_other_values_and_steps(tmp_path: Path) -> None:
    """At rest without gravity the slide is pushed along a parabola: q2 = f2 t^2 / (2 m2)."""
    file = tmp_path / "pushed.toml"
    file.write_text(LOOP)
    system = rparm.System(file)
    assert system.variants == ("default", "heavy")
    for expected, step, table in (
        (0.75, 0.01, system.run()),
        (0.375, 0.05, system.run("heavy", step="50 ms")),
        (0.25, 0.01, system.run("heavy", parameters={"arm.m2": "6 kg", "arm.f2": 3})),
        (0.5, 0.01, system.run(parameters={"arm.f2": np.float64(2.0)})),
    ):
        assert list(table) == ["time", "arm.q2"] and table.units["arm.q2"] == "m"
        assert np.diff(table["time"]) == pytest.approx(step)
        assert table["arm.q2"] == pytest.approx(expected * table["time"] ** 2, abs=1e-9)
    file.write_text(LOOP.replace("constant = 3.0", "constant = 6.0").replace("heavy", "light"))
    assert system.run()["arm.q2"][-1] == pytest.approx(1.5, abs=1e-9)
    assert system.variants == ("default", "light")


@pytest.mark.parametrize("start", [-1.0, 5.0])
def test_a_run_may_start_at_any_time(arm: Path, tmp_path: Path, start: float) -> None:
    file = tmp_path / "pushed.toml"
    file.write_text(LOOP.replace("stop = 1.0", f"start = {start}\nstop = {start + 1}"))
    values = {"g": 0.0, "a": 0.0, "m2": 2.0}
    times = {"start_time": start, "stop_time": start + 1, "step": 0.05}
    alone = rparm.simulate(arm, **times, start_values=values, inputs={"f2": 3.0})
    system = rparm.System(file)
    joined = system.run(step=0.05)
    for time, q2 in [(alone["time"], alone["q2"]), (joined["time"], joined["arm.q2"])]:
        assert (time[0], time[-1]) == (start, start + 1)
        assert q2 == pytest.approx(0.75 * (time - start) ** 2, abs=1e-9)
    with pytest.raises(UserError, match=r"pushed\.toml: Ecos starts at 0 s$"):
        system.run(engine="ecos")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"parameters": {"arn.m2": 1.0}}, "no component 'arn', did you mean 'arm'"),
        ({"parameters": {"arm.m3": 1.0}}, "arm.m3: 'arm' has no variable 'm3'$"),
        ({"parameters": {"arm.ee_x": 1.0}}, "arm.ee_x: is an output and cannot be set"),
        ({"parameters": {"arm.m2": "2 s"}}, "arm.m2: "),
        ({"parameters": {"arm.m2": -1.0}}, "arm.m2: expected at least"),
        ({"step": 0.03}, "step: expected a whole number of steps"),
        ({"engine": "ecos", "step": 0.05}, "'ecos' takes neither parameters nor step"),
    ],
)
def test_values_that_a_system_does_not_take_are_named(
    tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    (tmp_path / "pushed.toml").write_text(LOOP)
    with pytest.raises(UserError, match=words):
        rparm.System(tmp_path / "pushed.toml").run(**changes)


def test_a_new_system_runs_and_guesses_the_connections_of_the_closed_loop(
    tmp_path: Path, console: Console
) -> None:
    """It knows the three FMUs only; the connections are those of the closed loop."""
    names = {"RPTrajectory": "trajectory", "RPController": "controller", "RPManipulator": "arm"}
    two = tmp_path / "2dof.fmu"
    shutil.copy(rparm.fmu("RPManipulator"), two)
    console("new-system", "Two", two, "--output", tmp_path)
    assert "c_2dof.q1" in list(rparm.System(tmp_path / "Two.toml").run())
    ended, _, error = console("new-system", "Loop", *names, "--output", tmp_path)
    file = tmp_path / "Loop.toml"
    assert (ended, error) == (0, "")
    alone = rparm.System(file).run()
    step = min(read_model(rparm.fmu(name)).experiment.step for name in names)
    assert np.diff(alone["time"]) == pytest.approx(step)
    text = file.read_text(encoding="utf-8")
    guessed = tomllib.loads(re.sub('(?m)^# (?=.* = ")', "", text))["connections"]
    with opened(rparm.System("closed_loop").path) as loop:
        expected = {c.end: c.start for c in loop.system.connections}
    for known, name in names.items():
        guessed = {x.replace(known, name): y.replace(known, name) for x, y in guessed.items()}
    assert guessed == expected
    assert "exists already" in console.refused("new-system", "Loop", *names, "--output", tmp_path)
    assert file.read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("name", "own", "other", "guessed"),
    [
        ("tau1", "", "1", True),
        ("tau_1", "", "1", True),
        ("tau_1", "1", "", True),
        ("tau1", "", "N.m", True),  # of one name, and a connection may have a unit at one end
        ("tau_1", "", "N.m", False),
        ("tau1", "1", "N.m", False),
    ],
)
def test_one_is_no_unit_where_connections_are_guessed(
    name: str, own: str, other: str, guessed: bool, tmp_path: Path, console: Console
) -> None:
    for model, renamed, unit in (("RPManipulator", name, own), ("RPController", "tau1", other)):

        def change(text: str, renamed: str = renamed, unit: str = unit) -> str:
            given = f' unit="{unit}"' if unit else ""
            changed = rf'name="{renamed}"\1<Real{given}'
            text, count = re.subn(r'name="tau1"([^<]*)<Real unit="N.m"', changed, text)
            assert count == 1
            return text

        repacked(rparm.fmu(model), tmp_path / f"{model}.fmu", change)
    fmus = [tmp_path / f"{model}.fmu" for model in ("RPManipulator", "RPController")]
    console("new-system", "Loop", *fmus, "--output", tmp_path)
    text = (tmp_path / "Loop.toml").read_text(encoding="utf-8")
    assert (f'# "RPManipulator.{name}" = "RPController.tau1"' in text) == guessed


# ---- what is wrong


@pytest.mark.parametrize(
    ("change", "words"),
    [
        *MISTAKES["api"]["rows"],
        ({"inputs": {"tau1": lambda t: np.inf if t > 0.5 else 0.0}}, "tau1: is inf at t = 0.51"),
        ({"inputs": {"tau1": ((0.0, 0.0), (1.0, 2.0))}}, "times of a table increase"),
        ({"inputs": {"tau1": ((0.0,), (1.0, 2.0))}}, "have the same length"),
    ],
)
def test_a_mistake_is_one_line(arm: Path, change: dict[str, object], words: str) -> None:
    with pytest.raises(UserError, match=words) as raised:
        rparm.simulate(arm, **(RUN | change))
    assert "\n" not in str(raised.value)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "no.fmu").write_bytes(b"no archive")
    for wrong, words in (
        (lambda: rparm.fmu("RPPlnt"), r"'RPPlnt', did you mean 'RPPlant'\? \(known: rp_actuator"),
        (lambda: rparm.fmu("RPPlant", fmi=1), "fmi: expected 2 or 3, got 1"),
        (lambda: rparm.simulate(tmp_path / "no.fmu", **RUN), "not an FMU"),
        (lambda: rparm.simulate(tmp_path / "none.fmu", **RUN), "none.fmu"),
        (lambda: rparm.Scenario("sine_effort"), "did you mean 'sine_efforts'"),
        (lambda: rparm.System("closed"), "no system 'closed'"),
        (lambda: rparm.System("machine").run("nominl"), "no variant 'nominl'"),
        (lambda: rparm.System("machine").run("pick_and_place", engine="x"), "engine: expected"),
    ):
        with pytest.raises(UserError, match=words):
            wrong()
    with pytest.raises(AttributeError, match="no attribute 'fmus'"):
        rparm.fmus  # noqa: B018


# ---- its page


PAGE = (ROOT / "docs" / "python-api.md").read_text(encoding="utf-8")


def functions() -> Iterator[tuple[str, Callable]]:
    """All functions and methods for programs, by their names."""
    for name in rparm.__all__:
        thing = getattr(rparm, name)
        methods = vars(thing).items() if inspect.isclass(thing) else [("", thing)]
        for method, function in methods:
            if inspect.isfunction(function) and not method.startswith("_"):
                yield f"{name}.{method}".removesuffix("."), function


def test_the_page_has_all_names() -> None:
    assert set(re.findall(r"`rparm\.(\w+)", PAGE.split("```")[0])) >= set(rparm.__all__)
    for name, _ in functions():
        assert f"`rparm.{name}" in PAGE or f"`{name.split('.')[-1]}`" in PAGE, name


def test_every_argument_is_explained() -> None:
    for name, function in functions():
        arguments = set(inspect.signature(function).parameters) - {"self", "path", "table"}
        heads = re.findall(r"^ *(\w+(?:, \w+)*)(?: :|$)", function.__doc__, re.MULTILINE)
        explained = {argument for head in heads for argument in head.split(", ")}
        explained |= set(re.findall(r"`(\w+)`", function.__doc__))
        assert arguments <= explained, name


def test_what_stands_on_the_page_runs(tmp_path: Path) -> None:
    blocks = BLOCK.findall(PAGE)
    assert len(blocks) == 4
    made = python("-c", "\n".join(blocks), folder=tmp_path, check=True)
    lines = made.stdout.splitlines()
    assert lines[0].endswith(" rad") and lines[-1].startswith("no model 'RPPlnt', did you")
    check_near(np.genfromtxt(tmp_path / "fall.csv", delimiter=",", names=True))
    assert (tmp_path / "payload/manifest.json").is_file()


# ---- Many runs -----------------------------------------------------------------------------------


def test_a_system_runs_by_all_engines(tmp_path: Path) -> None:
    short = {"SystemStructure.ssd": replace('stopTime="6"', 'stopTime="0.5"')}
    loop = rparm.System(edited(SSP, tmp_path / "Short.ssp", short))
    assert "nominal" in loop.variants
    ours, *others = (loop.run("nominal", engine=name) for name in ("master", "ecos", "helics"))
    assert ours.units["arm.q1"] == "rad"
    for other in others:
        assert ours["arm.q1"] == pytest.approx(other["arm.q1"], abs=1e-9)


def test_a_campaign_is_a_table_of_its_runs(tmp_path: Path) -> None:
    """Without gravity and offset the slide is pushed along a parabola: q2 = f2 t^2 / (2 m2)."""
    file = tmp_path / "pushed.toml"
    file.write_text(
        'title = "Pushed"\ndescription = "-"\nscenario = "constant_effort"\nsampling = "random"\n'
        "runs = 5\ntime = { stop = 1.0 }\n[set]\ng = 0.0\na = 0.0\nq1 = 0.0\nq2 = 0.0\n"
        "dq1 = 0.0\ndq2 = 0.0\ntau1 = 0.0\nf2 = 2.0\n[parameters.m2]\nuniform = [0.5, 1.5]\n"
        '[keep]\nfinal = ["q2"]\n'
    )
    runs = rparm.run_campaign(file, output=tmp_path / "out", workers=1)
    assert runs["run"].tolist() == list(range(5)) and set(runs["failure"]) == {""}
    assert runs["final(q2)"] == pytest.approx(1.0 / runs["m2"], abs=1e-8)
    assert len(set(runs["m2"])) == 5


def test_what_the_coupling_costs_is_asked_of_the_system_that_knows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    loop = rparm.System("closed_loop")
    asked: list[tuple[Path, Path]] = []
    folder, module = comparison.coupling_study()
    monkeypatch.setattr(
        module, "study_coupling", lambda *given: asked.append(given) or {"part": {"passed": True}}
    )
    assert loop.study_coupling(tmp_path) == {"part": {"passed": True}}
    assert asked == [(loop.path, tmp_path)]
    with pytest.raises(UserError, match="has no study of its coupling, closed_loop has one"):
        rparm.System("machine").study_coupling(tmp_path)


@pytest.mark.parametrize(
    ("package", "words", "call"),
    [
        ("distributed", "not installed", lambda: rparm.run_campaign("x.toml")),
        (
            "helics",
            "cannot be loaded",
            lambda: rparm.System("closed_loop").run("nominal", engine="helics"),
        ),
    ],
)
def test_a_package_that_is_missing_is_named(
    monkeypatch: pytest.MonkeyPatch, package: str, words: str, call: Callable[[], object]
) -> None:
    for name in [name for name in sys.modules if name.startswith(("rparm.campaign", package))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UserError, match=rf"^{package}\b.* {words}.*\./setup\.sh --\w+ \w+ it\b"):
        call()
