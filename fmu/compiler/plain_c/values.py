"""Whole numbers, conditions and pointers of interpreted C: what is known of them where.

A whole number is an int, a table over an integer leaf, or a choice. What is known on a path through
the text resolves conditions: a mode that is 2 is not 3.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from ..graph.graph import Graph, Value, is_number

RELATION = {
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}
MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


@dataclass(frozen=True)
class Cases:
    """Results for all values of an integer leaf; None: the leaf itself, of unknown values."""

    leaf: Value
    results: tuple[tuple[int, Any], ...] | None


@dataclass(frozen=True)
class Choice:
    """The first where the condition holds, else the second."""

    condition: Value
    first: Any
    second: Any


@dataclass
class Known:
    """What holds on a path: conditions, possible values of integer leaves, and alternatives."""

    truths: dict[Value, bool] = field(default_factory=dict)
    sets: dict[Value, frozenset[int]] = field(default_factory=dict)
    clauses: tuple[Value, ...] = ()  # compound conditions that are known, but not their parts


class Conditions:
    """Makes conditions in a graph and resolves them; `spend` counts the steps of that."""

    def __init__(self, graph: Graph, spend: Callable[[], None] = lambda: None) -> None:
        self.graph, self.spend = graph, spend
        self.decided = partial(graph.value, "if")  # makes a choice of a condition that is not known
        self.members: dict[Value, tuple[Value, frozenset[int]]] = {}  # where a leaf is one of these
        self.domains: dict[Value, frozenset[int]] = {}
        self.true, self.false = graph.number(1.0), graph.number(0.0)

    def leaf(self, name: str, domain: tuple[int, ...] | None) -> Cases:
        """Return a whole number from outside."""
        leaf = self.graph.value("integer", name=name)
        if domain is None:
            return Cases(leaf, None)
        self.domains[leaf] = frozenset(domain)
        return Cases(leaf, tuple((value, value) for value in domain))

    # ---- Conditions ------------------------------------------------------------------------------

    def constant(self, value: bool) -> Value:
        return self.true if value else self.false

    def no(self, condition: Value) -> Value:
        """Return not condition."""
        if condition.op == "number":
            return self.constant(not condition.number)
        if condition.op == "not":
            return condition.arguments[0]
        return self.graph.value("not", condition)

    def both(self, first: Value, second: Value) -> Value:
        """Return first and second; of one leaf it is one condition."""
        if is_number(first, 0.0) or is_number(second, 0.0):
            return self.false
        if first.op == "number" or first is second:
            return second
        if second.op == "number":
            return first
        one, other = self._membership(first), self._membership(second)
        if one and other and one[0] is other[0]:
            return self.member(one[0], one[1] & other[1])
        return self.graph.value("and", first, second)

    def either(self, first: Value, second: Value) -> Value:
        """Return first or second."""
        if first.op != "number" and second.op != "number" and first is not second:
            one, other = self._membership(first), self._membership(second)
            if not (one and other and one[0] is other[0]):
                return self.graph.value("or", first, second)
            return self.member(one[0], one[1] | other[1])
        return self.no(self.both(self.no(first), self.no(second)))

    def _membership(self, condition: Value) -> tuple[Value, frozenset[int]] | None:
        """Return the leaf of a condition, and the values where it holds."""
        if condition.op == "not":
            inner = self._membership(condition.arguments[0])
            return inner and (inner[0], self.domains[inner[0]] - inner[1])
        return self.members.get(condition)

    def member(self, leaf: Value, values: frozenset[int], known: Known | None = None) -> Value:
        """Return whether a leaf is one of these values, in the shortest form."""
        possible = known.sets.get(leaf) if known else None
        possible = self.domains[leaf] if possible is None else possible
        inside, outside = values & possible, possible - values
        if not inside or not outside:
            return self.constant(bool(inside))
        if len(inside) == 1:
            return self._compare("==", leaf, *inside)
        if len(outside) == 1:
            return self.no(self._compare("==", leaf, *outside))
        if max(outside) < min(inside):
            return self._compare(">=", leaf, min(inside))
        if max(inside) < min(outside):
            return self._compare("<=", leaf, max(inside))
        if len(inside) > len(outside):
            return self.no(self._one_of(leaf, outside))
        return self._one_of(leaf, inside)

    def _one_of(self, leaf: Value, values: frozenset[int]) -> Value:
        parts = [self._compare("==", leaf, value) for value in sorted(values)]
        result = parts[0]
        for part in parts[1:]:
            result = self.graph.value("or", result, part)
        self.members[result] = (leaf, values)
        return result

    def _compare(self, op: str, leaf: Value, number: int) -> Value:
        condition = self.graph.value(op, leaf, self.graph.number(float(number)))
        self.learn([condition])
        return condition

    def learn(self, values: Iterable[Value]) -> None:
        """Note which conditions hold where a leaf is one of some values."""
        for value in values:
            if value.op in RELATION:
                (leaf, number), op = value.arguments, value.op
                if leaf.op == "number":
                    leaf, number, op = number, leaf, MIRRORED[op]
                if leaf in self.domains and number.op == "number":
                    holds = (v for v in self.domains[leaf] if RELATION[op](v, number.number))
                    self.members[value] = leaf, frozenset(holds)
            elif value.op in ("and", "or"):
                one, other = map(self._membership, value.arguments)
                if one and other and one[0] is other[0]:
                    holds = one[1] & other[1] if value.op == "and" else one[1] | other[1]
                    self.members[value] = one[0], holds

    # ---- What is known ---------------------------------------------------------------------------

    def resolve(self, condition: Value, known: Known) -> Value:
        """Return the condition, or a constant if it is known."""
        truth = self._truth(condition, known)
        return condition if truth is None else self.constant(truth)

    def _truth(
        self, condition: Value, known: Known, found: dict[Value, bool | None] | None = None
    ) -> bool | None:
        """Return whether a condition holds; `found`: what is known of others in this state."""
        self.spend()
        truth = self._noted(condition, known)
        is_compound = condition.op in ("not", "and", "or") and condition not in self.members
        if truth is not None or not is_compound:
            return truth
        found = {} if found is None else found
        if condition in found:
            return found[condition]
        parts = [self._truth(part, known, found) for part in condition.arguments]
        decides = condition.op == "or"
        if condition.op == "not":
            truth = None if parts[0] is None else not parts[0]
        elif decides in parts:
            truth = decides
        else:
            truth = None if None in parts else not decides
        found[condition] = truth
        return truth

    def _noted(self, condition: Value, known: Known) -> bool | None:
        """Return whether a condition holds, if that is known without its parts."""
        if condition.op == "number":
            return condition.number != 0.0
        if condition in known.truths:
            return known.truths[condition]
        if condition not in self.members:
            return None
        leaf, holds = self.members[condition]
        possible = known.sets.get(leaf, self.domains[leaf])
        if possible <= holds:
            return True
        return False if not possible & holds else None

    def assume(self, condition: Value, holds: bool, known: Known) -> Known | None:
        """Return the knowledge where the condition holds, or does not; None: nowhere."""
        found = Known(dict(known.truths), dict(known.sets), known.clauses)
        left: list[tuple[Value, bool]] | None = [(condition, holds)]
        while left:
            if not all(self._note(*each, found) for each in left):
                return None
            left = self._concluded(found)
        return None if left is None else found

    def _note(self, condition: Value, holds: bool, known: Known) -> bool:
        """Note that a condition holds, or does not; return whether that may be."""
        self.spend()
        truth = self._noted(condition, known)
        if truth is not None:
            return truth is holds
        if condition.op == "not":
            return self._note(condition.arguments[0], not holds, known)
        known.truths[condition] = holds
        if condition in self.members:
            leaf, inside = self.members[condition]
            possible = known.sets.get(leaf, self.domains[leaf])
            known.sets[leaf] = possible & inside if holds else possible - inside
        elif condition.op in ("and", "or"):
            if holds is (condition.op == "and"):
                return all(self._note(part, holds, known) for part in condition.arguments)
            known.clauses += (condition,)
        elif condition.op == "==" and condition.arguments[0].op == "integer" and holds:
            known.sets[condition.arguments[0]] = frozenset([int(condition.arguments[1].number)])
        return True

    def _concluded(self, known: Known) -> list[tuple[Value, bool]] | None:
        """Return what follows from alternatives whose other parts are known; None: none is left."""
        found: dict[Value, bool | None] = {}
        follows, clauses = [], []
        for clause in known.clauses:
            decided = clause.op == "or"  # a part with this truth satisfies the clause
            truths = [self._truth(part, known, found) for part in clause.arguments]
            if decided in truths:
                continue
            clauses.append(clause)
            left = [p for p, truth in zip(clause.arguments, truths, strict=True) if truth is None]
            if not left:
                return None
            if len(left) == 1:
                follows.append((left[0], decided))
        known.clauses = tuple(clauses)
        return follows

    # ---- Whole numbers ---------------------------------------------------------------------------

    def simplified(self, value: Any, known: Known) -> Any:
        """Simplify a whole number or a pointer by the knowledge."""
        self.spend()
        while isinstance(value, Choice):
            condition = self.resolve(value.condition, known)
            if condition.op != "number":
                return value
            value = value.first if condition.number else value.second
        if isinstance(value, Cases):
            possible = known.sets.get(value.leaf)
            if value.results is None:
                return next(iter(possible)) if possible and len(possible) == 1 else value
            results = value.results
            if possible is not None:
                results = tuple(pair for pair in results if pair[0] in possible)
            if len({result for _, result in results}) == 1:
                return results[0][1]
            return Cases(value.leaf, results)
        return value

    def choice(self, condition: Value, first: Any, second: Any) -> Any:
        """Return a choice between two whole numbers or pointers."""
        if condition.op == "number":
            return first if condition.number else second
        if condition.op == "not":
            return self.choice(condition.arguments[0], second, first)
        return first if first == second else Choice(condition, first, second)

    def each(self, function: Callable[[Any, Known], Any], value: Any, known: Known) -> Any:
        """Apply a function to each number or pointer that a value may be."""
        value = self.simplified(value, known)
        if isinstance(value, Cases) and value.results is not None:
            results = tuple((at, function(result, known)) for at, result in value.results)
            if all(isinstance(result, int) for _, result in results):
                return self.simplified(Cases(value.leaf, results), known)
            value = self.as_choice(Cases(value.leaf, results), known)
            return value
        if isinstance(value, Choice):
            yes = self.assume(value.condition, True, known)
            no = self.assume(value.condition, False, known)
            if yes is None or no is None:
                return self.each(function, value.second if yes is None else value.first, known)
            return self.choice(
                value.condition,
                self.each(function, value.first, yes),
                self.each(function, value.second, no),
            )
        return function(value, known)

    def as_choice(self, table: Cases, known: Known) -> Any:
        """Turn a table into choices between its results."""
        groups: dict[Any, set[int]] = {}
        for at, result in table.results or ():
            groups.setdefault(result, set()).add(at)
        left = list(groups.items())
        value = left[-1][0]
        for result, ats in left[-2::-1]:
            value = self.choice(self.member(table.leaf, frozenset(ats), known), result, value)
        return value

    def truth(self, value: Any, known: Known) -> Value:
        """Return the condition that a whole number is not 0."""
        value = self.simplified(value, known)
        if isinstance(value, Cases):
            if value.results is None:
                return self.resolve(self.no(self._compare("==", value.leaf, 0)), known)
            holds = frozenset(at for at, result in value.results if result)
            return self.resolve(self.member(value.leaf, holds, known), known)
        if isinstance(value, Choice):
            c = value.condition
            yes, no = self.assume(c, True, known), self.assume(c, False, known)
            first = self.truth(value.first, yes) if yes else self.false
            second = self.truth(value.second, no) if no else self.false
            if first.op == "number":
                return self.either(c, second) if first.number else self.both(self.no(c), second)
            if second.op == "number":
                return self.either(self.no(c), first) if second.number else self.both(c, first)
            return self.either(self.both(c, first), self.both(self.no(c), second))
        return self.constant(bool(value))

    def compare(self, op: str, left: Any, right: Any, known: Known) -> Any:
        """Compare two whole numbers; return 1 or 0 as a whole number."""
        left, right = self.simplified(left, known), self.simplified(right, known)
        if isinstance(right, Cases) and isinstance(left, int):
            op, left, right = MIRRORED[op], right, left
        if isinstance(left, Cases) and left.results is None and isinstance(right, int):
            negated = op == "!="
            condition = self._compare("==" if negated else op, left.leaf, right)
            condition = self.resolve(condition, known)
            return self.choice(self.no(condition) if negated else condition, 1, 0)
        return self.binary(lambda a, b: int(RELATION[op](a, b)), left, right, known)

    def binary(
        self, function: Callable[[int, int], int], left: Any, right: Any, known: Known
    ) -> Any:
        """Apply a function to two whole numbers."""

        def of_left(a: Any, known: Known) -> Any:
            return self.each(lambda b, _: function(a, b), right, known)

        left = self.simplified(left, known)
        if isinstance(left, Cases) and not isinstance(self.simplified(right, known), int):
            left = self.as_choice(left, known)
        return self.each(of_left, left, known)

    def real(self, value: Any, known: Known) -> Value:
        """Convert a whole number to a real one."""
        value = self.simplified(value, known)
        if isinstance(value, Cases):
            if value.results is None or all(at == result for at, result in value.results):
                return value.leaf
            value = self.as_choice(value, known)
        if isinstance(value, Choice):
            first, second = self.real(value.first, known), self.real(value.second, known)
            return self.select(value.condition, first, second)
        return self.graph.number(float(value))

    def select(self, condition: Value, first: Value, second: Value) -> Value:
        """Choose between two real numbers."""
        if condition.op == "number":
            return first if condition.number else second
        if condition.op == "not":
            return self.select(condition.arguments[0], second, first)
        if first.op == "if" and first.arguments[0] is condition:
            first = first.arguments[1]
        if second.op == "if" and second.arguments[0] is condition:
            second = second.arguments[2]
        return first if first is second else self.decided(condition, first, second)
