"""Variables for the newest coefficients of a series.

The next order begins with what this one ends with: it waits less for a variable than for memory
that was just written.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ..graph.graph import Value
from .statements import Block, Constant, Item, Operand, Place, Statement


class Newest:
    """Variables by value; `row`: where a coefficient is read."""

    def __init__(self, row: Callable[[Value, str], Place]) -> None:
        self.row = row
        self.values: dict[Value, Place] = {}
        self.pairs: dict[tuple[str, int], str] = {}  # by array and column

    def of(self, value: Value) -> Place:
        """Return the variable for the last coefficient of a value."""
        return self.values.setdefault(value, Place("e", len(self.values)))

    def of_pair(self, at: str, column: int) -> str:
        """Return the variable for the last coefficients of a pair in an array."""
        return self.pairs.setdefault((at, column), f"n{len(self.pairs)}")

    def given_to(self, at: str, column: int) -> str:
        """Return the begin of a statement that gives a pair its coefficients."""
        return f"{self.pairs[at, column]} = " if (at, column) in self.pairs else ""

    def begin(self) -> list[Item]:
        """Return statements in front of the first order."""
        found = [
            Statement(("double ", to, " = ", self.row(value, "before"), ";"))
            for value, to in self.values.items()
        ]
        pairs = [f"struct pair {n} = {at}[before][{i}];" for (at, i), n in self.pairs.items()]
        head = ["const int before = first > 0 ? first - 1 : 0;"] * bool(found or pairs)
        return [Statement((text,)) for text in head] + found + [Statement((t,)) for t in pairs]

    def through(self, items: Iterable[Item]) -> list[Item]:
        """Let statements of an order give coefficients to variables first, and read these."""
        variables = {_key(self.row(value, "k")): to for value, to in self.values.items()}
        return _through(items, variables)


def _key(place: Place) -> tuple:
    return place.before, place.index, place.after


def _through(items: Iterable[Item], variables: dict[tuple, Place]) -> list[Item]:
    def read(term: Operand) -> Operand:
        if isinstance(term, Place):
            return variables.get(_key(term), term)
        return (term[0], *map(read, term[1:])) if isinstance(term, tuple) else term

    found: list[Item] = []
    for item in items:
        if isinstance(item, Constant):
            item.of = read(item.of)
        elif isinstance(item, Block):
            item.condition = read(item.condition)
            item.bodies = tuple([_through(body, variables) for body in item.bodies])
        else:
            target = item.parts[0]
            to = read(target)
            item.parts = (to, *map(read, item.parts[1:]))
            if to is not target:
                found += [item, Statement((target, " = ", to, ";"))]
                continue
        found.append(item)
    return found
