"""The page on gradients: its commands, program and numbers, against closed forms."""

import math
import re
import shlex
from pathlib import Path

import pytest
from scipy.optimize import brentq, minimize_scalar

import rparm
from rparm.fmi.fmu_file import read_model
from tests.support.paths import ROOT
from tests.support.programs import RPARM, printed, python

PAGE = (ROOT / "docs" / "gradients.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
MODELS = {re.match(r'name = "(\w+)"', text)[1]: text for kind, text in BLOCKS if kind == "toml"}
G, E, WALL, TARGET = 9.81, 0.8, 3.0, (1.0, 0.5)


def height_by_e(t: float, e: float = E) -> float:
    """The derivative of the height of a ball that falls from 1 m, by its restitution."""
    first = math.sqrt(2 / G)
    if t < first:
        return 0.0
    if t < first * (1 + 2 * e):
        return G * first * (t - first)
    assert t < first * (1 + 2 * e + 2 * e**2)
    since = t - first * (1 + 2 * e)
    return 2 * e * G * first * since - 2 * first * (e**2 * G * first - G * since)


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        ("build ball.toml", "h_by_e v_by_e h_by_start_h v_by_start_h"),
        ("build ball.toml --gradients 'g,start(v)'", "h_by_g v_by_g h_by_start_v v_by_start_v"),
    ],
)
def test_its_models_are_built_as_typed(typed: str, found: str, tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(MODELS["Ball"], encoding="utf-8")
    assert f"./run.sh {typed}" in PAGE
    ran = python(*RPARM, *shlex.split(typed), folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert read_model(tmp_path / "Ball.fmu").real_outputs == ["h", "v", *found.split()]


def test_its_program_prints_what_it_says(tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(MODELS["Ball"], encoding="utf-8")
    (program,) = [text for kind, text in BLOCKS if kind == "python"]
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    ran = python("program.py", folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout in [text for kind, text in BLOCKS if kind == ""]


def test_the_gradient_of_the_ball_is_that_of_the_closed_form(tmp_path: Path) -> None:
    (tmp_path / "ball.toml").write_text(MODELS["Ball"], encoding="utf-8")
    run = rparm.gradient(tmp_path / "ball.toml", of=["h"], by=["e"], stop_time=1.7, step=0.01)
    wanted = [height_by_e(t) for t in run.time]
    assert run.are_exact and run.gradients[:, 0, 0] == pytest.approx(wanted, abs=1e-6)


def _end(speed: float, upward: float) -> tuple[float, float]:
    """Height at the target, and the time; the wall and two impacts on the floor lie before it."""
    time = WALL / speed + (WALL - TARGET[0]) / (E * speed)
    down = math.sqrt(upward**2 + 2 * G)
    first = (upward + down) / G
    since = time - first - 2 * E * down / G
    return E**2 * down * since - G * since**2 / 2, time


def test_the_throw_is_the_slowest_one(tmp_path: Path) -> None:
    """Each forward speed has one upward speed that hits; the best of them is searched for."""

    def upward(speed: float) -> float:
        return brentq(lambda v: _end(speed, v)[0] - TARGET[1], 1.9, 2.6)

    found = minimize_scalar(
        lambda speed: speed**2 + upward(speed) ** 2, bounds=(2.89, 2.94), method="bounded"
    )
    ball, line = printed("gradients.py", tmp_path)
    *throw, runs = map(float, re.findall(r"\d+\.?\d*", line))
    assert float(ball.split()[1]) == pytest.approx(height_by_e_after_three(2.0), abs=1e-6)
    best = found.x, upward(found.x), _end(found.x, upward(found.x))[1]
    assert throw == pytest.approx(best, abs=1e-4)
    assert throw[0] ** 2 + throw[1] ** 2 == pytest.approx(found.fun, abs=1e-6)
    assert runs < 40 and all(f"{value:.3f}" in PAGE for value in throw)


def height_by_e_after_three(t: float) -> float:
    """The same between the third impact and the next."""
    first = math.sqrt(2 / G)
    since = t - first * (1 + 2 * E + 2 * E**2)
    speed, later = E**3 * G * first, first * (2 + 4 * E)
    return 3 * E**2 * G * first * since - later * (speed - G * since)
