"""Limits of the damping of a sampled wall: closed forms, and the FMUs of arm and wall in a loop."""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rparm.models.machine.wall_limit import (
    AGE,
    Contact,
    exact_least_damping,
    growth,
    least_damping,
    transition,
)

from tests.support.instances import Instance, LoadedFmu
from tests.support.paths import ROOT
from tests.support.rparm_project import FMUS

ORDERS = tuple(AGE)
INPUTS = ("held", "extrapolated")
CASES = [(order, inputs) for order in ORDERS for inputs in INPUTS]
each_case = pytest.mark.parametrize(("order", "inputs"), CASES)

PAGE = ROOT / "models" / "machine" / "README.md"
CONTACT = Contact(mass=1.6, stiffness=1e4)
STEP = 1e-3  # s
FORCE = 400.0  # N, presses the mass against the wall


# ---- Closed forms --------------------------------------------------------------------------------


@pytest.mark.parametrize("kappa", [1e-3, 1e-2, 0.1, 0.2, 0.24])
def test_held_limits_are_those_of_jury(kappa: float) -> None:
    step = math.sqrt(kappa * CONTACT.mass / CONTACT.stiffness)
    unit = CONTACT.mass / step
    low, high = (kappa / 2 + (1 + side * math.sqrt(1 - 4 * kappa)) / 2 for side in (-1, 1))
    assert exact_least_damping(CONTACT, step) == pytest.approx(low * unit, rel=1e-9)
    for beta, stable in ((0.999 * low, False), (0.5 * (low + high), True), (1.001 * high, False)):
        contact = replace(CONTACT, damping=beta * unit)
        assert (growth(contact, step) < 1.0) == stable
    least = least_damping(CONTACT, step, "gauss_seidel")
    assert exact_least_damping(CONTACT, step, "gauss_seidel") == pytest.approx(least, rel=1e-9)


def test_no_damping_helps_when_steps_are_long() -> None:
    step = 0.501 * math.sqrt(CONTACT.mass / CONTACT.stiffness)
    with pytest.raises(ValueError, match=r"step = 0\.006\d+ s: no damping .* period is 0\.079"):
        exact_least_damping(CONTACT, step)


@each_case
def test_limits_are_the_leading_terms_of_the_exact_ones(order: str, inputs: str) -> None:
    """What the theory leaves out is of second order in the step."""
    ratios = []
    for steps in (400, 200, 100):
        step = CONTACT.period / steps
        exact = exact_least_damping(CONTACT, step, order, inputs)
        ratios.append(exact / least_damping(CONTACT, step, order, inputs) - 1)
    assert abs(ratios[0]) < 3e-4
    if (order, inputs) != ("gauss_seidel", "held"):
        assert ratios[1] / ratios[0] == pytest.approx(4.0, rel=0.02)
        assert ratios[2] / ratios[1] == pytest.approx(4.0, rel=0.02)


def test_ratios_of_the_page() -> None:
    page = PAGE.read_text(encoding="utf-8")
    (steps,) = re.findall(r"\| Steps in a period \| (.*) \|", page)
    names = {"Jacobi": "jacobi", "Gauss-Seidel": "gauss_seidel"}
    rows = re.findall(r"\| ([\w-]+), (held|extrapolated) \| ([\d. |]+) \|", page)
    assert {(names[order], inputs) for order, inputs, _ in rows} == set(CASES)
    for order, inputs, ratios in rows:
        for count, ratio in zip(steps.split(" | "), ratios.split(" | "), strict=True):
            step = CONTACT.period / int(count)
            exact = exact_least_damping(CONTACT, step, names[order], inputs)
            theory = least_damping(CONTACT, step, names[order], inputs)
            assert exact / theory == pytest.approx(float(ratio), abs=5.1e-5), (order, inputs, count)


def test_figures_of_the_page() -> None:
    contact = Contact(mass=1.0, stiffness=1e4)
    found = [least_damping(contact, 1e-3, *case) for case in (CASES[0], CASES[2], *CASES[1::2])]
    assert found == pytest.approx([15.0, 5.0, 0.125, 0.0083], rel=5e-3)
    assert "15, 5, 0.125 and 0.0083 N.s/m" in PAGE.read_text(encoding="utf-8")


# ---- The FMUs ------------------------------------------------------------------------------------

MOTION = ("ee_x", "ee_vx", "ee_y", "ee_vy", "ee_angle", "ee_rate")
WRENCH = ("ee_fx", "ee_fy", "ee_mz")


class Loop:
    """Plant and wall, stepped as rparm/systems/master.py does, the plant first."""

    def __init__(self, arm: Instance, wall: Instance, order: str, inputs: str) -> None:
        self.arm, self.wall = arm, wall
        self.jacobi, self.extrapolates = order == "jacobi", inputs == "extrapolated"
        self.count = 0
        self.arm_values, self.arm_slopes = self.read(arm, MOTION)
        self.wall_values, self.wall_slopes = self.read(wall, WRENCH)

    def read(self, instance: Instance, names: tuple[str, ...]) -> tuple[list[float], list[float]]:
        slopes = [0.0] * len(names)
        if self.extrapolates:
            references = [instance.loaded.references[name] for name in names]
            slopes = instance.fmi.getRealOutputDerivatives(references, [1] * len(names))
        return instance.get(*names), list(slopes)

    def move(
        self,
        instance: Instance,
        names: tuple[str, ...],
        values: list[float],
        slopes: list[float],
        ahead: bool = False,
    ) -> None:
        """Step an instance with lines of these values and slopes, at the end if `ahead`."""
        back = STEP if ahead else 0.0
        starts = [x - back * dx for x, dx in zip(values, slopes, strict=True)]
        instance.set(**dict(zip(names, starts, strict=True)))
        if self.extrapolates:
            rates = {name: [dx] for name, dx in zip(names, slopes, strict=True)}
            instance.set_input_derivatives(**rates)
        instance.step(self.count * STEP, STEP)

    def step(self) -> None:
        """From one communication point to the next."""
        before = self.arm_values, self.arm_slopes
        self.move(self.arm, WRENCH, self.wall_values, self.wall_slopes)
        self.arm_values, self.arm_slopes = self.read(self.arm, MOTION)
        motion = before if self.jacobi else (self.arm_values, self.arm_slopes)
        self.move(self.wall, MOTION, *motion, ahead=not self.jacobi)
        self.wall_values, self.wall_slopes = self.read(self.wall, WRENCH)
        self.count += 1


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadedFmu, LoadedFmu]:
    folder: Path = tmp_path_factory.mktemp("stability")
    return tuple(LoadedFmu(FMUS[name], folder / name) for name in ("rp_plant", "rp_environment"))


def motion(
    units: tuple[LoadedFmu, LoadedFmu], damping: float, order: str, inputs: str, count: int
) -> Iterator[np.ndarray]:
    """Deviations of the loop from its equilibrium: depth, velocity, force, slope, acceleration.

    The slide at q1 = 0, a = 0, g = 0 is a mass m2. It starts 1 mm deeper, with the force of the
    equilibrium.
    """
    equilibrium = FORCE / CONTACT.stiffness
    start = {"a": 0.0, "g": 0.0, "m2": CONTACT.mass, "q2": 1e-3, "f2": FORCE}
    # the surface is where the tip is at l1 + q2 = 0.5 - equilibrium
    wall = {"stiffness": CONTACT.stiffness, "damping": damping, "angle": math.pi}
    wall |= {"position": equilibrium - 0.5, "ee_x": 0.5}
    with Instance(units[0]) as arm, Instance(units[1]) as surface:
        arm.initialize(tolerance=1e-12, ee_fx=-FORCE, **start)
        loop = Loop(arm, surface.initialize(**wall), order, inputs)
        for _ in range(count):
            yield np.array(
                [
                    loop.arm_values[0] - 0.5,
                    loop.arm_values[1],
                    -loop.wall_values[0] - FORCE,
                    -loop.wall_slopes[0],
                    loop.arm_slopes[1],
                ]
            )
            loop.step()


# places of the state of `transition` in the rows of `motion`
STATE = {
    ("jacobi", "held"): [0, 1, 2],
    ("gauss_seidel", "held"): [0, 1],
    ("jacobi", "extrapolated"): [0, 1, 4, 2, 3],
    ("gauss_seidel", "extrapolated"): [0, 1, 2, 3],
}


@each_case
def test_every_step_of_the_fmus_is_that_of_the_matrix(
    units: tuple[LoadedFmu, LoadedFmu], order: str, inputs: str
) -> None:
    damping = 1.5 * least_damping(CONTACT, STEP, order, inputs)
    matrix = transition(replace(CONTACT, damping=damping), STEP, order, inputs)
    rows = np.array(list(motion(units, damping, order, inputs, 60)))[:, STATE[order, inputs]]
    # the first values of the wall belong to no step
    expected = rows[2:-1] @ matrix.T
    scale = np.abs(rows).max(axis=0)
    assert (scale > 0).all()
    assert (np.abs(rows[3:] - expected) <= 1e-9 * scale).all()


def fitted(depth: np.ndarray) -> complex:
    """Eigenvalue z of depth_n+2 = 2 Re(z) depth_n+1 - |z|^2 depth_n."""
    columns = np.column_stack([depth[1:-1], depth[:-2]])
    (twice_real, minus_square), *_ = np.linalg.lstsq(columns, depth[2:], rcond=None)
    return complex(twice_real / 2, math.sqrt(-minus_square - twice_real**2 / 4))


@each_case
def test_limit_of_the_fmus_is_that_of_the_theory(
    units: tuple[LoadedFmu, LoadedFmu], order: str, inputs: str
) -> None:
    """Between two dampings, |z|^2 of the motion passes 1."""
    theory = least_damping(CONTACT, STEP, order, inputs)
    products = []
    for share in (0.9, 1.1):
        rows = np.array(list(motion(units, share * theory, order, inputs, 200)))
        products.append(abs(fitted(rows[20:, 0])) ** 2)
    assert products[0] > 1.0 > products[1]
    measured = theory * (0.9 + 0.2 * (products[0] - 1) / (products[0] - products[1]))
    assert measured == pytest.approx(theory, rel=0.02)
    exact = exact_least_damping(CONTACT, STEP, order, inputs)
    assert measured == pytest.approx(exact, rel=1e-3)
