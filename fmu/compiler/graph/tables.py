"""Tables of a file with equations: their values, from lists or a CSV, and their segments.

A table of one argument is a polynomial in each segment between two bounds. Every mistake is a
ValueError, in one line.
"""

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TextIO

from ..expressions.expression import finite_number
from ..units import Unit

LARGEST_FILE = 50_000_000  # bytes
SEPARATORS = ",;\t"  # of columns; between others than commas, a comma may be a decimal point
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")  # so written, a comma may be no decimal one
FAR = 1e300  # beyond every value: the bound where there is none
INTERPOLATIONS = ("linear", "previous", "pchip")
OUTSIDE = ("hold", "extend", "error")


@dataclass(frozen=True)
class Axis:
    """Bounds of segments: segment k begins at bounds[k] and ends before bounds[k + 1]."""

    bounds: tuple[float, ...]
    origins: tuple[float, ...]  # of each segment: from where its polynomial counts


@dataclass(frozen=True)
class LookupTable:
    """A table as C needs it.

    Attributes
    ----------
    axes : tuple of Axis
        One for each argument.
    coefficients : tuple of tuple of float
        Of one argument: for each power of the distance from the origin, a number per segment. Of
        two: value, slope by the first, by the second and by both, a number per pair of segments,
        those of the second argument in a row.
    """

    name: str
    axes: tuple[Axis, ...]
    coefficients: tuple[tuple[float, ...], ...]

    def array(self, kind: str, number: int) -> str:
        """Return the name in C of an array: bounds, ends or origins of an axis, or coefficients."""
        return f"table_{self.name}_{kind}{number}"

    @property
    def ends(self) -> tuple[float, float] | None:
        """Between what it has values, if others are errors."""
        bounds = self.axes[0].bounds
        return (bounds[1], bounds[-2]) if math.isnan(self.coefficients[0][0]) else None

    def arrays(self) -> Iterator[tuple[str, str, Sequence[float]]]:
        """Yield name, dimensions and numbers of each array in C."""
        for i, axis in enumerate(self.axes):
            yield self.array("bounds", i), f"[{len(axis.origins)}]", axis.bounds[:-1]
            yield self.array("ends", i), f"[{len(axis.origins)}]", axis.bounds[1:]
            yield self.array("origins", i), f"[{len(axis.origins)}]", axis.origins
        dimensions = "".join(f"[{len(axis.origins)}]" for axis in self.axes)
        for i, numbers in enumerate(self.coefficients):
            yield self.array("c", i), dimensions, numbers


def read(name: str, given: dict[str, Any], folder: Path, units: Mapping[str, Unit]) -> LookupTable:
    """Read a table from its entry; a file's path counts from the folder. units: of x, y and z."""
    kind, outside = given.get("interpolation", "linear"), given.get("outside", "hold")
    for key, value, known in (
        ("interpolation", kind, INTERPOLATIONS),
        ("outside", outside, OUTSIDE),
    ):
        if value not in known:
            raise ValueError(f"{key}: expected one of {', '.join(known)}, got {value!r}")
    if "z" in given:
        if kind != "linear" or "file" in given:
            raise ValueError("z: a table of two arguments is linear, and given by lists")
        return _grid(name, given, outside, units)
    columns = _columns(given, folder) if "file" in given else _lists(given)
    columns = {key: _in_si(values, units.get(key)) for key, values in columns.items()}
    x, y = _checked(columns["x"], "x"), columns["y"]
    if len(x) != len(y):
        raise ValueError(f"y: has {len(y)} values, expected {len(x)}, as x has")
    coefficients = _polynomials(x, y, kind)
    return LookupTable(name, *_with_outside(x, y, coefficients, kind, outside))


def _in_si(values: list[float], unit: Unit | None) -> list[float]:
    return [unit.value(value) for value in values] if unit and unit.is_display else values


# ---- Values --------------------------------------------------------------------------------------
def _lists(given: dict[str, Any]) -> dict[str, list[float]]:
    return {key: [*_numbers(given.get(key), key)] for key in ("x", "y")}


def _numbers(values: object, key: str) -> Iterator[float]:
    if not isinstance(values, list):
        raise ValueError(f"{key}: expected a list of numbers")
    for row, value in enumerate(values, 1):
        try:
            yield finite_number(value)
        except ValueError as error:
            raise ValueError(f"{key}: row {row}: {error}") from None


def _columns(given: dict[str, Any], folder: Path) -> dict[str, list[float]]:
    """Read two columns of a CSV, which x and y name in its first line."""
    path, begin = folder / given["file"], 1  # line of a row
    names = {key: given.get(key) for key in ("x", "y")}
    for key, column in names.items():
        if not isinstance(column, str):
            raise ValueError(f"{key}: expected the name of a column of {path.name}")
    if names["x"] == names["y"]:
        raise ValueError(f"y: expected another column than x, got {names['y']!r}")
    try:
        if not path.is_file():
            raise ValueError(f"file: {path.name}: no such file")
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"file: {path.name}: has more than {LARGEST_FILE} bytes")
        with path.open(encoding="utf-8-sig", newline="") as file:
            separator, above = _separator(file, [*names.values()])
            rows = _rows(file, separator, above)
            head = [column.strip() for column in next(rows, [])]
            places = {}
            for key, column in names.items():
                if head.count(column) != 1:
                    known = ", ".join(head[:10])
                    raise ValueError(f"{key}: {path.name} has no column {column!r} (has: {known})")
                places[key] = head.index(column)
            found: dict[str, list[tuple[str, str]]] = {"x": [], "y": []}  # places and texts
            for row in rows:
                line = rows.line_num + above
                if any(map(str.strip, row[len(head) :])):
                    where = f"file: {path.name}: line {line}"
                    raise ValueError(f"{where}: has {len(row)} cells, expected {len(head)}")
                for key, place in places.items() if row else ():
                    where = f"{key}: {path.name}: line {line}"
                    found[key].append((where, row[place].strip() if place < len(row) else ""))
                begin = line + 1
    except csv.Error as error:
        reason = str(error)
        if "end of data" in reason or ("limit" in reason and rows.line_num + above > begin):
            reason = "a quote opens that is not closed"
        raise ValueError(f"file: {path.name}: line {begin}: {reason}") from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "is no text in UTF-8"
        raise ValueError(f"file: {path.name}: {reason}") from None
    has_points = any("." in text for cells in found.values() for _, text in cells)
    mark = "." if has_points or separator == "," else ","
    commas = [cell for cells in found.values() for cell in cells if mark == "," and "," in cell[1]]
    if commas and all(THOUSANDS.fullmatch(text) for _, text in commas):
        where, text = commas[0]
        either = f"{text.replace(',', '')} or {text.replace(',', '.')}"
        raise ValueError(f"{where}: expected {either}, no comma that may mean thousands")
    return {key: [_cell(*cell, mark) for cell in cells] for key, cells in found.items()}


def _separator(file: TextIO, names: Sequence[str]) -> tuple[str, int]:
    """Return what separates columns, by which there are these names, and how many lines say so.

    Spreadsheets say so by a line such as sep=; above the names.
    """
    said = re.fullmatch("sep=(.)", file.readline().strip("\r\n"))
    above = 1 if said else 0

    def fits(separator: str) -> tuple[bool, int]:
        with suppress(csv.Error):
            head = [column.strip() for column in next(_rows(file, separator, above), [])]
            return all(head.count(name) == 1 for name in names), len(head)
        return False, 0

    return max(said[1] if said else SEPARATORS, key=fits), above


def _rows(file: TextIO, separator: str, above: int) -> "csv._reader":
    """Return all rows below so many lines."""
    file.seek(0)
    for _ in range(above):
        file.readline()
    return csv.reader(file, strict=True, delimiter=separator)


def _cell(where: str, text: str, mark: str) -> float:
    try:
        number = float(text.replace("_", "?").replace(mark, "."))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{where}: expected a finite number, got {text[:30]!r}")
    return number


def _checked(x: list[float], key: str) -> list[float]:
    """Check that there are two rows, and that they rise."""
    if len(x) < 2:
        raise ValueError(f"{key}: has {len(x)} rows, expected two at least")
    for row, (low, high) in enumerate(pairwise(x), 2):
        if not low < high:
            raise ValueError(f"{key}: row {row}: expected more than {low!r}, got {high!r}")
    if abs(x[0]) > FAR or abs(x[-1]) > FAR or not math.isfinite(x[-1] - x[0]):
        raise ValueError(f"{key}: is beyond {FAR:g}")
    return x


# ---- Segments ------------------------------------------------------------------------------------
def _polynomials(x: list[float], y: list[float], kind: str) -> list[tuple[float, ...]]:
    """Return for each segment its coefficients, by powers of the distance from its begin."""
    if kind == "previous":
        return [(value,) for value in y[:-1]]
    widths = [high - low for low, high in pairwise(x)]
    slopes = [(after - before) / h for before, after, h in zip(y, y[1:], widths, strict=False)]
    if kind == "linear":
        return list(zip(y, slopes, strict=False))
    at = _pchip_slopes(widths, slopes)
    return [
        (value, d, (3 * slope - 2 * d - d_next) / h, (d + d_next - 2 * slope) / (h * h))
        for value, d, d_next, slope, h in zip(y, at, at[1:], slopes, widths, strict=False)
    ]


def _pchip_slopes(widths: list[float], slopes: list[float]) -> list[float]:
    """Return slopes at all rows: of the cubics that keep the shape.

    Fritsch and Butland, A Method for Constructing Local Monotone Piecewise Cubic Interpolants
    (1984); at the ends of three points, limited so that the shape is kept.
    """
    if len(slopes) == 1:
        return slopes * 2
    inner = []
    for (h0, h1), (s0, s1) in zip(pairwise(widths), pairwise(slopes), strict=True):
        if s0 * s1 <= 0:
            inner.append(0.0)
        else:
            w0, w1 = 2 * h1 + h0, h1 + 2 * h0
            inner.append((w0 + w1) / (w0 / s0 + w1 / s1))
    first = _end_slope(widths[0], widths[1], slopes[0], slopes[1])
    last = _end_slope(widths[-1], widths[-2], slopes[-1], slopes[-2])
    return [first, *inner, last]


def _end_slope(h0: float, h1: float, s0: float, s1: float) -> float:
    slope = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if slope * s0 <= 0:
        return 0.0
    return 3 * s0 if s0 * s1 <= 0 and abs(slope) > abs(3 * s0) else slope


def _with_outside(
    x: list[float], y: list[float], inside: list[tuple[float, ...]], kind: str, outside: str
) -> tuple[tuple[Axis, ...], tuple[tuple[float, ...], ...]]:
    """Add the segments outside; return the axes and the coefficients by powers."""
    powers = len(inside[0])
    if outside == "extend" and kind != "previous":
        return (_extended(x),), tuple(zip(*inside, strict=True))
    ends = (math.nan, math.nan) if outside == "error" else (y[0], y[-1])
    below, above = ((end,) + (0.0,) * (powers - 1) for end in ends)
    if outside == "error":  # the last row itself is inside
        last = math.nextafter(x[-1], math.inf)
        inside = [*inside, (y[-1],)] if kind == "previous" else inside
        x = [*x, last] if kind == "previous" else [*x[:-1], last]
    return (_held(x),), tuple(zip(below, *inside, above, strict=True))


def _grid(name: str, given: dict[str, Any], outside: str, units: Mapping[str, Unit]) -> LookupTable:
    """Return a bilinear table; z has a row for each x."""
    if outside == "error":
        raise ValueError("outside: a table of two arguments holds or extends")
    x, y = (
        _checked(_in_si([*_numbers(given.get(key), key)], units.get(key)), key)
        for key in ("x", "y")
    )
    if not isinstance(given["z"], list) or len(given["z"]) != len(x):
        raise ValueError(f"z: expected {len(x)} rows, one for each x")
    z = []
    for row, values in enumerate(given["z"], 1):
        z.append(_in_si([*_numbers(values, f"z: row {row}")], units.get("z")))
        if len(z[-1]) != len(y):
            raise ValueError(f"z: row {row}: has {len(z[-1])} values, expected {len(y)}")
    cells: list[tuple[float, float, float, float]] = []
    axes = tuple(_held(axis) if outside == "hold" else _extended(axis) for axis in (x, y))
    for i, wide in _spans(x, outside):
        for j, high in _spans(y, outside):
            a, b = i + (wide > 0), j + (high > 0)
            by_x = (z[a][j] - z[i][j]) / wide if wide else 0.0
            by_y = (z[i][b] - z[i][j]) / high if high else 0.0
            both = (z[a][b] - z[a][j] - z[i][b] + z[i][j]) / (wide * high) if wide and high else 0.0
            cells.append((z[i][j], by_x, by_y, both))
    return LookupTable(name, axes, tuple(zip(*cells, strict=True)))


def _held(x: list[float]) -> Axis:
    return Axis((-FAR, *x, FAR), (x[0], *x))


def _extended(x: list[float]) -> Axis:
    return Axis((-FAR, *x[1:-1], FAR), tuple(x[:-1]))


def _spans(x: list[float], outside: str) -> list[tuple[int, float]]:
    """Return for each segment the row where it begins, and its width; 0: the value is held."""
    inside = [(i, high - low) for i, (low, high) in enumerate(pairwise(x))]
    return [(0, 0.0), *inside, (len(x) - 1, 0.0)] if outside == "hold" else inside
