"""Interprets functions of plain C symbolically: what they calculate, as values of a graph.

Statements run in their order. A condition that is not known splits the path: both branches run, and
where they meet, each variable becomes a choice. After a return in a branch the rest of the function
runs once for each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from pycparser import c_ast

from ..graph.graph import Value
from .expressions import Expressions
from .memory import UNSET, VOID, Array, LeafOf, Pointer, Scope, State, Structure
from .text import CTextError, check_function, refused, walk

CELLS = 16  # variables that are copied in a step


@dataclass(frozen=True)
class Todo:
    """A statement that is to run in a scope, and all after it up to the end of the function."""

    statement: c_ast.Node
    scope: Scope
    after: Todo | None
    is_round: bool = False  # of a loop that has begun


class Interpreter(Expressions):
    """Runs functions of a program."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.checked: set[str] = set()
        self.calls: list[str] = []

    # ---- Functions -------------------------------------------------------------------------------

    def run(self, name: str, leaf_of: LeafOf) -> tuple[Any, dict[tuple[str | int, ...], Any]]:
        """Run a function; return result and writes, by paths. `leaf_of` gives what it reads."""
        self.steps, self.here = 0, None
        try:
            return self._run(name, leaf_of)
        except RecursionError:
            place, reason = self.program.functions[name].decl, f"{name} is nested too deeply"
            raise refused(place, f"{reason}: use variables for parts of it") from None

    def _run(self, name: str, leaf_of: LeafOf) -> tuple[Any, dict[tuple[str | int, ...], Any]]:
        function = self.program.functions.get(name)
        if function is None:
            raise CTextError(f"{name} is not defined in {self.program.files[0].name}")
        state, arguments, roots = State(), [], {}
        for parameter, kind in self.parameters(function):
            if isinstance(kind, Pointer | Array):
                to = kind.to if isinstance(kind, Pointer) else kind
                address = self.new_object(to)
                self.inputs[address.object] = (parameter.name, leaf_of)
                roots[address.object] = self.titles[address.object] = parameter.name
                arguments.append(address + 0 if isinstance(to, Array) else address)
            elif isinstance(kind, Structure):
                raise refused(parameter, "pass a structure by a pointer to a function from outside")
            else:
                arguments.append(leaf_of((parameter.name,), kind))
        state, result = self.call(function, arguments, state, function)
        written = {
            (roots[address.object], *address.path): value
            for address, value in state.memory.items()
            if address.object in roots and address not in self.read
        }
        for path, value in written.items():
            if value is UNSET:
                place = ".".join(map(str, path))
                raise refused(function.decl, f"{name} does not write {place} on every path")
        for address in self.read & state.memory.keys():
            if address.object in roots and state.memory[address] != self._leaf(address):
                place = ".".join(map(str, (roots[address.object], *address.path)))
                raise refused(function.decl, f"{name} reads {place} before it writes it")
        return result, written

    def parameters(self, function: c_ast.FuncDef) -> list[tuple[c_ast.Decl, Any]]:
        """Return declarations of parameters, with their types."""
        listed = function.decl.type.args
        found = []
        for parameter in listed.params if listed else []:
            if isinstance(parameter, c_ast.EllipsisParam):
                raise refused(parameter, "... is not read: declare each argument")
            kind = self.types.of(parameter)
            if kind != VOID:
                found.append((parameter, kind))
        return found

    def call(
        self, function: c_ast.FuncDef, arguments: list[Any], state: State, place: c_ast.Node
    ) -> tuple[State, Any]:
        """Return the state after a call, and its result."""
        name = function.decl.name
        if name not in self.checked:
            check_function(function)
            self.checked.add(name)
        if name in self.calls:
            raise refused(place, f"{name} calls itself: write a loop with a fixed number of rounds")
        parameters = self.parameters(function)
        if len(parameters) != len(arguments):
            raise refused(place, f"{name} has {len(parameters)} arguments, not {len(arguments)}")
        scope = self.globals.new_child()
        first = len(self.objects)
        for (parameter, kind), argument in zip(parameters, arguments, strict=True):
            kind = Pointer(kind.of) if isinstance(kind, Array) else kind
            self.declare(scope, parameter.name, kind, argument, state)
        self.calls.append(name)
        state, result = self.execute(Todo(function.body, scope, None), state)
        self.calls.pop()
        kind = self.types.of(function.decl.type.type)
        if result is None and kind != VOID:
            raise refused(function.decl, f"{name} does not return a value on every path")
        local = [a for a in state.memory if a.object >= first]
        if len(self.calls) or local:
            state.memory = {a: v for a, v in state.memory.items() if a.object < first}
        return state, result

    # ---- Statements ------------------------------------------------------------------------------

    def execute(self, todo: Todo | None, state: State) -> tuple[State, Any]:
        """Run statements; return the state at the end, None if they all return, and the result."""
        self.spend(4 + len(state.memory) // CELLS)  # calls and branches copy the variables
        while todo is not None:
            node, scope, after = todo.statement, todo.scope, todo.after
            match node:
                case c_ast.Compound():
                    inner = scope.new_child()
                    for item in (node.block_items or [])[::-1]:
                        after = Todo(item, inner, after)
                case c_ast.DeclList():
                    for item in node.decls[::-1]:
                        after = Todo(item, scope, after)
                case c_ast.Decl():
                    self.declaration(node, scope, state)
                case c_ast.Return():
                    value = self.returned(node, scope, state)
                    return state, (value,) if value is not None else (UNSET,)
                case c_ast.If():
                    found = self.branch(node, scope, after, state)
                    if isinstance(found, tuple):
                        return found
                    after = found
                case c_ast.For():
                    after = self.loop(todo, state)
                case c_ast.EmptyStatement() | None:
                    pass
                case c_ast.StaticAssert() | c_ast.Pragma():
                    pass
                case _:
                    self.value(node, scope, state)
            todo = after
        return state, None

    def returned(self, node: c_ast.Return, scope: Scope, state: State) -> Any:
        function = self.program.functions[self.calls[-1]]
        kind = self.types.of(function.decl.type.type)
        if node.expr is None:
            if kind != VOID:
                raise refused(node, f"{function.decl.name} does not return a value here")
            return None
        return self.scalar(*self.value(node.expr, scope, state), kind, state, node.expr)

    def branch(
        self, node: c_ast.If, scope: Scope, after: Todo | None, state: State
    ) -> Todo | None | tuple[State, Any]:
        """Return the statements after an if, or the end of the function."""
        condition = self.condition(node.cond, scope, state)
        branches = [
            Todo(b, scope.new_child(), None) if b else None for b in (node.iftrue, node.iffalse)
        ]
        if condition.op == "number":
            chosen = branches[0 if condition.number else 1]
            return after if chosen is None else replace(chosen, after=after)
        returns = any(isinstance(n, c_ast.Return) for n in walk(node))
        ends = []
        for branch, holds in zip(branches, (True, False), strict=True):
            known = self.conditions.assume(condition, holds, state.known)
            if known is None:
                ends.append(None)
                continue
            path = State(dict(state.memory), known)
            if returns:
                branch = replace(branch, after=after) if branch else after
            ends.append(self.execute(branch, path))
        first, second = ends
        end = self.merged(condition, first, second) if first and second else first or second
        if returns:
            end[0].known = state.known
            return end
        state.memory = end[0].memory
        return after

    def merged(
        self, condition: Value, first: tuple[State, Any], second: tuple[State, Any]
    ) -> tuple[State, Any]:
        """Merge the ends of two paths."""
        choose = partial(self.chosen, condition)
        a, b = first[0].memory, second[0].memory
        memory = {
            address: value if value is b[address] else choose(value, b[address])
            for address, value in a.items()
            if address in b
        }
        for address in [*a, *b]:  # what one path has read of an argument stays as it is
            if address not in memory and address.object in self.inputs:
                mine = a.get(address, UNSET)
                other = b.get(address, UNSET)
                leaf = self._leaf(address) if address in self.read else UNSET
                one, two = (leaf if v is UNSET else v for v in (mine, other))
                if one is not UNSET and two is not UNSET:
                    memory[address] = one if one is two else choose(one, two)
                else:
                    memory[address] = UNSET
        results = (first[1], second[1])
        if None in results:
            result = results[0] or results[1]
            if results[0] is not results[1] and result != (UNSET,):
                result = None
        else:
            result = (choose(results[0][0], results[1][0]),)
        return State(memory, first[0].known), result

    def loop(self, todo: Todo, state: State) -> Todo | None:
        """Return the statements after the head of a loop."""
        node, scope = todo.statement, todo.scope
        if not todo.is_round:
            scope = scope.new_child()
            if node.init is not None:
                for item in getattr(node.init, "decls", [node.init]):
                    self.execute(Todo(item, scope, None), state)
        elif node.next is not None:
            self.value(node.next, scope, state)
        if node.cond is None:
            raise refused(node, "this loop has no end: use for (int i = 0; i < N; i++)")
        condition = self.condition(node.cond, scope, state)
        if condition.op != "number":
            raise refused(
                node, "the number of rounds is not fixed: compare an int counter with a constant"
            )
        if not condition.number:
            return todo.after
        return Todo(node.stmt, scope.new_child(), replace(todo, scope=scope, is_round=True))

    def declaration(self, node: c_ast.Decl, scope: Scope, state: State) -> None:
        if node.name is None or isinstance(node.type, c_ast.FuncDecl):
            return
        kind, value = self.declared_kind(node), UNSET
        if isinstance(node.init, c_ast.InitList):
            value = self.initialized(node.init, kind, scope, state)
        elif node.init is not None:
            value = self.scalar(*self.value(node.init, scope, state), kind, state, node.init)
        self.declare(scope, node.name, kind, value, state)
