"""Dry friction and stops in C (src/model/contacts.h): tables, limits and what decides them."""

from collections.abc import Mapping, Sequence
from functools import partial, reduce
from itertools import pairwise

from ..graph.contacts import BACKWARD, FORWARD, FREE, STUCK, Contact, Direction, Limit, is_mode
from ..graph.graph import Graph, Value
from ..read.content import ModelFile, variable_of
from .c_code import Code, Leaves
from .c_text import filled, text
from .errors import Errors
from .statements import Block, Item, Operand, Place, Statement, store

HELD_SURELY = 0.75  # of the limit: relations_force_indicator


def limits(file: ModelFile) -> list[Limit]:
    """Return the limits of all contacts, two of each."""
    return file.graph.contacts.limits if file.graph.contacts else []


def held_states(file: ModelFile) -> dict[Value, Value]:
    """Return states that are 0 while a direction is held, with that condition."""
    found = file.graph.contacts.directions if file.graph.contacts else []
    return {d.own: d.held for d in found if d.velocity is d.own}


def moves_on(file: ModelFile) -> Value | None:
    """Return a condition for contacts to stay as they are; None: there is none.

    Each moves, is held far from its limit, or is off, with valid values: only one motion fits, so
    it goes on.
    """
    if file.graph.contacts is None:
        return None
    graph, found = file.graph, []
    zero, one = graph.number(0.0), graph.number(1.0)
    both, either = partial(graph.value, "and"), partial(graph.value, "or")
    for direction in file.graph.contacts.directions:
        if not _is_plain(direction):
            return None
        for contact in direction.contacts:
            given, is_in = contact.given, partial(is_mode, graph, contact)
            if contact.is_friction:
                velocity, coulomb = given["velocity"], given["coulomb"]
                forward = both(is_in(FORWARD), graph.value(">", velocity, zero))
                backward = both(is_in(BACKWARD), graph.value("<", velocity, zero))
                valid = graph.value(">=", coulomb, zero)
                if "breakaway" in given:
                    falls = graph.value(">", given["breakaway"], coulomb)
                    falls = both(falls, graph.value(">", given["stribeck"], zero))
                    valid = both(
                        valid, either(falls, graph.value("==", given["breakaway"], coulomb))
                    )
                stays = either(either(forward, backward), _is_stuck(graph, direction))
                own, off = both(stays, valid), is_in(FORWARD)
            else:
                ends = [given[key] for key in ("lower", "position", "upper") if key in given]
                inside = [graph.value("<", a, b) for a, b in pairwise(ends)]
                inside.append(graph.value(">=", given["restitution"], zero))
                inside.append(graph.value("<=", given["restitution"], one))
                off = is_in(FREE)
                own = reduce(both, inside, off)
            if contact.active is not None:
                own = either(
                    both(contact.active, own), both(graph.value("not", contact.active), off)
                )
            found.append(own)
    value = reduce(both, found)
    return None if ("time", "") in value.leaves else value


def _is_stuck(graph: Graph, direction: Direction) -> Value:
    """Return whether friction holds a direction, whose limit only parameters move."""
    if direction.friction.breakaway.moves or ("time", "") in direction.hold.leaves:
        return graph.number(0.0)
    at_rest = graph.value("==", direction.velocity, graph.number(0.0))
    return graph.value("and", is_mode(graph, direction.friction, STUCK), at_rest)


def surely_held(file: ModelFile, leaves: Leaves) -> list[Item]:
    """Return statements that return false where friction holds more than a good part of its limit.

    They follow those of `moves_on`.
    """
    found: list[Item] = []
    for direction in file.graph.contacts.directions:
        if not direction.friction or _is_stuck(file.graph, direction).op == "number":
            continue
        code, hold = Code(leaves), Place("hold")
        code.statements.append(Statement(("double hold;",)))
        code.assign({hold: direction.hold})
        most = "*", HELD_SURELY, code.of(direction.friction.breakaway)
        is_below = "<", ("fabs", hold), most
        code.statements.append(Block(("not", is_below), ([Statement(("return false;",))],)))
        outer = Code(leaves)
        is_stuck = outer.of(is_mode(file.graph, direction.friction, STUCK))
        found += [*outer.statements, Block(is_stuck, (code.statements,))]
    return found


def indicator(file: ModelFile, limit: Limit) -> Value:
    """Return the distance of a limit, or 1."""
    found = limit.distance(file.graph)
    return found if limit.used is None else file.graph.value(
        "if", limit.used, found, file.graph.number(1.0)
    )  # fmt: skip


def compare(
    file: ModelFile, code: Code, errors: Errors, slopes: Sequence[Value]
) -> list[Statement]:
    """Return statements that compare the limits; slopes: their derivatives by the time."""
    stores = []
    for i, (limit, slope) in enumerate(zip(limits(file), slopes, strict=True)):
        found = limit.distance(file.graph)
        entries = {
            "distance": code.of(found),
            "slope": code.of(slope),
            "noise": errors.of(found),
            "used": "1" if limit.used is None else code.of(limit.used),
        }
        for key, of in entries.items():
            stores.append(store(Place("compared[", i, f"].{key}"), of))
    return stores


def parts(
    file: ModelFile,
    leaves: Leaves,
    counted: Sequence[str],
    compared: list[str],
    along: Mapping[str, list[str]],
) -> dict[str, object]:
    """Return what events.c.in has of contacts.

    counted: names of struct count. compared: lines that compare limits. along: how gradients see
    an impact.
    """
    found = file.graph.contacts
    if found is None:
        return {"contacts": [], "of_contacts": [], "limits": 0, "room_of_contacts": ", {0}"}
    counts = [len(found.directions), len(found.contacts), len(found.moved)]
    states = {x.leaf: i for i, x in enumerate(file.of("states"))}
    text_of = filled(
        "contacts.c.in",
        contact=[_contact_row(file, contact, states, counted) for contact in found.contacts],
        direction=[_direction_row(file, direction, states) for direction in found.directions],
        moved=", ".join(str(states[x]) for x in found.moved) or "0",
        measure=_measure(file, leaves),
        compare=compared,
        **along,
        contacts=counts[1],
        directions=counts[0],
        blocks=len(found.blocks),
        moved_count=counts[2],
        indicator=len(file.graph.located),
    )
    room = f"CONTACTS_ROOM({', '.join(map(str, counts))})"
    return {
        "contacts": text_of.splitlines(),
        "of_contacts": [".contacts = &contacts,"],
        "limits": len(found.limits),
        "room_of_contacts": f", {room}",
    }


def _contact_row(
    file: ModelFile, contact: Contact, states: dict[Value, int], counted: Sequence[str]
) -> str:
    direction = next(
        i for i, d in enumerate(file.graph.contacts.directions) if contact in d.contacts
    )
    own = [
        text(contact.name),
        str(contact.is_friction).lower(),
        *(str(key in contact.given).lower() for key in ("lower", "upper")),
        str(direction),
        str(counted.index(variable_of(contact.name, "mode"))),
    ]
    if contact.is_friction:
        return f"{{{', '.join([*own, '0', '0', '0', '0'])}}},"
    own.append(str(states[contact.place[0]]))
    for key in ("impulse", "impulses", "loss"):
        field = file.fields.value(variable_of(contact.name, key))
        own.append(f"offsetof(struct equations_values, {field})")
    return f"{{{', '.join(own)}}},"


def _direction_row(file: ModelFile, direction: Direction, states: dict[Value, int]) -> str:
    blocks, number = file.graph.contacts.blocks, file.graph.contacts.directions.index(direction)
    block = next(i for i, block in enumerate(blocks) if number in block)
    is_plain = str(_is_plain(direction)).lower()
    is_exact = str(direction.is_exact).lower()
    return f"{{{states[direction.own]}, {is_plain}, {is_exact}, {block}}},"


def _is_plain(direction: Direction) -> bool:
    """Return whether a velocity is a multiple of a state."""
    return len(direction.row) == 1 and not direction.rest.leaves


def _measure(file: ModelFile, leaves: Leaves) -> list[str]:
    found, code = file.graph.contacts, Code(leaves)
    states = {x.leaf: i for i, x in enumerate(file.of("states"))}
    count = len(found.contacts)
    values: dict[Place, Value | Operand] = {}
    sums: list[Statement] = []
    for k, direction in enumerate(found.directions):
        of = {
            "velocity": direction.velocity,
            "rest": direction.rest,
            "factor": direction.row[direction.own],
            "acceleration": found.accelerations[k],
        }
        values |= {Place(f"to->{key}[", k, "]"): value for key, value in of.items()}
        values |= {
            Place("to->response[", k * count + e, "]"): slope
            for e, slope in enumerate(found.response[k])
        }
    for m, row in enumerate(found.moved.values()):
        values |= {Place("to->jump[", m * count + e, "]"): slope for e, slope in enumerate(row)}
    for e, contact in enumerate(found.contacts):
        values |= {
            Place(f"to->{key}[", e, "]"): value for key, value in of_contact(file, contact).items()
        }
    code.assign(values)
    for k, direction in enumerate(found.directions):
        terms = [("fabs", ("*", code.of(f), code.of(x))) for x, f in direction.row.items()]
        if direction.offset.leaves:
            terms.append(("fabs", code.of(direction.offset)))
        sums.append(store(Place("to->size[", k, "]"), _sum(terms)))
        slack = _tolerance(code, direction.row, states)
        sums.append(store(Place("to->slack[", k, "]"), slack))
    for e, contact in enumerate(found.contacts):
        if contact.tolerances:
            most = _tolerance(code, contact.tolerances, states)
            sums.append(store(Place("to->tolerance[", e, "]"), most))
        active = contact.active
        is_active = "1.0" if active is None else ("if", code.of(active), 1.0, 0.0)
        sums.append(store(Place("to->active[", e, "]"), is_active))
    code.statements += sums
    return code.lines()


def of_contact(file: ModelFile, contact: Contact) -> dict[str, Value]:
    """Return what is measured of a contact."""
    given, graph = contact.given, file.graph
    if contact.is_friction:
        own = {key: given[key] for key in ("coulomb", "stribeck") if key in given}
        own["breakaway"] = contact.breakaway
        return own | {"ratio": contact.ratio, "law": contact.law}
    own = {key: given[key] for key in ("position", "lower", "upper") if key in given}
    own |= {"ratio": contact.ratio, "restitution": given["restitution"]}
    state, rest = contact.place
    factor = contact.tolerances[state]
    for key in ("lower", "upper"):
        if key in given:
            is_plain = factor.op == "number" and factor.number == 1.0
            limit = given[key] if is_plain else graph.value("/", given[key], factor)
            own[f"at_{key}"] = graph.simple("+", limit, rest)
    return own


def _tolerance(code: Code, row: Mapping[Value, Value], states: Mapping[Value, int]) -> Operand:
    """Return the tolerance of a linear value, from those of its states."""
    return _sum(
        [
            ("*", ("fabs", code.of(factor)), Place("tolerance[", states[x], "]"))
            for x, factor in row.items()
        ]
    )


def _sum(terms: Sequence[Operand]) -> Operand:
    return reduce(lambda total, term: ("+", total, term), terms)
