"""A narrow band that holds the Jacobian of a large model, by the method of Cuthill and McKee."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

FEWEST_STATES, NARROWEST = 50, 4  # a full matrix has NARROWEST times the elements, or more


class Band(NamedTuple):
    """struct band of src/model/model.h."""

    lower: int
    upper: int
    order: list[int]
    places: list[int]  # of the elements that were given
    size: int

    @property
    def lines(self) -> list[str]:
        """Its declarations in C."""
        tables = {"order": self.order, "places": self.places}
        return [
            *(f"static const size_t {n}[] = {{{str(t)[1:-1]}}};" for n, t in tables.items()),
            f"static const struct band band = {{{self.lower}, {self.upper}, order,",
            "                                 &integrator_band_solver};",
        ]


def band(count: int, elements: Collection[tuple[int, int]]) -> Band | None:
    """Return the band of `count` states for the elements (i, j); None where it does not pay."""
    if count < FEWEST_STATES or NARROWEST * len(elements) > count**2:
        return None
    order = _ordered(count, elements)
    place = {state: k for k, state in enumerate(order)}
    moved = [(place[i], place[j]) for i, j in elements]
    lower = max([0, *(i - j for i, j in moved)])
    upper = max([0, *(j - i for i, j in moved)])
    length = 2 * lower + upper + 1
    places = [lower + upper + i - j + length * j for i, j in moved]
    found = Band(lower, upper, order, places, count * length)
    return found if NARROWEST * length <= count else None


def _ordered(count: int, elements: Collection[tuple[int, int]]) -> list[int]:
    """Return the states, those that depend on each other close together."""
    neighbors: list[set[int]] = [set() for _ in range(count)]
    for i, j in elements:
        neighbors[i].add(j)
        neighbors[j].add(i)
    near = [sorted(own, key=lambda k: (len(neighbors[k]), k)) for own in neighbors]
    order: dict[int, None] = {}
    for start in sorted(range(count), key=lambda k: len(near[k])):
        if start not in order:
            for _ in range(2):  # the last one from anywhere is at an end
                *_, start = _walk(start, near)
            order |= _walk(start, near)
    return [*order][::-1]


def _walk(start: int, near: list[list[int]]) -> dict[int, None]:
    """Return all states that depend on one, by their distance from it."""
    found = {start: None}
    queue = [start]
    for state in queue:
        new = [other for other in near[state] if other not in found]
        found |= dict.fromkeys(new)
        queue += new
    return found
