"""Pictures of a campaign: what their axes say, and what is drawn of odd values."""

from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from rparm.campaign import page
from rparm.campaign.page import Index
from rparm.report.pages import save_figure

RANDOM = np.random.default_rng(4)
STRANGE = r"a $\frac$ b"  # no formula of matplotlib's
NARROW = {
    "two neighbours": np.repeat([1.0, np.nextafter(1.0, 2.0)], 30),
    "conserved": -10.36 + 1e-14 * RANDOM.standard_normal(200),
    "final(q2)": 0.29970 + 1e-7 * RANDOM.standard_normal(200),
    "small": 1e-12 * RANDOM.random(200) - 3e-3,
    "wide": 1e5 * RANDOM.random(200),
    "counts": RANDOM.integers(0, 3, 40).astype(float),
    "one": np.array([3.0, np.nan]),
    "the same": np.full(9, 0.1),
    "too far apart": np.array([-1.7e308, 1.7e308, np.inf]),
    STRANGE: np.arange(9.0),
}


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(mpl.text.Text) if text.get_text()]


@pytest.fixture(scope="module")
def histograms(tmp_path_factory: pytest.TempPathFactory) -> Figure:
    figure = page.distributions_figure(NARROW)
    save_figure(figure, tmp_path_factory.mktemp("figures") / "picture.png")
    return figure


def test_every_run_with_a_value_is_in_its_histogram(histograms: Figure) -> None:
    for axes, values in zip(histograms.axes, NARROW.values(), strict=False):
        bars = sum(bar.get_height() for bar in axes.patches)
        told = [text for text in axes.texts if "all runs" in text.get_text()]
        assert bars == np.isfinite(values).sum() or (bars == 0 and told)
    drawn = [bool(axes.patches) for axes in histograms.axes[: len(NARROW)]]
    assert drawn == [name not in ("one", "the same", "too far apart") for name in NARROW]


def test_labels_of_ticks_do_not_overlap(histograms: Figure) -> None:
    for axes in histograms.axes[: len(NARROW)]:
        low, high = axes.get_xlim()
        ticks = zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
        boxes = [label.get_window_extent() for tick, label in ticks if low <= tick <= high]
        assert all(one.x1 < other.x0 for one, other in pairwise(boxes)), axes.get_xlabel()
        assert not axes.xaxis.get_offset_text().get_text()


def test_runs_are_counted_in_whole_numbers(histograms: Figure) -> None:
    for axes in histograms.axes[: len(NARROW)]:
        assert all(tick == round(tick) for tick in axes.get_yticks())


def test_differences_are_those_to_the_number_of_the_label(histograms: Figure) -> None:
    axes = histograms.axes[list(NARROW).index("final(q2)")]
    name, sign, number = axes.get_xlabel().rpartition("\N{MINUS SIGN}")
    assert name.strip() == "final(q2)" and sign
    values = NARROW["final(q2)"] - float(number)
    edges = [bar.get_x() for bar in axes.patches]
    assert min(edges) == pytest.approx(values.min())
    assert max(edges) + axes.patches[-1].get_width() == pytest.approx(values.max())


def test_texts_of_files_are_no_formulas(tmp_path: Path) -> None:
    found = {STRANGE: [Index(STRANGE, 0.5, 0.1, 0.6, np.nan)]}
    x, y = (part.ravel() for part in np.meshgrid(np.arange(3.0), np.arange(4.0)))
    pictures = (
        page.distributions_figure({STRANGE: x}),
        page.indices_figure(found),
        page.heat_map_figure([STRANGE] * 3, x, y, x * y),
    )
    for picture in pictures:
        save_figure(picture, tmp_path / "picture.png")
        assert STRANGE in texts(picture)


def test_a_map_leaves_out_what_has_no_value(tmp_path: Path) -> None:
    x, y = (part.ravel() for part in np.meshgrid(np.arange(3.0), np.arange(4.0)))
    colour = x + 10 * y
    colour[[2, 7]] = np.nan
    figure = page.heat_map_figure(["x", "y", "c"], x, y, colour)
    save_figure(figure, tmp_path / "picture.png")
    cells = figure.axes[0].collections[0].get_array()
    assert np.array_equal(np.ma.filled(cells, np.nan).ravel(), colour, equal_nan=True)
    x[5] = np.nan  # no grid any more
    figure = page.heat_map_figure(["x", "y", "c"], x, y, colour)
    save_figure(figure, tmp_path / "picture.png")
    points = figure.axes[0].collections[0].get_offsets()
    assert len(points) == 12 - 3


def test_a_map_of_what_hardly_varies(tmp_path: Path) -> None:
    x, y = (part.ravel() for part in np.meshgrid(1 + np.arange(3) * 2.0**-52, np.arange(4.0)))
    figure = page.heat_map_figure(["x", "y", "c"], x, y, 5 + x * 1e-15)
    save_figure(figure, tmp_path / "picture.png")
    assert any("x \N{MINUS SIGN} 1" in text for text in texts(figure))
