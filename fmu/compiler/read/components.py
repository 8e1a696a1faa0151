"""Components of a file: other files with equations, whose names begin with the component's.

A component is read and checked as a file of its own; then its entries join those of the whole,
where connections stand in the place of its inputs.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..expressions.expression import CONSTANTS, DERIVATIVE, Node, in_order
from ..expressions.hints import meant
from ..expressions.kinds import CONDITION, WHOLE
from ..interface import Terminal
from ..names import c_name
from ..units import parsed
from .content import (
    INTEGER,
    OPTIONS,
    PLACEHOLDER,
    SWITCHES,
    Change,
    Contact,
    Element,
    Event,
    Expression,
    ModelFile,
    ModelFileError,
    Variable,
    placed,
    shown,
)
from .keys import NAME, entries

EQUATIONS = ".toml"
LOOP = ("start", "step", "stop", "order", "keep", "variants")  # keys that only loop files have
OF_LOOP = ("name", "description", "components", "connections", "inputs", "parameters", *LOOP)
RUN = (".fmu", ".ssp", ".py")  # files that only `system` takes
MOST_LEVELS = 20
FREE = ("time", *CONSTANTS)  # names that every file has
QUANTITY = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*?)\s*")
OF_CHANGE = re.compile(r"\[(sampled|events|friction|stops)\.(.+)\]")


def flattened(table: Mapping[str, Any], begin: str = "") -> dict[str, Any]:
    """Return entries by dotted names, which may also be written as tables."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        inner = flattened(value, f"{begin}{key}.") if isinstance(value, dict) else {}
        for name, entry in (inner or {f"{begin}{key}": value}).items():
            if name in found:
                raise ModelFileError(f"{name}: is there twice")
            found[name] = entry
    return found


def is_loop(tables: Mapping[str, Any]) -> bool:
    """Return whether a file has keys that only loop files have; [stop] means [stops]."""
    return any(
        key in tables and not (key == "stop" and isinstance(tables[key], dict)) for key in LOOP
    )


def of_loop(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a loop file as those of a file with equations.

    Its parameters are start values of the components, its inputs those of the whole.
    """
    if not is_loop(tables):
        return dict(tables)
    for key in tables:
        if key not in OF_LOOP:
            raise ModelFileError(f"unknown key {shown(key)}{meant(key, OF_LOOP)}")
    found = {key: tables[key] for key in ("name", "description") if key in tables}
    times = found["experiment"] = {}
    for key in ("stop", "step"):
        with placed(key):
            times |= {key: _seconds(tables[key])} if key in tables else {}
    given: dict[str, dict[str, Any]] = {}
    with placed("[parameters]"):
        for name, value in flattened(tables.get("parameters", {})).items():
            component, _, rest = name.partition(".")
            given.setdefault(component, {})[rest] = value
    files = tables.get("components", {})
    if not isinstance(files, dict):
        raise ModelFileError(f"[components]: expected a table, got {shown(files)}")
    if missing := given.keys() - files.keys():
        raise ModelFileError(f"[parameters]: no component {min(missing)!r}")
    found["components"] = {}
    for name, entry in files.items():
        table = entry if isinstance(entry, dict) else {"file": entry}
        own = table.get("parameters", {})
        if isinstance(own, dict):
            with placed("[components]", name, "parameters"):
                own = flattened(own) | given.get(name, {})
        found["components"][name] = table | {"parameters": own}
    return found | {"connections": tables.get("connections", {})}


def _seconds(value: object) -> object:
    if not isinstance(value, str):
        return value
    number, unit = QUANTITY.fullmatch(value).groups() if QUANTITY.fullmatch(value) else ("", "")
    if not number:
        raise ModelFileError(f"expected a time such as '10 ms', got {shown(value)}")
    return parsed(unit or "s").value(float(number))


def check_loop(tables: Mapping[str, Any], file: ModelFile) -> None:
    """Check the names in a loop file of what only `system` uses: signals, variants, `keep`."""
    if not is_loop(tables):
        return
    for name in _ends(tables.get("inputs", {})):
        with placed("[inputs]", name):
            variable = _known(name, file)
            if variable.section not in ("inputs", SWITCHES):
                of = variable.expression
                is_fed = of is not None and of.place[0] == "[connections]"
                what = "connected already" if is_fed else f"of {variable.place}, no input"
                raise ModelFileError(f"is {what}")
    for variant, given in tables.get("variants", {}).items():
        for name in flattened(given) if isinstance(given, dict) else ():
            with placed(f"[variants.{variant}]", name):
                if name not in ("description", "file"):
                    _known(name, file)
    for name in tables.get("keep", ()):
        with placed("keep", shown(name)):
            _known(name, file)


def _known(name: str, file: ModelFile) -> Variable:
    if name not in file.variables:
        raise ModelFileError(f"there is no such variable{meant(name, file.variables)}")
    return file.variables[name]


def _ends(given: Mapping[str, Any], begin: str = "") -> Iterator[str]:
    """Yield names of [inputs], whose entries are tables themselves."""
    for key, value in given.items():
        if isinstance(value, dict) and any(isinstance(inner, dict) for inner in value.values()):
            yield from _ends(value, f"{begin}{key}.")
        else:
            yield f"{begin}{key}"


class Components:
    """Takes components into a file; `read` reads one with the files above it."""

    def __init__(
        self, file: ModelFile, read: Callable[[Path, tuple[Path, ...]], ModelFile],
        above: tuple[Path, ...],
    ) -> None:  # fmt: skip
        self.file, self.read, self.above = file, read, above

    def take(self, given: Mapping[str, Any]) -> None:
        """Read [components]."""
        for name, entry in given.items():
            with placed("[components]", name if NAME.fullmatch(name) else shown(name)):
                if not NAME.fullmatch(name):
                    raise ModelFileError("expected a name: a letter, then letters, digits, _")
                table = entry if isinstance(entry, dict) else {"file": entry}
                keys = entries(table, ("file", "parameters", "every"), "file")
                if "every" in keys:
                    what = "a rate is for co-simulation: built in, all components move together"
                    raise ModelFileError(f"every: {what}")
                part = self._part(keys["file"])
                self._merge(name, part)
                with placed("parameters"):
                    own = flattened(entries({"parameters": keys.get("parameters", {})},
                                            ("parameters",))["parameters"])  # fmt: skip
                    for variable, value in own.items():
                        self._set(f"{name}.{variable}", value)

    def _part(self, given: object) -> ModelFile:
        if not isinstance(given, str):
            raise ModelFileError(f"expected a file with equations, got {shown(given)}")
        if not given.lower().endswith(EQUATIONS):
            way_out = "; `system` runs it" if given.lower().endswith(RUN) else ""
            what = f"only files with equations (.toml) can be built in{way_out}"
            raise ModelFileError(f"{given or shown(given)}: {what}")
        path = self.file.path.parent / given
        if path.resolve() in self.above or len(self.above) > MOST_LEVELS:
            raise ModelFileError(f"{given} contains itself")
        if not path.is_file():
            raise ModelFileError(f"{given}: there is no such file")
        part = self.read(path, self.above)
        if part.hook is not None:
            what = "C decides its events, so that it cannot be built in; `system` runs it"
            raise ModelFileError(f"{given}: {what}")
        return part

    # ---- One component ---------------------------------------------------------------------------

    def _merge(self, prefix: str, part: ModelFile) -> None:
        """Add all that a file has, with the prefix in front of its names."""
        file, names = self.file, _Prefix(prefix)
        for symbol, unit in part.units.items():
            if file.units.setdefault(symbol, unit) != unit:
                raise ModelFileError(f"unit {symbol} has another meaning in another file")
        file.parts[prefix] = part
        for variable in part.variables.values():
            symbol = variable.unit
            if symbol and file.unit(symbol).exponents != variable.exponents:
                raise ModelFileError(f"unit {symbol} has another meaning in another file")
            new = names.variable(variable)
            file.variables[new.name] = new
            if not part.has_units:
                file.without_units.add(new.name)
        file.modes |= {names.of(mode): start for mode, start in part.modes.items()}
        file.sampled += map(names.change, part.sampled)
        file.events += map(names.change, part.events)
        file.contacts += map(names.contact, part.contacts)
        file.happening |= {names.of(name): kind for name, kind in part.happening.items()}
        for message, condition in part.checks:
            text = f"{prefix}: {names.message(message)}"
            file.checks.append((text, names.expression(condition)))
        for table in part.tables.items():
            number = len(file.tables)
            own = re.sub(r"\W", "_", table[0])
            file.tables[names.of(table[0])] = replace(table[1], name=f"{number}_{own}")
        file.terminals |= {
            f"{prefix}_{name}": names.terminal(terminal)
            for name, terminal in part.terminals.items()
        }
        file.dimensions |= {names.of(name): count for name, count in part.dimensions.items()}

    def _set(self, name: str, value: object) -> None:
        """Give a parameter, input or state another start."""
        variable = self.file.variables.get(name)
        with placed(name.partition(".")[2]):
            if variable is None:
                own = name.partition(".")[0]
                known = [x for x in self.file.variables if x.startswith(f"{own}.")]
                raise ModelFileError(f"there is no such variable{meant(name, known)}")
            if variable.section not in ("parameters", OPTIONS, "inputs", SWITCHES, "states"):
                what = "no parameter, input or state, which have start values"
                raise ModelFileError(f"is of {variable.place}: {what}")
            variable.start = self._number(variable, value)
            variable.initial = None
            low = -float("inf") if variable.min is None else variable.min
            high = float("inf") if variable.max is None else variable.max
            if not (variable.is_real or variable.kind == WHOLE):
                return
            if not low <= variable.start <= high:
                raise ModelFileError(f"{variable.start:g} is outside [min, max]")

    def _number(self, variable: Variable, value: object) -> float | bool | int:
        """Return a start value: in SI, or of a text with a unit."""
        kind = variable.kind
        if kind == CONDITION:
            if type(value) is not bool:
                raise ModelFileError(f"expected true or false, got {shown(value)}")
            return value
        if isinstance(kind, tuple):
            if value not in kind:
                raise ModelFileError(f"expected one of {', '.join(kind)}, got {shown(value)}")
            return kind.index(value) + 1
        if kind == WHOLE and type(value) is int:
            return value
        if type(value) in (int, float) and kind != WHOLE:
            return float(value)
        found = QUANTITY.fullmatch(value) if isinstance(value, str) else None
        if found is None or kind == WHOLE:
            wanted = INTEGER if kind == WHOLE else "a number in SI, or a text with its unit"
            raise ModelFileError(f"expected {wanted}, got {shown(value)}")
        unit = self.file.unit(found[2] or "1")
        if unit.exponents != variable.exponents and self.file.parts:
            raise ModelFileError(f"{value!r} does not have the unit of the variable")
        return unit.value(float(found[1]))

    # ---- Connections -----------------------------------------------------------------------------

    def connect(self, given: Mapping[str, Any]) -> None:
        """Let expressions stand in the place of inputs."""
        for name, text in flattened(given).items():
            with placed("[connections]", name):
                variable = self.file.variables.get(name)
                if variable is None:
                    raise ModelFileError(f"no such input{meant(name, [*self.file.variables])}")
                if variable.section not in ("inputs", SWITCHES) or "." not in name:
                    raise ModelFileError(f"is of {variable.place}, no input of a component")
            place = ("[connections]", name)
            element = Element(name, name, text)
            expression = self.file.expression(element, place, text, variable.kind, name)
            new = replace(variable, section="where", start=None, min=None, max=None, nominal=None)
            new.expression = expression
            self.file.variables[name] = new
        for prefix, part in all_parts(self.file):
            self._let_c_read_inputs(prefix, part)

    def _let_c_read_inputs(self, prefix: str, part: ModelFile) -> None:
        """Let what C calculates in a component follow from its inputs, which may be connected."""
        begin = f"{prefix}{part.calculate}: "
        names = [f"{prefix}{v.name}" for v in part.of("inputs", SWITCHES)]
        inputs = tuple(Node("name", 1, name=name) for name in names)
        for variable in self.file.variables.values() if part.calculate else ():
            expression = variable.expression
            if expression is not None and expression.tree.name.startswith(begin):
                expression.tree = replace(expression.tree, arguments=inputs)

    def check_names(self) -> None:
        """Check that different names are different in C."""
        known: dict[str, str] = {}
        rates = [f"der_{state.name}" for state in self.file.of("states")]
        for name in rates:
            if name in self.file.variables:
                raise ModelFileError(f"{name}: derivatives of states begin with der_: change it")
        for name in (*self.file.variables, *self.file.modes, *self.file.happening):
            other = known.setdefault(c_name("", name), name)
            if other != name:
                raise ModelFileError(f"{name}: C has the same name for {other}: change one of them")


class _Prefix:
    """Puts the name of a component in front of names."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix

    def of(self, name: str) -> str:
        return f"{self.prefix}.{name}"

    def message(self, text: str) -> str:
        return PLACEHOLDER.sub(lambda found: f"{{{self.of(found[1])}}}", text)

    def variable(self, given: Variable) -> Variable:
        new = copy(given)
        new.name, new.field = self.of(given.name), ""
        new.derivative_of = given.derivative_of and self.of(given.derivative_of)
        for key in ("expression", "initial", "guess"):
            if (expression := getattr(given, key)) is not None:
                setattr(new, key, self.expression(expression))
        return new

    def change(self, given: Change) -> Change:
        new = copy(given)
        new.name = self.of(given.name)
        for key in ("during", "when", "every", "offset"):
            if (expression := getattr(given, key, None)) is not None:
                setattr(new, key, self.expression(expression))
        for key in ("reinit", "set"):
            changes = getattr(given, key).items()
            setattr(new, key, {self.of(name): self.expression(e) for name, e in changes})
        new.where = [*map(self.expression, given.where)]
        if isinstance(new, Event):
            new.terminate = self.message(new.terminate)
        return new

    def contact(self, given: Contact) -> Contact:
        texts = {key: self.expression(expression) for key, expression in given.given.items()}
        return Contact(self.of(given.name), given.is_friction, self.of(given.force), texts)

    def expression(self, given: Expression) -> Expression:
        new = copy(given)
        new.tree, new.is_checked = self.tree(given.tree), True
        new.target = given.target and self.of(given.target)
        change = OF_CHANGE.fullmatch(given.place[0])
        if change:
            new.place = (f"[{change[1]}.{self.of(change[2])}]", *given.place[1:])
        else:
            head, *rest = given.place
            new.place = (head, *[self.of(name) for name in rest[:1]], *rest[1:])
        return new

    def tree(self, root: Node) -> Node:
        found: dict[Node, Node] = {}
        begin = f"{DERIVATIVE}("
        for node in in_order([root]):
            name = node.name
            if node.op in ("name", "element") and name.startswith(begin):
                name = f"{begin}{self.of(name.removeprefix(begin))}"
            elif node.op in ("table", "call", "element") or (
                node.op == "name" and name not in FREE
            ):
                name = self.of(name)
            found[node] = replace(
                node, name=name, arguments=tuple(found[argument] for argument in node.arguments)
            )
        return found[root]

    def terminal(self, given: Terminal) -> Terminal:
        groups = {
            key: {member: self.of(name) for member, name in getattr(given, key).items()}
            for key in ("signals", "inflows", "outflows")
        }
        inner = {name: self.terminal(terminal) for name, terminal in given.terminals.items()}
        return replace(given, **groups, terminals=inner)


def all_parts(file: ModelFile, begin: str = "") -> Iterator[tuple[str, ModelFile]]:
    """Yield all components with the names in front of theirs, each before those in it."""
    for name, part in file.parts.items():
        yield f"{begin}{name}.", part
        yield from all_parts(part, f"{begin}{name}.")
