"""The motion and the outputs in balls, and those of the checker, are what the plain equations say.

The generator's front end reads the plain headers into a graph. It is evaluated here in arb's
intervals: outputs and rates as they are, and the motion by Picard's iteration. Each ball contains
what the graph says, and is hardly wider than rounding makes it.
"""

from __future__ import annotations

import operator
import random
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import methodcaller
from pathlib import Path
from typing import Any

import flint
import pytest
from flint import arb, arb_series

from rparm.expressions.expression import in_order
from tests.prove.faults import COMPILE, Fault
from tests.prove.problems import SOURCES, motion_series
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
import operands  # noqa: E402
from equations.graph import Graph, Value  # noqa: E402
from plain_c.interpreter import Interpreter  # noqa: E402
from plain_c.text import read  # noqa: E402

PLAIN = SOURCES.parent
PARAMETERS = tuple(f"parameters.{x}" for x in ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g"))
STATES = ("q.0", "q.1", "dq.0", "dq.1")
EFFORTS = ("tau.0", "tau.1")
OUTPUTS = (
    "ddq.0", "ddq.1", "ee_position.0", "ee_position.1", "ee_velocity.0", "ee_velocity.1",
    "kinetic_energy", "potential_energy", "total_energy", "actuator_power",
)  # fmt: skip
BITS = 200
ARMS = 200
LAST = 4  # order of the motion
WIDEST = 1e-25  # radius of a ball over the terms that it is calculated from
UNDERFLOW = 1e-200  # radius where they are 0
OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "negative": operator.neg, "sin": methodcaller("sin"), "cos": methodcaller("cos"),
}  # fmt: skip


@pytest.fixture(autouse=True)
def precision() -> Iterator[None]:
    before = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = BITS, LAST + 1
    yield
    flint.ctx.prec, flint.ctx.cap = before


# ---- The plain equations -------------------------------------------------------------------------


@dataclass(frozen=True)
class Equations:
    """Values of the graph, whose leaves are fields of struct rp_values."""

    rates: list[Value]
    outputs: list[Value]


def equations(folder: Path) -> Equations:
    """What the plain headers in a folder say."""
    program = read(folder / "rp_calculated.h", [folder, ROOT / "models"], ["model.h"])
    graph = Graph(has_switches=False, is_guarded=False)
    interpreter = Interpreter(program, graph, doubles_move=False)
    arrays = {"x": STATES, "u": EFFORTS}

    def leaf(place: tuple[Any, ...], _: object) -> Value:
        argument, *parts = place
        if argument in arrays:
            return graph.value("state", name=arrays[argument][parts[0]])
        path = ["parameters", *parts] if argument == "p" else parts
        return graph.value("state", name=".".join(map(str, path)))

    _, rates = interpreter.run("rp_right_hand_side", leaf)
    _, calculated = interpreter.run("rp_calculate", leaf)
    fields = {".".join(map(str, place[1:])): value for place, value in calculated.items()}
    return Equations([rates["dx", i] for i in range(4)], [fields[name] for name in OUTPUTS])


def evaluated(
    roots: Sequence[Value], leaves: Mapping[str, Any], constant: Callable[[float], Any]
) -> list[Any]:
    """What values of a graph are in any arithmetic."""
    found: dict[Value, Any] = {}
    for value in in_order(roots):
        if value.op == "state":
            found[value] = leaves[value.name]
        elif value.op == "number":
            found[value] = constant(value.number)
        else:
            found[value] = OPERATIONS[value.op](*(found[x] for x in value.arguments))
    return [found[root] for root in roots]


class Sized:
    """A number, and how large it would be if no terms cancelled."""

    def __init__(self, value: arb | float, size: arb | None = None) -> None:
        self.value = arb(value)
        self.size = abs(self.value) if size is None else size

    def __add__(self, other: Sized) -> Sized:
        return Sized(self.value + other.value, self.size + other.size)

    def __sub__(self, other: Sized) -> Sized:
        return Sized(self.value - other.value, self.size + other.size)

    def __mul__(self, other: Sized) -> Sized:
        return Sized(self.value * other.value, self.size * other.size)

    def __truediv__(self, other: Sized) -> Sized:
        share = other.size / abs(other.value)
        return Sized(self.value / other.value, self.size / abs(other.value) * share)

    def __neg__(self) -> Sized:
        return Sized(-self.value, self.size)

    def sin(self) -> Sized:
        return Sized(self.value.sin(), arb(1))

    def cos(self) -> Sized:
        return Sized(self.value.cos(), arb(1))


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

    def outputs(self, plain: Equations) -> list[Sized]:
        """The rates, then the outputs."""
        given = (*self.states, *self.parameters, *(u[0] for u in self.efforts))
        names = (*STATES, *PARAMETERS, *EFFORTS)
        leaves = {name: Sized(x) for name, x in zip(names, given, strict=True)}
        return evaluated([*plain.rates, *plain.outputs], leaves, Sized)

    def motion(self, plain: Equations) -> list[arb_series]:
        """Series of the states: each round of Picard's iteration gets an order right."""
        known = dict(zip(EFFORTS, map(arb_series, self.effort_series), strict=True))
        known |= {n: arb_series([x]) for n, x in zip(PARAMETERS, self.parameters, strict=True)}
        found = [arb_series([x]) for x in self.states]
        for _ in range(LAST):
            leaves = known | dict(zip(STATES, found, strict=True))
            rates = evaluated(plain.rates, leaves, lambda x: arb_series([x]))
            found = [rate.integral() + x for rate, x in zip(rates, self.states, strict=True)]
        return found


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


def balls(folder: Path, program: Path) -> list[list[arb]]:
    """What the headers in a folder make of each arm; the program is compiled."""
    source = Path(__file__).with_name("arm_values.c")
    subprocess.run([*COMPILE, f"-I{folder}", source, "-o", program, "-lm"], check=True)
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
    series = motion_series.coefficients(states, parameters, arm.effort_series, arb(1), LAST)
    motion = [row[k][0] for k in range(1, LAST + 1) for row in series]
    efforts = [u[0] for u in arm.effort_series]
    return [*motion, *motion_series.outputs(states, parameters, efforts)]


def wrong(plain: Equations, found: Sequence[Sequence[arb]]) -> set[str]:
    """Numbers whose ball does not contain what the graph says, or is too wide."""
    names = [f"{name}, order {k}" for k in range(1, LAST + 1) for name in STATES]
    faults = set()
    for arm, own in zip(RANDOM, found, strict=True):
        sized, motion = arm.outputs(plain), arm.motion(plain)
        expected = [of[k] for k in range(1, LAST + 1) for of in motion]
        expected += [output.value for output in sized[4:]]
        for name, x, ball in zip((*names, *OUTPUTS), expected, own, strict=True):
            if not ball.overlaps(x):
                faults.add(name)
        firsts = zip((*names[:4], *OUTPUTS), sized, [*own[:4], *own[4 * LAST :]], strict=True)
        for name, x, ball in firsts:
            if not (ball.overlaps(x.value) and ball.rad() <= x.size * WIDEST + UNDERFLOW):
                faults.add(f"{name}: too wide")
    return faults


@pytest.fixture(scope="module")
def plain() -> Equations:
    return equations(PLAIN)


def test_balls_are_those_of_the_plain_equations(plain: Equations, tmp_path: Path) -> None:
    found = balls(SOURCES, tmp_path / "values")
    assert len(found) == ARMS
    assert wrong(plain, found) == set()


def test_so_are_those_of_the_checker(plain: Equations) -> None:
    assert wrong(plain, [of_checker(arm) for arm in RANDOM]) == set()


# ---- Faults --------------------------------------------------------------------------------------


def with_fault(fault: Fault, folder: Path, copy: Path) -> Path:
    """A copy of the headers in a folder, one of them with the fault."""
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("scenarios", "references"))
    file = copy / fault.file
    file.write_text(fault.source(file.read_text(encoding="utf-8")), encoding="utf-8")
    return copy


IN_PLAIN = (
    Fault("Coriolis term", "rp_equations.h", "- 2.0 * dq2", "- 1.0 * dq2"),
    Fault("offset of the slide", "rp_equations.h", "+ arm->a * ddq[0]", "- arm->a * ddq[0]"),
    Fault("inertia", "rp_equations.h", "p->I1z + p->I2z;", "p->I1z;"),
    Fault("power", "rp_calculated.h", "tau[0] * dq[0] +", "tau[0] * dq[0] -"),
)
IN_BALLS = (
    Fault(
        "centrifugal", "arm_series.h", "convolution(s, P, 0, W, i))", "convolution(s, P, 0, V, i))"
    ),
    Fault("weight", "arm_series.h", "times(s->offset, coefficient(s, C, i))", "s->offset"),
    Fault("Coriolis term", "arm_outputs.h", "v)), 2.0)", "v)), 1.0)"),
    Fault("height", "arm_outputs.h", "ball_product(m2, y))", "ball_product(m2, x))"),
)


def named(fault: Fault) -> str:
    return fault.name


@pytest.mark.parametrize("fault", IN_PLAIN, ids=named)
def test_a_fault_in_the_plain_equations_is_seen(fault: Fault, tmp_path: Path) -> None:
    faulty = equations(with_fault(fault, PLAIN, tmp_path / "headers"))
    assert wrong(faulty, [of_checker(arm) for arm in RANDOM])


@pytest.mark.parametrize("fault", IN_BALLS, ids=named)
def test_a_fault_in_the_balls_is_seen(fault: Fault, plain: Equations, tmp_path: Path) -> None:
    assert wrong(plain, balls(with_fault(fault, SOURCES, tmp_path / "proof"), tmp_path / "values"))
