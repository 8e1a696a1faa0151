"""The arm in sympy, from positions: values and exact derivatives of every output and local.

Shares nothing with the C code: equations of motion and outputs are those of make_references.py,
local variables are derived here. Evaluated with 40 digits.
"""

import importlib.util
import itertools
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import mpmath
import sympy as sp

from tests.support.instances import INPUTS, STATES
from tests.support.paths import ROOT

SCRIPT = ROOT / "models" / "rp_manipulator" / "references" / "make_references.py"
PARAMETERS = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
KNOWNS = (*PARAMETERS, *INPUTS, *STATES)
TERMS = ("D11", "D12", "D22", "coriolis1", "coriolis2", "gravity1", "gravity2")
# derivatives of the inputs with respect to time: orders 1 and 2
INPUT_RATES = (("tau1_rate", "f2_rate"), ("tau1_bend", "f2_bend"))

mpmath.mp.dps = 40

Values = dict[str, float]


def cross(u: sp.Matrix, v: sp.Matrix) -> sp.Expr:
    """Component out of the plane."""
    return u[0] * v[1] - u[1] * v[0]


def terms_of_the_motion(outputs: dict[str, sp.Expr]) -> dict[str, sp.Expr]:
    """D, C dq and g(q), by differentiation of the energies."""
    kinetic = sp.Matrix([outputs["kinetic_energy"]])
    potential = sp.Matrix([outputs["potential_energy"]])
    q, dq = sp.Matrix(sp.symbols(STATES[:2])), sp.Matrix(sp.symbols(STATES[2:]))
    momenta = kinetic.jacobian(dq).T
    inertia = momenta.jacobian(dq)
    coriolis = momenta.jacobian(q) * dq - kinetic.jacobian(q).T
    gravity = potential.jacobian(q)
    return dict(
        zip(TERMS, (inertia[0, 0], inertia[0, 1], inertia[1, 1], *coriolis, *gravity), strict=True)
    )


def loads_by_newton(accelerations: tuple[sp.Expr, sp.Expr]) -> dict[str, sp.Expr]:
    """Forces and moments in the joints that give both links the motion that they have.

    Newton's and Euler's laws in frame 0, from twice differentiated positions; a force on link 2
    acts at the end of link 1.
    """
    m1, m2, I1z, I2z, l1, lc1, a, g = sp.symbols(PARAMETERS)
    t = sp.Symbol("t")
    angle, slide = sp.Function("angle")(t), sp.Function("slide")(t)
    along = sp.Matrix([sp.cos(angle), sp.sin(angle)])
    across = sp.Matrix([-sp.sin(angle), sp.cos(angle)])
    center1, end1 = lc1 * along, l1 * along + a * across
    center2 = end1 + slide * along
    weightless = sp.Matrix([0, g])

    force2 = m2 * (center2.diff(t, 2) + weightless)
    force1 = force2 + m1 * (center1.diff(t, 2) + weightless)
    moment2 = I2z * angle.diff(t, 2) + cross(center2 - end1, force2)
    moment1 = (
        I1z * angle.diff(t, 2) + moment2 + cross(center1, force1) + cross(end1 - center1, force2)
    )
    loads = {
        "f1_x": across.dot(force1),
        "f1_z": along.dot(force1),
        "tau1_y": moment1,
        "f2_x": across.dot(force2),
        "f2_z": along.dot(force2),
        "tau2_y": moment2,
    }
    q, dq = sp.symbols(STATES[:2]), sp.symbols(STATES[2:])
    plain = [
        *zip((angle.diff(t, 2), slide.diff(t, 2)), accelerations, strict=True),
        *zip((angle.diff(t), slide.diff(t)), dq, strict=True),
        *zip((angle, slide), q, strict=True),
    ]
    return {name: load.subs(plain) for name, load in loads.items()}


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
        spec = importlib.util.spec_from_file_location("make_references", SCRIPT)
        maker = importlib.util.module_from_spec(spec)
        sys.modules.setdefault(spec.name, maker)
        spec.loader.exec_module(maker)
        equations = maker.derive()
        self.outputs = tuple(equations.outputs)
        self.accelerations = equations.accelerations
        self.expressions = (
            equations.outputs
            | terms_of_the_motion(equations.outputs)
            | loads_by_newton(equations.accelerations)
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
        """Terms of the derivatives of orders 1 and 2 of each output, one per moving variable."""
        rates = {
            **dict(zip(STATES, (*sp.symbols(STATES[2:]), *self.accelerations), strict=True)),
            **dict(zip(INPUTS, sp.symbols(INPUT_RATES[0]), strict=True)),
            **dict(zip(INPUT_RATES[0], sp.symbols(INPUT_RATES[1]), strict=True)),
        }

        def terms(expression: sp.Expr) -> list[sp.Expr]:
            return [expression.diff(sp.Symbol(name)) * rate for name, rate in rates.items()]

        rows = []
        for name in self.outputs:
            once = terms(self.expressions[name])
            rows += [once, terms(sp.Add(*once))]
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
