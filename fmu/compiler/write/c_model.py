"""The model in C: equations.h with its value structure, equations.c with its struct model."""

from collections.abc import Mapping
from typing import Any

from ..expressions.expression import RELATIONS, in_order
from ..expressions.kinds import CONDITION
from ..graph.band import band
from ..graph.curve import Curve
from ..graph.graph import FALLIBLE, Value, is_number
from ..graph.plain import plain
from ..graph.stribeck import REACHED
from ..names import Field
from ..read.content import CALCULATED, OPTIONS, ModelFile
from . import c_algebraic, c_hook, c_indicators, c_undefined
from .c_code import Code, of_both, told
from .c_events import Events, arrays, count, leaves, ticks
from .c_series import Series
from .c_text import declared, filled, indented, number, shortened, text
from .statements import Block, Place, Statement, field_of, store

BY_AVX2 = """
BY_AVX2 static enum status extend_by_avx2(const struct series_origin *origin, int first, int last,
                                          double row[][SERIES_LENGTH]) {
    return extend_orders(origin, first, last, row);
}

static enum status extend(const struct series_origin *origin, int first, int last,
                          double row[][SERIES_LENGTH]) {
    return origin->has_avx2 ? extend_by_avx2(origin, first, last, row)
                            : extend_orders(origin, first, last, row);
}
"""
LONG = 500  # lines for derivatives in small code: compilers need less time
FOLLOWED = "relations_followed(&relations, ROOM, values, time, &copy)"


def header(file: ModelFile) -> str:
    """Return the text of equations.h."""
    if file.hook:
        return filled("hooked.h.in", header=f"{file.path.stem}_model.h")
    events = Events(file)
    groups = _ranges(file) | {
        "calculated": [file.fields.value(v.name) for v in file.calculated_reals],
        "event indicators": list(events.indicators()),
        "samplers": [tick.field for tick in ticks(file)],
    }
    fields = []
    for title, names in groups.items():
        fields += [f"/* {title} */", *declared("double", names)] if names else []
        if title == "parameters":
            fields += declared("int", _options(file))
    counts = declared("int", [file.fields.count(v.name) for v in file.calculated_counts])
    fields += c_algebraic.fields(file)
    fields += events.doubles() + (["/* calculated, no real numbers */"] if counts else []) + counts
    return filled("equations.h.in", fields=fields + events.ints())


def source(file: ModelFile) -> str:
    """Return the text of equations.c."""
    events = Events(file)
    followed = _followed(file, events)
    has_kinks = _has_kinks(followed) and not file.hook
    followed = ({}, []) if has_kinks else followed
    is_limited = file.hook is not None and file.hook.reach
    series = Series(file.graph, *followed, leaves(file).but({}, is_near="true"), is_limited)
    has_domains = bool(events.located) and _may_end(file)
    smooth = _smooth(file)
    parts = {
        **smooth,
        **_series(file, series, has_domains),
        "series_of_model": [] if has_kinks else [".series = &series,"],
        **_calculated(file, events),
        **_domains(file, events, series, has_domains, smooth["jacobian_size"]),
        "events": events.functions("_in_domain" * has_domains),
        "checks": _checks(file),
        **c_algebraic.parts(file, _modes_of(file, events)),
        **c_hook.parts(file, _ranges(file)),
    }
    return filled(
        "equations.c.in",
        structure=c_hook.structure(file),
        symbol=c_hook.symbol(file),
        **parts,
        tables=_tables(file),  # those that the parts read
        followed=_modes_of(file, events),
        expressions=_expressions(file),
        ranges=[
            *(c_hook.parameters(file) if file.hook else _parameter_lines(file)),
            *_range_lines(file, {k: v for k, v in _ranges(file).items() if k != "parameters"}),
        ],
        gradient_count=[f".gradient_count = {len(file.gradients.by)},"] if file.gradients else [],
        model_events=[f".events = &{c_hook.events(file)},"] if events else [],
    )


def _modes_of(file: ModelFile, events: Events) -> list[str]:
    """Statements that let `values` have the modes in effect."""
    if file.hook:
        return c_hook.modes_of_values(file)
    return [f"{c_hook.structure(file)} copy;", f"values = {FOLLOWED};"] if events else []


def _expressions(file: ModelFile) -> list[str]:
    """Rows of struct expression."""
    fields = [(file.fields.rate(x.name), x) for x in file.of("states")]
    fields += [(file.fields.value(v.name), v) for v in file.calculated_reals]
    fields += [(file.fields.count(v.name), v) for v in file.calculated_counts]
    whole = c_hook.structure(file)
    return [
        f"{{offsetof({whole}, {name}), {shortened('', variable.expression, file.tables)}}},"
        for name, variable in fields
    ] or ["{0},"]


def _tables(file: ModelFile) -> list[str]:
    """Constant arrays of tables that functions read."""
    lines, used = [], file.graph.arrays
    for table in file.tables.values():
        for name, dimensions, values in table.arrays():
            if name not in used:
                continue
            numbers = [number(value) for value in values]
            is_grid = dimensions.count("[") == 2
            width = len(table.axes[-1].origins) if is_grid else len(numbers)
            rows = [", ".join(numbers[i : i + width]) for i in range(0, len(numbers), width)]
            content = ", ".join(f"{{{row}}}" for row in rows) if is_grid else rows[0]
            lines.append(f"static const double {name}{dimensions} = {{{content}}};")
    return lines


def _ranges(file: ModelFile) -> dict[str, list[Field]]:
    """Fields that are set from outside and their derivatives, by the ranges of struct model."""
    ranges = {
        section: [file.fields.value(v.name) for v in file.of(section)]
        for section in ("parameters", "inputs", "states")
    }
    return ranges | {"dx": [file.fields.rate(state.name) for state in file.of("states")]}


def _options(file: ModelFile) -> list[Field]:
    """Fields of Boolean parameters, ints behind the others, in pairs: there are no gaps."""
    names = [file.fields.count(v.name) for v in file.of(OPTIONS)]
    return [*names, Field("unused")] if len(names) % 2 else names


def _parameter_lines(file: ModelFile) -> list[str]:
    doubles, ints = _ranges(file)["parameters"], _options(file)
    if not ints:
        return _range_lines(file, {"parameters": doubles})
    first = [*doubles, *ints][0]
    size = f"{len(doubles)} * sizeof(double) + {len(ints)} * sizeof(int)"
    return [f".parameters = {{offsetof({c_hook.structure(file)}, {first}), {size}}},"]


def _range_lines(file: ModelFile, ranges: Mapping[str, list[Field]]) -> list[str]:
    """Initializers of struct range, of fields that follow each other."""
    whole = c_hook.structure(file)
    return [
        f".{name} = {{offsetof({whole}, {fields[0]}), {len(fields)} * sizeof(double)}},"
        for name, fields in ranges.items()
        if fields
    ]


def _smooth(file: ModelFile) -> dict[str, Any]:
    """What the methods of integration evaluate, a smooth function between events."""
    states = file.of("states")
    motion = {Place("rate[", i, "]"): state.value for i, state in enumerate(states)}
    states = states[: len(file.gradients.states)] if file.gradients else states
    rates, count = [state.value for state in states], len(states)
    found: dict[Value, dict[Value, Value]] = {}
    rows = file.graph.gradients(rates, [state.leaf for state in states], found)
    names = {
        slope: f"{name.partition('[')[0]}_by_{x.name}"
        for value, name in file.graph.names.items()
        for x, slope in found.get(value, {}).items()
    }
    slopes = {
        (i, j): _where_it_moves(file, state.value, rows[i][state.leaf])
        for j, state in enumerate(states)
        for i in range(count)
        if state.leaf in rows[i] and not is_number(rows[i][state.leaf], 0.0)
    }
    narrow = band(count, slopes)
    size = narrow.size if narrow else count * count
    entries = {
        Place("slope[places[", k, "]]") if narrow else Place("slope[", j * count + i, "]"): slope
        for k, ((i, j), slope) in enumerate(slopes.items())
    }
    clear = [f"for (size_t i = 0; i < {size}; i++) {{", "    slope[i] = 0.0;", "}"]
    jacobian = Code(arrays(file), names=names).assign(entries).lines()
    return {
        "right_hand_side": Code(arrays(file)).assign(motion).lines(),
        "jacobian": clear * (len(entries) < size) + jacobian,
        "jacobian_size": size,
        "band": narrow.lines if narrow else [],
        "band_of_jacobian": [".band = &band,"] if narrow else [],
    }


def _where_it_moves(file: ModelFile, rate: Value, slope: Value) -> Value:
    """Leave out what follows from a state in the modes in which it rests: its rate is 0 there.

    An elimination that exchanges rows would mix the rounding of others into it. With a hook, a
    state whose rate is another state rests with that one.
    """
    if rate.op == "state" and file.hook:
        rate = file.variables[rate.name].value
    if rate.op != "if" or rate.arguments[0].moves:
        return slope
    condition, *cases = rate.arguments
    first, second = (
        case if is_number(case, 0.0) else _where_it_moves(file, case, slope) for case in cases
    )
    return slope if first is second else file.graph.value("if", condition, first, second)


def _followed(file: ModelFile, events: Events) -> tuple[dict[Value, Value], list[Value]]:
    """Of what there is a series: rates of the states and, signed, distances."""
    rates = {state.leaf: state.value for state in file.of("states")}
    if file.hook:
        return rates, [file.variables[name].value for name in file.hook.series]
    values = plain(file.graph, [*rates.values(), *c_indicators.in_series(events)])
    return dict(zip(rates, values, strict=False)), values[len(rates) :]


def _has_kinks(followed: tuple[dict[Value, Value], list[Value]]) -> bool:
    """Return whether a value that C compares decides on a rate or distance, without an event."""
    rates, distances = followed
    nodes = in_order([*rates.values(), *distances])
    return any(v.op in RELATIONS and v.moves and v.name != REACHED for v in nodes)


def _series(file: ModelFile, series: Series, has_domains: bool) -> dict[str, object]:
    rows = [str(row) for row in series.row_of_followed]
    if file.hook:
        of_name = dict(zip(file.hook.series, rows, strict=True))
        rows = [of_name.get(name, "0") for name in file.hook.indicators]
    inner = series.inner()
    return {
        **series.parts(),
        "row_count": series.row_count + has_domains,
        "storage_of_extend": "ALWAYS_INLINE" if series.is_wide else "static",
        "extend": "extend_orders" if series.is_wide else "extend",
        "asks_for_avx2": str(series.is_wide).lower(),
        "extend_by_avx2": BY_AVX2.splitlines() if series.is_wide else [],
        "row_of_indicator": ", ".join(rows or ["0"]),
        "inner": ", ".join(inner or ["{0, 0}"]),
        "may_vanish": str(series.may_vanish).lower(),
        "is_of_time": str(series.is_of_time).lower(),
        "inner_count": len(inner),
        "solutions_of_series": [*_solutions(series, ".solutions"), *_sizes(series)],
        "inner_stride": len(series.columns) or 1,
    }


def _solutions(series: Series, member: str) -> list[str]:
    """Return the members of a struct for the rows of solutions; member: with their numbers."""
    rows = series.solutions()
    if not rows:
        return []
    numbers = ", ".join(map(str, rows))
    return [f"{member} = (const size_t[]){{{numbers}}},", f".solution_count = {len(rows)},"]


def _sizes(series: Series) -> list[str]:
    """Return the member of struct series for the nominal values of solutions."""
    sizes = ", ".join(map(repr, series.solutions().values()))
    return [f".solution_sizes = (const double[]){{{sizes}}},"] if sizes else []


def _may_end(file: ModelFile) -> bool:
    """Return whether there are values beyond an event that are not finite."""
    roots = [v.value for v in file.of("states", *CALCULATED) if v.shown]
    roots += [relation.distance for relation in file.graph.located]
    return any(
        v.op in FALLIBLE and any(argument.moves for argument in v.arguments[-(v.op == "/") :])
        for v in in_order(roots)
    )


def _domains(
    file: ModelFile, events: Events, series: Series, has_domains: bool, jacobian_size: int
) -> dict[str, object]:
    """The parts that keep values finite beyond an event (src/model/domains.h), if that is asked."""
    if not has_domains:
        names = ("domains_header", "domains_declared", "domains")
        return {"in_domain": "", **{name: [] for name in names}}
    ranges = _ranges(file)
    calculated = ranges["dx"] + [file.fields.value(v.name) for v in file.calculated_reals]
    groups = {key: ranges[key] for key in ("states", "inputs")}
    groups |= {"calculated": calculated, "indicators": list(events.indicators())}
    distances = {Place("distance[", i, "]"): r.distance for i, r in enumerate(events.relations)}
    text = filled(
        "domains.c.in",
        distances=Code(leaves(file).but({}, is_free="true")).assign(distances).lines(),
        ranges=[*_range_lines(file, groups), *_counts_in_domain(file)],
        undefined=c_undefined.IN_DOMAIN if c_undefined.has_conditions(file) else [],
        own_row=series.row_count,
        solutions=_solutions(series, ".solution"),
        anchors=c_algebraic.anchors(file),
        jacobian_size=jacobian_size,
        first_of_model=c_indicators.first_of_model(events),
        located=len(events.located) + len(events.limits),
    )
    declared = [
        "static enum status indicators_in_domain(const void *values, double t, const double x[],",
        "                                        const double u[], double z[]);",
        "static enum status extend_in_domain(const struct series_origin *origin, int first,",
        "                                    int last, double row[][SERIES_LENGTH]);",
        "",
    ]
    if file.gradients:
        declared[-1:] = [
            "static enum status right_hand_side_in_domain(const void *values, double t,",
            "                                             const double x[], const double u[],",
            "                                             double dx[]);",
            "",
        ]
    if c_undefined.has_conditions(file):
        declared[-1:] = [c_undefined.DECLARED_IN_DOMAIN, ""]
    return {
        "in_domain": "_in_domain",
        "domains_header": ['#include "domains.h"'],
        "domains_declared": declared,
        "domains": text.splitlines(),
    }


def _counts_in_domain(file: ModelFile) -> list[str]:
    """Initializer of the range of calculated ints, if one may have no value."""
    counts = file.calculated_counts
    if all(c_undefined.missing(file, v.kind, v.value) is None for v in counts):
        return []
    first = file.fields.count(counts[0].name)
    begin = f"offsetof(struct equations_values, {first})"
    return [f".counts = {{{begin}, {len(counts)} * sizeof(int)}},"]


def _calculated(file: ModelFile, events: Events) -> dict[str, Any]:
    """Calculated fields and their derivatives along a curve."""
    graph = file.graph
    fields = {file.fields.rate(state.name): state.value for state in file.of("states")}
    fields |= {file.fields.value(v.name): v.value for v in file.calculated_reals}
    fields |= events.indicators()
    fields |= {tick.field: tick.value for tick in ticks(file)}
    rates = {graph.value("time"): (graph.value("first"), graph.number(0.0))}
    for variable in file.of("parameters", "inputs", "states", "discrete"):
        orders = (graph.value(order, name=variable.name) for order in ("first", "second"))
        rates[variable.leaf] = tuple(orders)
    curve = Curve(graph, rates.get)
    real = [v for v in file.started if v.is_real]
    started = {file.fields.value(v.name): v.initial.value for v in real}
    start_firsts, firsts = curve.first(started.values()), curve.first(fields.values())
    start_seconds, seconds = curve.second(started.values()), curve.second(fields.values())
    names = {}
    for prefix, found in (("dd", curve.seconds), ("d", curve.firsts)):
        of = [(found[value], name) for value, name in graph.names.items() if value in found]
        names |= {value: f"{prefix}_{name}" for value, name in of}
    targets = {
        structure: {
            field_of(structure, field, field): value
            for field, value in zip(fields, order, strict=True)
        }
        for structure, order in (("first", firsts), ("second", seconds))
    }
    outputs = Code(leaves(file))
    outputs.assign({field_of("to", field, field): value for field, value in fields.items()})
    for v in file.calculated_counts:
        field = file.fields.count(v.name)
        of = count(outputs, v.kind, v.value)
        if v.kind == CONDITION and (unknown := graph.unknown(v.value)) is not None:
            of = "if", outputs.of(unknown), "MODEL_NO_INT", of
        outputs.statements.append(store(field_of("to", field, field), of))
    first, second = of_both(
        Code(leaves(file), names=names), *targets.values(), "second", "return STATUS_OK;"
    )
    is_long = len(first) + len(second) >= LONG
    return {
        "storage_of_derivatives": "SELDOM_CALLED static" if is_long else "static",
        "started": _at_start(file, "first", dict(zip(started, start_firsts, strict=True))),
        "started_twice": _at_start(file, "second", dict(zip(started, start_seconds, strict=True))),
        "outputs": outputs.lines(),
        "derivatives": first,
        "second_derivatives": second,
    }


def _at_start(file: ModelFile, structure: str, derivatives: Mapping[Field, Value]) -> list[str]:
    """Add derivatives of start values to the states' derivatives, until the initialization ends."""
    code, condition = Code(leaves(file)), "!values->is_begun"
    stores = [
        store(field_of(structure, field, field), code.of(value), "+=")
        for field, value in derivatives.items()
        if not is_number(value, 0.0)
    ]
    if not stores:
        return []
    code.statements += stores
    if structure == "second":
        condition = f"{condition} && second != NULL"
    return [f"if ({condition}) {{", *indented(code.lines()), "}"]


def _checks(file: ModelFile) -> list[str]:
    """Refuses parameters that are not finite or break a condition, or leave it undefined."""
    graph, code = file.graph, Code(leaves(file))
    conditions = [
        (("isfinite", code.of(v.leaf)), (text(f"{v.name.partition('[')[0]} is not finite"),))
        for v in file.of("parameters")
    ]
    for message, check in file.checks:
        holds, unknown = check.value, graph.unknown(check.value)
        if unknown is not None:
            holds = graph.value("and", graph.value("not", unknown), holds)
        conditions.append((code.of(holds), told(file, code, message, {"parameter", "integer"})))
    refused = Statement(("return STATUS_INVALID_PARAMETERS;",))
    for condition, message in conditions:
        why = Statement(("(void)snprintf(text, size, ", *message, ");"))
        code.statements.append(Block(("not", condition), ([why, refused],)))
    return code.lines()
