"""Mistakes in files of estimators, plants that have no filter, and warnings: a line each."""

import tomllib
from pathlib import Path

import pytest

from rparm.building import build
from rparm.errors import UserError
from rparm.estimator.equations import write
from tests.support.programs import RPARM, python

PLANT = """name = "Pendulum"
[parameters]
m = { start = 1.0, unit = "kg" }
l = { start = 1.0, unit = "m" }
k = { value = "m * l", unit = "kg.m" }
[inputs]
torque = { unit = "N.m" }
[states]
phi = { start = 1.0, unit = "rad", derivative = "omega" }
omega = { unit = "rad/s", derivative = "(torque - k * 9.81[m/s2] * sin(phi)) / (m * l**2)" }
[where]
half = "phi / 2"
"""
REQUEST = """name = "Observer"
estimator = "plant.toml"
every = "20 ms"
measure = { phi = "0.02 rad" }
noise = { torque = "0.05 N.m" }
start = { phi = "0.2 rad" }
"""
HEAD = 'name = "O"\nestimator = "plant.toml"\nevery = 0.1\n'
BALL = """name = "Ball"
[parameters]
e = { start = 0.8 }
[states]
h = { start = 1, derivative = "v" }
v = { derivative = "-9.81" }
[where]
low = "h < 0"
hit = "low and e > 0"
[events.impact]
when = "hit"
while = "v < 0"
reinit = { v = "-e * v" }
"""
MISTAKES = tomllib.loads(Path(__file__).with_name("mistakes.toml").read_text(encoding="utf-8"))


def refused(folder: Path, plant: str, request: str) -> str:
    (folder / "plant.toml").write_text(plant, encoding="utf-8")
    file = folder / "estimator.toml"
    file.write_text(request, encoding="utf-8")
    with pytest.raises(UserError) as error:
        write(file, folder / "equations.toml")
    place, text = str(error.value).split(": ", 1)
    assert place == str(file)
    return text.replace(str(folder), "FOLDER")


def warned(folder: Path, plant: str, request: str) -> tuple[list[str], str]:
    """Return warnings of an estimator, and the text of its equations."""
    (folder / "plant.toml").write_text(plant, encoding="utf-8")
    file, equations = folder / "estimator.toml", folder / "equations.toml"
    file.write_text(HEAD + request, encoding="utf-8")
    return write(file, equations), equations.read_text(encoding="utf-8")


def refuses(rows: list[list[str]]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize(("old", "new", "message"), rows, ids=[row[2] for row in rows])


@refuses(MISTAKES["request"])
def test_a_mistake_is_named(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert old in REQUEST
    assert refused(tmp_path, PLANT, REQUEST.replace(old, new)) == message


@refuses(MISTAKES["plant"])
def test_a_plant_without_a_filter_is_refused(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    plant = PLANT.replace(old, new) if old else PLANT + new
    unknown = 'unknown = { m = "0.1 kg", l = "1 cm" }\n'
    assert refused(tmp_path, plant, REQUEST + unknown) == message


def test_what_may_not_be_meant_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(
        """name = "Ball"
modes = ["resting"]
[states]
h = { start = 1, derivative = "v" }
v = { derivative = "u - 9.81" }
x = { derivative = "v" }
[discrete]
u = {}
[events.impact]
when = "h < 0"
reinit = { v = "-v" }
[sampled.law]
every = "0.1"
set = { u = "-v" }
""",
        encoding="utf-8",
    )
    file = tmp_path / "estimator.toml"
    text = 'name = "O"\nestimator = "plant.toml"\nevery = 0.1\nmeasure = { h = 0.1 }\n'
    text += "start = { v = 1 }"
    file.write_text(text, encoding="utf-8")
    assert write(file, tmp_path / "equations.toml") == [
        "plant.toml: [events.impact]: an update may pass its limit from the other side, and it "
        'happens again: write while with a direction, as "v < 0"',
        "plant.toml: [discrete]: u: follows from states, the filter takes it as exact",
        "measure: h does not show x near the start: sigma may grow",
        "plant.toml: mode resting: not measured, the filter takes it from its estimate",
    ]


def test_an_event_of_a_named_condition_has_its_saltation_matrix(tmp_path: Path) -> None:
    plant = BALL.replace('while = "v < 0"\n', "")
    request = "measure = { h = 0.1 }\nstart = { v = 1 }\n"
    warnings, text = warned(tmp_path, plant, request)
    assert "[events.after_impact]" in text and "an update may pass its limit" in warnings[0]
    named = plant.replace("hit =", 'falls = "v < 0"\nhit =')
    named = named.replace('when = "hit"', 'when = "hit"\nwhile = "falls"')
    assert warned(tmp_path, named, request)[0] == []


def test_what_only_events_or_branches_may_show_is_a_warning(tmp_path: Path) -> None:
    near = "near the start: only events, samplers or other branches may"
    request = "measure = { h = 0.1 }\nstart = { v = 1 }\nunknown = { e = 0.1 }\n"
    assert warned(tmp_path, BALL, request)[0] == [f"unknown: h does not show e {near}"]
    heater = BALL[: BALL.index("[where]")].replace("-9.81", "e * max(h - 5, 0)")
    request = request.replace("{ h = 0.1 }", "{ h = 0.1, v = 1 }")
    assert warned(tmp_path, heater, request)[0] == [f"unknown: h, v do not show e {near}"]


@pytest.mark.parametrize(
    ("rate", "jumping"),
    [
        ("20 if s > 0.6 else 2", "[states] s: s > 0.6"),
        ("near - s", "[where] near: s > e"),
        ("-sign(s) * e", "[states] s: s > 0, s < 0"),
        ("-floor(s)", "[states] s: floor(s)"),
        ("abs(s - 0.6) - max(s, 0.6) - min(s, e)", ""),
        ("s * abs(s) + s**2 * sign(s)", ""),
        ("s if s < e else e", ""),
        ("1 if time > 2 else 0", ""),
    ],
)
def test_rates_that_jump_without_an_event_are_a_warning(
    rate: str, jumping: str, tmp_path: Path
) -> None:
    plant = f"""name = "Plant"
[parameters]
e = {{ start = 0.5 }}
[states]
s = {{ start = 1, derivative = "{rate}" }}
[where]
near = "1 if s > e else 0"
"""
    found, _ = warned(tmp_path, plant, "measure = { s = 0.1 }\nstart = { s = 1 }\n")
    jump = "rates jump there, the covariance does not see it: write a mode that an event sets"
    assert found == ([f"plant.toml: {jumping}: {jump}"] if jumping else [])


def test_a_noisy_input_that_moves_a_measurement_directly_is_a_warning(tmp_path: Path) -> None:
    plant = """name = "Plant"
[inputs]
u = {}
w = {}
[states]
s = { derivative = "u - s" }
[outputs]
y = { value = "s + u" }
z = { value = "s + w" }
"""
    request = "measure = { y = 0.1, z = 0.1 }\nnoise = { u = 0.1, w = 0.1 }\n"
    what = "moves it directly, its noise there counts as independent of that of the states"
    assert warned(tmp_path, plant, request)[0] == [f"measure: y: u {what}"]


def test_a_long_period_is_a_warning(tmp_path: Path) -> None:
    plant = """name = "Plant"
experiment = { stop = 0.05 }
[parameters]
k = { start = 20 }
[inputs]
u = {}
[states]
s = { start = 1, derivative = "u - k * s**2" }
"""
    request = "measure = { s = 0.1 }\noffset = 1\nnoise = { u = 0.1 }\n"
    assert warned(tmp_path, plant, request)[0] == [
        "every: 0.1 s is above the stop time of plant.toml, 0.05 s",
        "offset: 1 s is above the stop time of plant.toml, 0.05 s",
        "every: 0.1 s is above the fastest time constant of plant.toml at the start, 0.025 s: "
        "it takes noise as white, sigma may be wrong",
    ]
    plant = plant.replace("stop = 0.05", "stop = 5").replace("start = 20", "start = 2")
    assert warned(tmp_path, plant, request)[0] == []


def test_an_array_is_no_output_but_its_elements_are(tmp_path: Path) -> None:
    states = '"T[i]" = { for = "i = 1..2", derivative = "-T[i]" }\nTa = { derivative = "-Ta" }\n'
    request = HEAD + 'measure = { T = 1 }\noffset = "0 s"\n'
    text = refused(tmp_path, f'name = "Rod"\n[states]\n{states}', request)
    assert text == "measure: plant.toml has no such output: T, did you mean 'T[1]'?"


def test_files_that_are_read_are_not_written(tmp_path: Path) -> None:
    whole = 'name = "Pendulum"\ninclude = ["parts.toml"]\n'
    parts = PLANT.replace('name = "Pendulum"\n', "")
    for name, text in {"plant": whole, "parts": parts, "estimator": REQUEST}.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    for name, text in {"plant": whole, "parts": parts, "estimator": REQUEST}.items():
        with pytest.raises(UserError, match=f"{name}.toml: .* is made from this file"):
            write(tmp_path / "estimator.toml", tmp_path / f"{name}.toml")
        assert (tmp_path / f"{name}.toml").read_text(encoding="utf-8") == text


def test_the_command_wants_an_estimator_and_keeps_its_equations(tmp_path: Path) -> None:
    """FMUs of the kept equations have the same bits; the lock file is the estimator's."""
    for name, text in {"plant": PLANT, "estimator": REQUEST}.items():
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    ran = python(*RPARM, "estimator", "plant.toml", folder=tmp_path)
    assert ran.returncode == 2 and "plant.toml: expected one of an estimator" in ran.stderr
    (tmp_path / "none.toml").write_text(REQUEST.replace("estimator =", "plant ="), encoding="utf-8")
    ran = python(*RPARM, "estimator", "none.toml", folder=tmp_path)
    assert ran.returncode == 2 and "none.toml: estimator is missing" in ran.stderr
    arguments = ("--output", "out", "--toml", "kept/filter.toml")
    ran = python(*RPARM, "estimator", "estimator.toml", *arguments, folder=tmp_path)
    assert (ran.returncode, ran.stderr) == (0, ""), ran.stderr
    build(tmp_path / "kept" / "filter.toml", output=tmp_path / "again")
    for name in ("Observer.fmu", "fmi3/Observer.fmu"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()
    assert (tmp_path / "estimator.lock.toml").is_file()
