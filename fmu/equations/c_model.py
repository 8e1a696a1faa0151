"""The model in C: equations.h with its value structure, equations.c with its struct model."""

from itertools import chain

from equations_file.tables import ModelFile

from equations.c_code import Code, filled, text
from equations.c_events import FIELD, Events, arrays, leaves
from equations.c_series import Series

RATE = "d_{}"  # fields have prefixes, so that any name of a variable will do
STRUCTURE = "struct equations_values"
SYMBOL = "equations_model"
FOLLOWED = "relations_followed(&relations, ROOM, values, t, &copy)"


def header(file: ModelFile) -> str:
    """Text of equations.h."""
    events = Events(file)
    groups = _ranges(file) | {
        "calculated": [FIELD.format(v.name) for v in file.of("where", "outputs")],
        "event indicators": list(events.indicators()),
    }
    fields = []
    for title, names in groups.items():
        fields += [f"/* {title} */", *(f"double {name};" for name in names)] if names else []
    return filled("equations.h.in", fields=fields + events.fields())


def source(file: ModelFile) -> str:
    """Text of equations.c."""
    events = Events(file)
    return filled(
        "equations.c.in",
        **_smooth(file),
        **_series(file, events),
        **_calculated(file, events),
        events=events.functions(),
        followed=[f"{STRUCTURE} copy;", f"values = {FOLLOWED};"] if events else [],
        checks=_checks(file),
        ranges=[
            f".{name} = {{offsetof({STRUCTURE}, {fields[0]}), {len(fields)} * sizeof(double)}},"
            for name, fields in _ranges(file).items()
            if fields
        ],
        model_events=[".events = &events,"] if events else [],
    )


def _ranges(file: ModelFile) -> dict[str, list[str]]:
    """Fields that are set from outside and their derivatives, by the ranges of struct model."""
    ranges = {
        section: [FIELD.format(v.name) for v in file.of(section)]
        for section in ("parameters", "inputs", "states")
    }
    return ranges | {"derivatives": [RATE.format(state.name) for state in file.of("states")]}


def _smooth(file: ModelFile) -> dict[str, list[str]]:
    """What the methods of integration evaluate, a smooth function between events."""
    one, states = file.graph.number(1.0), file.of("states")
    rates = [state.value for state in states]
    columns = [file.graph.derivatives(rates, {state.leaf: one}) for state in states]
    parts = {"right_hand_side": ("dx", rates), "jacobian": ("J", chain(*columns))}
    return {
        part: Code(arrays(file)).assign({f"{name}[{i}]": v for i, v in enumerate(values)}).lines
        for part, (name, values) in parts.items()
    }


def _series(file: ModelFile, events: Events) -> dict[str, object]:
    rates = {state.leaf: state.value for state in file.of("states")}
    followed = [events.signed(relation) for relation in events.located]
    series = Series(file.graph, rates, followed, leaves(file))
    rows = [str(row) for row in series.row_of_followed]
    return {
        **series.parts(),
        "row_count": len(series.rows),
        "row_of_indicator": ", ".join(rows or ["0"]),
    }


def _calculated(file: ModelFile, events: Events) -> dict[str, list[str]]:
    """Calculated fields and their derivatives along a curve."""
    graph = file.graph
    fields = {RATE.format(state.name): state.value for state in file.of("states")}
    fields |= {FIELD.format(v.name): v.value for v in file.of("where", "outputs")}
    fields |= events.indicators()
    seeds = {graph.value("time"): graph.value("first")}  # it has no second derivative
    for variable in file.of("parameters", "inputs", "states"):
        first = seeds[variable.leaf] = graph.value("first", name=variable.name)
        seeds[first] = graph.value("second", name=variable.name)
    firsts = graph.derivatives(fields.values(), seeds)
    seconds = graph.derivatives(firsts, seeds)
    curve = Code(leaves(file))
    curve.assign({f"d->{name}": value for name, value in zip(fields, firsts, strict=True)})
    split = len(curve.lines)
    curve.assign({f"dd->{name}": value for name, value in zip(fields, seconds, strict=True)})
    return {
        "outputs": Code(leaves(file)).assign({f"to->{n}": v for n, v in fields.items()}).lines,
        "derivatives": curve.lines[:split],
        "second_derivatives": curve.lines[split:],
    }


def _checks(file: ModelFile) -> list[str]:
    """Refuses parameters that are not finite or break a condition."""
    code = Code(leaves(file))
    conditions = {
        f"isfinite(values->{FIELD.format(v.name)})": f"{v.name} is not finite"
        for v in file.of("parameters")
    }
    lines = []
    for condition, message in [
        *conditions.items(),
        *((code.of(check.value), message) for message, check in file.checks.items()),
    ]:
        lines += [
            f"if (!{condition}) {{",
            f'    (void)snprintf(text, size, "%s", {text(message)});',
            "    return STATUS_INVALID_PARAMETERS;",
            "}",
        ]
    return code.lines + lines
