"""The largest stable communication step, predicted from linear models, against simulations."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest
from rparm.models.closed_loop.study import REST as LOOP
from rparm.models.machine.study import REST as MACHINE
from rparm.models.machine.wall_limit import Contact, growth
from scipy.linalg import expm

from rparm.linearization.largest_step import (
    LargestStep,
    Resting,
    factor,
    largest_steps,
    resting,
    transition,
)
from rparm.linearization.linear import Linear, closure
from rparm.linearization.sampling import exponential, hold
from rparm.systems.master import INPUT_MODES, ORDERS
from rparm.systems.structure import Connection
from tests.support.paths import ROOT

WAYS = [(order, inputs) for order in ORDERS for inputs in INPUT_MODES]
NEAR = 0.005  # of the predicted step: where simulations die out and grow
SYSTEMS = {"ClosedLoop": replace(LOOP, sequence=()), "Machine": MACHINE}


@contextmanager
def opened(fmu: Path, name: str, **changes: object) -> Iterator[Resting]:
    with resting(fmu.with_name(f"{name}.ssp"), replace(SYSTEMS[name], **changes)) as system:
        yield system


@pytest.mark.parametrize("way", WAYS, ids=", ".join)
@pytest.mark.parametrize("name", SYSTEMS)
def test_simulations_die_out_below_and_grow_above(
    fmu: Path, name: str, way: tuple[str, str]
) -> None:
    with opened(fmu, name) as system:
        step = system.predicted(way).step
        below, above = system.growth(way, step * (1 - NEAR)), system.growth(way, step * (1 + NEAR))
        assert below < 1.0 < above
        limit = system.limit(way)
    assert limit.predicted == step and limit.passed
    assert limit.measured == pytest.approx(step, rel=NEAR)


def test_pages_say_what_is_predicted(fmu: Path) -> None:
    with opened(fmu, "Machine") as system:
        found = {way: system.predicted(way).step for way in WAYS}
    page = (ROOT / "models" / "machine" / "README.md").read_text(encoding="utf-8")
    for order, start in (("jacobi", "| Jacobi |"), ("gauss_seidel", "| Gauss-Seidel, in the")):
        (row,) = [line for line in page.splitlines() if line.startswith(start)]
        for inputs, cell in zip(INPUT_MODES, row.split("|")[2:], strict=False):
            assert cell.strip() == f"{1e3 * found[order, inputs]:.3f} ms"
    page = (ROOT / "models" / "closed_loop" / "coupling.md").read_text(encoding="utf-8")
    with opened(fmu, "ClosedLoop", sequence=LOOP.sequence) as system:
        for order, inputs in WAYS:
            step = system.predicted((order, inputs)).step
            name = f"{order.replace('_', '-').title()}, {inputs}"
            assert f"| {name} | {1e3 * step:.3f} ms |" in page


@pytest.mark.parametrize("way", WAYS, ids=", ".join)
@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_a_mass_at_a_sampled_wall_grows_as_its_theory_says(
    way: tuple[str, str], step: float
) -> None:
    """The factor of models/machine/wall_limit.py, which is derived by hand."""
    contact = Contact(mass=2.0, stiffness=300.0, damping=1.5)
    zero = np.zeros(1)
    mass = Linear(
        ("x", "v"), ("f",), ("x", "v"), np.array([[0.0, 1], [0, 0]]), np.array([[0.0], [-0.5]]),
        np.eye(2), np.zeros((2, 1)), np.zeros(2), zero, np.zeros(2), np.zeros(2),
    )  # fmt: skip
    wall = Linear(
        (), ("x", "v"), ("f",), np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)),
        np.array([[300.0, 1.5]]), np.zeros(0), np.zeros(2), zero, np.zeros(0),
    )  # fmt: skip
    wires = [Connection("mass", n, "wall", n) for n in "xv"] + [
        Connection("wall", "f", "mass", "f")
    ]
    found = np.abs(np.linalg.eigvals(transition({"mass": mass, "wall": wall}, wires, step, *way)))
    assert found.max() == pytest.approx(growth(contact, step, *way), rel=1e-9)


def test_an_unstable_system_has_no_stable_step(fmu: Path) -> None:
    undamped = {"controller.Kd1": 0.0, "controller.Kd2": 0.0}
    with opened(fmu, "ClosedLoop", values=undamped) as system:
        found = [system.predicted(way) for way in WAYS]
    assert all(x.step == 0 and math.isnan(x.frequency) for x in found)


def test_without_a_loop_there_is_no_limit() -> None:
    zero = np.zeros(1)
    alone = Linear(
        ("x",), ("u",), ("x",), -np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), *[zero] * 4
    )
    assert largest_steps({"a": alone, "b": alone}, [Connection("a", "x", "b", "u")]) == []
    opposed = replace(alone, B=-alone.B)  # x' = -x - x
    stable = largest_steps({"a": opposed}, [Connection("a", "x", "a", "u")])
    assert all(isinstance(x, LargestStep) and x.step > 0 for x in stable)


def test_steps_of_years_keep_their_digits() -> None:
    """x' = -a x + c y, y' = -g x, and a^2 above c g: late by a step, x dies out up to a / (c g)."""
    a, c, g = 4e-4, 1.3, 1e-12
    A, B, zero = np.array([[-a, c], [0, 0]]), np.array([[0.0], [1.0]]), np.zeros
    plant = Linear(
        ("x", "y"), ("u",), ("x",), A, B, np.eye(1, 2), zero((1, 1)), *map(zero, (2, 1, 1, 2))
    )
    none = zero((0, 0)), zero((0, 1)), zero((1, 0)), np.array([[-g]])
    law = Linear((), ("x",), ("u",), *none, *map(zero, (0, 1, 1, 0)))
    wires = [Connection("plant", "x", "law", "x"), Connection("law", "u", "plant", "u")]
    ways = [("jacobi", "held"), ("gauss_seidel", "held")]
    steps = [x.step for x in largest_steps({"plant": plant, "law": law}, wires, ways)]
    assert steps == pytest.approx([a / c / g, 2 * a / c / g], rel=1e-5)  # but for 1 / (a h)
    h = 6.7e8
    F, G, S = hold(A, B, h)
    exact = c / a * np.array([1, h - 1 / a, h * h / 2 - h / a + 1 / a**2])
    np.testing.assert_allclose([F[0, 1], G[0, 0], S[0, 0]], exact, rtol=1e-13)


def test_a_motion_that_neither_grows_nor_dies_out_has_no_stable_step() -> None:
    """An undamped mass on a spring, at each step exactly; in units 12 decades apart."""
    for unit in (1.0, 1e12):
        A = np.array([[0, unit, 0], [-1 / unit, 0, 0], [0, 0, -1.0]])
        opposed = Linear(
            ("x", "v", "y"), ("u",), ("x",), A, np.zeros((3, 1)), np.eye(1, 3), np.zeros((1, 1)),
            *map(np.zeros, (3, 1, 1, 3)),
        )  # fmt: skip
        whole = transition({"a": opposed}, [Connection("a", "x", "a", "u")], 0.01)
        assert factor(whole) == 1.0
    assert factor(np.diag([0.5, 1 - 1e-9])) == 1 - 1e-9


def test_what_no_power_leads_to_is_exactly_0() -> None:
    """exp of two chains, and of a slow state beside fast ones, in units 12 decades apart."""
    source = np.random.default_rng(7)
    for _ in range(10):
        units = 10 ** source.uniform(-6, 6, 6)
        A = np.triu(source.normal(size=(6, 6))) * (source.random((6, 6)) < 0.5)
        A[np.diag_indices(6)] = -(10 ** source.uniform(-4, 2, 6))
        found, reached = exponential(A * units[:, None] / units), closure(A != 0)
        assert not found[~reached].any()
        with mpmath.workdps(80):
            exact = np.array(mpmath.expm(mpmath.matrix(A.tolist())).tolist(), float)
        rounding = 1e-13 * expm(np.where(np.eye(6), A, np.abs(A)))
        assert (np.abs(found / units[:, None] * units - exact) <= rounding).all()
