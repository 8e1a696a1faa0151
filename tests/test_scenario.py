"""Reading of scenarios: every mistake gets its message; the shipped ones are worth running."""

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

from cosim import scenario, variables
from cosim.errors import UserError
from cosim.scenario import Scenario

VARIABLES = """
include = ["../more/solver.toml"]
[variables.mass]
reference = 1
causality = "parameter"
unit = "kg"
min = 0.5
start = 1.0
[variables.speed]
reference = 3
causality = "output"
initial = "exact"
max = 100.0
[variables.force]
reference = 5
causality = "input"
min = -10.0
[variables.power]
reference = 4
causality = "output"
initial = "calculated"
[variables.gear]
reference = 6
type = "Enumeration"
causality = "parameter"
start = "second"
[variables.gear.items]
first = { description = "Slow", constant = "GEAR_FIRST" }
second = { description = "Faster", constant = "GEAR_SECOND" }
third = { description = "Fast", constant = "GEAR_THIRD" }
"""
INCLUDED = """
[variables.max_steps]
reference = 9
type = "Integer"
causality = "parameter"
[variables.time]
reference = 0
causality = "independent"
"""
HEAD = 'title = "A"\ndescription = "B"\ntolerance = 1e-6\n'
TIME = "[time]\nstart = 1.0\nstop = 2.0\nstep = 0.25\n"


@pytest.fixture
def write(tmp_path: Path):
    """Writes a scenario of a small model and returns its path."""
    model = tmp_path / "models" / "toy"
    (model / "scenarios").mkdir(parents=True)
    (model / "variables.toml").write_text(VARIABLES)
    (tmp_path / "models" / "more").mkdir()
    (tmp_path / "models" / "more" / "solver.toml").write_text(INCLUDED)

    def write(text: str, name: str = "run") -> Path:
        path = model / "scenarios" / f"{name}.toml"
        path.write_text(text)
        return path

    return write


def timed(start: object, stop: object, step: object) -> str:
    return f"{HEAD}[time]\nstart = {start}\nstop = {stop}\nstep = {step}\n"


def load_times(write, start: object, stop: object, step: object) -> np.ndarray:
    return scenario.load(write(timed(start, stop, step))).times


# what a right file gives


def test_everything_given(write) -> None:
    path = write(
        HEAD + "reference_every = 3\n" + TIME + "[parameters]\nmass = 2\nmax_steps = 10\n"
        "[initial]\nspeed = -1\n[inputs.force]\nconstant = 4\n"
    )
    run = scenario.load(path)
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
    run = scenario.load(write(HEAD + TIME))
    assert run.parameters == run.initial == run.inputs == {}
    assert run.reference_rows.tolist() == [0, 1, 2, 3, 4]


def test_variables_are_read_with_their_includes(write) -> None:
    declared = variables.load(write("").parents[1])
    assert list(declared) == ["time", "mass", "speed", "power", "force", "gear", "max_steps"]
    assert declared["mass"]["type"] == "Real" and declared["max_steps"]["type"] == "Integer"


def test_an_enumeration_starts_at_the_number_of_its_item(write) -> None:
    gear = variables.load(write("").parents[1])["gear"]
    assert (gear["start"], gear["min"], gear["max"]) == (2, 1, 3)


@pytest.mark.parametrize(("item", "number"), [("first", 1), ("second", 2), ("third", 3)])
def test_an_enumeration_is_given_by_the_name_of_an_item(write, item: str, number: int) -> None:
    run = scenario.load(write(f'{HEAD}{TIME}[parameters]\ngear = "{item}"\n'))
    assert run.parameters == {"gear": number}


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ('"fourth"', "'fourth'"),
        ('"Third"', "'Third', did you mean 'third'?"),
        ("2", "2"),
        ("true", "true"),
        ('["first"]', "['first']"),
    ],
)
def test_what_is_no_item_is_refused_with_the_items(write, given: str, shown: str) -> None:
    with pytest.raises(UserError) as caught:
        scenario.load(write(f"{HEAD}{TIME}[parameters]\ngear = {given}\n"))
    message = f'[parameters] gear: expected one of "first", "second", "third", got {shown}'
    assert str(caught.value).endswith(f"run.toml: {message}")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('start = "second"', 'start = "fourth"', "start must be one of first, second, third"),
        ("[variables.gear.items]", "[variables.gear.things]", "an Enumeration needs items"),
    ],
)
def test_a_wrong_enumeration_is_refused(write, old: str, new: str, message: str) -> None:
    path = write(HEAD + TIME)
    declared = path.parents[1] / "variables.toml"
    declared.write_text(declared.read_text().replace(old, new))
    with pytest.raises(UserError, match=re.escape(f"[variables.gear]: {message}")):
        scenario.load(path)


def test_variable_declared_twice(write, tmp_path: Path) -> None:
    path = write(HEAD + TIME)
    more = tmp_path / "models" / "more" / "solver.toml"
    more.write_text(INCLUDED + "[variables.mass]\nreference = 12\n")
    with pytest.raises(UserError, match=r"solver\.toml: \[variables\.mass\] is already in .*toy"):
        scenario.load(path)


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


# inputs


def test_sines_count_from_start(write) -> None:
    run = scenario.load(
        write(
            f"{HEAD}{TIME}[inputs.force]\noffset = 0.5\n"
            "sines = [{amplitude = 2, frequency = 0.5}, {amplitude = 1, frequency = 3, phase = 1}]"
        )
    )
    expected = [
        0.5 + 2 * math.sin(math.pi * t) + math.sin(6 * math.pi * t + 1) for t in run.times - 1.0
    ]
    assert run.inputs["force"] == pytest.approx(expected, abs=1e-14)


def test_table_is_linear_and_constant_beyond_its_ends(write) -> None:
    run = scenario.load(
        write(f"{HEAD}{TIME}[inputs.force]\ntable = [[0.25, 1], [0.5, 2], [0.75, -2]]")
    )
    assert run.inputs["force"].tolist() == [1.0, 1.0, 2.0, -2.0, -2.0]
    run = scenario.load(write(f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 1], [1, 3]]"))
    assert run.inputs["force"].tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]


# mistakes: the text of the file, what the message says

MISTAKES = {
    "not TOML": ("title = ", "not valid TOML: Invalid value (at end of document)"),
    "missing key": (TIME, "missing key 'title'"),
    "missing time": (HEAD, "missing key 'time'"),
    "misspelt key": (
        HEAD.replace("tolerance", "tolerence") + TIME,
        "unknown key 'tolerence', did you mean 'tolerance'?",
    ),
    "unknown key": (f"{HEAD}zzz = 1\n{TIME}", "unknown key 'zzz' (known: title, description, "),
    "unknown section": (
        f"{HEAD}{TIME}[parameter]\n",
        "unknown key 'parameter', did you mean 'parameters'?",
    ),
    "misspelt time key": (
        timed(0, 1, 0.1).replace("step", "stepp"),
        "[time]: unknown key 'stepp', did you mean 'step'?",
    ),
    "missing time key": (HEAD + "[time]\nstart = 0\nstop = 1", "[time]: missing key 'step'"),
    "time is no table": (HEAD + "time = 3", "[time]: expected a table, got 3"),
    "parameters are no table": (f"{HEAD}parameters = 1\n{TIME}", "[parameters]: expected a table"),
    "inputs are no table": (f"{HEAD}inputs = []\n{TIME}", "[inputs]: expected a table, got []"),
    "title is no text": ('title = 1\ndescription = ""\ntolerance = 1e-6\n' + TIME, "title: expect"),
    "empty description": (
        HEAD.replace('"B"', '" "') + TIME,
        "description: expected a text, got ' '",
    ),
    "text for a number": (
        HEAD.replace("1e-6", '"1e-6"') + TIME,
        "tolerance: expected a number, got '1e-6'",
    ),
    "bool for a number": (
        HEAD.replace("1e-6", "true") + TIME,
        "tolerance: expected a number, got true",
    ),
    "tolerance 0": (
        HEAD.replace("1e-6", "0") + TIME,
        "tolerance: expected a number between 0 and 1, got 0.0",
    ),
    "tolerance 1": (HEAD.replace("1e-6", "1") + TIME, "between 0 and 1, got 1.0"),
    "tolerance nan": (HEAD.replace("1e-6", "nan") + TIME, "tolerance: expected a finite number"),
    "reference_every 0": (
        f"{HEAD}reference_every = 0\n{TIME}",
        "reference_every: expected a whole number from 1 on, got 0",
    ),
    "reference_every 1.0": (f"{HEAD}reference_every = 1.0\n{TIME}", "whole number from 1 on"),
    "reference_every true": (f"{HEAD}reference_every = true\n{TIME}", "on, got true"),
    "start inf": (timed("-inf", 1, 0.1), "[time] start: expected a finite number, got -inf"),
    "stop nan": (timed(0, "nan", 0.1), "[time] stop: expected a finite number, got nan"),
    "stop too large": (timed(0, "1" + "0" * 400, 0.1), "[time] stop: expected a finite number"),
    "stop at start": (timed(3, 3, 0.1), "[time] stop: expected a time after start = 3.0, got 3.0"),
    "stop before start": (timed(3, 2, 0.1), "[time] stop: expected a time after start = 3.0"),
    "step 0": (timed(0, 1, 0), "[time] step: expected more than 0 s, got 0.0"),
    "step negative": (timed(0, 1, -0.1), "[time] step: expected more than 0 s, got -0.1"),
    "step inf": (timed(0, 1, "inf"), "[time] step: expected a finite number, got inf"),
    "step is bool": (timed(0, 1, "true"), "[time] step: expected a number, got true"),
    "step 0 in a pattern": (timed(0, 1, [0.1, 0]), "[time] step: expected more than 0 s, got 0.0"),
    "no pattern": (timed(0, 1, []), "[time] step: expected a list of numbers, got []"),
    "text in a pattern": (timed(0, 1, [0.1, "a"]), "[time] step: expected a number, got 'a'"),
    "step lost at start": (
        timed(1e6, 1e6 + 1, 1e-11),
        "[time] step: 1e-11 s is lost in rounding between start and stop",
    ),
    "step lost at stop": (timed(0, 1e6, 1e-11), "[time] step: 1e-11 s is lost in rounding"),
    "points that coincide": (
        timed(1e9, 1000000000.0001, 9e-8),
        "[time] step: too short to tell the communication points apart",
    ),
    "too many steps": (
        timed(0, 1e6, 1e-3),
        "[time] step: makes 1e+09 steps, expected at most 10000000",
    ),
    "misspelt parameter": (
        f"{HEAD}{TIME}[parameters]\nmas = 1",
        "[parameters]: the model has no variable 'mas', did you mean 'mass'? (known: mass, ",
    ),
    "input as parameter": (
        f"{HEAD}{TIME}[parameters]\nforce = 1",
        "[parameters]: 'force' is not a parameter of the model (known: mass, gear, max_steps)",
    ),
    "parameter as initial": (
        f"{HEAD}{TIME}[initial]\nmass = 1",
        "[initial]: 'mass' is not a state of the model (known: speed)",
    ),
    "output as initial": (f"{HEAD}{TIME}[initial]\npower = 1", "'power' is not a state"),
    "unknown initial": (
        f"{HEAD}{TIME}[initial]\nx = 1",
        "[initial]: the model has no variable 'x'",
    ),
    "output as input": (
        f"{HEAD}{TIME}[inputs.power]\nconstant = 1",
        "[inputs]: 'power' is not an input of the model (known: force)",
    ),
    "unknown input": (
        f"{HEAD}{TIME}[inputs.forse]\nconstant = 1",
        "[inputs]: the model has no variable 'forse', did you mean 'force'?",
    ),
    "parameter is text": (
        f"{HEAD}{TIME}[parameters]\nmass = 'x'",
        "[parameters] mass: expected a number, got 'x'",
    ),
    "parameter is bool": (f"{HEAD}{TIME}[parameters]\nmass = true", "mass: expected a number"),
    "parameter nan": (f"{HEAD}{TIME}[parameters]\nmass = nan", "mass: expected a finite number"),
    "parameter below min": (
        f"{HEAD}{TIME}[parameters]\nmass = 0.25",
        "[parameters] mass: expected at least 0.5 kg, got 0.25",
    ),
    "initial above max": (
        f"{HEAD}{TIME}[initial]\nspeed = 101",
        "[initial] speed: expected at most 100.0, got 101.0",
    ),
    "fraction for an integer": (
        f"{HEAD}{TIME}[parameters]\nmax_steps = 1.5",
        "[parameters] max_steps: expected a whole number, got 1.5",
    ),
    "initial inf": (f"{HEAD}{TIME}[initial]\nspeed = inf", "[initial] speed: expected a finite"),
    "input below min": (
        f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 0], [1, -11]]",
        "[inputs.force]: expected at least -10.0, got -11.0",
    ),
    "input is a number": (
        f"{HEAD}{TIME}[inputs]\nforce = 1",
        "[inputs.force]: expected a table, got 1",
    ),
    "input of no kind": (
        f"{HEAD}{TIME}[inputs.force]\n",
        "[inputs.force]: expected exactly one of constant, sines, table, got 0",
    ),
    "input of two kinds": (
        f"{HEAD}{TIME}[inputs.force]\nconstant = 1\ntable = [[0, 1]]",
        "[inputs.force]: expected exactly one of constant, sines, table, got 2",
    ),
    "misspelt kind": (
        f"{HEAD}{TIME}[inputs.force]\nsine = []",
        "[inputs.force]: unknown key 'sine', did you mean 'sines'?",
    ),
    "offset without sines": (
        f"{HEAD}{TIME}[inputs.force]\nconstant = 1\noffset = 2",
        "[inputs.force] offset: goes with sines only",
    ),
    "constant nan": (
        f"{HEAD}{TIME}[inputs.force]\nconstant = nan",
        "[inputs.force] constant: expected a finite number, got nan",
    ),
    "constant is a list": (f"{HEAD}{TIME}[inputs.force]\nconstant = [1]", "number, got [1]"),
    "no sines": (
        f"{HEAD}{TIME}[inputs.force]\nsines = []",
        "[inputs.force] sines: expected a list of tables, got []",
    ),
    "sine is a number": (
        f"{HEAD}{TIME}[inputs.force]\nsines = [1]",
        "[inputs.force] sines[0]: expected a table, got 1",
    ),
    "sine without frequency": (
        f"{HEAD}{TIME}[inputs.force]\nsines = [{{amplitude = 1}}]",
        "[inputs.force] sines[0]: missing key 'frequency'",
    ),
    "misspelt sine": (
        f"{HEAD}{TIME}[inputs.force]\nsines = [{{amplitude = 1, frequensy = 1}}]",
        "[inputs.force] sines[0]: unknown key 'frequensy', did you mean 'frequency'?",
    ),
    "sine inf": (
        f"{HEAD}{TIME}[inputs.force]\nsines = [{{amplitude = inf, frequency = 1}}]",
        "[inputs.force] sines[0] amplitude: expected a finite number",
    ),
    "sines overflow": (
        f"{HEAD}{TIME}[inputs.force]\noffset=1e308\nsines = [{{amplitude = 1e308, frequency = 9}}]",
        "[inputs.force]: expected finite values, got an overflow",
    ),
    "no table": (
        f"{HEAD}{TIME}[inputs.force]\ntable = []",
        "[inputs.force] table: expected a list of [time, value] pairs, got []",
    ),
    "table of triples": (
        f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 1], [1, 2, 3]]",
        "[inputs.force] table[1]: expected [time, value], got [1, 2, 3]",
    ),
    "table with text": (
        f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 'a']]",
        "[inputs.force] table[0]: expected a number, got 'a'",
    ),
    "unordered table": (
        f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 1], [2, 1], [1, 1]]",
        "[inputs.force] table[2]: expected a time after 2.0 s, got [1, 1]",
    ),
    "repeated time": (
        f"{HEAD}{TIME}[inputs.force]\ntable = [[0, 1], [0, 2]]",
        "[inputs.force] table[1]: expected a time after 0.0 s",
    ),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("text", "message"), MISTAKES.values(), ids=MISTAKES.keys())
def test_mistake_is_explained_in_one_line(write, text: str, message: str) -> None:
    path = write(text)
    with pytest.raises(UserError) as caught:
        scenario.load(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: ") and message in said and "\n" not in said


def test_missing_file(write) -> None:
    path = write("").with_name("none.toml")
    with pytest.raises(UserError, match=rf"^{re.escape(str(path))}: no such file$"):
        scenario.load(path)


def test_folder_instead_of_a_file(write) -> None:
    with pytest.raises(UserError, match="cannot be read: Is a directory"):
        scenario.load(write("").parent)


def test_bytes_that_are_not_text(write) -> None:
    path = write("")
    path.write_bytes(b"title = '\xff'")
    with pytest.raises(UserError, match="not UTF-8 text, at byte 9"):
        scenario.load(path)


def test_scenario_outside_a_model(tmp_path: Path) -> None:
    path = tmp_path / "run.toml"
    path.write_text(HEAD + TIME)
    with pytest.raises(UserError, match="expected in models/<model>/scenarios/"):
        scenario.load(path)


# finding scenarios


def test_find_by_name(write, tmp_path: Path) -> None:
    first, second = write("", "swing"), write("", "fall")
    write("").with_name("README.md").write_text("")
    assert scenario.find_all(tmp_path)["swing"] == first
    assert scenario.find(tmp_path, "fall") == second


def test_find_suggests_a_name(write, tmp_path: Path) -> None:
    write("", "swing")
    write("", "fall")
    message = re.escape("no scenario 'swinf', did you mean 'swing'? (known: fall, swing)")
    with pytest.raises(UserError, match=f"^{message}$"):
        scenario.find(tmp_path, "swinf")
    with pytest.raises(UserError, match=re.escape("no scenario 'x' (known: fall, swing)")):
        scenario.find(tmp_path, "x")


def test_find_without_scenarios(tmp_path: Path) -> None:
    assert scenario.find_all(tmp_path) == {}
    with pytest.raises(UserError, match=re.escape("no scenario 'x' (known: none)")):
        scenario.find(tmp_path, "x")


def test_two_models_with_a_scenario_of_the_same_name(write, tmp_path: Path) -> None:
    write("", "run")
    other = tmp_path / "models" / "zoo" / "scenarios" / "run.toml"
    other.parent.mkdir(parents=True)
    other.touch()
    with pytest.raises(UserError, match=r"zoo.*: the name 'run' is taken by .*toy"):
        scenario.find_all(tmp_path)


# the scenarios of the RP manipulator

SHIPPED = {
    name: scenario.load(path)
    for name, path in scenario.find_all(ROOT).items()
    if path.parts[-3] == "rp_manipulator"
}
DECLARED = variables.load(ROOT / "models" / "rp_manipulator")
SHORT = {"free_fall", "constant_effort_single_step"}  # need not last, step and turn as the others


def reference_column(run: Scenario, name: str) -> np.ndarray:
    """Column of the reference file of a scenario, (rows,)."""
    with (run.reference_folder / "RPManipulator_ref.csv").open(newline="") as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def is_driven(run: Scenario) -> bool:
    return any(np.any(values != 0) for values in run.inputs.values())


def gravity(run: Scenario) -> float:
    return run.parameters.get("g", DECLARED["g"]["start"])


def test_expected_scenarios_are_there() -> None:
    assert SHIPPED.keys() >= {
        "free_fall", "coasting", "constant_effort", "constant_effort_single_step", "sine_efforts",
        "hanging_swing", "negative_offset", "late_start", "early_start", "irregular_steps",
        "sixtieth",
    }  # fmt: skip


@pytest.mark.parametrize("run", SHIPPED.values(), ids=SHIPPED.keys())
class TestShipped:
    def test_is_worth_running(self, run: Scenario) -> None:
        assert run.tolerance == 1e-8
        if run.name in SHORT:
            assert run.stop - run.start >= 2
            return
        assert run.stop - run.start >= 5
        assert len(run.times) > 300
        assert np.ptp(reference_column(run, "q1")) > 1

    def test_motion_stays_sensible(self, run: Scenario) -> None:
        assert np.max(np.abs(reference_column(run, "q2"))) < 4
        assert np.max(np.abs(reference_column(run, "dq1"))) < 15

    def test_differs_from_start_values(self, run: Scenario) -> None:
        for name, value in (run.parameters | run.initial).items():
            assert value != DECLARED[name]["start"], name


def test_every_parameter_is_off_its_start_value_somewhere() -> None:
    given = {name for run in SHIPPED.values() for name in run.parameters}
    assert given >= {"m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g"}


def test_initial_states_differ() -> None:
    states = [tuple(sorted(run.initial.items())) for run in SHIPPED.values()]
    assert len(set(states)) == len(states) - 1  # constant_effort and its single step


def test_free_motions_are_free() -> None:
    assert not is_driven(SHIPPED["free_fall"]) and gravity(SHIPPED["free_fall"]) == 9.81
    assert not is_driven(SHIPPED["coasting"]) and gravity(SHIPPED["coasting"]) == 0


def test_constant_effort_in_500_steps_and_in_one() -> None:
    many, one = SHIPPED["constant_effort"], SHIPPED["constant_effort_single_step"]
    assert (len(many.times), len(one.times)) == (501, 2)
    assert (many.parameters, many.initial) == (one.parameters, one.initial)
    assert (many.start, many.stop) == (one.start, one.stop)
    for name in ("tau1", "f2"):
        assert set(many.inputs[name]) == set(one.inputs[name]) != {0.0}
    for name in ("q1", "q2", "dq1", "dq2"):
        ends = [reference_column(run, name)[-1] for run in (many, one)]
        assert ends[0] == pytest.approx(ends[1], rel=1e-15)


def test_sine_efforts_are_sampled_every_millisecond() -> None:
    run = SHIPPED["sine_efforts"]
    assert run.steps == (0.001,)
    assert all(len(set(run.inputs[name])) > 1000 for name in ("tau1", "f2"))


def test_hanging_swing_hangs_and_swings() -> None:
    run = SHIPPED["hanging_swing"]
    angle = reference_column(run, "q1") + np.pi / 2
    assert np.sum(np.diff(np.sign(angle)) != 0) >= 4
    weight = run.parameters["m2"] * gravity(run)
    assert run.inputs["f2"] == pytest.approx(-weight, rel=0.15)


def test_negative_offset_draws_link_2_past_the_joint() -> None:
    run = SHIPPED["negative_offset"]
    assert run.parameters["a"] < 0
    distance = run.parameters["l1"] + reference_column(run, "q2")
    assert 0.3 < np.mean(distance < 0) < 0.7


def test_start_times_and_steps() -> None:
    assert SHIPPED["late_start"].start == 1e6
    assert SHIPPED["early_start"].start == -0.5
    assert SHIPPED["sixtieth"].steps == (1 / 60,)
    lengths = np.diff(SHIPPED["irregular_steps"].times)
    assert lengths.min() == pytest.approx(1e-6, rel=1e-6)
    assert lengths.max() == pytest.approx(0.1)
    assert len({run.steps for run in SHIPPED.values()}) >= 7
