"""Reads the file of a model, checks it, and makes a graph of its expressions.

Every mistake is a ModelFileError: file, section, name, column and what was expected, in one line.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from equations.graph import Graph, Value
from rparm.expressions.kinds import CONDITION, NUMBER, check_kinds
from rparm.expressions.parser import parse
from rparm.expressions.tree import FUNCTIONS, NO_NAMES, RELATIONS, ExpressionError, Node, names
from rparm.expressions.units import ONE, Unit, exponents, unit_of, unit_of_exponents

LARGEST = 10**6  # bytes
MOST_VARIABLES = 1000
LONGEST_TEXT = 1000  # characters of a description or a message
NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
RESERVED = {*FUNCTIONS, *NO_NAMES, "pi", "time", "GUID", "NAME", "TOKEN_FMI3"}

SECTIONS = {
    "parameters": ("start", "unit", "min", "max", "description"),
    "inputs": ("start", "unit", "min", "max", "description"),
    "states": ("start", "unit", "min", "max", "nominal", "derivative", "description"),
    "where": (),
    "outputs": ("value", "unit", "description"),
}
HEAD = ("name", "description", "experiment", "modes", "units", "events", "check", *SECTIONS)
NUMBERS = ("start", "min", "max", "nominal")
TEXTS = ("unit", "description", "derivative", "value")
NEEDED = {"parameters": "start", "states": "derivative", "outputs": "value"}
EXPERIMENT = {"stop": 10.0, "step": 0.01, "tolerance": 1e-8}
EVENT = ("when", "while", "reinit", "set")


class ModelFileError(Exception):
    """What is wrong with the file, in one line."""


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
    text: str = ""  # derivative of a state, value of an output or [where] entry
    tree: Node | None = None
    value: Value | None = None  # of a state its derivative


@dataclass
class Event:
    """An event of the file."""

    name: str
    when: Node
    during: Node | None  # `while`
    reinit: dict[str, Node]  # by state
    set: dict[str, Node]  # by mode


@dataclass
class EventValues:
    """What an event of the file does, as a graph."""

    name: str
    when: Value  # a switch
    during: Value | None
    reinit: dict[str, Value]
    set: dict[str, Value]


@dataclass
class ModelFile:
    """All that the file says."""

    name: str
    description: str
    experiment: dict[str, float]
    text: str  # the file
    units: dict[str, dict[str, int]]  # exponents of the base units and rad, of [units]
    has_units: bool = False
    modes: list[str] = field(default_factory=list)
    variables: dict[str, Variable] = field(default_factory=dict)
    trees_of_events: list[Event] = field(default_factory=list)
    events: list[EventValues] = field(default_factory=list)
    checks: list[tuple[str, Value]] = field(default_factory=list)  # message, condition
    graph: Graph = field(default_factory=Graph)
    found_units: dict[str, Unit] = field(default_factory=dict)  # of all variables

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
    except (ModelFileError, ExpressionError, ValueError) as error:
        raise ModelFileError(": ".join([*map(str, place), str(error)])) from None


def read(path: Path, solver_names: Iterable[str] = ()) -> ModelFile:
    """Read and check a file; solver_names: of the variables that every model has.

    ModelFileError if something in it is wrong.
    """
    with placed(path):
        text, tables = _tables(path)
        file = _head(text, tables)
        _read_variables(file, tables, set(solver_names))
        _read_events(file, tables, set(solver_names))
        checks = _expressions_of_checks(file, tables.get("check", {}))
        _check_expressions(file)
        _make_graph(file)
        for place, message, tree in checks:
            with placed(place):
                file.checks.append((message, file.graph.of_tree(tree, _leaves(file))))
    return file


def _tables(path: Path) -> tuple[str, dict[str, Any]]:
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


def _head(text: str, tables: dict[str, Any]) -> ModelFile:
    for key in tables:
        if key not in HEAD:
            raise ModelFileError(f"unknown section {key!r:.60}, expected one of {', '.join(HEAD)}")
    name = tables.get("name")
    with placed("name"):
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ModelFileError(f"expected a letter, then letters, digits, _, got {_shown(name)}")
    units = {}
    for symbol, given in _table(tables, "units").items():
        with placed("[units]", _shown(symbol)):
            units[symbol] = _exponents(given)
    description = _text(tables.get("description", ""), "description")
    return ModelFile(name, description, _experiment(_table(tables, "experiment")), text, units)


def _table(tables: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = tables.get(key, {})
    if not isinstance(table, dict):
        raise ModelFileError(f"{key}: expected a table, got {_shown(table)}")
    return table


def _shown(value: object) -> str:
    """A value of the file in a message."""
    return repr(value) if len(repr(value)) <= 60 else repr(value)[:57] + "..."


def _exponents(given: object) -> dict[str, int]:
    base = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    if not isinstance(given, dict):
        raise ModelFileError(f"expected a table of exponents, got {_shown(given)}")
    for symbol, exponent in given.items():
        if symbol not in base:
            raise ModelFileError(f"unknown base unit {_shown(symbol)}, expected {', '.join(base)}")
        if type(exponent) is not int or abs(exponent) > 99:
            raise ModelFileError(f"{symbol}: expected a whole exponent, got {_shown(exponent)}")
    return given


def _text(value: object, key: str) -> str:
    with placed(key):
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise ModelFileError(
                f"expected a text of at most {LONGEST_TEXT} characters, got {_shown(value)}"
            )
        if CONTROL.search(value):
            raise ModelFileError("has a control character")
    return " ".join(value.split())


def _number(value: object, key: str) -> float:
    with placed(key):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ModelFileError(f"expected a number, got {_shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ModelFileError("expected a finite number")
    return number


def _experiment(table: dict[str, Any]) -> dict[str, float]:
    with placed("experiment"):
        for key in table:
            if key not in EXPERIMENT:
                raise ModelFileError(f"unknown key {_shown(key)}, expected {', '.join(EXPERIMENT)}")
        given = EXPERIMENT | {key: _number(value, key) for key, value in table.items()}
        if "step" not in table:
            given["step"] = min(given["step"], given["stop"] / 100)
        if not 0 < given["step"] <= given["stop"]:
            raise ModelFileError("expected 0 < step <= stop")
        if not 0 < given["tolerance"] < 1:
            raise ModelFileError("expected a tolerance between 0 and 1")
    return given


def _read_variables(file: ModelFile, tables: dict[str, Any], solver_names: set[str]) -> None:
    for section in SECTIONS:
        for name, entry in _table(tables, section).items():
            with placed(f"[{section}]", name if NAME.fullmatch(name) else _shown(name)):
                _check_name(name, file, solver_names)
                file.variables[name] = _variable(name, section, entry)
    if len(file.variables) > MOST_VARIABLES:
        raise ModelFileError(f"has {len(file.variables)} variables, at most {MOST_VARIABLES}")
    if not file.variables:
        raise ModelFileError("has no variables, expected a section such as [states]")
    file.has_units = any(variable.unit for variable in file.variables.values())


def _check_name(name: str, file: ModelFile, solver_names: set[str]) -> None:
    if not NAME.fullmatch(name):
        raise ModelFileError("expected a name: a letter, then letters, digits, _")
    if name in RESERVED or name in solver_names or name.startswith("der_"):
        raise ModelFileError("this name is reserved, choose another one")
    if name in file.variables:
        raise ModelFileError(f"this name is in [{file.variables[name].section}] already")


def _variable(name: str, section: str, entry: object) -> Variable:
    if section == "where":
        if not isinstance(entry, str):
            raise ModelFileError(f"expected an expression in quotes, got {_shown(entry)}")
        return Variable(name, section, text=entry, tree=parse(entry))
    if not isinstance(entry, dict):
        needed = NEEDED.get(section, "unit")
        raise ModelFileError(f"expected a table such as {{ {needed} = ... }}, got {_shown(entry)}")
    for key in entry:
        if key not in SECTIONS[section]:
            known = ", ".join(SECTIONS[section])
            raise ModelFileError(f"unknown key {_shown(key)}, expected one of {known}")
    if NEEDED.get(section, "") not in ("", *entry):
        raise ModelFileError(f"{NEEDED[section]} is missing")
    numbers = {key: _number(entry[key], key) for key in NUMBERS if key in entry}
    variable = Variable(name, section, **numbers)
    variable.unit = _text(entry.get("unit", ""), "unit")
    variable.description = _text(entry.get("description", ""), "description")
    if section in ("inputs", "states") and variable.start is None:
        variable.start = 0.0
    _check_range(variable)
    for key in ("derivative", "value"):
        if key in entry:
            with placed(key):
                if not isinstance(entry[key], str):
                    raise ModelFileError(
                        f"expected an expression in quotes, got {_shown(entry[key])}"
                    )
                variable.text, variable.tree = entry[key], parse(entry[key])
    return variable


def _check_range(variable: Variable) -> None:
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if variable.start is not None and not low <= variable.start <= high:
        raise ModelFileError(f"start = {variable.start:g} is outside [min, max]")
    if variable.nominal is not None and not variable.nominal > 0:
        raise ModelFileError(f"nominal = {variable.nominal:g}: expected a number above 0")


# ---- Events ----------------------------------------------------------------------------------


def _read_events(file: ModelFile, tables: dict[str, Any], solver_names: set[str]) -> None:
    modes = tables.get("modes", [])
    if not isinstance(modes, list) or not all(isinstance(mode, str) for mode in modes):
        raise ModelFileError(f"modes: expected a list of names, got {_shown(modes)}")
    for mode in modes:
        with placed("modes", _shown(mode)):
            _check_name(mode, file, solver_names)
            if mode in file.modes:
                raise ModelFileError("is there twice")
        file.modes.append(mode)
    for name, entry in _table(tables, "events").items():
        with placed(f"[events.{name if NAME.fullmatch(name) else _shown(name)}]"):
            _check_name(name, file, solver_names)
            if name in file.modes:
                raise ModelFileError("this name is in modes already")
            file.trees_of_events.append(_event(name, entry, file))
    if len(file.variables) + len(modes) + len(file.trees_of_events) > MOST_VARIABLES:
        raise ModelFileError(f"has more than {MOST_VARIABLES} variables, modes and events")


def _event(name: str, entry: object, file: ModelFile) -> Event:
    if not isinstance(entry, dict) or "when" not in entry:
        raise ModelFileError(f"expected a table with when, got {_shown(entry)}")
    for key in entry:
        if key not in EVENT:
            raise ModelFileError(f"unknown key {_shown(key)}, expected one of {', '.join(EVENT)}")
    when = _tree(entry["when"], "when")
    if when.op not in RELATIONS:
        raise ModelFileError("when: expected one relation such as h < 0")
    during = _tree(entry["while"], "while") if "while" in entry else None
    states = [variable.name for variable in file.of("states")]
    changes = {}
    for key, known in (("reinit", states), ("set", file.modes)):
        for changed in _table(entry, key):
            if changed not in known:
                what = "a state" if key == "reinit" else "one of modes"
                raise ModelFileError(f"{key}: expected {what}, got {_shown(changed)}")
        table = _table(entry, key)
        changes[key] = {n: _tree(text, f"{key}: {n}") for n, text in table.items()}
    return Event(name, when, during, **changes)


def _tree(text: object, key: str) -> Node:
    with placed(key):
        if not isinstance(text, str):
            raise ModelFileError(f"expected an expression in quotes, got {_shown(text)}")
        return parse(text)


def _expressions_of(event: Event) -> list[tuple[str, Node, str, str]]:
    """Key, expression, its kind and the state that it is assigned to."""
    listed = [("when", event.when, CONDITION, "")]
    listed += [("while", event.during, CONDITION, "")] if event.during is not None else []
    listed += [(f"reinit: {name}", tree, NUMBER, name) for name, tree in event.reinit.items()]
    return listed + [(f"set: {name}", tree, CONDITION, "") for name, tree in event.set.items()]


# ---- Expressions -----------------------------------------------------------------------------


def _expressions_of_checks(file: ModelFile, table: object) -> list[tuple[str, str, Node]]:
    """Place, message and condition of each entry of [check]."""
    found = []
    for message, text in _table({"check": table}, "check").items():
        place = f"[check]: {_shown(message)}"
        with placed(place):
            if not isinstance(text, str):
                raise ModelFileError(f"expected a condition in quotes, got {_shown(text)}")
            tree = parse(text)
            check_kinds(tree, CONDITION)
            parameters = {variable.name for variable in file.of("parameters")}
            for name in sorted(names(tree) - parameters):
                raise ModelFileError(f"{_shown(name)} is no parameter")
            found.append((place, _text(message, "message"), tree))
    return found


def _key(variable: Variable) -> str:
    """The key of a variable's expression, in a message."""
    return {"states": "derivative", "outputs": "value"}.get(variable.section, "value")


def _check_expressions(file: ModelFile) -> None:
    """Check names, kinds and units of all expressions."""
    known = {*file.variables, *file.modes, "time"}
    for variable in file.of("states", "where", "outputs"):
        with placed(f"[{variable.section}]", variable.name, _key(variable)):
            for name in sorted(names(variable.tree) - known):
                raise ModelFileError(f"unknown name {_shown(name)}")
            check_kinds(variable.tree, NUMBER, file.modes)
    for event in file.trees_of_events:
        for key, tree, kind, _ in _expressions_of(event):
            with placed(f"[events.{event.name}]", key):
                for name in sorted(names(tree) - known):
                    raise ModelFileError(f"unknown name {_shown(name)}")
                check_kinds(tree, kind, file.modes)
    order = _in_order_of_use(file)
    units = {"time": unit_of_exponents({"s": 1})}
    for variable in file.variables.values():
        with placed(f"[{variable.section}]", variable.name, "unit"):
            units[variable.name] = unit_of_exponents(file.exponents(variable.unit or "1"))
    for variable in order if file.has_units else ():
        with placed(f"[{variable.section}]", variable.name, _key(variable)):
            given = None if variable.section == "where" else units[variable.name]
            units[variable.name] = unit_of(variable.tree, units, given)
    for variable in file.of("states") if file.has_units else ():
        with placed(f"[{variable.section}]", variable.name, _key(variable)):
            rate = tuple(a - b for a, b in zip(units[variable.name], units["time"], strict=True))
            unit_of(variable.tree, units, rate)
    for event in file.trees_of_events if file.has_units else ():
        for key, tree, _, state in _expressions_of(event):
            with placed(f"[events.{event.name}]", key):
                unit_of(tree, units, units[state] if state else None)
    file.found_units = units if file.has_units else dict.fromkeys(units, ONE)


def _in_order_of_use(file: ModelFile) -> list[Variable]:
    """Entries of [where] and [outputs], each after those that it names."""
    entries = {variable.name: variable for variable in file.of("where", "outputs")}
    done: dict[str, Variable] = {}
    for first in entries.values():
        way = {first.name: None}  # a name and what it needs, down to one that needs nothing
        while way:
            name = next(reversed(way))
            needed = sorted(names(entries[name].tree) & entries.keys() - done.keys())
            if not needed or name in done:
                done[name] = entries[name]
                way.popitem()
            elif needed[0] in way:
                loop = " -> ".join([*list(way)[list(way).index(needed[0]) :], needed[0]])
                raise ModelFileError(
                    f"[{entries[name].section}]: {name}: algebraic loop {_shown(loop)}: "
                    "solve these equations for one of them first"
                )
            else:
                way[needed[0]] = None
    return list(done.values())


LEAF_OF_SECTION = {"parameters": "parameter", "inputs": "input", "states": "state"}


def _leaves(file: ModelFile) -> dict[str, Value]:
    """Values of the names that do not follow from others."""
    graph = file.graph
    leaves = {
        variable.name: graph.value(LEAF_OF_SECTION[variable.section], name=variable.name)
        for variable in file.of(*LEAF_OF_SECTION)
    }
    leaves |= {mode: graph.value("mode", name=mode) for mode in file.modes}
    return leaves | {"time": graph.value("time"), "pi": graph.number(math.pi)}


def _make_graph(file: ModelFile) -> None:
    known = _leaves(file)
    # without states nothing is integrated: outputs follow at once
    file.graph.has_switches = bool(file.of("states") or file.trees_of_events)
    for variable in [*_in_order_of_use(file), *file.of("states")]:
        with placed(f"[{variable.section}]", variable.name, _key(variable)):
            variable.value = file.graph.of_tree(variable.tree, known)
            if variable.section != "states":
                known[variable.name] = variable.value
    for event in file.trees_of_events:
        sides = [file.graph.of_tree(side, known) for side in event.when.arguments]
        file.events.append(
            EventValues(
                event.name,
                file.graph.switch(event.when.op, *sides),
                None if event.during is None else file.graph.of_tree(event.during, known),
                {n: file.graph.of_tree(t, known, is_instant=True) for n, t in event.reinit.items()},
                {n: file.graph.of_tree(t, known, is_instant=True) for n, t in event.set.items()},
            )
        )
