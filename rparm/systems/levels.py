"""The levels of a system for an SSP: each with its elements, connectors and connections.

A signal that enters or leaves a subsystem passes a connector of it, whose name is that of the
component's variable from there: `motor.u` of the subsystem `left`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from rparm.systems.structure import Component, System

Signal = tuple[str, str]  # component and variable


@dataclass
class Level:
    """A system or subsystem."""

    name: str  # of all levels above and its own; "" of the whole
    elements: list["Level | Component"] = field(default_factory=list)  # in the order of the file
    # name -> the variable of a component that it stands for
    connectors: dict[str, Signal] = field(default_factory=dict)
    # start element, start connector, end element, end connector; "": the level's own
    connections: dict[tuple[str, str, str, str], None] = field(default_factory=dict)

    def own(self, name: str) -> str:
        """Return the name of an element within the level."""
        return name[len(self.name) + 1 :] if self.name else name


def levels(system: System, inputs: Iterable[tuple[str, str, str]], flat: bool = False) -> Level:
    """Return the whole; `inputs` from outside are (connector, component, variable)."""
    whole = Level("")
    known = {"": whole}
    for name in () if flat else system.subsystems:
        known[name] = Level(name)
    placed: set[str] = set()
    for component in system.components:
        chain = _chain(component.name, known)
        for above, level in zip(chain, chain[1:], strict=False):
            if level.name not in placed:
                above.elements.append(level)
                placed.add(level.name)
        chain[-1].elements.append(component)
    for c in system.connections:
        start, end = (c.start_component, c.start_connector), (c.end_component, c.end_connector)
        _connect(known, start, end)
    for name, component, variable in inputs:
        whole.connectors[name] = component, variable
        _enter(_chain(component, known), (component, variable), ("", name))
    return whole


def _chain(component: str, known: dict[str, Level]) -> list[Level]:
    """Return the levels that a component is in, the whole first."""
    return [x for name, x in known.items() if not name or component.startswith(f"{name}.")]


def _connect(known: dict[str, Level], start: Signal, end: Signal) -> None:
    here, there = _chain(start[0], known), _chain(end[0], known)
    common = sum(a is b for a, b in zip(here, there, strict=False))
    left = start
    for level in reversed(here[common:]):  # out of each
        leaving = level.own(f"{start[0]}.{start[1]}")
        level.connectors[leaving] = start
        level.connections[level.own(left[0]), left[1], "", leaving] = None
        left = level.name, leaving
    _enter(there[common - 1 :], end, (here[common - 1].own(left[0]), left[1]))


def _enter(chain: Sequence[Level], end: Signal, source: Signal) -> None:
    """Connect a source, of the first level's elements or its own, down to a component."""
    for level, below in zip(chain, chain[1:], strict=False):
        entering = below.own(f"{end[0]}.{end[1]}")
        below.connectors[entering] = end
        level.connections[*source, level.own(below.name), entering] = None
        source = "", entering
    last = chain[-1]
    last.connections[*source, last.own(end[0]), end[1]] = None
