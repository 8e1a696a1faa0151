"""Arm and plant in sympy, from positions, evaluated with 40 digits.

Shares nothing with the C code: equations of motion and outputs are those of the references, joint
loads are derived here by Newton's and Euler's laws.
"""

import functools
import itertools
import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import mpmath
import sympy as sp
from rparm.models.rp_manipulator.references.make_references import PARAMETERS, derive
from rparm.models.rp_plant.references import equations as plant
from rparm.models.rp_plant.references.equations import ACCELERATIONS, PAYLOAD, STATES

from tests.support.instances import INPUTS

KNOWNS = (*PARAMETERS, *INPUTS, *STATES)
TERMS = ("D11", "D12", "D22", "coriolis1", "coriolis2", "gravity1", "gravity2")
LOADS = ("f1_x", "f1_z", "tau1_y", "f2_x", "f2_z", "tau2_y")
# derivatives of the inputs with respect to time: orders 1 and 2
INPUT_RATES = (("tau1_rate", "f2_rate"), ("tau1_bend", "f2_bend"))
DRIVES = ("armature1", "armature2", "damping1", "damping2")
NAMES = (*PARAMETERS, *DRIVES, *PAYLOAD, "attached", *plant.INPUTS, *STATES, *ACCELERATIONS)

mpmath.mp.dps = 40

Values = dict[str, float]


def cross(u: sp.Matrix, v: sp.Matrix) -> sp.Expr:
    """Component out of the plane."""
    return u[0] * v[1] - u[1] * v[0]


def loads_by_newton() -> sp.Matrix:
    """LOADS of the plant in NAMES; moments about joint 1 and about the end of link 1.

    Forces and moments that give the bodies their accelerations, in frame 0.
    """
    s = {name: sp.Symbol(name) for name in NAMES}
    t = sp.Symbol("t")
    angle, slide = sp.Function("angle")(t), sp.Function("slide")(t)
    along = sp.Matrix([sp.cos(angle), sp.sin(angle)])
    across = sp.Matrix([-sp.sin(angle), sp.cos(angle)])
    end1 = s["l1"] * along + s["a"] * across
    effector = end1 + slide * along
    payload = effector + s["payload_x"] * across + s["payload_z"] * along
    carried = s["attached"] * s["payload_mass"], s["attached"] * s["payload_inertia"], payload
    weightless, alpha = sp.Matrix([0, s["g"]]), angle.diff(t, 2)

    wrench = sp.Matrix([s["ee_fx"], s["ee_fy"]])
    force2, moment2 = -wrench, -s["ee_mz"] - cross(effector - end1, wrench)
    for m, inertia, x in (s["m2"], s["I2z"], effector), carried:
        inertial = m * (x.diff(t, 2) + weightless)
        force2 = force2 + inertial
        moment2 += inertia * alpha + cross(x - end1, inertial)
    center1 = s["lc1"] * along
    inertial1 = s["m1"] * (center1.diff(t, 2) + weightless)
    force1 = force2 + inertial1
    moment1 = s["I1z"] * alpha + moment2 + cross(center1, inertial1) + cross(end1, force2)
    frame = (across, along)
    loads = [*(x.dot(force1) for x in frame), moment1, *(x.dot(force2) for x in frame), moment2]
    moving = (alpha, slide.diff(t, 2), angle.diff(t), slide.diff(t), angle, slide)
    plain = zip(moving, sp.symbols((*ACCELERATIONS, *STATES[2:], *STATES[:2])), strict=True)
    return sp.Matrix(loads).subs(list(plain))


class SmoothPlant:
    """Mass matrix, forces, energies, joint loads and end effector of the plant, in NAMES."""

    def __init__(self) -> None:
        equations = plant.derive()
        q, dq = (sp.Matrix(sp.symbols(names)) for names in (STATES[:2], STATES[2:]))
        kinetic, potential = (equations.outputs[f"{x}_energy"] for x in ("kinetic", "potential"))
        coriolis = (equations.inertia * dq).jacobian(q) * dq - sp.Matrix([kinetic]).jacobian(q).T
        gravity = sp.Matrix([potential]).jacobian(q).T
        self.expressions = {
            "mass_matrix": equations.inertia,
            "coriolis": coriolis.expand(),
            "gravity": gravity,
            "applied": (equations.forces + coriolis + gravity).expand(),
            "kinetic_energy": kinetic,
            "potential_energy": potential,
            "acceleration": sp.Matrix([equations.outputs[name] for name in ("ee_ax", "ee_ay")]),
            "loads": loads_by_newton(),
        }
        self._functions = {
            name: sp.lambdify(sp.symbols(NAMES), expression, "mpmath", cse=True)
            for name, expression in self.expressions.items()
        }

    def evaluate(self, name: str, case: Mapping[str, float]) -> mpmath.matrix | mpmath.mpf:
        """An expression at exact rationals."""
        return self._functions[name](*(mpmath.mpf(case.get(key, 0.0)) for key in NAMES))


@functools.cache
def terms_of_the_motion(is_attached: bool = False) -> dict[str, sp.Expr]:
    """D, C dq and g(q) of the arm, with or without the payload."""
    e = SmoothPlant().expressions
    D = e["mass_matrix"].subs(dict.fromkeys(DRIVES, 0))
    terms = (D[0, 0], D[0, 1], D[1, 1], *e["coriolis"], *e["gravity"])
    return {n: x.subs("attached", int(is_attached)) for n, x in zip(TERMS, terms, strict=True)}


def derivatives_by_time(
    expressions: Iterable[sp.Expr], rates: Mapping[str, sp.Expr]
) -> list[list[sp.Expr]]:
    """Terms of the derivatives of orders 1 and 2 of each expression, one per moving variable."""

    def terms(expression: sp.Expr) -> list[sp.Expr]:
        return [expression.diff(sp.Symbol(name)) * rate for name, rate in rates.items()]

    once = [terms(expression) for expression in expressions]
    return [row for first in once for row in (first, terms(sp.Add(*first)))]


def random_arm(source: random.Random) -> Values:
    """Parameters of the arm, none of them zero."""
    return {
        **{name: 10 ** source.uniform(*low_high) for name, low_high in DECADES.items()},
        "l1": source.uniform(0.1, 2.0),
        "lc1": source.uniform(0.05, 1.5),
        "a": source.choice((-1, 1)) * source.uniform(0.05, 1.5),
        "g": source.uniform(1.0, 25.0),
    }


DECADES = {"m1": (-1.0, 1.5), "m2": (-2.0, 1.5), "I1z": (-3.0, 1.0), "I2z": (-3.0, 1.0)}


@dataclass(frozen=True)
class Exact:
    """Exact value of a derivative, and the largest of what it could have been made of."""

    value: mpmath.mpf
    scale: mpmath.mpf

    def assert_is(self, actual: float, what: object) -> None:
        bound = max(abs(self.value) * mpmath.mpf("1e-11"), self.scale * mpmath.mpf("1e-14"))
        assert abs(mpmath.mpf(actual) - self.value) <= bound, (what, actual, self.value, self.scale)


class Model:
    """Every output and local in terms of parameters, inputs and states, with its derivatives."""

    def __init__(self) -> None:
        equations = derive()
        self.outputs = tuple(equations.outputs)
        self.accelerations = equations.accelerations
        arm = dict.fromkeys((*PAYLOAD, "attached", *plant.INPUTS[2:]), 0)
        arm |= dict(zip(ACCELERATIONS, equations.accelerations, strict=True))
        self.expressions = (
            equations.outputs
            | terms_of_the_motion()
            | dict(zip(LOADS, loads_by_newton().subs(arm), strict=True))
        )

    @cached_property
    def _jacobian(self) -> Callable[..., list]:
        rows = sp.Matrix(list(self.expressions.values())).jacobian(sp.symbols(KNOWNS))
        return sp.lambdify(sp.symbols(KNOWNS), rows, "mpmath", cse=True)

    def jacobian(self, at: Values, knowns: tuple[str, ...]) -> dict[tuple[str, str], Exact]:
        """Derivatives of every output and local with respect to `knowns`, by their names."""
        rows = self._jacobian(*(mpmath.mpf(at[name]) for name in KNOWNS))
        exact = {}
        for i, unknown in enumerate(self.expressions):
            row = {known: rows[i, KNOWNS.index(known)] for known in knowns}
            scale = max(abs(entry) for entry in row.values())
            exact |= {(unknown, known): Exact(entry, scale) for known, entry in row.items()}
        return exact

    @cached_property
    def _along_the_motion(self) -> Callable[..., list]:
        """Terms of the derivatives of orders 1 and 2 of each output."""
        rates = {
            **dict(zip(STATES, (*sp.symbols(STATES[2:]), *self.accelerations), strict=True)),
            **dict(zip(INPUTS, sp.symbols(INPUT_RATES[0]), strict=True)),
            **dict(zip(INPUT_RATES[0], sp.symbols(INPUT_RATES[1]), strict=True)),
        }
        rows = derivatives_by_time((self.expressions[name] for name in self.outputs), rates)
        names = (*KNOWNS, *INPUT_RATES[0], *INPUT_RATES[1])
        return sp.lambdify(sp.symbols(names), rows, "mpmath", cse=True)

    def along_the_motion(self, at: Values, rates: list[list]) -> dict[tuple[str, int], Exact]:
        """Derivatives of every output with respect to time, by name and order.

        `rates`: derivatives of (tau1, f2) of order 1, then 2.
        """
        arguments = (*(mpmath.mpf(at[name]) for name in KNOWNS), *rates[0], *rates[1])
        rows = iter(self._along_the_motion(*arguments))
        return {
            (name, order): Exact(mpmath.fsum(row), max(abs(term) for term in row))
            for name in self.outputs
            for order, row in zip((1, 2), itertools.islice(rows, 2), strict=True)
        }
