"""The FMUs in the page give the bits of the native ones, forward and back in time."""

import numpy as np
import pytest

from tests.playground.native import INPUTS, OUTPUTS, Native, coupled_trajectory
from tests.playground.opened_page import OpenedPage

STEPS = 2000  # of 1 ms
METHODS = {"cvode_adams": 1, "cvode_bdf": 2, "erk": 3, "taylor": 4}
# a swing with dry friction that holds, and impacts
PLANT = {
    "q1": 0.9, "dq1": -1.0, "damping1": 0.1, "coulomb_friction1": 0.4, "breakaway_friction1": 0.8,
    "stribeck_velocity1": 0.1, "coulomb_friction2": 2.0, "breakaway_friction2": 4.0,
    "stribeck_velocity2": 0.05, "stops2": 2, "lower2": -0.2, "upper2": 0.35, "restitution2": 0.4,
}  # fmt: skip


def efforts(columns: int) -> np.ndarray:
    """Rows (STEPS, columns) of inputs that change all the time, and stay for a while."""
    t = 1e-3 * np.arange(STEPS)
    rows = np.column_stack([(3.0 - i) * np.sin((5.0 + 2.0 * i) * t + i) for i in range(columns)])
    rows[700:1100] = rows[700]
    return rows


@pytest.mark.parametrize("method", METHODS)
def test_plant(opened: OpenedPage, plant: Native, method: str) -> None:
    values = PLANT | {"solver_method": METHODS[method]}
    inputs = efforts(len(INPUTS))
    expected = plant.trajectory(values, inputs)
    found = opened.doubles("trajectory", values, inputs.tolist(), OUTPUTS, INPUTS)
    assert len(expected) == 8 * STEPS * len(OUTPUTS)
    assert found == expected
    numbers = np.frombuffer(found).reshape(STEPS, -1)
    assert np.isfinite(numbers).all()
    assert len(np.unique(numbers[:, 0])) > 0.9 * STEPS  # it moves


@pytest.mark.parametrize("method", METHODS)
def test_serialized_state(opened: OpenedPage, plant: Native, method: str) -> None:
    """All that an instance keeps, the integrator's history too, has the same bytes."""
    values = PLANT | {"solver_method": METHODS[method]}
    inputs = efforts(len(INPUTS))[:300]
    expected = plant.state(values, inputs)
    found = bytes(opened.call("serialized", values, inputs.tolist(), OUTPUTS, INPUTS))
    assert len(expected) > 1000
    assert found == expected


@pytest.mark.parametrize(
    "controller_values",
    [{}, {"mode": 1, "Ki1": 200.0, "Ki2": 200.0, "tau1_max": 12.0}, {"sample_time": 0.007}],
    ids=["computed_torque", "pd", "sampled"],
)
def test_plant_and_controller(
    opened: OpenedPage, plant: Native, controller: Native, controller_values: dict[str, float]
) -> None:
    values = {"plant": PLANT, "controller": controller_values}
    reference, added = (0.6, 0.15), efforts(2)
    expected = coupled_trajectory(plant, controller, values, reference, added)
    assert opened.doubles("coupled", values, reference, added.tolist(), OUTPUTS) == expected


def test_drag(opened: OpenedPage, plant: Native) -> None:
    """What the hand makes of its pull is what the native FMU makes of the same forces."""
    found = np.frombuffer(opened.doubles("dragged", {"plant": PLANT}, OUTPUTS, INPUTS))
    inputs = found[: 1000 * len(INPUTS)].reshape(1000, -1)
    forces = np.hypot(inputs[:, 2], inputs[:, 3])
    assert forces[100] > 10 and (forces[:100] == 0).all() and (forces[700:] == 0).all()
    assert plant.trajectory(PLANT, inputs) == found[1000 * len(INPUTS) :].tobytes()


@pytest.mark.parametrize("way", ["saved", "kept", "method"])
def test_back_in_time(opened: OpenedPage, way: str) -> None:
    """A saved state, a kept one, and one from before a change of the method give the bits back."""
    numbers = opened.doubles("again", {"plant": PLANT, "controller": {}}, OUTPUTS, way)
    half = len(numbers) // 2
    assert half == 8 * 500 * len(OUTPUTS)
    assert numbers[:half] == numbers[half:]
    angles = np.frombuffer(numbers[:half]).reshape(500, -1)[:, 0]
    assert len(np.unique(angles)) > 400  # it moves until friction holds it
