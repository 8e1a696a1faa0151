"""Directional, adjoint and output derivatives are those of the present modes: beside differences of
values with the modes kept."""

import numpy as np
import pytest
from fmpy import read_model_description

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_model_exchange import STATES, PlantModel, model, unknowns
from tests.rp_plant.fmu.plant_runs import COMPLIANT, RIGID, modes, started

FRICTION = {
    "coulomb_friction1": 1.0,
    "breakaway_friction1": 1.5,
    "stribeck_velocity1": 0.6,
    "coulomb_friction2": 2.0,
    "breakaway_friction2": 2.5,
    "stribeck_velocity2": 0.4,
    "damping1": 0.3,
    "armature2": 0.2,
}
STOP = {"stops2": RIGID, "lower2": -0.2, "upper2": 0.4, "f2": -9.0}
BUFFER = {"stops2": COMPLIANT, "upper2": 0.04, "stop_stiffness2": 400.0, "stop_damping2": 0.5}
PAYLOAD = {
    "payload_mass": 0.7,
    "payload_inertia": 0.02,
    "payload_x": 0.04,
    "payload_z": 0.1,
    "payload_attached": True,
}
MOVING = {"dq1": 1.1, "dq2": -0.7}
INPUTS = {"tau1": 0.4, "f2": 6.1, "ee_fx": 0.5, "ee_fy": -0.8, "ee_mz": 0.2}
POINT = {"q1": 0.7, "q2": 0.1} | INPUTS

# what is set, the modes that follow, and the side on which the values of q2 keep them
CASES = {
    "free": (POINT | MOVING, (2, 2), 0),
    "sliding": (POINT | MOVING | FRICTION, (1, -1), 0),
    "sliding with a payload": (POINT | MOVING | FRICTION | PAYLOAD, (1, -1), 0),
    "joint 1 held": (POINT | FRICTION | {"dq2": -0.7, "tau1": 9.0}, (0, -1), 0),
    "joint 2 held": (POINT | FRICTION | {"dq1": 1.1}, (1, 0), 0),
    "both held": (POINT | FRICTION | {"tau1": 9.0}, (0, 0), 0),
    "joint 2 at its stop": (POINT | FRICTION | STOP | {"dq1": -0.8, "q2": -0.2}, (-1, 0), -1),
    "pushed by a compliant stop": (POINT | MOVING | BUFFER, (2, 2), 0),
    "let go by a compliant stop": (POINT | MOVING | BUFFER | {"dq2": -2.5}, (2, 2), 0),
    "held in a compliant stop": (
        POINT | BUFFER | {"dq1": 1.1, "coulomb_friction2": 90.0},
        (2, 0),
        0,
    ),
    "the payload at the stop": (POINT | STOP | PAYLOAD | {"dq1": -0.8, "q2": -0.2}, (2, 0), -1),
}
KNOWNS = (*STATES, *INPUTS)
STEP = 1e-4  # of a known, in its unit


def differences(plant: PlantModel, names: list[str], side: int) -> np.ndarray:
    """Derivatives of unknowns by KNOWNS (names, knowns), of fourth order; q2 to one side."""
    inputs = {name: plant.get(name) for name in INPUTS}
    x = np.array([plant.get(name) for name in STATES])
    columns = []
    for i, known in enumerate(KNOWNS):

        def at(steps: int, i: int = i, known: str = known) -> np.ndarray:
            if i < len(STATES):
                moved = x.copy()
                moved[i] += steps * STEP
                plant.set_states(moved)
            else:
                plant.set(known, inputs[known] + steps * STEP)
            return np.array([plant.get(name) for name in names])

        if known == "q2" and side != 0:
            weights = {0: -25 / 12, 1: 4, 2: -3, 3: 4 / 3, 4: -1 / 4}
            column = sum(w * at(side * k) for k, w in weights.items()) * side
        else:
            column = (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / 12
        columns.append(column / STEP)
        at(0)
    return np.array(columns).T


def jacobian(plant: PlantModel, names: list[str]) -> np.ndarray:
    """The same from the FMU."""
    rows = [plant.variables[name].valueReference for name in names]
    columns = []
    for known in KNOWNS:
        reference = plant.variables[known].valueReference
        columns.append(plant.fmu.getDirectionalDerivative(rows, [reference], [1.0]))
    return np.array(columns).T


@pytest.mark.parametrize("case", CASES)
def test_directional_and_adjoint_derivatives(plant: Fmu, case: str) -> None:
    values, expected_modes, side = CASES[case]
    names = unknowns(read_model_description(plant.path))
    with model(plant.path, **values) as instance:
        assert (instance.get("mode1"), instance.get("mode2")) == expected_modes
        expected = differences(instance, names, side)
        J = jacobian(instance, names)
        scale = 1.0 + np.abs(expected).max(axis=1, keepdims=True)
        np.testing.assert_allclose(J / scale, expected / scale, rtol=0, atol=1e-7)
        held = [joint for joint in (0, 1) if expected_modes[joint] == 0]
        for joint in held:
            assert not J[names.index(f"ddq{joint + 1}")].any()
        if instance.is_fmi3:
            references = [
                [instance.variables[n].valueReference for n in g] for g in (names, KNOWNS)
            ]
            rows = [
                instance.fmu.getAdjointDerivative([reference], references[1], [1.0], len(KNOWNS))
                for reference in references[0]
            ]
            np.testing.assert_array_equal(np.array(rows), J)


@pytest.mark.parametrize("case", CASES)
def test_output_derivatives(plant: Fmu, case: str) -> None:
    """First and second derivatives by time, while the modes stay."""
    values, expected_modes, _ = CASES[case]
    variables = plant.model.variables
    names = unknowns(read_model_description(plant.path))
    names = [name for name in names if variables[name].causality == "output"]
    h = 5e-4
    samples = []
    with started(plant, tolerance=1e-12, **values) as instance:
        reals = instance.reals(names)
        derivatives = [instance.output_derivatives(names, order) for order in (1, 2)]
        for k in range(5):
            assert modes(instance) == expected_modes
            reals.get()
            samples.append(reals.view.copy())
            if k == 2:
                for derivative in derivatives:
                    derivative.get()
                found = [derivative.view.copy() for derivative in derivatives]
            instance.do_step(k * h, h)
    a, b, c, d, e = samples
    expected = [
        (8 * (d - b) - (e - a)) / (12 * h),
        (16 * (d + b) - (e + a) - 30 * c) / (12 * h * h),
    ]
    for order in (0, 1):
        scale = 1.0 + np.abs(expected[order])
        np.testing.assert_allclose(
            found[order] / scale, expected[order] / scale, rtol=0, atol=(1e-6, 1e-4)[order]
        )
