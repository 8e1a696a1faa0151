"""variables.toml of a model (declaration/schema.py), and its page."""

from __future__ import annotations

import json
import re
import string

from declaration.files import read as read_declaration
from declaration.load import UNITS

from equations import c_model
from equations.c_events import FIELD, INDICATOR, MODE, Events
from equations.file_tables import NUMBERS, ModelFile, Variable, placed
from equations.graph import MOVING, Value
from equations.lock import Key
from rparm.expressions.units import shown

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
    for relation in Events(file).located:
        name = f"indicator_{relation.name}"
        while name in taken:
            name += "_"
        found.append(name)
    return found


def generated(file: ModelFile, references: dict[Key, int]) -> dict[str, str]:
    """Texts of all files that are written of a model, by their names."""
    return {
        "equations.h": c_model.header(file),
        "equations.c": c_model.source(file),
        "variables.toml": variables_toml(file, references),
        "README.md": page(file),
    }


def variables_toml(file: ModelFile, references: dict[Key, int]) -> str:
    """Text of variables.toml."""
    events, units, states = Events(file), _Units(), file.of("states")
    helpers = {variable.name for variable in file.of("where")}  # last, if shown at all
    tables = {v.name: _entries_of(v, file, units) for v in file.variables.values()}
    for state in states:
        tables[f"der_{state.name}"] = {
            **_local(c_model.RATE.format(state.name)),
            "unit": units.named(_per_second(state) if file.has_units else {}),
            "derivative_of": state.name,
            **_dependencies(state.value, file),
            "description": f"Derivative of {state.name} by the time",
        }
    for mode in file.modes if events else ():
        own = {"type": "boolean", "variability": "discrete", "description": f"Mode {mode}"}
        tables[mode] = _local(MODE.format(mode)) | own
    for name, relation in zip(indicator_names(file), events.located, strict=True):
        tables[name] = {
            **_local(INDICATOR.format(relation.name)),
            "unit": "1",
            **_dependencies(relation.distance, file),
            "description": "Distance from an event; 1 while it plays no role",
        }
    model = {
        "name": file.name,
        "description": file.description or file.name,
        "header": "equations.h",
        "values": c_model.STRUCTURE,
        "symbol": c_model.SYMBOL,
        "event_indicators": indicator_names(file),
        "time_events": len(events.located) < len(events.relations),
    }
    includes = [TIME, *([SOLVER] if states else []), *([EVENTS] if events else [])]
    sections = {"model": model, "experiment": {"start": 0.0} | file.experiment}
    sections |= {f"units.{_toml(name)}": exponents for name, exponents in units.new.items()}
    sections |= {
        f"variables.{name}": {"reference": references[name, kind], **tables[name]}
        for name, kind in sorted(keys(file), key=lambda key: key[0] in helpers)
        if name in tables and (name, kind) in references
    }
    lines = [f"include = {_toml([str(path) for path in includes])}"]
    for title, entries in sections.items():
        lines += ["", f"[{title}]", *(f"{key} = {_toml(given)}" for key, given in entries.items())]
    return "\n".join(lines) + "\n"


def page(file: ModelFile) -> str:
    """Text of README.md: the description and the file itself."""
    runs = re.findall("`+", file.text)
    fence = "`" * max(3, 1 + max(map(len, runs), default=0))
    plain = "".join(f"\\{c}" if c in string.punctuation else c for c in file.description)
    head = f"# {file.name}\n\n{plain}\n\n## Equations\n\nThis file is the model:\n"
    return f"{head}\n{fence}toml\n{file.text.rstrip()}\n{fence}\n"


def _local(field: str) -> dict[str, object]:
    return {"field": field, "causality": "local", "variability": "continuous"}


def _entries_of(variable: Variable, file: ModelFile, units: _Units) -> dict[str, object]:
    """Table of a variable of the file."""
    causality = CAUSALITIES[variable.section]
    entries = _local(FIELD.format(variable.name)) | {"causality": causality}
    if causality == "parameter":
        entries["variability"] = "tunable"
    if variable.section == "states":
        entries |= {"initial": "exact", "dependencies": [variable.name]}
        entries["reinit"] = any(variable.name in event.reinit for event in file.events)
    with placed(f"[{variable.section}]", variable.name, "unit"):
        entries["unit"] = units.named(variable.exponents, variable.unit)
    numbers = {key: getattr(variable, key) for key in NUMBERS}
    entries |= {key: number for key, number in numbers.items() if number is not None}
    if variable.section == "outputs":
        entries |= _dependencies(variable.value, file)
    return entries | {"description": variable.description or variable.name}


def _dependencies(value: Value, file: ModelFile) -> dict[str, list[str]]:
    """What a calculated variable follows from, by the keys of variables.toml."""
    leaves, todo = set(), list(value.leaves)
    while todo:
        leaf = todo.pop()
        if leaf not in leaves and leaf[1] in file.graph.relations:
            todo += file.graph.relations[leaf[1]].distance.leaves
        leaves.add(leaf)
    moving = {name for op, name in leaves if op in MOVING}
    parameters = {name for op, name in leaves if op == "parameter"}
    return {
        "dependencies": [name or "time" for name in ("", *file.variables) if name in moving],
        "parameters": [name for name in file.variables if name in parameters],
    }


def _per_second(state: Variable) -> dict[str, int]:
    return state.exponents | {"s": state.exponents.get("s", 0) - 1}


class _Units:
    """Names of units; `new` are those that are declared beside units.toml."""

    def __init__(self) -> None:
        self.known = {n: unit.exponents for n, unit in read_declaration(UNITS).units.items()}
        self.new: dict[str, dict[str, int]] = {}

    def named(self, exponents: dict[str, int], name: str = "") -> str:
        """Name of a unit with these exponents."""
        exponents = {base: exponent for base, exponent in exponents.items() if exponent}
        known = self.known | self.new
        if not name:
            same = [other for other, unit in known.items() if unit == exponents]
            name = same[0] if same else shown(exponents)
        if known.get(name, exponents) != exponents:
            raise ValueError(f"{name!r} is another unit already, give it another name")
        if name not in known:
            self.new[name] = exponents
        return name


def _toml(value: object) -> str:
    """A value of TOML: JSON's texts, lists and numbers are the same, but for one character."""
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
