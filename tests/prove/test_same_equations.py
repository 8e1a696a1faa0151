"""The motion and the outputs in balls, and those of the checker, are what the plain equations say.

Each ball contains what the graph of the plain headers says, and is hardly wider than rounding makes
it.
"""

from __future__ import annotations

import random
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from flint import arb

from tests.prove.problems import COMPILE, SOURCES, motion_series, operands
from tests.support.paths import ROOT
from tests.support.plain_equations import (
    ACCELERATIONS,
    STATES,
    Place,
    PlainEquations,
    Sized,
    precision,
)

PLAIN = SOURCES.parent
PARAMETERS = [
    ("values", "parameters", x) for x in ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
]
EFFORTS = [("values", "tau", i) for i in (0, 1)]
ENERGIES = ("kinetic_energy", "potential_energy", "total_energy", "actuator_power")
OUTPUTS: list[Place] = [
    *ACCELERATIONS, *(("values", f"ee_{x}", i) for x in ("position", "velocity") for i in (0, 1)),
    *(("values", x) for x in ENERGIES),
]  # fmt: skip
ARMS = 200
LAST = 8  # order of the motion
WIDEST = 1e-25  # radius of a ball over the terms that it is calculated from
UNDERFLOW = 1e-200  # radius where they are 0


@pytest.fixture(autouse=True)
def orders() -> Iterator[None]:
    with precision(LAST):
        yield


# ---- Arms ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Arm:
    """A start in doubles. efforts: values at the start, then first to third derivatives."""

    states: tuple[float, ...]
    parameters: tuple[float, ...]
    efforts: tuple[tuple[float, ...], ...]

    @property
    def line(self) -> str:
        """The numbers as arm_values.c reads them."""
        numbers = (*self.states, *self.parameters, *self.efforts[0], *self.efforts[1])
        return " ".join(x.hex() for x in numbers) + "\n"

    @property
    def effort_series(self) -> list[list[arb]]:
        return [[arb(u) / arb.fac_ui(k) for k, u in enumerate(of)] for of in self.efforts]

    def leaf(self, place: Place) -> Sized:
        """What stands in struct rp_values; efforts are series."""
        if place in EFFORTS:
            return Sized.of(*self.effort_series[EFFORTS.index(place)])
        places = dict(zip((*STATES, *PARAMETERS), (*self.states, *self.parameters), strict=True))
        return Sized.of(places[place])

    def expected(self, plain: PlainEquations) -> list[tuple[arb, arb]]:
        """Orders 1 to LAST of the states and the outputs, each with the size of its terms."""
        motion = plain.motion(self.leaf, LAST).values()
        outputs = plain.values(OUTPUTS, self.leaf)
        orders = [(of.value[k], of.size[k]) for k in range(1, LAST + 1) for of in motion]
        return [*orders, *((of.value[0], of.size[0]) for of in outputs)]


def random_arm(draw: random.Random) -> Arm:
    """Of any size and with zeros; a may be negative, and the slide be behind the joint."""

    def number(exponents: int = 10) -> float:
        return operands.number(draw, exponents)

    m1, m2, I1z, I2z, lc1 = (abs(number(20)) for _ in range(5))
    parameters = (m1, m2 or 1.0, I1z, I2z or 1.0, abs(number(3)), lc1, number(4), number(4))
    angle = draw.choice((0.0, draw.uniform(-8.0, 8.0)))  # balls of sines grow with larger ones
    states = (angle, number(3), number(), number())
    efforts = tuple(tuple(number() for _ in range(4)) for _ in range(2))
    return Arm(states, parameters, efforts)


DRAW = random.Random(41)
RANDOM = [random_arm(DRAW) for _ in range(ARMS)]


# ---- The same equations in balls -----------------------------------------------------------------


def balls(program: Path) -> list[list[arb]]:
    """What the headers make of each arm; the program is compiled."""
    source = Path(__file__).with_name("arm_values.c")
    subprocess.run([*COMPILE, f"-I{SOURCES}", source, "-o", program, "-lm"], check=True)
    text = "".join(arm.line for arm in RANDOM)
    answer = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    found = []
    for line in answer.stdout.splitlines():
        words = [arb(float.fromhex(word)) for word in line.split()]
        parts = zip(words[::3], words[1::3], words[2::3], strict=True)
        found.append([hi + lo + radius * arb(0, 1) for hi, lo, radius in parts])
    return found


def of_checker(arm: Arm) -> list[arb]:
    """The same as `balls`, by motion_series.py."""
    states, parameters = ([arb(x) for x in of] for of in (arm.states, arm.parameters))
    polynomials = [[*of, *[arb(0)] * LAST] for of in arm.effort_series]
    series = motion_series.coefficients(states, parameters, polynomials, arb(1), LAST)
    motion = [row[k][0] for k in range(1, LAST + 1) for row in series]
    efforts = [u[0] for u in arm.effort_series]
    return [*motion, *motion_series.outputs(states, parameters, efforts)]


Expected = Sequence[Sequence[tuple[arb, arb]]]  # of each arm


def wrong(expected: Expected, found: Sequence[Sequence[arb]]) -> set[Place]:
    """Numbers whose ball does not contain what the graph says, or is too wide."""
    names = [(*name, k) for k in range(1, LAST + 1) for name in STATES] + OUTPUTS
    return {
        name
        for arm, own in zip(expected, found, strict=True)
        for name, (x, size), ball in zip(names, arm, own, strict=True)
        if not (ball.overlaps(x) and ball.rad() <= size * WIDEST + UNDERFLOW)
    }


@pytest.fixture(scope="module")
def expected() -> Expected:
    with precision(LAST):
        header, includes = PLAIN / "rp_calculated.h", [PLAIN, ROOT / "models"]
        plain = PlainEquations(header, includes, "rp_calculate")
        return [arm.expected(plain) for arm in RANDOM]


def test_balls_are_those_of_the_plain_equations(expected: Expected, tmp_path: Path) -> None:
    assert wrong(expected, balls(tmp_path / "values")) == set()


def test_so_are_those_of_the_checker(expected: Expected) -> None:
    assert wrong(expected, [of_checker(arm) for arm in RANDOM]) == set()
