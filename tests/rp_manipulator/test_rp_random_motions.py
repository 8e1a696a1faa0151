"""The Taylor method on the built FMU, at motions that could mislead it, against heyoka."""

import numpy as np
import pytest

from tests.rp_manipulator.random_motions import (
    ALLOWED,
    TAYLOR,
    Case,
    Exact,
    judge,
    judge_all,
    simulate,
)
from tests.support.instances import DISCARD, OK, STATES, Instance, LoadedFmu, status_of
from tests.support.symbolic import PARAMETERS

ARM = (2.0, 1.0, 0.1, 0.05, 0.5, 0.25, 0.1, 9.81)
WEIGHTLESS = (*ARM[:7], 0.0)
TOLERANCES = (1e-4, 1e-7, 1e-10, 1e-13)

each_tolerance = pytest.mark.parametrize("tolerance", TOLERANCES)


@pytest.fixture(scope="module")
def exact() -> Exact:
    return Exact()


def case(
    start: tuple[float, ...],
    steps: tuple[float, ...],
    tolerance: float,
    parameters: tuple[float, ...] = ARM,
    tau1: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    f2: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
) -> Case:
    """A motion with the same inputs, value and derivatives, at the begin of each step."""
    inputs = np.array([[tau1, f2]] * len(steps))
    return Case(parameters, start, tolerance, steps, inputs)


# ---- Random motions ----------------------------------------------------------------------------


def test_random_motions_keep_the_tolerance(loaded: LoadedFmu, exact: Exact) -> None:
    outcomes = judge_all(loaded, exact, 300, seed=14)
    assert [outcome for outcome in outcomes if not outcome.error <= outcome.allowed] == []


# ---- Series whose first terms are no measure of the others -------------------------------------


@each_tolerance
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("dq1", [0.0, 1e-9, 5.0])
def test_inputs_whose_first_derivatives_vanish(
    loaded: LoadedFmu, exact: Exact, tolerance: float, order: int, dq1: float
) -> None:
    grows = tuple(60.0 if k == order else 0.0 for k in range(4))
    for parameters in (WEIGHTLESS, (2.0, 1.0, 0.1, 0.05, 0.5, 0.25, 0.0, 0.0)):
        for tau1, f2 in ((grows, (0.0,) * 4), ((0.0,) * 4, grows), (grows, grows)):
            start = (0.3, 0.1, dq1, 0.0)
            moved = case(start, (0.5, 1.0), tolerance, parameters, tau1, f2)
            outcome = judge(loaded, exact, moved)
            assert outcome.error <= outcome.allowed


@each_tolerance
@pytest.mark.parametrize("a", [0.0, 0.1])
def test_constant_efforts_from_rest_with_link_2_at_the_joint(
    loaded: LoadedFmu, exact: Exact, tolerance: float, a: float
) -> None:
    """From L = 0 the solution has the powers 1, 2, 5, 6, 9, 10 ... of time and none between."""
    parameters = (2.0, 1.0, 0.1, 0.05, 0.0, 0.25, a, 0.0)
    held = (5.0, 0.0, 0.0, 0.0)
    for h in (0.01, 0.1, 1.0):
        start = case((0.0, 0.0, 0.0, 0.0), (h, h), tolerance, parameters, held, held)
        outcome = judge(loaded, exact, start)
        assert outcome.error <= outcome.allowed, h


@each_tolerance
@pytest.mark.parametrize(
    ("tau1", "f2", "h"),
    [
        ((0.0, 0.0, 60.0, 0.0), (0.0,) * 4, 1.0),
        ((0.0, 0.0, 600.0, 0.0), (0.0,) * 4, 0.25),
        ((0.0,) * 4, (0.0, 0.0, 60.0, 0.0), 1.0),
        ((0.0, 0.0, 0.0, 60.0), (0.0, 0.0, 0.0, 60.0), 1.0),
        ((0.0, 0.0, 0.0, 1e-3), (0.0, 30.0, 0.0, 0.0), 0.5),
        ((0.0, 0.0, 0.0, 1e-9), (0.0, 500.0, 0.0, 0.0), 0.1),
    ],
)
@pytest.mark.parametrize("beside", [0.0, 1e-12, 1e-9])
def test_motions_from_rest_with_link_2_at_the_joint(
    loaded: LoadedFmu,
    exact: Exact,
    tolerance: float,
    tau1: tuple[float, ...],
    f2: tuple[float, ...],
    h: float,
    beside: float,
) -> None:
    """Up to seven orders in turn vanish, or nearly so; those behind them matter."""
    start = (0.0, -0.5 + beside, 0.0, 0.0)
    moved = case(start, (h, h), tolerance, WEIGHTLESS, tau1, f2)
    outcome = judge(loaded, exact, moved)
    assert outcome.error <= outcome.allowed


@each_tolerance
def test_a_swing_that_hides_its_middle_orders(
    loaded: LoadedFmu, exact: Exact, tolerance: float
) -> None:
    parameters = (1.0, 1.0, 1.0, 0.0, 0.5, 0.0, -1.0, 9.81)
    start = (-np.pi / 2, -0.5, 1e-6, 0.0)
    moved = case(start, (0.01, 0.01), tolerance, parameters, tau1=(0.0, 300.0, 0.0, 0.0))
    outcome = judge(loaded, exact, moved)
    assert outcome.error <= outcome.allowed


@each_tolerance
@pytest.mark.parametrize("deviation", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
def test_starts_beside_the_upright_equilibrium(
    loaded: LoadedFmu, exact: Exact, tolerance: float, deviation: float
) -> None:
    """The deviation doubles every 0.15 s and is within the tolerance at first."""
    parameters = (*ARM[:6], 0.0, 9.81)
    for h in (0.01, 0.3, 1.0):
        start = (np.pi / 2 + deviation, 0.1, 0.0, 0.0)
        held = (9.81, 0.0, 0.0, 0.0)  # the weight of link 2
        outcome = judge(loaded, exact, case(start, (h,) * 5, tolerance, parameters, f2=held))
        assert outcome.error <= outcome.allowed


@each_tolerance
def test_a_turn_that_the_efforts_keep_even_at_first(
    loaded: LoadedFmu, exact: Exact, tolerance: float
) -> None:
    """The efforts suit q1 = w t, L = L0 + b t^3 but for the order 5 of the momentum: of the states,
    the orders 4 and 5 vanish and the order 6 does not.
    """
    m2, w, L0, b = 1.0, 3.0, 0.3, 0.7
    parameters = (0.0, m2, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0)
    tau1 = (0.0, 0.0, 12.0 * m2 * w * b * L0, 0.0)
    f2 = (-m2 * w**2 * L0, 6.0 * m2 * b, 0.0, -6.0 * m2 * w**2 * b)
    for h in (0.01, 0.1, 0.4, 1.0):
        turn = case((0.0, L0, w, 0.0), (h,), tolerance, parameters, tau1, f2)
        outcome = judge(loaded, exact, turn)
        assert outcome.error <= outcome.allowed, h


def test_rest_stays_rest(loaded: LoadedFmu) -> None:
    rest = case((0.3, -0.5, 0.0, 0.0), (1e-9, 1.0, 1e6), 1e-8, WEIGHTLESS)
    assert np.all(simulate(loaded, rest) == rest.start)


# ---- Extremes ----------------------------------------------------------------------------------


@each_tolerance
def test_tiny_steps(loaded: LoadedFmu, exact: Exact, tolerance: float) -> None:
    h = 2.0**-30  # 0.9 ns
    start = (1.0, 0.2, 30.0, -5.0)
    sloped = case(start, (h,) * 20, tolerance, tau1=(5.0, 1e3, 1e6, 1e9))
    outcome = judge(loaded, exact, sloped)
    assert outcome.error <= outcome.allowed


@each_tolerance
@pytest.mark.parametrize(
    ("parameters", "h"), [(WEIGHTLESS, 1e6), (ARM, 100.0)], ids=["weightless", "falling"]
)
def test_huge_steps(
    loaded: LoadedFmu, exact: Exact, tolerance: float, parameters: tuple[float, ...], h: float
) -> None:
    """Link 2 flies off, or falls 50 km."""
    flight = case((0.4, 0.1, 2.0, 1.0), (h,), tolerance, parameters)
    outcome = judge(loaded, exact, flight)
    assert outcome.error <= outcome.allowed


def step_within(loaded: LoadedFmu, moved: Case, most_steps: int) -> tuple[int, list[float]]:
    """Status of the first step of a case, and the states after it."""
    values = dict(zip(PARAMETERS, moved.parameters, strict=True))
    values |= dict(zip(STATES, moved.start, strict=True))
    with Instance(loaded) as instance:
        names = ("solver_method", "max_internal_steps")
        instance.fmi.setInteger([loaded.references[n] for n in names], [TAYLOR, most_steps])
        instance.initialize(relative_tolerance=moved.tolerance, **values)
        return status_of(instance.step, 0.0, moved.steps[0]), instance.get(*STATES)


def test_a_motion_that_takes_too_many_steps_is_given_up(loaded: LoadedFmu) -> None:
    falling = case((0.4, 0.1, 2.0, 1.0), (1e6,), 1e-8, ARM)
    status, states = step_within(loaded, falling, 20)
    assert status == DISCARD
    assert np.all(np.isfinite(states))
    status, _ = step_within(loaded, falling, 2000)
    assert status == OK


@pytest.mark.parametrize("exponent", [8, 20, 77, 110, 150, 160, 200, 250, 300, 304])
@pytest.mark.parametrize("moving", [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-0.5, -1.0)])
def test_extreme_speeds_are_refused_or_right(
    loaded: LoadedFmu, exact: Exact, exponent: int, moving: tuple[float, float]
) -> None:
    speed = 10.0**exponent
    start = (0.3, 0.2, speed * moving[0], speed * moving[1])
    for h in (1.0, 1e-3, 2.0 / speed, 0.01 / speed):
        moved = case(start, (h,), 1e-8, WEIGHTLESS)
        status, states = step_within(loaded, moved, 2000)
        if status != OK:
            assert status == DISCARD
            continue
        expected = exact.states(moved)
        error = np.max(np.abs(states - expected[1]) / moved.unit(expected)[1])
        assert error <= ALLOWED or error <= exact.growth(moved, expected)[0], h
