"""Friction that falls from breakaway with the velocity: c + (b - c) exp(-(v / v_s)^2)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .graph import Graph, Value

REACHED = "reached"  # name of what steps cannot hide: reach of struct model_events
FAST = 7.0  # velocity over its scale: exp(-49) of the difference is left, and rounding leaves c
MOST_FALL = 1e5  # b over c, up to which that is so
LARGE = 1e16  # x / (1 + x) is 1 to the last digit


def size(graph: Graph, given: dict[str, Value], is_backward: Value | None = None) -> Value:
    """Return the size of friction that slides; without a mode in either sense.

    Past the event that ends its mode it stays b: an internal step from a fast motion forward to one
    backward would find c at both ends, and no trace of what lies between.
    """
    coulomb, breakaway, scale = (given[key] for key in ("coulomb", "breakaway", "stribeck"))
    value, zero, one = graph.value, graph.number(0.0), graph.number(1.0)
    if scale.op == "number" and scale.number == 0.0:  # a fall is refused where it would be
        return coulomb
    compared = partial(graph.value, name=REACHED)
    w = value("/", given["velocity"], scale)
    if is_backward is not None:
        w = value("if", is_backward, graph.negative(w), w)
    square = value("*", w, w)
    left = value("exp", value("negative", square), name=REACHED)
    is_fast = compared(">", square, graph.number(FAST * FAST))
    if is_backward is not None:
        is_fast = compared(">", w, graph.number(FAST))
        power = value("*", square, square)
        power = value("*", power, power)
        back = value("/", power, value("+", one, power), name=REACHED)
        back = value("if", compared("<", power, graph.number(LARGE)), back, one)
        left = value("if", compared("<", w, zero), value("+", left, back), left)
    at_rest, slides = value("*", breakaway, left), value("*", coulomb, value("-", one, left))
    most = value("*", graph.number(MOST_FALL), coulomb)
    falls, may_fall = value("+", at_rest, slides), value(">", scale, zero)
    if not (coulomb.moves or breakaway.moves):
        has_fallen = value("and", is_fast, value("<", breakaway, most))
        falls = value("if", has_fallen, coulomb, falls)
        may_fall = value("and", value(">", breakaway, coulomb), may_fall)
    return falls if scale.moves else value("if", may_fall, falls, coulomb)
