"""RPPlant's events in fmi-sim: in co-simulation however it handles them, and by Euler's method.

It sets no enumerations, so that stops cannot be switched on: both joints slide until friction stops
them, one after the other.
"""

from pathlib import Path

import numpy as np
import pytest

from tests.importers.test_importers import run
from tests.rp_plant.fmu.plant_runs import FRICTION

OUTPUTS = ["time", "q1", "q2", "dq1", "dq2", "mode1", "mode2"]
EVENT_MODE, EARLY_RETURN = "--event-mode-used", "--early-return-allowed"
STOP = 1.0  # s


@pytest.fixture(scope="module")
def paths(fmu: Path) -> dict[str, Path]:
    """RPPlant by version of FMI."""
    return {"fmi2": fmu.with_name("RPPlant.fmu"), "fmi3": fmu.parent / "fmi3" / "RPPlant.fmu"}


def simulate(fmu: Path, step: float, folder: Path, interface: str, *options: str) -> np.ndarray:
    """Rows of OUTPUTS; at events there may be further ones."""
    steps = round(STOP / step)
    plan = {
        "start": 0.0,
        "step": step,
        "steps": steps,
        "parameters": FRICTION | {"g": 0.0},
        "initial": {"dq1": 1.0, "dq2": -0.8},
        "inputs": {"tau1": [0.0] * (steps + 1), "f2": [0.0] * (steps + 1)},
        "outputs": OUTPUTS,
    }
    return run("fmi-sim", fmu, plan, folder, interface, *options)


def test_co_simulation_has_the_same_bits(paths: dict[str, Path], tmp_path: Path) -> None:
    step = 0.01
    expected = simulate(paths["fmi3"], step, tmp_path, "co-simulation")
    assert not expected[-1, 3:].any()  # both joints are held
    # its times of FMI 2.0 are rounded otherwise
    in_fmi2 = simulate(paths["fmi2"], step, tmp_path, "co-simulation")
    np.testing.assert_allclose(in_fmi2, expected, rtol=0, atol=1e-14)
    rows = []
    for options in [EVENT_MODE], [EARLY_RETURN], [EVENT_MODE, EARLY_RETURN]:
        found = simulate(paths["fmi3"], step, tmp_path, "co-simulation", *options)
        rows.append(len(found))
        k = np.rint(found[:, 0] / step)
        on_grid = found[np.abs(found[:, 0] - k * step) < 1e-12]
        first = np.unique(np.rint(on_grid[:, 0] / step), return_index=True)[1]
        np.testing.assert_array_equal(on_grid[first], expected)
    assert len(expected) < rows[1] < rows[2]  # it sees the events


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_the_error_of_eulers_method_falls_with_its_step(
    paths: dict[str, Path], version: str, tmp_path: Path
) -> None:
    expected = simulate(paths["fmi2"], 0.01, tmp_path, "co-simulation")[-1]
    errors = []
    for step in (1e-2, 1e-3):
        found = simulate(paths[version], step, tmp_path, "model-exchange")[-1]
        np.testing.assert_array_equal(found[3:], expected[3:])  # at rest
        errors.append(np.abs(found[1:3] - expected[1:3]).max())
    assert errors[1] < errors[0] / 5 < 5e-3
