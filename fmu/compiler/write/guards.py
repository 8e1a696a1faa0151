"""What a branch of a choice needs, and what several branches need.

What only one branch needs is calculated in this branch. A value that several branches use, and
nothing else, is calculated under what these have in common: friction where a joint slides, though
efforts, energies and loads read it under conditions of their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..expressions.expression import in_order
from ..graph.graph import CONDITIONS, Value, is_unknown
from ..plain_c.values import Conditions, Known

COSTS = {"+": 1, "-": 1, "*": 1, "negative": 0, "/": 5, "value_of": 0, "moving_as": 0, "if": 0}
COSTS |= {"entry": 1, "element": 2}
OF_FUNCTION = 20
MOST_CHOSEN = 4  # cost of both branches of ?:
WORTH_A_BRANCH = 8  # cost of what is not calculated then
MOST_LEVELS = 20  # of guards within each other
Path = tuple[tuple[Value, bool], ...]  # conditions that hold, or do not, from outside to inside


@dataclass(frozen=True)
class Need:
    """A value is needed where integer leaves have one of these values and the literals hold."""

    sets: tuple[tuple[Value, frozenset[int]], ...] = ()
    literals: Path = ()


def cost(value: Value) -> int:
    """Estimate how long an operation takes, in additions."""
    if not value.arguments or value.op in CONDITIONS:
        return 0
    return COSTS.get(value.op, OF_FUNCTION)


@dataclass(frozen=True)
class Plan:
    """Values that are calculated in the order of what they read, each in the branch of its path.

    choices: those with calculations in a branch; the others are `?:`.
    """

    roots: list[Value]
    order: list[Value]
    paths: Mapping[Value, Path]
    choices: list[Value]

    @classmethod
    def of(cls, roots: list[Value]) -> Plan:
        """Return the plan for values of a graph."""
        order = in_order(roots)
        found = paths(order, dict.fromkeys(roots, ()))
        return cls(roots, order, found, choices_in_blocks(order, found))


def with_guards(roots: Sequence[Value], conditions: Conditions) -> dict[Value, Value]:
    """Put values that only some cases need behind choices; map each to its successor."""
    order = in_order(roots)
    if not any(value.op == "if" for value in order):
        return {value: value for value in order}
    conditions.learn(order)
    return guarded(roots, conditions)


def choices_in_blocks(
    order: Iterable[Value],
    places: Mapping[Value, Path],
    cost_of: Callable[[Value], int] | None = None,
) -> list[Value]:
    """Return choices with calculations in a branch."""
    inside = costs_inside(order, places, cost_of or cost)
    return [
        value for value in order
        if value.op == "if" and not is_unknown(value)
        and inside[places[value], value.arguments[0]] > MOST_CHOSEN
    ]  # fmt: skip


def stripped(roots: Iterable[Value], conditions: Conditions) -> dict[Value, Value]:
    """Remove operations that differ in derivatives only; map each value to its successor."""
    found: dict[Value, Value] = {}
    for value in in_order(roots):
        if value.op in ("value_of", "moving_as"):
            found[value] = found[value.arguments[0]]
        else:
            found[value] = _with(value, [found[a] for a in value.arguments], conditions)
    return found


def _with(value: Value, arguments: list[Value], conditions: Conditions) -> Value:
    """Return the operation with other arguments."""
    if all(a is b for a, b in zip(value.arguments, arguments, strict=True)):
        return value
    graph = conditions.graph
    new = graph.value(value.op, *arguments, name=value.name, number=value.number)
    if value in conditions.members:
        conditions.members[new] = conditions.members[value]
    return new


def paths(order: Sequence[Value], roots: Mapping[Value, Path]) -> dict[Value, Path]:
    """Find the innermost branch that contains all uses of a value, from the roots' branches."""
    found = dict(roots)

    def use(value: Value, path: Path) -> None:
        found[value] = common(found[value], path) if value in found else path

    for value in order[::-1]:
        path = found.get(value)
        for argument, literal in uses(value) if path is not None else ():
            use(argument, (*path, literal) if literal else path)
    return found


def uses(value: Value) -> list[tuple[Value, tuple[Value, bool] | None]]:
    """Yield arguments, with the condition under which they are used."""
    if value.op != "if" or is_unknown(value):
        return [(argument, None) for argument in value.arguments]
    condition, first, second = value.arguments
    return [(condition, None), (first, (condition, True)), (second, (condition, False))]


def common(first: Path, second: Path) -> Path:
    """Return the common begin of two paths."""
    length = 0
    for a, b in zip(first, second, strict=False):
        if a[0] is not b[0] or a[1] is not b[1]:
            break
        length += 1
    return first[:length]


def known_on(path: Path, conditions: Conditions) -> Known:
    """Return the knowledge in a branch."""
    known = Known()
    for condition, holds in path:
        known = conditions.assume(condition, holds, known) or known
    return known


def costs_inside(
    values: Iterable[Value], places: Mapping[Value, Path], cost_of: Callable[[Value], int]
) -> Counter[tuple[Path, Value]]:
    """Return the cost of both branches of each condition, by its place."""
    found: Counter[tuple[Path, Value]] = Counter()
    for value in values:
        path = places[value]
        for i in range(len(path)):
            found[path[:i], path[i][0]] += cost_of(value)
    return found


def guarded(roots: Sequence[Value], conditions: Conditions) -> dict[Value, Value]:
    """Put values that only some cases need behind choices; map each to its successor."""
    became = {value: value for value in in_order(roots)}
    for _ in range(MOST_LEVELS):
        guards = Guards([became[root] for root in roots], conditions)
        if not guards.found:
            break
        found = guards.rewritten()
        became = {value: found[now] for value, now in became.items() if now in found}
    found = settled([became[root] for root in roots], conditions)
    return {value: found[now] for value, now in became.items() if now in found}


def settled(roots: Sequence[Value], conditions: Conditions) -> dict[Value, Value]:
    """Remove choices that the blocks around them have made; map each value to its successor."""
    places = paths(in_order(roots), dict.fromkeys(roots, ()))
    found: dict[Value, Value] = {}
    for value in in_order(roots):
        now = _with(value, [found[a] for a in value.arguments], conditions)
        if value.op == "if" and places[value]:
            known = known_on(places[value], conditions)
            choice = conditions.resolve(value.arguments[0], known)
            if choice.op == "number":
                now = now.arguments[1 if choice.number else 2]
        found[value] = now
    return found


class Guards:
    """The guards of values that are needed in some cases only: conditions that stand outermost."""

    def __init__(self, roots: Sequence[Value], conditions: Conditions) -> None:
        self.conditions = conditions
        self.order = in_order(roots)
        self.paths = paths(self.order, dict.fromkeys(roots, ()))
        self.needs: dict[Value, Need] = dict.fromkeys(roots, Need())
        for value in self.order[::-1]:
            need = self.needs[value]
            for argument, literal in uses(value):
                new = self._and(need, *literal) if literal else need
                known = self.needs.get(argument)
                self.needs[argument] = new if known is None else self._either(known, new)
        self.found = self._guards()

    def rewritten(self) -> dict[Value, Value]:
        """Put guards into the roots; map each value to its successor."""
        zero = self.conditions.graph.number(0.0)
        guards = self.found
        found: dict[Value, Value] = {}
        for value in self.order:
            arguments = []
            for argument, literal in uses(value):
                new, guard = found[argument], guards.get(argument)
                if guard is not None and not self._is_inside(value, argument, literal, guards):
                    new = self.conditions.select(guard, new, zero)
                arguments.append(new)
            found[value] = _with(value, arguments, self.conditions)
        return found

    def _is_inside(
        self,
        user: Value,
        value: Value,
        literal: tuple[Value, bool] | None,
        guards: Mapping[Value, Value],
    ) -> bool:
        """Return whether a use of a value is behind the same guard."""
        guard, path = guards[value], self.paths[value]
        if guards.get(user) is guard and self.paths[user] == path:
            return literal is None
        of_use = (*self.paths[user], literal) if literal else self.paths[user]
        if len(of_use) <= len(path):
            return False
        condition, holds = of_use[len(path)]
        return guard is (condition if holds else self.conditions.no(condition))

    def _guards(self) -> dict[Value, Value]:
        """Return conditions that are stronger than the uses' and worth a branch."""
        found: dict[Value, Value] = {}
        costs: Counter[tuple[Path, Value]] = Counter()
        inside = costs_inside(self.order, self.paths, cost)
        for value in self.order:
            if cost(value) == 0 and value.op != "if":
                continue
            guard = self._condition(self.needs[value], known_on(self.paths[value], self.conditions))
            has_it = value.op == "if" and value.arguments[0] in (guard, self.conditions.no(guard))
            if guard.op != "number" and not has_it:
                found[value] = guard
                path = self.paths[value]
                own = inside[path, value.arguments[0]] if value.op == "if" else cost(value)
                costs[path, guard] += own
        worth = [v for v, guard in found.items() if costs[self.paths[v], guard] >= WORTH_A_BRANCH]
        depth = min((len(self.paths[value]) for value in worth), default=0)
        return {value: found[value] for value in worth if len(self.paths[value]) == depth}

    def _condition(self, need: Need, known: Known) -> Value:
        """Turn a need into a condition, where some is known already."""
        result = self.conditions.true
        for leaf, values in need.sets:
            member = self.conditions.member(leaf, values, known)
            result = self.conditions.both(result, self.conditions.resolve(member, known))
        for condition, holds in need.literals:
            literal = condition if holds else self.conditions.no(condition)
            result = self.conditions.both(result, self.conditions.resolve(literal, known))
        return result

    def _and(self, need: Need, condition: Value, holds: bool) -> Need:
        """Add a condition to a need."""
        if condition.op == "not":
            return self._and(need, condition.arguments[0], not holds)
        if condition in self.conditions.members:
            leaf, inside = self.conditions.members[condition]
            domain = self.conditions.domains[leaf]
            sets = dict(need.sets)
            sets[leaf] = sets.get(leaf, domain) & (inside if holds else domain - inside)
            return Need(tuple(sets.items()), need.literals)
        if condition.op in ("and", "or") and holds is (condition.op == "and"):
            for part in condition.arguments:
                need = self._and(need, part, holds)
            return need
        new = (condition, holds)
        return need if new in need.literals else Need(need.sets, (*need.literals, new))

    def _either(self, first: Need, second: Need) -> Need:
        """Return the common part of two needs."""
        other = dict(second.sets)
        sets = []
        for leaf, values in first.sets:
            union = values | other.get(leaf, self.conditions.domains[leaf])
            if union != self.conditions.domains[leaf]:
                sets.append((leaf, union))
        literals = tuple(literal for literal in first.literals if literal in second.literals)
        return Need(tuple(sets), literals)
