"""What a model declares (interface.py), and its page."""

import re
import string
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from typing import Any

from .. import interface
from ..expressions.expression import in_order
from ..expressions.kinds import CONDITION, WHOLE
from ..graph.contacts import deciding
from ..graph.graph import MOVING, Value
from ..interface import Declaration, Display
from ..names import Field
from ..read import by_hand
from ..read.components import all_parts
from ..read.content import (
    ALGEBRAIC,
    CALCULATED,
    COUNTS,
    FOLLOWS,
    FORCES,
    OPTIONS,
    SWITCHES,
    ModelFile,
    Variable,
    placed,
    variable_of,
)
from ..read.keys import NUMBERS
from ..units import ANGLE, BASE, STANDARD, Exponents, parsed, shown
from . import c_contacts, c_events, c_hook, c_model, lock
from .lock import Key

FLAT = {"floor", "ceil", "round", "mod", "sign"}
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
    ALGEBRAIC: "local",
    FORCES: "local",
    "where": "local",
    "outputs": "output",
}
USUAL_INITIAL = {"parameter": "exact"}
USUAL_INITIAL |= dict.fromkeys(("calculatedParameter", "output", "local"), "calculated")
TIME = interface.Variable(
    0, "time", "independent", "continuous", "Time", owner="instance", unit="s"
)


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


def _indicators(file: ModelFile) -> dict[str, Value]:
    """The distances that have an indicator, by its name, which no other variable has."""
    taken, found = {*file.variables, *file.modes}, {}
    for relation in file.graph.located:
        name = f"indicator_{relation.name}"
        while name in taken:
            name += "_"
        found[name] = relation.distance
    limits = c_contacts.limits(file)
    return found | {
        variable_of(limit.contact, limit.key): limit.distance(file.graph) for limit in limits
    }


def generated(file: ModelFile) -> dict[str, str]:
    """Texts of the files that are written of a model, by their names."""
    return {
        "equations.h": c_model.header(file),
        "equations.c": c_model.source(file),
        "README.md": page(file),
    }


def declared(file: ModelFile, references: dict[Key, int]) -> Declaration:
    """Return the declaration of a model."""
    indicators = (*(file.named_indicators or _indicators(file)),)
    has_time_events = len(file.graph.located) < len(file.graph.relations) or bool(file.sampled)
    has_time_events = has_time_events or file.time_events
    units = {name: parsed(name).exponents for name in STANDARD}  # further ones come to it
    variables = {"time": TIME} | _variables(file, references, units)
    has_events = bool(indicators) or has_time_events or file.hook is not None
    for name in _parts_of_instance(file, has_events):
        variables |= of_instance(name, units)
    used = {variable.unit for variable in variables.values() if variable.unit}
    return Declaration(
        name=file.name,
        description=file.description or file.name,
        **_in_c(file),
        experiment={"start": 0.0} | file.experiment,
        units={
            name: {base: units[name][base] for base in (*BASE, ANGLE) if base in units[name]}
            for name in used
        },
        variables=dict(sorted(variables.items(), key=lambda item: item[1].reference)),
        terminals=file.terminals,
        indicators=indicators,
        has_time_events=has_time_events,
        flat=() if file.is_by_hand else (*flat(file),),
        modulated=(*modulated(file),),
    )


def _in_c(file: ModelFile) -> dict[str, str]:
    """Return the header of the model in C, and what it declares."""
    if not file.is_by_hand:
        own = {"values": c_hook.structure(file), "symbol": c_hook.symbol(file)}
        return {"header": "equations.h"} | own
    stem = file.path.stem
    return {"header": f"{stem}.h", "values": f"struct {stem}_values", "symbol": f"{stem}_model"}


def _parts_of_instance(file: ModelFile, has_events: bool) -> Iterator[str]:
    """Yield which files of src/instance have variables of a model."""
    if has_events:
        yield "event"
    if file.of("states"):
        yield "solver"
    elif file.sampled:
        yield "time_event"


def of_instance(name: str, units: dict[str, Exponents]) -> dict[str, interface.Variable]:
    """Return the variables of a file of src/instance."""
    found = _variables(by_hand.of_instance(name), lock.of_instance(), units)
    return {
        name: replace(
            variable,
            owner="instance",
            constants=tuple(f"INTEGRATOR_{item.upper()}" for item in variable.items),
        )
        for name, variable in found.items()
    }


def _variables(
    file: ModelFile, references: dict[Key, int], units: dict[str, Exponents]
) -> dict[str, interface.Variable]:
    """Return the variables of a file; `units` gets those that it lacks."""
    own = [v for v in file.variables.values() if v.section != FORCES]
    tables = {v.name: _entries_of(v, file, units) for v in own}
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
    for i, (name, distance) in enumerate(_indicators(file).items()):
        tables[name] = {
            **_local(Field("z", i)),
            "unit": "1",
            **_dependencies(distance, file),
            "description": "Distance from an event; 1 while it plays no role",
        }
    for tick in c_events.ticks(file):
        own = {"unit": _unit(units, tick.exponents), "description": tick.description}
        tables[tick.name] = _local(tick.field) | own
    return {
        name: interface.Variable(references[name, kind], **_with_usual(tables[name]))
        for name, kind in keys(file)
        if name in tables
    }


def _with_usual(entries: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of a variable with those that follow from its causality and type."""
    usual: dict[str, Any] = {"initial": USUAL_INITIAL.get(entries["causality"])}
    if entries.get("type") == "boolean":
        usual |= {"min": 0, "max": 1}
    if items := entries.get("items"):
        usual |= {"min": 1, "max": len(items)}
    return usual | entries


def flat(file: ModelFile) -> list[str]:
    """Return functions without slope of what moves or is set, with the variables that call them."""
    called = [(v.name, v.expression) for v in file.of("states", *CALCULATED) if v.is_real]
    hidden = {variable.name for variable in file.variables.values() if not variable.shown}
    changes = [pair for change in file.changes for pair in change.given.items()]
    called += [(name, expression) for name, expression in changes if name not in hidden]
    found = {}
    for name, expression in called:
        nodes = in_order([expression.tree])
        known = FLAT & {node.function for node in nodes}
        known |= {f for node in nodes if node.op == "call" for f in flat_of(file, node.name)}
        leaves = _reached(expression.value.leaves, file, ["discrete"]) if known else ()
        if {op for op, _ in leaves} & {"state", "input", "discrete"}:
            found |= {f"{function} in {name.partition('[')[0]}": None for function in sorted(known)}
    return [*found]


def flat_of(file: ModelFile, function: str) -> set[str]:
    """Return the functions without slope that a function of C calls."""
    for prefix, part in all_parts(file):
        if function.startswith(prefix) and part.code:
            function, file = function.removeprefix(prefix), part
            break
    return file.code.flat[function]


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
    plain = "".join(f"\\{c}" if c in string.punctuation else c for c in file.description)
    head = f"# {file.name}\n\n{plain}\n\n## Equations\n\nThis file is the model:\n"
    found = [head + _fenced(file.text)]
    if file.blocks:
        lines = [f"- `{', '.join(b.names)}`: {b.kind}" for b in dict.fromkeys(file.blocks.values())]
        found += ["## Solved together\n", *lines, ""]
    texts = {part.path.resolve(): part for _, part in all_parts(file)}
    for part in texts.values():
        found.append(f"## {part.name}\n\nComponents are made of this file:\n{_fenced(part.text)}")
    return "\n".join(found)


def _fenced(text: str) -> str:
    runs = re.findall("`+", text)
    fence = "`" * max(3, 1 + max(map(len, runs), default=0))
    return f"\n{fence}toml\n{text.rstrip()}\n{fence}\n"


def _causality(variable: Variable) -> str:
    return variable.causality or CAUSALITIES[variable.section]


def _local(field: str) -> dict[str, object]:
    return {"field": field, "causality": "local", "variability": "continuous"}


def _entries_of(
    variable: Variable, file: ModelFile, units: dict[str, Exponents]
) -> dict[str, object]:
    """Table of a variable of the file."""
    causality = _causality(variable)
    if not variable.is_real:
        return _entries_of_count(variable, file)
    entries = _local(file.fields.value(variable.name)) | {"causality": causality}
    if variable.section in CALCULATED and variable.variability:
        entries["variability"] = variable.variability
    if causality == "parameter":
        is_fixed = ("parameter", variable.name) in _fixed(file)
        entries["variability"] = "fixed" if is_fixed else "tunable"
    if variable.section == FOLLOWS:
        is_fixed = variable.value.leaves <= _fixed(file)
        entries |= {"variability": "fixed" if is_fixed else "tunable"}
        entries |= _dependencies(variable.value, file)
    if variable.section == "states":
        entries |= {"initial": "exact", "dependencies": (variable.name,)}
        by_events = any(variable.name in change.reinit for change in file.changes)
        in_c = file.hook is not None or bool(file.indicators) or file.time_events
        entries["reinit"] = by_events or in_c or variable.leaf in _moved(file)
        if file.gradients and variable.leaf not in file.gradients.states:
            entries["reinit"] = bool(file.graph.relations or file.changes)
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
        entries["display"] = Display(*variable.display)
    keys = NUMBERS if entries.get("initial") != "calculated" else NUMBERS[1:]
    numbers = {key: getattr(variable, key) for key in keys}
    entries |= {key: number for key, number in numbers.items() if number is not None}
    is_derivative = bool(variable.derivative_of) and variable.section != "states"
    if variable.section == "outputs" or is_derivative or variable.name in file.named_indicators:
        entries |= _dependencies(variable.value, file)
    if variable.derivative_of:
        entries["derivative_of"] = variable.derivative_of
    return entries | {"description": variable.description or variable.name}


def _entries_of_count(variable: Variable, file: ModelFile) -> dict[str, object]:
    """Table of a condition, a whole number or an enumeration."""
    kind, is_calculated = variable.kind, variable.leaf is None
    leaf: Leaf = ("" if is_calculated else variable.leaf.op, variable.name)
    variability = "discrete"
    if variable.section in (OPTIONS, FOLLOWS):
        leaves = variable.value.leaves if is_calculated else {leaf}
        variability = "fixed" if leaves <= _fixed(file) else "tunable"
    entries: dict[str, object] = {
        "field": file.fields.count(variable.name),
        "type": TYPES.get(kind, "enumeration") if isinstance(kind, str) else "enumeration",
        "causality": _causality(variable),
        "variability": variability,
    }
    if isinstance(kind, tuple):
        entries["items"] = kind.descriptions
    bounds = {"min": variable.min, "max": variable.max}
    entries |= {key: number for key, number in bounds.items() if number is not None}
    if is_calculated:
        entries |= _dependencies(variable.value, file)
    elif variable.section == COUNTS:
        changed = _all_known(file) if file.hook else _reached({leaf}, file, ["discrete"])
        entries |= _known_of(changed, file)
        entries |= _initially({leaf}, {}, file)
    else:
        entries["start"] = variable.start
    return entries | {"description": variable.description or variable.name}


def _fixed(file: ModelFile) -> frozenset[Leaf]:
    """Leaves of parameters that must not change: the file says so, or periods follow from them."""
    said = {(v.leaf.op, v.name) for v in file.of("parameters", OPTIONS) if v.variability}
    return frozenset(said).union(*(e.value.leaves for s in file.sampled for e in s.periods))


def _unit(units: dict[str, Exponents], exponents: Exponents, name: str = "") -> str:
    """Return the name of a unit with these exponents, which is in `units` then."""
    exponents = {base: exponent for base, exponent in exponents.items() if exponent}
    if not name:
        same = [other for other, unit in units.items() if unit == exponents]
        name = same[0] if same else shown(exponents)
    if units.setdefault(name, exponents) != exponents:
        raise ValueError(f"{name!r} is another unit already, give it another name")
    return name


def _dependencies(value: Value, file: ModelFile) -> dict[str, tuple[str, ...]]:
    """What a calculated variable follows from, as interface.Variable has it."""
    leaves = _reached(value.leaves, file, ["discrete"])
    known = _known_of(leaves, file)
    return known | _initially(leaves, known, file)


def _known_of(leaves: set[Leaf], file: ModelFile) -> dict[str, tuple[str, ...]]:
    """Dependencies and parameters among what these leaves follow from."""
    moving = {name for op, name in leaves if op in MOVING or _is_in(file, name, SWITCHES)}
    parameters = {name for op, name in leaves if op == "parameter" or _is_in(file, name, OPTIONS)}
    return {
        "dependencies": _in_order({name or "time" for name in moving}, file),
        "parameters": _in_order(parameters, file),
    }


def _in_order(names: set[str], file: ModelFile) -> tuple[str, ...]:
    hidden = {variable.name for variable in file.variables.values() if not variable.shown}
    return (*sorted((names & file.places.keys()) - hidden, key=file.places.__getitem__),)


def _is_in(file: ModelFile, name: str, *sections: str) -> bool:
    return name in file.variables and file.variables[name].section in sections


def _reached(leaves: Iterable[Leaf], file: ModelFile, changed: Collection[str]) -> set[Leaf]:
    """All leaves that these follow from by relations and, if of a kind in `changed`, by changes."""
    found, todo = set(), list(leaves)
    of_contacts = {c.variable(key) for c in file.contacts for key in ("mode", "impulse", "loss")}
    if "state" in changed:
        of_contacts |= {x.name for x in _moved(file)}
    of_all = [leaf for value in deciding(file.graph) for leaf in value.leaves]
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
        if name in of_contacts:
            todo += of_all
        if "state" in changed:
            initial = file.variables[name].initial if name in file.variables else None
            todo += initial.value.leaves if initial is not None else ()
        is_changed = op in changed or _is_in(file, name, COUNTS)
        for change in file.changes if is_changed else ():
            if name in change.assigned:
                own = [*change.conditions, change.assigned[name]]
                todo += [leaf for expression in own for leaf in expression.value.leaves]
    return found


def _moved(file: ModelFile) -> set[Value]:
    """States that contacts set."""
    found = file.graph.contacts
    if found is None:
        return set()
    places = {contact.place[0] for contact in found.contacts if contact.place}
    return {*found.moved, *(direction.own for direction in found.directions), *places}


def _all_known(file: ModelFile) -> set[Leaf]:
    """All that the C of a hook may read, when it sets modes and states."""
    known = file.of("states", "inputs", "parameters", OPTIONS, SWITCHES)
    return {(variable.leaf.op, variable.name) for variable in known}


def _initially(
    leaves: set[Leaf], known: dict[str, tuple[str, ...]], file: ModelFile
) -> dict[str, tuple[str, ...]]:
    """What it follows from at the end of the initialization, when events may happen."""
    found = _reached(leaves, file, ["state", "mode", "discrete"])
    # a tick at the start takes the start values of discrete variables
    known_here = {n or "time" for op, n in found if op in (*MOVING, "parameter", "discrete")}
    known_here |= {name for _, name in found if _is_in(file, name, OPTIONS, SWITCHES)}
    names = {n for n in known_here if n == "time" or file.variables[n].initial is None}
    if known and names == {*known["dependencies"], *known["parameters"]}:
        return {}
    return {"initially": _in_order(names, file)}
