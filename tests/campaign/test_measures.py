"""What is kept of a run, of motions whose measures are known; and expressions."""

import math

import numpy as np
import pytest

from rparm.campaign.measures import LYAPUNOV, Measure, Recorded, plain
from rparm.expressions import evaluation as expressions

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


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2 * x + 1", 7.0),
        ("-(x - 5) ** 2 / 4", -1.0),
        ("sqrt(part.y)", 4.0),
        ("2 ** -x", 0.125),
        ("sin(pi / 2) + cos(0) + log(exp(2))", 4.0),
    ],
)
def test_expressions(text: str, expected: float) -> None:
    value = expressions.parsed(text).value({"x": 3.0, "part.y": 16.0})
    assert value == pytest.approx(expected)


def test_names_of_an_expression() -> None:
    assert expressions.parsed("a * part.b + sqrt(c) * pi").names == {"a", "part.b", "c"}


@pytest.mark.parametrize(
    "text",
    ["", "1 +", "x if y else z", "[1]", "f(x)", "sqrt(x, y)", "sqrt.real", "x()", "'a'", "True"]
    + ["lambda: 1", "x @ y", "x // 2", "(y := 3)", "a[0]", "__import__('os')", "x." * 600 + "x"]
    + ["(" * 900],
)
def test_what_is_no_expression_is_refused(text: str) -> None:
    if text == "sqrt.real":  # a name like any other: no attribute of anything
        assert expressions.parsed(text).names == {"sqrt.real"}
        return
    with pytest.raises(ValueError):
        expressions.parsed(text)


@pytest.mark.parametrize("text", ["1 / x", "sqrt(x - 1)", "log(x)", "(x - 1) ** 0.5", "exp(1e9)"])
def test_a_value_that_is_not_defined(text: str) -> None:
    with pytest.raises((ArithmeticError, ValueError)):
        expressions.parsed(text).value({"x": 0.0})
