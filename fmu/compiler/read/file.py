"""Reads a file with equations and checks it: names, kinds and units in its tables.

Every mistake is a ModelFileError: file, line, section, name, column and what was expected, in one
line.
"""

import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..expressions.expression import ExpressionError, Node, in_order, with_names
from ..expressions.kinds import CONDITION, NUMBER, WHOLE
from ..expressions.parser import table_unit
from ..units import ANGLE, BASE, Unit
from . import contacts, functions, gradients, header, keys, terminals
from .arrays import FOR, elements, every, target
from .code import read as read_code
from .components import Components, check_loop, of_loop
from .content import (
    BOOLEAN,
    CALCULATED,
    COUNTS,
    DISCRETE,
    FIXED,
    FOLLOWS,
    SWITCHES,
    Element,
    Event,
    Expression,
    Hook,
    ModelFile,
    ModelFileError,
    Sampler,
    Variable,
    placed,
    shown,
)
from .include import Source, source_of, tables_of
from .meaning import check

INSTANCE = Path(__file__).resolve().parents[3] / "src" / "instance"
MOST_VARIABLES = 20_000


def solver_names() -> set[str]:
    """Return the names of the variables that models get without declaring them."""
    tables = [tables_of(path)[1] for path in INSTANCE.glob("*_variables.toml")]
    return {name for sections in tables for section in sections.values() for name in section}


def read_tables(
    source: Source,
    reserved: Iterable[str],
    is_by_hand: bool = False,
    above: tuple[Path, ...] = (),
) -> ModelFile:
    """Read the tables, without the meaning of the expressions; above: files that have this one."""
    path, text = source.path, source.text
    known = keys.BY_HAND if is_by_hand else keys.HEAD
    head = keys.entries(source.tables, known, "name", "section")
    if keys.DEVICE.fullmatch(head["name"]):
        raise ModelFileError("name: Windows keeps this name for a device, choose another one")
    with placed("[experiment]"):
        experiment = _experiment(keys.entries(head.get("experiment", {}), keys.EXPERIMENT))
    reserved = keys.RESERVED | set(reserved)
    file = ModelFile(head["name"], head.get("description", ""), experiment, path, text, reserved)
    file.is_by_hand, file.calculating = is_by_hand, head.get("calculate", "")
    file.indicators = head.get("indicators", [])
    file.time_events = head.get("time_events", False)
    for size, number in head.get("sizes", {}).items():
        with placed("[sizes]", keys.named(size)):
            _check_name(size, file)
            if type(number) is not int or not 0 <= number <= keys.MOST_SIZE:
                raise ModelFileError(
                    f"expected a whole number from 0 to {keys.MOST_SIZE}, got {shown(number)}"
                )
        file.sizes[size] = number
    for symbol, given in head.get("units", {}).items():
        with placed("[units]", shown(symbol)):
            known = keys.entries(given, (*BASE, ANGLE), what="base unit")
            file.units[symbol] = Unit(known, base=symbol)
    for name, entry in head.get("tables", {}).items():
        functions.read_table(file, name, entry)
    if "code" in head:
        with placed("code"):
            file.code = read_code([path.parent / name for name in head["code"]], header.made)
            file.header = header.Header(source)
            for name, function in file.code.functions.items():
                if function.is_helper and name in keys.TAKEN:
                    continue
                with placed(f"{function.place}: {name}"):
                    functions.check_name(name, file)
                file.functions[name] = function
    functions.read(file, head.get("functions", {}))
    if "hook" in head:
        _read_hook(file, head)
    parts = Components(file, read, (*above, path.resolve()))
    parts.take(head.get("components", {}))
    modes = head.get("modes", [])
    entries = [*keys.SECTIONS, "sampled", "events", *contacts.SECTIONS]
    if sum(len(head.get(section, {})) for section in entries) + len(modes) > keys.MOST_ENTRIES:
        raise ModelFileError(
            f"has more than {keys.MOST_ENTRIES} variables, modes, samplers and events"
        )
    for section in keys.SECTIONS:
        for element in _elements(file, f"[{section}]", head.get(section, {}).items()):
            _read_variable(file, section, element)
    if not file.variables:
        raise ModelFileError("has no variables, expected a section such as [states]")
    for element in _elements(file, "modes", modes):
        with placed("modes", keys.named(element.shown)):
            _check_name(element.name, file)
            start = element.entry
            if isinstance(start, dict):
                start = keys.entries(start, ("start",)).get("start", False)
            if type(start) is not bool:
                raise ModelFileError(f"expected true or false, got {shown(start)}")
        file.modes[element.name] = start
    for element in _elements(file, "[sampled]", head.get("sampled", {}).items()):
        _read_sampler(file, element)
    for element in _elements(file, "[events]", head.get("events", {}).items()):
        _read_event(file, element)
    for section in contacts.SECTIONS:
        for element in _elements(file, f"[{section}]", head.get(section, {}).items()):
            contacts.read(file, section, element, _check_name)
    for message, condition in head.get("check", {}).items():
        _read_check(file, message, condition)
    parts.connect(head.get("connections", {}))
    parts.check_names()
    file.terminals |= terminals.read(file, head.get("terminals", {}))
    _check_places(file)
    return file


def _read_hook(file: ModelFile, head: dict[str, Any]) -> None:
    with placed("[hook]"):
        given = keys.entries(head["hook"], keys.HOOK, "sources")
        for key in ("modes", "sampled", "events"):
            if head.get(key):
                raise ModelFileError(f"decides all events, but there is {key}")
        if not file.calculate:
            raise ModelFileError(f"expected code with a function {file.path.stem}_calculate")
        for mode, names in given.get("reads", {}).items():
            with placed("reads", shown(mode)):
                keys.LIST(names)
        lists = (given.get(key, []) for key in ("indicators", "series"))
        file.hook = Hook(
            given["sources"], *lists, given.get("reads", {}), given.get("reach", False)
        )
        for key in ("sources", "indicators", "series"):
            if len({*(listed := given.get(key, []))}) < len(listed):
                raise ModelFileError(f"{key}: expected different names, got {shown(listed)}")
        if missing := {*file.hook.series} - {*file.hook.indicators}:
            raise ModelFileError(f"series: {min(missing)} is none of indicators")
        for name in file.hook.sources:
            if not keys.CODE.fullmatch(name) or not (file.path.parent / name).is_file():
                raise ModelFileError(f"sources: expected a C file, got {shown(name)}")


def _check_places(file: ModelFile) -> None:
    """Check that no two variables have the same place in the struct of values."""
    where: dict[str, str] = {}
    arrays: dict[str, tuple[Variable, int]] = {}  # by their names: a variable, count of indexes
    for variable in file.variables.values():
        with placed(variable.place, variable.name):
            if variable.field and not file.code:
                raise ModelFileError("field: expected code above the sections, whose struct has it")
            place = variable.field or variable.name
            other = where.setdefault(place, variable.name)
            if other != variable.name:
                raise ModelFileError(f"field: {shown(place)} is the place of {other}")
            array, count = place.partition("[")[0], place.count("[")
            first, first_count = arrays.setdefault(array, (variable, count))
            if (first.is_real, first_count) != (variable.is_real, count):
                raise ModelFileError(f"field: {shown(place)} is not of the type of {first.name}")
    if file.hook is None:
        return
    reals = {v.name for v in file.of(*CALCULATED) if v.is_real}
    read = [name for names in file.hook.reads.values() for name in names]
    for key, names, known in (
        ("indicators", file.hook.indicators, reals),
        ("reads", [*file.hook.reads, *read], {*file.variables}),
    ):
        for name in names:
            if name not in known:
                what = "a real entry of [where] or [outputs]" if known is reals else "a variable"
                raise ModelFileError(f"[hook]: {key}: expected {what}, got {shown(name)}")


def _elements(
    file: ModelFile, place: str, entries: Iterable[tuple[str, object]]
) -> Iterator[Element]:
    """Yield the entries of a section, each as often as its `for` says."""
    for key, entry in entries:
        with placed(place):
            of = {"modes": list, "experiment": dict}.get(key)
            if type(entry) is of and (of is list or entry.keys() & keys.EXPERIMENT):
                raise ModelFileError(f"{key} belongs above the first [section]")
            found = [*elements(file, key, entry)]
        yield from found


def _read_check(file: ModelFile, message: str, entry: object) -> None:
    """Read a condition, which has to hold for all values of its indexes."""
    place = ("[check]", shown(message))
    with placed(*place):
        text = keys.message(message)
        given = keys.entries(entry, ("value", FOR), "value") if isinstance(entry, dict) else {}
        found = every(file, given.get(FOR))
    for indexes in found:
        element = Element(text, text, given.get("value", entry), indexes)
        condition = file.expression(element, place, element.entry, CONDITION)
        file.checks.append((text, condition))


def _experiment(given: dict[str, float]) -> dict[str, float]:
    found = keys.EXPERIMENT | given
    if "step" not in given:
        found["step"] = min(found["step"], found["stop"] / 100)
    if not 0 < found["step"] <= found["stop"]:
        raise ModelFileError("expected 0 < step <= stop")
    if not 0 < found["tolerance"] < 1:
        raise ModelFileError("expected a tolerance between 0 and 1")
    return found


def _read_variable(file: ModelFile, section: str, element: Element) -> None:
    place = (f"[{section}]", keys.named(element.shown))
    with placed(*place):
        _check_name(element.name, file)
        entry = element.entry
        if section == "where" and not isinstance(entry, dict):
            entry = {"value": entry}
        given = keys.entries(entry, *_keys(section, entry, file))
        section = _section(section, given)
        kinds = ("derivative", "value", "equation")
        texts = {key: given.pop(key) for key in kinds if key in given}
        _set_start(section, given, texts)
        variable = Variable(element.name, section, **given)
        wanted = DISCRETE if section in keys.CALCULATED else FIXED
        if variable.variability not in ("", wanted, FIXED if file.is_by_hand else wanted):
            said = shown(variable.variability)
            raise ModelFileError(f'variability: expected "{wanted}", got {said}')
        _set_unit(variable, file)
        _check_range(variable)
        if file.is_by_hand and texts:
            raise ModelFileError(f"start: expected a number, got {shown(texts['start'])}")
        if section in CALCULATED and variable.start is not None:
            number = Node("number", 1, value=variable.start)
            options = (NUMBER, element.name)
            variable.guess = Expression((*place, "start"), f"{variable.start:g}", number, *options)
            variable.start = None
    for key, text in texts.items():
        whole = (*place, key) if isinstance(element.entry, dict) else place
        options = (variable.kind, element.name, key == "derivative")
        options = (NUMBER, "") if key == "equation" else options
        expression = file.expression(element, whole, text, *options)
        if key == "start" and section in CALCULATED:
            variable.guess = expression
        elif key == "start":
            variable.initial = expression
            expression.event = "then"  # inputs jump at the start
        else:
            variable.expression = expression
    if section in header.CALCULATED and not texts and not file.is_by_hand:
        function = f"{file.calculate}: {element.name}"
        tree = Node("call", 1, name=function)
        variable.expression = Expression(place, function, tree, variable.kind, element.name)
        file.table_units[table_unit(function)] = variable.exponents
    file.variables[element.name] = variable


def _keys(section: str, entry: object, file: ModelFile) -> tuple[tuple[str, ...], str]:
    """Return the keys that an entry may have, and the one that it needs."""
    if section in header.CALCULATED and file.calculate:  # C may write it
        is_typed = isinstance(entry, dict) and "type" in entry
        return (keys.OWN_KEYS if is_typed else keys.SECTIONS)[section][0], ""
    known, needed = keys.SECTIONS[section]
    if section == "parameters" and isinstance(entry, dict) and "value" in entry:
        known, needed = keys.FOLLOWING_COUNTS if "type" in entry else keys.OWN_KEYS[FOLLOWS]
    elif section in keys.NOT_REAL and isinstance(entry, dict) and "type" in entry:
        known, needed = keys.OWN_KEYS[keys.NOT_REAL[section]]
    if file.is_by_hand:
        own = ("follows",) if section in header.CALCULATED else ()
        known = (*(key for key in known if key not in keys.OF_EQUATIONS), *own)
        needed = "follows" if section == "outputs" else needed if needed in known else ""
    return known, needed


def _section(section: str, given: dict[str, Any]) -> str:
    """Return the section of a variable by its type, which becomes its kind."""
    kind = given.pop("type", NUMBER)
    follows = section == "parameters" and "value" in given
    if kind == NUMBER:
        return FOLLOWS if follows else section
    if section == "inputs" and kind != CONDITION:
        raise ModelFileError(f'type: expected "{BOOLEAN}": other inputs are real numbers')
    if kind != WHOLE and {"min", "max"} & given.keys():
        raise ModelFileError("min and max are for numbers")
    given["kind"] = kind
    return FOLLOWS if follows else keys.NOT_REAL[section]


def _set_start(section: str, given: dict[str, Any], texts: dict[str, Any]) -> None:
    """Read a start value by its kind; one that follows from parameters goes into the texts."""
    kind, start = given.get("kind", NUMBER), given.get("start")
    if isinstance(kind, tuple) and (start is None or start in kind):
        if section not in (*keys.CALCULATED, FOLLOWS):
            given["start"] = kind.index(start or kind[0]) + 1
        return
    wanted = "true or false" if kind == CONDITION else kind
    if isinstance(kind, tuple):
        wanted = f"one of {', '.join(map(shown, kind))}"
    if isinstance(start, str):
        if section not in ("states", "discrete", COUNTS, *CALCULATED):
            raise ModelFileError(f"start: expected {wanted}, got {shown(start)}")
        texts["start"] = given.pop("start")
    elif start is None and section in ("inputs", "states", "discrete", SWITCHES, COUNTS):
        given["start"] = False if kind == CONDITION else 0.0
    if "start" in given:
        fits = type(given["start"]) is (bool if kind == CONDITION else float)
        if not fits or isinstance(kind, tuple):
            wanted = NUMBER if kind == WHOLE else wanted
            raise ModelFileError(f"start: expected {wanted}, got {_literal(given['start'])}")
    for key in ("start", "min", "max"):
        if kind == WHOLE and key in given:
            if not given[key].is_integer() or abs(given[key]) > keys.LARGEST_INTEGER:
                wanted = f"a whole number within +-{keys.LARGEST_INTEGER}"
                raise ModelFileError(f"{key}: expected {wanted}, got {given[key]:g}")
            given[key] = int(given[key])


def _literal(value: object) -> str:
    return f"{value}".lower() if isinstance(value, bool) else shown(value)


def _set_unit(variable: Variable, file: ModelFile) -> None:
    """Find the unit of a variable, and write its numbers in SI."""
    if not variable.is_real:
        return
    with placed("unit"):
        unit = file.unit(variable.unit or "1")
    variable.exponents = unit.exponents
    if not unit.is_display:
        return
    # number = factor value + offset, as FMI has it
    variable.display = (variable.unit, float(1 / unit.factor), float(-unit.offset / unit.factor))
    variable.unit = unit.base
    for key in keys.NUMBERS:
        if (number := getattr(variable, key)) is not None:
            setattr(variable, key, unit.value(number, key == "nominal"))


def _check_name(name: str, file: ModelFile) -> None:
    base, *_ = name.partition("[")
    if not keys.NAME.fullmatch(base):
        raise ModelFileError("expected a name: a letter, then letters, digits, _")
    if base in file.reserved or name.startswith("der_"):
        why = keys.reason(base, name.startswith("der_"))
        raise ModelFileError(f"this name is reserved ({why}), choose another one")
    _check_dimensions(name, base, file)
    if name in file.variables:
        raise ModelFileError(f"this name is in {file.variables[name].place} already")
    if name in file.modes:
        raise ModelFileError("this name is in modes already")
    if base in file.sizes:
        raise ModelFileError("this name is in [sizes] already")
    if base in file.functions:
        raise ModelFileError("this name is a function or table already")
    if name in file.happening:
        raise ModelFileError(f"this name is in [{file.happening[name]}] already")
    if len(file.variables) + len(file.modes) + len(file.events) >= MOST_VARIABLES:
        raise ModelFileError(f"has more than {MOST_VARIABLES} variables, modes and events")


def _check_dimensions(name: str, base: str, file: ModelFile) -> None:
    """Check that a name has as many indexes everywhere."""
    count = name.count(",") + 1 if "[" in name else 0
    if file.dimensions.setdefault(base, count) != count:
        counts = f"{file.dimensions[base]} indexes elsewhere, {count} here"
        raise ModelFileError(f"{base} has {counts}: choose another name")


def _check_range(variable: Variable) -> None:
    low = -math.inf if variable.min is None else variable.min
    high = math.inf if variable.max is None else variable.max
    if low > high:
        raise ModelFileError(f"min = {low:g} is above max = {high:g}")
    if variable.start is not None and not low <= variable.start <= high:
        raise ModelFileError(f"start = {variable.start:g} is outside [min, max]")
    if variable.nominal is not None and not variable.nominal > 0:
        raise ModelFileError(f"nominal = {variable.nominal:g}: expected a number above 0")


def _read_event(file: ModelFile, element: Element) -> None:
    place, given = _change(file, "events", element, keys.EVENT)
    when = file.expression(element, (place, "when"), given["when"], CONDITION, event="when")
    changes = _given(file, element, place, given, "")
    file.events.append(Event(element.name, *changes, when, given.get("terminate", "")))


def _read_sampler(file: ModelFile, element: Element) -> None:
    place, given = _change(file, "sampled", element, keys.SAMPLER)
    every, offset = (
        file.expression(element, (place, key), given.get(key, "0"), NUMBER, "time")
        for key in ("every", "offset")
    )
    changes = _given(file, element, place, given, "then")
    file.sampled.append(Sampler(element.name, *changes, every, offset))


def _change(
    file: ModelFile, section: str, element: Element, known: tuple[str, ...]
) -> tuple[str, dict[str, Any]]:
    """Return the place of an event or sampler, and its entries; it needs the first of its keys."""
    place = f"[{section}.{keys.named(element.shown)}]"
    with placed(place):
        _check_name(element.name, file)
        file.happening[element.name] = section
        given = keys.entries(element.entry, known, known[0])
        effects = [key for key in keys.EFFECTS if key in known]
        if not any(map(given.get, effects)):
            raise ModelFileError(f"expected {' or '.join(effects)}: what it does")
        return place, given


def _given(
    file: ModelFile, element: Element, place: str, given: dict[str, Any], event: str
) -> tuple[Expression | None, dict[str, Expression], dict[str, Expression], list[Expression]]:
    """Return `while`, `reinit`, `set` and `where`; event: of the expression of `while`."""
    kinds = {
        "reinit": (("states",), "a state"),
        "set": (("discrete", COUNTS), "one of modes or of [discrete]"),
    }
    found: dict[str, dict[str, Expression]] = {"reinit": {}, "set": {}}
    where, local = _local(file, element, place, given.get("where", {}))
    for key, (sections, what) in kinds.items():
        for written, text, own in _each(file, element, place, key, given.get(key, {})):
            whole = (place, f"{key}: {written}")
            with placed(*whole):
                name = target(written, own, file.sizes)
                if name in found[key]:
                    raise ModelFileError(f"{name} has a new value already")
            variable = file.variables.get(name)
            is_mode = key == "set" and name in file.modes
            if not is_mode and (variable is None or variable.section not in sections):
                hint = _hint(variable, name in file.modes)
                raise ModelFileError(f"{place}: {key}: expected {what}, got {shown(name)}{hint}")
            kind = CONDITION if is_mode else variable.kind
            new = file.expression(own, whole, text, kind, name, event="then")
            new.tree = with_names(new.tree, local)
            found[key][name] = new
    during = None
    if "while" in given:
        whole = (place, "while")
        during = file.expression(element, whole, given["while"], CONDITION, event=event)
    return during, found["reinit"], found["set"], where


def _each(
    file: ModelFile, element: Element, place: str, key: str, entries: dict[str, object]
) -> Iterator[tuple[str, object, Element]]:
    """Yield key, expression and indexes of each new value: an entry may be a table with `for`."""
    for written, entry in entries.items():
        if not isinstance(entry, dict):
            yield written, entry, element
            continue
        with placed(place, f"{key}: {written}"):
            given = keys.entries(entry, ("value", FOR), "value")
            over = every(file, given.get(FOR), element.indexes)
        for at in over:
            yield written, given["value"], replace(element, indexes=element.indexes | at)


def _local(
    file: ModelFile, element: Element, place: str, entries: dict[str, object]
) -> tuple[list[Expression], dict[str, Node]]:
    """Return the expressions of `where` of an event or sampler, and what their names stand for."""
    found: list[Expression] = []
    known: dict[str, Node] = {}
    for name, text in entries.items():
        whole = (place, f"where: {keys.named(name)}")
        with placed(*whole):
            _check_name(name, file)
            if name in (*file.indexes, *element.indexes):
                raise ModelFileError("this name is an index of for, too")
        own = file.expression(element, whole, text, None, event="then")
        for node in in_order([own.tree]):
            if node.op == "name" and node.name in entries and node.name not in known:
                below = "is this entry itself" if node.name == name else "stands below"
                wanted = f"{shown(node.name)} {below}: expected a name that stands above"
                with placed(*whole):
                    raise ExpressionError(node.column, wanted)
        own.tree = with_names(own.tree, known)
        known[name] = own.tree
        found.append(own)
    return found, known


def _hint(variable: Variable | None, is_mode: bool) -> str:
    """Say where or how what stands in the wrong one of `set` and `reinit` gets a new value."""
    if is_mode or (variable is not None and variable.section in ("discrete", COUNTS)):
        return ": write it in set"
    if variable is None:
        return ""
    if variable.section == "states":
        return ", a state: write it in reinit"
    return f", of {variable.place}: what keeps its value until an event is one of [discrete]"


def read(path: Path, above: tuple[Path, ...] = (), by: list[str] | None = None) -> ModelFile:
    """Read and check a file; ModelFileError.

    above: files that have it as a component. by: as of model_file.read.
    """
    with placed(path):
        source = source_of(path)
    with located(path, source.text):
        equations = replace(source, tables=of_loop(source.tables))
        file = read_tables(equations, solver_names(), above=above)
        check_loop(source.tables, file)
        file.sources = [each.path for each in source.all()]
        for part in file.parts.values():
            file.sources += [path for path in part.sources if path not in file.sources]
        check(file)
        if (by or "gradients" in source.tables) and not above:
            gradients.read(file, source.tables.get("gradients", {}), by)
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
    place = re.match(r"(\[(?:[^][]|\[[^]]*\])*\])(?:: ['\"]?(\w+))?|(\w+): ", message)
    lines = text.split("\n")
    begin, key = 0, place and (place[2] or place[3])
    if place and place[1]:
        head = re.sub(r"[\s\"']", "", place[1][1:-1])
        plain = [re.sub(r"[\s\"']", "", line.partition("#")[0]) for line in lines]
        # the table itself, else one below it, else its line in the table above or at the top
        heads = [i for i, line in enumerate(plain, 1) if line in (f"[{head}]", f"[[{head}]]")]
        heads = heads or [i for i, line in enumerate(plain, 1) if line.startswith(f"[{head}.")]
        if not heads:
            above, _, key = head.rpartition(".")
            starts = (f"[{above}]", f"{head}=")
            heads = [i for i, line in enumerate(plain, 1) if line.startswith(starts)]
            heads = heads if above else [0]
        begin = heads[0] if len(heads) == 1 else len(lines) + 1
    for i, line in enumerate(lines[begin:], begin + 1):
        if line.lstrip().startswith("["):
            break
        if key and re.match(rf"\s*[\"']?{re.escape(key)}(?![\w-]).*=", line):
            return f"line {i}: "
    return f"line {begin}: " if 0 < begin <= len(lines) else ""
