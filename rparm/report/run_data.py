"""Data of a page with plots: what its scripts read, as JSON in the page."""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rparm.runs.comparison import SMALLEST_SCALE

MOST_ROWS = 800  # of a page, so that a report stays small
FEWEST_PACKED = 8  # numbers; shorter lists stay as they are
TIME = "time"  # keeps all digits
LINKS = "links"  # of the motion: for pictures; pages draw by its other values
ROUNDING = 1e-12  # of a variable's scale: less is rounding of its computation
SEEN = 1e-6  # of a column's range: extremes that stand out by less are not seen


@dataclass(frozen=True, eq=False)
class Curve:
    """A line of a plot."""

    name: str
    values: np.ndarray  # (rows,)
    reference: np.ndarray | None = None  # (rows,), drawn dashed above it
    steps: bool = False  # each row ends an interval of this value
    limit: bool = False  # is not a result but a limit of results
    points: bool = False  # is drawn as points below the other curves
    other: np.ndarray | None = None  # (rows,) of another result; NaN where that has none
    difference: np.ndarray | None = None  # (rows,) from it

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """What it has for each row."""
        names = "values", "reference", "other", "difference"
        return {name: x for name in names if (x := getattr(self, name)) is not None}

    def at(self, rows: np.ndarray) -> "Curve":
        """Reduce to some of the rows."""
        return replace(self, **{name: values[rows] for name, values in self.arrays.items()})


@dataclass(frozen=True, eq=False)
class Plot:
    """Curves of one unit over the abscissa of the page."""

    title: str
    unit: str
    curves: Sequence[Curve]
    log: bool = False
    levels: Sequence[tuple[str, float]] = ()  # dashed lines: name and value
    note: str = ""  # meaning of its values

    @property
    def columns(self) -> list[np.ndarray]:
        """Drawn curves, (rows,) each; logarithms on a logarithmic axis."""
        found = [values for curve in self.curves for values in curve.arrays.values()]
        if not self.log:
            return found
        tiny = np.finfo(float).tiny
        return [np.log10(np.maximum(values, tiny)) for values in found]

    def at(self, rows: np.ndarray) -> "Plot":
        """Reduce to some of the rows."""
        return replace(self, curves=[curve.at(rows) for curve in self.curves])

    @property
    def text(self) -> str:
        """Description for readers who do not see it."""
        parts = []
        for curve in self.curves:
            finite = curve.values[np.isfinite(curve.values)]
            if not len(finite):
                parts.append(f"{curve.name} has no finite values")
                continue
            ends = f"from {curve.values[0]:.4g} to {curve.values[-1]:.4g}"
            parts.append(f"{curve.name} {ends}, between {finite.min():.4g} and {finite.max():.4g}")
        unit = f" in {self.unit}" if self.unit else ""
        return f"Plot of {self.title}{unit}: {'; '.join(parts)}"


@dataclass(frozen=True)
class Axis:
    """The abscissa of all plots of a page."""

    title: str = "time"
    unit: str = "s"
    log: bool = False
    reversed: bool = False


@dataclass(frozen=True, eq=False)
class RunData:
    """Everything that the scripts of a page need."""

    name: str
    title: str
    x: np.ndarray  # (rows,) abscissa, in order
    plots: Sequence[Plot]
    axis: Axis = field(default_factory=Axis)
    motion: dict[str, Any] | None = None  # of rparm.report.motion
    other: dict[str, Any] | None = None  # of rparm.report.overlay

    def json(self) -> str:
        """Write text for a script element: no text in it ends the element."""
        packer = _Packer()
        moving = self.motion and {k: x for k, x in self.motion.items() if k != LINKS}
        content = {
            "name": self.name,
            "title": self.title,
            "axis": vars(self.axis),
            TIME: packer.packed(self.x, TIME),
            "plots": [_plot(plot, packer) for plot in self.plots],
            "motion": packer.packed(moving),
            "other": self.other,
            "arrays": packer.arrays,
        }
        text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        return text.replace("<", "\\u003c")


def without_rounding(values: np.ndarray) -> np.ndarray:
    """Return values with 0 for rounding beside the variable's scale, 3e-17 say."""
    scale = max(np.abs(values[np.isfinite(values)]).max(initial=0.0), SMALLEST_SCALE)
    return np.where(np.abs(values) < ROUNDING * scale, 0.0, values)


def result_curve(
    name: str, values: np.ndarray, reference: np.ndarray | None = None, steps: bool = False
) -> Curve:
    """Return the values of a variable over its reference's, without rounding."""
    below = None if reference is None else without_rounding(reference)
    return Curve(name, without_rounding(values), below, steps)


def thinned(columns: Sequence[np.ndarray], most: int = MOST_ROWS) -> np.ndarray:
    """Choose rows to show of columns (rows,): at most `most`, or where the extremes are.

    Half of them at least are at equal distances; the others have the smallest and the largest value
    of each column in each of many equal intervals.
    """
    table = np.nan_to_num(np.column_stack(columns).astype(float), posinf=1e300, neginf=-1e300)
    count = len(table)
    if count <= most:
        return np.arange(count)
    every, widest = -(-count // most), -(-2 * count // most)
    while True:
        grid = np.arange(0, count, min(every, widest))
        rows = np.union1d(grid, _extremes(table, every))
        if len(rows) <= most or every >= count:
            return rows
        every *= 2


def _extremes(table: np.ndarray, every: int) -> np.ndarray:
    """Choose every k-th row of a table (rows, columns), the last, and extremes between."""
    count = len(table)
    bins = -(-count // every)
    padded = np.pad(table, ((0, bins * every - count), (0, 0)), mode="edge")
    padded = padded.reshape(bins, every, -1)
    ends = np.append(np.arange(0, count, every), count - 1)
    margin = SEEN * np.ptp(table, axis=0)
    found = [ends]
    for sign in (1, -1):
        row = np.argmax(sign * padded, axis=1) + ends[:-1, None]  # (bins, columns)
        row = np.minimum(row, count - 1)
        value = np.take_along_axis(table, row, axis=0)
        beside = np.maximum(sign * table[ends[:-1]], sign * table[ends[1:]])
        found.append(row[sign * value > beside + margin])
        found.append(np.argmax(sign * table, axis=0))  # of the whole run, however little it is
    return np.unique(np.concatenate(found))


def narrow(values: np.ndarray) -> np.ndarray:
    """Return floats for doubles, unless one is too large or too small for seven digits."""
    with np.errstate(over="ignore", under="ignore"):
        floats = values.astype(np.float32)
    digits = np.isfinite(floats) & (np.abs(floats) >= np.finfo(np.float32).tiny)
    return floats if (digits | (values == 0) | ~np.isfinite(values)).all() else values


def _plot(plot: Plot, packer: "_Packer") -> dict[str, Any]:
    content: dict[str, Any] = {"title": plot.title, "unit": plot.unit, "log": plot.log}
    content["levels"] = [{"name": name, "value": value} for name, value in plot.levels]
    content["curves"] = curves = []
    for curve in plot.curves:
        item = {"name": curve.name, "steps": curve.steps, "limit": curve.limit}
        curves.append(item | {"points": curve.points} | packer.packed(curve.arrays))
    return content


class _Packer:
    """Arrays in base64, each once however often a page uses it."""

    def __init__(self) -> None:
        self.arrays: list[dict[str, str]] = []
        self._known: dict[tuple[str, bytes], int] = {}

    def packed(self, content: Any, name: str = "") -> Any:
        """Replace arrays and lists of floats by their indices in `arrays`, short but for times."""
        if isinstance(content, dict):
            return {name: self.packed(value, name) for name, value in content.items()}
        long = isinstance(content, list) and len(content) >= FEWEST_PACKED
        if long and all(type(value) is float for value in content):
            content = np.array(content)
        if not isinstance(content, np.ndarray):
            return content
        content = content if name == TIME else narrow(content)
        kind = "f4" if content.dtype == np.float32 else "f8"
        data = content.astype(f"<{kind}").tobytes()
        if (kind, data) not in self._known:
            self._known[kind, data] = len(self.arrays)
            self.arrays.append({kind: base64.b64encode(data).decode("ascii")})
        return {"array": self._known[kind, data]}
