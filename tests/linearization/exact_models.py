"""Exact linear models of arm, plant, drives and controller at random points, from sympy.

Equations are those of the references, from positions; here they are differentiated by states and
inputs, and evaluated with 40 digits. Nothing is shared with the FMUs.
"""

import functools
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
import sympy as sp
from rparm.models.rp_plant.references import contacts
from rparm.models.rp_plant.references import equations as plant
from rparm.models.rp_plant.references.equations import ACCELERATIONS, PAYLOAD, STATES

from tests.rp_controller import controller_symbolic as controller
from tests.support.rp_symbolic import random_arm

Values = dict[str, float]
COMPLIANT, RIGID, NONE = 3, 2, 1  # items of stops


@dataclass(frozen=True)
class Exact:
    """Entries of A, B, C and D by names, (unknowns, knowns); unknowns are derivatives by states."""

    values: Values  # of the point, as the FMU takes them
    rates: Sequence[str]  # states whose derivatives are the first rows
    outputs: Sequence[str]  # the other rows
    knowns: Sequence[str]
    entries: np.ndarray


# ---- Arm and plant -------------------------------------------------------------------------------


@functools.cache
def _plant(held: tuple[int, ...], side: tuple[int, int]) -> tuple[tuple[str, ...], Callable]:
    """Names of outputs; all rows by numbers, with these joints held and pressed into stops."""
    e = plant.derive()
    dq = sp.symbols(STATES[2:])
    pushes = [contacts.force(i, side[i - 1]) for i in (1, 2)]
    right = e.forces - e.friction + sp.Matrix(pushes)
    free = [i for i in (0, 1) if i not in held]
    D = e.inertia
    motion = sp.zeros(2, 1)
    if len(free) == 2:
        determinant = D[0, 0] * D[1, 1] - D[0, 1] ** 2
        motion[0] = (D[1, 1] * right[0] - D[0, 1] * right[1]) / determinant
        motion[1] = (D[0, 0] * right[1] - D[0, 1] * right[0]) / determinant
    elif free:
        motion[free[0]] = right[free[0]] / D[free[0], free[0]]
    outputs = dict(e.outputs)
    for i in (1, 2):
        if side[i - 1]:
            depth = contacts.penetration(i, side[i - 1])
            spring = sp.Symbol(f"stop_stiffness{i}") * depth**2 / 2
            for name in ("potential_energy", "total_energy"):
                outputs[name] = outputs[name] + spring
            outputs[f"stop_force{i}"] = pushes[i - 1]
        if i - 1 not in held:
            outputs[f"friction{i}"] = e.friction[i - 1]
    knowns = sp.symbols((*STATES, *plant.INPUTS))
    rows = sp.Matrix([*dq, *motion, *outputs.values()])
    accelerations = dict(zip(sp.symbols(ACCELERATIONS), motion, strict=True))
    # the chain rule keeps the expressions short
    inner = sp.symbols(ACCELERATIONS)
    by_motion = rows.jacobian(inner)
    whole = rows.jacobian(knowns) + by_motion * motion.jacobian(knowns)
    still = dict.fromkeys([dq[i] for i in held], 0)
    names = (*plant.PARAMETERS, *_STOPS, *STATES, *plant.INPUTS, *plant.SWITCHES)
    chosen = whole.subs(accelerations).subs(still)
    return tuple(outputs), sp.lambdify(sp.symbols(names), chosen, "mpmath", cse=True)


_STOPS = tuple(f"{side}{i}" for side in ("lower", "upper") for i in (1, 2)) + contacts.PARAMETERS
MODES = ("sliding", "held 1", "held 2", "both held", "rigid stop", "compliant stops")


def plant_point(mode: str, seed: int) -> Exact:
    """The plant in a mode, with friction, damping and sometimes a payload."""
    source = random.Random(f"{mode} {seed}")
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
    held = {"held 1": (0,), "held 2": (1,), "both held": (0, 1), "rigid stop": (1,)}.get(mode, ())
    side = (0, 0)
    for i in held:
        values[f"dq{i + 1}"] = 0.0
        if mode != "rigid stop":
            values[f"breakaway_friction{i + 1}"] = 1e5
    if mode == "rigid stop":
        values |= {"upper2": values["q2"], "lower2": values["q2"] - 1.0, "f2": 1e5}
        switches["stops2"] = RIGID
    if mode == "compliant stops":
        side = (source.choice((-1, 1)), source.choice((-1, 1)))
        for i in (1, 2):
            into = values[f"q{i}"] + side[i - 1] * source.uniform(0.01, 0.2)
            lower = into if side[i - 1] > 0 else into - 1.0
            switches[f"stops{i}"] = COMPLIANT
            values |= {f"lower{i}": lower, f"upper{i}": lower + 1.0}
            values[f"stop_stiffness{i}"] = 10 ** source.uniform(1.0, 3.0)
            values[f"stop_damping{i}"] = source.uniform(0.01, 0.2)
    outputs, function = _plant(held, side)
    numbers = plant.prepared(values | dict.fromkeys([], 0.0))
    numbers |= {name: values.get(name, 0.0) for name in (*_STOPS, *STATES, *plant.INPUTS)}
    numbers |= {f"direction{i}": float(np.sign(values[f"dq{i}"])) for i in (1, 2)}
    numbers["attached"] = float(switches["payload_attached"])
    names = (*plant.PARAMETERS, *_STOPS, *STATES, *plant.INPUTS, *plant.SWITCHES)
    entries = function(*(mpmath.mpf(numbers[name]) for name in names))
    return _exact(values | switches, STATES, outputs, (*STATES, *plant.INPUTS), entries.tolist())


def arm_point(seed: int) -> Exact:
    """The arm: the plant without anything that it has besides."""
    source = random.Random(f"arm {seed}")
    values = dict(random_arm(source))
    values |= {name: source.uniform(-2.0, 2.0) for name in STATES}
    values |= {"tau1": source.uniform(-9.0, 9.0), "f2": source.uniform(-9.0, 9.0)}
    outputs, function = _plant((), (0, 0))
    names = (*plant.PARAMETERS, *_STOPS, *STATES, *plant.INPUTS, *plant.SWITCHES)
    ones = dict.fromkeys(("stribeck_velocity1", "stribeck_velocity2"), 1.0)
    numbers = dict.fromkeys(names, 0.0) | ones | values
    entries = function(*(mpmath.mpf(numbers[name]) for name in names)).tolist()
    knowns = (*STATES, "tau1", "f2")
    kept = [i for i, name in enumerate((*STATES, *plant.INPUTS)) if name in knowns]
    own = [name for name in outputs if name not in ("ee_angle", "ee_rate", "ee_ax", "ee_ay")]
    own = [name for name in own if not name.startswith("friction")]
    rows = [*range(4), *(4 + outputs.index(name) for name in own)]
    return _exact(values, STATES, own, knowns, [[entries[i][j] for j in kept] for i in rows])


# ---- Drives and controller -----------------------------------------------------------------------


def drives_point(seed: int) -> Exact:
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
    return _exact(values, ("current1", "current2"), outputs, knowns, entries)


def controller_point(seed: int) -> Exact:
    """The controller in one of its laws, free or at a limit."""
    case = controller.CASES[seed % len(controller.CASES)]
    values = controller.generic_point(case, seed)
    rows = controller.jacobian(case)(*controller.numbers(values, controller.KNOWNS))
    knowns = (*controller.STATES, *controller.INPUTS)
    outputs = (*controller.EFFORTS, *controller.ERRORS)
    columns = [controller.KNOWNS.index(name) for name in knowns]
    kept = [controller.UNKNOWNS.index(name) for name in (*controller.RATES, *outputs)]
    entries = [[rows[i][j] for j in columns] for i in kept]
    given = {"mode": controller.MODES[case.mode], "payload_attached": case.is_attached}
    return _exact(values | given, controller.STATES, outputs, knowns, entries)


def _exact(
    values: Mapping[str, float],
    rates: Sequence[str],
    outputs: Sequence[str],
    knowns: Sequence[str],
    entries: Sequence[Sequence],
) -> Exact:
    numbers = np.array([[float(x) for x in row] for row in entries])
    return Exact(dict(values), tuple(rates), tuple(outputs), tuple(knowns), numbers)
