"""Makes the reference trajectories of the RP manipulator, without the code that they check.

The Lagrangian is written from the positions of both centers of mass, sympy turns it into equations
of motion, and heyoka's Taylor method integrates them in numbers of 113 bits at their precision:
what is written are the nearest doubles. No closed form of "Example of dynamics computation
(Euler-Lagrange and Newton-Euler formulations): Revolute-Prismatic (RP) manipulator (Problem 7.8)"
goes in.
"""

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import heyoka as hy
import numpy as np
import sympy as sp

MODEL_FOLDER = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(MODEL_FOLDER.parents[1]))

from rparm.errors import UserError
from rparm.models import reference_files
from rparm.runs.scenario import Scenario

MODEL = "RPManipulator"
PARAMETERS = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
INPUTS = ("tau1", "f2")
STATES = ("q1", "q2", "dq1", "dq2")


@dataclass(frozen=True)
class Equations:
    """What the integrator and the outputs evaluate: sympy expressions in the names above."""

    accelerations: tuple[sp.Expr, sp.Expr]  # ddq1 in rad/s2, ddq2 in m/s2
    outputs: dict[str, sp.Expr]


@cache
def derive() -> Equations:
    """Equations of motion by Euler-Lagrange from positions in frame 0, and every Real output."""
    m1, m2, I1z, I2z, l1, lc1, a, g = sp.symbols(PARAMETERS)
    tau1, f2 = sp.symbols(INPUTS)
    t = sp.Symbol("t")
    angle, slide = sp.Function("angle")(t), sp.Function("slide")(t)
    along = sp.Matrix([sp.cos(angle), sp.sin(angle)])  # long side of link 1
    across = sp.Matrix([-sp.sin(angle), sp.cos(angle)])  # its short side

    center1 = lc1 * along
    center2 = (l1 + slide) * along + a * across  # also the end effector
    velocity1, velocity2 = center1.diff(t), center2.diff(t)
    spin = angle.diff(t)
    kinetic = (
        m1 * velocity1.dot(velocity1) + m2 * velocity2.dot(velocity2) + (I1z + I2z) * spin**2
    ) / 2
    potential = g * (m1 * center1[1] + m2 * center2[1])

    coordinates = sp.Matrix([angle, slide])
    rates = coordinates.diff(t)
    lagrangian = sp.Matrix([kinetic - potential])
    momenta = lagrangian.jacobian(rates).T
    balance = momenta.diff(t) - lagrangian.jacobian(coordinates).T - sp.Matrix([tau1, f2])

    q, dq, ddq = (sp.symbols(names) for names in (STATES[:2], STATES[2:], ("ddq1", "ddq2")))
    plain = [
        *zip(coordinates.diff(t, 2), ddq, strict=True),
        *zip(rates, dq, strict=True),
        *zip(coordinates, q, strict=True),
    ]
    balance = balance.subs(plain)
    inertia = balance.jacobian(ddq).applyfunc(sp.simplify)
    bias = balance.subs(dict.fromkeys(ddq, 0)).applyfunc(sp.simplify)
    solved = -inertia.adjugate() * bias / sp.simplify(inertia.det())

    kinetic, potential = sp.simplify(kinetic.subs(plain)), potential.subs(plain)
    position, velocity = center2.subs(plain), velocity2.subs(plain)
    outputs = {
        **{name: sp.Symbol(name) for name in STATES},
        "ddq1": solved[0],
        "ddq2": solved[1],
        "ee_x": position[0],
        "ee_y": position[1],
        "ee_vx": velocity[0],
        "ee_vy": velocity[1],
        "kinetic_energy": kinetic,
        "potential_energy": potential,
        "total_energy": kinetic + potential,
        "actuator_power": tau1 * dq[0] + f2 * dq[1],
    }
    return Equations((solved[0], solved[1]), outputs)


class Reference:
    """Compiled equations; evaluates scenarios in the floating-point type `real`, or in 113 bits."""

    def __init__(self, real: type | None = None) -> None:
        real = real or getattr(hy, "real128", None)
        if real is None:
            raise UserError("heyoka has no numbers of 113 bits here: make the references elsewhere")
        self.real = real
        equations = derive()
        self.outputs = list(equations.outputs)

        states = hy.make_vars(*STATES)
        runtime = {name: hy.par[i] for i, name in enumerate((*PARAMETERS, *INPUTS))}
        names = {sp.Symbol(name): par for name, par in runtime.items()}
        ddq1, ddq2 = (hy.from_sympy(e, names) for e in equations.accelerations)
        self.integrator = hy.taylor_adaptive(
            list(zip(states, (states[2], states[3], ddq1, ddq2), strict=True)),
            np.zeros(len(STATES), dtype=real),
            pars=np.zeros(len(runtime), dtype=real),
            fp_type=real,
        )
        self.evaluate = hy.cfunc(
            [hy.from_sympy(expression, names) for expression in equations.outputs.values()],
            vars=states,
            fp_type=real,
        )

    def simulate(self, scenario: Scenario) -> np.ndarray:
        """Outputs (n + 1, outputs); row i has the inputs of the step before it, row 0 the first."""
        value = scenario.start_values
        # time counts from the start; the differences of the communication points are exact
        elapsed = scenario.times.astype(self.real) - self.real(scenario.start)
        inputs = reference_files.input_table(scenario, INPUTS)
        held = np.concatenate((inputs[:1], inputs[:-1])).astype(self.real)

        integrator = self.integrator
        integrator.time = self.real(0)
        integrator.pars[: len(PARAMETERS)] = np.array(
            [value[name] for name in PARAMETERS], self.real
        )
        integrator.state[:] = np.array([value[name] for name in STATES], self.real)
        states = np.empty((len(elapsed), len(STATES)), self.real)
        states[0] = integrator.state
        for i in range(1, len(elapsed)):
            integrator.pars[len(PARAMETERS) :] = held[i]
            outcome = integrator.propagate_until(elapsed[i])[0]
            if outcome != hy.taylor_outcome.time_limit:
                raise UserError(
                    f"{scenario.path}: the motion blows up near {scenario.times[i]!r} s"
                )
            states[i] = integrator.state

        runtime = np.tile(integrator.pars, (len(elapsed), 1))
        runtime[:, len(PARAMETERS) :] = held
        return self.evaluate(np.ascontiguousarray(states.T), pars=np.ascontiguousarray(runtime.T)).T

    def write(self, scenario: Scenario, folder: Path, values: np.ndarray) -> None:
        """Write what `simulate` gives."""
        reference_files.write(scenario, folder, MODEL, self.outputs, values, INPUTS)


def writer() -> reference_files.Writer:
    """Simulates and writes one scenario after the other."""
    reference = Reference()
    return lambda scenario, folder: reference.write(scenario, folder, reference.simulate(scenario))


if __name__ == "__main__":
    reference_files.main(MODEL_FOLDER, writer)
