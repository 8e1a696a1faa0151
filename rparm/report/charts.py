"""Charts of a page: their data, which `assets/diagrams.js` makes traces and axes of plotly of."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rparm.report import pages
from rparm.report.pages import PageTable, RunPage

Data = dict[str, Any]
DIGITS = 7  # of numbers


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart; `text` is for readers who do not see it, `kind` is a function of diagrams.js."""

    title: str
    text: str
    kind: str
    data: Data
    height: int = 22  # of its drawing, in units of the text's size

    @property
    def json(self) -> str:
        return script(self.data | {"kind": self.kind})


def write_page(
    path: Path, page: RunPage, first: PageTable, drawn: Sequence[Chart], rest: str, root: str
) -> Path:
    """Write a page with a table and charts before its plots, headed `rest`; its path."""
    values = {"page": page, "data": page.data and page.data.json(), "root": root}
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
