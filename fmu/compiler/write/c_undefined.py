"""Which condition or whole number of events and samplers has no value (src/model/relations.h)."""

from collections.abc import Iterator

from ..expressions.kinds import CONDITION
from ..graph.graph import Value
from ..graph.undefined import may_miss
from ..read.content import Change, Event, Expression, ModelFile
from .c_code import Code, Leaves
from .c_text import indented, shortened
from .statements import Block, Statement

Row = tuple[str, Expression, Value]  # begin of a message, whether it has no value
START, CONDITIONS = "RELATIONS_START", "RELATIONS_CONDITIONS"
HEAD = """
static const char *undefined(const void *values_pointer, double time, double later, int event) {
    const struct equations_values *values = values_pointer;
    (void)values;
"""
IN_DOMAIN = """
static const char *undefined_condition_in_domain(const void *values, double t) {
    const struct domains_room room = DOMAINS_ROOM;
    const char *found = undefined_condition(values, t);
    return found != NULL && domains_follow(&domains, room, values, t)
               ? undefined_condition(room.values, t)
               : found;
}

""".splitlines()[1:]
DECLARED_IN_DOMAIN = IN_DOMAIN[0].replace(" {", ";")
OF_CONDITIONS = f"""
static const char *undefined_condition(const void *values, double time) {{
    return undefined(values, time, time, {CONDITIONS});
}}
"""


def parts(file: ModelFile, leaves: Leaves, in_domain: str) -> dict[str, list[str]]:
    """Return the function `undefined`, and where structs have it."""
    found = _rows(file)
    if not found:
        return dict.fromkeys(("undefined", "undefined_values", "undefined_conditions"), [])
    lines = HEAD.strip().splitlines()
    for number, rows in found.items():
        code = Code(leaves.but({("later", ""): "later"} if number[0] != "R" else {}))
        for name, expression, missing in rows:
            said = shortened(name, expression, file.tables)
            code.statements.append(Block(code.of(missing), ([Statement((f"return {said};",))],)))
        block = [f"if (event == {number}) {{", *indented(code.lines()), "}"]
        lines += indented(block)
    lines += ["    return NULL;", "}", ""]
    has_conditions = CONDITIONS in found
    return {
        "undefined": lines + has_conditions * [*OF_CONDITIONS.strip().splitlines(), ""],
        "undefined_values": [".undefined = undefined,"],
        "undefined_conditions": has_conditions * [f".undefined = undefined_condition{in_domain},"],
    }


def has_conditions(file: ModelFile) -> bool:
    """Return whether a condition of an event may have no value."""
    return CONDITIONS in _rows(file)


def missing(file: ModelFile, kind: object, value: Value) -> Value | None:
    """Return whether a condition or whole number has no value; None: it always has one."""
    if kind == CONDITION:
        return file.graph.unknown(value)
    return file.graph.value("isnan", value) if may_miss(value) else None


def _rows(file: ModelFile) -> dict[str, list[Row]]:
    """Return what may have no value by the number of the event, as C has it."""
    starts = {v.name: v.initial for v in file.started}
    changes = [*file.events, *file.sampled]
    found = {CONDITIONS: [row for event in file.events for row in _of_conditions(file, event)]}
    found[START] = [*_of_new(file, "start", starts, None)]
    for i, change in enumerate(changes):
        found[str(i)] = [*_of_change(file, change)]
    return {number: _once(rows) for number, rows in found.items() if rows}


def _once(rows: list[Row]) -> list[Row]:
    """Leave out what is missing together with something before."""
    first = {missing: (name, expression, missing) for name, expression, missing in rows[::-1]}
    return list(first.values())[::-1]


def _of_conditions(file: ModelFile, event: Event) -> Iterator[Row]:
    """Yield `while` of an event, and `when` where that holds."""
    name, during = f"event {event.name}", event.during
    if during is not None and (of := file.graph.unknown(during.value)) is not None:
        yield f"{name}: while = ", during, of
    if (of := file.graph.unknown(event.when.value)) is not None:
        yield f"{name}: when = ", event.when, _if(file, during, of)


def _of_change(file: ModelFile, change: Change) -> Iterator[Row]:
    """Yield `while` of a sampler, and new values where it holds."""
    is_event = isinstance(change, Event)
    name, during = f"{'event' if is_event else 'sampler'} {change.name}", change.during
    if is_event:  # it happens, so that its conditions hold
        during = None
    elif during is not None and (of := file.graph.unknown(during.value)) is not None:
        yield f"{name}: while = ", during, of
    yield from _of_new(file, name, change.given, during)


def _of_new(
    file: ModelFile, name: str, given: dict[str, Expression], during: Expression | None
) -> Iterator[Row]:
    """Yield new values that are no real numbers."""
    for target, expression in given.items():
        kind = file.kinds.get(target)
        of = kind and missing(file, kind, expression.value)
        if of is not None:
            yield f"{name}: {target} = ", expression, _if(file, during, of)


def _if(file: ModelFile, condition: Expression | None, value: Value) -> Value:
    return value if condition is None else file.graph.value("and", condition.value, value)
