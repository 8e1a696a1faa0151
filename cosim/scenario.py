"""Scenarios: what to simulate, read from models/<model>/scenarios/<name>.toml.

The README.md next to the scenarios documents the format.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from cosim import variables
from cosim.errors import UserError, did_you_mean
from cosim.variables import show

MAX_STEPS = 10_000_000
MAX_PATTERN = 1000  # step lengths in a pattern
SLIVER = 1e-9  # a last step shorter than this fraction of its full length joins the one before


@dataclass(frozen=True, eq=False)
class Scenario:
    """A run of one model: parameters, initial state, communication points and inputs (SI units).

    Only what the file gives is in `parameters`, `initial` and `inputs`; everything else has the
    start value of the model's variables.toml. Arrays are read-only.
    """

    name: str
    model: str  # folder name below models/
    path: Path
    title: str
    description: str
    parameters: dict[str, float]
    initial: dict[str, float]
    start: float  # s
    stop: float  # s
    steps: tuple[float, ...]  # s, pattern of step lengths; one element: a constant step
    tolerance: float  # relative
    times: np.ndarray  # (n + 1,) communication points in s, from start to stop
    inputs: dict[str, np.ndarray]  # (n + 1,) each: held over the step that begins at times[i]
    reference_every: int  # every k-th communication point is in the reference

    @property
    def model_folder(self) -> Path:
        """models/<model>."""
        return self.path.parent.parent

    @property
    def reference_folder(self) -> Path:
        """models/<model>/references/<name>."""
        return self.model_folder / "references" / self.name

    @property
    def reference_rows(self) -> np.ndarray:
        """Indices (rows,) of the communication points in the reference: every k-th and the last."""
        last = len(self.times) - 1
        return np.append(np.arange(0, last, self.reference_every), last)


def find_all(root: Path) -> dict[str, Path]:
    """All scenarios below `root`/models, by name."""
    found: dict[str, Path] = {}
    for path in sorted(Path(root).glob("models/*/scenarios/*.toml")):
        if path.stem in found:
            raise UserError(f"{path}: the name {path.stem!r} is taken by {found[path.stem]}")
        found[path.stem] = path
    return dict(sorted(found.items()))


def find(root: Path, name: str) -> Path:
    """Path of the scenario called `name`; if there is none, a UserError lists the known ones."""
    found = find_all(root)
    if name not in found:
        known = ", ".join(found) or "none"
        raise UserError(f"no scenario {name!r}{did_you_mean(name, found)} (known: {known})")
    return found[name]


def load(path: Path) -> Scenario:
    """Read and check the scenario at `path`, a file in models/<model>/scenarios/.

    Raises
    ------
    UserError
        If the file or the model's variables.toml cannot be read, or if anything in it is wrong.
    """
    path = Path(path)
    content = variables.read_toml(path)
    model_folder = path.absolute().parent.parent
    if not (model_folder / variables.FILE_NAME).is_file():
        raise UserError(f"{path}: expected in models/<model>/scenarios/, next to a model's files")
    reader = _Reader(path, variables.load(model_folder))

    reader.keys(
        content,
        "",
        required=("title", "description", "tolerance", "time"),
        optional=("reference_every", "parameters", "initial", "inputs"),
    )
    tolerance = reader.number(content["tolerance"], "tolerance")
    if not 0 < tolerance < 1:
        reader.fail("tolerance", f"expected a number between 0 and 1, got {tolerance!r}")
    every = content.get("reference_every", 1)
    if type(every) is not int or every < 1:
        reader.fail("reference_every", f"expected a whole number from 1 on, got {show(every)}")

    start, stop, steps = reader.time(content["time"])
    times = reader.communication_points(start, stop, steps)
    inputs = reader.table(content.get("inputs", {}), "[inputs]")
    return Scenario(
        name=path.stem,
        model=model_folder.name,
        path=path.absolute(),
        title=reader.text(content["title"], "title"),
        description=reader.text(content["description"], "description"),
        parameters=reader.values(content, "parameters"),
        initial=reader.values(content, "initial"),
        start=start,
        stop=stop,
        steps=steps,
        tolerance=tolerance,
        times=times,
        inputs={name: reader.input(name, value, times - start) for name, value in inputs.items()},
        reference_every=min(every, MAX_STEPS),
    )


class _Reader:
    """Takes checked values from one file; errors name the file and the key."""

    def __init__(self, path: Path, declared: dict[str, dict[str, Any]]) -> None:
        self.path = path
        self.declared = declared

    def fail(self, key: str, message: str) -> NoReturn:
        raise UserError(f"{self.path}: {key}: {message}")

    # plain values

    def number(self, value: Any, key: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fail(key, f"expected a number, got {show(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.fail(key, f"expected a finite number, got {show(value)}")
        return number

    def text(self, value: Any, key: str) -> str:
        if not isinstance(value, str) or not value.strip():
            self.fail(key, f"expected a text, got {show(value)}")
        return value.strip()

    def table(self, value: Any, key: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            self.fail(key, f"expected a table, got {show(value)}")
        return value

    def array(self, value: Any, key: str, of: str) -> list[Any]:
        if not isinstance(value, list) or not value:
            self.fail(key, f"expected a list of {of}, got {show(value)}")
        return value

    def keys(
        self, table: dict, where: str, required: Iterable[str] = (), optional: Iterable[str] = ()
    ) -> None:
        known = [*required, *optional]
        place = f"{where}: " if where else ""
        for key in table:
            if key not in known:
                guess = did_you_mean(key, known)
                raise UserError(
                    f"{self.path}: {place}unknown key {key!r}{guess} (known: {', '.join(known)})"
                )
        for key in required:
            if key not in table:
                raise UserError(f"{self.path}: {place}missing key {key!r}")

    # variables

    def variable(self, name: str, section: str) -> dict[str, Any]:
        """Declaration of a variable that may stand in [section]."""
        suits = {
            "parameters": lambda v: v.get("causality") == "parameter",
            "initial": lambda v: v.get("causality") == "output" and v.get("initial") == "exact",
            "inputs": lambda v: v.get("causality") == "input",
        }[section]
        meant = [key for key, variable in self.declared.items() if suits(variable)]
        where, known = f"[{section}]", ", ".join(meant) or "none"
        if name not in self.declared:
            guess = did_you_mean(name, meant)
            self.fail(where, f"the model has no variable {name!r}{guess} (known: {known})")
        if name not in meant:
            kind = {"parameters": "a parameter", "initial": "a state", "inputs": "an input"}[
                section
            ]
            self.fail(where, f"{name!r} is not {kind} of the model (known: {known})")
        return self.declared[name]

    def item(self, value: Any, items: list[str], key: str) -> float:
        """Number of an Enumeration's item, which is given by its name."""
        if not isinstance(value, str) or value not in items:
            guess = did_you_mean(value, items) if isinstance(value, str) else ""
            known = ", ".join(f'"{item}"' for item in items)
            self.fail(key, f"expected one of {known}, got {show(value)}{guess}")
        return float(items.index(value) + 1)

    def in_range(self, low: float, high: float, variable: dict[str, Any], key: str) -> None:
        unit = f" {variable['unit']}" if "unit" in variable else ""
        if low < variable.get("min", -math.inf):
            self.fail(key, f"expected at least {show(variable['min'])}{unit}, got {low!r}")
        if high > variable.get("max", math.inf):
            self.fail(key, f"expected at most {show(variable['max'])}{unit}, got {high!r}")

    def values(self, content: dict[str, Any], section: str) -> dict[str, float]:
        """Section [parameters] or [initial]: name = value, or an Enumeration's item as a text."""
        result = {}
        for name, value in self.table(content.get(section, {}), f"[{section}]").items():
            variable = self.variable(name, section)
            key = f"[{section}] {name}"
            if variable["type"] == "Enumeration":
                result[name] = self.item(value, list(variable["items"]), key)
                continue
            result[name] = self.number(value, key)
            if variable["type"] == "Integer" and not result[name].is_integer():
                self.fail(key, f"expected a whole number, got {show(value)}")
            self.in_range(result[name], result[name], variable, key)
        return result

    # time

    def time(self, content: Any) -> tuple[float, float, tuple[float, ...]]:
        table = self.table(content, "[time]")
        self.keys(table, "[time]", required=("start", "stop", "step"))
        start = self.number(table["start"], "[time] start")
        stop = self.number(table["stop"], "[time] stop")
        if stop <= start or not math.isfinite(stop - start):
            self.fail("[time] stop", f"expected a time after start = {start!r}, got {stop!r}")
        given = table["step"]
        if isinstance(given, list):
            self.array(given, "[time] step", "numbers")
            if len(given) > MAX_PATTERN:
                self.fail(
                    "[time] step", f"has {len(given)} lengths, expected at most {MAX_PATTERN}"
                )
        else:
            given = [given]
        steps = tuple(self.number(step, "[time] step") for step in given)
        for step in steps:
            if step <= 0:
                self.fail("[time] step", f"expected more than 0 s, got {step!r}")
            if start + step == start or stop - step == stop:
                self.fail("[time] step", f"{step!r} s is lost in rounding between start and stop")
        try:
            count = (stop - start) / math.fsum(steps) * len(steps)
        except OverflowError:
            self.fail("[time] step", "the sum of the pattern overflows")
        if count > MAX_STEPS:
            self.fail("[time] step", f"makes {count:.3g} steps, expected at most {MAX_STEPS}")
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
            self.fail("[time] step", "too short to tell the communication points apart")
        times.setflags(write=False)
        return times

    # inputs

    def input(self, name: str, content: Any, elapsed: np.ndarray) -> np.ndarray:
        """Values of one input at `elapsed` seconds after the start, (n + 1,)."""
        variable = self.variable(name, "inputs")
        where = f"[inputs.{name}]"
        table = self.table(content, where)
        shapes = ("constant", "sines", "table")
        self.keys(table, where, optional=(*shapes, "offset"))
        given = [shape for shape in shapes if shape in table]
        if len(given) != 1:
            self.fail(where, f"expected exactly one of {', '.join(shapes)}, got {len(given)}")
        if "offset" in table and given != ["sines"]:
            self.fail(f"{where} offset", "goes with sines only")
        with np.errstate(all="ignore"):
            values = getattr(self, f"_{given[0]}")(table, where, elapsed)
        if not np.all(np.isfinite(values)):
            self.fail(where, "expected finite values, got an overflow")
        self.in_range(float(values.min()), float(values.max()), variable, where)
        values.setflags(write=False)
        return values

    def _constant(self, table: dict[str, Any], where: str, elapsed: np.ndarray) -> np.ndarray:
        return np.full(len(elapsed), self.number(table["constant"], f"{where} constant"))

    def _sines(self, table: dict[str, Any], where: str, elapsed: np.ndarray) -> np.ndarray:
        # numpy's sine of doubles depends on the processor; that of long doubles, rounded, does not
        t = elapsed.astype(np.longdouble)
        total = np.full(len(t), self.number(table.get("offset", 0.0), f"{where} offset"), t.dtype)
        for i, sine in enumerate(self.array(table["sines"], f"{where} sines", "tables")):
            key = f"{where} sines[{i}]"
            self.keys(self.table(sine, key), key, ("amplitude", "frequency"), ("phase",))
            amplitude = self.number(sine["amplitude"], f"{key} amplitude")
            frequency = self.number(sine["frequency"], f"{key} frequency")
            phase = self.number(sine.get("phase", 0.0), f"{key} phase")
            total += amplitude * np.sin(2 * np.pi * frequency * t + phase)
        return total.astype(np.float64)

    def _table(self, table: dict[str, Any], where: str, elapsed: np.ndarray) -> np.ndarray:
        key = f"{where} table"
        points = []
        for i, row in enumerate(self.array(table["table"], key, "[time, value] pairs")):
            if not isinstance(row, list) or len(row) != 2:
                self.fail(f"{key}[{i}]", f"expected [time, value], got {show(row)}")
            points.append([self.number(value, f"{key}[{i}]") for value in row])
            if i and points[i][0] <= points[i - 1][0]:
                last = points[i - 1][0]
                self.fail(f"{key}[{i}]", f"expected a time after {last!r} s, got {show(row)}")
        t, values = np.array(points).T
        return np.interp(elapsed, t, values)
