"""Charts of a page: traces and axes of plotly, which `assets/charts.js` draws.

A text that begins with -- is a colour of `page.css`. Names of traces and titles of axes are plain
texts; what is shown at the pointer (`text`, `hovertemplate`) may have <br>.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from rparm.report import pages
from rparm.report.pages import RunPage, Table

Trace = dict[str, Any]
DIGITS = 7  # of numbers
GAP = 0.06  # between axes above each other, of the height
DASHED = "6px,4px"


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart; `text` is for readers who do not see it."""

    title: str
    text: str
    traces: Sequence[Trace]
    layout: Mapping[str, Any] = field(default_factory=dict)
    height: int = 22  # of its drawing, in units of the text's size

    @property
    def json(self) -> str:
        return script({"traces": self.traces, "layout": self.layout})


def write_page(path: Path, page: RunPage, first: Table, drawn: Sequence[Chart], rest: str) -> Path:
    """Write a page of a section with a table and charts before the plots, headed `rest`."""
    values = {"page": page, "data": page.data and page.data.json(), "root": "../"}
    more = {"first": first, "charts": drawn, "rest": rest}
    return pages.write_page(path, "answers.html", **values, **more)


def script(content: object) -> str:
    """Write JSON for a script element: no text in it ends the element."""
    text = json.dumps(_plain(content), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _plain(content: Any) -> Any:
    """Return lists for arrays, and None for numbers that are not finite."""
    if isinstance(content, Mapping):
        return {name: _plain(value) for name, value in content.items()}
    if isinstance(content, np.ndarray) and content.dtype == float:
        digits, rows = _digits(content), content.tolist()
        return (
            [_numbers(row, digits) for row in rows] if content.ndim > 1 else _numbers(rows, digits)
        )
    if isinstance(content, np.ndarray | list | tuple):
        return [_plain(value) for value in content]
    if isinstance(content, float | np.floating):
        return _numbers([float(content)], DIGITS)[0]
    return int(content) if isinstance(content, np.integer) else content


def _numbers(values: Sequence[float], digits: int) -> list[float | None]:
    return [float(f"{x:.{digits}g}") if math.isfinite(x) else None for x in values]


def _digits(values: np.ndarray) -> int:
    """Return how many digits numbers need to be told apart: more if they hardly vary."""
    numbers = values[np.isfinite(values)]
    with np.errstate(over="ignore"):
        width = np.ptp(numbers) if len(numbers) else 0.0
    if not 0 < width < math.inf:
        return 17 if width else DIGITS
    more = math.log10(max(np.abs(numbers).max() / width, 1.0))
    return min(DIGITS + math.ceil(more), 17)


def curves() -> Iterator[str]:
    """Yield the colours of curves."""
    return cycle(f"--curve{i}" for i in range(1, 7))


def line(colour: str, width: float = 1.6, dash: str = "solid", **more: object) -> Trace:
    """Return the style of a line."""
    return {"color": colour, "width": width, "dash": dash, "simplify": False, **more}


def axis(title: str, log: bool = False, **more: object) -> dict[str, Any]:
    """Return an axis."""
    return {"title": {"text": title}, "type": "log" if log else "linear", **more}


def stacked(*axes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a layout's axes yaxis, yaxis2 ... one below the other."""
    height = (1 + GAP) / len(axes)
    bottoms = [max(1 - (i + 1) * height + GAP, 0.0) for i in range(len(axes))]
    return {
        f"yaxis{i + 1 if i else ''}": {**own, "domain": [low, low + height - GAP]}
        for i, (own, low) in enumerate(zip(axes, bottoms, strict=True))
    }


def vertical(x: float, colour: str = "--muted", dash: str = "2px,3px") -> dict[str, Any]:
    """Return a shape: a line across the whole height."""
    place = {"x0": x, "x1": x, "y0": 0, "y1": 1, "yref": "paper", "layer": "below"}
    return {"type": "line", **place, "line": {"color": colour, "width": 1, "dash": dash}}
