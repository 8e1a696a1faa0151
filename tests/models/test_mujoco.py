"""Accelerations of the arm and of the plant's smooth part against MuJoCo's.

MuJoCo knows nothing of the equations of the notes: it gets masses, inertias and joint axes
(tests/rp_manipulator/rp_manipulator.xml) and forms its own mass matrix and bias forces. Armature,
damping, a body welded to link 2 and a force on that link are MuJoCo's own.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.support.instances import Instance, LoadedFmu, set_value
from tests.support.paths import ROOT

MODEL = ROOT / "tests" / "rp_manipulator" / "rp_manipulator.xml"
STATES = 1000

DEFAULT = {
    "m1": 2.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1, "g": 9.81
}  # fmt: skip
ARMS = {
    "default": {},
    "horizontal plane": {"g": 0.0},
    "no offset": {"a": 0.0},
    "heavy link 2 on the other side": {"m2": 8.0, "a": -0.7, "l1": 1.2},
    "light link 1 upside down": {"m1": 0.05, "I1z": 1e-3, "lc1": 0.0, "g": -3.7},
}
FEATURES = {
    "armature": {"armature1": 0.3, "armature2": 0.7},
    "damping": {"damping1": 1.5, "damping2": 4.0},
    "wrench": {"ee_fx": 7.0, "ee_fy": -4.0, "ee_mz": 2.5},
    "payload": {
        "payload_mass": 0.8, "payload_inertia": 0.02, "payload_x": 0.15, "payload_z": -0.25,
    },
}  # fmt: skip
EVERYTHING = {name: value for feature in FEATURES.values() for name, value in feature.items()}
CASES = [("RPManipulator", name, values) for name, values in ARMS.items()]
CASES += [("RPPlant", name, values) for name, values in FEATURES.items()]
CASES += [("RPPlant", "everything", EVERYTHING)]


def mujoco_model(parameters: dict[str, float]) -> mujoco.MjModel:
    """Return the arm with these parameters; drives and a welded payload, where they have any."""
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
    if "payload_mass" in parameters:
        payload = link2.add_body(name="payload")
        payload.explicitinertial = True
        payload.mass = parameters["payload_mass"]
        payload.inertia = [parameters["payload_inertia"]] * 3
        # x along the slide, y along the short side of link 1
        payload.ipos = [parameters["payload_z"], parameters["payload_x"], 0.0]
    return spec.compile()


def bounds(name: str, p: dict[str, float], state: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Return the errors allowed of ddq1 and ddq2, (2,).

    The arm's are 1e-13 of the terms in (13), by their absolute values: MuJoCo factors
    J + m2 a^2 - m2 a^2, which loses up to 1 + m2 a^2 / J < 16 of its digits: 16 * 2e-16, with a few
    roundings of each.
    """
    if name == "RPPlant":
        return 1e-10 * (100.0 + np.abs(exact))
    m1, m2, _, _, l1, lc1, a, g = (abs(p[name]) for name in DEFAULT)
    q2, dq1, dq2, tau1, f2 = np.abs(state[1:])
    torque = tau1 + 2 * m2 * (l1 + q2) * dq1 * dq2 + g * (m1 * lc1 + m2 * (l1 + q2 + a))
    force = f2 + m2 * (l1 + q2) * dq1**2 + m2 * g
    ddq1 = (torque + a * force) / (
        m1 * lc1**2 + p["I1z"] + p["I2z"] + m2 * (p["l1"] + state[1]) ** 2
    )
    return 1e-13 * np.array([ddq1, a * ddq1 + force / m2])


def test_model_file_holds_the_default_parameters() -> None:
    model, expected = mujoco.MjModel.from_xml_path(str(MODEL)), mujoco_model(DEFAULT)
    for name in ("body_mass", "body_inertia", "body_ipos", "body_pos"):
        np.testing.assert_array_equal(getattr(model, name), getattr(expected, name))
    np.testing.assert_array_equal(model.opt.gravity, expected.opt.gravity)


@pytest.mark.parametrize(("name", "case", "changed"), CASES)
def test_accelerations_are_those_of_mujoco(
    fmu: Path, tmp_path: Path, name: str, case: str, changed: dict[str, float]
) -> None:
    """At random states; l1 + q2 takes both signs."""
    parameters = DEFAULT | changed
    model = mujoco_model(parameters)
    data = mujoco.MjData(model)
    link2 = model.body("link2").id
    force = [parameters.get(key, 0.0) for key in ("ee_fx", "ee_fy")]
    data.xfrc_applied[link2] = [*force, 0.0, 0.0, 0.0, parameters.get("ee_mz", 0.0)]
    loaded = LoadedFmu(fmu.with_name(f"{name}.fmu"), tmp_path)
    with Instance(loaded).begin() as instance:
        instance.set(**parameters)
        for variable in loaded.description.modelVariables:
            if variable.name == "payload_attached":
                set_value(instance.fmi, variable, "payload_mass" in parameters)
        limits = np.array([np.pi, 2.0, 5.0, 5.0, 30.0, 30.0])
        for state in np.random.default_rng(len(case)).uniform(-limits, limits, (STATES, 6)):
            data.qpos, data.qvel, data.qfrc_applied = state[0:2], state[2:4], state[4:6]
            mujoco.mj_forward(model, data)
            names = ("q1", "q2", "dq1", "dq2", "tau1", "f2")
            instance.set(**dict(zip(names, state, strict=True)))
            ddq = np.array(instance.get("ddq1", "ddq2"))
            error = np.abs(ddq - data.qacc)
            assert np.all(error <= bounds(name, parameters, state, data.qacc)), (state, ddq)
