"""What moves an event, and when gradients are no longer exact."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.equations.examples import METHODS, loaded
from tests.gradients.models import EXACT, fmus, run
from tests.support.instances import Instance

EACH_METHOD = pytest.mark.parametrize("method", METHODS)
STOP, STEP = 2.0, 0.125  # s


def ended(
    method: str, *names: str, at: Callable[[float], tuple[float, float]], model: str = "Causes"
) -> list[float]:
    """Values of a model at 2 s; `at` gives the input and its derivative from a time on."""
    with Instance(loaded(fmus()[model])) as instance:
        instance.begin(tolerance=1e-10)
        instance.fmi.setInteger([instance.loaded.references["solver_method"]], [METHODS[method]])
        instance.set(u=at(0.0)[0])
        instance.fmi.exitInitializationMode()
        for k in range(round(STOP / STEP)):
            value, slope = at(k * STEP)
            instance.set(u=value)
            instance.set_input_derivatives(u=[slope])
            instance.step(k * STEP, STEP)
        assert instance.fmi.getBoolean([instance.loaded.references[EXACT]]) == [True]
        return instance.get(*names)


@EACH_METHOD
def test_an_event_that_another_one_permits_moves_with_that(method: str) -> None:
    """The other's mode lets it happen, by `while` or within its condition, that held before."""
    names = [f"{x}_by_{p}" for x in "zw" for p in ("p", "q", "c", "start_y")]
    found = ended(method, *names, at=lambda _: (9.0, 0.0))
    assert found == pytest.approx([8, 0, 0, 4, 24, 0, 0, 12], abs=1e-9)


@EACH_METHOD
def test_an_event_of_slope_0_moves_with_what_caused_it(method: str) -> None:
    """By a mode, an input that jumps at 1 s, a tick (the third: 2 Ts), or the start."""
    names = [f"{x}_by_{p}" for x in ("z", "w", "n", "r") for p in ("p", "q", "Ts", "start_y")]
    found = ended(method, *names, at=lambda t: (9.0 if t < 0.9 else 0.0, 0.0), model="Flat")
    wanted = [1, 0, 0, 0] + [0, 0, 0, 0] + [0, 0, 2, 0] + [0, 1, 0, 0]
    assert found == pytest.approx(wanted, abs=1e-12)


@EACH_METHOD
def test_an_event_at_the_start_does_not_move(method: str) -> None:
    names = [f"n_by_{p}" for p in ("p", "q", "c", "start_s")]
    assert ended(method, *names, at=lambda _: (9.0, 0.0)) == pytest.approx([2, 0, 0, 1], abs=1e-12)


@EACH_METHOD
@pytest.mark.parametrize(
    ("at", "wanted"),
    [
        pytest.param(lambda _: (1.8, 0.0), (-1.8 / 4, -1.125), id="rests"),
        pytest.param(lambda t: (1.8 + t / 2, 0.5), (-0.8, -2.0), id="moves"),  # not -0.6, -1.5
        pytest.param(lambda t: (9.0 if t < 0.6 else 0.0, 0.0), (0.0, 0.0), id="jumps"),
    ],
)
def test_an_input_moves_the_event_where_it_is_met(
    method: str, at: Callable, wanted: tuple[float, float]
) -> None:
    """x = c t meets u + s t at u / (c - s), and moves by -u / (c - s)^2; at a jump by nothing."""
    assert ended(method, "met_by_c", "r_by_c", at=at) == pytest.approx(wanted, abs=1e-9)


ODD = [
    ({}, None),
    ({"p": 1.0, "q": 1.0}, 1.0),  # z: 2 z + 1 or 2 (z + 1)
    ({"p": 1.0, "q": 1.3}, None),
    ({"r": 1.0}, None),  # two events by one cause
    ({"p": 1.0, "r": 1.0}, 1.0),
    ({"top": 1.8 - 1e-8}, 0.4),
    ({"top": 1.8 + 1e-8}, 0.4),
    ({"top": 1.7}, None),
    ({"top": 1.9}, None),
]


@EACH_METHOD
@pytest.mark.parametrize(("start", "end"), ODD, ids=[str(start) for start, _ in ODD])
def test_gradients_are_exact_until(method: str, start: dict, end: float | None) -> None:
    """A touch or near miss, or another order of events; without these to the end."""
    are_exact_until(end or 9.0, run(fmus()["Odd"], method, 1.9, 0.1, **start))


def are_exact_until(end: float, found: np.ndarray) -> None:
    away = abs(found["time"] - end) > 0.03
    assert found[EXACT][away].tolist() == (found["time"] < end)[away].tolist()


@EACH_METHOD
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("flat", [1.0, 1.04])
def test_gradients_end_at_a_slope_of_0(method: str, tolerance: float, flat: float) -> None:
    """At a communication point and between two."""
    start = {"flat": flat, "x": -(flat**3)}
    are_exact_until(flat, run(fmus()["Cube"], method, 1.9, 0.1, tolerance=tolerance, **start))


@EACH_METHOD
def test_two_events_by_one_cause(method: str) -> None:
    """z = 3 (1 + 0.1 r) + 2 + 0.1 (t - r); likewise with parameters that move neither event."""
    found = run(fmus()["Odd"], method, 1.9, 0.1, r=1.05)
    assert found["z_by_r"][-1] == pytest.approx(0.2, abs=1e-10)
    found = run(fmus()["Alike"], method, 1.9, 0.1)
    assert found[EXACT].all()
    assert found["z_by_start_z"][-1] == pytest.approx(2.0, abs=1e-12)


@pytest.mark.parametrize(("method", "top"), [*product(METHODS, [1.7, 1.75])])
def test_a_ceiling_away_from_the_apex(method: str, top: float) -> None:
    """h = top - v s - 5 s^2, s after (4 - v) / 10, where v = sqrt(16 - 20 (top - 1))."""
    found = run(fmus()["Odd"], method, 1.9, 0.1, top=top)
    v = (16 - 20 * (top - 1)) ** 0.5
    slope = 2 + 20 * (1.9 - (4 - v) / 10) / v
    assert found["h_by_top"][-1] == pytest.approx(slope, rel=1e-9)


@EACH_METHOD
def test_what_begins_at_its_limit(method: str) -> None:
    """By the limit the run has two derivatives; by what does not move it, one."""
    assert not run(fmus()["Ties"], method, 1.0, 0.25)[EXACT][0]
    assert run(fmus()["Ties"], method, 1.0, 0.25, L=0.9)[EXACT].all()


@EACH_METHOD
def test_kinks_say_nothing(method: str) -> None:
    """Both sides of abs and max are equal, also where the slope is 0 or the run begins there."""
    assert run(fmus()["Kinks"], method, 2.0, 0.25)[EXACT].all()


@EACH_METHOD
@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-9])
def test_gradients_go_on_beyond_the_end_of_a_branch(method: str, tolerance: float) -> None:
    """Where a trial step looks at the power of a negative number: against variations by scipy."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        above = max(x[0] - 1.0, 0.0)
        slope = -3.0 * above**0.5
        power = above**1.5
        return [np.cos(t) - 2 * power, np.cos(t) + slope * x[1], -power + slope * x[2]]

    found = run(fmus()["Weir"], method, 9.0, 0.5, tolerance=tolerance)
    wanted = solve_ivp(rates, (0, 9), [0.5, 0, 0], "DOP853", rtol=1e-11, atol=1e-12).y[1:, -1]
    given = [found[name][-1] for name in ("h_by_q", "h_by_w")]
    assert given == pytest.approx(wanted, abs=100 * tolerance)


@EACH_METHOD
def test_parts_that_switch_at_once_each_move_at_their_own_time(method: str) -> None:
    """Two balls that know nothing of each other: only the first one's start moves it."""
    found = run(fmus()["Twins"], method, 1.9, 0.1)
    assert found[EXACT].all()
    assert found["h1_by_e"] == pytest.approx(found["h2_by_e"], abs=1e-12)
    assert found["v1_by_start_v1"][-1] == pytest.approx(1.0, abs=1e-9)
    assert not found["v2_by_start_v1"].any() and not found["h2_by_start_v1"].any()
