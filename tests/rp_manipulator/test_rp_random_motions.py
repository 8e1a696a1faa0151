"""The Taylor method on the built FMU, at motions that could mislead it, against heyoka."""

from collections.abc import Callable, Iterator
from itertools import product

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


@pytest.mark.parametrize(
    ("count", "seed"), [(300, 14), pytest.param(3000, 0, marks=pytest.mark.long)]
)
def test_random_motions_keep_the_tolerance(
    loaded: LoadedFmu, exact: Exact, count: int, seed: int
) -> None:
    outcomes = judge_all(loaded, exact, count, seed)
    assert [outcome for outcome in outcomes if not outcome.error <= outcome.allowed] == []


# ---- Motions that could mislead a series -------------------------------------------------------

NONE = (0.0, 0.0, 0.0, 0.0)


def vanishing_derivatives(tolerance: float) -> Iterator[Case]:
    """Inputs whose first derivatives vanish."""
    for order, dq1, a in product((1, 2, 3), (0.0, 1e-9, 5.0), (0.1, 0.0)):
        grows = tuple(60.0 if k == order else 0.0 for k in range(4))
        for tau1, f2 in ((grows, NONE), (NONE, grows), (grows, grows)):
            parameters = (*ARM[:6], a, 0.0)
            yield case((0.3, 0.1, dq1, 0.0), (0.5, 1.0), tolerance, parameters, tau1, f2)


def link_2_at_the_joint(tolerance: float) -> Iterator[Case]:
    """From L = 0 under constant efforts the solution has the powers 1, 2, 5, 6, 9, 10 ... of time
    and none between."""
    held = (5.0, 0.0, 0.0, 0.0)
    for a, h in product((0.0, 0.1), (0.01, 0.1, 1.0)):
        parameters = (2.0, 1.0, 0.1, 0.05, 0.0, 0.25, a, 0.0)
        yield case(NONE, (h, h), tolerance, parameters, held, held)


def vanishing_orders(tolerance: float) -> Iterator[Case]:
    """Up to seven orders in turn vanish, or nearly so; those behind them matter."""
    efforts = [
        ((0.0, 0.0, 60.0, 0.0), NONE, 1.0),
        ((0.0, 0.0, 600.0, 0.0), NONE, 0.25),
        (NONE, (0.0, 0.0, 60.0, 0.0), 1.0),
        ((0.0, 0.0, 0.0, 60.0), (0.0, 0.0, 0.0, 60.0), 1.0),
        ((0.0, 0.0, 0.0, 1e-3), (0.0, 30.0, 0.0, 0.0), 0.5),
        ((0.0, 0.0, 0.0, 1e-9), (0.0, 500.0, 0.0, 0.0), 0.1),
    ]
    for beside, (tau1, f2, h) in product((0.0, 1e-12, 1e-9), efforts):
        start = (0.0, -0.5 + beside, 0.0, 0.0)
        yield case(start, (h, h), tolerance, WEIGHTLESS, tau1, f2)


def hidden_middle_orders(tolerance: float) -> Iterator[Case]:
    """A swing that hides its middle orders."""
    parameters = (1.0, 1.0, 1.0, 0.0, 0.5, 0.0, -1.0, 9.81)
    start, tau1 = (-np.pi / 2, -0.5, 1e-6, 0.0), (0.0, 300.0, 0.0, 0.0)
    yield case(start, (0.01, 0.01), tolerance, parameters, tau1)


def upright(tolerance: float) -> Iterator[Case]:
    """Beside the equilibrium: the deviation doubles every 0.15 s and is within the tolerance at
    first."""
    held = (9.81, 0.0, 0.0, 0.0)  # the weight of link 2
    for deviation, h in product((0.0, 1e-15, 1e-12, 1e-9, 1e-6), (0.01, 0.3, 1.0)):
        start = (np.pi / 2 + deviation, 0.1, 0.0, 0.0)
        yield case(start, (h,) * 5, tolerance, (*ARM[:6], 0.0, 9.81), f2=held)


def even_turn(tolerance: float) -> Iterator[Case]:
    """The efforts suit q1 = w t, L = L0 + b t^3 but for the order 5 of the momentum: of the states,
    the orders 4 and 5 vanish and the order 6 does not."""
    m2, w, L0, b = 1.0, 3.0, 0.3, 0.7
    parameters = (0.0, m2, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0)
    tau1 = (0.0, 0.0, 12.0 * m2 * w * b * L0, 0.0)
    f2 = (-m2 * w**2 * L0, 6.0 * m2 * b, 0.0, -6.0 * m2 * w**2 * b)
    for h in (0.01, 0.1, 0.4, 1.0):
        yield case((0.0, L0, w, 0.0), (h,), tolerance, parameters, tau1, f2)


def extreme_steps(tolerance: float) -> Iterator[Case]:
    """Steps of 0.9 ns; link 2 flies off, or falls 50 km."""
    tau1 = (5.0, 1e3, 1e6, 1e9)
    yield case((1.0, 0.2, 30.0, -5.0), (2.0**-30,) * 20, tolerance, tau1=tau1)
    for parameters, h in ((WEIGHTLESS, 1e6), (ARM, 100.0)):
        yield case((0.4, 0.1, 2.0, 1.0), (h,), tolerance, parameters)


MISLEADING = (
    vanishing_derivatives, link_2_at_the_joint, vanishing_orders, hidden_middle_orders, upright,
    even_turn, extreme_steps,
)  # fmt: skip


@pytest.mark.parametrize("tolerance", (1e-4, 1e-7, 1e-10, 1e-13))
@pytest.mark.parametrize("motions", MISLEADING, ids=lambda motions: motions.__name__)
def test_misleading_motions_keep_the_tolerance(
    loaded: LoadedFmu, exact: Exact, tolerance: float, motions: Callable[[float], Iterator[Case]]
) -> None:
    for moved in motions(tolerance):
        outcome = judge(loaded, exact, moved)
        assert outcome.error <= outcome.allowed, outcome


def test_rest_stays_rest(loaded: LoadedFmu) -> None:
    rest = case((0.3, -0.5, 0.0, 0.0), (1e-9, 1.0, 1e6), 1e-8, WEIGHTLESS)
    assert np.all(simulate(loaded, rest) == rest.start)


# ---- Extremes ----------------------------------------------------------------------------------


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
