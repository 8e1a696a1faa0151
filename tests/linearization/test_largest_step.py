"""The largest stable communication step, predicted from linear models, against simulations."""

import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rparm.models.machine.stability import Contact, growth
from scipy.linalg import expm

from rparm.coupling.master import INPUTS, ORDERS, Master
from rparm.linearization.largest_step import LargestStep, largest_steps, transition
from rparm.linearization.linear import Linear
from rparm.linearization.measured_growth import growth as growth_in_a_run
from rparm.linearization.system import SystemSubject
from rparm.system import ssp
from rparm.system.structure import Connection
from tests.support.paths import ROOT

WAYS = [(order, inputs) for order in ORDERS for inputs in INPUTS]
NEAR = 0.005  # of the predicted step: where simulations die out and grow
MOVED = 1e-6  # rad and m, out of equilibrium
FREE_OF_FRICTION = {f"plant.{k}_friction{i}": 0.0 for k in ("coulomb", "breakaway") for i in (1, 2)}
# the variant, what is left out, values, and the arm's component
SYSTEMS = {
    "ClosedLoop": ("nominal", (), {"trajectory.start_time": 1e4}, "arm"),
    "Machine": (
        "wall_contact", ("sensor",), FREE_OF_FRICTION | {"trajectory.start_time": 1e4}, "plant",
    ),
}  # fmt: skip


@contextmanager
def opened(fmu: Path, name: str, variant: str = "") -> Iterator[SystemSubject]:
    usual, without, _, _ = SYSTEMS[name]
    with ExitStack() as stack:
        unpacked = stack.enter_context(ssp.unpacked(fmu.with_name(f"{name}.ssp")))
        yield stack.enter_context(SystemSubject(unpacked, variant or usual, without=without))


def predicted(subject: SystemSubject, values: Mapping[str, float], ways: list) -> dict:
    parts = subject.parts(values)
    held = subject.held(parts)
    parts = {name: part.without(held[name]) for name, part in parts.items()}
    found = largest_steps(parts, subject.connections, ways)
    return {(x.order, x.inputs): x for x in found}


def rate(subject: SystemSubject, values: dict, arm: str, way: tuple[str, str], h: float) -> float:
    """By how much deviations grow in a step, from eigenvalues of the motion of the arm."""
    signals = [f"{arm}.{name}" for name in ("q1", "q2", "dq1", "dq2")]
    with Master(subject.fmus, subject.connections, *way) as master:
        master.initialize(0.0, None, subject.merged(values))
        return growth_in_a_run(master, h, signals)


@pytest.mark.parametrize("way", WAYS, ids=", ".join)
@pytest.mark.parametrize("name", SYSTEMS)
def test_simulations_die_out_below_and_grow_above(
    fmu: Path, name: str, way: tuple[str, str]
) -> None:
    _, _, values, arm = SYSTEMS[name]
    with opened(fmu, name) as subject:
        step = predicted(subject, values, [way])[way].step
        start = subject.at(values).at
        moved = values | {f"{arm}.{q}": start[f"{arm}.{q}"] + MOVED for q in ("q1", "q2")}
        assert rate(subject, moved, arm, way, step * (1 - NEAR)) < 1.0
        assert rate(subject, moved, arm, way, step * (1 + NEAR)) > 1.0


def test_pages_say_what_is_predicted(fmu: Path) -> None:
    _, _, values, _ = SYSTEMS["Machine"]
    with opened(fmu, "Machine") as subject:
        found = predicted(subject, values, WAYS)
    page = (ROOT / "models" / "machine" / "README.md").read_text(encoding="utf-8")
    for order, start in (("jacobi", "| Jacobi |"), ("gauss_seidel", "| Gauss-Seidel, in the")):
        (row,) = [line for line in page.splitlines() if line.startswith(start)]
        for inputs, cell in zip(INPUTS, row.split("|")[2:], strict=False):
            assert cell.strip() == f"{1e3 * found[order, inputs].step:.3f} ms"
    loop = SYSTEMS["ClosedLoop"][2]
    with opened(fmu, "ClosedLoop") as subject:
        found = predicted(subject, loop, [("jacobi", x) for x in INPUTS])
    page = (ROOT / "models" / "closed_loop" / "coupling.md").read_text(encoding="utf-8")
    for inputs in INPUTS:
        assert f"| Jacobi, {inputs} | {1e3 * found['jacobi', inputs].step:.3f} ms |" in page


def test_the_closed_loop_is_stable_up_to_21_ms_in_jacobi_order(fmu: Path) -> None:
    """Without gravity by another path: two integrators, and efforts for s^2 + 40 s + 400, late."""

    def largest(h: float) -> float:
        # x, v and the effort that the next step holds
        free = expm(np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]]) * h)
        free[2] = [-400.0, -40.0, 0.0]
        return np.abs(np.linalg.eigvals(free)).max()

    low, high = 0.001, 0.1
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if largest(middle) < 1 else (low, middle)
    way = "jacobi", "held"
    with opened(fmu, "ClosedLoop", "horizontal_plane") as subject:
        assert predicted(subject, {}, [way])[way].step == pytest.approx(low, rel=1e-9)
    with opened(fmu, "ClosedLoop") as subject:  # gravity is compensated late, too
        assert predicted(subject, {}, [way])[way].step == pytest.approx(21.297e-3, abs=1e-6)


@pytest.mark.parametrize("way", WAYS, ids=", ".join)
@pytest.mark.parametrize("step", [1e-3, 2e-2])
def test_a_mass_at_a_sampled_wall_grows_as_its_theory_says(
    way: tuple[str, str], step: float
) -> None:
    """The factor of models/machine/stability.py, which is derived by hand."""
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
    with opened(fmu, "ClosedLoop") as subject:
        found = predicted(subject, {"controller.Kd1": 0.0, "controller.Kd2": 0.0}, WAYS)
    assert all(x.step == 0 and math.isnan(x.frequency) for x in found.values())


def test_without_a_loop_there_is_no_limit() -> None:
    zero = np.zeros(1)
    alone = Linear(
        ("x",), ("u",), ("x",), -np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), *[zero] * 4
    )
    assert largest_steps({"a": alone, "b": alone}, [Connection("a", "x", "b", "u")]) == []
    opposed = replace(alone, B=-alone.B)  # x' = -x - x
    stable = largest_steps({"a": opposed}, [Connection("a", "x", "a", "u")])
    assert all(isinstance(x, LargestStep) and x.step > 0 for x in stable)
