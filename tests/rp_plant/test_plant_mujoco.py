"""The smooth part of the plant against MuJoCo's accelerations, 1e-10 of their terms.

The arm is that of tests/rp_manipulator; armature, damping, a body welded to link 2 and a force on
that link are MuJoCo's own.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.rp_manipulator.test_mujoco import mujoco_model
from tests.rp_plant.plant_rows import DEFAULT, evaluate

STATES = 500
FEATURES = {
    "armature": {"armature1": 0.3, "armature2": 0.7},
    "damping": {"damping1": 1.5, "damping2": 4.0},
    "wrench": {"ee_fx": 7.0, "ee_fy": -4.0, "ee_mz": 2.5},
    "payload": {
        "attached": 1.0, "payload_mass": 0.8, "payload_inertia": 0.02,
        "payload_x": 0.15, "payload_z": -0.25,
    },
}  # fmt: skip
EVERYTHING = {name: value for feature in FEATURES.values() for name, value in feature.items()}


@pytest.mark.parametrize("name", [*FEATURES, "everything"])
def test_accelerations_are_those_of_mujoco(program: Path, name: str) -> None:
    feature = EVERYTHING if name == "everything" else FEATURES[name]
    bounds = np.array([np.pi, 2.0, 5.0, 5.0, 30.0, 30.0])
    states = np.random.default_rng(len(name)).uniform(-bounds, bounds, (STATES, 6))
    names = ("q1", "q2", "dq1", "dq2", "tau1", "f2")
    cases = [DEFAULT | feature | dict(zip(names, state, strict=True)) for state in states.tolist()]
    model = mujoco_model(cases[0])
    data = mujoco.MjData(model)
    link2 = model.body("link2").id
    for case, state, found in zip(cases, states, evaluate(program, cases), strict=True):
        data.qpos, data.qvel, data.qfrc_applied = state[0:2], state[2:4], state[4:6]
        force = [case.get(key, 0.0) for key in ("ee_fx", "ee_fy")]
        data.xfrc_applied[link2] = [*force, 0.0, 0.0, 0.0, case.get("ee_mz", 0.0)]
        mujoco.mj_forward(model, data)
        ddq = np.array([found["ddq1"], found["ddq2"]])
        error = np.abs(ddq - data.qacc) / (100.0 + np.abs(data.qacc))
        assert np.all(error <= 1e-10), (case, ddq, data.qacc)
