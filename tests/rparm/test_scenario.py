"""Reading of scenarios: what right files give, how they are found, and what mistakes are told."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from rparm import project
from rparm.errors import UserError
from rparm.runs import scenario
from tests.support.rparm_project import MISTAKES
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


def test_only_what_is_needed(write) -> None:
    run = scenario.load(write(HEAD + TIME), TOY)
    assert run.parameters == run.initial == run.inputs == {}
    assert run.reference_rows.tolist() == [0, 1, 2, 3, 4]


def test_what_is_not_given_has_its_start_value(write) -> None:
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


def test_find_by_name(write, root: Path) -> None:
    first, second = write("", "swing"), write("", "fall")
    write("").with_name("README.md").write_text("")
    assert project.scenario_files()["swing"] == first
    assert project.scenario_file("fall") == second


def test_find_suggests_a_name(write, root: Path) -> None:
    write("", "swing")
    write("", "fall")
    message = re.escape("no scenario 'swinf', did you mean 'swing'? (./run.sh list names them)")
    with pytest.raises(UserError, match=f"^{message}$"):
        project.scenario_file("swinf")
    with pytest.raises(UserError, match=re.escape("no scenario 'x' (./run.sh")):
        project.scenario_file("x")


def test_find_without_scenarios(root: Path) -> None:
    assert project.scenario_files() == {}
    with pytest.raises(UserError, match=re.escape("no scenario 'x' (./run.sh")):
        project.scenario_file("x")


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


def test_missing_file(write) -> None:
    path = write("").with_name("none.toml")
    with pytest.raises(UserError, match=rf"^{re.escape(str(path))}: no such file$"):
        scenario.load(path, TOY)


def test_bytes_that_are_not_text(write) -> None:
    path = write("")
    path.write_bytes(b"title = '\xff'")
    with pytest.raises(UserError, match="not UTF-8 text, at byte 9"):
        scenario.load(path, TOY)


@pytest.mark.parametrize(("keys", "message"), MISTAKES["elsewhere"]["rows"])
def test_what_a_scenario_elsewhere_is_of(tmp_path: Path, keys: str, message: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(f"{keys}\n{HEAD}{TIME}")
    (tmp_path / "Toy.fmu").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError, match=f"^{re.escape(str(path))}: {message}") as error:
        scenario.load(path, TOY)
    assert "\n" not in str(error.value)
