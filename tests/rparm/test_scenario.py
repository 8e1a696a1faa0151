"""Reading of scenarios: what right files give, how they are found, a line for each mistake."""

import dataclasses
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from rparm import project
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import METHOD, SMALLEST_TOLERANCES, TOLERANCE
from rparm.runs import scenario, simulation
from rparm.runs import scenario as scenarios
from rparm.runs.comparison import Runs
from rparm.runs.scenario import Scenario
from rparm.systems.master import Master
from rparm.systems.structure import Connection
from tests.support.rparm_project import BUILD, FMUS, MISTAKES, SHORT, Console, declared, fmi3_fmu
from tests.support.ssp_files import SSP, edited, replace
from tests.support.tables import cases
from tests.support.toy_model import DESCRIPTION, HEAD, TIME, TOY, timed, toy


def load_times(write, start: object, stop: object, step: object) -> np.ndarray:
    return scenario.load(write(timed(start, stop, step)), TOY).times


# what a right file gives


def test_everything_given(write) -> None:
    path = write(
        HEAD + "reference_every = 3\n" + TIME + "[parameters]\nmass = 2\nmax_steps = 10\n"
        "[initial]\nspeed = -1\n[inputs.force]\nconstant = 4\n"
    )
    run = scenario.load(path, TOY)
    assert (run.name, run.model, run.title, run.description) == ("run", "toy", "A", "B")
    assert run.parameters == {"mass": 2.0, "max_steps": 10.0}
    assert run.initial == {"speed": -1.0}
    assert (run.start, run.stop, run.steps, run.tolerance) == (1.0, 2.0, (0.25,), 1e-6)
    assert run.times.tolist() == [1.0, 1.25, 1.5, 1.75, 2.0]
    assert run.inputs["force"].tolist() == [4.0] * 5
    assert run.reference_rows.tolist() == [0, 3, 4]
    assert run.reference_folder == path.parents[1] / "references" / "run"
    assert not run.times.flags.writeable and not run.inputs["force"].flags.writeable


def test_what_is_not_given_has_its_start_value(write) -> None:
    run = scenario.load(write(HEAD + TIME), TOY)
    assert run.parameters == run.initial == run.inputs == {}
    assert run.reference_rows.tolist() == [0, 1, 2, 3, 4]
    run = scenario.load(write(f"{HEAD}{TIME}[parameters]\nmass = 3\n[initial]\nspeed = 1\n"), TOY)
    assert run.start_values == {
        "mass": 3.0, "speed": 1.0, "force": 2.5, "gear": 2, "max_steps": 7, "quiet": False,
    }  # fmt: skip
    assert run.input("force").tolist() == [2.5] * 5
    run = scenario.load(write(f"{HEAD}{TIME}[inputs.force]\nconstant = 4\n"), TOY)
    assert run.input("force").tolist() == [4.0] * 5


def test_variables_have_the_types_of_their_values() -> None:
    assert list(TOY.variables) == [
        "time", "mass", "speed", "power", "force", "gear", "max_steps", "quiet",
    ]  # fmt: skip
    mass, gear, quiet = (TOY.variables[name] for name in ("mass", "gear", "quiet"))
    assert (mass.start, mass.least, mass.greatest, mass.unit) == (1.0, 0.5, math.inf, "kg")
    assert (gear.start, gear.least, gear.greatest) == (2, 1, 3)
    assert gear.items == {"first": 1, "second": 2, "third": 3}
    assert (quiet.start, quiet.items, TOY.real_outputs) == (False, {}, ["speed", "power"])
    with pytest.raises(ValueError, match="heavy"):
        toy(DESCRIPTION.replace('min="0.5"', 'min="heavy"'))


@pytest.mark.parametrize(("item", "number"), [("first", 1), ("second", 2), ("third", 3)])
def test_an_enumeration_is_given_by_the_name_of_an_item(write, item: str, number: int) -> None:
    run = scenario.load(write(f'{HEAD}{TIME}[parameters]\ngear = "{item}"\n'), TOY)
    assert run.parameters == {"gear": number}


@pytest.mark.parametrize(("given", "shown"), MISTAKES["item"]["rows"])
def test_what_is_no_item_is_refused_with_the_items(write, given: str, shown: str) -> None:
    with pytest.raises(UserError) as caught:
        scenario.load(write(f"{HEAD}{TIME}[parameters]\ngear = {given}\n"), TOY)
    message = f'[parameters] gear: expected one of "first", "second", "third", got {shown}'
    assert str(caught.value).endswith(f"run.toml: {message}")


# communication points


def test_constant_steps_do_not_accumulate(write) -> None:
    times = load_times(write, -0.5, 999.5, 0.1)
    assert len(times) == 10001
    assert np.array_equal(times[:-1], -0.5 + np.arange(10000) * 0.1)
    assert times[-1] == 999.5


def test_pattern_of_steps_is_repeated(write) -> None:
    times = load_times(write, 0, 0.9, [0.1, 0.2, 0.05])
    assert times == pytest.approx([0, 0.1, 0.3, 0.35, 0.45, 0.65, 0.7, 0.8, 0.9], abs=1e-15)
    assert times[-1] == 0.9


@pytest.mark.parametrize(
    ("stop", "count"),
    [
        (1.0, 10),
        (1.05, 11),  # half a step is left
        (1.0 + 1e-8, 11),  # short, but a step
        (1.0 + 1e-11, 10),  # a sliver joins the last step
        (1.0 - 1e-11, 10),
        (0.01, 1),  # shorter than a step
    ],
)
def test_last_step_ends_at_stop(write, stop: float, count: int) -> None:
    times = load_times(write, 0, stop, 0.1)
    assert len(times) == count + 1
    assert (times[0], times[-1]) == (0.0, stop)


def test_no_sliver_from_rounding_late_in_time(write) -> None:
    times = load_times(write, 1e6, 1e6 + 7, 0.1)
    assert len(times) == 71
    assert np.diff(times) == pytest.approx(0.1, abs=1e-9)


WHOLE = [
    (0.0, 1.05, 0.05), (0.0, 0.3, 0.1), (0.2, 0.3, 0.1), (0.0, 1.0, 1 / 3), (-5.0, -4.0, 0.05),
    (0.0, 1e6, 1e-3), (1e6, 1e6 + 1, 1e-3), (1.7e9, 1.7e9 + 0.3, 1e-3), (0.0, 0.1, 0.1),
]  # fmt: skip
BROKEN = [
    (0.0, 1.0, 0.3), (0.0, 1.05, 0.1), (0.0, 0.4, 1.0), (0.0, 1.0, 0.3333333333),
    (0.0, 1.0, 1 - 1e-12), (0.0, 1e4, 1e-3 + 1e-13), (1e6, 1e6 + 1.0005, 1e-3),
]  # fmt: skip


def test_steps_are_whole_but_for_rounding() -> None:
    assert [x for x in WHOLE if not scenario.are_whole(*x)] == []
    assert [x for x in BROKEN if scenario.are_whole(*x)] == []


# inputs


def test_sines_count_from_start(write) -> None:
    run = scenario.load(
        write(
            f"{HEAD}{TIME}[inputs.force]\noffset = 0.5\n"
            "sines = [{amplitude = 2, frequency = 0.5}, {amplitude = 1, frequency = 3, phase = 1}]"
        ),
        TOY,
    )
    expected = [
        0.5 + 2 * math.sin(math.pi * t) + math.sin(6 * math.pi * t + 1) for t in run.times - 1.0
    ]
    assert run.inputs["force"] == pytest.approx(expected, abs=1e-14)


def test_table_is_linear_and_constant_beyond_its_ends(write) -> None:
    run = scenario.load(
        write(f"{HEAD}{TIME}[inputs.force]\ntable = [[0.25, 1], [0.5, 2], [0.75, -2]]"), TOY
    )
    assert run.inputs["force"].tolist() == [1.0, 1.0, 2.0, -2.0, -2.0]
    run = scenario.load(write(f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 1], [1, 3]]"), TOY)
    assert run.inputs["force"].tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]


# finding scenarios


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The project is elsewhere."""
    monkeypatch.setattr(project, "ROOT", tmp_path)
    return tmp_path


def test_a_scenario_is_found_by_its_name(write, root: Path) -> None:
    assert project.scenario_files() == {}
    first, second = write("", "swing"), write("", "fall")
    write("").with_name("README.md").write_text("")
    assert project.scenario_files()["swing"] == first
    assert project.scenario_file("fall") == second
    for name, guess in (("swinf", ", did you mean 'swing'?"), ("x", "")):
        message = re.escape(f"no scenario '{name}'{guess} (./run.sh list names them)")
        with pytest.raises(UserError, match=f"^{message}$"):
            project.scenario_file(name)


def test_two_models_with_a_scenario_of_the_same_name(write, root: Path) -> None:
    write("", "run")
    other = root / "models" / "zoo" / "scenarios" / "run.toml"
    other.parent.mkdir(parents=True)
    other.touch()
    with pytest.raises(UserError, match=r"zoo.*: the name 'run' is taken by .*toy"):
        project.scenario_files()


def test_a_title_is_read_from_an_otherwise_wrong_file(write) -> None:
    assert scenario.title(write('title = " A "\n[parameters]\nmass = "x"\n')) == "A"
    for text, message in (("", "missing key 'title'"), ("title = 1\n", "title: expected a text")):
        with pytest.raises(UserError, match=message):
            scenario.title(write(text))


# what has been built


def test_what_is_built_has_the_name_of_its_folder(root: Path) -> None:
    (root / "build").mkdir()
    for name in ("RPPlant.fmu", "RPPlantTwo.fmu", "RPPlant.ssp"):
        (root / "build" / name).touch()
    folder = root / "models" / "rp_plant"
    assert project.built(folder, ".fmu") == root / "build" / "RPPlant.fmu"
    assert project.built(folder, ".ssp") == root / "build" / "RPPlant.ssp"
    with pytest.raises(UserError, match=r"build: has no FMU of toy: \./run\.sh builds it"):
        project.built(root / "models" / "toy", ".fmu")


def test_systems_are_found_by_their_names(root: Path) -> None:
    with pytest.raises(UserError, match=r"models: has no folder with loop\.toml"):
        project.systems()
    for name in ("loop", "machine", "other"):
        (root / "models" / name).mkdir(parents=True)
    for name in ("machine", "loop"):
        (root / "models" / name / "loop.toml").touch()
    assert list(project.systems()) == ["loop", "machine"]
    assert project.systems()["loop"] == root / "models" / "loop"


# ---- Mistakes ------------------------------------------------------------------------------------

WRONG = [
    *cases(MISTAKES["scenario"]),
    (timed(0, "1" + "0" * 400, 0.1), "[time] stop: expected a finite number"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("text", "message"), WRONG)
def test_mistake_is_explained_in_one_line(write, text: str, message: str) -> None:
    path = write(text)
    with pytest.raises(UserError) as caught:
        scenario.load(path, TOY)
    said = str(caught.value)
    assert said.startswith(f"{path}: ") and message in said and "\n" not in said


def test_what_is_no_text_is_refused(write) -> None:
    path, none = write(""), write("").with_name("none.toml")
    path.write_bytes(b"title = '\xff'")
    for wrong, message in ((path, "not UTF-8 text, at byte 9"), (none, "no such file$")):
        with pytest.raises(UserError, match=f"^{re.escape(str(wrong))}: {message}"):
            scenario.load(wrong, TOY)


@pytest.mark.parametrize(("keys", "message"), MISTAKES["elsewhere"]["rows"])
def test_what_a_scenario_elsewhere_is_of(tmp_path: Path, keys: str, message: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(f"{keys}\n{HEAD}{TIME}")
    (tmp_path / "Toy.fmu").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError, match=f"^{re.escape(str(path))}: {message}") as error:
        scenario.load(path, TOY)
    assert "\n" not in str(error.value)


# ---- Boolean inputs ------------------------------------------------------------------------------


SWITCHED = toy(
    DESCRIPTION.replace(
        "  </ModelVariables>",
        '<ScalarVariable name="brake" valueReference="11" causality="input" variability="discrete">'
        '<Boolean start="true"/></ScalarVariable>'
        '<ScalarVariable name="level" valueReference="12" causality="input" variability="discrete">'
        '<Integer start="3"/></ScalarVariable></ModelVariables>',
    )
)


def brake(write: Callable[..., object], text: str, time: str = TIME) -> np.ndarray:
    return scenario.load(write(f"{HEAD}{time}[inputs.brake]\n{text}\n"), SWITCHED).inputs["brake"]


def test_a_boolean_is_held(write) -> None:
    """At its start value, a constant, or from each time of a table on."""
    table = "table = [[0.25, true], [0.5, false], [0.9, true]]"
    for values, expected in (
        (scenario.load(write(HEAD + TIME), SWITCHED).input("brake"), [True] * 5),
        (brake(write, "constant = false"), [False] * 5),
        (brake(write, table), [True, True, False, False, True]),
    ):
        assert values.dtype == bool and values.tolist() == expected
    assert not values.flags.writeable


def test_rounding_of_times_does_not_delay_a_switch(write) -> None:
    """n steps of 0.1 s from 0.3 s on are often a bit less than n / 10 s after the start."""
    for n in range(1, 10):
        table = f"table = [[0, false], [{n / 10}, true]]"
        values = brake(write, table, f"[time]\nstart = 0.3\nstop = {0.3 + 1.0}\nstep = 0.1\n")
        assert values.tolist() == [False] * n + [True] * (11 - n)


@pytest.mark.parametrize(("text", "message"), MISTAKES["scenario_with_brake"]["rows"])
def test_mistakes_are_explained(write, text: str, message: str) -> None:
    path = write(f"{HEAD}{TIME}[inputs.brake]\n{text}\n")
    with pytest.raises(UserError) as caught:
        scenario.load(path, SWITCHED)
    said = str(caught.value)
    assert said.startswith(f"{path}: ") and message in said and "\n" not in said


def test_other_types_and_other_shapes_are_refused(write) -> None:
    with pytest.raises(UserError, match=r"level\]: is of type Integer, expected Real or Boolean$"):
        scenario.load(write(f"{HEAD}{TIME}[inputs.level]\nconstant = 1\n"), SWITCHED)
    with pytest.raises(UserError, match="constant: expected a number, got true"):
        scenario.load(write(f"{HEAD}{TIME}[inputs.force]\nconstant = true\n"), SWITCHED)


# ---- runs of the wheel ---------------------------------------------------------------------------


@pytest.fixture(params=["fmi2", "fmi3"])
def wheel(request: pytest.FixtureRequest) -> Iterator[Fmu]:
    path = BUILD / "tests" / "wheel" / "Wheel.fmu"
    with Fmu(path if request.param == "fmi2" else fmi3_fmu(path)) as fmu:
        yield fmu


INPUTS = "[inputs.speed]\nconstant = 3.0\n[inputs.is_counting]\n"


def test_a_boolean_input_and_parameter_reach_the_fmu(write, wheel: Fmu) -> None:
    text = timed(0, 10, 1) + "[parameters]\nis_reversed = true\n" + INPUTS
    text += "table = [[0, false], [4, true], [7, false]]\n"
    loaded = dataclasses.replace(scenario.load(write(text), wheel.model), panels=(("turns",),))
    result = simulation.simulate(wheel, loaded)
    assert result.times.tolist() == list(range(11))
    for time, turns in zip(result.times[1:], result.integers["turns"][1:], strict=True):
        expected = -np.floor(3.0 * time / (2 * np.pi)) if 4 < time <= 7 else 0
        assert turns == expected


def test_only_boolean_inputs(write, wheel: Fmu) -> None:
    text = f"{timed(0, 2, 1)}[initial]\nangle = 1.0\n[inputs.is_counting]\nconstant = false\n"
    result = simulation.simulate(wheel, scenario.load(write(text), wheel.model))
    assert set(result.values[:, result.names.index("angle")]) == {1.0}


def turns(wheel: Fmu, counting: object) -> int | None:
    """Turns that one of two wheels counts, which give each other their speed in a master."""
    other = [Connection("a", "angle", "b", "speed"), Connection("b", "angle", "a", "speed")]
    with Master({"a": wheel, "b": wheel}, other) as master:
        start = {"angle": 20.0, "is_counting": counting}
        master.initialize(0.0, None, {"a": start, "b": {"angle": 1.0}})
        instance = master.components["a"].instance
        return instance.integer("turns")


def test_a_master_leaves_boolean_inputs_at_their_start(wheel: Fmu) -> None:
    assert turns(wheel, True) == 3
    assert turns(wheel, False) == 0
    with pytest.raises(UserError, match=r"^a\.is_counting: expected true or false, got 1$"):
        turns(wheel, 1)


# ---- Tolerances that a method of integration cannot reach ----------------------------------------


TOLERANT = MISTAKES["tolerances"]["SCENARIO"]


def with_tolerance(folder: Path, method: str, tolerance: float, parameter: float = 0.0) -> Scenario:
    text = TOLERANT.format(tolerance=tolerance, method=method, parameter=parameter)
    path = folder / "x.toml"
    path.write_text(text, encoding="utf-8")
    return scenarios.load(path, declared("rp_manipulator"))


def effective_tolerance(fmu: Fmu, method: str, tolerance: float) -> float:
    """What the FMU integrates at."""
    with fmu.instance("x") as instance:
        instance.set_up(0.0, 1.0)
        instance.set(METHOD, fmu.model.variables[METHOD].items[method])
        instance.set(TOLERANCE, tolerance)
        instance.enter_initialization()
        instance.exit_initialization()
        value = instance.reals(["effective_relative_tolerance"])
        value.get()
        return float(value.view[0])


def test_the_smallest_tolerances_are_those_of_the_fmus() -> None:
    """Above it a tolerance makes a difference, below it none, in both versions of FMI."""
    for folder in FMUS:
        methods = declared(folder).variables.get(METHOD)
        assert methods is None or set(methods.items) == set(SMALLEST_TOLERANCES)
    for path in (FMUS["rp_manipulator"], fmi3_fmu(FMUS["rp_manipulator"])):
        with Fmu(path) as fmu:
            for method, smallest in SMALLEST_TOLERANCES.items():
                least = effective_tolerance(fmu, method, smallest)
                assert effective_tolerance(fmu, method, 2 * smallest) == pytest.approx(
                    2 * least, rel=1e-9
                )
                for factor in (0.5, 1e-3, 1e-18):
                    assert effective_tolerance(fmu, method, factor * smallest) == pytest.approx(
                        least, rel=1e-9
                    )


@pytest.mark.parametrize("method", SMALLEST_TOLERANCES)
def test_what_a_method_cannot_reach_is_refused(tmp_path: Path, method: str) -> None:
    smallest = SMALLEST_TOLERANCES[method]
    for good in (smallest, math.nextafter(smallest, 1), 1e-4):
        assert with_tolerance(tmp_path, method, good).smallest_tolerance == smallest
        with_tolerance(tmp_path, method, 1e-8, good)
    for bad in (math.nextafter(smallest, 0), smallest / 2, 1e-30, 5e-324):
        for arguments, key in (((bad,), "tolerance"), ((1e-8, bad), "[parameters] relative_")):
            with pytest.raises(UserError, match=re.escape(f"x.toml: {key}")) as caught:
                with_tolerance(tmp_path, method, *arguments)
            assert f"the smallest of {method}, got {bad!r}" in str(caught.value)


def test_errors_are_estimated_down_to_the_smallest_tolerance(tmp_path: Path) -> None:
    """From a run that is another one."""
    with Fmu(FMUS["rp_manipulator"]) as fmu:
        runs = Runs({"rp_manipulator": fmu})
        for method, smallest in SMALLEST_TOLERANCES.items():
            scenario = with_tolerance(tmp_path, method, smallest)
            assert 0 < runs.estimated(scenario, smallest).error < 1e-8


@pytest.mark.parametrize(("tolerance", "code"), [("4.9999e-12", 2), ("5e-12", 0)])
def test_the_option_of_run(tmp_path: Path, console: Console, tolerance: str, code: int) -> None:
    arguments = ("run", SHORT, "--fmi", "2", "--tolerance", tolerance, "--report", tmp_path / "r")
    if code == 0:
        assert console(*arguments)[0] == 0
        return
    words = f"--tolerance: {SHORT}: expected at least 5e-12, the smallest of cvode_adams"
    assert words in console.refused(*arguments) and not (tmp_path / "r").exists()


def test_systems_and_campaigns(tmp_path: Path, console: Console) -> None:
    place = "resources/arm_nominal.ssv"
    fine = edited(SSP, tmp_path / "fine.ssp", {place: replace('"1e-11"', '"5e-12"')})
    assert console("system", "--list", "--ssp", fine)[0] == 0
    path = edited(SSP, tmp_path / "bad.ssp", {place: replace('"1e-11"', '"4.9e-12"')})
    error = console.refused("system", "--list", "--ssp", path)
    assert "component 'arm': 'relative_tolerance': expected at" in error


CAMPAIGN = MISTAKES["tolerances"]["CAMPAIGN"]


@pytest.mark.parametrize(("section", "expected"), MISTAKES["tolerances"]["rows"])
def test_of_campaigns(tmp_path: Path, section: str, expected: str) -> None:
    planning = pytest.importorskip("rparm.campaign.planning")
    from rparm.campaign import bases, campaign_file

    path = tmp_path / "test.toml"
    path.write_text(f"{CAMPAIGN}{section}\n", encoding="utf-8")
    given = campaign_file.read(path)
    with bases.opened(given, None, path) as base:
        if not expected:
            planning.plan(given, base, path)
            return
        with pytest.raises(UserError, match=re.escape(f"test.toml: {expected}")) as caught:
            planning.plan(given, base, path)
    assert "expected at least 5e-12, the smallest of cvode_adams, got 1e-1" in str(caught.value)
