"""Reading of scenarios: every mistake gets its message."""

import re
from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.runs import scenario
from tests.support.toy_model import HEAD, TIME, TOY, timed

# mistakes: the text of the file, what the message says

PARAMETERS, INITIAL, FORCE = (
    f"{HEAD}{TIME}[{section}]\n" for section in ("parameters", "initial", "inputs.force")
)
MISTAKES = [
    ("title = ", "not valid TOML: Invalid value (at end of document)"),
    (TIME, "missing key 'title'"),
    (HEAD, "missing key 'time'"),
    (
        HEAD.replace("tolerance", "tolerence") + TIME,
        "unknown key 'tolerence', did you mean 'tolerance'?",
    ),
    (f"{HEAD}zzz = 1\n{TIME}", "unknown key 'zzz' (known: title, description, "),
    (f"{HEAD}{TIME}[parameter]\n", "unknown key 'parameter', did you mean 'parameters'?"),
    (
        timed(0, 1, 0.1).replace("step", "stepp"),
        "[time]: unknown key 'stepp', did you mean 'step'?",
    ),
    (HEAD + "[time]\nstart = 0\nstop = 1", "[time]: missing key 'step'"),
    (HEAD + "time = 3", "[time]: expected a table, got 3"),
    (f"{HEAD}parameters = 1\n{TIME}", "[parameters]: expected a table"),
    (f"{HEAD}inputs = []\n{TIME}", "[inputs]: expected a table, got []"),
    ('title = 1\ndescription = ""\ntolerance = 1e-6\n' + TIME, "title: expect"),
    (HEAD.replace('"B"', '" "') + TIME, "description: expected a text, got ' '"),
    (HEAD.replace("1e-6", '"1e-6"') + TIME, "tolerance: expected a number, got '1e-6'"),
    (HEAD.replace("1e-6", "true") + TIME, "tolerance: expected a number, got true"),
    (HEAD.replace("1e-6", "0") + TIME, "tolerance: expected a number between 0 and 1, got 0.0"),
    (HEAD.replace("1e-6", "1") + TIME, "between 0 and 1, got 1.0"),
    (HEAD.replace("1e-6", "nan") + TIME, "tolerance: expected a finite number"),
    (
        f"{HEAD}reference_every = 0\n{TIME}",
        "reference_every: expected a whole number from 1 on, got 0",
    ),
    (f"{HEAD}reference_every = 1.0\n{TIME}", "whole number from 1 on"),
    (f"{HEAD}reference_every = true\n{TIME}", "on, got true"),
    (f"{HEAD}panels = 1\n{TIME}", "panels: expected a list of lists of"),
    (f'{HEAD}panels = [["speed", "sped"]]\n{TIME}', "panels[0]: 'sped' cannot be drawn"),
    (f'{HEAD}panels = [["mass"]]\n{TIME}', "'mass' cannot be drawn"),
    (timed("-inf", 1, 0.1), "[time] start: expected a finite number, got -inf"),
    (timed(0, "nan", 0.1), "[time] stop: expected a finite number, got nan"),
    (timed(0, "1" + "0" * 400, 0.1), "[time] stop: expected a finite number"),
    (timed(3, 3, 0.1), "[time] stop: expected a time after start = 3.0, got 3.0"),
    (timed(3, 2, 0.1), "[time] stop: expected a time after start = 3.0"),
    (timed(0, 1, 0), "[time] step: expected more than 0 s, got 0.0"),
    (timed(0, 1, -0.1), "[time] step: expected more than 0 s, got -0.1"),
    (timed(0, 1, "inf"), "[time] step: expected a finite number, got inf"),
    (timed(0, 1, "true"), "[time] step: expected a number, got true"),
    (timed(0, 1, [0.1, 0]), "[time] step: expected more than 0 s, got 0.0"),
    (timed(0, 1, []), "[time] step: expected a list of numbers, got []"),
    (
        timed(0, 1, [0.1, "a"]),
        "expected a number, or a number and its unit (known: s, ms, cs, ks), got 'a'",
    ),
    (timed(1e6, 1e6 + 1, 1e-11), "[time] step: 1e-11 s is lost in rounding between start and stop"),
    (timed(0, 1e6, 1e-11), "[time] step: 1e-11 s is lost in rounding"),
    (timed(1e9, 1000000000.0001, 9e-8), "[time] step: too short, communication points coincide"),
    (timed(0, 1e6, 1e-3), "[time] step: makes 1e+09 steps, expected at most 10000000"),
    (
        f"{PARAMETERS}mas = 1",
        "[parameters]: the model has no variable 'mas', did you mean 'mass'? (known: mass, ",
    ),
    (
        f"{PARAMETERS}force = 1",
        "[parameters]: 'force' is not a parameter of the model (known: mass, gear, max_steps, ",
    ),
    (f"{INITIAL}mass = 1", "[initial]: 'mass' is not a state of the model (known: speed)"),
    (f"{INITIAL}power = 1", "'power' is not a state"),
    (f"{INITIAL}x = 1", "[initial]: the model has no variable 'x'"),
    (
        f"{HEAD}{TIME}[inputs.power]\nconstant = 1",
        "[inputs]: 'power' is not an input of the model (known: force)",
    ),
    (
        f"{HEAD}{TIME}[inputs.forse]\nconstant = 1",
        "[inputs]: the model has no variable 'forse', did you mean 'force'?",
    ),
    (
        f"{PARAMETERS}mass = 'x'",
        "[parameters] mass: expected a number, or a number and its unit (known: kg), got 'x'",
    ),
    (f"{PARAMETERS}mass = true", "mass: expected a number"),
    (f"{PARAMETERS}mass = nan", "mass: expected a finite number"),
    (f"{PARAMETERS}mass = 0.25", "[parameters] mass: expected at least 0.5 kg, got 0.25"),
    (f"{INITIAL}speed = 101", "[initial] speed: expected at most 100.0, got 101.0"),
    (f"{PARAMETERS}max_steps = 1.5", "[parameters] max_steps: expected a whole number, got 1.5"),
    (
        f"{PARAMETERS}max_steps = 4294967297",
        "[parameters] max_steps: expected at most 2147483647, got 4294967297",
    ),
    (f"{PARAMETERS}quiet = 1", "[parameters] quiet: expected true or false, got 1"),
    (f"{INITIAL}speed = inf", "[initial] speed: expected a finite"),
    (f"{FORCE}table = [[0, 0], [1, -11]]", "[inputs.force]: expected at least -10.0, got -11.0"),
    (f"{HEAD}{TIME}[inputs]\nforce = 1", "[inputs.force]: expected a table, got 1"),
    (FORCE, "[inputs.force]: expected exactly one of constant, sines, table, file, got 0"),
    (
        f"{FORCE}constant = 1\ntable = [[0, 1]]",
        "[inputs.force]: expected exactly one of constant, sines, table, file, got 2",
    ),
    (f"{FORCE}sine = []", "[inputs.force]: unknown key 'sine', did you mean 'sines'?"),
    (f"{FORCE}constant = 1\noffset = 2", "[inputs.force] offset: goes with sines only"),
    (f"{FORCE}constant = nan", "[inputs.force] constant: expected a finite number, got nan"),
    (f"{FORCE}constant = [1]", "number, got [1]"),
    (f"{FORCE}sines = []", "[inputs.force] sines: expected a list of tables, got []"),
    (f"{FORCE}sines = [1]", "[inputs.force] sines[0]: expected a table, got 1"),
    (f"{FORCE}sines = [{{amplitude = 1}}]", "[inputs.force] sines[0]: missing key 'frequency'"),
    (
        f"{FORCE}sines = [{{amplitude = 1, frequensy = 1}}]",
        "[inputs.force] sines[0]: unknown key 'frequensy', did you mean 'frequency'?",
    ),
    (
        f"{FORCE}sines = [{{amplitude = inf, frequency = 1}}]",
        "[inputs.force] sines[0] amplitude: expected a finite number",
    ),
    (
        f"{FORCE}offset=1e308\nsines = [{{amplitude = 1e308, frequency = 9}}]",
        "[inputs.force]: expected finite values, got an overflow",
    ),
    (f"{FORCE}table = []", "[inputs.force] table: expected a list of [time, value] pairs, got []"),
    (
        f"{FORCE}table = [[0, 1], [1, 2, 3]]",
        "[inputs.force] table[1]: expected [time, value], got [1, 2, 3]",
    ),
    (f"{FORCE}table = [[0, 'a']]", "[inputs.force] table[0]: expected a number, got 'a'"),
    (
        f"{FORCE}table = [[0, 1], [2, 1], [1, 1]]",
        "[inputs.force] table[2]: expected a time after 2.0 s, got [1, 1]",
    ),
    (f"{FORCE}table = [[0, 1], [0, 2]]", "[inputs.force] table[1]: expected a time after 0.0 s"),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("text", "message"), MISTAKES)
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


def test_folder_instead_of_a_file(write) -> None:
    with pytest.raises(UserError, match="cannot be read: Is a directory"):
        scenario.load(write("").parent, TOY)


def test_bytes_that_are_not_text(write) -> None:
    path = write("")
    path.write_bytes(b"title = '\xff'")
    with pytest.raises(UserError, match="not UTF-8 text, at byte 9"):
        scenario.load(path, TOY)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("", "missing key 'model', the name of what the scenario is of .*, or 'fmu', the file"),
        ('fmu = "Toy.fmu"\nmodel = "toy"', "has both 'model' and 'fmu': expected one of them"),
        ("fmu = 3", "fmu: expected a text, got 3"),
        ('fmu = "Toi.fmu"', "fmu: 'Toi.fmu': no such file, did you mean 'Toy.fmu'"),
        ('fmu = "folder"', "fmu: 'folder': "),
        ('fmu = "a\\u0000b"', "fmu: 'a.x00b': "),
    ],
)
def test_what_a_scenario_elsewhere_is_of(tmp_path: Path, keys: str, message: str) -> None:
    path = tmp_path / "run.toml"
    path.write_text(f"{keys}\n{HEAD}{TIME}")
    (tmp_path / "Toy.fmu").touch()
    (tmp_path / "folder").mkdir()
    with pytest.raises(UserError, match=f"^{re.escape(str(path))}: {message}") as error:
        scenario.load(path, TOY)
    assert "\n" not in str(error.value)
