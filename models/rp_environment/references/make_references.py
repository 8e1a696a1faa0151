"""Makes the reference trajectories of the wall, without the code that they check.

Points and vectors of the plane are complex numbers of 40 digits: the turn of frame 2 is a factor,
the component along the normal a real part, a moment an imaginary part.
"""

from collections.abc import Mapping

import numpy as np
from mpmath import mp, mpf

from rparm.models import reference_files
from rparm.runs.scenario import Scenario

INPUTS = ("ee_x", "ee_y", "ee_vx", "ee_vy", "ee_angle", "ee_rate")
OUTPUTS = ("ee_fx", "ee_fy", "ee_mz", "penetration", "wall_force")
DIGITS = 40


def values(value: Mapping[str, float]) -> list[mpf]:
    """Return OUTPUTS, in N, N, N.m, m, N, of parameters and inputs."""
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


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the columns of OUTPUTS, (n + 1,) each."""
    rows = []
    with mp.workdps(DIGITS):
        for row in reference_files.held_rows(scenario, INPUTS).tolist():
            held = dict(zip(INPUTS, row, strict=True))
            rows.append([float(x) for x in values(scenario.start_values | held)])
    return dict(zip(OUTPUTS, np.array(rows).T, strict=True))
