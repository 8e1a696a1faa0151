"""What a branch of a choice needs, and what several branches need.

What only one branch needs is calculated in this branch. A value that several branches use, and
nothing else, is calculated under what these have in common: friction where a joint slides, though
efforts, energies and loads read it under conditions of their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_

from ..expressions.expression import in_order
from ..graph.algebraic import SEVERAL
from ..graph.graph import CONDITIONS, Value, is_unknown
from ..plain_c.values import Conditions, Known

COSTS = {"+": 1, "-": 1, "*": 1, "negative": 0, "/": 5, "value_of": 0, "moving_as": 0, "if": 0}
COSTS |= {"entry": 1, "element": 2, "component": 60} | dict.fromkeys(SEVERAL, 0)
OF_FUNCTION = 20
MOST_CHOSEN = 4  # cost of both branches of ?:
WORTH_A_BRANCH = 8  # cost of what is not calculated then
MOST_CASES = 2**14  # of integer leaves together
OF_CASES = {"and": and_, "or": or_}
MOST_LEVELS = 20  # of guards within each other
CostOf = Callable[[Value], int]
Path = tuple[tuple[Value, bool], ...]  # conditions that hold, or do not, from outside to inside


@dataclass(frozen=True)
class Need:
    """A value is needed in these cases, if the literals hold."""

    cases: int
    literals: Path = ()


class Space:
    """What integer leaves may be together: a set of such cases has bits in a whole number."""

    def __init__(self, order: Iterable[Value], conditions: Conditions) -> None:
        self.conditions, count = conditions, 1
        strides: dict[Value, int] = {}
        for leaf in order:
            size = len(conditions.domains.get(leaf, ()))
            if size and count * size <= MOST_CASES:
                strides[leaf] = count
                count *= size
        self.all = (1 << count) - 1
        self.where: dict[Value, dict[int, int]] = {}
        for leaf, stride in strides.items():
            numbers = sorted(conditions.domains[leaf])
            period, ones = len(numbers) * stride, (1 << stride) - 1
            each = sum(1 << start for start in range(0, count, period))
            self.where[leaf] = {x: (ones << i * stride) * each for i, x in enumerate(numbers)}
        self.found: dict[Value, int | None] = {}

    def cases(self, condition: Value) -> int | None:
        """Return where a condition holds; None if other values decide, too."""
        if condition not in self.found:
            self.found[condition] = self._cases(condition)
        return self.found[condition]

    def _cases(self, condition: Value) -> int | None:
        leaf, numbers = self.conditions.members.get(condition, (None, ()))
        if leaf in self.where:
            return reduce(or_, (self.where[leaf][x] for x in numbers), 0)
        if condition.op not in ("not", "and", "or"):
            return None
        parts = [self.cases(part) for part in condition.arguments]
        if None in parts:
            return None
        return self.all ^ parts[0] if condition.op == "not" else OF_CASES[condition.op](*parts)

    def left(self, cases: int) -> Iterator[tuple[Value, frozenset[int]]]:
        """Yield leaves, and what they may be."""
        for leaf, where in self.where.items():
            yield leaf, frozenset(x for x, of_number in where.items() if cases & of_number)


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


def with_guards(
    roots: Sequence[Value], conditions: Conditions, cost_of: CostOf | None = None
) -> dict[Value, Value]:
    """Put values that only some cases need behind choices; map each to its successor."""
    order = in_order(roots)
    if not any(value.op == "if" for value in order):
        return {value: value for value in order}
    conditions.learn(order)
    return guarded(roots, conditions, cost_of or cost)


def choices_in_blocks(
    order: Iterable[Value], places: Mapping[Value, Path], cost_of: CostOf | None = None
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


def known_on(path: Path, conditions: Conditions, found: dict[Path, Known]) -> Known:
    """Return the knowledge in a branch; `found`: of those that were asked for before."""
    if path in found:
        return found[path]
    known = found.setdefault((), Known())
    for i, literal in enumerate(path, 1):
        if path[:i] not in found:
            found[path[:i]] = conditions.assume(*literal, known) or known
        known = found[path[:i]]
    return known


def costs_inside(
    values: Iterable[Value], places: Mapping[Value, Path], cost_of: CostOf
) -> Counter[tuple[Path, Value]]:
    """Return the cost of both branches of each condition, by its place."""
    found: Counter[tuple[Path, Value]] = Counter()
    for value in values:
        path = places[value]
        for i in range(len(path)):
            found[path[:i], path[i][0]] += cost_of(value)
    return found


def guarded(roots: Sequence[Value], conditions: Conditions, cost_of: CostOf) -> dict[Value, Value]:
    """Put values that only some cases need behind choices; map each to its successor."""
    became = {value: value for value in in_order(roots)}
    for _ in range(MOST_LEVELS):
        guards = Guards([became[root] for root in roots], conditions, cost_of)
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
    knowledge: dict[Path, Known] = {}
    for value in in_order(roots):
        now = _with(value, [found[a] for a in value.arguments], conditions)
        if value.op == "if" and places[value]:
            known = known_on(places[value], conditions, knowledge)
            choice = conditions.resolve(value.arguments[0], known)
            if choice.op == "number":
                now = now.arguments[1 if choice.number else 2]
        found[value] = now
    return found


class Guards:
    """The guards of values that are needed in some cases only: conditions that stand outermost."""

    def __init__(self, roots: Sequence[Value], conditions: Conditions, cost_of: CostOf) -> None:
        self.conditions, self.cost_of = conditions, cost_of
        self.order = in_order(roots)
        self.paths = paths(self.order, dict.fromkeys(roots, ()))
        self.space = Space(self.order, conditions)
        self.needs: dict[Value, Need] = dict.fromkeys(roots, Need(self.space.all))
        choosing = dict.fromkeys(v.arguments[0] for v in self.order if v.op == "if")
        known = [(c, self.space.cases(c)) for c in choosing]
        known = [(condition, cases) for condition, cases in known if cases is not None]
        self.of_cases = [((condition, True), cases) for condition, cases in known]
        self.of_cases += [
            ((condition, False), self.space.all ^ cases) for condition, cases in known
        ]
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
                is_alike = guards.get(value) is guard and self.paths[value] == self.paths[argument]
                if guard is not None and (literal or not is_alike):
                    new = self.conditions.select(guard, new, zero)
                arguments.append(new)
            found[value] = _with(value, arguments, self.conditions)
        return found

    def _guards(self) -> dict[Value, Value]:
        """Return conditions that are stronger than the uses' and worth a branch."""
        found: dict[Value, Value] = {}
        knowledge: dict[Path, Known] = {}
        costs: Counter[tuple[Path, Value]] = Counter()
        inside = costs_inside(self.order, self.paths, self.cost_of)
        for value in self.order:
            if self.cost_of(value) == 0 and value.op != "if":
                continue
            known = known_on(self.paths[value], self.conditions, knowledge)
            guard = self._condition(self.needs[value], known)
            has_it = value.op == "if" and value.arguments[0] in (guard, self.conditions.no(guard))
            if guard.op != "number" and not has_it:
                found[value] = guard
                path = self.paths[value]
                own = inside[path, value.arguments[0]] if value.op == "if" else self.cost_of(value)
                costs[path, guard] += own
        worth = [v for v, guard in found.items() if costs[self.paths[v], guard] >= WORTH_A_BRANCH]
        depth = min((len(self.paths[value]) for value in worth), default=0)
        return {value: found[value] for value in worth if len(self.paths[value]) == depth}

    def _condition(self, need: Need, known: Known) -> Value:
        """Turn a need into a condition, where some is known already."""
        result, left = self.conditions.true, self.space.all
        for leaf, values in self.space.left(need.cases):
            left &= reduce(or_, (self.space.where[leaf][x] for x in values), 0)
            member = self.conditions.member(leaf, values, known)
            result = self.conditions.both(result, self.conditions.resolve(member, known))
        literals = [*need.literals]
        for literal, cases in self.of_cases:
            if not need.cases & ~cases and left & ~cases:
                left &= cases
                literals.append(literal)
        for condition, holds in literals:
            literal = condition if holds else self.conditions.no(condition)
            result = self.conditions.both(result, self.conditions.resolve(literal, known))
        return result

    def _and(self, need: Need, condition: Value, holds: bool) -> Need:
        """Add a condition to a need."""
        if condition.op == "not":
            return self._and(need, condition.arguments[0], not holds)
        cases = self.space.cases(condition)
        if cases is not None:
            return Need(need.cases & (cases if holds else self.space.all ^ cases), need.literals)
        if condition.op in ("and", "or"):
            decides = condition.op == "or"  # a part with this truth
            if holds is not decides:
                for part in condition.arguments:
                    need = self._and(need, part, holds)
                return need
            left = [part for part in condition.arguments if not self._is(need, part, not decides)]
            if len(left) == 1:
                return self._and(need, left[0], holds)
        new = (condition, holds)
        return need if new in need.literals else Need(need.cases, (*need.literals, new))

    def _is(self, need: Need, condition: Value, holds: bool) -> bool:
        """Return whether a condition holds, or does not, in all cases of a need."""
        cases = self.space.cases(condition)
        if cases is None:
            return (condition, holds) in need.literals
        return not need.cases & (self.space.all ^ cases if holds else cases)

    def _either(self, first: Need, second: Need) -> Need:
        """Return the common part of two needs."""
        literals = tuple(literal for literal in first.literals if literal in second.literals)
        return Need(first.cases | second.cases, literals)
