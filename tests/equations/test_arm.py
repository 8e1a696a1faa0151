"""The arm from a file with equations against the one that is written by hand."""

from pathlib import Path

import numpy as np
import pytest

from tests.equations.examples import METHODS, initializing, quick, simulated
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
    return quick(FOLDER / "arm.toml", tmp_path_factory.mktemp("arm"))


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
