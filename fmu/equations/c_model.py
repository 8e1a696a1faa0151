"""The model in C: equations.h with its value structure, equations.c with its struct model."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from equations.c_code import along_curve, calculated, text
from equations.c_events import FIELD, Events
from equations.c_series import Series
from equations.graph import Value, with_partials
from equations.model_file import ModelFile

# fields have prefixes, so that any name of a variable will do
RATE = "d_{}"
STRUCTURE = "struct equations_values"
SYMBOL = "equations_model"
CAST = f"const {STRUCTURE} *values = values_pointer;"
SMOOTH = ("right_hand_side", "jacobian", "outputs", "propagate", "check_parameters")


def header(file: ModelFile) -> str:
    """Text of equations.h."""
    groups = {
        "parameters": [FIELD.format(v.name) for v in file.of("parameters")],
        "inputs": [FIELD.format(v.name) for v in file.of("inputs")],
        "states": [FIELD.format(v.name) for v in file.of("states")],
        "their derivatives": [RATE.format(v.name) for v in file.of("states")],
        "calculated": [FIELD.format(v.name) for v in file.of("where", "outputs")],
        "event indicators": list(Events(file).indicators()),
    }
    fields = [
        line
        for title, names in groups.items()
        if names
        for line in (f"    /* {title} */", *(f"    double {name};" for name in names))
    ]
    modes = Events(file).fields()
    fields += ["    /* modes */", *(f"    {line}" for line in modes)] if modes else []
    return _lines(
        "/* Generated from the file of the model. */",
        "#ifndef EQUATIONS_H",
        "#define EQUATIONS_H",
        "",
        '#include "model.h"',
        "",
        f"{STRUCTURE} {{",
        *fields,
        "};",
        "",
        f"extern const struct model {SYMBOL};",
        "",
        "#endif",
    )


def source(file: ModelFile) -> str:
    """Text of equations.c."""
    has_states = bool(file.of("states"))
    events = Events(file)
    parts = [
        _right_hand_side(file),
        _jacobian(file) if has_states else [],
        _series(file, events) if has_states else [],
        _indicators(file, events) if events.located else [],
        events.decisions() if events else [],
        events.functions() if events else [],
        _outputs(file, events),
        _propagate(file, events),
        _check_parameters(file),
        _model(file),
    ]
    return _lines(
        "/* Generated from the file of the model. */",
        '#include "equations.h"',
        "",
        "#include <math.h>",
        "#include <stdbool.h>",
        "#include <stdio.h>",
        *(line for part in parts if part for line in ("", *part)),
    )


def _lines(*lines: str) -> str:
    return "\n".join(lines) + "\n"


def _function(head: str, body: Iterable[str]) -> list[str]:
    return [f"static enum status {head} {{", *(f"    {line}" for line in body), "}"]


def _leaf(file: ModelFile) -> Callable[[Value], str]:
    """How functions of (values, t, x, u) read a leaf."""
    places = {v.name: f"x[{i}]" for i, v in enumerate(file.of("states"))}
    places |= {v.name: f"u[{i}]" for i, v in enumerate(file.of("inputs"))}
    places |= {v.name: f"values->{FIELD.format(v.name)}" for v in file.of("parameters")}
    events = Events(file)

    def leaf(value: Value) -> str:
        if value.op == "mode":
            return events.mode(value.name)
        return "t" if value.op == "time" else places[value.name]

    return leaf


def _field_of(file: ModelFile, structure: str, time: str) -> Callable[[Value], str]:
    """How functions of value structures read a leaf."""
    events = Events(file)

    def leaf(value: Value) -> str:
        if value.op == "mode":
            return events.mode(value.name)
        return time if value.op == "time" else f"{structure}->{FIELD.format(value.name)}"

    return leaf


ARGUMENTS = (
    "(const void *values_pointer, double t, const double x[], const double u[], double {}[])"
)


def _right_hand_side(file: ModelFile) -> list[str]:
    rates = [state.value for state in file.of("states")]
    lines, at = calculated(rates, _leaf(file))
    results = [f"dx[{i}] = {at[value]};" for i, value in enumerate(rates)]
    body = [CAST, "(void)values;", *lines, *results, "return STATUS_OK;"]
    return _function("right_hand_side" + ARGUMENTS.format("dx"), body)


def _jacobian(file: ModelFile) -> list[str]:
    """Sparse: what is 0 for all values is not calculated."""
    graph, states = file.graph, file.of("states")
    entries = [
        graph.derivative(of.value, {graph.value("state", name=by.name): graph.number(1.0)})
        for by in states
        for of in states
    ]
    lines, at = calculated(entries, _leaf(file))
    results = [f"J[{k}] = {at[entry]};" for k, entry in enumerate(entries)]
    body = [CAST, "(void)values;", *lines, *results, "return STATUS_OK;"]
    return _function("jacobian" + ARGUMENTS.format("J"), body)


def _series(file: ModelFile, events: Events) -> list[str]:
    followed = [events.signed(switch) for switch in events.located]
    series = Series(
        file.graph,
        [state.name for state in file.of("states")],
        [variable.name for variable in file.of("inputs")],
        [state.value for state in file.of("states")],
        followed,
        _leaf(file),
    )
    body = [f"const {STRUCTURE} *values = origin->values;", "(void)values;", *series.statements()]
    head = (
        "extend(const struct series_origin *origin, int first, int last, "
        "double row[][SERIES_LENGTH])"
    )
    rows = ", ".join(str(series.rows.get(value, 0)) for value in followed)
    table = [f"static const size_t row_of_indicator[] = {{{rows}}};", ""] if followed else []
    member = "    .row_of_indicator = row_of_indicator,"
    return [
        *_function(head, body),
        "",
        *table,
        "static const struct series series = {",
        f"    .row_count = {len(series.rows)},",
        *([member] if followed else []),
        "    .extend = extend,",
        "};",
    ]


def _indicators(file: ModelFile, events: Events) -> list[str]:
    values = list(events.indicators().values())
    lines, at = calculated(values, _leaf(file))
    results = [f"z[{i}] = {at[value]};" for i, value in enumerate(values)]
    body = [CAST, "(void)values;", *lines, *results, "return STATUS_OK;"]
    return _function("indicators" + ARGUMENTS.format("z"), body)


def _calculated_fields(file: ModelFile, events: Events) -> dict[str, Value]:
    """Values by the fields that they are written to."""
    fields = {RATE.format(state.name): state.value for state in file.of("states")}
    fields |= {FIELD.format(v.name): v.value for v in file.of("where", "outputs")}
    return fields | events.indicators()


def _values_in_modes(events: Events) -> list[str]:
    """The values to read: modes follow what was set before they are next updated."""
    if not events:
        return [CAST, "(void)values;"]
    return [
        CAST,
        f"{STRUCTURE} copy;",
        "values = followed(values, t, &copy);",
    ]


def _outputs(file: ModelFile, events: Events) -> list[str]:
    fields = _calculated_fields(file, events)
    lines, at = calculated(fields.values(), _field_of(file, "values", "t"))
    results = [f"to->{name} = {at[value]};" for name, value in fields.items()]
    body = [
        f"{STRUCTURE} *to = values_pointer;",
        *_values_in_modes(events),
        "(void)to;",
        *lines,
        *results,
        "return STATUS_OK;",
    ]
    return _function("outputs(void *values_pointer, double t)", body)


def _propagate(file: ModelFile, events: Events) -> list[str]:
    fields = _calculated_fields(file, events)
    values = with_partials(file.graph, fields.values(), lambda value: value.leaves)
    lines, at = calculated(values, _field_of(file, "values", "t"))
    firsts, first = along_curve(file.graph, values, at, {}, _field_of(file, "d", "dt"), 1)
    seconds, second = along_curve(file.graph, values, at, first, _field_of(file, "dd", "0.0"), 2)
    first_results = [f"d->{name} = {first[value]};" for name, value in fields.items()]
    second_results = [f"dd->{name} = {second[value]};" for name, value in fields.items()]
    seconds = _used(seconds, second_results)
    firsts = _used(firsts, [*first_results, *seconds, *second_results])
    body = [
        *_values_in_modes(events),
        f"{STRUCTURE} *d = first_pointer;",
        f"{STRUCTURE} *dd = second_pointer;",
        "(void)d;",
        *_used(lines, [*firsts, *seconds]),
        *firsts,
        *first_results,
        "if (dd == NULL) {",
        "    return STATUS_OK;",
        "}",
        *seconds,
        *second_results,
        "return STATUS_OK;",
    ]
    head = (
        "propagate(const void *values_pointer, double t, double dt, void *first_pointer, "
        "void *second_pointer)"
    )
    return _function(head, body)


def _used(lines: list[str], after: list[str]) -> list[str]:
    """Those of the statements whose constants others read."""
    read = {word for line in after for word in _words(line)}
    kept = []
    for line in reversed(lines):
        left, _, right = line.partition(" = ")
        if left.split()[-1] in read:
            kept.append(line)
            read |= _words(right)
    return kept[::-1]


def _words(line: str) -> set[str]:
    return set("".join(c if c.isalnum() or c == "_" else " " for c in line).split())


def _check_parameters(file: ModelFile) -> list[str]:
    fields = [FIELD.format(v.name) for v in file.of("parameters")]
    lines, at = calculated(
        [condition for _, condition in file.checks], _field_of(file, "values", "t")
    )
    body = [CAST, "(void)values;"]
    for name in fields:
        body += [
            f"if (!isfinite(values->{name})) {{",
            f'    (void)snprintf(text, size, "%s is not finite", {text(name.removeprefix("v_"))});',
            "    return STATUS_INVALID_PARAMETERS;",
            "}",
        ]
    body += lines
    for message, condition in file.checks:
        body += [
            f"if (!{at[condition]}) {{",
            f'    (void)snprintf(text, size, "%s", {text(message)});',
            "    return STATUS_INVALID_PARAMETERS;",
            "}",
        ]
    head = "check_parameters(const void *values_pointer, char *text, size_t size)"
    return _function(head, [*body, "return STATUS_OK;"])


def _model(file: ModelFile) -> list[str]:
    states = file.of("states")
    ranges = {
        "parameters": [FIELD.format(v.name) for v in file.of("parameters")],
        "inputs": [FIELD.format(v.name) for v in file.of("inputs")],
        "states": [FIELD.format(v.name) for v in states],
        "derivatives": [RATE.format(v.name) for v in states],
    }
    lines = [
        f"    .{name} = {{offsetof({STRUCTURE}, {names[0]}), {len(names)} * sizeof(double)}},"
        for name, names in ranges.items()
        if names
    ]
    functions = [name for name in SMOOTH if states or name != "jacobian"]
    return [
        f"const struct model {SYMBOL} = {{",
        f"    .values_size = sizeof({STRUCTURE}),",
        *lines,
        *(f"    .{name} = {name}," for name in functions),
        *(["    .series = &series,"] if states else []),
        *(["    .events = &events,"] if Events(file) else []),
        "};",
    ]
