"""Choices of a graph as `if` blocks; what only one branch needs is calculated there."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

from ..expressions.expression import in_order
from ..graph.algebraic import SEVERAL
from ..graph.graph import CONDITIONS, Value
from ..plain_c.values import Conditions
from .guards import Path, Plan, stripped, with_guards
from .statements import Block, Constant, Item, Operand, store


class Writer:
    """What writes an operation: Code, or a series."""

    statements: list[Item]
    known: dict[Value, Operand]
    names: Mapping[Value, str]

    def read(self, value: Value) -> Sequence[Value]:
        """What is calculated before a value."""
        return value.arguments

    def beside(self, _value: Value) -> Sequence[Value]:
        """What is calculated wherever a value is, behind it."""
        return ()

    def operand(self, value: Value, given: Sequence[Operand], name: str = "") -> Operand:
        """Return the operand of an operation on others, after its statement."""
        raise NotImplementedError

    def chosen(self, value: Value, variable: Constant) -> None:
        """Write what follows the block of a choice."""


class Scope:
    """Operands of known values in a block and around it; the block is for values `wanted`."""

    def __init__(self, path: Path, wanted: set[Value], outer: Scope | None = None) -> None:
        self.path, self.wanted, self.outer = path, wanted, outer
        self.known: dict[Value, Operand] = {}
        self.shared: set[Value] = set()  # which a later block with this condition reads, too
        self.results: dict[Value, Constant] = {}  # choices, and variables outside that get them
        self.items: list[Item] = []

    def __contains__(self, value: Value) -> bool:
        return self.find(value) is not None

    def find(self, value: Value) -> Operand | None:
        scope: Scope | None = self
        while scope is not None:
            if value in scope.known:
                return scope.known[value]
            scope = scope.outer
        return None

    def around(self, path: Path) -> Scope:
        """Return the scope for a value with this path; this one may have begun too late for it."""
        scope = self
        while len(scope.path) > len(path) and scope.outer is not None:
            scope = scope.outer
        return scope


class Blocks:
    """Operands of values and statements that calculate them."""

    def __init__(
        self, writer: Writer, plan: Plan, successors: Mapping[Value, Value] | None = None
    ) -> None:
        self.writer, self.successors = writer, successors or {}
        self.names = {}
        for value, name in writer.names.items():
            self.names.setdefault(self.successors.get(value, value), name)
        self.roots, self.paths, self.blocks = plan.roots, plan.paths, plan.choices
        self.alike: dict[tuple[Value, Path], list[Value]] = defaultdict(list)
        for value in self.blocks:
            self.alike[value.arguments[0], self.paths[value]].append(value)
        self.bits = {value: 1 << i for i, value in enumerate(self.blocks)}
        self.users = Counter(x for value in (*plan.order, *plan.roots) for x in value.arguments)
        self.depends: dict[Value, int] = {}  # on values of blocks, as bits
        for value in plan.order if self.blocks else ():
            mask = 0
            for argument in writer.read(value):
                mask |= self.depends[argument] | self.bits.get(argument, 0)
            self.depends[value] = mask
        self.in_progress = 0
        self.done: set[Value] = set()  # choices that have been written
        self.partly: set[Value] = set()  # with a variable that has its value in one branch

    @classmethod
    def of_graph(cls, writer: Writer, roots: Sequence[Value], conditions: Conditions) -> Blocks:
        """Return the blocks for values, of which those that only some cases need get guards."""
        plain = stripped(roots, conditions)
        found = with_guards([plain[root] for root in roots], conditions)
        successors = {value: found[now] for value, now in plain.items() if now in found}
        return cls(writer, Plan.of([successors[root] for root in roots]), successors)

    def written(self) -> tuple[list[Operand], list[Item]]:
        """Return operands of the roots, and statements; the writer knows what is always valid."""
        scope = Scope((), set(in_order(self.roots, read=self.writer.read)))
        for value, operand in self.writer.known.items():
            scope.known[self.successors.get(value, value)] = operand
        found = [self._of(root, scope) for root in self.roots]
        for value, now in self.successors.items():
            if now in scope.known and now not in self.partly:
                self.writer.known[value] = scope.known[now]
        return found, scope.items

    def _of(self, value: Value, scope: Scope) -> Operand:
        """Return the operand of a value in a block, after statements that it needs."""
        if value not in scope:
            scope = scope.around(self.paths[value])
            for needed in in_order([value], scope, self._read):
                self._calculate(needed, scope.around(self.paths[needed]))
        return scope.find(value)

    def _read(self, value: Value) -> Sequence[Value]:
        """Return what is calculated before a value, in its block."""
        if value in self.blocks:
            return [value.arguments[0], *self._needed([value], self.paths[value])]
        return self.writer.read(value)

    def _calculate(self, value: Value, scope: Scope) -> None:
        if value in scope:  # with others
            return
        if value in self.blocks:
            self._block(value, scope)
            return
        given = [self._of(argument, scope) for argument in self.writer.read(value)]
        self.writer.statements = scope.items
        operand = self.writer.operand(value, given, self.names.get(value, ""))
        if value in scope.shared and scope.outer is not None:
            variable = self._variable(value)
            self._declare(value, variable, scope.outer, 0.0)
            scope.items.append(store(variable, operand))
            self.partly.add(value)
        else:
            scope.known[value] = operand
        for other in self.writer.beside(value):
            self._of(other, scope)

    def _name(self, value: Value) -> str:
        """Return the name of a value or, of a choice, of what it chooses."""
        values = [value, *(value.arguments[1:] if value.op == "if" else ())]
        return next((self.names[v] for v in values if v in self.names), "")

    def _variable(self, value: Value) -> Constant:
        return Constant(None, name=self._name(value), is_kept=True, is_variable=True)

    def _declare(self, value: Value, variable: Constant, scope: Scope, start: Operand) -> None:
        """Declare the variable of a value in front of the block that calculates it."""
        variable.of, scope.known[value] = start, variable
        scope.items.append(variable)

    # ---- Blocks ----------------------------------------------------------------------------------

    def _block(self, value: Value, scope: Scope) -> None:
        """Write the `if` that calculates a choice and all others that go with it."""
        condition, path = value.arguments[0], self.paths[value]
        group = [value]
        busy, below = self.in_progress | self.bits[value], self.depends[value]
        same = [v for v in self.alike[condition, path] if v not in self.done]
        for other in same:
            if (
                other is not value
                and other in scope.wanted
                and not self.depends[other] & busy
                and not (self.in_progress | below) & self.bits[other]
            ):
                group.append(other)
                busy |= self.bits[other]
                below |= self.depends[other]
        before, self.in_progress = self.in_progress, busy
        for needed in self._needed(group, path):
            self._of(needed, scope)
        head = self._of(condition, scope)
        later = [v for v in same if v not in group and v not in self.done]
        variables = [scope.results.get(v) or self._variable(v) for v in group]
        bodies = []
        for holds in (True, False):
            results = [member.arguments[1 if holds else 2] for member in group]
            inner = Scope((*path, (condition, holds)), set(), scope)
            inner.wanted = self._inside(results, len(inner.path))
            inner.shared = self._shared(later, inner, 1 if holds else 2)
            for result, variable in zip(results, variables, strict=True):
                is_own = self.users[result] == 1 and self.paths[result] == inner.path
                if is_own and result in self.bits and result not in inner.shared:
                    inner.results[result] = variable
            given = [self._of(result, inner) for result in results]
            bodies.append((inner.items, given))
        if _are_numbers(*bodies[0]):
            head, bodies = ("not", head), bodies[::-1]
        self.in_progress = before
        has_starts = _are_numbers(*bodies[1])
        for member, variable, start in zip(group, variables, bodies[1][1], strict=True):
            if member in scope.results:
                scope.known[member] = variable
                scope.items += [store(variable, start)] * has_starts
            elif member in scope.shared and scope.outer is not None:
                self._declare(member, variable, scope.outer, 0.0)
                self.partly.add(member)
                scope.items += [store(variable, start)] * has_starts
            else:
                self._declare(member, variable, scope, start if has_starts else None)
        self.done.update(group)
        full = [
            [*items, *(store(to, x) for to, x in zip(variables, given, strict=True) if to is not x)]
            for items, given in bodies[: 1 if has_starts else 2]
        ]
        scope.items.append(Block(head, tuple(full)))
        self.writer.statements = scope.items
        for member, variable in zip(group, variables, strict=True):
            self.writer.chosen(member, variable)

    def _inside(self, roots: list[Value], depth: int) -> set[Value]:
        """Return the values in a block that the roots follow from."""
        found: set[Value] = set()
        todo = list(roots)
        while todo:
            value = todo.pop()
            if value not in found and len(self.paths[value]) >= depth:
                found.add(value)
                todo += self.writer.read(value)
        return found

    def _shared(self, later: list[Value], scope: Scope, branch: int) -> set[Value]:
        """Return the values of a block that other choices of the same condition start from."""
        if not later:
            return set()
        depth = len(scope.path)
        results = [other.arguments[branch] for other in later]
        users = self._inside(results, depth) - scope.wanted
        read = {*results, *(argument for user in users for argument in user.arguments)}
        read -= {v for v in read if v.op in SEVERAL}
        return {v for v in read & scope.wanted if self.paths[v] == scope.path and v.arguments}

    def _needed(self, group: list[Value], path: Path) -> list[Value]:
        """Return values that branches need and that are calculated before them, in this block."""
        members, seen, found = set(group), set(group), []
        todo = [a for value in group[::-1] for a in self.writer.read(value)[::-1]]
        while todo:
            value = todo.pop()
            if value in seen:
                continue
            seen.add(value)
            if len(self.paths[value]) > len(path):
                todo += self.writer.read(value)[::-1]
            elif self.paths[value] == path and value not in members and value.arguments:
                if value.op in CONDITIONS:
                    todo += self.writer.read(value)[::-1]
                else:
                    found.append(value)
        return found


def _are_numbers(items: list[Item], results: list[Operand]) -> bool:
    """Return whether a branch calculates nothing."""
    return not items and all(isinstance(result, float) for result in results)
