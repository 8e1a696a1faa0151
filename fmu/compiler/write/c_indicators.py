"""Event indicators in C: what each is in the modes that are, and which have rows in a series."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ..graph.graph import MOVING, Relation, Value
from .c_code import Code
from .statements import Operand, Place, store

if TYPE_CHECKING:
    from .c_events import Events


def in_series(events: Events) -> Iterator[Value]:
    """Yield distances, with the signs of modes, as far as they are needed: else 0.

    What follows from one state needs no row.
    """
    graph, zero = events.graph, events.graph.number(0.0)

    def where(condition: Value | None, first: Value, second: Value) -> Value:
        if condition is None or condition.moves or first is second:
            return first
        return graph.value("if", condition, first, second)

    for relation in events.located:
        is_of_state = _state_of(events, relation.distance) is not None
        used, found = events.used[relation.name], zero if is_of_state else events.signed(relation)
        yield where(used, found, zero)
    for limit in events.limits:
        condition, *cases = limit.cases
        first, second = (zero if _state_of(events, x) is not None else x for x in cases)
        found = second if condition is None else where(condition, first, second)
        yield where(limit.used, found, zero)


def first_of_model(events: Events) -> int:
    """Return the place of the first indicator that no single state gives: others are finite."""
    of_state = [_state_of(events, relation.distance) is not None for relation in events.located]
    return [*of_state, False].index(False)


def describe(events: Events) -> list[str]:
    """Return statements that write the kind of each indicator."""
    code, stores, one = Code(events.leaves), [], events.graph.number(1.0)
    for i, relation in enumerate(events.located):
        found, used = _described(events, code, relation), events.used[relation.name]
        if used is not None:
            found = "if", code.of(used), found, "unused"
        stores.append(store(Place("indicator[", i, "]"), found))
    for i, limit in enumerate(events.limits, len(events.located)):
        condition, *cases = limit.cases
        # what breaks away begins with a rate of 0, of which rounding must not make a fall
        first, second = (
            _described(events, code, Relation(x, True, None, None, one), limit.most is None)
            for x in cases
        )
        if limit.most is not None and not limit.most.moves:
            first = "relations_force_indicator", code.of(limit.most)
            second = first if cases[0] is cases[1] else second
        found = second if condition is None else ("if", code.of(condition), first, second)
        if limit.used is not None:
            found = "if", code.of(limit.used), found, "unused"
        stores.append(store(Place("indicator[", i, "]"), found))
    code.statements += stores
    return code.lines()


def _state_of(events: Events, distance: Value) -> tuple[int, Value, Value] | None:
    """Return the one state that moves a distance by a factor, with its place; None: none does."""
    moving = [leaf for leaf in distance.leaves if leaf[0] in MOVING]
    if len(moving) != 1 or moving[0][0] != "state":
        return None
    place, x = next(
        (i, x) for i, x in enumerate(events.file.of("states")) if x.name == moving[0][1]
    )
    factor = events.graph.derivative(distance, x.leaf)
    return None if factor.moves else (place, x, factor)


def _described(events: Events, code: Code, relation: Relation, may_rise: bool = True) -> Operand:
    """How an indicator follows from the states: from one by a factor, if it can be."""
    distance, zero = relation.distance, events.graph.number(0.0)
    found = _state_of(events, distance)
    if found is None:
        return "relations_model_indicator", code.of(relation.limit or zero)
    place, x, factor = found
    is_known = may_rise and ("time", "") not in x.value.leaves
    rate = x.value if is_known else zero
    at_zero = Code(code.leaves.but({("state", x.name): 0.0}))
    at_zero.statements = code.statements  # which have its constants, too
    offset = at_zero.of(distance)
    holds, factor, rate = (code.of(v) for v in (relation.mode, factor, rate))
    return "relations_state_indicator", place, holds, factor, offset, rate
