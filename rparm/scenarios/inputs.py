"""Inputs of a scenario as functions of time, and what was measured of its outputs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rparm.errors import UserError, hint
from rparm.files import show
from rparm.fmi.model import INPUTS, Model, Variable
from rparm.scenarios import logs
from rparm.scenarios.logs import Columns, Log
from rparm.scenarios.reader import Reader
from rparm.scenarios.signals import EARLY, Constant, Logged, Signal, Sines, Switches, Table
from rparm.units import HERTZ, RADIANS, SECONDS

MEASURED = "measured"  # section of a scenario
CONSTANT, SINES, TABLE, FILE = "constant", "sines", "table", "file"  # shapes of an input
# keys beside a shape, and which one takes them
BESIDE = {"offset": SINES} | dict.fromkeys(("column", "time", "begin", "scale", "hold"), FILE)


class InputReader:
    """Reads the sections [inputs] and [measured].

    Communication points are `times` (n + 1,) in s, rounded, and `elapsed` since the start.
    """

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
        """What looks damaged in the logs that were read."""
        return list(self._warnings)

    def inputs(self, content: Mapping[str, Any]) -> dict[str, Signal]:
        """Section [inputs] as functions of time."""
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
        """Section [measured]: logs of Real outputs."""
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
        """Values of the inputs at the communication points, (n + 1,) each."""
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
            reader.keys(reader.table(sine, key), key, ("amplitude", "frequency"), ("phase",))
            amplitude = reader.quantity(sine["amplitude"], f"{key} amplitude", known, True)
            frequency = reader.quantity(sine["frequency"], f"{key} frequency", HERTZ)
            phase = reader.quantity(sine.get("phase", 0.0), f"{key} phase", RADIANS)
            terms.append((amplitude, frequency, phase))
        return Sines(offset, tuple(terms))

    def _points(self, table: dict[str, Any], where: str, variable: Variable) -> Table:
        rows, known = self._rows(table, where), variable.units
        return Table(tuple((t, self._reader.quantity(v, key, known)) for t, v, key in rows))

    def _rows(self, table: dict[str, Any], where: str) -> list[tuple[float, Any, str]]:
        """Times in s, values as they stand in the file, and their keys."""
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
        """A column of a log, whose times are the run's unless `begin` says otherwise."""
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
            found = self._log(file).columns(time, [column], begin)
        except UserError as error:
            reader.fail(f"{where}: {error}")
        path = self._logs[file].path
        self._check_covers(found, begin, f"{where}: {path}")
        self._warnings |= {f"{path}: {x}": None for x in found.warnings(0.0, self._elapsed[-1])}
        numbers = found.values[:, 0]
        if variable.type == "Boolean":
            numbers = self._on_or_off(table, numbers, where)
        elif "scale" in table:
            scale = reader.quantity(table["scale"], f"{where} scale", variable.units, True)
            if scale == 0:
                reader.fail(f"{where} scale: expected another number than 0, it loses the log")
            with np.errstate(over="ignore"):  # is looked for later
                numbers = numbers * scale
        return Logged(found.times, numbers, is_held, f"{file}, column {column}")

    def _log(self, file: str) -> Log:
        """A log, read once."""
        if file not in self._logs:
            self._logs[file] = logs.read(Path(self._reader.path).parent / file)
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
        self._reader.fail(
            f"{where}: {found}, the run needs it from {begin!r} to {begin + last!r} s"
        )

    def _on_or_off(self, table: dict[str, Any], numbers: np.ndarray, where: str) -> np.ndarray:
        """Values of a Boolean input."""
        if "scale" in table or table.get("hold") is False:
            self._reader.fail(f"{where}: a Boolean input is held and not scaled")
        wrong = numbers[(numbers != 0) & (numbers != 1)]
        if len(wrong):
            self._reader.fail(f"{where}: expected 0 or 1 in a log, got {float(wrong[0])!r}")
        return numbers.astype(bool)
