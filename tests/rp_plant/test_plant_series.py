"""The plant's Taylor series against that of its Lagrangian, in long double, in each mode.

The reference works with truncated power series as numbers: what sympy derives from positions is
evaluated with them, order after order. It shares no recurrence with the C code.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from tests.rp_plant.plant_rows import FREE, INPUTS, ORDERS, STATES, STUCK, expand
from tests.rp_plant.test_plant_lagrangian import Case, in_stops, random_case
from tests.support.rp_symbolic import NAMES, SmoothPlant

CASES = 64
MODES = (-1.0, STUCK, 1.0, FREE)
BOUND = 1e-12

real = np.longdouble


class Series:
    """The sum of c[k] t^k; operations keep as many orders as their arguments."""

    __array_ufunc__ = None  # numbers of numpy leave operations to this class

    def __init__(self, c: Sequence[float] | np.ndarray) -> None:
        self.c = np.array(c, real)

    def of(self, other: object) -> "Series":
        """A number as a series of this length."""
        if isinstance(other, Series):
            return other
        c = np.zeros_like(self.c)
        c[0] = other
        return Series(c)

    def __neg__(self) -> "Series":
        return Series(-self.c)

    def __add__(self, other: object) -> "Series":
        return Series(self.c + self.of(other).c)

    def __sub__(self, other: object) -> "Series":
        return self + -self.of(other)

    def __rsub__(self, other: object) -> "Series":
        return self.of(other) - self

    def __mul__(self, other: object) -> "Series":
        return Series(np.convolve(self.c, self.of(other).c)[: len(self.c)])

    def __truediv__(self, other: object) -> "Series":
        divisor, found = self.of(other).c, np.zeros_like(self.c)
        for k, x in enumerate(self.c):
            found[k] = (x - divisor[1 : k + 1] @ found[:k][::-1]) / divisor[0]
        return Series(found)

    def __pow__(self, power: int) -> "Series":
        return self * self ** (power - 1) if power > 1 else self

    __radd__, __rmul__ = __add__, __mul__

    def composed(self, derivatives: Callable[[int], np.longdouble]) -> "Series":
        """A function of this series, from its derivatives at the first coefficient."""
        step = Series([0.0, *self.c[1:]])
        found = self.of(0)
        for k in reversed(range(len(self.c))):
            found = found * step + derivatives(k) / math.factorial(k)
        return found


def turn(x: Series) -> tuple[np.longdouble, ...]:
    """sin x and its derivatives, in turn."""
    s, c = np.sin(x.c[0]), np.cos(x.c[0])
    return s, c, -s, -c


def sine(x: Series) -> Series:
    return x.composed(lambda k: turn(x)[k % 4])


def cosine(x: Series) -> Series:
    return x.composed(lambda k: turn(x)[(k + 1) % 4])


def exponential(x: Series) -> Series:
    return x.composed(lambda _: np.exp(x.c[0]))


class Reference:
    """Series of motions in given modes."""

    def __init__(self) -> None:
        plant = SmoothPlant()
        symbols = sp.symbols(NAMES)
        modules: list[Any] = [{"sin": sine, "cos": cosine}]
        self._functions = [
            sp.lambdify(symbols, list(plant.expressions[name]), modules, cse=True)
            for name in ("mass_matrix", "applied", "coriolis", "gravity")
        ]

    def forces(self, case: Case, x: Sequence[Series], u: Sequence[Series]) -> tuple[list, list]:
        """D and all forces but those of stuck joints."""
        known = case | dict(zip(STATES, x, strict=True)) | dict(zip(INPUTS, u, strict=True))
        arguments = [known.get(name, 0) for name in NAMES]
        D, applied, coriolis, gravity = (f(*arguments) for f in self._functions)
        forces = [applied[i] - coriolis[i] - gravity[i] for i in range(2)]
        for i in range(2):
            mode = case[f"mode{i + 1}"]
            if mode in (-1, 1):
                forces[i] = forces[i] - mode * friction(case, i, x[2 + i])
            if abs(case.get(f"contact{i + 1}", 0)) == 1:
                forces[i] = forces[i] + stop_force(case, i, x[i], x[2 + i])
        return D, forces

    def accelerations(
        self, case: Case, x: Sequence[Series], u: Sequence[Series]
    ) -> tuple[list[Series], list[Series]]:
        """q'' and what holds the joints: 0 for one that is not stuck."""
        D, forces = self.forces(case, x, u)
        none = forces[0] * 0
        stuck = [case[f"mode{i + 1}"] == STUCK for i in range(2)]
        if stuck == [False, False]:
            det = D[0] * D[3] - D[1] * D[2]
            return [
                (D[3] * forces[0] - D[1] * forces[1]) / det,
                (D[0] * forces[1] - D[2] * forces[0]) / det,
            ], [none, none]
        ddq = [none if stuck[i] else forces[i] / D[3 * i] for i in range(2)]
        held = [forces[i] - D[2 * i] * ddq[0] - D[2 * i + 1] * ddq[1] for i in range(2)]
        return ddq, [held[i] if stuck[i] else none for i in range(2)]

    def expand(self, case: Case, inputs: np.ndarray) -> tuple[list[Series], list[Series]]:
        """States and reactions over the time in s; inputs: (5, 4) coefficients."""
        rows = [[real(case[name])] for name in STATES]
        reactions: list[Series] = []
        for k in range(ORDERS):
            x = [Series(row) for row in rows]
            u = [Series([*row, *[0.0] * k][: k + 1]) for row in inputs]
            ddq, reactions = self.accelerations(case, x, u)
            if k + 1 < ORDERS:
                rates = (x[2], x[3], *ddq)
                for row, rate in zip(rows, rates, strict=True):
                    row.append(rate.c[k] / (k + 1))
        return [Series(row) for row in rows], reactions


def breakaway(case: Case, i: int) -> float:
    return case[f"breakaway_friction{i + 1}"] or case[f"coulomb_friction{i + 1}"]


def friction(case: Case, i: int, dq: Series) -> Series | float:
    """Stribeck's law."""
    coulomb, vs = case[f"coulomb_friction{i + 1}"], case[f"stribeck_velocity{i + 1}"]
    if breakaway(case, i) == coulomb:
        return coulomb
    ratio = dq / vs
    return coulomb + (breakaway(case, i) - coulomb) * exponential(-(ratio * ratio))


def stop_force(case: Case, i: int, q: Series, dq: Series) -> Series:
    """Hunt's and Crossley's, on the joint."""
    side = case[f"contact{i + 1}"]
    limit = case[f"lower{i + 1}"] if side > 0 else case[f"upper{i + 1}"]
    depth, into = (limit - q) * side, dq * -side
    return side * case[f"stop_stiffness{i + 1}"] * depth * (case[f"stop_damping{i + 1}"] * into + 1)


# ---- Cases -----------------------------------------------------------------------------------


def plant_case(random: np.random.Generator, number: int) -> Case:
    """A smooth plant with friction, each pair of modes in turn; the wrench is 0 in one of four."""
    case = random_case(random)
    for i, mode in enumerate((MODES[number % 4], MODES[number // 4 % 4])):
        coulomb = round(random.uniform(0, 4) * 64) / 64
        case |= {f"mode{i + 1}": mode, f"coulomb_friction{i + 1}": coulomb}
        case[f"breakaway_friction{i + 1}"] = coulomb + random.integers(3)
        case[f"stribeck_velocity{i + 1}"] = float(random.choice([0.125, 0.5, 2.0]))
        if mode == STUCK and number % 3 != 0:
            case[f"dq{i + 1}"] = 0.0
    if number % 5 == 4:
        case |= dict.fromkeys(INPUTS[2:], 0.0)
    return case


def input_polynomials(random: np.random.Generator, case: Case) -> np.ndarray:
    """(5, 4): cubic ones in turn with constant ones."""
    inputs = np.zeros((5, 4))
    inputs[:, 0] = [case[name] for name in INPUTS]
    if random.integers(3) > 0:
        inputs[:, 1:] = np.round(random.uniform(-50, 50, (5, 3)))
        if inputs[2:, 0].tolist() == [0, 0, 0]:
            inputs[2:] = 0
    return inputs


def unit_of(case: Case, rows: list[Series]) -> float:
    """A power of two (s) in which no coefficient exceeds the first ones much, and in which a
    velocity near rest moves no farther than the model allows."""
    unit = 1.0
    for row in rows:
        scale = 1 + abs(row.c[0])
        for k, c in enumerate(row.c[1:], 1):
            while abs(c) * unit**k > scale:
                unit /= 2
    for i in range(2):
        vs, dq = case[f"stribeck_velocity{i + 1}"], rows[2 + i].c
        if breakaway(case, i) > case[f"coulomb_friction{i + 1}"] and case[f"mode{i + 1}"] in (
            -1,
            1,
        ):
            reach = max(vs, abs(dq[0]) - 6 * vs)
            while sum(abs(c) * unit**k for k, c in enumerate(dq) if k > 0) > reach:
                unit /= 2
    return unit


@pytest.fixture(scope="module")
def cases() -> list[tuple[Case, np.ndarray, list[Series], list[Series]]]:
    """Cases, their inputs, and the reference: states and reactions over the time in s."""
    random = np.random.default_rng(4)
    reference = Reference()
    found = []
    for number in range(CASES + CASES // 2):
        case = plant_case(random, number)
        if number >= CASES:
            case = in_stops(random, case)
        inputs = input_polynomials(random, case)
        found.append((case, inputs, *reference.expand(case, inputs)))
    return found


def assert_row(actual: np.ndarray, expected: Series, unit: float) -> None:
    """Within the bound times the largest coefficient."""
    scaled = expected.c * real(unit) ** np.arange(ORDERS)
    largest = max(1, np.max(np.abs(scaled)))
    assert np.max(np.abs(actual - scaled)) <= BOUND * largest


def test_coefficients_are_those_of_the_lagrangian(program: Path, cases: list) -> None:
    units = np.array([unit_of(case, states) for case, _, states, _ in cases])
    inputs = np.array([row for _, row, _, _ in cases]) * units[:, None, None] ** np.arange(4)
    states, indicators = expand(program, [case for case, *_ in cases], units, inputs)
    pairs = set()
    for n, (case, _, expected, reactions) in enumerate(cases):
        for i in range(4):
            assert_row(states[n, i], expected[i], units[n])
        for i in range(2):
            if case[f"mode{i + 1}"] == STUCK:
                limit = breakaway(case, i)
                assert_row(indicators[n, 4 * i], limit - reactions[i], units[n])
                assert_row(indicators[n, 4 * i + 1], limit + reactions[i], units[n])
        pairs.add((case["mode1"], case["mode2"]))
    assert len(pairs) == len(MODES) ** 2
