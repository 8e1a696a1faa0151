"""Gradients of a run in C (src/model/gradients.h): what an event's time follows from."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING

from ..graph.graph import Value
from ..read.content import ModelFile
from ..read.gradients import ARE_EXACT, part_of, part_of_change
from . import c_contacts
from .c_code import Code, Leaves
from .c_text import filled, indented, text
from .statements import Operand, Place, store

if TYPE_CHECKING:
    from .c_events import Events

NONE = {"gradients": [], "of_gradients": [], "room_of_gradients": ", {0}"}


def parts(events: Events, in_domain: str) -> dict[str, object]:
    """Return the functions, the member of struct relations and the initializer of the memory.

    in_domain: behind the name of the right-hand side.
    """
    file = events.file
    if file.gradients is None:
        return NONE
    by, states = file.gradients.by, [*file.gradients.states]
    names = [*file.graph.relations]
    limits = [f"{limit.contact}.{limit.key}" for limit in events.limits]
    causes = [part_of(file, [(r.mode.op, r.name)]) for r in events.relations]
    causes += [part_of(file, x.distance(file.graph).leaves) for x in events.limits]
    causes += [part_of_change(file, sampler) for sampler in file.sampled]
    distances = [relation.distance for relation in events.relations]
    distances += [limit.distance(file.graph) for limit in events.limits]
    watched = [names.index(file.gradients.watched[r]) if r in file.gradients.watched else -1
               for r in names]  # fmt: skip
    found = filled(
        "gradients.c.in",
        size=", ".join(repr(given.size) for given in by),
        names=", ".join(text(name[:100]) for name in [*file.relation_texts, *limits]) or "NULL",
        relations=file.gradients.relations,
        kinks=", ".join(str(name in file.gradients.kinks).lower() for name in names) or "false",
        watched=", ".join(map(str, watched)) or "-1",
        in_domain=in_domain,
        state_offset=_offset(file, "states"),
        inputs=_offset(file, "inputs"),
        crossings=[line for i, distance in enumerate(distances)
                   for line in _crossing(events, i, distance)],
        ticks=_ticks(events),
        count=len(by),
        of_states=", ".join(str(part_of(file, [(x.op, x.name)])) for x in states) or "0",
        of_causes=", ".join(map(str, causes)) or "0",
        states=len(states),
        are_exact=file.fields.count(ARE_EXACT),
    )  # fmt: skip
    contacts = file.graph.contacts
    counts = (
        [len(of) for of in (contacts.directions, contacts.contacts, contacts.moved)]
        if contacts
        else []
    )
    of_contacts = "0"
    if contacts:
        of_contacts = f"CONTACTS_MEASURED({', '.join(map(str, counts))}) + {2 * counts[0]}"
    room = len(by), len(states), file.gradients.part_count, of_contacts
    return {
        "gradients": found.splitlines(),
        "of_gradients": [".gradients = &gradients,"],
        "room_of_gradients": f", GRADIENTS_ROOM({', '.join(map(str, room))})",
    }


def _offset(file: ModelFile, section: str) -> str:
    """Return where the values of a section begin."""
    found = [file.fields.value(v.name) for v in file.of(section)]
    return f"offsetof(struct equations_values, {found[0]})" if found else "0"


def shifts(file: ModelFile) -> dict[tuple[str, str], Operand]:
    """Return where an event finds how its time and the inputs move."""
    moving: dict[tuple[str, str], Operand] = {
        ("first", u.name): Place("du[", i, "]") for i, u in enumerate(file.of("inputs"))
    }
    by = file.gradients.by if file.gradients else ()
    parts = range(file.gradients.part_count) if by else ()
    return moving | {
        ("shift", f"{part} {given.name}"): Place("shift[", part * len(by) + j, "]")
        for part in parts
        for j, given in enumerate(by)
    }


def along(file: ModelFile, leaves: Leaves) -> dict[str, list[str]]:
    """Return how gradients see what is measured at an impact."""
    found, gradients, graph = file.graph.contacts, file.gradients, file.graph
    if gradients is None or found is None:
        return {"measure_along": [], "of_gradients": []}
    count = len(found.contacts)
    values = {Place("to->velocity[", k, "]"): d.velocity for k, d in enumerate(found.directions)}
    for key, rows in (("response", found.response), ("jump", found.moved.values())):
        for i, row in enumerate(rows):
            of = {Place(f"to->{key}[", i * count + e, "]"): v for e, v in enumerate(row)}
            values |= of
    for e, contact in enumerate(found.contacts):
        own = c_contacts.of_contact(file, contact)
        keys = [key for key in ("ratio", "restitution", "at_lower", "at_upper") if key in own]
        values |= {Place(f"to->{key}[", e, "]"): own[key] for key in keys}
    lines, inputs = [], [u.leaf for u in file.of("inputs")]
    part = part_of(file, [(d.own.op, d.own.name) for d in found.directions])
    for j in range(len(gradients.by)):
        slopes = graph.derivatives(values.values(), gradients.seeds(graph, j, inputs, part))
        code = Code(leaves.but(shifts(file)))
        code.assign(dict(zip(values, slopes, strict=True)))
        lines += [f"if (parameter == {j}) {{", *indented(code.lines()), "}"]
    head = [
        "static void measure_along(const void *values_pointer, double time, const double du[],",
        "                          const double shift[], int parameter,",
        "                          const struct contacts_measured *to) {",
        "    const struct equations_values *values = values_pointer;",
        "    (void)values;",
        "    (void)du;",
        "    (void)shift;",
    ]
    members = [".measure_along = measure_along,"]
    members += [f".{name}_gradients = contacts_{name}_gradients," for name in ("strike", "hold")]
    return {"measure_along": [*head, *indented(lines), "}", ""], "of_gradients": members}


def _crossing(events: Events, index: int, distance: Value) -> list[str]:
    """How a distance moves by the time and by each parameter."""
    file, graph = events.file, events.graph
    gradients, inputs = file.gradients, file.of("inputs")
    states = [x for x in file.of("states") if x.leaf in gradients.states]
    rates = {("first", x.name): Place("rate[", i, "]") for i, x in enumerate(states)}
    code = Code(events.leaves.but(shifts(file) | rates))
    motion = {x.leaf: graph.value("first", name=x.name) for x in [*states, *inputs]}
    motion |= {graph.value("time"): graph.number(1.0)}
    stores = []
    if any((u.leaf.op, u.name) in distance.leaves for u in inputs):
        stores.append(store("to->is_of_input", "true"))
    along = [motion, *(gradients.seeds(graph, j) for j in range(len(gradients.by)))]
    if index >= len(events.relations):  # forces that hold contacts have long derivatives
        terms = [[graph.derivatives([distance], seeds)[0]] for seeds in along]
    else:
        leaves = dict.fromkeys(leaf for seeds in along for leaf in seeds)
        (slopes,) = graph.gradients([distance], leaves)
        terms = [
            [graph.simple("*", of, seeds[x]) for x, of in slopes.items() if x in seeds]
            for seeds in along
        ]
        drift = [of for x, of in slopes.items() if x.op == "time"]
        drift += [graph.simple("*", slopes[u.leaf], motion[u.leaf])
                  for u in inputs if u.leaf in slopes]  # fmt: skip
        stores.append(store("to->drift", _sums(code, drift)[0]))
        (whole,) = graph.derivatives([distance], motion | {x.leaf: x.value for x in states})
        (curvature,) = graph.derivatives([whole], motion)
        stores.append(store("to->curvature", code.of(curvature)))
    names = ["to->slope", *(Place("to->by[", j, "]") for j in range(len(gradients.by)))]
    sizes = ["to->size", *(Place("to->sizes[", j, "]") for j in range(len(gradients.by)))]
    for name, size, own in zip(names, sizes, terms, strict=True):
        total, magnitude = _sums(code, own)
        stores += [store(name, total), store(size, magnitude)]
    code.statements += stores
    return [f"if (relation == {index}) {{", *indented(code.lines()), "}"]


def _sums(code: Code, terms: list[Value]) -> tuple[Operand, Operand]:
    """Return the sum of terms, and of their magnitudes."""
    given = [code.of(term) for term in terms] or [0.0]
    sizes = [("fabs", code.constant(operand)) for operand in given] if terms else [0.0]
    total, magnitude = (reduce(lambda a, b: ("+", a, b), of) for of in (given, sizes))
    return total, magnitude


def _ticks(events: Events) -> list[str]:
    """Derivatives of the time of a tick, offset + count every, by each parameter."""
    file, graph, lines = events.file, events.graph, []
    for i, sampler in enumerate(file.sampled):
        code, count = Code(events.leaves), f"values->{events.discrete[1 + i]}"
        stores = []
        for j, by in enumerate(file.gradients.by):
            seeds = {} if by.is_start else {by.variable.leaf: graph.number(1.0)}
            periods = [sampler.every.value, sampler.offset.value]
            every, offset = map(code.of, graph.derivatives(periods, seeds))
            stores.append(store(Place("shift[", j, "]"), ("+", offset, ("*", count, every))))
        code.statements += stores
        lines += [f"if (sampler == {i}) {{", *indented(code.lines()), "}"]
    return lines
