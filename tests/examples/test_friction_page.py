"""The page on friction and stops: its models, commands and numbers."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.paths import ROOT
from tests.support.programs import RPARM, printed, python

PAGE = (ROOT / "docs" / "friction-and-stops.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
MODELS = {re.match(r'name = "(\w+)"', text)[1]: text for text in BLOCKS if text.startswith("name")}
INPUTS = {re.match(r"\[(.*)\]", text)[1]: text for text in BLOCKS if text.startswith("[inputs.")}


@pytest.fixture
def typed(tmp_path: Path) -> Callable:
    """Types commands of the page in an empty folder; returns what is printed."""

    def command(*arguments: str) -> str:
        ran = python(*RPARM, *arguments, folder=tmp_path)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    return command


def recorded(typed: Callable, folder: Path, model: str, name: str, of: str = "") -> np.ndarray:
    """What a new scenario of a model of the page records, with an input of the page."""
    (folder / f"{model.lower()}.toml").write_text(MODELS[model], encoding="utf-8")
    typed("build", f"{model.lower()}.toml")
    assert f"./run.sh new {name} --model {model}.fmu" in PAGE
    typed("new", name, "--model", f"{model}.fmu")
    scenario = folder / f"{name}.toml"
    text = scenario.read_text(encoding="utf-8")
    before, found, after = text.partition(f"[{of}]\n") if of else (text, "", "")
    assert not of or (found and after.count("\n") == 1)  # its last two lines
    scenario.write_text(before + INPUTS.get(of, ""), encoding="utf-8")
    typed("run", scenario.name, "--output", "report")
    return np.genfromtxt(
        folder / "report" / "files" / f"{name}.csv", delimiter=",", names=True, deletechars=""
    )


def test_the_block_sticks_up_to_its_limit(typed: Callable, tmp_path: Path) -> None:
    run = recorded(typed, tmp_path, "Belt", "squeak")
    sticks = run["v"] == 0.2
    force = run["friction.belt.force"][sticks]
    assert force == pytest.approx(-20 * run["x"][sticks], abs=1e-9)
    assert 3.9 < -force.min() <= 4 and np.count_nonzero(np.diff(sticks.astype(int)) == 1) == 5
    assert run["x"].min() == pytest.approx(-0.03, abs=0.005)


def test_the_load_follows_through_the_backlash(typed: Callable, tmp_path: Path) -> None:
    example = ROOT / "examples" / "models" / "gearbox.toml"
    assert MODELS["Gearbox"] == example.read_text(encoding="utf-8")
    run = recorded(typed, tmp_path, "Gearbox", "shift", "inputs.torque")
    play = np.degrees(run["drive"] - run["load"])
    assert [play.min(), play.max()] == pytest.approx([-1.5, 1.5], abs=1e-9)
    inside = (np.abs(play) < 1.4) & (run["time"] > 0.5)
    stands = run["load_speed"] == 0
    assert inside.any() and stands[inside].mean() > 0.5


def test_the_valve_opens_in_jerks(typed: Callable, tmp_path: Path) -> None:
    run = recorded(typed, tmp_path, "Valve", "ramp", "inputs.p")
    first, last = np.flatnonzero(run["x"] > 0)[[0, -1]]
    assert 0.26 <= run["p"][first] / 1e5 < 0.263 and 0.14 <= run["p"][last] / 1e5 < 0.16
    assert run["x"].max() == pytest.approx(0.03, abs=1e-12)
    forces = [run[f"{name}.force"][0] for name in ("friction.packing", "stops.seats")]
    assert forces == pytest.approx([-120, 280], abs=1e-9)
    opening = run["x"][run["time"] < 13]
    rests = np.unique(opening[1:][np.diff(opening) == 0])
    assert len(rests) > 15 and np.diff(rests) == pytest.approx(1.3e-3, abs=4e-5)
    asked = "linearize Valve.fmu --at x=10mm --trim p"
    answer = "p         40000  34000  46000  Pa"
    assert f"./run.sh {asked}" in PAGE and answer in PAGE and answer in typed(*asked.split())


def test_its_picture_is_drawn(tmp_path: Path) -> None:
    (line,) = printed("friction_and_stops.py", tmp_path)
    slips, play, opens = map(float, re.findall(r"\d\.\d+", line))
    assert 1.0 < slips < 1.1 and play == 1.5 and 0.26 <= opens < 0.263
