"""What of a run a page holds: no peak is lost, rounding is no number, colours are apart."""

import re
from itertools import combinations

import numpy as np
import pytest

from rparm.report.pages import ASSET_SOURCES
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


# ---- Colours of the pages ------------------------------------------------------------------------


TEXTS = ("ink", "muted", "accent", "good", "bad")
LINES = ("reference", "effort", "stop", *(f"curve{i}" for i in range(1, 7)))
# responses of the three kinds of cones to linear sRGB (Hunt-Pointer-Estevez, D65), and what a
# missing kind would have seen, from the two that are left
CONES = np.array(
    [[0.31399, 0.63951, 0.04650], [0.15537, 0.75789, 0.08670], [0.01775, 0.10945, 0.87257]]
)
BLIND = {
    "protan": np.array([[0, 1.05118, -0.05116], [0, 1, 0], [0, 0, 1]]),
    "deutan": np.array([[1, 0, 0], [0.95131, 0, 0.04866], [0, 0, 1]]),
}


def schemes() -> dict[str, dict[str, np.ndarray]]:
    """Colours as linear sRGB, (3,) each, of light and dark."""
    text = (ASSET_SOURCES / "page.css").read_text(encoding="utf-8")
    blocks = re.findall(r":root \{(.*?)\}", text, re.DOTALL)
    assert len(blocks) == 2
    found = {}
    for name, block in zip(("light", "dark"), blocks, strict=True):
        colours = dict(re.findall(r"--(\w+): #([0-9a-f]{6});", block))
        found[name] = {key: linear(value) for key, value in colours.items()}
    return found


def linear(code: str) -> np.ndarray:
    values = np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def luminance(colour: np.ndarray) -> float:
    return float(colour @ (0.2126, 0.7152, 0.0722))


def contrast(one: np.ndarray, other: np.ndarray) -> float:
    """Ratio of WCAG: 1 to 21."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def lab(colour: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB, (3,)."""
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    ratio = to_xyz @ np.clip(colour, 0, 1) / (0.9505, 1.0, 1.089)
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_and_lines_stand_out(scheme: str) -> None:
    colours = schemes()[scheme]
    for name in TEXTS:
        for ground in ("paper", "panel"):
            assert contrast(colours[name], colours[ground]) >= 4.5, (name, ground)
    for name in LINES:
        assert contrast(colours[name], colours["paper"]) >= 3.0, name


@pytest.mark.parametrize("kind", [None, *BLIND])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_of_curves_differ(scheme: str, kind: str | None) -> None:
    """Of the first four curves, by ten units of CIE 1976 at least; two is what an eye notices."""
    colours = schemes()[scheme]
    seen = np.eye(3) if kind is None else np.linalg.inv(CONES) @ BLIND[kind] @ CONES
    for one, other in combinations([f"curve{i}" for i in range(1, 5)], 2):
        distance = np.linalg.norm(lab(seen @ colours[one]) - lab(seen @ colours[other]))
        assert distance >= 10, (one, other, distance)
