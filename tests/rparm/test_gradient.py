"""Gradients of runs for programs: closed forms, what stays open, mistakes."""

import os
from pathlib import Path

import numpy as np
import pytest

import rparm
from rparm import gradients
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu

DECAY = """name = "Decay"
[parameters]
k = { start = 2.0 }
[inputs]
u = {}
[states]
x = { start = 1.0, derivative = "u - k * x" }
[outputs]
square = { value = "x**2" }
"""
GIVEN = {"of": ["x", "square"], "by": ["k", "start(x)"], "stop_time": 1.0, "step": 0.25}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "decay.toml"
    path.write_text(DECAY)
    return path


def test_gradients_are_those_of_the_closed_form(file: Path) -> None:
    """Under a constant input u the state goes to u / k."""
    run = rparm.gradient(file, **GIVEN, start_values={"k": 3.0}, inputs={"u": 1.5}, tolerance=1e-10)
    t, k, u = run.time, 3.0, 1.5
    decay = np.exp(-k * t)
    x = u / k + (1 - u / k) * decay
    by = np.column_stack([u / k**2 * (decay - 1) - (1 - u / k) * t * decay, decay])
    assert run.are_exact is True and run.time == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert run.values == pytest.approx(np.column_stack([x, x**2]), abs=1e-9)
    assert run.gradients[:, 0] == pytest.approx(by, abs=1e-9)
    assert run.gradients[:, 1] == pytest.approx(2 * x[:, None] * by, abs=1e-9)


def test_an_fmu_stays_open_until_its_file_changes(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = []

    def counted(*given: object, **named: object) -> Fmu:
        opened.append(given)
        return Fmu(*given, **named)

    monkeypatch.setattr(gradients, "Fmu", counted)
    first = rparm.gradient(file, **GIVEN)
    again = rparm.gradient(file, **GIVEN)
    assert len(opened) == 1 and np.array_equal(first.gradients, again.gradients)
    file.write_text(DECAY.replace("k * x", "2 * k * x"))
    os.utime(file, (1, 1))
    assert rparm.gradient(file, **GIVEN).values[-1, 0] == pytest.approx(np.exp(-4), abs=1e-7)
    assert len(opened) == 2


def test_models_of_the_project_and_fmus_have_gradients(file: Path) -> None:
    made = rparm.build(file, output=file.parent, gradients=["k"])
    ends = [rparm.gradient(fmu, **GIVEN | {"by": ["k"]}).gradients[-1, :, 0] for fmu in made]
    assert ends[0] == pytest.approx([-np.exp(-2), -2 * np.exp(-4)], abs=1e-7)
    assert np.array_equal(*ends)
    arm = rparm.gradient("RPManipulator", of=["q1"], by=["m2"], stop_time=0.1)
    assert arm.gradients.shape == (len(arm.time), 1, 1) and arm.are_exact


@pytest.mark.parametrize(
    ("model", "given", "message"),
    [
        ("decay.toml", {"of": ["y"]}, "no Real output 'y'"),
        ("decay.toml", {"by": ["start(k)"]}, "expected a state"),
        ("decay.toml", {"by": "k"}, "by: expected a list of names, got 'k'"),
        ("decay.toml", {"of": []}, "of: expected a list of names"),
        ("decay.toml", {"tolerance": 2.0}, "tolerance: expected"),
        ("RPManipulatr", {}, "did you mean"),
        ("none.toml", {}, "none.toml"),
        ("Decay.fmu", {}, "'x_by_k', which gradients need"),
    ],
)
def test_a_mistake_is_one_line(model: str, given: dict, message: str, file: Path) -> None:
    if model == "Decay.fmu":
        rparm.build(file, output=file.parent)
    path = file.parent / model if "." in model else model
    with pytest.raises(UserError, match=message.replace("(", r"\(")) as raised:
        rparm.gradient(path, **GIVEN | given)
    assert "\n" not in str(raised.value)
