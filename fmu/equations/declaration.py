"""variables.toml of a model (declaration/schema.py), and its page."""

from __future__ import annotations

import json
import re
import string
from fractions import Fraction

from declaration.files import read as read_declaration
from declaration.load import UNITS

from equations import c_model
from equations.c_events import INDICATOR, MODE, Events
from equations.graph import MOVING, Value
from equations.lock import Key
from equations.model_file import ModelFile, Variable, placed
from rparm.expressions.units import BASE, Unit

INSTANCE = UNITS.parents[2] / "src" / "instance"
TIME = INSTANCE / "time_variable.toml"
SOLVER = INSTANCE / "solver_variables.toml"
EVENTS = INSTANCE / "event_variables.toml"

CAUSALITIES = {
    "parameters": "parameter",
    "inputs": "input",
    "states": "output",
    "where": "local",
    "outputs": "output",
}


def solver_names() -> list[str]:
    """Names of the variables that models get without declaring them."""
    return [name for path in (TIME, SOLVER, EVENTS) for name in read_declaration(path).variables]


def keys(file: ModelFile) -> list[Key]:
    """Name and kind of each variable, in the order in which they get value references."""
    listed = [
        (variable.name, CAUSALITIES[variable.section]) for variable in file.variables.values()
    ]
    listed += [(f"der_{state.name}", "local") for state in file.of("states")]
    listed += [(mode, "mode") for mode in file.modes]
    return listed + [(name, "local") for name in indicator_names(file)]


def indicator_names(file: ModelFile) -> list[str]:
    """Names of the indicators in the FMU, other than those of the file."""
    taken = {*file.variables, *file.modes}
    found = []
    for switch in Events(file).located:
        name = f"indicator_{switch.name}"
        while name in taken:
            name += "_"
        found.append(name)
    return found


def variables_toml(file: ModelFile, references: dict[Key, int]) -> str:
    """Text of variables.toml."""
    writer = _Writer(file, references)
    shown = file.of("parameters", "inputs", "states", "outputs")
    shown += [v for v in file.of("where") if (v.name, CAUSALITIES["where"]) in references]
    tables = [writer.table(variable) for variable in shown]
    tables += [writer.table_of_rate(state) for state in file.of("states")]
    tables += [writer.table_of_mode(mode) for mode in file.modes if writer.events]
    tables += writer.tables_of_indicators()
    includes = [
        TIME,
        *([SOLVER] if file.of("states") else []),
        *([EVENTS] if writer.events else []),
    ]
    head = {
        "name": file.name,
        "description": file.description or file.name,
        "header": "equations.h",
        "values": c_model.STRUCTURE,
        "symbol": c_model.SYMBOL,
    }
    lines = [f"include = {_toml([str(path) for path in includes])}", "", "[model]"]
    lines += [f"{key} = {_toml(value)}" for key, value in head.items()]
    if writer.events.located:
        lines.append(f"event_indicators = {_toml(indicator_names(file))}")
    if writer.events.timed:
        lines.append("time_events = true")
    lines += ["", "[experiment]", "start = 0.0"]
    lines += [f"{key} = {value!r}" for key, value in file.experiment.items()]
    if writer.new_units:
        lines += ["", "[units]"]
        for name, exponents in writer.new_units.items():
            listed = ", ".join(f"{base} = {power}" for base, power in exponents.items())
            lines.append(f"{_toml(name)} = {{ {listed} }}")
    return "\n".join([*lines, *tables]) + "\n"


def page(file: ModelFile) -> str:
    """Text of README.md: the description and the file itself."""
    runs = re.findall("`+", file.text)
    fence = "`" * max(3, 1 + max(map(len, runs), default=0))
    return "\n".join(
        [
            f"# {file.name}",
            "",
            _plain(file.description),
            "",
            "## Equations",
            "",
            "This file is the model:",
            "",
            f"{fence}toml",
            file.text.rstrip("\n"),
            fence,
            "",
        ]
    )


class _Writer:
    """Tables of variables; `new_units` are those that they need beside units.toml."""

    def __init__(self, file: ModelFile, references: dict[Key, int]) -> None:
        self.file, self.references, self.events = file, references, Events(file)
        self.known = {n: unit.exponents for n, unit in read_declaration(UNITS).units.items()}
        self.new_units: dict[str, dict[str, int]] = {}

    def table(self, variable: Variable) -> str:
        """Table of a variable of the file."""
        causality = CAUSALITIES[variable.section]
        with placed(f"[{variable.section}]", variable.name, "unit"):
            unit = self.unit(variable)
        entries: dict[str, object] = {
            "reference": self.references[variable.name, causality],
            "field": c_model.FIELD.format(variable.name),
            "causality": causality,
            "variability": "tunable" if causality == "parameter" else "continuous",
        }
        if variable.section == "states":
            entries["initial"] = "exact"
            entries["dependencies"] = [variable.name]
            if any(variable.name in event.reinit for event in self.file.events):
                entries["reinit"] = True
        entries["unit"] = unit
        numbers = {key: getattr(variable, key) for key in ("start", "min", "max", "nominal")}
        entries |= {key: number for key, number in numbers.items() if number is not None}
        if variable.section == "outputs":
            entries |= self.dependencies(variable.value)
        entries["description"] = variable.description or variable.name
        return _table(variable.name, entries)

    def table_of_rate(self, state: Variable) -> str:
        """Table of the derivative of a state by the time."""
        name = f"der_{state.name}"
        entries = {
            "reference": self.references[name, "local"],
            "field": c_model.RATE.format(state.name),
            "causality": "local",
            "variability": "continuous",
            "unit": self.unit_of_rate(state),
            "derivative_of": state.name,
            **self.dependencies(state.value),
            "description": f"Derivative of {state.name} by the time",
        }
        return _table(name, entries)

    def table_of_mode(self, mode: str) -> str:
        """Table of a mode of the file."""
        entries = {
            "reference": self.references[mode, "mode"],
            "field": MODE.format(mode),
            "type": "boolean",
            "causality": "local",
            "variability": "discrete",
            "description": f"Mode {mode}",
        }
        return _table(mode, entries)

    def tables_of_indicators(self) -> list[str]:
        """Tables of the event indicators."""
        tables = []
        for name, switch in zip(indicator_names(self.file), self.events.located, strict=True):
            entries = {
                "reference": self.references[name, "local"],
                "field": INDICATOR.format(switch.name),
                "causality": "local",
                "variability": "continuous",
                "unit": "1",
                **self.dependencies(switch.relation.distance),
                "description": "Distance from an event; 1 while it plays no role",
            }
            tables.append(_table(name, entries))
        return tables

    def dependencies(self, value: Value) -> dict[str, list[str]]:
        """What a calculated variable follows from, by the keys of variables.toml."""
        leaves, todo = set(), list(value.leaves)
        while todo:
            leaf = todo.pop()
            if leaf not in leaves and leaf[1] in self.file.graph.relations:
                todo += self.file.graph.relations[leaf[1]].distance.leaves
            leaves.add(leaf)
        moving = {name for op, name in leaves if op in MOVING}
        parameters = {name for op, name in leaves if op == "parameter"}
        return {
            "dependencies": [n or "time" for n in ("", *self.file.variables) if n in moving],
            "parameters": [n for n in self.file.variables if n in parameters],
        }

    def unit(self, variable: Variable) -> str:
        """Name of a variable's unit."""
        if not self.file.has_units:
            return "1"
        if variable.section == "where":
            return self.named(_whole(self.file.found_units[variable.name]))
        name = variable.unit or "1"
        exponents = {b: e for b, e in self.file.exponents(name).items() if e}
        if name in self.known and self.known[name] != exponents:
            raise ValueError(f"{name!r} is another unit already, give it another name")
        if name not in self.known:
            self.new_units[name] = exponents
        return name

    def unit_of_rate(self, state: Variable) -> str:
        """Name of a state's unit by the second."""
        if not self.file.has_units:
            return "1"
        exponents = dict(self.file.exponents(state.unit or "1"))
        exponents["s"] = exponents.get("s", 0) - 1
        return self.named(exponents)

    def named(self, exponents: dict[str, int]) -> str:
        """Name of a unit with these exponents."""
        exponents = {base: exponent for base, exponent in exponents.items() if exponent}
        for name, known in (self.known | self.new_units).items():
            if known == exponents:
                return name
        above = [f"{b}{e if e != 1 else ''}" for b, e in exponents.items() if e > 0]
        below = [f"{b}{-e if e != -1 else ''}" for b, e in exponents.items() if e < 0]
        divisor = below[0] if len(below) == 1 else f"({'.'.join(below)})"
        name = ".".join(above) or "1"
        name = f"{name}/{divisor}" if below else name
        self.new_units[name] = exponents
        return name


def _whole(unit: Unit) -> dict[str, int]:
    if any(exponent != int(exponent) for exponent in unit):
        raise ValueError("its exponents are no whole numbers, which FMI cannot say: use its square")
    return {base: int(Fraction(e)) for base, e in zip(BASE, unit, strict=True)}


def _table(name: str, entries: dict[str, object]) -> str:
    return "\n".join(
        ["", f"[variables.{name}]", *(f"{k} = {_toml(v)}" for k, v in entries.items())]
    )


def _toml(value: object) -> str:
    """A value of TOML: JSON's texts, lists and numbers are the same, but for one character."""
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _plain(text: str) -> str:
    """Text that means itself in Markdown."""
    return "".join(f"\\{c}" if c in string.punctuation else c for c in text)
