"""Which outputs of a system follow which inputs at once: chains, loops, orders of steps.

An output follows the inputs that its FMU declares; one whose FMU declares nothing follows all, by
FMI 2.0, section 2.2.8, and FMI 3.0, section 2.4.8. Components in Python give outputs by steps only.
"""

from collections.abc import Iterable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter

from rparm.errors import WrongValueError
from rparm.fmi.model import INPUTS, Model
from rparm.systems.structure import Connection


def direct(models: Mapping[str, Model]) -> dict[str, set[str]]:
    """Return the inputs that each output follows at once, all by "component.variable"."""
    found = {}
    for component, model in models.items():
        ends = {v.name for v in model.variables.values() if v.is_a(INPUTS)}
        for variable in model.variables.values():
            if variable.causality == "output":
                inputs = ends.intersection(model.dependencies.get(variable.name, ends))
                found[f"{component}.{variable.name}"] = {f"{component}.{x}" for x in inputs}
    return found


def longest_chain(connections: Sequence[Connection], models: Mapping[str, Model]) -> int:
    """Return through how many connections in a row values pass; WrongValueError for a loop."""
    causes = direct(models) | {c.end: {c.start} for c in connections}
    fed, length = {c.end for c in connections}, dict[str, int]()
    try:
        for name in TopologicalSorter(causes).static_order():
            before = (length[cause] for cause in causes.get(name, ()))
            length[name] = max(before, default=0) + (name in fed)
    except CycleError as error:
        raise WrongValueError(f"algebraic loop, {' -> '.join(error.args[1])}") from error
    return max(length.values(), default=0)


def loops(
    connections: Iterable[Connection], models: Mapping[str, Model]
) -> list[tuple[Connection, ...]]:
    """Return the connections of each algebraic loop; one that follows others is behind them."""
    connections = list(connections)
    causes = direct(models) | {c.end: {c.start} for c in connections}
    reached = {c.end: _behind(c.end, causes) for c in connections}
    found: dict[frozenset[str], list[Connection]] = {}
    for c in connections:
        circle = frozenset(x for x in reached[c.end] if c.end in reached.get(x, ()))
        if circle:
            found.setdefault(circle, []).append(c)
    return sorted(map(tuple, found.values()), key=lambda loop: len(reached[loop[0].end]))


def on_loops(connections: Iterable[Connection], models: Mapping[str, Model]) -> set[str]:
    """Return the Real inputs on algebraic loops, which are solved for."""
    reals = [
        c
        for c in connections
        if (v := models[c.start_component].variables.get(c.start_connector)) and v.type == "Real"
    ]
    return {c.end for loop in loops(reals, models) for c in loop}


def _behind(name: str, causes: Mapping[str, Iterable[str]]) -> set[str]:
    """Return all that a name follows at once, itself only if it is in a circle."""
    found: set[str] = set()
    to_see = list(causes.get(name, ()))
    while to_see:
        if (cause := to_see.pop()) not in found:
            found.add(cause)
            to_see += causes.get(cause, ())
    return found


def sequence(
    names: Iterable[str], connections: Iterable[Connection], models: Mapping[str, Model]
) -> list[str]:
    """Sort components for Gauss-Seidel order: behind those that they follow at once.

    What feeds an input that some output follows steps first, as blocks of diagrams are sorted by
    direct feedthrough. The components of an algebraic loop stand side by side. Where this leaves a
    choice, the order of `names` decides.
    """
    left, connections = list(names), list(connections)
    follows = set().union(*direct(models).values())
    before: dict[str, set[str]] = {name: set() for name in left}
    for c in connections:
        if c.end in follows and c.start_component != c.end_component:
            before[c.end_component].add(c.start_component)
    groups = {name: {name} for name in left}
    for loop in loops(connections, models):
        whole = set[str]().union(*(groups[c.end_component] for c in loop))
        groups |= dict.fromkeys(whole, whole)
    found: list[str] = []
    while left:
        free = (
            name
            for name in left
            if all(before[x] <= groups[name].union(found) for x in groups[name])
        )
        group = groups[next(free, left[0])]  # without a free one, the first of the file
        found += [name for name in left if name in group]
        left = [name for name in left if name not in group]
    return found
