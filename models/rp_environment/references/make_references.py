"""Makes the reference trajectories of the wall, without the code that they check.

Points and vectors of the plane are complex numbers of 40 digits: the turn of frame 2 is a factor,
the component along the normal a real part, a moment an imaginary part.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from mpmath import mp, mpf

MODEL_FOLDER = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(MODEL_FOLDER.parents[1]))

from rparm.models import reference_files
from rparm.runs.scenario import Scenario

MODEL = "RPEnvironment"
INPUTS = ("ee_x", "ee_y", "ee_vx", "ee_vy", "ee_angle", "ee_rate")
OUTPUTS = ("ee_fx", "ee_fy", "ee_mz", "penetration", "wall_force")
DIGITS = 40


def outputs(value: Mapping[str, float]) -> list[mpf]:
    """OUTPUTS, in N, N, N.m, m, N, of parameters and inputs."""
    v = {name: mpf(float(x)) for name, x in value.items()}
    normal = mp.expj(v["angle"])
    lever = mp.mpc(v["tip_z"], v["tip_x"]) * mp.expj(v["ee_angle"])
    tip = mp.mpc(v["ee_x"], v["ee_y"]) + lever
    velocity = mp.mpc(v["ee_vx"], v["ee_vy"]) + 1j * v["ee_rate"] * lever
    depth = v["position"] - (tip / normal).real
    speed = (velocity / normal).real
    pressed = v["stiffness"] * depth - v["damping"] * speed
    size = max(pressed, mpf(0)) if depth > 0 else mpf(0)
    force = size * normal
    moment = (force * mp.conj(lever)).imag
    return [force.real, force.imag, moment, max(depth, mpf(0)), size]


def simulate(scenario: Scenario) -> np.ndarray:
    """Outputs (n + 1, outputs); row i has the inputs of the step before it, row 0 the first."""
    inputs = reference_files.input_table(scenario, INPUTS)
    rows = []
    with mp.workdps(DIGITS):
        for i in range(len(inputs)):
            held = dict(zip(INPUTS, inputs[max(i - 1, 0)].tolist(), strict=True))
            rows.append([float(x) for x in outputs(scenario.start_values | held)])
    return np.array(rows)


def write(scenario: Scenario, folder: Path) -> None:
    reference_files.write(scenario, folder, MODEL, OUTPUTS, simulate(scenario), INPUTS)


if __name__ == "__main__":
    reference_files.main(MODEL_FOLDER, lambda: write)
