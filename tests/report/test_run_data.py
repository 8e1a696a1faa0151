"""What of a run a page holds: no peak is lost, and rounding is no number."""

import numpy as np
import pytest

from rparm.report.run_data import MOST_ROWS, Curve, Plot, thinned, without_rounding  # fmt: skip


def series(kind: str, count: int, random: np.random.Generator) -> np.ndarray:
    """Noise, a random walk, a single row that stands out, or 0s and 1s."""
    noise = random.standard_normal(count)
    spike = np.sin(np.linspace(0.0, 9.0, count))
    spike[random.integers(count)] = random.choice([-5.0, 5.0])
    courses = {"noise": noise, "walk": np.cumsum(noise), "spike": spike, "switch": noise > 2.0}
    return courses[kind].astype(float)


@pytest.mark.parametrize("kind", ["noise", "walk", "spike", "switch"])
def test_extremes_survive(kind: str) -> None:
    """Of the whole run, and of each of its parts where there is room for them.

    An interval with one smallest and one largest value may reach into two parts.
    """
    random = np.random.default_rng(1)
    for count in (801, 802, 1000, 1601, *random.integers(1000, 60000, 6)):
        for width in (1, 7):
            columns = [series(kind, count, random) for _ in range(width)]
            rows = thinned(columns)
            assert rows[0] == 0 and rows[-1] == count - 1 and (np.diff(rows) > 0).all()
            assert len(rows) <= MOST_ROWS
            assert np.diff(rows).max() <= np.ceil(2 * count / MOST_ROWS)
            for column in columns:
                assert column[rows].min() == column.min() and column[rows].max() == column.max()
            if width > 1:
                continue
            for part in np.array_split(np.arange(count), 20):
                around = 8 * count // MOST_ROWS
                near = (rows >= part[0] - around) & (rows <= part[-1] + around)
                kept = columns[0][rows[near]]
                margin = 2e-6 * np.ptp(columns[0])
                assert kept.min() <= columns[0][part].min() + margin
                assert kept.max() >= columns[0][part].max() - margin


@pytest.mark.parametrize("count", [1, 2, 799, MOST_ROWS])
def test_a_short_run_is_whole(count: int) -> None:
    assert thinned([np.random.default_rng(count).standard_normal(count)]).tolist() == [
        *range(count)
    ]


def test_what_is_not_finite_disturbs_nothing() -> None:
    values = np.sin(np.linspace(0.0, 50.0, 5000))
    values[[10, 2000, 4000]] = np.nan, np.inf, -np.inf
    rows = thinned([values])
    assert {2000, 4000} <= set(rows.tolist()) and len(rows) <= MOST_ROWS


def test_rounding_is_0_and_the_rest_stays() -> None:
    random = np.random.default_rng(2)
    assert without_rounding(np.array([0.5, -2.775558e-17])).tolist() == [0.5, 0.0]
    assert without_rounding(np.array([1e-16, -3e-17])).tolist() == [0.0, 0.0]  # below 1e-3 rad
    for _ in range(200):
        values = random.standard_normal(50) * 10.0 ** random.uniform(-20, 20, 50)
        shown, largest = without_rounding(values), np.abs(values).max()
        changed = shown != values
        assert (shown[changed] == 0).all()
        assert (np.abs(values[changed]) < 1e-12 * max(largest, 1e-3)).all()
        assert (
            shown[np.argmax(np.abs(values))] == values[np.argmax(np.abs(values))] or largest < 1e-15
        )


def test_errors_keep_their_size() -> None:
    """On a logarithmic axis a small number is no rounding of a large one."""
    errors = np.array([1e-3, 1e-17, 0.0])
    plot = Plot("error", "", [Curve("a", errors)], log=True)
    assert "between 0 and 0.001" in plot.text
    assert plot.at(np.array([0, 1])).curves[0].values.tolist() == [1e-3, 1e-17]
