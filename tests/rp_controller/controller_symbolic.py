"""The laws of RPController in sympy, with arm and payload from positions (rp_symbolic), and random
points."""

import functools
import itertools
import random
from collections.abc import Callable
from typing import NamedTuple

import mpmath
import sympy as sp

from tests.support.rp_symbolic import PARAMETERS as ARM
from tests.support.rp_symbolic import (
    PAYLOAD,
    Values,
    derivatives_by_time,
    random_arm,
    terms_of_the_motion,
)

MODES = {"pd": 1, "pd_gravity": 2, "computed_torque": 3}
LAW = ("Kp1", "Kp2", "Kd1", "Kd2", "Ki1", "Ki2", "inertia1", "inertia2", "tracking_time")
LIMITS = ("tau1_max", "f2_max")
PARAMETERS = (*ARM, *LAW, *LIMITS, *PAYLOAD)
REFERENCES = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
INPUTS = (*REFERENCES, "q1", "q2", "dq1", "dq2")
STATES = ("integral1", "integral2")
KNOWNS = (*PARAMETERS, *INPUTS, *STATES)
EFFORTS = ("tau1", "f2")
ERRORS = ("q1_error", "q2_error", "dq1_error", "dq2_error")
RATES = ("dintegral1", "dintegral2")
UNLIMITED = ("tau1_unlimited", "f2_unlimited")
UNKNOWNS = (*EFFORTS, *ERRORS, *RATES, *UNLIMITED)
INPUT_RATES = tuple(tuple(f"{name}_{order}" for name in INPUTS) for order in ("rate", "bend"))
FREE = (0, 0)
SIDES = ((0, 0), (1, 0), (0, -1), (-1, 1))  # per joint: free, at the upper or lower limit


class Case(NamedTuple):
    """Which of the laws it is."""

    mode: str
    sides: tuple[int, int] = FREE
    is_attached: bool = False  # the payload


CASES = [Case(*case) for case in itertools.product(MODES, SIDES, (False, True))]

# ---- The laws in sympy ---------------------------------------------------------------------------


@functools.cache
def law(case: Case) -> dict[str, sp.Expr]:
    """Every unknown, with each joint free or at the limit on the side that is given."""
    s = {name: sp.Symbol(name) for name in KNOWNS}
    arm = terms_of_the_motion(case.is_attached)
    e = [s[f"q{i}_ref"] - s[f"q{i}"] for i in (1, 2)]
    de = [s[f"dq{i}_ref"] - s[f"dq{i}"] for i in (1, 2)]
    v = [s[f"Kp{i}"] * e[i - 1] + s[f"Kd{i}"] * de[i - 1] + s[f"integral{i}"] for i in (1, 2)]
    inertia = [s["inertia1"], s["inertia2"]]
    gravity = sp.Matrix([arm["gravity1"], arm["gravity2"]])
    if case.mode == "computed_torque":
        mass = sp.Matrix([[arm["D11"], arm["D12"]], [arm["D12"], arm["D22"]]])
        asked = sp.Matrix([s["ddq1_ref"] + v[0], s["ddq2_ref"] + v[1]])
        unlimited = mass * asked + sp.Matrix([arm["coriolis1"], arm["coriolis2"]]) + gravity
    else:
        unlimited = sp.Matrix([inertia[0] * v[0], inertia[1] * v[1]])
        if case.mode == "pd_gravity":
            unlimited += gravity
    limit = [s[name] for name in LIMITS]
    effort = [case.sides[i] * limit[i] if case.sides[i] else unlimited[i] for i in (0, 1)]
    rates = [
        s[f"Ki{i + 1}"] * e[i] + (effort[i] - unlimited[i]) / (inertia[i] * s["tracking_time"])
        for i in (0, 1)
    ]
    return dict(zip(UNKNOWNS, (*effort, *e, *de, *rates, *unlimited), strict=True))


def compiled(names: tuple[str, ...], rows: list[list[sp.Expr]]) -> Callable[..., list]:
    return sp.lambdify(sp.symbols(names), rows, "mpmath", cse=True)


@functools.cache
def terms_of_values(case: Case) -> Callable[..., list]:
    return compiled(KNOWNS, [list(sp.expand(x).as_ordered_terms()) for x in law(case).values()])


@functools.cache
def jacobian(case: Case) -> Callable[..., list]:
    expressions = law(case).values()
    return compiled(KNOWNS, [[x.diff(sp.Symbol(k)) for k in KNOWNS] for x in expressions])


@functools.cache
def along_time(case: Case) -> Callable[..., list]:
    """Terms of the derivatives of orders 1 and 2 of each output."""
    expressions = law(case)
    rates = {
        **dict(zip(STATES, (expressions[name] for name in RATES), strict=True)),
        **dict(zip(INPUTS, sp.symbols(INPUT_RATES[0]), strict=True)),
        **dict(zip(INPUT_RATES[0], sp.symbols(INPUT_RATES[1]), strict=True)),
    }
    rows = derivatives_by_time((expressions[name] for name in (*EFFORTS, *ERRORS)), rates)
    return compiled((*KNOWNS, *INPUT_RATES[0], *INPUT_RATES[1]), rows)


def numbers(values: Values, names: tuple[str, ...]) -> list[mpmath.mpf]:
    return [mpmath.mpf(values[name]) for name in names]


def assert_close(actual: float, terms: list, bound: float, what: object) -> None:
    exact = mpmath.fsum(terms)
    scale = mpmath.fsum(abs(term) for term in terms)
    assert abs(mpmath.mpf(actual) - exact) <= bound * scale, (what, actual, exact, scale)


def random_point(source: random.Random) -> Values:
    """Parameters, inputs and states, none of them zero; the limits are still to be chosen."""

    def either(low: float, high: float) -> float:
        return source.choice((-1, 1)) * source.uniform(low, high)

    return dict(
        **random_arm(source),
        payload_mass=10 ** source.uniform(-2.0, 1.0),
        payload_inertia=10 ** source.uniform(-3.0, 0.0),
        payload_x=either(0.02, 0.5),
        payload_z=either(0.02, 0.5),
        **{name: 10 ** source.uniform(0.0, 3.0) for name in LAW[:6]},
        **{name: 10 ** source.uniform(-1.0, 1.0) for name in LAW[6:8]},
        tracking_time=10 ** source.uniform(-2.0, 1.0),
        **dict.fromkeys(LIMITS, 1.0),
        **{name: either(0.1, 3.0) for name in (*INPUTS, *STATES)},
    )


def generic_point(case: Case, seed: int) -> Values:
    """Draw a point at which each joint is free or at a limit as `case` says."""
    sides = case.sides
    free = case._replace(sides=FREE)
    source = random.Random(f"{case.mode} {sides} {seed}")
    while True:
        point = random_point(source)
        rows = terms_of_values(free)(*numbers(point, KNOWNS))
        asked = [float(mpmath.fsum(rows[UNKNOWNS.index(name)])) for name in UNLIMITED]
        if all(side * u >= 0.0 for side, u in zip(sides, asked, strict=True)):
            break
    for name, side, u in zip(LIMITS, sides, asked, strict=True):
        point[name] = abs(u) * (source.uniform(0.2, 0.9) if side else source.uniform(1.5, 5.0))
    return point
