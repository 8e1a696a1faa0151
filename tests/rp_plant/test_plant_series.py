"""The series of the plant, and so of the arm, are those of the plain equations, in all orders.

The generator's front end reads the plain text into a graph. Picard's iteration in it, in 200 bits,
gives the coefficients that the recurrences in C have to give but for rounding.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import product
from typing import Any

import numpy as np
import pytest

from tests.rp_plant.plant_in_c import (
    ATTACHED,
    COMPLIANT,
    FREE,
    NONE,
    RELEASED,
    STUCK,
    PlantInC,
)
from tests.support.model_calls import series
from tests.support.plain_equations import (
    STATES,
    Place,
    PlainEquations,
    Sized,
    along,
    precision,
)

FEATURES = ("armature", "damping", "breakaway", "contact", "payload")
INPUTS = [("tau", 0), ("tau", 1), ("wrench", 0), ("wrench", 1), ("wrench", 2)]
DEGREE = 3  # of inputs
ORDER = 20
ROUNDINGS = 8 * 2**-52  # of a coefficient's terms, for each order
EACH = 12  # plants for each pair of modes


@pytest.fixture(autouse=True)
def orders() -> Iterator[None]:
    with precision(ORDER):
        yield


# ---- Plants --------------------------------------------------------------------------------------


def some(draw: random.Random, high: float) -> float:
    """Return 0 in one draw of four."""
    return draw.choice((0.0, 1.0, 1.0, 1.0)) * draw.uniform(0.0, high)


def random_plant(plant: Any, draw: random.Random, joints: Sequence[int]) -> Any:
    """Any size, with few features or with most; friction is there, if only Coulomb's."""
    p, modes, share = plant.parameters, plant.modes, draw.choice((0.2, 0.8))
    has = {feature: draw.random() < share for feature in FEATURES}
    for name in ("m1", "m2", "I1z", "I2z"):
        setattr(p.arm, name, 10.0 ** draw.uniform(-2.0, 1.5))
    p.arm.l1, p.arm.lc1 = some(draw, 2.0), some(draw, 2.0)
    p.arm.a, p.arm.g = draw.uniform(-1.5, 1.5), draw.uniform(-20.0, 20.0)
    plant.q[:] = draw.uniform(-3.2, 3.2), draw.uniform(-3.0, 2.0)
    modes.payload = ATTACHED if has["payload"] else RELEASED
    p.payload_mass, p.payload_inertia = some(draw, 4.0), some(draw, 1.0)
    p.payload_x, p.payload_z = draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5)
    for i, mode in enumerate(joints):
        modes.joint[i] = mode
        p.stops[i] = NONE
        p.coulomb_friction[i] = draw.uniform(0.1, 5.0)
        speed = draw.uniform(0.0, 5.0)
        p.armature[i] = has["armature"] * some(draw, 2.0)
        p.damping[i] = has["damping"] * some(draw, 3.0)
        if has["breakaway"]:  # of a joint that is fast, or not nearly so
            p.breakaway_friction[i] = p.coulomb_friction[i] + draw.uniform(0.125, 5.0)
            p.stribeck_velocity[i] = speed / draw.choice((draw.uniform(0.1, 6.9), 11.0))
        if has["contact"] and draw.random() < 0.5:
            touch(plant, i, draw)
        # a joint that has turned back is beyond an event; a stuck one may turn for an instant
        plant.dq[i] = speed * (mode if abs(mode) == 1 else draw.choice((-1, 0, 1)))
    return plant


def touch(plant: Any, i: int, draw: random.Random) -> None:
    """Put a joint into a compliant stop, which pushes or has let go, or between two."""
    p, contact, depth = plant.parameters, draw.randint(-2, 2), draw.uniform(0.0, 0.25)
    p.stops[i], plant.modes.contact[i] = COMPLIANT, contact
    p.stop_stiffness[i], p.stop_damping[i] = draw.uniform(1.0, 500.0), some(draw, 2.0)
    p.lower[i] = plant.q[i] + (depth if contact > 0 else -1.0)
    p.upper[i] = plant.q[i] - (depth if contact < 0 else -1.0)


Inputs = Sequence[Sequence[float]]


def random_inputs(draw: random.Random, scale: float) -> Inputs:
    """Polynomials of the inputs, in units of the time scale; there is no wrench in some draws."""
    ends = [50.0, 50.0, *[draw.choice((0.0, 20.0))] * 3]
    return [[draw.uniform(-end, end) * scale**k for k in range(DEGREE + 1)] for end in ends]


# ---- Series --------------------------------------------------------------------------------------


def indicators(plant: Any) -> list[int]:
    """Numbers of those that a stuck joint has."""
    return [4 * i + side for i in (0, 1) if plant.modes.joint[i] == STUCK for side in (0, 1)]


def exact(plain: PlainEquations, plant: Any, scale: float, inputs: Inputs) -> list[Sized]:
    """Series of the states and of the indicators."""

    def part(at: Any, name: str | int) -> Any:
        return at[name] if isinstance(name, int) else getattr(at, name)

    def leaf(place: Place) -> Sized:
        _, *path = place
        if path[0] == "inputs":
            return Sized.of(*inputs[INPUTS.index((path[1], path[2]))])
        return Sized.of(reduce(part, path, plant))

    motion = plain.motion(leaf, ORDER, scale)
    followed = [("values", "indicators", i) for i in indicators(plant)]
    return [*motion.values(), *plain.values(followed, along(motion, leaf))]


def in_parts(in_c: PlantInC, plant: Any, scale: float, inputs: Inputs) -> list[list[float]]:
    """The same as `exact` from the libraries of the build, in two parts."""
    rows = series(in_c.words, np.frombuffer(plant), np.array(inputs), np.nan, (7, ORDER), scale)
    followed = [in_c.row_of_indicator[i] for i in indicators(plant)]
    return [rows[i][: ORDER + 1].tolist() for i in (*range(len(STATES)), *followed)]


@pytest.mark.parametrize("joints", [*product((-1, STUCK, 1, FREE), repeat=2)], ids=str)
def test_coefficients_are_those_of_the_plain_equations(
    plant_in_c: PlantInC, joints: Sequence[int]
) -> None:
    draw = random.Random(str(joints))
    for _ in range(EACH):
        plant, scale = random_plant(plant_in_c.plant(), draw, joints), 2.0 ** draw.randint(-10, 0)
        given = plant, scale, random_inputs(draw, scale)
        rows = zip(exact(plant_in_c.plain, *given), in_parts(plant_in_c, *given), strict=True)
        for i, (expected, found) in enumerate(rows):
            for k, x in enumerate(found):
                bound = ROUNDINGS * max(k, 1) * expected.size[k]
                assert abs(expected.value[k] - x) <= bound, f"row {i}, order {k}"
