"""Reads a file with equations and checks it: its tables, and names, kinds and units in them.

Every mistake is a ModelFileError: file, line, section, name, column and what was expected, in one
line.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

import equations_code
import equations_tables
from declaration.load import shown
from equations_content import (
    BOOLEAN,
    FOLLOWS,
    OPTIONS,
    SWITCHES,
    Event,
    Expression,
    ModelFile,
    ModelFileError,
    Sampler,
    Variable,
    instead_of,
    placed,
)

from rparm.expressions.expression import (
    CONDITION,
    CONSTANTS,
    FUNCTIONS,
    FURTHER,
    NO_NAMES,
    NUMBER,
    ExpressionError,
    Function,
    Lookup,
    check_kinds,
    derivative_of,
    evaluated,
    finite_number,
    in_order,
    names,
)
from rparm.expressions.units import (
    ANGLE,
    BASE,
    Unit,
    table_unit,
    times,
    unit_of,
    unit_of_exponents,
)
from rparm.expressions.units import shown as unit_shown

LARGEST = 10**6  # bytes
MOST_VARIABLES = 1000
LONGEST_TEXT = 1000  # characters of a description
LONGEST_MESSAGE = 500  # bytes: src/instance/settings.c has no room for more
NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,99}", re.ASCII)
# files that Windows cannot have, with any suffix
CODE = re.compile(r'[^\x00-\x1f\\"]+\.c')
DEVICE = re.compile("(?i:con|prn|aux|nul|com[1-9]|lpt[1-9])")
CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
LATER = ("sum", "der", "floor", "ceil", "round", "mod")
RESERVED = {*FUNCTIONS, *NO_NAMES, "pi", "time", "GUID", "NAME", "TOKEN_FMI3"}
TAKEN = {*RESERVED, *FURTHER, *LATER}  # no names of functions
NUMBERS = ("start", "min", "max", "nominal")
OF_ALL = ("start", "unit", "min", "max", "description")
SECTIONS = {  # keys of their entries, and the one that each needs
    "parameters": ((*OF_ALL, "type"), "start"),
    "inputs": ((*OF_ALL, "type"), ""),
    "states": ((*OF_ALL, "nominal", "derivative"), "derivative"),
    "discrete": (("start", "unit", "description"), ""),
    "where": ((), ""),  # they are expressions
    "outputs": (("value", "unit", "description"), "value"),
}
OWN_KEYS = {
    FOLLOWS: (("value", "unit", "description"), "value"),
    OPTIONS: (("type", "start", "description"), "start"),
    SWITCHES: (("type", "start", "description"), ""),
}
HEAD = (
    *("name", "description", "experiment", "modes", "code", "units", "tables", "functions"),
    *("sampled", "events", "check"),
    *SECTIONS,
)
EXPERIMENT = {"stop": 10.0, "step": 0.01, "tolerance": 1e-8}
TABLE = ("x", "y", "z", "file", "interpolation", "outside")
EVENT = ("when", "while", "reinit", "set")
SAMPLER = ("every", "offset", "while", "reinit", "set")
TABLES = (
    "experiment",
    "units",
    "tables",
    "functions",
    "sampled",
    "events",
    "check",
    "reinit",
    "set",
    *SECTIONS,
)
QUOTES = r"[\s\"']"
SECOND = unit_of_exponents({"s": 1})


def _named(name: str) -> str:
    """Return a name as messages have it: in quotes if it is none."""
    return name if NAME.fullmatch(name) else shown(name)


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


LIST = _expect("a list of names", list, lambda names: all(type(name) is str for name in names))


def _modes(value: Any) -> list[tuple[str, bool]]:
    """Return the modes with their values at the start."""
    if isinstance(value, dict) and all(type(start) is bool for start in value.values()):
        return [*value.items()]
    try:
        return [(name, False) for name in LIST(value)]
    except ValueError:
        raise ValueError("expected a list of names, or a table of true and false") from None


def _arguments(value: Any) -> dict[str, str]:
    """Return the arguments of a function with their units; of a list, these are empty."""
    if isinstance(value, dict) and all(type(unit) is str and unit for unit in value.values()):
        return value
    if isinstance(value, list) and all(type(name) is str for name in value):
        found = dict.fromkeys(value, "")
        if len(found) == len(value):
            return found
    raise ValueError("expected a list of names, each once, or a table of their units")


READ = {
    **dict.fromkeys((*NUMBERS, *EXPERIMENT), finite_number),
    "start": lambda given: given if type(given) is bool else finite_number(given),
    "type": _expect(f'"{BOOLEAN}"', str, lambda name: name == BOOLEAN),
    **dict.fromkeys(("unit", "description"), _text),
    **dict.fromkeys(TABLES, _expect("a table", dict, lambda _: True)),
    **dict.fromkeys((*BASE, ANGLE), _expect("a whole exponent", int, lambda e: abs(e) < 100)),
    "name": _expect("a letter, then letters, digits, _", str, NAME.fullmatch),
    "modes": _modes,
    "arguments": _arguments,
    "code": _expect("a C file such as crane.c", str, CODE.fullmatch),
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
            raise ModelFileError(place + listed + instead_of(key))
    if needed and needed not in table:
        raise ModelFileError(f"{needed} is missing")
    return {key: _value(key, value, what) for key, value in table.items()}


def _value(key: str, value: object, what: str) -> Any:
    with placed(f"[{key}]" if what == "section" and key in TABLES else key):
        try:
            return READ[key](value) if key in READ else value
        except ValueError as error:
            instead = instead_of("[") if isinstance(value, list) else ""
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
    for name, entry in head.get("tables", {}).items():
        _read_table(file, name, entry)
    if "code" in head:
        with placed("code"):
            file.code = equations_code.read(path.parent / head["code"])
            for name, function in file.code.functions.items():
                if function.is_helper and name in TAKEN:
                    continue
                with placed(f"{function.place}: {name}"):
                    _check_function_name(name, file)
                file.functions[name] = function
    _read_functions(file, head.get("functions", {}))
    for section in SECTIONS:
        for name, entry in head.get(section, {}).items():
            _read_variable(file, section, name, entry)
    if not file.variables:
        raise ModelFileError("has no variables, expected a section such as [states]")
    for mode, start in head.get("modes", []):
        with placed("modes", shown(mode)):
            _check_name(mode, file)
        file.modes[mode] = start
    for name, entry in head.get("sampled", {}).items():
        _read_sampler(file, name, entry)
    for name, entry in head.get("events", {}).items():
        _read_event(file, name, entry)
    for message, condition in head.get("check", {}).items():
        place = ("[check]", shown(message))
        with placed(*place):
            message = _text(message)
            if len(message.encode()) > LONGEST_MESSAGE:
                raise ModelFileError(f"expected a message of at most {LONGEST_MESSAGE} bytes")
        file.checks[message] = file.expression(place, condition, CONDITION)
    return file


def _read_table(file: ModelFile, name: str, entry: object) -> None:
    place = f"[tables.{_named(name)}]"
    with placed(place):
        _check_function_name(name, file)
        units = entry.get("unit", {}) if isinstance(entry, dict) else {}
        bare = {k: v for k, v in entry.items() if k != "unit"} if units else entry
        given = _entries(bare, (*TABLE, "unit"), "x")
        arguments = ("x", "y") if "z" in given else ("x",)
        file.tables[name] = equations_tables.read(name, given, file.path.parent)
        file.functions[name] = Lookup(name, arguments)
        keys = (*arguments, "z" if "z" in given else "y")
        if not isinstance(units, dict) or not all(type(unit) is str for unit in units.values()):
            raise ModelFileError(
                f"unit: expected a table such as {{ x = 'm' }}, got {shown(units)}"
            )
        for key in units:
            if key not in keys:
                raise ModelFileError(f"unit: unknown key {shown(key)}, expected {', '.join(keys)}")
            unit = units[key]
            found = file.exponents_of(unit)
            file.table_units[table_unit(name, "" if key == keys[-1] else keys.index(key))] = found


def _check_function_name(name: str, file: ModelFile) -> None:
    if not NAME.fullmatch(name) or name in (*TAKEN, *file.functions):
        raise ModelFileError("expected a name that is no function already")


def _read_functions(file: ModelFile, entries: dict[str, object]) -> None:
    """Read units of functions of the C file, then functions, which may call those before them."""
    in_c = file.code.functions if file.code else {}
    of_c = {name: entry for name, entry in entries.items() if name in in_c}
    for name, entry in (of_c | entries).items():
        with placed("[functions]", _named(name)):
            needed = "" if name in in_c else "value"
            given = _entries(entry, ("arguments", "value", "unit"), needed)
            arguments, units = given.get("arguments", {}), {}
            order = (*arguments,) if "value" in given else in_c[name].arguments
            if {*order} != {*arguments}:
                raise ModelFileError(f"arguments: expected all of the C file: {', '.join(order)}")
            if "unit" in given or any(arguments.values()):
                if "" in arguments.values():
                    raise ModelFileError("unit: expected units of arguments, too: { x = 'm' }")
                units = {table_unit(name, order.index(a)): u for a, u in arguments.items()}
                units |= {table_unit(name): given.get("unit", "1")}
                file.table_units |= {key: file.exponents_of(unit) for key, unit in units.items()}
            if "value" in given:
                own = _function(file, name, arguments, given["value"], bool(units))
                file.functions[name] = own


def _function(
    file: ModelFile, name: str, arguments: dict[str, str], text: object, has_units: bool
) -> Function:
    """Return a function, whose arguments and value have units in the file, or take any."""
    _check_function_name(name, file)
    if not arguments or not all(NAME.fullmatch(a) and a not in RESERVED for a in arguments):
        raise ModelFileError("arguments: expected names, each once and none reserved")
    value = file.expression(("value",), text)
    for node in in_order([value.tree]):
        if node.op == "name" and node.name not in (*arguments, *CONSTANTS):
            raise ExpressionError(node.column, f"{shown(node.name)} is no argument")
    check_kinds(value.tree)
    if has_units:
        units = {key: unit_of_exponents(found) for key, found in file.table_units.items()}
        units |= {a: units[table_unit(name, i)] for i, a in enumerate(arguments)}
        with placed("value"):
            unit_of(value.tree, units, units[table_unit(name)])
    return Function((*arguments,), value.tree, name=name if has_units else "")


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
    place = (f"[{section}]", _named(name))
    with placed(*place):
        _check_name(name, file)
        given = {"start": 0.0} if section in ("inputs", "states", "discrete") else {}
        if section == "where":
            texts = {"": entry}
        else:
            section, entry, texts = _texts_of(section, entry)
            given = {} if "start" in texts else given
            given |= _entries(entry, *(OWN_KEYS | SECTIONS)[section])
            if given.pop("type", None) is None and type(given.get("start")) is bool:
                raise ModelFileError(f"start: expected a number, got {shown(given['start'])}")
            texts |= {key: given.pop(key) for key in ("derivative", "value") if key in given}
        variable = Variable(name, section, **given)
        with placed("unit"):
            unit = variable.unit or "1"
            variable.exponents = file.exponents_of(unit)
        _check_range(variable)
    for key, text in texts.items():
        whole = (*place, key) if key else place
        expression = file.expression(whole, text, NUMBER, name, key == "derivative")
        if key == "start":
            variable.initial = expression
        else:
            variable.expression = expression
    file.variables[name] = variable


def _texts_of(section: str, entry: object) -> tuple[str, object, dict[str, object]]:
    """Take a start value that is an expression from an entry; return its section and the rest."""
    if not isinstance(entry, dict):
        return section, entry, {}
    if section == "parameters" and "value" in entry:
        return FOLLOWS, entry, {}
    if entry.get("type") == BOOLEAN and section in ("parameters", "inputs"):
        if type(entry.get("start", False)) is not bool:
            raise ModelFileError(f"start: expected true or false, got {shown(entry['start'])}")
        return (
            (OPTIONS, entry, {})
            if section == "parameters"
            else (SWITCHES, {"start": False} | entry, {})
        )
    if section in ("states", "discrete") and isinstance(entry.get("start"), str):
        return section, {k: v for k, v in entry.items() if k != "start"}, {"start": entry["start"]}
    return section, entry, {}


def _check_name(name: str, file: ModelFile) -> None:
    if not NAME.fullmatch(name):
        raise ModelFileError("expected a name: a letter, then letters, digits, _")
    if name in file.reserved or name.startswith("der_"):
        raise ModelFileError("this name is reserved, choose another one")
    if name in file.variables:
        raise ModelFileError(f"this name is in {file.variables[name].place} already")
    if name in file.modes:
        raise ModelFileError("this name is in modes already")
    if name in file.functions:
        raise ModelFileError("this name is a function or table already")
    if len(file.variables) + len(file.modes) + len(file.changes) >= MOST_VARIABLES:
        raise ModelFileError(
            f"has more than {MOST_VARIABLES} variables, modes, samplers and events"
        )


def _check_range(variable: Variable) -> None:
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if variable.start is not None and not low <= variable.start <= high:
        raise ModelFileError(f"start = {variable.start:g} is outside [min, max]")
    if variable.nominal is not None and not variable.nominal > 0:
        raise ModelFileError(f"nominal = {variable.nominal:g}: expected a number above 0")


def _read_event(file: ModelFile, name: str, entry: object) -> None:
    place, given = _change(file, "events", name, entry, EVENT)
    when = file.expression((place, "when"), given["when"], CONDITION, event="when")
    file.events.append(Event(name, *_given(file, place, given, ""), when))


def _read_sampler(file: ModelFile, name: str, entry: object) -> None:
    place, given = _change(file, "sampled", name, entry, SAMPLER)
    every, offset = (
        file.expression((place, key), given.get(key, "0"), NUMBER, "time")
        for key in ("every", "offset")
    )
    if not (given.get("set") or given.get("reinit")):
        raise ModelFileError(f"{place}: expected set or reinit: what it does")
    file.sampled.append(Sampler(name, *_given(file, place, given, "then"), every, offset))


def _change(
    file: ModelFile, section: str, name: str, entry: object, keys: tuple[str, ...]
) -> tuple[str, dict[str, Any]]:
    """Return the place of an event or sampler, and its entries; it needs the first of its keys."""
    place = f"[{section}.{_named(name)}]"
    with placed(place):
        _check_name(name, file)
        return place, _entries(entry, keys, keys[0])


def _given(
    file: ModelFile, place: str, given: dict[str, Any], event: str
) -> tuple[Expression | None, dict[str, Expression], dict[str, Expression]]:
    """Return `while`, `reinit` and `set`; event: of the expression of `while`."""
    states, discrete = ({v.name for v in file.of(section)} for section in ("states", "discrete"))
    kinds = {
        "reinit": (dict.fromkeys(states, NUMBER), "a state"),
        "set": (
            dict.fromkeys(discrete, NUMBER) | dict.fromkeys(file.modes, CONDITION),
            "one of modes or of [discrete]",
        ),
    }
    found: dict[str, dict[str, Expression]] = {"reinit": {}, "set": {}}
    for key, (known, what) in kinds.items():
        for target, text in given.get(key, {}).items():
            if target not in known:
                raise ModelFileError(f"{place}: {key}: expected {what}, got {shown(target)}")
            whole = (place, f"{key}: {target}")
            found[key][target] = file.expression(whole, text, known[target], target, event="then")
    during = None
    if "while" in given:
        during = file.expression((place, "while"), given["while"], CONDITION, event=event)
    return during, found["reinit"], found["set"]


def read(path: Path, solver_names: Iterable[str] = ()) -> ModelFile:
    """Read and check a file for a model that has `solver_names`, too; ModelFileError."""
    with placed(path):
        text, tables = tables_of(path)
    with located(path, text):
        file = read_tables(path, text, tables, solver_names)
        _check_names(file)
        file.order = _in_order(file)
        _check_periods(file)
        if file.has_units:
            _check_units(file)
    return file


@contextmanager
def located(path: Path, text: str) -> Iterator[None]:
    """Put the path and the line in front of what is wrong inside."""
    try:
        yield
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {_line(text, str(error))}{error}") from None


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
    rates = [derivative_of(state.name) for state in file.of("states")]
    known = {*file.variables, *file.modes, "time", *CONSTANTS, *rates}
    parameters = {v.name for v in file.of("parameters", FOLLOWS, OPTIONS)} | {*CONSTANTS}
    for expressions, allowed, mistake in (
        (file.assigned, known, "unknown name {}"),
        (file.constant, parameters, "{} is no parameter"),
    ):
        for expression in expressions:
            with placed(*expression.place):
                for node in in_order([expression.tree]):
                    if node.op == "name" and node.name not in allowed:
                        meant = get_close_matches(node.name, allowed, n=1)
                        hint = f", did you mean {meant[0]!r}?" if meant else ""
                        raise ExpressionError(node.column, mistake.format(shown(node.name)) + hint)
                check_kinds(expression.tree, expression.kind, file.conditions)


def _in_order(file: ModelFile) -> list[Expression]:
    """Order all expressions: [where] and [outputs] first, each after those that it names."""
    entries = {variable.name: variable for variable in file.calculated}
    entries |= {derivative_of(state.name): state for state in file.of("states")}
    for variable in entries.values():
        used = names(variable.expression.tree) & entries.keys()
        variable.arguments = tuple(entries[name] for name in sorted(used))
    try:
        TopologicalSorter({v: v.arguments for v in entries.values()}).prepare()
    except CycleError as error:
        loop = error.args[1][::-1]
        way = shown(" -> ".join(variable.name for variable in loop))
        raise ModelFileError(
            f"{loop[0].place}: {loop[0].name}: algebraic loop {way}: "
            "solve these equations for one of them first"
        ) from None
    variables = in_order(entries.values())
    happening = [expression for change in file.changes for expression in change.expressions]
    constant = [e for e in file.constant if e.target not in entries]
    return [*(v.expression for v in variables), *happening, *constant]


def _check_periods(file: ModelFile) -> None:
    """Check that samplers tick, and starts exist, with the start values of the parameters."""
    starts = {variable.name: variable.start for variable in file.of("parameters", OPTIONS)}
    follows = {variable.expression for variable in file.of(FOLLOWS)}
    for expression in file.order:
        if expression in follows and (number := _known_number(expression, starts)) is not None:
            starts[expression.target] = number
    for variable in file.started:
        with placed(*variable.initial.place):
            if not math.isfinite(_number(variable.initial, starts)):
                raise ModelFileError("is not a finite number at the start values")
    for sampler in file.sampled:
        every, offset = (_number(expression, starts) for expression in sampler.periods)
        with placed(*sampler.every.place):
            if not 0 < every < math.inf:
                raise ModelFileError(f"is {every:g} s at the start values, expected more than 0")
        with placed(*sampler.offset.place):
            if not 0 <= offset < math.inf:
                raise ModelFileError(f"is {offset:g} s at the start values, expected 0 or more")


def _number(expression: Expression, values: Mapping[str, float]) -> float:
    """Evaluate an expression; nan if it has no value, 1 if that is known at run time only."""
    number = _known_number(expression, values)
    return 1.0 if number is None else number


def _known_number(expression: Expression, values: Mapping[str, float]) -> float | None:
    try:
        return evaluated(expression.tree, values)
    except (ArithmeticError, ValueError):
        return math.nan
    except KeyError:  # tables and functions of C: the start of a simulation checks their values
        return None


def _check_units(file: ModelFile) -> None:
    """Check that units fit, and find the units of [where]."""
    declared = [v for v in file.variables.values() if v.section != "where"]
    units = {v.name: unit_of_exponents(v.exponents) for v in declared} | {"time": SECOND}
    units |= {key: unit_of_exponents(found) for key, found in file.table_units.items()}
    for state in file.of("states"):
        units[derivative_of(state.name)] = times(units[state.name], SECOND, -1)
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
