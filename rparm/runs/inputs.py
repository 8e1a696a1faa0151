"""Inputs of a scenario: constants, tables, sines and logs as functions of time.

A log is a CSV file of measurements by any program, whose first row names the columns. It may also
give measured outputs, to compare with a run.
"""

import csv
import hashlib
import io
import math
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from rparm.errors import UserError, did_you_mean, hint, placed
from rparm.files import decoded, number_in, read_bytes, show
from rparm.fmi.model import INPUTS, Model, Variable
from rparm.units import HERTZ, RADIANS, SECONDS, Units, finite_number, quantity, scale

EARLY = 1e-9  # s; a communication point that rounding puts this little before a switch is at it
LARGEST_LOG = 50_000_000  # bytes
DELIMITERS = ",;\t"
SEPARATOR = re.compile(r'"?sep=([^\w\s"]|\t)"?(?:\r\n?|\n)', re.IGNORECASE | re.ASCII)  # first line
DECIMAL_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:e[+-]?\d+)?", re.IGNORECASE | re.ASCII)
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")  # so written, a comma may be no decimal one
EMPTY = {"na", "n/a", "#n/a", "null"}  # cells without a number, beside NaN and nothing
MOST_SHOWN = 20  # columns in a message
MOST_TRIED = 100  # rows, to choose the delimiter by
LONGEST_STEP = 10 * (1 + 1e-9)  # usual steps: a longer one is a gap
MEASURED = "measured"  # section of a scenario
CONSTANT, SINES, TABLE, FILE = "constant", "sines", "table", "file"  # shapes of an input
SINE = ("amplitude", "frequency"), ("phase",)  # its keys, needed and not
# keys beside a shape, and which one takes them
BESIDE = {"offset": SINES} | dict.fromkeys(("column", "time", "begin", "scale", "hold"), FILE)


# ---- Checked values of a file --------------------------------------------------------------------
class Reader:
    """Takes checked values from one file; errors name the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def fail(self, message: str) -> NoReturn:
        raise UserError(f"{self.path}: {message}")

    def placed(self, key: str) -> AbstractContextManager[None]:
        """Name this key in errors of the values that are checked inside."""
        return placed(f"{self.path}: {key}")

    def number(self, value: Any, key: str) -> float:
        with self.placed(key):
            return finite_number(value)

    def quantity(self, value: Any, key: str, known: Units, is_difference: bool = False) -> float:
        """Convert a number, or a text with a number and one of the `known` units."""
        with self.placed(key):
            return quantity(value, known, is_difference)

    def text(self, value: Any, key: str) -> str:
        if not isinstance(value, str) or not value.strip():
            self.fail(f"{key}: expected a text, got {show(value)}")
        return value.strip()

    def table(self, value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            self.fail(f"{key}: expected a table, got {show(value)}")
        return value

    def array(self, value: Any, key: str, of: str) -> list[Any]:
        if not isinstance(value, list) or not value:
            self.fail(f"{key}: expected a list of {of}, got {show(value)}")
        return value

    def keys(
        self, table: dict, where: str, required: Iterable[str] = (), optional: Iterable[str] = ()
    ) -> None:
        known = [*required, *optional]
        begin = f"{where}: " if where else ""
        for key in table:
            if key not in known:
                self.fail(f"{begin}unknown key {key!r}{hint(key, known)}")
        for key in required:
            if key not in table:
                self.fail(f"{begin}missing key {key!r}")


# ---- Functions of time ---------------------------------------------------------------------------
@dataclass(frozen=True)
class Constant:
    """The same value at all times."""

    value: float

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        return np.full(len(elapsed), self.value)


@dataclass(frozen=True)
class Sines:
    """A smooth signal: offset + sum of amplitude sin(2 pi frequency t + phase)."""

    offset: float
    terms: tuple[tuple[float, float, float], ...]  # amplitude, frequency (Hz), phase (rad)

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        # numpy's sine of doubles depends on the processor; of long doubles, rounded, it does not
        t = elapsed.astype(np.longdouble)
        total = np.full(len(t), self.offset, t.dtype)
        for amplitude, frequency, phase in self.terms:
            total += amplitude * np.sin(2 * np.pi * frequency * t + phase)
        return total.astype(np.float64)

    def derivative(self, elapsed: np.ndarray, order: int) -> np.ndarray:
        """Return the derivative of an order (0: value) at `elapsed` seconds after the start, (n,).

        It is exact but for a rounding, unlike `values`, whose pi is a double: exact final states of
        convergence problems are compared with it.
        """
        pi = np.arctan2(np.longdouble(0), np.longdouble(-1))
        t = np.asarray(elapsed, dtype=np.longdouble)
        total = np.full(t.shape, self.offset if order == 0 else 0.0, t.dtype)
        for amplitude, frequency, phase in self.terms:
            omega = 2 * pi * np.longdouble(frequency)
            total += amplitude * omega**order * np.sin(omega * t + phase + order * pi / 2)
        return total.astype(np.float64)


@dataclass(frozen=True)
class Polyline:
    """Linear between points, constant before the first and after the last."""

    points: tuple[tuple[float, float], ...]  # s since the start, value; in order of time

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        times, values = np.array(self.points).T
        return np.interp(elapsed, times, values)


@dataclass(frozen=True)
class Switches:
    """True or false from each time on, and before the first one as there."""

    points: tuple[tuple[float, bool], ...]  # s since the start, value; in order of time

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        times, values = zip(*self.points, strict=True)
        rows = np.searchsorted(times, elapsed + EARLY, side="right") - 1
        return np.array(values)[np.maximum(rows, 0)]


@dataclass(frozen=True, eq=False)
class Logged:
    """A column of a log: linear between its rows, or with zero-order hold."""

    times: np.ndarray  # (rows,) s since the start, in order
    numbers: np.ndarray  # (rows,) values; Booleans of a Boolean input
    is_held: bool
    source: str  # file and column

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        if self.is_held:
            rows = np.searchsorted(self.times, elapsed + EARLY, side="right") - 1
            return self.numbers[np.maximum(rows, 0)]
        return np.interp(elapsed, self.times, self.numbers)

    def covers(self, elapsed: np.ndarray) -> np.ndarray:
        """Return which of the times are within the log, and in none of its gaps, (n,)."""
        inside = (self.times[0] - EARLY <= elapsed) & (elapsed <= self.times[-1] + EARLY)
        before = np.searchsorted(self.times, elapsed + EARLY, side="right") - 1
        is_between = np.searchsorted(self.times, elapsed - EARLY) > before
        return inside & ~(is_between & np.append(_gaps(self.times), False)[before])


Signal = Constant | Sines | Polyline | Switches | Logged


# ---- Logs ----------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of a log with their times, as exact as the file writes them."""

    first: float  # s, time of the first row
    times: np.ndarray  # (rows,) s since the requested time, increasing
    values: np.ndarray  # (rows, columns), finite; NaN where a cell is empty
    lines: np.ndarray  # (rows,) of the file, each where a row ends
    joined: Sequence[tuple[int, int]]  # lines that are one row: first and last

    def only(self, column: int) -> "Columns":
        """Return a column by itself, with the rows that have a value of it."""
        rows = np.isfinite(self.values[:, column])
        times, lines, values = self.times[rows], self.lines[rows], self.values[rows, column]
        first = self.first + float(times[0] - self.times[0])
        return Columns(first, times, values[:, None], lines, self.joined)

    def warnings(self, begin: float = -math.inf, end: float = math.inf) -> list[str]:
        """Warn of what looks damaged from `begin` to `end`, in the rows' time; a line each."""
        texts = [
            f"lines {first} to {last} are one row, by a quoted field with line ends: "
            "is a quotation mark there by mistake?"
            for first, last in self.joined
        ]
        steps = np.diff(self.times)
        gaps = np.flatnonzero(
            _gaps(self.times) & (self.times[1:] > begin) & (self.times[:-1] < end)
        )
        if len(gaps):
            longest = int(gaps[np.argmax(steps[gaps])])
            found = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
            texts.append(
                f"line {self.lines[longest + 1]}: {found} of {steps[longest]:.4g} s before it, "
                f"where rows are {np.median(steps):.4g} s apart"
            )
        return texts


def _gaps(times: np.ndarray) -> np.ndarray:
    """Return after which rows there is a gap, (rows - 1,)."""
    steps = np.diff(times)
    return steps > LONGEST_STEP * np.median(steps) if len(steps) else steps > 0


@dataclass(frozen=True)
class Log:
    """A file that has been read; its numbers are looked at when they are asked for."""

    path: Path
    text: str
    sha256: str
    delimiter: str
    names: tuple[str, ...]  # of the columns
    head: int = 1  # their line; above it spreadsheets name the delimiter

    def columns(self, time: str, names: Sequence[str], since: float | None = None) -> Columns:
        """Read columns over times since `since` (s) or the first row; UserError names the line.

        A number has a decimal point, or all have a decimal comma. Cells may be empty.
        """
        indices = [self._index(name) for name in (time, *names)]
        origin = None if since is None else Decimal(repr(since))
        found, lines, joined = array("d"), array("q"), list[tuple[int, int]]()
        first, before, last = 0.0, -math.inf, -math.inf
        marks: dict[str, int] = {}  # decimal points and commas, by the line that first has one
        commas = _Commas()
        for begin, line, row in self._rows():
            if begin < line:
                joined.append((begin, line))
            if begin == self.head:  # the names
                continue
            if len(row) != len(self.names):
                raise self._wrong(f"expected {len(self.names)} values, found {len(row)}", line)
            cells = [_number_text(row[i]) for i in indices]
            try:
                clock, *values = map(number_in, cells)
            except ValueError:
                raise self._no_number(row, indices, line) from None
            if not math.isfinite(clock) or any(map(math.isinf, values)):
                raise self._no_number(row, indices, line)
            for mark in {*"".join([row[i] for i in indices])} & {*".,"}:
                marks.setdefault(mark, line)
            if len(marks) > 1:
                other = min(marks.values())
                raise self._wrong(f"has another sign of decimals, . or , than line {other}", line)
            if "," in marks:
                commas.see(line, [row[i].strip() for i in indices])
            exact = Decimal(cells[0])
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
        if not commas.are_decimal and commas.doubtful is not None:
            line, cell = commas.doubtful
            either = f"{cell.replace(',', '')} or {cell.replace(',', '.')}"
            wanted = f"expected {either}, no comma that may mean thousands"
            raise self._wrong(f"{wanted}, found {show(cell)}", line)
        table = np.array(found).reshape(len(lines), -1)
        for name, values in zip(names, table.T[1:], strict=True):
            if not np.isfinite(values).any():
                raise UserError(f"{self.path}: column {show(name)} has no numbers")
        return Columns(first, table[:, 0], table[:, 1:], np.array(lines), joined)

    def _index(self, name: str) -> int:
        found = self.names.count(name)
        if found != 1:
            what = "is there twice" if found else f"is not there{did_you_mean(name, self.names)}"
            raise UserError(f"{self.path}: column {show(name)} {what} ({_known(self.names)})")
        return self.names.index(name)

    def _rows(self) -> Iterator[tuple[int, int, list[str]]]:
        """Yield names and rows that are not blank, after the lines of their begin and end."""
        rows, begin, above = _csv_reader(self.text, self.delimiter), self.head, self.head - 1
        try:
            for row in rows:
                line = rows.line_num + above
                if any(map(str.strip, row)):
                    yield begin, line, row
                begin = line + 1
        except csv.Error as error:
            is_open = ": a quote opens that is not closed" if begin < rows.line_num + above else ""
            raise self._wrong(f"{error}{is_open}", begin) from None

    def _no_number(self, row: Sequence[str], columns: Sequence[int], line: int) -> UserError:
        """Return the error for the first value in `columns` of a row that is no finite number."""
        for column in columns:
            expected = "a finite number"
            try:
                value = number_in(_number_text(row[column]))
                if math.isfinite(value) or (math.isnan(value) and column != columns[0]):
                    continue
            except ValueError:
                expected = "a number with a decimal point"
                if set(row[column].strip()) <= set("+-0123456789.,' "):
                    expected = "a number without signs of thousands"
            break
        name, found = show(self.names[column]), show(row[column])
        return self._wrong(f"column {name}: expected {expected}, found {found}", line)

    def _wrong(self, message: str, line: int) -> UserError:
        return UserError(f"{self.path}, line {line}: {message}")


def read_log(path: Path) -> Log:
    """Read a log with , ; or tabs between its columns; UserError if it has none, or is no text.

    Spreadsheets write `sep=;` above the names, or another delimiter.
    """
    try:
        with placed(path):
            content = read_bytes(path, LARGEST_LOG)
        text = decoded(content)
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not UTF-8 text, at byte {error.start}") from None
    named = SEPARATOR.match(text)
    text = text[named.end() :] if named else text
    delimiters = named[1] if named else DELIMITERS
    headers = {delimiter: _header(path, text, delimiter) for delimiter in delimiters}
    possible = [delimiter for delimiter in delimiters if len(headers[delimiter]) > 1]
    if not possible:
        known = show(named[1]) if named else ", ; or tabs"
        raise UserError(f"{path}: expected names of columns in its first line, with {known}")
    delimiter = max(possible, key=lambda x: (_fitting(text, x, len(headers[x])), len(headers[x])))
    names = tuple(name.strip() for name in headers[delimiter])
    head = 2 if named else 1
    return Log(path, text, hashlib.sha256(content).hexdigest(), delimiter, names, head)


class _Commas:
    """Whether commas in cells are decimal ones: in 1,100 it may be a sign of thousands."""

    def __init__(self) -> None:
        self.are_decimal = False
        self.doubtful: tuple[int, str] | None = None  # line and cell

    def see(self, line: int, cells: Iterable[str]) -> None:
        for cell in cells if not self.are_decimal else ():
            if THOUSANDS.fullmatch(cell):
                self.doubtful = self.doubtful or (line, cell)
            elif "," in cell:
                self.are_decimal = True


def _number_text(cell: str) -> str:
    """Return a cell with a decimal point for a comma, and "nan" for an empty one."""
    text = cell.strip()
    if not text or text.lower() in EMPTY:
        return "nan"
    return text.replace(",", ".") if DECIMAL_COMMA.fullmatch(text) else text


def _fitting(text: str, delimiter: str, count: int) -> int:
    """Count numbers in the first rows of `count` fields, where a comma may be a decimal one."""
    found = 0
    with suppress(csv.Error):  # is said when the rows are read
        for row in islice(_csv_reader(text, delimiter), 1, MOST_TRIED):
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
        return next(_csv_reader(text, delimiter), [])
    except csv.Error as error:
        raise UserError(f"{path}, line 1: {error}") from None


def _csv_reader(text: str, delimiter: str) -> "csv._reader":
    return csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)


# ---- Sections of a scenario ----------------------------------------------------------------------
class InputReader:
    """Reads [inputs] and [measured] at `times` (n + 1,) s, rounded; `elapsed` since the start."""

    def __init__(
        self, reader: Reader, model: Model, times: np.ndarray, elapsed: np.ndarray
    ) -> None:
        self._reader, self._model = reader, model
        self._times, self._elapsed = times, elapsed
        self._logs: dict[str, Log] = {}  # by the file as the scenario gives it
        self._warnings: dict[str, None] = {}  # in order

    @property
    def hashes(self) -> dict[str, str]:
        """SHA-256 of the logs that were read, by file as the scenario gives it."""
        return {file: log.sha256 for file, log in self._logs.items()}

    @property
    def warnings(self) -> list[str]:
        """Damages that the logs seem to have."""
        return list(self._warnings)

    def inputs(self, content: Mapping[str, Any]) -> dict[str, Signal]:
        """Read section [inputs] as functions of time."""
        result = {}
        for name, given in self._reader.table(content.get(INPUTS, {}), f"[{INPUTS}]").items():
            with self._reader.placed(f"[{INPUTS}]"):
                variable = self._model.find(name, INPUTS)
            where = f"[{INPUTS}.{name}]"
            if variable.type not in ("Real", "Boolean"):
                self._reader.fail(f"{where}: is of type {variable.type}, expected Real or Boolean")
            result[name] = self._signal(given, where, variable)
        return result

    def measured(self, content: Mapping[str, Any]) -> dict[str, Logged]:
        """Read section [measured]: logs of Real outputs."""
        result = {}
        outputs = self._model.real_outputs
        for name, given in self._reader.table(content.get(MEASURED, {}), f"[{MEASURED}]").items():
            if name not in outputs:
                missing = f"the model has no Real output {name!r}{hint(name, outputs)}"
                self._reader.fail(f"[{MEASURED}]: {missing}")
            where = f"[{MEASURED}.{name}]"
            table = self._reader.table(given, where)
            beside = (key for key, shape in BESIDE.items() if shape == FILE)
            self._reader.keys(table, where, required=(FILE,), optional=beside)
            result[name] = self._logged(table, where, self._model.variables[name])
            if not np.isfinite(result[name].numbers).all():
                self._reader.fail(f"{where}: expected finite values, got an overflow")
        return result

    def sampled(self, signals: Mapping[str, Signal]) -> dict[str, np.ndarray]:
        """Sample the inputs at the communication points, (n + 1,) each."""
        result = {}
        for name, signal in signals.items():
            where = f"[{INPUTS}.{name}]"
            # rounding must not decide which row counts; other signals use the rounded time
            has_rows = isinstance(signal, Switches | Logged)
            with np.errstate(all="ignore"):
                values = signal.values(self._elapsed if has_rows else self._times - self._times[0])
            if not np.all(np.isfinite(values)):
                self._reader.fail(f"{where}: expected finite values, got an overflow")
            with self._reader.placed(where):
                self._model.variables[name].check_range(float(values.min()), float(values.max()))
            values.setflags(write=False)
            result[name] = values
        return result

    # ---- Shapes ----------------------------------------------------------------------------------

    def _signal(self, content: Any, where: str, variable: Variable) -> Signal:
        table = self._reader.table(content, where)
        shapes = {CONSTANT: self._constant, SINES: self._sines, TABLE: self._points}
        shapes |= {FILE: self._logged}
        if variable.type == "Boolean":
            shapes |= {CONSTANT: self._switch, TABLE: self._switches}
            del shapes[SINES]
        beside = {key: shape for key, shape in BESIDE.items() if shape in shapes}
        self._reader.keys(table, where, optional=(*shapes, *beside))
        given = [shape for shape in shapes if shape in table]
        if len(given) != 1:
            expected = ", ".join(shapes)
            self._reader.fail(f"{where}: expected exactly one of {expected}, got {len(given)}")
        for key, shape in beside.items():
            if key in table and shape != given[0]:
                self._reader.fail(f"{where} {key}: goes with {shape} only")
        return shapes[given[0]](table, where, variable)

    def _switch(self, table: dict[str, Any], where: str, variable: Variable) -> Switches:
        return Switches(((0.0, self._boolean(table[CONSTANT], f"{where} {CONSTANT}", variable)),))

    def _switches(self, table: dict[str, Any], where: str, variable: Variable) -> Switches:
        rows = self._rows(table, where)
        return Switches(tuple((t, self._boolean(v, key, variable)) for t, v, key in rows))

    def _boolean(self, given: Any, key: str, variable: Variable) -> bool:
        with self._reader.placed(key):
            return bool(variable.checked(given))

    def _constant(self, table: dict[str, Any], where: str, variable: Variable) -> Constant:
        key = f"{where} {CONSTANT}"
        return Constant(self._reader.quantity(table[CONSTANT], key, variable.units))

    def _sines(self, table: dict[str, Any], where: str, variable: Variable) -> Sines:
        reader, known = self._reader, variable.units
        offset = reader.quantity(table.get("offset", 0.0), f"{where} offset", known)
        terms = []
        for i, sine in enumerate(reader.array(table[SINES], f"{where} {SINES}", "tables")):
            key = f"{where} {SINES}[{i}]"
            reader.keys(reader.table(sine, key), key, *SINE)
            amplitude = reader.quantity(sine["amplitude"], f"{key} amplitude", known, True)
            frequency = reader.quantity(sine["frequency"], f"{key} frequency", HERTZ)
            phase = reader.quantity(sine.get("phase", 0.0), f"{key} phase", RADIANS)
            terms.append((amplitude, frequency, phase))
        return Sines(offset, tuple(terms))

    def _points(self, table: dict[str, Any], where: str, variable: Variable) -> Polyline:
        rows, known = self._rows(table, where), variable.units
        return Polyline(tuple((t, self._reader.quantity(v, key, known)) for t, v, key in rows))

    def _rows(self, table: dict[str, Any], where: str) -> list[tuple[float, Any, str]]:
        """Read times in s, values as they stand in the file, and their keys."""
        rows: list[tuple[float, Any, str]] = []
        pairs = self._reader.array(table[TABLE], f"{where} {TABLE}", "[time, value] pairs")
        for i, row in enumerate(pairs):
            key = f"{where} {TABLE}[{i}]"
            if not isinstance(row, list) or len(row) != 2:
                self._reader.fail(f"{key}: expected [time, value], got {show(row)}")
            time = self._reader.quantity(row[0], key, SECONDS)
            if i and time <= rows[-1][0]:
                last = rows[-1][0]
                self._reader.fail(f"{key}: expected a time after {last!r} s, got {show(row)}")
            rows.append((time, row[1], key))
        return rows

    # ---- Logs ------------------------------------------------------------------------------------

    def _logged(self, table: dict[str, Any], where: str, variable: Variable) -> Logged:
        """Read a column of a log, whose times are the run's unless `begin` says otherwise."""
        reader = self._reader
        file = reader.text(table[FILE], f"{where} {FILE}")
        column = reader.text(table.get("column", variable.name), f"{where} column")
        time = reader.text(table.get("time", "time"), f"{where} time")
        start = float(self._times[0])
        begin = reader.quantity(table.get("begin", start), f"{where} begin", SECONDS)
        is_held = table.get("hold", variable.type == "Boolean")
        if not isinstance(is_held, bool):
            reader.fail(f"{where} hold: expected true or false, got {show(is_held)}")
        try:
            found = self._log(file).columns(time, [column], begin).only(0)
        except UserError as error:
            reader.fail(f"{where}: {error}")
        path = self._logs[file].path
        self._check_covers(found, begin, f"{where}: {path}")
        self._warnings |= {f"{path}: {x}": None for x in found.warnings(0.0, self._elapsed[-1])}
        numbers = found.values[:, 0]
        if variable.type == "Boolean":
            numbers = self._on_or_off(table, numbers, where)
        elif "scale" in table:
            with reader.placed(f"{where} scale"):
                known = scale(table["scale"], variable.units)
            if known.factor == 0:
                reader.fail(f"{where} scale: expected another number than 0, it loses the log")
            with np.errstate(over="ignore"):  # is looked for later
                numbers = known.values(numbers)
        return Logged(found.times, numbers, is_held, f"{file}, column {column}")

    def _log(self, file: str) -> Log:
        """Read a log, once."""
        if file not in self._logs:
            self._logs[file] = read_log(Path(self._reader.path).parent / file)
        return self._logs[file]

    def _check_covers(self, log: Columns, begin: float, where: str) -> None:
        """Check that a log covers each point where a step begins: it may end one step early."""
        last = float(self._elapsed[-2])
        if log.times[0] > EARLY:
            found = f"begins at {log.first!r} s"
        elif log.times[-1] < last - EARLY:
            found = f"ends at {begin + float(log.times[-1])!r} s"
        else:
            return
        needed = f"from {begin!r} to {begin + last!r} s"
        self._reader.fail(f"{where}: {found}, the run needs it {needed}")

    def _on_or_off(self, table: dict[str, Any], numbers: np.ndarray, where: str) -> np.ndarray:
        """Convert values of a Boolean input."""
        if "scale" in table or table.get("hold") is False:
            self._reader.fail(f"{where}: a Boolean input is held and not scaled")
        wrong = numbers[(numbers != 0) & (numbers != 1)]
        if len(wrong):
            self._reader.fail(f"{where}: expected 0 or 1 in a log, got {float(wrong[0])!r}")
        return numbers.astype(bool)
