"""What a model declares (declaration/schema.py), and its page."""

import re
import string
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from declaration.load import read as read_declaration

from ..expressions.expression import in_order
from ..expressions.kinds import CONDITION, WHOLE
from ..graph.graph import MOVING, Relation, Value
from ..names import Field
from ..read.content import COUNTS, FOLLOWS, OPTIONS, SWITCHES, ModelFile, Variable, placed
from ..read.keys import NUMBERS
from ..units import STANDARD, parsed, shown
from . import c_events, c_hook, c_model

INSTANCE = Path(__file__).resolve().parents[3] / "src" / "instance"
TIME = INSTANCE / "time_variable.toml"
SOLVER = INSTANCE / "solver_variables.toml"
EVENTS = INSTANCE / "event_variables.toml"
TIME_EVENTS = INSTANCE / "time_event_variables.toml"

FLAT = {"floor", "ceil", "round", "mod", "sign"}
Key = tuple[str, str]  # name and kind of a variable
Leaf = tuple[str, str]  # of the graph: operation and name
TYPES = {CONDITION: "boolean", WHOLE: "int32"}
CAUSALITIES = {
    "parameters": "parameter",
    FOLLOWS: "calculatedParameter",
    OPTIONS: "parameter",
    SWITCHES: "input",
    COUNTS: "output",
    "inputs": "input",
    "states": "output",
    "discrete": "output",
    "where": "local",
    "outputs": "output",
}


def solver_names() -> list[str]:
    """Return the names of the variables that models get without declaring them."""
    return [name for path in (TIME, SOLVER, EVENTS) for name in read_declaration(path).variables]


def keys(file: ModelFile) -> list[Key]:
    """Return name and kind of each variable, in the order in which they get value references."""
    return [
        *((v.name, _causality(v)) for v in file.variables.values() if v.shown),
        *((f"der_{state.name}", "local") for state in _without_derivative(file)),
        *((mode, "mode") for mode in file.modes),
        *((name, "local") for name in _indicators(file)),
        *((tick.name, "local") for tick in c_events.ticks(file)),
    ]


def _without_derivative(file: ModelFile) -> list[Variable]:
    """Return the states whose derivative is no variable of the file."""
    named = {variable.derivative_of for variable in file.variables.values()}
    return [state for state in file.of("states") if state.name not in named]


def _indicators(file: ModelFile) -> dict[str, Relation]:
    """The relations that have an indicator, by its name, which no other variable has."""
    taken, found = {*file.variables, *file.modes}, {}
    for relation in file.graph.located:
        name = f"indicator_{relation.name}"
        while name in taken:
            name += "_"
        found[name] = relation
    return found


def generated(file: ModelFile) -> dict[str, str]:
    """Texts of the files that are written of a model, by their names."""
    return {
        "equations.h": c_model.header(file),
        "equations.c": c_model.source(file),
        "README.md": page(file),
    }


def declared(file: ModelFile, references: dict[Key, int]) -> dict[str, Any]:
    """Write a variables.toml (declaration/schema.py) as nested dictionaries."""
    relations, indicators, states = file.graph.relations, _indicators(file), file.of("states")
    units = {name: parsed(name).exponents for name in STANDARD}  # further ones come to it
    tables = {v.name: _entries_of(v, file, units) for v in file.variables.values()}
    for state in _without_derivative(file):
        rate = state.exponents | {"s": state.exponents.get("s", 0) - file.has_units}
        tables[f"der_{state.name}"] = {
            **_local(file.fields.rate(state.name)),
            "unit": _unit(units, rate),
            "derivative_of": state.name,
            **_dependencies(state.value, file),
            "description": f"Derivative of {state.name} by the time",
        }
    for mode in file.modes if c_events.has_events(file) else ():
        own = {"type": "boolean", "variability": "discrete", "description": f"Mode {mode}"}
        tables[mode] = _local(file.fields.count(mode)) | own
    for i, (name, relation) in enumerate(indicators.items()):
        tables[name] = {
            **_local(Field("z", i)),
            "unit": "1",
            **_dependencies(relation.distance, file),
            "description": "Distance from an event; 1 while it plays no role",
        }
    for tick in c_events.ticks(file):
        own = {"unit": _unit(units, tick.exponents), "description": tick.description}
        tables[tick.name] = _local(tick.field) | own
    model = {
        "name": file.name,
        "description": file.description or file.name,
        "header": "equations.h",
        "values": c_hook.structure(file),
        "symbol": c_hook.symbol(file),
        "event_indicators": file.hook.indicators if file.hook else [*indicators],
        "naming": "structured" if any("[" in name for name, _ in keys(file)) else "flat",
        "flat": flat(file),
        "modulated": modulated(file),
        "time_events": len(indicators) < len(relations) or bool(file.sampled),
    }
    includes = [TIME, *([EVENTS] if relations or file.sampled or file.hook else [])]
    includes += [SOLVER] if states else [TIME_EVENTS] if file.sampled else []
    helpers = {variable.name for variable in file.of("where")}  # last
    return {
        "include": [str(path) for path in includes],
        "model": model,
        "experiment": {"start": 0.0} | file.experiment,
        "units": {name: units[name] for name in units if name not in STANDARD},
        "variables": {
            name: {"reference": references[name, kind], **tables[name]}
            for name, kind in sorted(keys(file), key=lambda key: key[0] in helpers)
            if name in tables
        },
        "terminals": {
            name: terminal.model_dump(exclude_defaults=True)
            for name, terminal in file.terminals.items()
        },
    }


def flat(file: ModelFile) -> list[str]:
    """Return functions without slope of what moves or is set, with the variables that call them."""
    called = [(v.name, v.expression) for v in file.of("states", "where", "outputs") if v.is_real]
    hidden = {variable.name for variable in file.variables.values() if not variable.shown}
    changes = [pair for change in file.changes for pair in change.given.items()]
    called += [(name, expression) for name, expression in changes if name not in hidden]
    found = {}
    for name, expression in called:
        nodes = in_order([expression.tree])
        known = FLAT & {node.function for node in nodes}
        known |= {f for node in nodes if node.op == "call" for f in file.code.flat[node.name]}
        leaves = _reached(expression.value.leaves, file, ["discrete"]) if known else ()
        if {op for op, _ in leaves} & {"state", "input", "discrete"}:
            found |= {f"{function} in {name.partition('[')[0]}": None for function in sorted(known)}
    return [*found]


def modulated(file: ModelFile) -> list[str]:
    """Return the relations that switch within a period at a time that inputs or states decide.

    They compare with the time, with its part of a period, or with a state that samplers begin anew.
    """
    begun = {
        ("state", name)
        for sampler in file.sampled
        for name, new in sampler.reinit.items()
        if ("state", name) not in new.value.leaves
    }
    saws = {
        ("integer", name)
        for name, segment in file.graph.segments.items()
        if {op for op, _ in segment.argument.leaves} - {"parameter"} == {"time"}
    }
    found = []
    relations = file.graph.relations.values()
    for relation, text in zip(relations, file.relation_texts, strict=True):
        leaves = relation.distance.leaves
        carriers = leaves & (begun | saws)
        others = {leaf for leaf in leaves - carriers if leaf[0] in ("input", "state", "discrete")}
        is_timed = ("time", "") in leaves and not any(op == "state" for op, _ in others)
        reached = {op for op, _ in _reached(others, file, ["discrete"])}
        if (carriers or is_timed) and reached & {"input", "state"}:
            found.append(text)
    return found


def page(file: ModelFile) -> str:
    """Return the text of README.md: the description and the file itself."""
    runs = re.findall("`+", file.text)
    fence = "`" * max(3, 1 + max(map(len, runs), default=0))
    plain = "".join(f"\\{c}" if c in string.punctuation else c for c in file.description)
    head = f"# {file.name}\n\n{plain}\n\n## Equations\n\nThis file is the model:\n"
    return f"{head}\n{fence}toml\n{file.text.rstrip()}\n{fence}\n"


def _causality(variable: Variable) -> str:
    return variable.causality or CAUSALITIES[variable.section]


def _local(field: str) -> dict[str, object]:
    return {"field": field, "causality": "local", "variability": "continuous"}


def _entries_of(
    variable: Variable, file: ModelFile, units: dict[str, dict[str, int]]
) -> dict[str, object]:
    """Table of a variable of the file."""
    causality = _causality(variable)
    if not variable.is_real:
        return _entries_of_count(variable, file)
    entries = _local(file.fields.value(variable.name)) | {"causality": causality}
    if variable.section in ("where", "outputs") and variable.variability:
        entries["variability"] = variable.variability
    if causality == "parameter":
        is_fixed = ("parameter", variable.name) in _fixed(file)
        entries["variability"] = "fixed" if is_fixed else "tunable"
    if variable.section == FOLLOWS:
        is_fixed = variable.value.leaves <= _fixed(file)
        entries |= {"variability": "fixed" if is_fixed else "tunable"}
        entries |= _dependencies(variable.value, file)
    if variable.section == "states":
        entries |= {"initial": "exact", "dependencies": [variable.name]}
        is_written = any(variable.name in change.reinit for change in file.changes)
        entries["reinit"] = is_written or file.hook is not None
    if variable.section == "discrete":
        entries |= {"variability": "discrete", "initial": "exact"}
        leaves = _reached({("discrete", variable.name)}, file, ["discrete"])
        entries |= _known_of(leaves, file)
    if variable.section == "discrete" and file.hook:
        entries |= {"initial": "calculated", **_known_of(_all_known(file), file)}
    if variable.initial is not None:
        op = variable.leaf.op
        entries |= {"initial": "calculated", **_initially({(op, variable.name)}, {}, file)}
    with placed(file.path, variable.place, variable.name, "unit"):
        entries["unit"] = _unit(units, variable.exponents, variable.unit)
    if variable.display:
        entries["display"] = dict(zip(("name", "factor", "offset"), variable.display, strict=True))
    keys = NUMBERS if entries.get("initial") != "calculated" else NUMBERS[1:]
    numbers = {key: getattr(variable, key) for key in keys}
    entries |= {key: number for key, number in numbers.items() if number is not None}
    is_derivative = bool(variable.derivative_of) and variable.section != "states"
    is_indicator = file.hook is not None and variable.name in file.hook.indicators
    if variable.section == "outputs" or is_derivative or is_indicator:
        entries |= _dependencies(variable.value, file)
    if variable.derivative_of:
        entries["derivative_of"] = variable.derivative_of
    return entries | {"description": variable.description or variable.name}


def _entries_of_count(variable: Variable, file: ModelFile) -> dict[str, object]:
    """Table of a condition, a whole number or an enumeration."""
    kind, is_calculated = variable.kind, variable.leaf is None
    leaf: Leaf = ("" if is_calculated else variable.leaf.op, variable.name)
    variability = "discrete"
    if variable.section == OPTIONS:
        variability = "fixed" if leaf in _fixed(file) else "tunable"
    entries: dict[str, object] = {
        "field": file.fields.count(variable.name),
        "type": TYPES.get(kind, "enumeration") if isinstance(kind, str) else "enumeration",
        "causality": _causality(variable),
        "variability": variability,
    }
    if isinstance(kind, tuple):
        entries["items"] = {item: {"description": kind.descriptions[item]} for item in kind}
    bounds = {"min": variable.min, "max": variable.max}
    entries |= {key: number for key, number in bounds.items() if number is not None}
    if is_calculated:
        entries |= _dependencies(variable.value, file)
    elif variable.section == COUNTS:
        changed = _all_known(file) if file.hook else _reached({leaf}, file, ["discrete"])
        entries |= _known_of(changed, file)
        entries |= _initially({leaf}, {}, file)
    else:
        start = variable.start
        entries["start"] = kind[start - 1] if isinstance(kind, tuple) else start
    return entries | {"description": variable.description or variable.name}


def _fixed(file: ModelFile) -> frozenset[Leaf]:
    """Leaves of parameters that must not change: the file says so, or periods follow from them."""
    said = {(v.leaf.op, v.name) for v in file.of("parameters", OPTIONS) if v.variability}
    return frozenset(said).union(*(e.value.leaves for s in file.sampled for e in s.periods))


def _unit(units: dict[str, dict[str, int]], exponents: dict[str, int], name: str = "") -> str:
    """Return the name of a unit with these exponents, which is in `units` then."""
    exponents = {base: exponent for base, exponent in exponents.items() if exponent}
    if not name:
        same = [other for other, unit in units.items() if unit == exponents]
        name = same[0] if same else shown(exponents)
    if units.setdefault(name, exponents) != exponents:
        raise ValueError(f"{name!r} is another unit already, give it another name")
    return name


def _dependencies(value: Value, file: ModelFile) -> dict[str, list[str]]:
    """What a calculated variable follows from, by the keys of variables.toml."""
    leaves = _reached(value.leaves, file, ["discrete"])
    known = _known_of(leaves, file)
    return known | _initially(leaves, known, file)


def _known_of(leaves: set[Leaf], file: ModelFile) -> dict[str, list[str]]:
    """Dependencies and parameters among what these leaves follow from."""
    moving = {name for op, name in leaves if op in MOVING or _is_in(file, name, SWITCHES)}
    parameters = {name for op, name in leaves if op == "parameter" or _is_in(file, name, OPTIONS)}
    return {
        "dependencies": _in_order({name or "time" for name in moving}, file),
        "parameters": _in_order(parameters, file),
    }


def _in_order(names: set[str], file: ModelFile) -> list[str]:
    hidden = {variable.name for variable in file.variables.values() if not variable.shown}
    return sorted((names & file.places.keys()) - hidden, key=file.places.__getitem__)


def _is_in(file: ModelFile, name: str, *sections: str) -> bool:
    return name in file.variables and file.variables[name].section in sections


def _reached(leaves: Iterable[Leaf], file: ModelFile, changed: Collection[str]) -> set[Leaf]:
    """All leaves that these follow from by relations and, if of a kind in `changed`, by changes."""
    found, todo = set(), list(leaves)
    while todo:
        leaf = todo.pop()
        if leaf in found:
            continue
        found.add(leaf)
        op, name = leaf
        if name in file.graph.relations:
            todo += file.graph.relations[name].distance.leaves
        if name in file.graph.segments:
            todo += file.graph.segments[name].argument.leaves
        if file.hook and (op == "state" or _is_in(file, name, "discrete", COUNTS)):
            given = file.hook.reads.get(name, [])
            todo += [known for known in _all_known(file) if known[1] in given]
            is_any = "state" in changed and not (op == "state" and given)
            todo += _all_known(file) - found if is_any else ()
        if "state" in changed:
            initial = file.variables[name].initial if name in file.variables else None
            todo += initial.value.leaves if initial is not None else ()
        is_changed = op in changed or _is_in(file, name, COUNTS)
        for change in file.changes if is_changed else ():
            if name in change.given:
                own = [*change.conditions, change.given[name]]
                todo += [leaf for expression in own for leaf in expression.value.leaves]
    return found


def _all_known(file: ModelFile) -> set[Leaf]:
    """All that the C of a hook may read, when it sets modes and states."""
    known = file.of("states", "inputs", "parameters", OPTIONS, SWITCHES)
    return {(variable.leaf.op, variable.name) for variable in known}


def _initially(
    leaves: set[Leaf], known: dict[str, list[str]], file: ModelFile
) -> dict[str, list[str]]:
    """What it follows from at the end of the initialization, when events may happen."""
    found = _reached(leaves, file, ["state", "mode", "discrete"])
    # a tick at the start takes the start values of discrete variables
    known_here = {n or "time" for op, n in found if op in (*MOVING, "parameter", "discrete")}
    known_here |= {name for _, name in found if _is_in(file, name, OPTIONS, SWITCHES)}
    names = {n for n in known_here if n == "time" or file.variables[n].initial is None}
    if known and names == {*known["dependencies"], *known["parameters"]}:
        return {}
    return {"initially": _in_order(names, file)}
