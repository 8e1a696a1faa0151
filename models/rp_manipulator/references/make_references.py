"""Makes the reference trajectories of the RP manipulator, without the code that they check.

The Lagrangian is written from the positions of both centers of mass, sympy turns it into equations
of motion, and heyoka's Taylor method integrates them in numbers of 113 bits at their precision:
what is written are the nearest doubles. No closed form of "Example of dynamics computation
(Euler-Lagrange and Newton-Euler formulations): Revolute-Prismatic (RP) manipulator (Problem 7.8)"
goes in. The exact final state of a problem in ../convergence has inputs that are smooth functions
of time, in long double.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import heyoka as hy
import numpy as np
import sympy as sp

from rparm import project
from rparm.errors import UserError
from rparm.files import write_text
from rparm.models import reference_files
from rparm.runs import convergence
from rparm.runs.inputs import Sines
from rparm.runs.scenario import Scenario

PARAMETERS = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
INPUTS = ("tau1", "f2")
STATES = ("q1", "q2", "dq1", "dq2")
ON_THE_WAY = 1000  # points of a smooth motion at which the largest values are looked for


@dataclass(frozen=True)
class Equations:
    """Expressions in the names above, for the integrator and the outputs."""

    accelerations: tuple[sp.Expr, sp.Expr]  # ddq1 in rad/s2, ddq2 in m/s2
    outputs: dict[str, sp.Expr]


@cache
def derive() -> Equations:
    """Return the equations by Euler-Lagrange from positions in frame 0, and every Real output."""
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
        """Return the outputs, (n + 1, outputs); each row has the inputs of the step before."""
        value = scenario.start_values
        # time counts from the start; the differences of the communication points are exact
        elapsed = scenario.times.astype(self.real) - self.real(scenario.start)
        held = reference_files.held_rows(scenario, INPUTS).astype(self.real)

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


compiled = cache(Reference)


def outputs(scenario: Scenario) -> dict[str, np.ndarray]:
    """Return the columns of the Real outputs, (n + 1,) each."""
    reference = compiled()
    return dict(zip(reference.outputs, reference.simulate(scenario).T, strict=True))


# ---- Smooth inputs -------------------------------------------------------------------------------
def signal(sines: Sines, real: type) -> hy.expression:
    """`sines` as a function of heyoka's time."""
    omega = 2 * np.arctan2(real(0), real(-1))
    total = hy.expression(real(sines.offset))
    for amplitude, frequency, phase in sines.terms:
        angle = hy.expression(omega * real(frequency)) * hy.time + hy.expression(real(phase))
        total += hy.expression(real(amplitude)) * hy.sin(angle)
    return total


def integrator(
    scenario: Scenario, inputs: dict[str, hy.expression], real: type = np.longdouble, pars: int = 0
) -> hy.taylor_adaptive:
    """The motion from time 0, with tau1 (N.m) and f2 (N) of heyoka's time and `pars` parameters."""
    start = scenario.start_values
    names = {sp.Symbol(name): hy.expression(real(start[name])) for name in PARAMETERS}
    names |= {sp.Symbol(name): inputs[name] for name in INPUTS}
    states = hy.make_vars(*STATES)
    ddq1, ddq2 = (hy.from_sympy(e, names) for e in derive().accelerations)
    return hy.taylor_adaptive(
        list(zip(states, (states[2], states[3], ddq1, ddq2), strict=True)),
        np.array([start[name] for name in STATES], real),
        pars=np.zeros(pars, dtype=real),
        fp_type=real,
    )


def final_state(
    scenario: Scenario, real: type = np.longdouble
) -> tuple[dict[str, float], dict[str, float]]:
    """Return states at the end, and the largest absolute value of each on the way."""
    if real is np.longdouble and np.finfo(real).eps > 2e-19:
        raise UserError("long double is no wider than double here: make the references elsewhere")
    sines = convergence.smooth_inputs(scenario)
    motion = integrator(scenario, {name: signal(s, real) for name, s in sines.items()}, real)
    end = real(scenario.stop) - real(scenario.start)
    outcome, *_, path = motion.propagate_grid(np.linspace(real(0), end, ON_THE_WAY))
    if outcome != hy.taylor_outcome.time_limit:
        raise UserError(f"{scenario.path}: the motion blows up")
    largest = np.max(np.abs(path), axis=0)
    return (
        dict(zip(STATES, path[-1].astype(float).tolist(), strict=True)),
        dict(zip(STATES, largest.astype(float).tolist(), strict=True)),
    )


def write_exact_state(scenario: Scenario, folder: Path) -> None:
    """Write the exact final state of `scenario` to `folder`."""
    final, largest = final_state(scenario)
    content = {"time": scenario.stop, "final": final, "largest": largest}
    file = project.exact_state_file(scenario.path).name
    write_text(folder / file, json.dumps(content, indent=2) + "\n")
