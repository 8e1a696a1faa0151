"""What the file of a model says: its tables, the names and the expressions in them."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from equations.graph import Graph, Value
from rparm.expressions.kinds import CONDITION, NUMBER
from rparm.expressions.numbers import finite_number
from rparm.expressions.parser import parse
from rparm.expressions.tree import FUNCTIONS, NO_NAMES, RELATIONS, Node
from rparm.expressions.units import ANGLE, BASE, Unit, exponents

LARGEST = 10**6  # bytes
MOST_VARIABLES = 1000
LONGEST_TEXT = 1000  # characters of a description or a message
NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
RESERVED = {*FUNCTIONS, *NO_NAMES, "pi", "time", "GUID", "NAME", "TOKEN_FMI3"}

NUMBERS = ("start", "min", "max", "nominal")
OF_ALL = ("start", "unit", "min", "max", "description")
SECTIONS = {  # keys of their entries, and the one that each needs
    "parameters": (OF_ALL, "start"),
    "inputs": (OF_ALL, ""),
    "states": ((*OF_ALL, "nominal", "derivative"), "derivative"),
    "where": ((), ""),  # they are expressions
    "outputs": (("value", "unit", "description"), "value"),
}
HEAD = ("name", "description", "experiment", "modes", "units", "events", "check", *SECTIONS)
EXPERIMENT = {"stop": 10.0, "step": 0.01, "tolerance": 1e-8}
EVENT = ("when", "while", "reinit", "set")
# what other languages have, by what it looks like, and what to do instead
INSTEAD = {
    r"\[": "arrays are not supported: give each element a name and write sums out",
    r"==|\bder\s*\(|^(?:equations?|algebraic|residuals?|dae)$": (
        "equations in implicit form are not supported: solve them for the derivative of each state"
    ),
    r"\b(?:sample[rds]?|pre|previous|hold|clock|interval)\s*(?:\(|$)": (
        "samplers are not supported: set an input at the communication points, or write the model "
        "in C"
    ),
    r"\b(?:noise|random|rand|randn|gauss|normal|uniform)\s*(?:\(|$)": (
        "noise is not supported: make it outside and give it to an input"
    ),
}


class ModelFileError(Exception):
    """What is wrong with the file, in one line."""


@dataclass
class Expression:
    """An expression of the file."""

    place: tuple[str, ...]
    text: str
    kind: str = NUMBER
    target: str = ""  # the variable that it is assigned to, if that has a unit of its own
    is_rate: bool = False  # of the target
    tree: Node = field(init=False)
    value: Value = field(init=False)  # as a graph

    def __post_init__(self) -> None:
        with placed(*self.place):
            if not isinstance(self.text, str):
                raise ModelFileError(f"expected an expression in quotes, got {shown(self.text)}")
            try:
                self.tree = parse(self.text)
            except ValueError as error:
                raise ModelFileError(f"{error}{_instead(self.text)}") from None


@dataclass
class Variable:
    """A variable of the file; numbers that it does not give are None."""

    name: str
    section: str
    start: float | None = None
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    unit: str = ""  # as the file has it
    description: str = ""
    expression: Expression | None = None  # derivative of a state, value of others

    @property
    def value(self) -> Value:
        """What the expression calculates."""
        return self.expression.value


@dataclass
class Event:
    """An event of the file."""

    name: str
    when: Expression
    during: Expression | None  # `while`
    reinit: dict[str, Expression]  # by state
    set: dict[str, Expression]  # by mode

    @property
    def expressions(self) -> list[Expression]:
        """All of them."""
        first = [self.when] if self.during is None else [self.when, self.during]
        return [*first, *self.reinit.values(), *self.set.values()]


@dataclass
class ModelFile:
    """All that the file says."""

    name: str
    description: str
    experiment: dict[str, float]
    text: str  # the file
    units: dict[str, dict[str, int]]  # exponents of the base units and rad, of [units]
    modes: list[str] = field(default_factory=list)
    variables: dict[str, Variable] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    checks: dict[str, Expression] = field(default_factory=dict)  # conditions by message
    graph: Graph = field(default_factory=Graph)
    found_units: dict[str, Unit] = field(default_factory=dict)  # of all variables

    @property
    def has_units(self) -> bool:
        """Whether units are checked."""
        return any(variable.unit for variable in self.variables.values())

    def of(self, *sections: str) -> list[Variable]:
        """Variables of these sections, in the order of the file."""
        return [v for section in sections for v in self.variables.values() if v.section == section]

    def exponents(self, unit: str) -> dict[str, int]:
        """Exponents of a unit; ValueError if there is none of that name."""
        return self.units[unit] if unit in self.units else exponents(unit)


@contextmanager
def placed(*place: object) -> Iterator[None]:
    """Put the place in front of what is wrong inside."""
    try:
        yield
    except (ModelFileError, ValueError) as error:
        raise ModelFileError(": ".join([*map(str, place), str(error)])) from None


def shown(value: object) -> str:
    """A value of the file in a message."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a very large number"
    return text if len(text) <= 60 else text[:57] + "..."


def _instead(text: str) -> str:
    """What to do instead of what is not supported, or nothing."""
    found = [sentence for pattern, sentence in INSTEAD.items() if re.search(pattern, text)]
    return f"; {found[0]}" if found else ""


def tables_of(path: Path) -> tuple[str, dict[str, Any]]:
    """Text and tables of a file."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"cannot be read: {error.strerror}") from None
    if len(content) > LARGEST:
        raise ModelFileError(f"has {len(content)} bytes, expected at most {LARGEST}")
    try:
        text = content.decode("utf-8").replace("\r\n", "\n")
        return text, tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        reason = " ".join(str(error).split()) or "too many levels"
        raise ModelFileError(f"is not valid TOML: {reason:.200}") from None


def read_tables(text: str, tables: dict[str, Any], solver_names: Iterable[str]) -> ModelFile:
    """What the tables say, without the meaning of the expressions."""
    _check_keys(tables, HEAD, "section")
    name = tables.get("name")
    with placed("name"):
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ModelFileError(f"expected a letter, then letters, digits, _, got {shown(name)}")
    units = {}
    for symbol, given in _table(tables, "units").items():
        with placed("[units]", shown(symbol)):
            units[symbol] = _exponents(given)
    description = _text(tables.get("description", ""), "description")
    file = ModelFile(name, description, _experiment(_table(tables, "experiment")), text, units)
    reserved = RESERVED | set(solver_names)
    _read_variables(file, tables, reserved)
    _read_events(file, tables, reserved)
    for message, condition in _table(tables, "check").items():
        place = ("[check]", shown(message))
        with placed(place[0]):
            message = _text(message, place[1])
        file.checks[message] = Expression(place, condition, CONDITION)
    return file


def _table(tables: dict[str, Any], key: str) -> dict[str, Any]:
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise ModelFileError(f"{key}: expected a table, got {shown(table)}")
    return table


def _check_keys(table: dict[str, Any], known: Collection[str], what: str = "key") -> None:
    for key in table:
        if key not in known:
            listed = f"unknown {what} {shown(key)}, expected one of {', '.join(known)}"
            raise ModelFileError(listed + _instead(key))


def _exponents(given: object) -> dict[str, int]:
    if not isinstance(given, dict):
        raise ModelFileError(f"expected a table of exponents, got {shown(given)}")
    _check_keys(given, (*BASE, ANGLE), "base unit")
    for symbol, exponent in given.items():
        if type(exponent) is not int or abs(exponent) > 99:
            raise ModelFileError(f"{symbol}: expected a whole exponent, got {shown(exponent)}")
    return given


def _text(value: object, key: str) -> str:
    with placed(key):
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise ModelFileError(
                f"expected a text of at most {LONGEST_TEXT} characters, got {shown(value)}"
            )
        if CONTROL.search(value):
            raise ModelFileError("has a control character")
    return " ".join(value.split())


def _number(value: object, key: str) -> float:
    with placed(key):
        try:
            return finite_number(value)
        except ValueError as error:
            instead = _instead("[") if isinstance(value, list) else ""
            raise ModelFileError(f"{error}, got {shown(value)}{instead}") from None


def _experiment(table: dict[str, Any]) -> dict[str, float]:
    with placed("experiment"):
        _check_keys(table, EXPERIMENT)
        given = EXPERIMENT | {key: _number(value, key) for key, value in table.items()}
        if "step" not in table:
            given["step"] = min(given["step"], given["stop"] / 100)
        if not 0 < given["step"] <= given["stop"]:
            raise ModelFileError("expected 0 < step <= stop")
        if not 0 < given["tolerance"] < 1:
            raise ModelFileError("expected a tolerance between 0 and 1")
    return given


def _read_variables(file: ModelFile, tables: dict[str, Any], reserved: set[str]) -> None:
    for section in SECTIONS:
        for name, entry in _table(tables, section).items():
            place = (f"[{section}]", name if NAME.fullmatch(name) else shown(name))
            with placed(*place):
                _check_name(name, file, reserved)
                variable = file.variables[name] = _variable(name, section, entry)
            if section == "where":
                variable.expression = Expression(place, entry)
            elif section in ("states", "outputs"):
                key = SECTIONS[section][1]
                variable.expression = Expression(
                    (*place, key), entry[key], NUMBER, name, section == "states"
                )
    if not file.variables:
        raise ModelFileError("has no variables, expected a section such as [states]")


def _check_name(name: str, file: ModelFile, reserved: set[str]) -> None:
    if not NAME.fullmatch(name):
        raise ModelFileError("expected a name: a letter, then letters, digits, _")
    if name in reserved or name.startswith("der_"):
        raise ModelFileError("this name is reserved, choose another one")
    if name in file.variables:
        raise ModelFileError(f"this name is in [{file.variables[name].section}] already")
    if name in file.modes:
        raise ModelFileError("this name is in modes already")
    if len(file.variables) + len(file.modes) + len(file.events) >= MOST_VARIABLES:
        raise ModelFileError(f"has more than {MOST_VARIABLES} variables, modes and events")


def _variable(name: str, section: str, entry: object) -> Variable:
    keys, needed = SECTIONS[section]
    if section == "where":
        return Variable(name, section)
    if not isinstance(entry, dict):
        example = f"{{ {needed or 'unit'} = ... }}"
        raise ModelFileError(f"expected a table such as {example}, got {shown(entry)}")
    _check_keys(entry, keys)
    if needed and needed not in entry:
        raise ModelFileError(f"{needed} is missing")
    numbers = {key: _number(entry[key], key) for key in NUMBERS if key in entry}
    texts = {key: _text(entry.get(key, ""), key) for key in ("unit", "description")}
    variable = Variable(name, section, **numbers, **texts)
    if section in ("inputs", "states") and variable.start is None:
        variable.start = 0.0
    _check_range(variable)
    return variable


def _check_range(variable: Variable) -> None:
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if variable.start is not None and not low <= variable.start <= high:
        raise ModelFileError(f"start = {variable.start:g} is outside [min, max]")
    if variable.nominal is not None and not variable.nominal > 0:
        raise ModelFileError(f"nominal = {variable.nominal:g}: expected a number above 0")


def _read_events(file: ModelFile, tables: dict[str, Any], reserved: set[str]) -> None:
    modes = tables.get("modes", [])
    if not isinstance(modes, list) or not all(isinstance(mode, str) for mode in modes):
        raise ModelFileError(f"modes: expected a list of names, got {shown(modes)}")
    for mode in modes:
        with placed("modes", shown(mode)):
            _check_name(mode, file, reserved)
        file.modes.append(mode)
    for name, entry in _table(tables, "events").items():
        place = f"[events.{name if NAME.fullmatch(name) else shown(name)}]"
        with placed(place):
            _check_name(name, file, reserved)
            _check_event(entry, file)
        file.events.append(_event(name, entry, place))


def _check_event(entry: object, file: ModelFile) -> None:
    if not isinstance(entry, dict) or "when" not in entry:
        raise ModelFileError(f"expected a table with when, got {shown(entry)}")
    _check_keys(entry, EVENT)
    for changed in _table(entry, "reinit"):
        if changed not in (variable.name for variable in file.of("states")):
            raise ModelFileError(f"reinit: expected a state, got {shown(changed)}")
    for changed in _table(entry, "set"):
        if changed not in file.modes:
            raise ModelFileError(f"set: expected one of modes, got {shown(changed)}")


def _event(name: str, entry: dict[str, Any], place: str) -> Event:
    def listed(key: str, kind: str) -> dict[str, Expression]:
        return {
            changed: Expression(
                (place, f"{key}: {changed}"), text, kind, changed * (kind == NUMBER)
            )
            for changed, text in entry.get(key, {}).items()
        }

    when = Expression((place, "when"), entry["when"], CONDITION)
    if when.tree.op not in RELATIONS:
        raise ModelFileError(f"{place}: when: expected one relation such as h < 0")
    during = Expression((place, "while"), entry["while"], CONDITION) if "while" in entry else None
    return Event(name, when, during, listed("reinit", NUMBER), listed("set", CONDITION))
