"""The plant's C functions from Python, by the program plant_rows: many rows in one call."""

import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np

ARM = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
JOINT = (
    "armature", "damping", "coulomb_friction", "breakaway_friction", "stribeck_velocity", "lower",
    "upper", "restitution",
)  # fmt: skip
PAYLOAD = ("payload_mass", "payload_inertia", "payload_x", "payload_z")
INPUTS = ("tau1", "f2", "ee_fx", "ee_fy", "ee_mz")
STATES = ("q1", "q2", "dq1", "dq2")
COMPLIANT = ("stop_stiffness1", "stop_stiffness2", "stop_damping1", "stop_damping2")
PARAMETERS = (*ARM, *(f"{name}{joint}" for name in JOINT for joint in (1, 2)), *PAYLOAD, *COMPLIANT)
SWITCHES = ("attached", "mode1", "mode2", "contact1", "contact2", "stops1", "stops2")
KNOWNS = (*PARAMETERS, *INPUTS, *STATES, *SWITCHES)
RESULTS = (
    "ddq1", "ddq2", "ee_ax", "ee_ay", "kinetic_energy", "potential_energy", "D11", "D12", "D22",
    "coriolis1", "coriolis2", "gravity1", "gravity2", "f1_x", "f1_z", "tau1_y", "f2_x", "f2_z",
    "tau2_y", "friction1", "friction2", "stop_force1", "stop_force2",
)  # fmt: skip
FREE, STUCK = 2.0, 0.0
DEFAULT = {
    "m1": 2.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "l1": 0.5, "lc1": 0.25, "a": 0.1, "g": 9.81,
    "mode1": FREE, "mode2": FREE,
}  # fmt: skip


def evaluate(program: Path, cases: list[Mapping[str, float]]) -> list[dict[str, float]]:
    """Calculated values of the plant, in SI units; knowns that a case does not have are those of
    DEFAULT, or else 0."""
    values = [DEFAULT | dict(case) for case in cases]
    assert all(case.keys() <= set(KNOWNS) for case in values)
    rows = np.array([[case.get(name, 0.0) for name in KNOWNS] for case in values], dtype=np.float64)
    done = subprocess.run(program, input=rows.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(done.stdout).reshape(len(rows), len(RESULTS))
    return [dict(zip(RESULTS, row, strict=True)) for row in found.tolist()]
