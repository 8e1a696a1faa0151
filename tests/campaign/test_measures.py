"""What is kept of a run, of motions whose measures are known."""

import math

import numpy as np
import pytest

from rparm.campaign.job import LYAPUNOV, Measure, Recorded, plain

TIMES = np.linspace(3.0, 5.0, 20001)
ELAPSED = TIMES - 3.0
SINE = np.sin(2 * np.pi * ELAPSED)
DECAY = np.exp(-3 * ELAPSED)
CIRCLE = np.cos(ELAPSED), np.sin(ELAPSED)
NONE = np.zeros(0)


def of(measure: Measure, *columns: np.ndarray, growth: np.ndarray = NONE) -> float:
    recorded = Recorded(TIMES, np.column_stack(columns or [TIMES]), growth)
    return measure.value(recorded, range(len(columns)))


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("start", DECAY, 1.0),
        ("final", DECAY, math.exp(-6)),
        ("minimum", SINE, -1.0),
        ("maximum", SINE, 1.0),
        ("rms", SINE, math.sqrt(0.5)),
        ("rms", ELAPSED, 2 / math.sqrt(3)),
        ("integral", DECAY, (1 - math.exp(-6)) / 3),
        ("integral", SINE, 0.0),
    ],
)
def test_plain_measures(kind: str, values: np.ndarray, expected: float) -> None:
    assert of(plain(kind, "x"), values) == pytest.approx(expected, abs=1e-8)


def test_a_distance_is_that_of_points() -> None:
    names = ("x", "x_ref", "y", "y_ref")
    columns = CIRCLE[0], 2 * CIRCLE[0], CIRCLE[1], 2 * CIRCLE[1]
    for kind in ("largest_distance", "rms_distance"):
        assert of(Measure("d", names, kind), *columns) == pytest.approx(1.0, abs=1e-12)
    shifted = CIRCLE[0], CIRCLE[0] + 0.3 * ELAPSED, CIRCLE[1], CIRCLE[1]
    largest = of(Measure("d", names, "largest_distance"), *shifted)
    rms = of(Measure("d", names, "rms_distance"), *shifted)
    assert largest == pytest.approx(0.6) and rms == pytest.approx(0.6 / math.sqrt(3))


def test_settling_is_the_last_entry_into_the_band() -> None:
    def settling(values: np.ndarray, target: float, band: float) -> float:
        return of(Measure("s", ("x",), "settling", (target, band)), values)

    assert settling(DECAY, 0.0, 0.05) == pytest.approx(math.log(20) / 3, abs=2e-4)
    damped = DECAY * np.cos(20 * ELAPSED)
    outside = ELAPSED[np.abs(damped) > 0.02]
    assert settling(damped, 0.0, 0.02) == pytest.approx(outside[-1] + 1e-4, abs=1e-9)
    assert settling(SINE, 0.0, 2.0) == 0.0
    assert math.isnan(settling(DECAY, 1.0, 0.1))


def test_crossings_are_counted_upwards() -> None:
    assert of(Measure("c", ("x",), "crossings", (0.5,)), SINE) == 2
    assert of(Measure("c", ("x",), "crossings", (1.5,)), SINE) == 0
    assert of(Measure("c", ("x",), "crossings", (0.5,)), DECAY) == 0


def test_an_exponent_is_the_mean_growth() -> None:
    growth = np.tile([2.0, 1.0, 0.5, 2.0], 5000)
    expected = 5000 * math.log(2) / 2
    assert of(Measure(LYAPUNOV, (), LYAPUNOV), growth=growth) == pytest.approx(expected, rel=1e-12)
    strong = np.full(20000, 1e30)  # neither product nor sum overflows
    expected = 20000 * math.log(1e30) / 2
    assert of(Measure(LYAPUNOV, (), LYAPUNOV), growth=strong) == pytest.approx(expected, rel=1e-12)
