"""Linear models of FMUs against exact ones, in all versions and kinds of FMI; equilibria."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import CO_SIMULATION, MODEL_EXCHANGE, Fmu
from rparm.linearization.linear import FmuSubject, Linear, checked_point
from rparm.linearization.trim import Trimmed, trim
from tests.equations.examples import example, made
from tests.support import symbolic
from tests.support.rparm_project import MISTAKES
from tests.support.symbolic import ExactModel

M1, M2, LC1, L1, A, G = 2.0, 1.0, 0.25, 0.5, 0.1, 9.81  # start values of the arm's parameters
FRICTION = {
    "coulomb_friction1": 0.5,
    "breakaway_friction1": 0.75,
    "stribeck_velocity1": 0.05,
    "coulomb_friction2": 1.0,
}


def gravity(q1: float, q2: float) -> tuple[float, float]:
    """Efforts that hold the arm, from the heights of its centers of mass (N.m, N)."""
    arm = (M1 * LC1 + M2 * (L1 + q2)) * math.cos(q1) - M2 * A * math.sin(q1)
    return G * arm, G * M2 * math.sin(q1)


@pytest.fixture(scope="module")
def plant(fmu: Path) -> Iterator[FmuSubject]:
    path = fmu.with_name("RPPlant.fmu")
    with Fmu(path, kind=MODEL_EXCHANGE) as opened, FmuSubject(opened) as subject:
        yield subject


def trimmed(plant: FmuSubject, free: list[str], **given: object) -> Trimmed:
    values, targets = checked_point(plant, given, with_outputs=True)
    return trim(plant, values, free, targets)


@pytest.mark.parametrize("pose", [(0.5, 0.3), (-1.2, 0.1), (2.0, -0.2)])
def test_efforts_for_a_pose(plant: FmuSubject, pose: tuple[float, float]) -> None:
    found = trimmed(plant, ["tau1", "f2"], q1=pose[0], q2=pose[1])
    assert (found.values["tau1"], found.values["f2"]) == pytest.approx(gravity(*pose), rel=1e-9)
    assert found.intervals == {}


def test_pose_for_a_point_of_the_end_effector(plant: FmuSubject) -> None:
    found = trimmed(plant, ["q1", "q2", "tau1", "f2"], ee_x="450 mm", ee_y=0.3)
    q1, q2 = found.values["q1"], found.values["q2"]
    along, across = np.array([math.cos(q1), math.sin(q1)]), np.array([-math.sin(q1), math.cos(q1)])
    assert (L1 + q2) * along + A * across == pytest.approx([0.45, 0.3], abs=1e-9)
    assert (found.values["tau1"], found.values["f2"]) == pytest.approx(gravity(q1, q2), rel=1e-8)


@pytest.mark.parametrize("given", [{}, {"tau1": 9.0, "f2": 3.0}])
def test_friction_holds_in_an_interval(plant: FmuSubject, given: dict[str, float]) -> None:
    """Its ends are gravity and breakaway friction; the middle is taken."""
    pose = {"q1": "30 deg", "q2": "300 mm"}
    found = trimmed(plant, ["tau1", "f2"], **FRICTION, **pose)
    expected = gravity(math.radians(30), 0.3)
    for name, middle, friction in zip(("tau1", "f2"), expected, (0.75, 1.0), strict=True):
        low, high = found.intervals[name]
        assert (low, high) == pytest.approx((middle - friction, middle + friction), abs=1e-7)
        assert found.values[name] == pytest.approx(middle, abs=1e-7)


def test_slow_sliding_under_stribeck_friction_is_unstable(plant: FmuSubject) -> None:
    """Friction falls with the velocity: that is stick-slip. Its pole from the falling curve."""
    rate = 0.02
    given = FRICTION | {"q1": 0.5, "dq1": rate, "g": 0.0, "a": 0.0, "coulomb_friction2": 1e3}
    found = trimmed(plant, ["tau1"], **given)
    linear = plant.at(found.values)
    held = plant.held(linear)
    assert held == ["q2", "dq2"]
    fast = max(linear.without(held).poles.real)
    inertia = M1 * LC1**2 + 0.1 + 0.05 + M2 * L1**2
    slope = -2 * rate / 0.05**2 * 0.25 * math.exp(-((rate / 0.05) ** 2))
    assert fast == pytest.approx(-slope / inertia, rel=1e-6)
    assert fast > 5


def test_a_velocity_that_is_free_is_that_of_a_steady_motion(plant: FmuSubject) -> None:
    """Where an effort drives against damping; a joint that can rest rests."""
    given = {"g": 0.0, "damping1": 0.5, "damping2": 1.0, "q2": -0.5}  # no arm to throw the slide
    driven = trimmed(plant, ["dq1", "f2"], tau1=2.0, **given)
    assert driven.values["dq1"] == pytest.approx(4.0)
    assert driven.values["f2"] == pytest.approx(0.0, abs=1e-9)
    rests = trimmed(plant, ["q1", "dq1"], q2=0.1, f2=0.0, g=0.0, damping1=0.5, ee_y=0.2)
    assert rests.values["dq1"] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(UserError, match="no equilibrium found by dq1, tau1"):
        trimmed(plant, ["dq1", "tau1"], f2=3.0, **given)


def test_a_motor_under_a_voltage_turns() -> None:
    """Its load's angle follows by a gear: steady where k i = d w and u = R i + k w."""
    with Fmu(example("dc_motor"), kind=MODEL_EXCHANGE) as opened, FmuSubject(opened) as motor:
        found = trimmed(motor, ["i", "speed"], voltage=12.0)
    w = 12.0 / (1.2 * 1e-5 / 0.05 + 0.05)
    assert (found.values["speed"], found.values["i"]) == pytest.approx((w, 2e-4 * w), rel=1e-9)


def test_a_touched_compliant_stop_gives_its_pair(plant: FmuSubject) -> None:
    given = {"q2": 0.01, "stops2": "compliant", "upper2": 0.0, "stop_stiffness2": 400.0}
    given |= {"g": 0.0, "a": 0.0, "coulomb_friction1": 1e3}
    found = trimmed(plant, ["f2"], **given)
    assert found.values["f2"] == pytest.approx(4.0)
    linear = plant.at(found.values)
    poles = linear.without(plant.held(linear)).poles
    assert sorted(poles.imag) == pytest.approx([-20.0, 20.0])


@pytest.mark.parametrize("free, given, message", MISTAKES["trim"]["rows"])
def test_refused(
    plant: FmuSubject, free: list[str], given: dict[str, object], message: str
) -> None:
    with pytest.raises(UserError) as caught:
        trimmed(plant, free, **given)
    assert message in str(caught.value) and "\n" not in str(caught.value)


# ---- Sizes far from 1 ----------------------------------------------------------------------------
SCALES = """
name = "Scales"
[parameters]
gap = { start = 0 }
[inputs]
q = { start = 1e-3 }
u = { start = 5e-9 }
[states]
x = { start = 1e-7, derivative = "1.2e-12 - 6e-4 * x" }
y = { start = 3, derivative = "(1 - y) / 1e10" }
p = { start = 1, derivative = "1e12 * (q - 2.5e-13 * p)" }
flow = { start = 1, nominal = 1e-5, derivative = "-flow" }
fold = { start = 3, derivative = "-(fold - 1)**2 - gap" }
v = { derivative = "max(0, u - 1e-9) + min(0, u + 1e-9) - v" }
"""
EXACT = {"x": 2e-9, "y": 1.0, "p": 2e7, "q": 5e-6, "flow": 0.0}


@pytest.fixture(scope="module")
def scales() -> Iterator[FmuSubject]:
    path = made(SCALES)
    with Fmu(path, kind=MODEL_EXCHANGE) as opened, FmuSubject(opened) as subject:
        yield subject


def test_units_do_not_decide_what_is_an_equilibrium(scales: FmuSubject) -> None:
    """Slow, small and large states; where two solutions meet, half of the digits are rounding."""
    free = ["x", "y", "p", "fold", "u"]
    found = trimmed(scales, free, flow=0.0, q=5e-6)
    for name in free[:3]:
        assert found.values[name] == pytest.approx(EXACT[name], rel=1e-12, abs=0.0)
    assert found.values["fold"] == pytest.approx(1.0, abs=1e-7)
    assert found.intervals == {"u": pytest.approx((-1e-9, 1e-9), rel=1e-9, abs=0)}
    with pytest.raises(UserError, match="the derivative of fold stays at -1e-13"):
        trimmed(scales, free, flow=0.0, q=5e-6, gap=1e-13)


def test_what_moves_is_said_by_sizes_and_nominal_values(scales: FmuSubject) -> None:
    """The flow of 1e-14 is nothing beside its nominal value, but x is far from its equilibrium."""
    at = EXACT | {"fold": 1.0, "u": 0.0}
    assert scales.at(at | {"flow": 1e-14}).moving() == []
    assert scales.at(at | {"x": 1e-9}).moving() == ["x' = 6e-13"]
    assert scales.at(at | {"y": 1.001, "p": 2.01e7}).moving() == ["y' = -1e-13", "p' = -25000"]


# ---- Matrices ------------------------------------------------------------------------------------


BOUND = 1e-12  # of the largest entry of a matrix
POINTS = 25
CASES = {
    "drives": ("RPActuator", symbolic.drives_point),
    "controller": ("RPController", symbolic.controller_point),
} | {
    f"plant, {mode}": ("RPPlant", partial(symbolic.plant_point, mode))
    for mode in symbolic.PLANT_MODES
}


@pytest.fixture(scope="module")
def points() -> Callable[[str], list[ExactModel]]:
    """The exact models of a case, made once."""
    made: dict[str, list[ExactModel]] = {}

    def of(case: str) -> list[ExactModel]:
        if case not in made:
            made[case] = [CASES[case][1](seed) for seed in range(POINTS)]
        return made[case]

    return of


@pytest.fixture(scope="module")
def subjects(fmu: Path) -> Iterator[Callable[[str, str, str], FmuSubject]]:
    """FMUs to linearize by name, version and kind."""
    with ExitStack() as stack:
        made: dict[tuple[str, str, str], FmuSubject] = {}

        def of(name: str, version: str, kind: str) -> FmuSubject:
            key = name, version, kind
            if key not in made:
                folder = fmu.parent if version == "2.0" else fmu.parent / "fmi3"
                opened = stack.enter_context(Fmu(folder / f"{name}.fmu", kind=kind))
                made[key] = stack.enter_context(FmuSubject(opened))
            return made[key]

        yield of


@pytest.mark.parametrize("kind", [CO_SIMULATION, MODEL_EXCHANGE])
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("case", CASES)
def test_matrices_are_exact(
    subjects: Callable, points: Callable, case: str, version: str, kind: str
) -> None:
    subject = subjects(CASES[case][0], version, kind)
    for exact in points(case):
        found = subject.at(exact.values)
        n, m = len(found.states), len(exact.knowns) - len(found.states)
        assert exact.knowns[:n] == found.states and exact.knowns[n:] == found.inputs[:m]
        rows = [found.outputs.index(name) for name in exact.outputs]
        for matrix, expected in (
            (found.A, exact.entries[:n, :n]),
            (found.B, exact.entries[:n, n:]),
            (found.C[rows], exact.entries[n:, :n]),
            (found.D[rows], exact.entries[n:, n:]),
        ):
            largest = np.abs(expected).max(initial=0.0)
            assert np.abs(matrix - expected).max(initial=0.0) <= BOUND * largest


HELD = {
    "sliding": (), "held 1": ("q1", "dq1"), "held 2": ("q2", "dq2"), "rigid stop": ("q2", "dq2"),
    "both held": ("q1", "q2", "dq1", "dq2"), "compliant stops": (),
}  # fmt: skip


@pytest.mark.parametrize("mode", HELD)
def test_held_states_are_named_and_dropped(subjects: Callable, points: Callable, mode: str) -> None:
    subject = subjects("RPPlant", "2.0", CO_SIMULATION)
    for exact in points(f"plant, {mode}"):
        found = subject.at(exact.values)
        held = subject.held(found)
        assert set(held) == set(HELD[mode])
        kept: Linear = found.without(held)
        assert kept.states == tuple(name for name in found.states if name not in held)
        assert set(kept.held) == set(HELD[mode])
        # of a joint whose partner is held: no false poles at 0 but those of free fall
        assert len(kept.poles) == 4 - len(held)


def test_a_moving_joint_at_the_moment_of_no_motion_is_not_held(subjects: Callable) -> None:
    """Without friction a joint in equilibrium stands still, but efforts move it."""
    subject = subjects("RPPlant", "2.0", MODEL_EXCHANGE)
    assert subject.held(subject.at({"g": 0.0})) == []
