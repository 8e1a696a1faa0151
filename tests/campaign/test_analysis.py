"""Measures of motions where they are known; Sobol' indices, quantiles, worst cases, charts."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rparm.campaign import page
from rparm.campaign.job import LYAPUNOV, Measure, Recorded, plain
from rparm.campaign.page import Index
from rparm.campaign.planning import Points
from rparm.report import charts
from tests.campaign.files import ARM, campaign

# ---- Measures of a run ---------------------------------------------------------------------------


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


# ---- All runs ------------------------------------------------------------------------------------


A, B = 7.0, 0.1  # Ishigami's sin x + A sin^2 y + B z^4 sin x, in the literature's parameters
PARAMETERS = "".join(
    f"[parameters.{name}]\nuniform = [{-math.pi!r}, {math.pi!r}]\n" for name in "xyz"
)
TEXT = ARM[: ARM.index("[parameters.m2]")] + PARAMETERS + ARM[ARM.index("[keep]") :]


def ishigami_indices() -> tuple[list[float], list[float]]:
    """First-order and total indices, by integration."""
    x = 0.5 * (1 + B * math.pi**4 / 5) ** 2
    y = A**2 / 8
    xz = B**2 * math.pi**8 * (1 / 18 - 1 / 50)
    total = x + y + xz
    return [x / total, y / total, 0.0], [(x + xz) / total, y / total, xz / total]


@pytest.mark.parametrize("seed", [3, 8, 31])
def test_indices_of_ishigami_are_within_their_confidence(seed: int, tmp_path: Path) -> None:
    changes = [("sobol", "indices"), ("40", "2048"), ("seed = 3", f"seed = {seed}")]
    given = campaign(tmp_path, TEXT, changes)
    x, y, z = Points(given, {}).of(range(given.count)).T
    found = page.sobol_indices(given, np.sin(x) + A * np.sin(y) ** 2 + B * z**4 * np.sin(x))
    first, total = ishigami_indices()
    assert [row.parameter for row in found] == ["x", "y", "z"]
    for row, known_first, known_total in zip(found, first, total, strict=True):
        assert abs(row.first - known_first) <= max(row.first_confidence, 2e-3)
        assert abs(row.total - known_total) <= max(row.total_confidence, 2e-3)
        assert row.first_confidence < 0.12 and row.total_confidence < 0.12


def test_groups_with_a_failed_run_are_left_out(tmp_path: Path) -> None:
    given = campaign(tmp_path, TEXT, [("sobol", "indices"), ("40", "512")])
    x, y, _ = Points(given, {}).of(range(given.count)).T
    values = 3 * x + 4 * y
    values[[2, 700]] = np.nan
    assert len(page.saltelli_groups(given, values)) == 510
    found = page.sobol_indices(given, values)
    for row, known in zip(found, (9 / 25, 16 / 25, 0.0), strict=True):
        assert abs(row.first - known) <= max(row.first_confidence, 2e-3)


def test_what_does_not_vary_has_no_indices(tmp_path: Path) -> None:
    given = campaign(tmp_path, TEXT, [("sobol", "indices"), ("40", "8")])
    assert page.sobol_indices(given, np.full(given.count, 3.0)) == []
    assert page.sobol_indices(given, np.full(given.count, np.nan)) == []


def test_the_worst_runs_come_first() -> None:
    values = np.array([3.0, np.nan, 9.0, 1.0, 9.0] + [0.0] * 20)
    assert page.worst(values)[:4] == [2, 4, 0, 3]
    assert len(page.worst(values)) == 10


def test_quantiles_leave_out_failed_runs() -> None:
    values = np.append(np.arange(101.0), [np.nan, np.inf])
    assert page.quantiles(values) == [0, 5, 50, 95, 100]
    assert np.isnan(page.quantiles(np.array([np.nan]))).all()


def test_failures_are_counted_by_reasons_apart_from_numbers() -> None:
    found = page.failures(["", "a", "b", "", "b"])
    assert [(x.reason, x.count, x.run) for x in found] == [("b", 2, 2), ("a", 1, 1)]
    many = [f"m2 = {-1.5e-3 * i} is refused at t = {i / 8}s: 1e-09 to inf" for i in range(1000)]
    found = page.failures([*many, "m1 = 2 is refused", "m1 = -.5e+7 is refused", "m1 = nan"])
    assert [(x.reason, x.count, x.run) for x in found] == [
        (many[0], 1000, 0),
        ("m1 = 2 is refused", 2, 1000),
        ("m1 = nan", 1, 1002),
    ]


# ---- Charts of odd values, and of very many runs -------------------------------------------------


RANDOM = np.random.default_rng(4)
NARROW = {
    "two neighbours": np.repeat([1.0, np.nextafter(1.0, 2.0)], 30),
    "conserved": -10.36 + 1e-14 * RANDOM.standard_normal(200),
    "final(q2)": 0.29970 + 1e-7 * RANDOM.standard_normal(200),
    "wide": 1e5 * RANDOM.random(200),
    "counts": RANDOM.integers(0, 3, 40).astype(float),
    "one": np.array([3.0, np.nan]),
    "the same": np.full(9, 0.1),
    "too far apart": np.array([-1.7e308, 1.7e308, np.inf]),
}


def test_a_histogram_has_a_bar_where_runs_are_and_rounding_has_none() -> None:
    drawn = {name for name, values in NARROW.items() if page.bars(values)}
    assert drawn == {"final(q2)", "wide", "counts"}
    grid = np.repeat(np.linspace(-4.7, 1.57, 48), 40)  # as often at each point: bars are even
    for values, count in ((grid, 48), (NARROW["counts"], 3)):
        heights = [float(part.split("h")[0]) for part in page.bars(values).split("V")[1:-1]]
        assert len(heights) == count and min(heights) == 0.0
        assert (max(heights) == 0.0) == (values is grid)


def test_numbers_that_hardly_differ_are_told_apart() -> None:
    """By a hundredth of their range; others have seven digits."""
    for name in ("final(q2)", "conserved", "two neighbours"):
        values = NARROW[name]
        shown = np.array(json.loads(charts.script(values)))
        assert np.abs(shown - values).max() <= 0.01 * np.ptp(values)
    assert json.loads(charts.script(np.array([0, np.pi, np.nan]))) == [0, 3.141593, None]


def test_a_rank_correlation_sees_any_monotone_dependence() -> None:
    x = RANDOM.standard_normal(500)
    assert page.rank_correlation(x, np.exp(-3 * x)) == pytest.approx(-1.0)
    assert abs(page.rank_correlation(x, RANDOM.standard_normal(500))) < 0.2
    gap = np.where(np.arange(500) % 7, x**3, np.nan)
    assert page.rank_correlation(x, gap) == pytest.approx(1.0)
    assert np.isnan(page.rank_correlation(x, np.full(500, 2.0)))


def test_a_map_leaves_out_what_has_no_value_and_stays_small() -> None:
    x, y = (part.ravel() for part in np.meshgrid(np.arange(3.0), np.arange(4.0)))
    colour, some = x + 10 * y, np.arange(12)
    colour[[2, 7]] = np.nan
    chart, count = page.map_chart(["x", "y", "c"], x, y, colour, some)
    assert count == 10 and np.array_equal(chart.data["z"].ravel(), colour, equal_nan=True)
    x[5] = np.nan  # no grid any more
    chart, count = page.map_chart(["x", "y", "c"], x, y, colour, some)
    assert count == len(chart.data["x"]) == 12 - 3
    sides = np.arange(400.0), np.arange(250.0)
    x, y = (part.ravel() for part in np.meshgrid(*sides))
    chart, count = page.map_chart(["x", "y", "c"], x, y, x - y, np.arange(len(x)))
    assert count == 200 * 125 and np.array_equal(
        chart.data["z"], chart.data["x"] - chart.data["y"][:, None]
    )


def test_of_100000_runs_few_are_drawn_the_extreme_ones_among_them() -> None:
    results = {"a": RANDOM.standard_normal(100_000), "b": RANDOM.random(100_000)}
    results["b"][:1000] = np.nan
    order = RANDOM.permutation(100_000)
    campaign = SimpleNamespace(worst=["a"])
    made = SimpleNamespace(drawn=results, table=results, order=order, campaign=campaign)
    runs = page.Page.sample.fget(made)
    assert page.POINTS <= len(runs) <= page.POINTS + 14
    for values in results.values():
        assert {np.nanargmin(values), np.nanargmax(values)} <= set(runs.tolist())


def test_texts_of_files_are_no_html() -> None:
    chart = page.indices_chart("x", [Index("</script><b>", 0.5, 0.1, 0.6, np.nan)])
    assert "<" not in chart.json and json.loads(chart.json)["rows"][0]["total_confidence"] is None
