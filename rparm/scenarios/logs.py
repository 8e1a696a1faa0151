"""Logs of measurements: CSV files of any program, whose first row names the columns."""

import csv
import hashlib
import io
import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from rparm.errors import UserError, did_you_mean, placed
from rparm.input_files import decoded, number_in, read_bytes, show

LARGEST = 50_000_000  # bytes
DELIMITERS = ",;\t"
MOST_SHOWN = 20  # columns in a message


@dataclass(frozen=True)
class Log:
    """A file that has been read; its numbers are looked at when they are asked for."""

    path: Path
    text: str
    sha256: str
    delimiter: str
    names: tuple[str, ...]  # of the columns

    def columns(self, time: str, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Increasing times and values of a column, (rows,), finite; UserError names the line."""
        first, second = self._index(time), self._index(name)
        found = array("d")
        for line, row in self._rows():
            if len(row) != len(self.names):
                raise self._wrong(f"expected {len(self.names)} values, found {len(row)}", line)
            try:
                found.append(number_in(row[first]))
                found.append(number_in(row[second]))
            except ValueError:
                raise self._no_number(row, (first, second), line) from None
        if not found:
            raise UserError(f"{self.path}: has no rows below the names of its columns")
        times, values = np.array(found).reshape(-1, 2).T
        wrong = np.flatnonzero(~(np.isfinite(times) & np.isfinite(values)))
        if len(wrong):
            line, row = next(islice(self._rows(), int(wrong[0]), None))
            raise self._no_number(row, (first, second), line)
        wrong = np.flatnonzero(np.diff(times) <= 0)
        if len(wrong):
            before, after = times[wrong[0] : wrong[0] + 2].tolist()
            line, _ = next(islice(self._rows(), int(wrong[0]) + 1, None))
            raise self._wrong(f"expected a time after {before!r}, found {after!r}", line)
        return times, values

    def _index(self, name: str) -> int:
        found = self.names.count(name)
        if found != 1:
            what = "is there twice" if found else f"is not there{did_you_mean(name, self.names)}"
            raise UserError(f"{self.path}: column {show(name)} {what} ({_known(self.names)})")
        return self.names.index(name)

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        """Rows that are not blank, below the names, with the line that each ends in."""
        rows = _reader(self.text, self.delimiter)
        try:
            next(rows)
            for row in rows:
                if row:
                    yield rows.line_num, row
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
    delimiter = max(DELIMITERS, key=lambda delimiter: len(headers[delimiter]))
    names = tuple(name.strip() for name in headers[delimiter])
    if len(names) < 2:
        raise UserError(f"{path}: expected names of columns in its first line, with , ; or tabs")
    return Log(path, text, hashlib.sha256(content).hexdigest(), delimiter, names)


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
