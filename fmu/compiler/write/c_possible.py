"""What can happen in the modes that are, for struct model_events: no more is searched."""

from __future__ import annotations

from functools import partial, reduce
from typing import TYPE_CHECKING

from ..graph.contacts import STUCK, is_mode
from ..graph.graph import is_number
from . import c_contacts, c_undefined
from .c_code import Code
from .c_text import indented
from .statements import Block, Place, Statement, store

if TYPE_CHECKING:
    from ..graph.graph import Value
    from .c_events import Events

SLOW = 6.0  # velocity, in scales of the fall, beyond which exp(-36) of it is left
HEAD = "    const struct equations_values *values = values_pointer;"


def parts(events: Events) -> dict[str, list[str]]:
    """Return the functions and where the struct has them."""
    found = {"are_possible": _are_possible(events)}
    found |= _are_read(events)
    return found | _rest(events) | _moves_on(events) | _reach(events)


def _are_read(events: Events) -> dict[str, list[str]]:
    """Whether parameters let anything read relations."""
    conditions = [*events.read_by()]
    if not conditions or None in conditions or events.graph.segments:
        return {"are_read": [], "of_are_read": []}
    code = Code(events.leaves)
    are_read = code.of(reduce(partial(events.graph.value, "or"), conditions))
    code.statements.append(Statement(("return ", ("!=", are_read, 0), ";")))
    lines = ["static bool are_read(const void *values_pointer) {"]
    return {
        "are_read": [*lines, HEAD, *indented(code.lines()), "}", ""],
        "of_are_read": [".are_read = are_read,"],
    }


def _are_possible(events: Events) -> list[str]:
    """Whether there are relations that are read in these modes, or contacts that may hold."""
    used = [contact.active for contact in events.graph.contacts.contacts] if events.limits else []
    used += [events.used[relation.name] for relation in events.located]
    if not used or any(x is None or x.moves for x in used):
        return [f"return {str(bool(used)).lower()};"]
    code = Code(events.leaves)
    holds = code.of(reduce(partial(events.graph.value, "or"), dict.fromkeys(used)))
    code.statements.append(Statement(("return ", ("!=", holds, 0), ";")))
    head = "const struct equations_values *values = values_pointer;"
    return [head, *code.lines()]


def _rest(events: Events) -> dict[str, list[str]]:
    """When all states rest: where the conditions hold that make each rate 0.

    Then nothing is integrated, and no event is located that the time leads to.
    """
    conditions, zero = [], events.graph.number(0.0)
    held = c_contacts.held_states(events.file)
    for state in events.file.of("states"):
        rate = state.value
        if rate.op == "if" and rate.arguments[1] is zero and not rate.arguments[0].moves:
            conditions.append(rate.arguments[0])
        elif rate in held:
            conditions.append(held[rate])
        elif rate is not zero:
            conditions = []
            break
    is_of_time = any(("time", "") in distance.leaves for distance in events.followed)
    if not conditions or (events.located and not events.limits) or is_of_time:
        return {"rest": [], "is_at_rest": []}
    code = Code(events.leaves)
    rests = code.of(reduce(partial(events.graph.value, "and"), dict.fromkeys(conditions)))
    code.statements.append(Statement(("return ", ("!=", rests, 0), ";")))
    head = ["static bool is_at_rest(const void *values_pointer) {"]
    head += ["    const struct equations_values *values = values_pointer;"]
    rest = [*head, *indented(code.lines()), "}", ""]
    return {"rest": rest, "is_at_rest": [".is_at_rest = is_at_rest,"]}


def _moves_on(events: Events) -> dict[str, list[str]]:
    """Whether an update would change nothing: contacts stay, nothing else is read or due."""
    quiet, graph, code = c_contacts.moves_on(events.file), events.graph, Code(events.leaves)
    used, conditions = events.used.values(), []
    conditions = [c.value for event in events.file.events for c in event.conditions]
    is_open = any(x is None or x.moves for x in used) or any(x.moves for x in conditions)
    may_miss = c_undefined.parts(events.file, events.leaves, "")["undefined"]
    if quiet is None or is_open or may_miss or events.file.sampled or graph.segments:
        return {"moves_on": [], "of_moves_on": []}
    for of in dict.fromkeys(used):
        quiet = graph.value("and", quiet, graph.value("not", of))
    stays = code.of(quiet)
    for i, due in enumerate(events.dues(code)):
        stays = "and", stays, ("==", due, Place("values->active[", i, "]"))
    moves = "not", ("and", "values->is_begun", stays)
    code.statements.append(Block(moves, ([Statement(("return false;",))],)))
    code.statements += c_contacts.surely_held(events.file, events.leaves)
    code.statements.append(Statement(("return true;",)))
    head = ["static bool moves_on(const void *values_pointer) {"]
    head += ["    const struct equations_values *values = values_pointer;"]
    return {
        "moves_on": [*head, *indented(code.lines()), "}", ""],
        "of_moves_on": [".moves_on = moves_on,"],
    }


def _is_of_time(*values: Value) -> bool:
    """Return whether one of them needs the time, which is not known here."""
    return any(("time", "") in value.leaves for value in values)


def _reach(events: Events) -> dict[str, list[str]]:
    """How far a step may go while friction slides that falls from breakaway: to see its fall.

    Steps of what is fast end before, those of what is slow change its velocity by the scale of the
    fall at most.
    """
    file, graph = events.file, events.graph
    falling = [] if graph.contacts is None else [
        (direction, direction.friction)
        for direction in graph.contacts.directions
        if direction.friction and "breakaway" in direction.friction.given
        and not is_number(direction.friction.given["stribeck"], 0.0)
        and not _is_of_time(direction.friction.given["stribeck"], direction.velocity)
    ]  # fmt: skip
    if not falling:
        return {"reach": [], "of_reach": []}
    states = {x.leaf: i for i, x in enumerate(file.of("states"))}
    code = Code(events.leaves.but({(x.op, x.name): Place("state[", i, "]", x.name)
                                   for x, i in states.items()}))  # fmt: skip
    stores = [store(Place("reach[", i, "]"), "INFINITY") for i in states.values()]
    for direction, friction in falling:
        given, is_stuck = friction.given, is_mode(graph, friction, STUCK)
        falls = graph.value(">", given["breakaway"], given["coulomb"])
        slides = graph.value("not", is_stuck)
        if not _is_of_time(falls):
            slides = graph.value("and", slides, falls)
        if friction.active is not None:
            slides = graph.value("and", friction.active, slides)
        scale, speed = code.of(given["stribeck"]), ("fabs", code.of(given["velocity"]))
        above = code.constant(("-", speed, ("*", SLOW, scale)), is_kept=True)
        way = code.constant(("if", (">", above, scale), above, scale), is_kept=True)
        body = []
        for x, factor in direction.row.items():
            place = Place("reach[", states[x], "]")
            size = "fabs", code.of(factor)
            of_state = "/", way, ("*", float(len(direction.row)), size)
            body.append(store(place, ("fmin", place, of_state)))
        stores.append(Block(code.of(slides), (body,)))
    code.statements += stores
    lines = [
        "static void reach(const void *values_pointer, const double state[], double reach[]) {"
    ]
    return {
        "reach": [*lines, HEAD, *indented(code.lines()), "}", ""],
        "of_reach": [".reach = reach,"],
    }
