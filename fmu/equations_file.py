"""Reads a file with equations and checks it: its tables, and names, kinds and units in them.

Every mistake is a ModelFileError: file, line, section, name, column and what was expected, in one
line.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from declaration.load import shown

from rparm.expressions.expression import (
    CONDITION,
    CONSTANTS,
    FUNCTIONS,
    NO_NAMES,
    NUMBER,
    RELATIONS,
    ExpressionError,
    Node,
    check_kinds,
    finite_number,
    in_order,
    names,
    parse,
)
from rparm.expressions.units import ANGLE, BASE, Unit, exponents, times, unit_of, unit_of_exponents
from rparm.expressions.units import shown as unit_shown

LARGEST = 10**6  # bytes
MOST_VARIABLES = 1000
LONGEST_TEXT = 1000  # characters of a description
LONGEST_MESSAGE = 500  # bytes: src/instance/settings.c has no room for more
NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)
# files that Windows cannot have, with any suffix
DEVICE = re.compile("(?i:con|prn|aux|nul|com[1-9]|lpt[1-9])")
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
TABLES = ("experiment", "units", "events", "check", "reinit", "set", *SECTIONS)
QUOTES = r"[\s\"']"
SECOND = unit_of_exponents({"s": 1})


class ModelFileError(Exception):
    """What is wrong with the file, in one line."""


@dataclass
class Expression:
    """An expression of the file."""

    place: tuple[str, ...]
    text: str
    kind: str = NUMBER
    target: str = ""  # the variable or mode that it is assigned to
    is_rate: bool = False  # of the target
    event: str = ""  # "when" one happens, or "then"
    tree: Node = field(init=False)
    value: Any = field(init=False)  # what a generator makes of it

    def __post_init__(self) -> None:
        with placed(*self.place):
            if not isinstance(self.text, str):
                raise ModelFileError(f"expected an expression in quotes, got {shown(self.text)}")
            try:
                self.tree = parse(self.text)
            except ValueError as error:
                raise ModelFileError(f"{error}{_instead(self.text)}") from None


@dataclass(eq=False)
class Variable:
    """A variable of the file; numbers that it does not give are None."""

    name: str
    section: str
    start: float | None = None
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    unit: str = ""  # as the file has it
    exponents: dict[str, int] = field(default_factory=dict)  # of the base units and rad
    description: str = ""
    expression: Expression | None = None  # derivative of a state, value of others
    leaf: Any = None  # what a generator makes of a parameter, input or state
    arguments: tuple[Variable, ...] = ()  # those of [where] and [outputs] that it names

    @property
    def value(self) -> Any:
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
    path: Path
    text: str
    reserved: set[str]  # names that it must not give
    units: dict[str, dict[str, int]] = field(default_factory=dict)  # exponents, of [units]
    modes: list[str] = field(default_factory=list)
    variables: dict[str, Variable] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)
    checks: dict[str, Expression] = field(default_factory=dict)  # conditions by message
    order: list[Expression] = field(default_factory=list)  # each after those that it names
    graph: Any = None  # what a generator makes of it

    @property
    def has_units(self) -> bool:
        """Whether units are checked."""
        return any(variable.unit for variable in self.variables.values())

    @property
    def assigned(self) -> list[Expression]:
        """All expressions but conditions on parameters."""
        found = [variable.expression for variable in self.of("states", "where", "outputs")]
        return found + [expression for event in self.events for expression in event.expressions]

    def of(self, *sections: str) -> list[Variable]:
        """Return variables of these sections, in the order of the file."""
        return [v for section in sections for v in self.variables.values() if v.section == section]


@contextmanager
def placed(*place: object) -> Iterator[None]:
    """Put the place in front of what is wrong inside."""
    try:
        yield
    except (ModelFileError, ValueError) as error:
        raise ModelFileError(": ".join([*map(str, place), str(error)])) from None


def _instead(text: str) -> str:
    """Propose a replacement of what is not supported, or nothing."""
    found = [sentence for pattern, sentence in INSTEAD.items() if re.search(pattern, text)]
    return f"; {found[0]}" if found else ""


def tables_of(path: Path) -> tuple[str, dict[str, Any]]:
    """Read text and tables of a file."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"cannot be read: {error.strerror}") from None
    if len(content) > LARGEST:
        raise ModelFileError(f"has {len(content)} bytes, expected at most {LARGEST}")
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
        return text, tomllib.loads(text)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ModelFileError(f"line {line}: is not UTF-8: save it in this encoding") from None
    except tomllib.TOMLDecodeError as error:
        raise ModelFileError(f"is not valid TOML: {' '.join(str(error).split()):.200}") from None
    except (ValueError, RecursionError):
        raise ModelFileError("has a number or a table that is too long") from None


def _expect(what: str, kind: type, fits: Callable[[Any], object] = bool) -> Callable[[Any], Any]:
    """Return a function that refuses values unless they are of a kind and fit."""

    def read(value: Any) -> Any:
        if type(value) is not kind or not fits(value):
            raise ValueError(f"expected {what}")
        return value

    return read


def _text(value: object) -> str:
    TEXT(value)
    if CONTROL.search(value):
        raise ModelFileError("has a control character")
    return " ".join(value.split())


TEXT = _expect(
    f"a text of at most {LONGEST_TEXT} characters", str, lambda text: len(text) <= LONGEST_TEXT
)


READ = {
    **dict.fromkeys((*NUMBERS, *EXPERIMENT), finite_number),
    **dict.fromkeys(("unit", "description"), _text),
    **dict.fromkeys(TABLES, _expect("a table", dict, lambda _: True)),
    **dict.fromkeys((*BASE, ANGLE), _expect("a whole exponent", int, lambda e: abs(e) < 100)),
    "name": _expect("a letter, then letters, digits, _", str, NAME.fullmatch),
    "modes": _expect("a list of names", list, lambda m: all(type(name) is str for name in m)),
}  # how values of keys are read; others are expressions


def _entries(
    table: object, known: Collection[str], needed: str = "", what: str = "key"
) -> dict[str, Any]:
    """Check a table with these keys, and return its values as they are used."""
    if not isinstance(table, dict):
        example = needed or next(iter(known))
        raise ModelFileError(f"expected a table such as {{ {example} = ... }}, got {shown(table)}")
    for key in table:
        if key not in known:
            place = f"[{key}]: " if what == "section" else ""
            listed = f"unknown {what} {shown(key)}, expected one of {', '.join(known)}"
            raise ModelFileError(place + listed + _instead(key))
    if needed and needed not in table:
        raise ModelFileError(f"{needed} is missing")
    return {key: _value(key, value, what) for key, value in table.items()}


def _value(key: str, value: object, what: str) -> Any:
    with placed(f"[{key}]" if what == "section" and key in TABLES else key):
        try:
            return READ[key](value) if key in READ else value
        except ValueError as error:
            instead = _instead("[") if isinstance(value, list) else ""
            raise ModelFileError(f"{error}, got {shown(value)}{instead}") from None


def read_tables(
    path: Path, text: str, tables: dict[str, Any], solver_names: Iterable[str]
) -> ModelFile:
    """Read the tables, without the meaning of the expressions."""
    head = _entries(tables, HEAD, "name", "section")
    if DEVICE.fullmatch(head["name"]):
        raise ModelFileError("name: Windows keeps this name for a device, choose another one")
    with placed("[experiment]"):
        experiment = _experiment(_entries(head.get("experiment", {}), EXPERIMENT))
    reserved = RESERVED | set(solver_names)
    file = ModelFile(head["name"], head.get("description", ""), experiment, path, text, reserved)
    for symbol, given in head.get("units", {}).items():
        with placed("[units]", shown(symbol)):
            file.units[symbol] = _entries(given, (*BASE, ANGLE), what="base unit")
    for section in SECTIONS:
        for name, entry in head.get(section, {}).items():
            _read_variable(file, section, name, entry)
    if not file.variables:
        raise ModelFileError("has no variables, expected a section such as [states]")
    for mode in head.get("modes", ()):
        with placed("modes", shown(mode)):
            _check_name(mode, file)
        file.modes.append(mode)
    for name, entry in head.get("events", {}).items():
        _read_event(file, name, entry)
    for message, condition in head.get("check", {}).items():
        place = ("[check]", shown(message))
        with placed(*place):
            message = _text(message)
            if len(message.encode()) > LONGEST_MESSAGE:
                raise ModelFileError(f"expected a message of at most {LONGEST_MESSAGE} bytes")
        file.checks[message] = Expression(place, condition, CONDITION)
    return file


def _experiment(given: dict[str, float]) -> dict[str, float]:
    found = EXPERIMENT | given
    if "step" not in given:
        found["step"] = min(found["step"], found["stop"] / 100)
    if not 0 < found["step"] <= found["stop"]:
        raise ModelFileError("expected 0 < step <= stop")
    if not 0 < found["tolerance"] < 1:
        raise ModelFileError("expected a tolerance between 0 and 1")
    return found


def _read_variable(file: ModelFile, section: str, name: str, entry: object) -> None:
    place = (f"[{section}]", name if NAME.fullmatch(name) else shown(name))
    with placed(*place):
        _check_name(name, file)
        given = {"start": 0.0} if section in ("inputs", "states") else {}
        if section == "where":
            texts = {"": entry}
        else:
            given |= _entries(entry, *SECTIONS[section])
            texts = {key: given.pop(key) for key in ("derivative", "value") if key in given}
        variable = Variable(name, section, **given)
        with placed("unit"):
            unit = variable.unit or "1"
            variable.exponents = file.units[unit] if unit in file.units else exponents(unit)
        _check_range(variable)
    for key, text in texts.items():
        whole = (*place, key) if key else place
        variable.expression = Expression(whole, text, NUMBER, name, key == "derivative")
    file.variables[name] = variable


def _check_name(name: str, file: ModelFile) -> None:
    if not NAME.fullmatch(name):
        raise ModelFileError("expected a name: a letter, then letters, digits, _")
    if name in file.reserved or name.startswith("der_"):
        raise ModelFileError("this name is reserved, choose another one")
    if name in file.variables:
        raise ModelFileError(f"this name is in [{file.variables[name].section}] already")
    if name in file.modes:
        raise ModelFileError("this name is in modes already")
    if len(file.variables) + len(file.modes) + len(file.events) >= MOST_VARIABLES:
        raise ModelFileError(f"has more than {MOST_VARIABLES} variables, modes and events")


def _check_range(variable: Variable) -> None:
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if variable.start is not None and not low <= variable.start <= high:
        raise ModelFileError(f"start = {variable.start:g} is outside [min, max]")
    if variable.nominal is not None and not variable.nominal > 0:
        raise ModelFileError(f"nominal = {variable.nominal:g}: expected a number above 0")


def _read_event(file: ModelFile, name: str, entry: object) -> None:
    place = f"[events.{name if NAME.fullmatch(name) else shown(name)}]"
    with placed(place):
        _check_name(name, file)
        given = _entries(entry, EVENT, "when")

    def changes(key: str, kind: str, known: Collection[str], what: str) -> dict[str, Expression]:
        found = {}
        for target, text in given.get(key, {}).items():
            if target not in known:
                raise ModelFileError(f"{place}: {key}: expected {what}, got {shown(target)}")
            whole = (place, f"{key}: {target}")
            found[target] = Expression(whole, text, kind, target, event="then")
        return found

    when = Expression((place, "when"), given["when"], CONDITION, event="when")
    if when.tree.op not in RELATIONS:
        raise ModelFileError(f"{place}: when: expected one relation such as h < 0")
    during = Expression((place, "while"), given["while"], CONDITION) if "while" in given else None
    reinit = changes("reinit", NUMBER, [state.name for state in file.of("states")], "a state")
    modes = changes("set", CONDITION, file.modes, "one of modes")
    file.events.append(Event(name, when, during, reinit, modes))


def read(path: Path, solver_names: Iterable[str] = ()) -> ModelFile:
    """Read and check a file for a model that has `solver_names`, too; ModelFileError."""
    with placed(path):
        text, tables = tables_of(path)
        try:
            file = read_tables(path, text, tables, solver_names)
            _check_names(file)
            file.order = _in_order(file)
            if file.has_units:
                _check_units(file)
        except ModelFileError as error:
            raise ModelFileError(f"{_line(text, str(error))}{error}") from None
    return file


def _line(text: str, message: str) -> str:
    """Find the line of a message's section and name, as far as that is sure."""
    place = re.match(r"(\[.*?\])(?:: ['\"]?(\w+))?|(\w+): ", message)
    lines = text.split("\n")
    begin, key = 0, place and (place[2] or place[3])
    if place and place[1]:
        head = re.sub(QUOTES, "", place[1][1:-1])
        plain = [re.sub(QUOTES, "", line.partition("#")[0]) for line in lines]
        # the table itself, else one below it, else its line in the table above
        heads = [i for i, line in enumerate(plain, 1) if line in (f"[{head}]", f"[[{head}]]")]
        heads = heads or [i for i, line in enumerate(plain, 1) if line.startswith(f"[{head}.")]
        if not heads:
            above, _, key = head.rpartition(".")
            heads = [i for i, line in enumerate(plain, 1) if line == f"[{above}]"]
            heads = heads if above else [0]
        begin = heads[0] if len(heads) == 1 else len(lines) + 1
    for i, line in enumerate(lines[begin:], begin + 1):
        if line.lstrip().startswith("["):
            break
        if key and re.match(rf"\s*[\"']?{re.escape(key)}(?![\w-]).*=", line):
            return f"line {i}: "
    return f"line {begin}: " if 0 < begin <= len(lines) else ""


def _check_names(file: ModelFile) -> None:
    """Check the names and kinds in all expressions."""
    known = {*file.variables, *file.modes, "time", *CONSTANTS}
    parameters = {variable.name for variable in file.of("parameters")} | {*CONSTANTS}
    for expressions, allowed, mistake in (
        (file.assigned, known, "unknown name {}"),
        (file.checks.values(), parameters, "{} is no parameter"),
    ):
        for expression in expressions:
            with placed(*expression.place):
                for node in in_order([expression.tree]):
                    if node.name and node.name not in allowed:
                        meant = get_close_matches(node.name, allowed, n=1)
                        hint = f", did you mean {meant[0]!r}?" if meant else ""
                        raise ExpressionError(node.column, mistake.format(shown(node.name)) + hint)
                check_kinds(expression.tree, expression.kind, file.modes)


def _in_order(file: ModelFile) -> list[Expression]:
    """Order all expressions: [where] and [outputs] first, each after those that it names."""
    entries = {variable.name: variable for variable in file.of("where", "outputs")}
    for variable in entries.values():
        used = names(variable.expression.tree) & entries.keys()
        variable.arguments = tuple(entries[name] for name in sorted(used))
    try:
        TopologicalSorter({v: v.arguments for v in entries.values()}).prepare()
    except CycleError as error:
        loop = error.args[1][::-1]
        way = shown(" -> ".join(variable.name for variable in loop))
        raise ModelFileError(
            f"[{loop[0].section}]: {loop[0].name}: algebraic loop {way}: "
            "solve these equations for one of them first"
        ) from None
    variables = [*in_order(entries.values()), *file.of("states")]
    happening = [expression for event in file.events for expression in event.expressions]
    return [*(v.expression for v in variables), *happening, *file.checks.values()]


def _check_units(file: ModelFile) -> None:
    """Check that units fit, and find the units of [where]."""
    declared = [v for v in file.variables.values() if v.section != "where"]
    units = {v.name: unit_of_exponents(v.exponents) for v in declared} | {"time": SECOND}
    for expression in file.order:
        with placed(*expression.place):
            expected = units.get(expression.target)
            if expression.is_rate:
                expected = times(expected, SECOND, -1)
            unit = unit_of(expression.tree, units, expected)
        if expression.target:
            units.setdefault(expression.target, unit)
    for variable in file.of("where"):
        with placed("[where]", variable.name):
            variable.exponents = _whole(units[variable.name])


def _whole(unit: Unit) -> dict[str, int]:
    if any(exponent.denominator > 1 for exponent in unit):
        raise ModelFileError(
            f"has unit {unit_shown(unit)}, whose exponents are no whole numbers: use its square"
        )
    return {base: int(exponent) for base, exponent in zip(BASE, unit, strict=True)}
