"""Mistakes with friction and stops: one line each, at the build or, with values, at the start."""

import re
from pathlib import Path

import pytest

from tests.contacts.test_closed_forms import fmus
from tests.equations.compiled import ModelFileError, read_text
from tests.equations.examples import made
from tests.support.instances import Instance, LoadedFmu

TEXT = """name = "Block"
[parameters]
m = { start = 2 }
[inputs]
drive = {}
[states]
x = { derivative = "v" }
v = { derivative = "(drive - F + P) / m" }
w = { derivative = "-w + F" }
[friction.slide]
force = "F"
velocity = "v"
coulomb = "1"
[stops.slide]
force = "P"
position = "x"
velocity = "v"
lower = "-0.2"
upper = "0.2"
restitution = "0.5"
"""
MORE = '[friction.{}]\nforce = "G"\nvelocity = "{}"\ncoulomb = "1"\n[stops.slide]'
ROWS = [
    ('velocity = "v"', 'velocity = "v**2"', "must be linear in the states: the factor of v"),
    ('velocity = "v"', 'velocity = "v - drive"', "reads drive: expected states, parameters and"),
    ('velocity = "v"', 'velocity = "2"', "velocity: follows from no state"),
    ('coulomb = "1"', 'coulomb = "0.3 * P"', "coulomb: reads the unknown force P: then no motion"),
    ('coulomb = "1"', """coulomb = "1 if friction.slide.mode == 'stuck' else 2\"""",
     "coulomb: reads friction.slide.mode, which is decided together with it"),
    ('velocity = "v"', 'velocity = "v - 0.5"', "velocity: differs from that of friction.slide"),
    ('coulomb = "1"', 'coulomb = "1"\nstribeck = "2"', "stribeck: expected breakaway, too"),
    ('coulomb = "1"\n', "", "line 10: [friction.slide]: coulomb is missing"),
    ('force = "F"', 'force = "F + 1"', "force: expected a name that the equations use"),
    ('force = "F"', 'force = "x"', "force: this name is in [states] already"),
    ('force = "F"', "force = 3", "[friction.slide]: force: expected an expression in quotes"),
    ('position = "x"', 'position = "2 * x"', "velocity: is not the rate of position"),
    ('position = "x"', 'position = "v"', "position: has no velocity: a force acts on its rate"),
    ('lower = "-0.2"\nupper = "0.2"\n', "", "expected lower or upper: where it stops"),
    ('lower = "-0.2"', 'lower = "drive"', "lower: column 1: 'drive' is no parameter"),
    ("[stops.slide]", "[stop.slide]", "unknown section 'stop'"),
    ("drive - F + P", "drive - F**2 + P", "the derivative of v is not linear in F"),
    ("drive - F + P", "drive - F", "force: P does not act on the velocity"),
    ("coulomb", "coulmb", "unknown key 'coulmb', expected one of force, velocity, coulomb"),
    ('coulomb = "1"', 'coulomb = "1"\nwhile = "m"', "while: column 1: expected a condition"),
    ("[stops.slide]", MORE.format("more", "v"), "velocity: is that of friction.slide"),
    (
        "[stops.slide]", '[friction.a]\nforce = "A"\nvelocity = "w"\ncoulomb = "1"\n'
        + MORE.format("b", "v - 2 * w"), "follows from those of friction.slide and friction.a",
    ),
    ("[friction.slide]", "[friction.slide]\nfor = 'i = 1..2'", "for: expected indexes in the name"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "message"), ROWS, ids=[message for *_, message in ROWS])
def test_a_mistake_in_the_file(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TEXT
    text = TEXT.replace(old, new, 1)
    if "w - 2" in new or "2 * w" in new:  # forces that act on both
        text = text.replace("-w + F", "-w + A - 2 * G").replace("- F + P", "- F + P + G")
    with pytest.raises(ModelFileError) as refused:
        read_text(tmp_path, text)
    assert message in str(refused.value) and "\n" not in str(refused.value)


def test_more_than_eight_velocities_are_not_held_together(tmp_path: Path) -> None:
    lines = ['name = "Chain"', "[sizes]", "n = 9", '[states."v[i]"]', 'for = "i = 1..n"']
    lines += ['derivative = "F[i] - (F[i+1] if i < n else 0)"', '[friction."f[i]"]']
    lines += ['for = "i = 1..n"', 'force = "F[i]"', 'coulomb = "1"']
    lines += ['velocity = "-v[1] if i == 1 else v[i-1] - v[i]"']
    with pytest.raises(ModelFileError, match="more than 8 velocities are held together"):
        read_text(tmp_path, "\n".join(lines))


PARAMETERS = """name = "Sizes"
[parameters]
c = { start = 1 }
b = { start = 1 }
vs = { start = 0.1 }
low = { start = -0.2 }
high = { start = 0.2 }
e = { start = 0.5 }
sign = { start = 1 }
[states]
x = { derivative = "v" }
v = { derivative = "5 - sign * F + P" }
[friction.slide]
force = "F"
velocity = "v"
coulomb = "c"
breakaway = "b"
stribeck = "vs"
[stops.slide]
force = "P"
position = "x"
velocity = "v"
lower = "low"
upper = "high"
restitution = "e"
"""
AT_START = [
    ({"c": -1}, "friction.slide: coulomb = -1 is refused: it must be 0 or more"),
    ({"b": 0.5}, "breakaway = 0.5 is refused: it must not be below coulomb = 1"),
    ({"b": 2, "vs": 0}, "stribeck = 0 is refused: it must be above 0 where breakaway is above"),
    ({"e": 1.5}, "stops.slide: restitution = 1.5 is refused: it must be from 0 to 1"),
    ({"low": 0.3}, "stops.slide: lower = 0.3 is refused: it must be below upper = 0.2"),
    ({"x": 0.5}, "position = 0.5 is refused: a start must not be above upper = 0.2"),
    ({"sign": -1}, "der(velocity) by force = 1 is refused: friction acts against its velocity"),
]


@pytest.mark.parametrize(("start", "message"), AT_START, ids=[m for _, m in AT_START])
def test_a_wrong_value_at_the_start(tmp_path: Path, start: dict, message: str) -> None:
    with Instance(LoadedFmu(made(PARAMETERS), tmp_path), logging_on=True) as instance:
        instance.begin(**start)
        with pytest.raises(Exception, match="fmi2ExitInitializationMode"):
            instance.fmi.exitInitializationMode()
        texts = [text for *_, text in instance.messages]
    assert any(re.fullmatch(f"at t = 0: .*{re.escape(message)}.*", text) for text in texts), texts


def test_a_wrong_value_in_a_run(tmp_path: Path) -> None:
    """A limit that is set while it runs is judged at the next step."""
    with Instance(LoadedFmu(fmus()["Slider"], tmp_path), logging_on=True) as instance:
        instance.initialize(u=0.5)
        instance.step(0.0, 0.1)
        instance.set(c=-1)
        with pytest.raises(Exception, match="fmi2DoStep"):
            instance.step(0.1, 0.1)
        assert "coulomb = -1 is refused" in instance.messages[-1].text
