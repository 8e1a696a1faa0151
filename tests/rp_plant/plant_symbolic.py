"""The plant's smooth part in sympy, from positions, evaluated with 40 digits at the numbers given.

Shares nothing with the C code: the equations of motion come from the Lagrangian, the joint loads
from Newton's and Euler's laws in frame 0.
"""

from collections.abc import Mapping

import mpmath
import sympy as sp

from tests.rp_plant.plant_rows import ARM, INPUTS, PAYLOAD, STATES

DRIVES = ("armature1", "armature2", "damping1", "damping2")
ACCELERATIONS = ("ddq1", "ddq2")
NAMES = (*ARM, *DRIVES, *PAYLOAD, "attached", *INPUTS, *STATES, *ACCELERATIONS)

mpmath.mp.dps = 40


def cross(u: sp.Matrix, v: sp.Matrix) -> sp.Expr:
    """Component out of the plane."""
    return u[0] * v[1] - u[1] * v[0]


class SmoothPlant:
    """Mass matrix, forces, energies, joint loads and end effector."""

    def __init__(self) -> None:
        t = sp.Symbol("t")
        angle, slide = sp.Function("angle")(t), sp.Function("slide")(t)
        s = {name: sp.Symbol(name) for name in NAMES}
        along = sp.Matrix([sp.cos(angle), sp.sin(angle)])
        across = sp.Matrix([-sp.sin(angle), sp.cos(angle)])
        end1 = s["l1"] * along + s["a"] * across
        effector = end1 + slide * along
        load = effector + s["payload_x"] * across + s["payload_z"] * along
        mp, Ip = s["attached"] * s["payload_mass"], s["attached"] * s["payload_inertia"]
        # mass, inertia about its center, center of mass
        bodies = [
            (s["m1"], s["I1z"], s["lc1"] * along),
            (s["m2"], s["I2z"], effector),
            (mp, Ip, load),
        ]
        frame = (along, across, end1, effector)
        wrench = sp.Matrix([s["ee_fx"], s["ee_fy"]])
        w, v = angle.diff(t), slide.diff(t)
        drives = (s["armature1"] * w**2 + s["armature2"] * v**2) / 2

        kinetic = drives + sum(
            (m * x.diff(t).dot(x.diff(t)) + inertia * w**2) / 2 for m, inertia, x in bodies
        )
        potential = s["g"] * sum(m * x[1] for m, _, x in bodies)
        power = wrench.dot(effector.diff(t)) + s["ee_mz"] * w + s["tau1"] * w + s["f2"] * v

        plain = [
            *zip((angle.diff(t, 2), slide.diff(t, 2)), sp.symbols(ACCELERATIONS), strict=True),
            *zip((w, v), sp.symbols(STATES[2:]), strict=True),
            *zip((angle, slide), sp.symbols(STATES[:2]), strict=True),
        ]
        q, dq = sp.symbols(STATES[:2]), sp.symbols(STATES[2:])
        K, P = sp.expand(kinetic.doit().subs(plain)), potential.subs(plain)
        momenta = sp.Matrix([K.diff(rate) for rate in dq])
        coriolis = momenta.jacobian(q) * sp.Matrix(dq) - sp.Matrix([K.diff(x) for x in q])
        drag = sp.Matrix([s["damping1"] * dq[0], s["damping2"] * dq[1]])
        driving = sp.Matrix([sp.expand(power.subs(plain)).diff(rate) for rate in dq])
        self._expressions = {
            "mass_matrix": momenta.jacobian(dq),
            "coriolis": coriolis,
            "gravity": sp.Matrix([P.diff(x) for x in q]),
            "applied": driving - drag,
            "kinetic_energy": K,
            "potential_energy": P,
            "acceleration": effector.diff(t, 2).subs(plain),
            "loads": self._loads(s, bodies, frame, wrench, w.diff(t), t).subs(plain),
        }
        self._functions = {
            name: sp.lambdify(sp.symbols(NAMES), expression, "mpmath", cse=True)
            for name, expression in self._expressions.items()
        }

    @staticmethod
    def _loads(
        s: Mapping[str, sp.Symbol],
        bodies: list[tuple],
        geometry: tuple[sp.Matrix, ...],
        wrench: sp.Matrix,
        alpha: sp.Expr,
        t: sp.Symbol,
    ) -> sp.Matrix:
        """f1_x, f1_z, tau1_y, f2_x, f2_z, tau2_y; moments about joint 1 and the end of link 1."""
        along, across, end1, effector = geometry
        weightless = sp.Matrix([0, s["g"]])
        (m1, I1z, center1), *carried = bodies

        force2, moment2 = -wrench, -s["ee_mz"] - cross(effector - end1, wrench)
        for m, inertia, x in carried:
            inertial = m * (x.diff(t, 2) + weightless)
            force2 = force2 + inertial
            moment2 += inertia * alpha + cross(x - end1, inertial)
        inertial1 = m1 * (center1.diff(t, 2) + weightless)
        force1 = force2 + inertial1
        moment1 = I1z * alpha + moment2 + cross(center1, inertial1) + cross(end1, force2)
        return sp.Matrix(
            [across.dot(force1), along.dot(force1), moment1,
             across.dot(force2), along.dot(force2), moment2]
        )  # fmt: skip

    def expression(self, name: str) -> sp.Expr | sp.Matrix:
        """In the symbols NAMES."""
        return self._expressions[name]

    def evaluate(self, name: str, case: Mapping[str, float]) -> mpmath.matrix | mpmath.mpf:
        """An expression at exact rationals."""
        return self._functions[name](*(mpmath.mpf(case.get(key, 0.0)) for key in NAMES))
