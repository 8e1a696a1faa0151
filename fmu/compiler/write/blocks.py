"""Values of a graph as statements with `if` blocks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..expressions.expression import in_order
from ..graph.graph import CONDITIONS, Value
from ..plain_c.values import RELATION, Conditions
from .guards import Path, costs_inside, guarded, paths, stripped
from .loops import printed
from .statements import Block, Constant, Item, Operand, Place, Statement, store

MOST_CHOSEN = 2  # cost of both branches of ?:


class Scope:
    """Operands of known values in a block and around it; the block is for values `wanted`."""

    def __init__(self, path: Path, wanted: set[Value], outer: Scope | None = None) -> None:
        self.path, self.wanted, self.outer = path, wanted, outer
        self.known: dict[Value, Operand] = {}
        self.shared: set[Value] = set()  # which a later block with this condition reads, too
        self.items: list[Item] = []

    def find(self, value: Value) -> Operand | None:
        scope: Scope | None = self
        while scope is not None:
            if value in scope.known:
                return scope.known[value]
            scope = scope.outer
        return None


class Blocks:
    """Statements that give lvalues of C (`targets`) values; `enumerators` name whole numbers."""

    def __init__(
        self,
        targets: Mapping[str, Value],
        names: Mapping[Value, str],
        conditions: Conditions,
        enumerators: Mapping[str, Mapping[int, str]],
        taken: Iterable[str] = (),
    ) -> None:
        self.enumerators, self.taken = enumerators, taken
        targets, plain = stripped(targets, conditions)
        targets, became = guarded(targets, conditions)
        self.names: dict[Value, str] = {}
        for value, name in names.items():
            if plain.get(value) in became:
                self.names.setdefault(became[plain[value]], name)
        self.targets = targets
        self.order = in_order(targets.values())
        self.leaves = {
            value: Place(
                value.name, name="" if value.op == "integer" else self.names.get(value, "")
            )
            for value in self.order
        }
        self.paths = paths(targets)
        inside = costs_inside(self.order, self.paths)
        self.blocks = {  # choices with calculations in a branch; the others are `?:`
            value: None for value in self.order
            if value.op == "if" and inside[self.paths[value], value.arguments[0]] > MOST_CHOSEN
        }  # fmt: skip
        self.bits = {value: 1 << i for i, value in enumerate(self.blocks)}
        self.depends: dict[Value, int] = {}  # on values of blocks, as bits
        for value in self.order:
            mask = 0
            for argument in value.arguments:
                mask |= self.depends[argument] | self.bits.get(argument, 0)
            self.depends[value] = mask
        self.in_progress = 0

    def lines(self) -> list[str]:
        """Return the statements."""
        scope = Scope((), set(self.order))
        for target, value in self.targets.items():
            scope.items.append(store(Place(target, name=target), self.of(value, scope)))
        return printed(scope.items, taken=self.taken, is_long=False)[0]

    def of(self, value: Value, scope: Scope) -> Operand:
        """Return the operand of a value in a block, after statements that it needs."""
        found = scope.find(value)
        if found is not None:
            return found
        if not value.arguments:
            return value.number if value.op == "number" else self.leaves[value]
        while len(scope.path) > len(self.paths[value]) and scope.outer is not None:
            scope = scope.outer  # it was forgotten before the block began
        if value in self.blocks:
            self._block(value, scope)
            return self.of(value, scope)
        operation = self._operation(value, scope)
        if value.op in CONDITIONS:
            return operation
        if value in scope.shared and scope.outer is not None:
            variable = self._variable(value, scope.outer, 0.0)
            scope.items.append(store(variable, operation))
            return variable
        scope.known[value] = Constant(operation, name=self._name(value))
        scope.items.append(scope.known[value])
        return scope.known[value]

    def _operation(self, value: Value, scope: Scope) -> Operand:
        given = [self.of(argument, scope) for argument in value.arguments]
        leaf = value.arguments[0]
        if leaf.op == "integer" and value.op in RELATION:  # with a whole number
            number = int(value.arguments[1].number)
            return value.op, given[0], str(self.enumerators.get(leaf.name, {}).get(number, number))
        for i, argument in enumerate(value.arguments):
            if argument.op == "integer":
                given[i] = Place(f"(double){argument.name}")
        return value.op, *given

    def _name(self, value: Value) -> str:
        """Return the name of a value or, of a choice, of what it chooses."""
        values = [value, *(value.arguments[1:] if value.op == "if" else ())]
        return next((self.names[v] for v in values if v in self.names), "")

    def _variable(self, value: Value, scope: Scope, start: float | None) -> Constant:
        """Declare a value in front of the block that calculates it."""
        variable = scope.known[value] = Constant(None, name=self._name(value), is_kept=True)
        first = (";",) if start is None else (" = ", start, ";")
        scope.items.append(Statement(("double ", variable, *first)))
        return variable

    # ---- Blocks ----------------------------------------------------------------------------------

    def _block(self, value: Value, scope: Scope) -> None:
        """Write the `if` that calculates a choice and all others that go with it."""
        condition, path = value.arguments[0], self.paths[value]
        group = [value]
        busy, below = self.in_progress | self.bits[value], self.depends[value]
        same = [
            other for other in self.blocks
            if other.arguments[0] is condition and self.paths[other] == path
            and other in scope.wanted and scope.find(other) is None
        ]  # fmt: skip
        for other in same:
            if (
                other is not value
                and not self.depends[other] & busy
                and not (self.in_progress | below) & self.bits[other]
            ):
                group.append(other)
                busy |= self.bits[other]
                below |= self.depends[other]
        before, self.in_progress = self.in_progress, busy
        for needed in self._needed(group, path):
            self.of(needed, scope)
        head = self.of(condition, scope)
        bodies = []
        for holds in (True, False):
            results = [member.arguments[1 if holds else 2] for member in group]
            inner = Scope((*path, (condition, holds)), set(), scope)
            inner.wanted = self._inside(results, len(inner.path))
            later = [other for other in same if scope.find(other) is None and other not in group]
            inner.shared = self._shared(later, inner, 1 if holds else 2)
            bodies.append((inner.items, [self.of(result, inner) for result in results]))
        if _are_numbers(*bodies[0]):
            head, bodies = ("not", head), bodies[::-1]
        self.in_progress = before
        has_starts = _are_numbers(*bodies[1])
        variables = []
        for member, start in zip(group, bodies[1][1], strict=True):
            is_shared = member in scope.shared and scope.outer is not None
            to = scope.outer if is_shared else scope
            first = 0.0 if is_shared else start if has_starts else None
            variables.append(self._variable(member, to, first))
            if is_shared and has_starts:
                scope.items.append(store(variables[-1], start))
        full = [
            [*items, *(store(to, of) for to, of in zip(variables, given, strict=True))]
            for items, given in bodies[: 1 if has_starts else 2]
        ]
        scope.items.append(Block(head, tuple(full)))

    def _inside(self, roots: list[Value], depth: int) -> set[Value]:
        """Return the values in a block that the roots follow from."""
        found: set[Value] = set()
        todo = list(roots)
        while todo:
            value = todo.pop()
            if value not in found and len(self.paths[value]) >= depth:
                found.add(value)
                todo += value.arguments
        return found

    def _shared(self, later: list[Value], scope: Scope, branch: int) -> set[Value]:
        """Return the values of a block that other choices of the same condition start from."""
        if not later:
            return set()
        depth = len(scope.path)
        results = [other.arguments[branch] for other in later]
        users = self._inside(results, depth) - scope.wanted
        read = {*results, *(argument for user in users for argument in user.arguments)}
        return {v for v in read & scope.wanted if self.paths[v] == scope.path and v.arguments}

    def _needed(self, group: list[Value], path: Path) -> list[Value]:
        """Return values that branches need and that are calculated before them, in this block."""
        members, seen, found = set(group), set(group), []
        todo = [a for value in group[::-1] for a in value.arguments[::-1]]
        while todo:
            value = todo.pop()
            if value in seen:
                continue
            seen.add(value)
            if len(self.paths[value]) > len(path):
                todo += value.arguments[::-1]
            elif self.paths[value] == path and value not in members and value.arguments:
                if value.op in CONDITIONS:
                    todo += value.arguments[::-1]
                else:
                    found.append(value)
        return found


def _are_numbers(items: list[Item], results: list[Operand]) -> bool:
    """Return whether a branch calculates nothing."""
    return not items and all(isinstance(result, float) for result in results)
