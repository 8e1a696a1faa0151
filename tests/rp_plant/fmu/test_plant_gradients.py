"""Gradients of RPPlant through friction and impacts, against differences of runs of its C.

The gradients are those of the file with elements; the C beside it decides events by hand.
"""

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

from tests.equations.examples import METHODS, quick
from tests.support.paths import ROOT

RIGID = 2
START = {
    **{"q1": 0.3, "q2": 0.1, "dq1": 1.0, "dq2": 0.5},
    **{"coulomb_friction1": 1.0, "coulomb_friction2": 0.8},
    **{"stops1": RIGID, "lower1": -1.2, "upper1": 1.0, "restitution1": 0.5},
    **{"stops2": RIGID, "lower2": -0.2, "upper2": 0.2, "restitution2": 0.5},
}
BY = {"m2": 1.0, "coulomb_friction1": 1.0, "restitution1": 0.5}
OF = ("q1", "q2", "dq1", "dq2", "total_energy")
STOP, STEP = 2.0, 0.02


def _run(fmu: Path, given: dict[str, float], outputs: list[str], tolerance: float) -> np.ndarray:
    names = {"start_values": START | given, "output": outputs, "record_events": False}
    return simulate_fmu(
        fmu, stop_time=STOP, output_interval=STEP, relative_tolerance=tolerance, **names
    )


@pytest.fixture(scope="module")
def gradients(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = ROOT / "models/rp_plant/with_elements/rp_plant.toml"
    return quick(file, tmp_path_factory.mktemp("gradients"), by=[*BY])


@pytest.fixture(scope="module")
def differences() -> dict[str, np.ndarray]:
    """Derivatives by differences of fourth order; each jumps where an impact comes."""
    found, best = {}, {"solver_method": METHODS["taylor"]}
    for name, value in BY.items():
        h = 1e-5 * value
        runs = [
            _run(ROOT / "build/RPPlant.fmu", best | {name: value + k * h}, [*OF], 1e-12)
            for k in (-2, -1, 1, 2)
        ]
        for of in OF:
            a, b, c, d = (run[of] for run in runs)
            found[f"{of}_by_{name}"] = (8 * (c - b) - (d - a)) / (12 * h)
    return found


@pytest.mark.parametrize("method", ["cvode_adams", "taylor"])
def test_gradients_are_those_of_the_c(
    gradients: Path, differences: dict[str, np.ndarray], method: str
) -> None:
    outputs = [*differences, "gradients_are_exact", "stops.joint1.impulses"]
    run = _run(gradients, {"solver_method": METHODS[method]}, outputs, 1e-10)
    assert run["gradients_are_exact"].all()
    assert abs(run["stops.joint1.impulses"][-1]) > 1.0  # so there were impacts
    for name, wanted in differences.items():
        # runs of 1e-12 whose difference is divided by h
        np.testing.assert_allclose(run[name], wanted, rtol=0, atol=1e-7 * np.abs(wanted).max())
