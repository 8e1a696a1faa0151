"""Forces that hold what is at rest, in closed form: one solution for each set of held directions.

Each direction of a block has one unknown: the force that holds it or, while it moves, its
acceleration, on which others may depend. Equations are solved one after another, first those whose
slope by their own unknown stands still. So each case takes what an engineer would calculate in it,
and a series has a branch for each.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from .algebraic import UNKNOWN, replaced

if TYPE_CHECKING:
    from .contacts import Builder, Direction
    from .graph import Value

MOST_DIRECTIONS = 3  # of a block: it has as many cases as there are sets of them

ZERO, ONE = ("number", 0.0), ("number", 1.0)
Case = frozenset[int]  # directions that are held


class Held:
    """Forces that hold the directions of a block, and the rates of their states."""

    def __init__(self, builder: Builder, block: list[int], response: list[list[Value]]) -> None:
        self.builder, self.graph, self.block = builder, builder.graph, block
        self.response = response  # of accelerations to the forces
        self.zero = builder.zero
        self.directions = {k: builder.directions[k] for k in block}
        self.rates = {k: builder.rates[self.directions[k].velocity] for k in block}
        self.unknown = {k: self.graph.value(UNKNOWN, name=f"of direction {k}") for k in block}
        self.solved: dict[Case, dict[int, Value]] = {}

    @staticmethod
    def fits(directions: list[Direction]) -> bool:
        """Return whether there are few cases, and each velocity is a state."""
        return len(directions) <= MOST_DIRECTIONS and all(d.velocity is d.own for d in directions)

    def hold(self, k: int) -> Value:
        """Return the force that holds a direction; 0 while it moves."""
        return self._of_cases(k, lambda held: self._solution(held)[k], lambda _: self.zero)

    def rate(self, k: int) -> Value:
        """Return the rate of a direction's state."""
        return self._of_cases(k, lambda _: self.zero, lambda held: self._solution(held)[k])

    def _of_cases(
        self, k: int, held: Callable[[Case], Value], moving: Callable[[Case], Value]
    ) -> Value:
        """Return what follows from which directions are held, this one first."""

        def choose(left: list[int], case: Case, of: Callable[[Case], Value]) -> Value:
            if not left:
                return of(case)
            first, rest = left[0], left[1:]
            return self.builder.choice(
                self.directions[first].held,
                choose(rest, case | {first}, of),
                choose(rest, case, of),
            )

        others = [j for j in self.block if j != k]
        return self.builder.choice(
            self.directions[k].held, choose(others, frozenset({k}), held),
            choose(others, frozenset(), moving),
        )  # fmt: skip

    def _solution(self, held: Case) -> dict[int, Value]:
        """Return the forces of held directions, and the rates of the others."""
        if held not in self.solved:
            by = self._forces(held)
            rates = {self.rates[k]: self.zero if k in held else self.unknown[k] for k in self.block}
            equations = {}
            for k in self.block:
                others = {rate: x for rate, x in rates.items() if rate is not self.rates[k]}
                (equations[k],) = replaced(self.graph, [self.rates[k]], by | others)
            self.solved[held] = self._solve(equations, held)
        return self.solved[held]

    def _forces(self, held: Case) -> dict[Value, Value]:
        """Return the forces of all contacts, from those that hold directions."""
        graph, builder, found = self.graph, self.builder, {}
        for k, direction in self.directions.items():
            friction, stuck = direction.friction, builder.stuck(direction)
            total = self.unknown[k]
            is_one = self._act_alike(direction)
            if friction is not None:
                slides = builder.sliding(friction)
                found[friction.force] = slides
                if k in held and is_one:
                    rest = builder.choice(stuck, self.zero, slides)
                    found[friction.force] = graph.simple("-", rest, total)
                elif k in held:
                    found[friction.force] = builder.choice(stuck, graph.negative(total), slides)
            for contact in direction.stops:
                found[contact.force] = self.zero
                if k in held and not is_one:
                    force = builder.over(total, contact.ratio)
                    closed = builder.alone(direction, contact)
                    found[contact.force] = builder.choice(closed, force, self.zero)
        return found

    def _act_alike(self, direction: Direction) -> bool:
        """Return whether it is the same to accelerations which contact holds a direction."""
        friction, *stops = direction.contacts
        if not friction.is_friction:
            return False
        own = self.builder.contacts.index(friction)
        return all(
            contact.ratio is self.builder.one
            and all(is_opposite(row[own], row[self.builder.contacts.index(contact)])
                    for row in [*self.response, *self.builder.moved.values()])
            for contact in stops
        )  # fmt: skip

    def _solve(self, equations: dict[int, Value], held: Case) -> dict[int, Value]:
        """Solve equations: accelerations are 0 or, of what moves, the unknowns themselves."""
        left, found = dict(equations), {}
        while left:
            k = min(left, key=lambda k: (self._slope(left[k], k, held).moves, k not in held))
            found[k] = self._alone(left.pop(k), k, held)
            by = {self.unknown[k]: found[k]}
            left = dict(zip(left, replaced(self.graph, left.values(), by), strict=True))
        known: dict[Value, Value] = {}
        for k in reversed(found):
            (found[k],) = replaced(self.graph, [found[k]], known)
            known[self.unknown[k]] = found[k]
        return found

    def _slope(self, value: Value, k: int, held: Case) -> Value:
        value = self._factor(value, k) if k in held else value
        (row,) = self.graph.gradients([value], [self.unknown[k]])
        return row.get(self.unknown[k], self.zero)

    def _factor(self, value: Value, k: int) -> Value:
        """Return what is 0 where a value is: without what its own unknown is not in."""
        own = (self.unknown[k].op, self.unknown[k].name)
        while value.op in ("negative", "*", "/"):
            inner = [x for x in value.arguments if own in x.leaves]
            if len(inner) != 1 or (value.op == "/" and inner[0] is not value.arguments[0]):
                break
            value = inner[0]
        return value

    def _alone(self, value: Value, k: int, held: Case) -> Value:
        """Return the unknown for which an acceleration is 0, or the unknown itself."""
        graph, slope = self.graph, self._slope(value, k, held)
        at_zero = {self.unknown[k]: self.zero}
        if k in held:
            (rest,) = replaced(graph, [self._factor(value, k)], at_zero)
            return self.builder.over(graph.negative(rest), slope)
        if slope is self.zero:
            return value
        divisor = self.builder.one
        own = (self.unknown[k].op, self.unknown[k].name)
        if value.op == "/" and own not in value.arguments[1].leaves:
            value, divisor = value.arguments
            slope = self._slope(value, k, held)
        (rest,) = replaced(graph, [value], at_zero)
        return graph.value("/", rest, graph.simple("-", divisor, slope))


def is_opposite(a: Value, b: Value) -> bool:
    """Return whether a value is written as the negative of another one."""
    (sign, form), (other_sign, other) = _signed(a), _signed(b)
    return form == other and (sign != other_sign or form == ZERO)


def _signed(value: Value) -> tuple[int, tuple]:
    """Return the sign with which a value is written, and its form without signs and factors 1."""
    if value.op == "number":
        return -1 if value.number < 0.0 else 1, ("number", abs(value.number))
    if value.op not in ("negative", "*", "/", "+", "-"):
        return 1, ("value", value)
    found = [_signed(x) for x in value.arguments]
    sign, form = found[0]
    if value.op == "negative":
        return -sign, form
    other_sign, other = found[1]
    if value.op in ("*", "/"):
        if other == ONE:
            return sign * other_sign, form
        is_plain = value.op == "*" and form == ONE
        return sign * other_sign, other if is_plain else (value.op, form, other)
    relative = sign * other_sign * (1 if value.op == "+" else -1)
    return sign, ("+", form, other, relative)
