"""Scenarios: what to simulate, read from models/<model>/scenarios/<name>.toml.

The README.md next to the scenarios documents the format. What a scenario says of its model is
checked against the description of the model's FMU.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cosim import project
from cosim.errors import UserError, did_you_mean
from cosim.input_files import read_toml, show
from cosim.model import (
    INITIAL,
    INPUTS,
    PARAMETERS,
    Model,
    Value,
    Variable,
    WrongValueError,
    finite_number,
)
from cosim.signals import Constant, Signal, Sines, Switches, Table

MODEL = "model"  # key of a file that is in no model's folder
MAX_STEPS = 10_000_000
MAX_PATTERN = 1000  # step lengths in a pattern
SLIVER = 1e-9  # a last step shorter than this fraction of its full length joins the one before


@dataclass(frozen=True, eq=False)
class Scenario:
    """A run of one model: parameters, initial state, communication points and inputs (SI units).

    Only what the file gives is in `parameters`, `initial` and `inputs`; everything else has its
    start value. Arrays are read-only; those of Boolean inputs hold Booleans.
    """

    name: str
    model: str  # folder name below models/
    path: Path
    title: str
    description: str
    parameters: dict[str, Value]  # an Enumeration's item as its number
    initial: dict[str, Value]
    start: float  # s
    stop: float  # s
    steps: tuple[float, ...]  # s, pattern of step lengths; one element: a constant step
    tolerance: float  # relative
    times: np.ndarray  # (n + 1,) communication points in s, from start to stop
    signals: dict[str, Signal]  # inputs as functions of time
    inputs: dict[str, np.ndarray]  # (n + 1,) each: held over the step that begins at times[i]
    reference_every: int  # every k-th communication point is in the reference
    defaults: dict[str, Value]  # start values in the FMU
    panels: tuple[tuple[str, ...], ...] = ()  # variables to draw beside the states, by diagram

    @property
    def start_values(self) -> dict[str, Value]:
        """Start values of all variables: those that the file gives, else those in the FMU."""
        return self.defaults | self.parameters | self.initial

    def input(self, name: str) -> np.ndarray:
        """Values of an input, (n + 1,): its start value throughout if the file gives none."""
        if name in self.inputs:
            return self.inputs[name]
        return np.full(len(self.times), self.defaults[name])

    @property
    def reference_folder(self) -> Path:
        """models/<model>/references/<name>."""
        return project.reference_folder(self.path)

    @property
    def reference_rows(self) -> np.ndarray:
        """Indices (rows,) of the communication points in the reference: every k-th and the last."""
        last = len(self.times) - 1
        return np.append(np.arange(0, last, self.reference_every), last)


def title(path: Path) -> str:
    """Title of the scenario at `path`; the rest of the file is not checked."""
    content = read_toml(path)
    reader = _Reader(path)
    if "title" not in content:
        reader.fail("missing key 'title'")
    return reader.text(content["title"], "title")


def folder_of(path: Path) -> Path:
    """Folder of the model of a scenario: that its key `model` names, or else the one it lies in.

    Raises
    ------
    UserError
        If the file cannot be read, or names no model.
    """
    content, reader = read_toml(path), _Reader(path)
    if MODEL not in content:
        if project.is_in_model(path):
            return project.model_folder(path)
        known = ", ".join(project.models())
        reader.fail(f"missing key {MODEL!r}: the name of what the scenario is of (known: {known})")
    name = reader.text(content[MODEL], MODEL)
    try:
        return project.model(name)
    except UserError as error:
        reader.fail(f"{MODEL}: {error}")


def load(path: Path, model: Model, times: Mapping[str, float] | None = None) -> Scenario:
    """Read and check the scenario at `path`, of the project or of a user.

    Parameters
    ----------
    path : Path
    model : Model
        What the model's FMU declares.
    times : mapping, optional
        Values that replace those of section [time].

    Raises
    ------
    UserError
        If the file cannot be read, or if anything in it is wrong.
    """
    path = Path(path)
    content = read_toml(path)
    folder = folder_of(path)
    reader = _Reader(path)
    reader.keys(
        content,
        "",
        required=("title", "description", "tolerance", "time"),
        optional=(MODEL, "reference_every", "panels", PARAMETERS, INITIAL, INPUTS),
    )
    tolerance = reader.number(content["tolerance"], "tolerance")
    if not 0 < tolerance < 1:
        reader.fail(f"tolerance: expected a number between 0 and 1, got {tolerance!r}")
    every = content.get("reference_every", 1)
    if type(every) is not int or every < 1:
        reader.fail(f"reference_every: expected a whole number from 1 on, got {show(every)}")

    start, stop, steps = reader.time(reader.table(content["time"], "[time]") | dict(times or {}))
    times = reader.communication_points(start, stop, steps)
    parameters = reader.values(content, PARAMETERS, model)
    initial = reader.values(content, INITIAL, model)
    signals = reader.signals(content, model)
    return Scenario(
        name=path.stem,
        model=folder.name,
        path=path.absolute(),
        title=reader.text(content["title"], "title"),
        description=reader.text(content["description"], "description"),
        parameters=parameters,
        initial=initial,
        start=start,
        stop=stop,
        steps=steps,
        tolerance=tolerance,
        times=times,
        signals=signals,
        inputs=reader.sampled(signals, times - start, model),
        reference_every=min(every, MAX_STEPS),
        defaults=model.start_values,
        panels=reader.panels(content, model),
    )


class _Reader:
    """Takes checked values from one file; errors name the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def fail(self, message: str) -> NoReturn:
        raise UserError(f"{self.path}: {message}")

    # plain values

    def number(self, value: Any, key: str) -> float:
        try:
            return finite_number(value)
        except WrongValueError as error:
            self.fail(f"{key}: {error}")

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
        place = f"{where}: " if where else ""
        for key in table:
            if key not in known:
                guess = did_you_mean(key, known)
                self.fail(f"{place}unknown key {key!r}{guess} (known: {', '.join(known)})")
        for key in required:
            if key not in table:
                self.fail(f"{place}missing key {key!r}")

    # parameters and initial states

    def values(self, content: dict[str, Any], section: str, model: Model) -> dict[str, Value]:
        """Section [parameters] or [initial]: name = value, or an Enumeration's item as a text."""
        result = {}
        for name, given in self.table(content.get(section, {}), f"[{section}]").items():
            where = f"[{section}]"
            try:
                variable = model.find(name, section)
                where = f"[{section}] {name}"
                result[name] = variable.checked(given)
            except WrongValueError as error:
                self.fail(f"{where}: {error}")
        return result

    # pictures

    def panels(self, content: dict[str, Any], model: Model) -> tuple[tuple[str, ...], ...]:
        """Key panels: lists of variables that are drawn into one diagram, of one unit."""
        if "panels" not in content:
            return ()
        drawn = [
            v.name
            for v in model.variables.values()
            if (v.causality == "output" and v.type in ("Real", "Integer"))
            or (v.causality == "input" and v.type == "Real")
        ]
        result = []
        for i, names in enumerate(self.array(content["panels"], "panels", "lists of variables")):
            key = f"panels[{i}]"
            for name in self.array(names, key, "variables"):
                if name not in drawn:
                    guess = did_you_mean(name, drawn) if isinstance(name, str) else ""
                    self.fail(f"{key}: {show(name)} cannot be drawn{guess}")
            if (
                len({(model.variables[name].type, model.variables[name].unit) for name in names})
                > 1
            ):
                self.fail(f"{key}: expected variables of one type and unit")
            result.append(tuple(names))
        return tuple(result)

    # time

    def time(self, content: Any) -> tuple[float, float, tuple[float, ...]]:
        table = self.table(content, "[time]")
        self.keys(table, "[time]", required=("start", "stop", "step"))
        start = self.number(table["start"], "[time] start")
        stop = self.number(table["stop"], "[time] stop")
        if stop <= start or not math.isfinite(stop - start):
            self.fail(f"[time] stop: expected a time after start = {start!r}, got {stop!r}")
        given = table["step"]
        if isinstance(given, list):
            self.array(given, "[time] step", "numbers")
            if len(given) > MAX_PATTERN:
                count = len(given)
                self.fail(f"[time] step: has {count} lengths, expected at most {MAX_PATTERN}")
        else:
            given = [given]
        steps = tuple(self.number(step, "[time] step") for step in given)
        for step in steps:
            if step <= 0:
                self.fail(f"[time] step: expected more than 0 s, got {step!r}")
            if start + step == start or stop - step == stop:
                self.fail(f"[time] step: {step!r} s is lost in rounding between start and stop")
        try:
            count = (stop - start) / math.fsum(steps) * len(steps)
        except OverflowError:
            self.fail("[time] step: the sum of the pattern overflows")
        if count > MAX_STEPS:
            self.fail(f"[time] step: makes {count:.3g} steps, expected at most {MAX_STEPS}")
        return start, stop, steps

    def communication_points(
        self, start: float, stop: float, steps: tuple[float, ...]
    ) -> np.ndarray:
        """Times from start to stop in s, each computed from its index: nothing accumulates."""
        period = math.fsum(steps)
        cycles = math.ceil((stop - start) / period) + 1
        within = np.array([math.fsum(steps[:i]) for i in range(len(steps))])
        with np.errstate(over="ignore"):  # beyond stop
            times = start + (np.arange(cycles)[:, None] * period + within).ravel()
        remainder = np.maximum(SLIVER * np.array(steps), 4 * np.spacing(max(abs(start), abs(stop))))
        times = times[stop - times >= np.tile(remainder, cycles)]
        times = np.concatenate(([start], times[times > start], [stop]))
        if not np.all(np.diff(times) > 0):
            self.fail("[time] step: too short, communication points coincide")
        times.setflags(write=False)
        return times

    # inputs

    def signals(self, content: dict[str, Any], model: Model) -> dict[str, Signal]:
        """Section [inputs] as functions of time."""
        result = {}
        for name, given in self.table(content.get(INPUTS, {}), f"[{INPUTS}]").items():
            try:
                variable = model.find(name, INPUTS)
            except WrongValueError as error:
                self.fail(f"[{INPUTS}]: {error}")
            where = f"[{INPUTS}.{name}]"
            if variable.type == "Boolean":
                result[name] = self.switches(given, where, variable)
            elif variable.type == "Real":
                result[name] = self.signal(given, where)
            else:
                self.fail(f"{where}: is of type {variable.type}, expected Real or Boolean")
        return result

    def switches(self, content: Any, where: str, variable: Variable) -> Switches:
        """A Boolean input: constant, or a table of times and values."""
        table = self.table(content, where)
        self.keys(table, where, optional=("constant", "table"))
        if len(table) != 1:
            self.fail(f"{where}: expected exactly one of constant, table, got {len(table)}")
        if "constant" in table:
            return Switches(
                ((0.0, self.boolean(table["constant"], f"{where} constant", variable)),)
            )
        rows = self.rows(table, where)
        return Switches(tuple((t, self.boolean(v, key, variable)) for t, v, key in rows))

    def boolean(self, given: Any, key: str, variable: Variable) -> bool:
        try:
            return bool(variable.checked(given))
        except WrongValueError as error:
            self.fail(f"{key}: {error}")

    def signal(self, content: Any, where: str) -> Signal:
        table = self.table(content, where)
        shapes = {"constant": self.constant, "sines": self.sines, "table": self.points}
        self.keys(table, where, optional=(*shapes, "offset"))
        given = [shape for shape in shapes if shape in table]
        if len(given) != 1:
            self.fail(f"{where}: expected exactly one of {', '.join(shapes)}, got {len(given)}")
        if "offset" in table and given != ["sines"]:
            self.fail(f"{where} offset: goes with sines only")
        return shapes[given[0]](table, where)

    def constant(self, table: dict[str, Any], where: str) -> Constant:
        return Constant(self.number(table["constant"], f"{where} constant"))

    def sines(self, table: dict[str, Any], where: str) -> Sines:
        offset = self.number(table.get("offset", 0.0), f"{where} offset")
        terms = []
        for i, sine in enumerate(self.array(table["sines"], f"{where} sines", "tables")):
            key = f"{where} sines[{i}]"
            self.keys(self.table(sine, key), key, ("amplitude", "frequency"), ("phase",))
            amplitude = self.number(sine["amplitude"], f"{key} amplitude")
            frequency = self.number(sine["frequency"], f"{key} frequency")
            phase = self.number(sine.get("phase", 0.0), f"{key} phase")
            terms.append((amplitude, frequency, phase))
        return Sines(offset, tuple(terms))

    def points(self, table: dict[str, Any], where: str) -> Table:
        rows = self.rows(table, where)
        return Table(tuple((time, self.number(value, key)) for time, value, key in rows))

    def rows(self, table: dict[str, Any], where: str) -> list[tuple[float, Any, str]]:
        """Times in s, values as they stand in the file, and their keys."""
        rows: list[tuple[float, Any, str]] = []
        for i, row in enumerate(
            self.array(table["table"], f"{where} table", "[time, value] pairs")
        ):
            key = f"{where} table[{i}]"
            if not isinstance(row, list) or len(row) != 2:
                self.fail(f"{key}: expected [time, value], got {show(row)}")
            time = self.number(row[0], key)
            if i and time <= rows[-1][0]:
                self.fail(f"{key}: expected a time after {rows[-1][0]!r} s, got {show(row)}")
            rows.append((time, row[1], key))
        return rows

    def sampled(
        self, signals: dict[str, Signal], elapsed: np.ndarray, model: Model
    ) -> dict[str, np.ndarray]:
        """Values of the inputs at `elapsed` seconds after the start, (n + 1,) each."""
        result = {}
        for name, signal in signals.items():
            where = f"[{INPUTS}.{name}]"
            with np.errstate(all="ignore"):
                values = signal.values(elapsed)
            if not np.all(np.isfinite(values)):
                self.fail(f"{where}: expected finite values, got an overflow")
            try:
                model.variables[name].check_range(float(values.min()), float(values.max()))
            except WrongValueError as error:
                self.fail(f"{where}: {error}")
            values.setflags(write=False)
            result[name] = values
        return result
