"""Blocks of a file: entries that need each other, and the unknowns for which they are solved.

Each entry of [algebraic] is an unknown and an equation. Equations are matched to unknowns that they
contain, so that strongly connected entries are the smallest systems; in a cycle of other entries as
few as possible become unknowns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from ..expressions.expression import EQUALITIES, RELATIONS, Node, in_order, names
from ..expressions.kinds import LOGIC
from .content import ALGEBRAIC, Block, ModelFileError, Variable, shown

CONDITIONS = (*RELATIONS, *EQUALITIES, *LOGIC, "literal")


@dataclass(eq=False)
class Group:
    """Entries that need each other, or a single one; `arguments`: groups that they name."""

    names: list[str]
    is_block: bool
    arguments: tuple[Group, ...] = field(default=())


def groups(entries: Mapping[str, Variable]) -> tuple[list[Group], dict[str, str]]:
    """Group the entries in an order in which each group follows those that it names.

    entries: variables by the names of what they calculate, of states their derivatives. Returns the
    groups, and the names of the unknowns by the entry whose equation they are matched to.
    """
    read = {
        name: sorted(_read(variable.expression.tree, entries)) for name, variable in entries.items()
    }
    matched = _matched(entries, read)
    needs = dict(read)  # names that each unknown or other entry needs
    for equation, unknown in matched.items():
        guess = entries[unknown].guess
        of_guess = _read(guess.tree, entries) if guess else set()
        needs[unknown] = sorted({*read[equation], *of_guess})
        needs[unknown] = [name for name in needs[unknown] if name != unknown]
    found: dict[str, Group] = {}
    for members in _strong(needs):
        own = [name for name in entries if name in members]
        is_alone = len(own) == 1 and own[0] not in needs[own[0]]
        is_unknown = entries[own[0]].section == ALGEBRAIC
        group = Group(own, not is_alone or is_unknown)
        found |= dict.fromkeys(own, group)
    for group in dict.fromkeys(found.values()):
        of = dict.fromkeys(found[other] for name in group.names for other in needs[name])
        group.arguments = tuple(other for other in of if other is not group)
    return in_order(dict.fromkeys(found[name] for name in entries)), matched


def _read(tree: Node, entries: Mapping[str, Variable]) -> set[str]:
    return names(tree) & entries.keys()


def _matched(entries: Mapping[str, Variable], read: Mapping[str, list[str]]) -> dict[str, str]:
    """Match each equation to an unknown that it contains; ModelFileError if some have none."""
    unknowns = [name for name, variable in entries.items() if variable.section == ALGEBRAIC]
    contained: dict[str, list[str]] = {}
    for equation in unknowns:
        seen, todo = {}, [*read[equation]]
        while todo:
            name = todo.pop()
            if name not in seen:
                seen[name] = None
                todo += [] if entries[name].section == ALGEBRAIC else read[name]
        own = [name for name in unknowns if name in seen]
        contained[equation] = sorted(own, key=lambda name: name != equation)
        if not own:
            raise ModelFileError(_without_unknown(entries[equation], entries))
    by_unknown: dict[str, str] = {}

    def match(equation: str, tried: set[str]) -> bool:
        """Augment the matching by a path from the equation."""
        for unknown in contained[equation]:
            if unknown in tried:
                continue
            tried.add(unknown)
            if unknown not in by_unknown or match(by_unknown[unknown], tried):
                by_unknown[unknown] = equation
                return True
        return False

    for equation in unknowns:
        if equation in contained[equation] and equation not in by_unknown:
            by_unknown[equation] = equation
    for equation in unknowns:
        if equation not in by_unknown.values() and not match(equation, set()):
            left = next(name for name in unknowns if name not in by_unknown)
            what = f"another equation determines {', '.join(contained[equation])} already"
            raise ModelFileError(f"[{ALGEBRAIC}]: {equation}: {what}, and none determines {left}")
    return {equation: unknown for unknown, equation in by_unknown.items()}


def _without_unknown(variable: Variable, entries: Mapping[str, Variable]) -> str:
    """Say what to do about an equation without an unknown."""
    states = {v.name for v in entries.values() if v.section == "states"}
    named = sorted(names(variable.expression.tree) & states)
    what = "its equation contains no unknown of [algebraic]"
    hint = ""
    if named:
        text = ", ".join(f"der({name})" for name in named)
        hint = (
            f": differentiate {shown(variable.expression.text)} by the time, once or twice, until "
            f"the unknown appears by {text}"
        )
    return f"{variable.place}: {variable.name}: {what}{hint}"


def _strong(needs: Mapping[str, Iterable[str]]) -> Iterator[set[str]]:
    """Yield the strongly connected components, by Tarjan's algorithm."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    open_: dict[str, None] = {}
    for root in needs:
        if root in number:
            continue
        todo: list[tuple[str, Iterator[str]]] = []

        def begin(name: str) -> None:
            number[name] = low[name] = len(number)
            open_[name] = None
            todo.append((name, iter(needs[name])))  # noqa: B023

        begin(root)
        while todo:
            name, left = todo[-1]
            for other in left:
                if other not in number:
                    begin(other)
                    break
                if other in open_:
                    low[name] = min(low[name], number[other])
            else:
                todo.pop()
                if todo:
                    above = todo[-1][0]
                    low[above] = min(low[above], low[name])
                if low[name] == number[name]:
                    members = set()
                    while name not in members:
                        members.add(open_.popitem()[0])
                    yield members


def block(group: Group, entries: Mapping[str, Variable], matched: Mapping[str, str]) -> Block:
    """Return the block of a group: its unknowns, and the other entries in their order."""
    implicit = [name for name in group.names if entries[name].section == ALGEBRAIC]
    of_unknown = {unknown: equation for equation, unknown in matched.items()}
    equations = {of_unknown[name]: None for name in implicit}
    read = {name: names(entries[name].expression.tree) for name in equations}
    solved: dict[str, tuple[str, float]] = {}  # unknowns by equations with a factor for them
    for name in implicit:
        if (entries[name].min, entries[name].max) != (None, None):
            continue  # the search respects them
        having = (other for other in equations if name in read[other])
        for equation in sorted(having, key=lambda other: other != name):
            factor = _factor(entries[equation].expression.tree, name, implicit)
            if factor:
                solved[name] = equation, factor
                del equations[equation]
                break
    unknowns = [name for name in implicit if name not in solved]
    given = solved | {name: (name, 0.0) for name in group.names if name not in implicit}
    own = [name for name in group.names if name in given]
    for name in group.names:
        guess = entries[name].guess
        inside = sorted(_read(guess.tree, entries) & {*group.names}) if guess else []
        if inside:
            raise ModelFileError(
                f"{entries[name].place}: {name}: start: {inside[0]} follows from {name}: expected "
                "names outside of its block"
            )
    while True:
        left = {
            name: sorted(
                other
                for other in _read(entries[given[name][0]].expression.tree, entries)
                if other in given and other not in unknowns
                and not (other == name and name in implicit)
            )
            for name in own
            if name not in unknowns
        }  # fmt: skip
        cycles = [
            members for members in _strong(left)
            if len(members) > 1 or next(iter(members)) in left[next(iter(members))]
        ]  # fmt: skip
        if not cycles:
            break
        for members in cycles:
            unknowns.append(_torn([n for n in own if n in members], left, entries))
    rest = [name for name in own if name not in unknowns]
    explicit = in_order(rest, read=lambda name: [n for n in left[name] if n in rest])
    torn = [given[name][0] for name in own if name in unknowns]
    return Block(
        [*group.names], unknowns, {name: given[name] for name in explicit}, [*equations, *torn]
    )


def _factor(tree: Node, unknown: str, unknowns: list[str]) -> float:
    """Return the number by which an equation has an unknown, for which it can be solved then.

    0 where it has it otherwise, or another unknown by a larger number: to solve it for the smaller
    one would let errors grow.
    """
    factors: dict[str, float] = {}
    todo, sign = [(tree, 1.0)], {"+": 1.0, "-": -1.0}
    for node, of in todo:
        first, last = (*node.arguments, node, node)[:2]
        if node.op in sign:
            todo += [(first, of), (last, of * sign[node.op])]
        elif node.op == "negative":
            todo.append((first, -of))
        elif node.op == "*" and first.op == "number":
            todo.append((last, of * first.value))
        elif node.op == "name" and node.name in unknowns:
            factors[node.name] = factors.get(node.name, 0.0) + of
        elif unknown in names(node):
            return 0.0
    own = factors.get(unknown, 0.0)
    return own if all(abs(own) >= abs(other) for other in factors.values()) else 0.0


def _torn(
    members: list[str], needs: Mapping[str, list[str]], entries: Mapping[str, Variable]
) -> str:
    """Choose the member of a cycle that becomes an unknown: one with a start, or of most paths."""
    uses = {name: sum(name in needs[other] for other in members) for name in members}
    real = [
        name for name in members
        if entries[name].is_real and entries[name].expression.tree.op not in CONDITIONS
    ]  # fmt: skip
    if not real:
        first = entries[members[0]]
        raise ModelFileError(
            f"{first.place}: {members[0]}: {', '.join(members)} follow from each other, and none "
            "is a real number"
        )

    def worth(name: str) -> tuple[bool, int]:
        return entries[name].guess is not None, uses[name] * len({*needs[name]} & {*members})

    return max(real, key=worth)
