"""The FMU's accelerations against MuJoCo's, for the same arm described as bodies and joints.

MuJoCo knows nothing of the equations of the notes: it gets masses, inertias and joint axes
(rp_manipulator.xml) and forms its own mass matrix and bias forces.
"""

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.support.instances import Instance, LoadedFmu

MODEL = Path(__file__).parent / "rp_manipulator.xml"
STATES = 1000

DEFAULT = {
    "m1": 2.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1, "g": 9.81
}  # fmt: skip
PARAMETER_SETS = {
    "default": DEFAULT,
    "horizontal plane": DEFAULT | {"g": 0.0},
    "no offset": DEFAULT | {"a": 0.0},
    "heavy link 2 on the other side": DEFAULT | {"m2": 8.0, "a": -0.7, "l1": 1.2},
    "light link 1 upside down": DEFAULT | {"m1": 0.05, "I1z": 1e-3, "lc1": 0.0, "g": -3.7},
}
VARIABLES = ["q1", "q2", "dq1", "dq2", "tau1", "f2"]


@pytest.fixture(scope="module")
def arm(loaded: LoadedFmu) -> Iterator[Instance]:
    """One instance for all states."""
    with Instance(loaded) as instance:
        yield instance


def accelerations(arm: Instance, values: dict[str, float]) -> np.ndarray:
    """Accelerations (ddq1, ddq2) in rad/s2 and m/s2 after a reset to the given values."""
    arm.fmi.reset()
    arm.fmi.setupExperiment()
    arm.fmi.enterInitializationMode()
    arm.set(**values)
    return np.array(arm.get("ddq1", "ddq2"))


def mujoco_model(parameters: dict[str, float]) -> mujoco.MjModel:
    """The arm with these parameters; drives and a welded payload, where they have any."""
    given = parameters.get
    spec = mujoco.MjSpec.from_file(str(MODEL))
    spec.option.gravity = [0.0, -parameters["g"], 0.0]
    link1, link2 = spec.body("link1"), spec.body("link2")
    link1.mass, link2.mass = parameters["m1"], parameters["m2"]
    link1.inertia, link2.inertia = [parameters["I1z"]] * 3, [parameters["I2z"]] * 3
    link1.ipos = [parameters["lc1"], 0.0, 0.0]
    link2.pos = [parameters["l1"], parameters["a"], 0.0]
    for joint in (1, 2):
        spec.joint(f"q{joint}").armature = given(f"armature{joint}", 0.0)
        spec.joint(f"q{joint}").damping = [given(f"damping{joint}", 0.0), 0.0, 0.0]
    if given("attached", 0.0):
        payload = link2.add_body(name="payload")
        payload.explicitinertial = True
        payload.mass = parameters["payload_mass"]
        payload.inertia = [parameters["payload_inertia"]] * 3
        # x along the slide, y along the short side of link 1
        payload.ipos = [parameters["payload_z"], parameters["payload_x"], 0.0]
    return spec.compile()


def random_states(seed: int) -> np.ndarray:
    """Rows q1, q2, dq1, dq2, tau1, f2, shape (STATES, 6); l1 + q2 takes both signs."""
    bounds = np.array([np.pi, 2.0, 5.0, 5.0, 30.0, 30.0])
    return np.random.default_rng(seed).uniform(-bounds, bounds, (STATES, 6))


def acceleration_terms(parameters: dict[str, float], state: np.ndarray) -> np.ndarray:
    """Sum the absolute values of the terms of ddq1 and of ddq2 in (13), shape (2,)."""
    m1, m2, _, _, l1, lc1, a, g = (abs(parameters[name]) for name in DEFAULT)
    q2, dq1, dq2, tau1, f2 = np.abs(state[1:])
    torque = tau1 + 2 * m2 * (l1 + q2) * dq1 * dq2 + g * (m1 * lc1 + m2 * (l1 + q2 + a))
    force = f2 + m2 * (l1 + q2) * dq1**2 + m2 * g
    length = parameters["l1"] + state[1]
    inertia = m1 * lc1**2 + parameters["I1z"] + parameters["I2z"] + m2 * length**2
    ddq1 = (torque + a * force) / inertia
    return np.array([ddq1, a * ddq1 + force / m2])


def test_model_file_holds_the_default_parameters() -> None:
    model, expected = mujoco.MjModel.from_xml_path(str(MODEL)), mujoco_model(DEFAULT)
    for name in ("body_mass", "body_inertia", "body_ipos", "body_pos"):
        np.testing.assert_array_equal(getattr(model, name), getattr(expected, name))
    np.testing.assert_array_equal(model.opt.gravity, expected.opt.gravity)


@pytest.mark.parametrize("name", PARAMETER_SETS)
def test_accelerations_are_those_of_mujoco(arm: Instance, name: str) -> None:
    parameters = PARAMETER_SETS[name]
    model = mujoco_model(parameters)
    data = mujoco.MjData(model)
    for state in random_states(seed=len(name)):
        data.qpos, data.qvel, data.qfrc_applied = state[0:2], state[2:4], state[4:6]
        mujoco.mj_forward(model, data)
        ddq = accelerations(arm, parameters | dict(zip(VARIABLES, state, strict=True)))
        # MuJoCo factors J + m2 a^2 - m2 a^2, which loses up to 1 + m2 a^2 / J < 16 of its digits:
        # 16 * 2e-16, with a few roundings of each
        error = np.abs(ddq - data.qacc) / acceleration_terms(parameters, state)
        assert np.all(error <= 1e-13), f"{parameters}, state {state}: {ddq}, MuJoCo {data.qacc}"
