"""Equations of motion of the plant in sympy, from positions, without the code that they check.

The Lagrangian is written from the centers of mass of both links and of the payload; drives,
friction and the wrench at the end effector come in by their power.
"""

from dataclasses import dataclass

import sympy as sp

ARM = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
PER_JOINT = (
    "armature", "damping", "coulomb_friction", "breakaway_friction", "stribeck_velocity",
)  # fmt: skip
PAYLOAD = ("payload_mass", "payload_inertia", "payload_x", "payload_z")
PARAMETERS = (*ARM, *(f"{name}{joint}" for name in PER_JOINT for joint in (1, 2)), *PAYLOAD)
INPUTS = ("tau1", "f2", "ee_fx", "ee_fy", "ee_mz")
SWITCHES = ("direction1", "direction2", "attached")  # a direction is 0 if no friction acts
STATES = ("q1", "q2", "dq1", "dq2")
ACCELERATIONS = ("ddq1", "ddq2")


@dataclass(frozen=True)
class Equations:
    """Expressions in the names above."""

    inertia: sp.Matrix  # D, 2 x 2: kg.m2, kg.m, kg
    forces: sp.Matrix  # b, all generalized forces but dry friction and stops: N.m, N
    friction: sp.Matrix  # dry friction of sliding joints, as it acts: N.m, N
    breakaway: sp.Matrix  # largest dry friction of joints at rest: N.m, N
    outputs: dict[str, sp.Expr]  # Real outputs that follow from states and accelerations


def derive() -> Equations:
    """Euler-Lagrange from the positions of all masses in frame 0."""
    s = {name: sp.Symbol(name) for name in (*PARAMETERS, *INPUTS, *SWITCHES)}
    t = sp.Symbol("t")
    angle, slide = sp.Function("angle")(t), sp.Function("slide")(t)
    along = sp.Matrix([sp.cos(angle), sp.sin(angle)])  # long side of link 1
    across = sp.Matrix([-sp.sin(angle), sp.cos(angle)])  # its short side
    effector = (s["l1"] + slide) * along + s["a"] * across
    carried = effector + s["payload_x"] * across + s["payload_z"] * along
    bodies = [  # mass, inertia about its center, center
        (s["m1"], s["I1z"], s["lc1"] * along),
        (s["m2"], s["I2z"], effector),
        (s["attached"] * s["payload_mass"], s["attached"] * s["payload_inertia"], carried),
    ]
    spin, speed = angle.diff(t), slide.diff(t)
    velocity = effector.diff(t)
    kinetic = (s["armature1"] * spin**2 + s["armature2"] * speed**2) / 2
    for mass, inertia, center in bodies:
        kinetic += (mass * center.diff(t).dot(center.diff(t)) + inertia * spin**2) / 2
    potential = s["g"] * sum(mass * center[1] for mass, _, center in bodies)
    wrench = sp.Matrix([s["ee_fx"], s["ee_fy"]])
    power = wrench.dot(velocity) + s["ee_mz"] * spin + s["tau1"] * spin + s["f2"] * speed

    q, dq = sp.symbols(STATES[:2]), sp.symbols(STATES[2:])
    plain = [
        *zip((angle.diff(t, 2), slide.diff(t, 2)), sp.symbols(ACCELERATIONS), strict=True),
        *zip((spin, speed), dq, strict=True),
        *zip((angle, slide), q, strict=True),
    ]
    squared = {sp.sin(q[0]) ** 2: 1 - sp.cos(q[0]) ** 2}
    kinetic = sp.expand(sp.expand(kinetic.doit().subs(plain)).subs(squared))
    potential = potential.subs(plain)
    position, velocity = effector.subs(plain), velocity.subs(plain)
    momenta = sp.Matrix([kinetic.diff(rate) for rate in dq])
    coriolis = momenta.jacobian(q) * sp.Matrix(dq) - sp.Matrix([kinetic.diff(x) for x in q])
    gravity = sp.Matrix([potential.diff(x) for x in q])
    applied = sp.Matrix([sp.expand(power.subs(plain)).diff(rate) for rate in dq])
    drag = sp.Matrix([s["damping1"] * dq[0], s["damping2"] * dq[1]])
    acceleration = effector.diff(t, 2).subs(plain)

    friction, breakaway = zip(
        *(_dry_friction(s, joint, dq[joint - 1]) for joint in (1, 2)), strict=True
    )
    outputs = {
        **{name: sp.Symbol(name) for name in (*STATES, *ACCELERATIONS)},
        "ee_x": position[0],
        "ee_y": position[1],
        "ee_vx": velocity[0],
        "ee_vy": velocity[1],
        "kinetic_energy": kinetic,
        "potential_energy": potential,
        "total_energy": kinetic + potential,
        "actuator_power": s["tau1"] * dq[0] + s["f2"] * dq[1],
        "ee_angle": q[0],
        "ee_rate": dq[0],
        "ee_ax": acceleration[0],
        "ee_ay": acceleration[1],
    }
    return Equations(
        inertia=momenta.jacobian(dq),
        forces=applied - drag - coriolis - gravity,
        friction=sp.Matrix(friction),
        breakaway=sp.Matrix(breakaway),
        outputs=outputs,
    )


def _dry_friction(s: dict[str, sp.Symbol], joint: int, rate: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Friction at a rate in its direction, and at rest at most, of values that are `prepared`."""
    coulomb = s[f"coulomb_friction{joint}"]
    breakaway = s[f"breakaway_friction{joint}"]
    fall = sp.exp(-((rate / s[f"stribeck_velocity{joint}"]) ** 2))
    return s[f"direction{joint}"] * (coulomb + (breakaway - coulomb) * fall), breakaway


def prepared(values: dict[str, float]) -> dict[str, float]:
    """Return parameters of these equations from the FMU's, where 0 means a default."""
    result = {name: float(values[name]) for name in PARAMETERS}
    for joint in (1, 2):
        if result[f"breakaway_friction{joint}"] == 0:
            result[f"breakaway_friction{joint}"] = result[f"coulomb_friction{joint}"]
        if result[f"stribeck_velocity{joint}"] == 0:  # both frictions are equal
            result[f"stribeck_velocity{joint}"] = 1.0
    return result
