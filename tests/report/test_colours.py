"""Colours of the pages: contrast in light and dark, and apart for colour-blind readers."""

import re
from itertools import combinations

import numpy as np
import pytest

from rparm.report.pages import ASSET_SOURCES

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
