"""Arm, plant, drives and controller in sympy, evaluated with 40 digits, at random points.

Shares nothing with the C code: equations of motion and outputs are those of the references, from
positions; joint loads are derived here by Newton's and Euler's laws. Tests compare values of the
arm (arm_expressions), the controller's laws (law), values of the plant and linear models
(ExactModel) with FMUs.
"""

import functools
import itertools
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mpmath
import numpy as np
import sympy as sp
from rparm.models.rp_manipulator.references.make_references import PARAMETERS, derive
from rparm.models.rp_plant.references import contacts
from rparm.models.rp_plant.references import equations as plant
from rparm.models.rp_plant.references.equations import ACCELERATIONS, PAYLOAD, STATES

from tests.support.instances import INPUTS

# ---- Arm and plant -------------------------------------------------------------------------------

KNOWNS = (*PARAMETERS, *INPUTS, *STATES)
TERMS = ("D11", "D12", "D22", "coriolis1", "coriolis2", "gravity1", "gravity2")
LOADS = ("f1_x", "f1_z", "tau1_y", "f2_x", "f2_z", "tau2_y")
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


@functools.cache
def terms_of_the_motion() -> dict[str, sp.Expr]:
    """D, C dq and g(q) of the plant, in NAMES."""
    e = equations_of_the_plant()
    q, dq = (sp.Matrix(sp.symbols(names)) for names in (STATES[:2], STATES[2:]))
    kinetic, potential = (sp.Matrix([e.outputs[f"{x}_energy"]]) for x in ("kinetic", "potential"))
    coriolis = (e.inertia * dq).jacobian(q) * dq - kinetic.jacobian(q).T
    D = e.inertia
    terms = (D[0, 0], D[0, 1], D[1, 1], *coriolis.expand(), *potential.jacobian(q).T)
    return dict(zip(TERMS, terms, strict=True))


def terms_of_the_arm(is_attached: bool = False) -> dict[str, sp.Expr]:
    """The same of the arm, with or without the payload."""
    known = dict.fromkeys(DRIVES, 0) | {"attached": int(is_attached)}
    return {name: term.subs(known) for name, term in terms_of_the_motion().items()}


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


def arm_expressions() -> dict[str, sp.Expr]:
    """Every output and local of the arm in terms of parameters, inputs and states."""
    equations = derive()
    arm = dict.fromkeys((*PAYLOAD, "attached", *plant.INPUTS[2:]), 0)
    arm |= dict(zip(ACCELERATIONS, equations.accelerations, strict=True))
    loads = dict(zip(LOADS, loads_by_newton().subs(arm), strict=True))
    return equations.outputs | terms_of_the_arm() | loads


# ---- The laws of RPController --------------------------------------------------------------------

LAWS = {"pd": 1, "pd_gravity": 2, "computed_torque": 3}
GAINS = ("Kp1", "Kp2", "Kd1", "Kd2", "Ki1", "Ki2", "inertia1", "inertia2", "tracking_time")
LIMITS = ("tau1_max", "f2_max")
CONTROLLER_PARAMETERS = (*PARAMETERS, *GAINS, *LIMITS, *PAYLOAD)
REFERENCES = ("q1_ref", "q2_ref", "dq1_ref", "dq2_ref", "ddq1_ref", "ddq2_ref")
CONTROLLER_INPUTS = (*REFERENCES, "q1", "q2", "dq1", "dq2")
INTEGRALS = ("integral1", "integral2")
CONTROLLER_KNOWNS = (*CONTROLLER_PARAMETERS, *CONTROLLER_INPUTS, *INTEGRALS)
EFFORTS = ("tau1", "f2")
ERRORS = ("q1_error", "q2_error", "dq1_error", "dq2_error")
RATES = ("dintegral1", "dintegral2")
UNLIMITED = ("tau1_unlimited", "f2_unlimited")
UNKNOWNS = (*EFFORTS, *ERRORS, *RATES, *UNLIMITED)
FREE = (0, 0)
SIDES = ((0, 0), (1, 0), (0, -1), (-1, 1))  # per joint: free, at the upper or lower limit


class Case(NamedTuple):
    """Which of the laws it is."""

    mode: str
    sides: tuple[int, int] = FREE
    is_attached: bool = False  # the payload


CASES = [Case(*case) for case in itertools.product(LAWS, SIDES, (False, True))]


@functools.cache
def law(case: Case) -> dict[str, sp.Expr]:
    """Every unknown, with each joint free or at the limit on the side that is given."""
    s = {name: sp.Symbol(name) for name in CONTROLLER_KNOWNS}
    arm = terms_of_the_arm(case.is_attached)
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


def compiled(names: tuple[str, ...], rows: list[list[sp.Expr]] | sp.Matrix) -> Callable:
    return sp.lambdify(sp.symbols(names), rows, "mpmath", cse=True)


@functools.cache
def terms_of_values(case: Case) -> Callable[..., list]:
    return compiled(
        CONTROLLER_KNOWNS, [list(sp.expand(x).as_ordered_terms()) for x in law(case).values()]
    )


@functools.cache
def law_jacobian(case: Case) -> Callable[..., list]:
    expressions = law(case).values()
    return compiled(
        CONTROLLER_KNOWNS, [[x.diff(sp.Symbol(k)) for k in CONTROLLER_KNOWNS] for x in expressions]
    )


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
        **{name: 10 ** source.uniform(0.0, 3.0) for name in GAINS[:6]},
        **{name: 10 ** source.uniform(-1.0, 1.0) for name in GAINS[6:8]},
        tracking_time=10 ** source.uniform(-2.0, 1.0),
        **dict.fromkeys(LIMITS, 1.0),
        **{name: either(0.1, 3.0) for name in (*CONTROLLER_INPUTS, *INTEGRALS)},
    )


def case_point(case: Case, seed: int) -> Values:
    """Draw a point at which each joint is free or at a limit as `case` says."""
    sides = case.sides
    free = case._replace(sides=FREE)
    source = random.Random(f"{case.mode} {sides} {seed}")
    while True:
        point = random_point(source)
        rows = terms_of_values(free)(*numbers(point, CONTROLLER_KNOWNS))
        asked = [float(mpmath.fsum(rows[UNKNOWNS.index(name)])) for name in UNLIMITED]
        if all(side * u >= 0.0 for side, u in zip(sides, asked, strict=True)):
            break
    for name, side, u in zip(LIMITS, sides, asked, strict=True):
        point[name] = abs(u) * (source.uniform(0.2, 0.9) if side else source.uniform(1.5, 5.0))
    return point


# ---- Linear models: equations differentiated by states and inputs --------------------------------

COMPLIANT, RIGID, NONE = 3, 2, 1  # items of stops


@dataclass(frozen=True)
class ExactModel:
    """Entries of A, B, C and D by names, (unknowns, knowns); unknowns are derivatives by states."""

    values: Values  # of the point, as the FMU takes them
    rates: Sequence[str]  # states whose derivatives are the first rows
    outputs: Sequence[str]  # the other rows
    knowns: Sequence[str]
    entries: np.ndarray


class PlantMode(NamedTuple):
    """Joints that are held, by a rigid stop or by friction, or pressed into compliant stops."""

    held: tuple[int, ...] = ()
    side: tuple[int, int] = (0, 0)
    is_rigid: bool = False


@functools.cache
def equations_of_the_plant() -> plant.Equations:
    return plant.derive()


@functools.cache
def loads_of_the_plant() -> dict[str, sp.Expr]:
    return dict(zip(LOADS, loads_by_newton(), strict=True))


def pushes(mode: PlantMode) -> sp.Matrix:
    """Forces of the compliant stops, (2,)."""
    return sp.Matrix([contacts.force(i, mode.side[i - 1]) for i in (1, 2)])


@functools.cache
def motion_of_the_plant(mode: PlantMode) -> sp.Matrix:
    """Accelerations of both joints, (2,)."""
    e = equations_of_the_plant()
    right, D = e.forces - e.friction + pushes(mode), e.inertia
    free = [i for i in (0, 1) if i not in mode.held]
    motion = sp.zeros(2, 1)
    if len(free) == 2:
        determinant = D[0, 0] * D[1, 1] - D[0, 1] ** 2
        motion[0] = (D[1, 1] * right[0] - D[0, 1] * right[1]) / determinant
        motion[1] = (D[0, 0] * right[1] - D[0, 1] * right[0]) / determinant
    elif free:
        motion[free[0]] = right[free[0]] / D[free[0], free[0]]
    return motion


@functools.cache
def outputs_of_the_plant(mode: PlantMode) -> dict[str, sp.Expr]:
    """Outputs whose derivatives are compared, by states and accelerations."""
    e = equations_of_the_plant()
    outputs = dict(e.outputs)
    for i in (1, 2):
        if mode.side[i - 1]:
            depth = contacts.penetration(i, mode.side[i - 1])
            spring = sp.Symbol(f"stop_stiffness{i}") * depth**2 / 2
            for name in ("potential_energy", "total_energy"):
                outputs[name] = outputs[name] + spring
            outputs[f"stop_force{i}"] = pushes(mode)[i - 1]
        if i - 1 not in mode.held:
            outputs[f"friction{i}"] = e.friction[i - 1]
    return outputs


@functools.cache
def entries_of_the_plant(mode: PlantMode) -> Callable:
    motion = motion_of_the_plant(mode)
    rows = sp.Matrix([*sp.symbols(STATES[2:]), *motion, *outputs_of_the_plant(mode).values()])
    knowns = sp.symbols((*STATES, *plant.INPUTS))
    # the chain rule keeps the expressions short
    by_motion = rows.jacobian(sp.symbols(ACCELERATIONS))
    return of_the_plant(mode, rows.jacobian(knowns) + by_motion * motion.jacobian(knowns))


@functools.cache
def values_of_the_plant(mode: PlantMode) -> tuple[tuple[str, ...], Callable]:
    """Names of outputs and locals, and their values."""
    e = equations_of_the_plant()
    values = outputs_of_the_plant(mode) | terms_of_the_motion() | loads_of_the_plant()
    reaction = e.forces + pushes(mode) - e.inertia * sp.Matrix(sp.symbols(ACCELERATIONS))
    for i in mode.held:
        values[f"friction{i + 1}"] = e.breakaway[i] if mode.is_rigid else reaction[i]
        values[f"stop_force{i + 1}"] = e.breakaway[i] - reaction[i] if mode.is_rigid else sp.S.Zero
    return tuple(values), of_the_plant(mode, sp.Matrix([*values.values()]))


STOPS = tuple(f"{side}{i}" for side in ("lower", "upper") for i in (1, 2)) + contacts.PARAMETERS
PLANT_MODES = ("sliding", "held 1", "held 2", "both held", "rigid stop", "compliant stops")


PLANT_NUMBERS = (*plant.PARAMETERS, *STOPS, *STATES, *plant.INPUTS, *plant.SWITCHES)


def of_the_plant(mode: PlantMode, rows: sp.Matrix) -> Callable[..., sp.Matrix]:
    """Function of PLANT_NUMBERS, of expressions in them and in the accelerations."""
    motion = compiled(PLANT_NUMBERS, motion_of_the_plant(mode))
    function = compiled((*PLANT_NUMBERS, *ACCELERATIONS), rows)
    return lambda *numbers: function(*numbers, *motion(*numbers))


def random_plant(kind: str, seed: int) -> tuple[PlantMode, Values, list[mpmath.mpf]]:
    """Mode, values as the FMU takes them, and PLANT_NUMBERS.

    With friction, damping and sometimes a payload.
    """
    source = random.Random(f"{kind} {seed}")
    values: Values = dict(random_arm(source))
    for i in (1, 2):
        coulomb = source.uniform(0.5, 2.0)
        values |= {
            f"armature{i}": source.uniform(0.05, 0.5),
            f"damping{i}": source.uniform(0.1, 2.0),
            f"coulomb_friction{i}": coulomb,
            f"breakaway_friction{i}": coulomb * source.uniform(1.1, 2.0),
            f"stribeck_velocity{i}": source.uniform(0.1, 1.0),
            f"q{i}": source.uniform(-2.0, 2.0),
            f"dq{i}": source.choice((-1, 1)) * source.uniform(0.1, 2.0),
        }
    values |= {name: source.uniform(-5.0, 5.0) for name in plant.INPUTS}
    values |= {name: source.uniform(0.05, 0.5) for name in PAYLOAD}
    switches = {"payload_attached": source.random() < 0.5}
    held = {"held 1": (0,), "held 2": (1,), "both held": (0, 1), "rigid stop": (1,)}.get(kind, ())
    side = (0, 0)
    for i in held:
        values[f"dq{i + 1}"] = 0.0
        if kind != "rigid stop":
            values[f"breakaway_friction{i + 1}"] = 1e5
    if kind == "rigid stop":
        values |= {"upper2": values["q2"], "lower2": values["q2"] - 1.0, "f2": 1e5}
        switches["stops2"] = RIGID
    if kind == "compliant stops":
        side = (source.choice((-1, 1)), source.choice((-1, 1)))
        for i in (1, 2):
            into = values[f"q{i}"] + side[i - 1] * source.uniform(0.01, 0.2)
            lower = into if side[i - 1] > 0 else into - 1.0
            switches[f"stops{i}"] = COMPLIANT
            values |= {f"lower{i}": lower, f"upper{i}": lower + 1.0}
            values[f"stop_stiffness{i}"] = 10 ** source.uniform(1.0, 3.0)
            values[f"stop_damping{i}"] = source.uniform(0.01, 0.2)
    numbers = plant.prepared(values)
    numbers |= {name: values.get(name, 0.0) for name in (*STOPS, *STATES, *plant.INPUTS)}
    numbers |= {f"direction{i}": float(np.sign(values[f"dq{i}"])) for i in (1, 2)}
    numbers["attached"] = float(switches["payload_attached"])
    mode = PlantMode(held, side, kind == "rigid stop")
    return mode, values | switches, [mpmath.mpf(numbers[name]) for name in PLANT_NUMBERS]


def plant_point(kind: str, seed: int) -> ExactModel:
    """The linear model of the plant in a mode."""
    mode, values, numbers = random_plant(kind, seed)
    entries = entries_of_the_plant(mode)(*numbers).tolist()
    knowns = (*STATES, *plant.INPUTS)
    return exact_model(values, STATES, tuple(outputs_of_the_plant(mode)), knowns, entries)


def plant_values(kind: str, seed: int) -> tuple[Values, Values]:
    """What is given to the plant, and its outputs and locals there."""
    mode, values, numbers = random_plant(kind, seed)
    names, function = values_of_the_plant(mode)
    return values, dict(zip(names, map(float, function(*numbers)), strict=True))


def drives_point(seed: int) -> ExactModel:
    """Two drives, whose currents follow the command or are at a limit."""
    source = random.Random(f"drives {seed}")
    values: Values = {}
    rows: dict[str, dict[str, float]] = {}
    for i, (command, effort) in enumerate((("tau1_cmd", "tau1"), ("f2_cmd", "f2")), start=1):
        limit = source.choice(("command", "current", "voltage"))
        k, n, r, t = (source.uniform(0.5, 2.0) for _ in range(4))
        values |= {
            f"torque_constant{i}": k,
            f"gear_ratio{i}": n,
            f"resistance{i}": r,
            f"time_constant{i}": t,
            f"current_max{i}": 1e4 if limit == "voltage" else 32.0,
            f"voltage_max{i}": 1e5 if limit == "current" else 128.0,
            command: source.uniform(0.5, 2.0) * (1 if limit == "command" else 1e6),
            f"dq{i}": source.uniform(-2.0, 2.0),
            f"current{i}": source.uniform(-2.0, 2.0),
        }
        followed = {
            "command": {command: 1 / (n * k * t)},
            "current": {},
            "voltage": {f"dq{i}": -n * k / (r * t)},
        }[limit]
        rows[f"current{i}'"] = {f"current{i}": -1 / t} | followed
        rows[effort] = {f"current{i}": n * k}
        rows[f"current{i}"] = {f"current{i}": 1.0}
        rows[f"voltage{i}"] = {f"current{i}": r, f"dq{i}": n * k}
    knowns = ("current1", "current2", "tau1_cmd", "f2_cmd", "dq1", "dq2")
    outputs = ("tau1", "f2", "current1", "current2", "voltage1", "voltage2")
    names = ("current1'", "current2'", *outputs)
    entries = [[rows[name].get(known, 0.0) for known in knowns] for name in names]
    return exact_model(values, ("current1", "current2"), outputs, knowns, entries)


def controller_point(seed: int) -> ExactModel:
    """The controller in one of its laws, free or at a limit."""
    case = CASES[seed % len(CASES)]
    values = case_point(case, seed)
    rows = law_jacobian(case)(*numbers(values, CONTROLLER_KNOWNS))
    knowns = (*INTEGRALS, *CONTROLLER_INPUTS)
    outputs = (*EFFORTS, *ERRORS)
    columns = [CONTROLLER_KNOWNS.index(name) for name in knowns]
    kept = [UNKNOWNS.index(name) for name in (*RATES, *outputs)]
    entries = [[rows[i][j] for j in columns] for i in kept]
    given = {"mode": LAWS[case.mode], "payload_attached": case.is_attached}
    return exact_model(values | given, INTEGRALS, outputs, knowns, entries)


def exact_model(
    values: Mapping[str, float],
    rates: Sequence[str],
    outputs: Sequence[str],
    knowns: Sequence[str],
    entries: Sequence[Sequence],
) -> ExactModel:
    numbers = np.array([[float(x) for x in row] for row in entries])
    return ExactModel(dict(values), tuple(rates), tuple(outputs), tuple(knowns), numbers)
