"""Limits of the damping of a sampled wall: closed forms. tests/machine measures them with FMUs."""

import math
import re
from dataclasses import replace

import pytest
from rparm.models.machine.wall_limit import AGE, Contact, exact_least_damping, growth, least_damping

from tests.support.paths import ROOT

ORDERS = tuple(AGE)
INPUTS = ("held", "extrapolated")
CASES = [(order, inputs) for order in ORDERS for inputs in INPUTS]
each_case = pytest.mark.parametrize(("order", "inputs"), CASES)

PAGE = ROOT / "models" / "machine" / "README.md"
CONTACT = Contact(mass=1.6, stiffness=1e4)
STEP = 1e-3  # s


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
