"""Charts of a campaign: what they have of odd values, and of very many runs."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from rparm.campaign import page
from rparm.campaign.page import Index
from rparm.report import charts

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
