"""Models from files with equations against those that are written by hand: the arm, the spring."""

from pathlib import Path
from shutil import copy

import numpy as np
import pytest

from tests.equations.examples import FOLDER as EXAMPLES
from tests.equations.examples import METHODS, build, initializing, simulated
from tests.support.instances import Instance, LoadedFmu

FOLDER = Path(__file__).parent
POINTS = 500
STATES = ["q1", "q2", "dq1", "dq2"]
GIVEN = ["m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g", *STATES, "tau1", "f2"]
FOUND = ["ddq1", "ddq2", "ee_x", "ee_y", "ee_vx", "ee_vy", "kinetic_energy", "potential_energy"]
FOUND += ["total_energy", "actuator_power", "D11", "coriolis1", "coriolis2", "gravity1", "gravity2"]


def found(unit: Instance, point: np.ndarray, direction: np.ndarray) -> tuple[list, list]:
    """Values at a point, and their derivatives in a direction."""
    given, outputs = ([unit.loaded.references[x] for x in names] for names in (GIVEN, FOUND))
    unit.fmi.setReal(given, point)
    derivatives = unit.fmi.getDirectionalDerivative(outputs, given[-len(direction) :], direction)
    return unit.fmi.getReal(outputs), derivatives


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    return build(copy(FOLDER / "arm.toml", folder), folder)


@pytest.fixture(scope="module")
def own_spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("spring")
    return build(copy(FOLDER / "oscillator.toml", folder), folder)


def test_values_and_directional_derivatives_have_the_same_bits(
    arm: Path, loaded: LoadedFmu
) -> None:
    chance = np.random.default_rng(5)
    with initializing(arm) as own, Instance(loaded).begin() as by_hand:
        for _ in range(POINTS):
            point = np.concatenate([chance.uniform(0.1, 3, 8), chance.uniform(-3, 3, 6)])
            direction = chance.uniform(-1, 1, 6)
            assert found(own, point, direction) == found(by_hand, point, direction)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_motions_are_the_same(arm: Path, fmu: Path, method: int) -> None:
    start = {"q1": 0.5, "q2": 0.2, "dq1": -1.0, "tau1": 3.0, "f2": 8.0, "solver_method": method}
    runs = [simulated(path, 2.0, 0.01, start, also=[]) for path in (arm, fmu)]
    bound = 0.0 if method == METHODS["erk"] else 1e-11 if method == METHODS["taylor"] else 1e-8
    for name in STATES:
        assert np.max(np.abs(runs[0][name] - runs[1][name])) <= bound


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_the_spring_is_that_by_hand(own_spring: Path, fmu: Path, method: int) -> None:
    """And both are the closed form."""
    hand = fmu.parent / "tests" / "oscillator" / "Oscillator.fmu"
    start = {"omega": 3.0, "gain": 2.0, "x": 0.2, "v": -1.0, "u": 5.0, "solver_method": method}
    runs = [
        simulated(path, 4.0, 0.01, start, relative_tolerance=1e-10) for path in (own_spring, hand)
    ]
    t, middle = runs[0]["time"], 2.0 * 5.0 / 9.0
    exact = middle + (0.2 - middle) * np.cos(3 * t) - np.sin(3 * t) / 3
    for run in runs:
        np.testing.assert_allclose(run["x"], exact, rtol=0, atol=1e-8)
    for name in ("x", "v", "a", "energy"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("path", "most"),
    [
        (FOLDER / "oscillator.toml", 15),
        (EXAMPLES / "bouncing_ball.toml", 20),
        (FOLDER / "arm.toml", 50),
    ],
    ids=lambda value: getattr(value, "stem", ""),
)
def test_a_model_is_short(path: Path, most: int) -> None:
    assert len(path.read_text().splitlines()) <= most
