"""Logs of measurements: CSV files of any program, whose first row names the columns."""

import csv
import hashlib
import io
import math
from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from itertools import islice
from pathlib import Path

import numpy as np

from rparm.errors import UserError, did_you_mean, placed
from rparm.files import decoded, number_in, read_bytes, show

LARGEST = 50_000_000  # bytes
DELIMITERS = ",;\t"
MOST_SHOWN = 20  # columns in a message
MOST_TRIED = 100  # rows, to choose the delimiter by
LONGEST_STEP = 10 * (1 + 1e-9)  # usual steps: what is longer is a gap


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a log with their times, as exact as the file writes them."""

    first: float  # s, time of the first row
    times: np.ndarray  # (rows,) s since what was asked for, increasing
    values: np.ndarray  # (rows, columns), finite
    lines: np.ndarray  # (rows,) of the file, each where a row ends
    joined: Sequence[tuple[int, int]]  # lines that are one row: first and last

    def warnings(self, begin: float = -math.inf, end: float = math.inf) -> list[str]:
        """What looks damaged from `begin` to `end`, in the same time as the rows; a line each."""
        texts = [
            f"lines {first} to {last} are one row, by a quoted field with line ends: "
            "is a quotation mark there by mistake?"
            for first, last in self.joined
        ]
        steps = np.diff(self.times)
        usual = float(np.median(steps)) if len(steps) else 0.0
        is_gap = steps > LONGEST_STEP * usual
        gaps = np.flatnonzero(is_gap & (self.times[1:] > begin) & (self.times[:-1] < end))
        if len(gaps):
            longest = int(gaps[np.argmax(steps[gaps])])
            found = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
            texts.append(
                f"line {self.lines[longest + 1]}: {found} of {steps[longest]:.4g} s before it, "
                f"where rows are {usual:.4g} s apart"
            )
        return texts


@dataclass(frozen=True)
class Log:
    """A file that has been read; its numbers are looked at when they are asked for."""

    path: Path
    text: str
    sha256: str
    delimiter: str
    names: tuple[str, ...]  # of the columns

    def columns(self, time: str, names: Sequence[str], since: float | None = None) -> Columns:
        """Columns, with times since `since` (s), or since the first row.

        UserError names the line of what is wrong. Times are subtracted as decimals: doubles of
        clocks that count from 1970 are 0.2 microseconds apart.
        """
        indices = [self._index(name) for name in (time, *names)]
        origin = None if since is None else Decimal(repr(since))
        found, lines, joined = array("d"), array("q"), list[tuple[int, int]]()
        first, before, last = 0.0, -math.inf, -math.inf
        for begin, line, row in self._rows():
            if begin < line:
                joined.append((begin, line))
            if begin == 1:  # the names
                continue
            if len(row) != len(self.names):
                raise self._wrong(f"expected {len(self.names)} values, found {len(row)}", line)
            try:
                clock, *values = [number_in(row[i]) for i in indices]
            except ValueError:
                raise self._no_number(row, indices, line) from None
            if not all(map(math.isfinite, (clock, *values))):
                raise self._no_number(row, indices, line)
            exact = Decimal(row[indices[0]])
            if origin is None:
                origin = exact
            elapsed = float(exact - origin) if origin else clock
            if elapsed <= last:
                raise self._wrong(f"expected a time after {before!r}, found {clock!r}", line)
            first, before, last = first if lines else clock, clock, elapsed
            found.extend((elapsed, *values))
            lines.append(line)
        if not lines:
            raise UserError(f"{self.path}: has no rows below the names of its columns")
        table = np.array(found).reshape(len(lines), -1)
        return Columns(first, table[:, 0], table[:, 1:], np.array(lines), joined)

    def _index(self, name: str) -> int:
        found = self.names.count(name)
        if found != 1:
            what = "is there twice" if found else f"is not there{did_you_mean(name, self.names)}"
            raise UserError(f"{self.path}: column {show(name)} {what} ({_known(self.names)})")
        return self.names.index(name)

    def _rows(self) -> Iterator[tuple[int, int, list[str]]]:
        """Names and rows that are not blank, after the lines that each begins and ends in."""
        rows, begin = _reader(self.text, self.delimiter), 1
        try:
            for row in rows:
                if row:
                    yield begin, rows.line_num, row
                begin = rows.line_num + 1
        except csv.Error as error:
            raise self._wrong(str(error), rows.line_num) from None

    def _no_number(self, row: Sequence[str], columns: Sequence[int], line: int) -> UserError:
        """What is wrong with the first value in `columns` of a row that is no finite number."""
        for column in columns:
            expected = "a finite number"
            try:
                if math.isfinite(number_in(row[column])):
                    continue
            except ValueError:
                expected = "a number with a decimal point"
            break
        name, found = show(self.names[column]), show(row[column])
        return self._wrong(f"column {name}: expected {expected}, found {found}", line)

    def _wrong(self, message: str, line: int) -> UserError:
        return UserError(f"{self.path}, line {line}: {message}")


def read(path: Path) -> Log:
    """Read a log with , ; or tabs between its columns; UserError if it has none, or is no text."""
    try:
        with placed(path):
            content = read_bytes(path, LARGEST)
        text = decoded(content)
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not UTF-8 text, at byte {error.start}") from None
    headers = {delimiter: _header(path, text, delimiter) for delimiter in DELIMITERS}
    possible = [delimiter for delimiter in DELIMITERS if len(headers[delimiter]) > 1]
    if not possible:
        raise UserError(f"{path}: expected names of columns in its first line, with , ; or tabs")
    delimiter = max(possible, key=lambda x: (_fitting(text, x, len(headers[x])), len(headers[x])))
    names = tuple(name.strip() for name in headers[delimiter])
    return Log(path, text, hashlib.sha256(content).hexdigest(), delimiter, names)


def _fitting(text: str, delimiter: str, count: int) -> int:
    """Numbers in the first rows of `count` fields; a comma is no delimiter of them, or decimal."""
    found = 0
    with suppress(csv.Error):  # is said when the rows are read
        for row in islice(_reader(text, delimiter), 1, MOST_TRIED):
            for field in row if len(row) == count else ():
                with suppress(ValueError):
                    number_in(field.replace(",", "."))
                    found += 1
    return found


def _known(names: Sequence[str]) -> str:
    shown = [show(name)[1:-1] for name in names[:MOST_SHOWN]]
    shown += ["..."] if len(names) > MOST_SHOWN else []
    return f"known: {', '.join(shown)}"


def _header(path: Path, text: str, delimiter: str) -> list[str]:
    try:
        return next(_reader(text, delimiter), [])
    except csv.Error as error:
        raise UserError(f"{path}, line 1: {error}") from None


def _reader(text: str, delimiter: str) -> "csv._reader":
    return csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
