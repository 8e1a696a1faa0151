"""Interprets functions of plain C symbolically: what they calculate, as values of a graph.

Statements run in their order. A condition that is not known splits the path: both branches run, and
where they meet, each variable becomes a choice. After a return in a branch the rest of the function
runs once for each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from pycparser import c_ast

from equations.c_text import CTextError, Program, check_function, refused, walk
from equations.c_types import (
    BOOL,
    DOUBLE,
    INT,
    REAL,
    UNSET,
    VOID,
    Address,
    Array,
    Pointer,
    Structure,
    Types,
    is_real,
    is_whole,
)
from equations.c_values import RELATION, Choice, Conditions, Known, Table
from equations.graph import DERIVATIVES, Graph, Value
from rparm.expressions.tree import RELATIONS, in_order

MOST_ROUNDS = 100_000  # of loops, before a text is refused
BUILT_IN = ("fabs", "abs", "value_of", "moving_as")
ARGUMENTS = {name: len(rules) for name, rules in DERIVATIVES.items()}
ARGUMENTS |= {"fabs": 1, "abs": 1, "value_of": 1, "moving_as": 2}


@dataclass
class State:
    """What variables hold on a path, and what is known on it."""

    memory: dict[Address, Any] = field(default_factory=dict)
    known: Known = field(default_factory=Known)


@dataclass
class Scope:
    """Variables of a block by name."""

    outer: Scope | None
    own: dict[str, tuple[Address, Any]] = field(default_factory=dict)

    def find(self, name: str) -> tuple[Address, Any] | None:
        scope: Scope | None = self
        while scope is not None:
            if name in scope.own:
                return scope.own[name]
            scope = scope.outer
        return None


@dataclass(frozen=True)
class Todo:
    """A statement that is to run in a scope, and all after it up to the end of the function."""

    statement: c_ast.Node
    scope: Scope
    after: Todo | None
    is_round: bool = False  # of a loop that has begun


# leaf of an argument's part: its path from the name of the argument, and its type
LeafOf = Callable[[tuple[str | int, ...], Any], Any]


class Interpreter:
    """Runs functions of a program.

    doubles_move: double is a number with derivatives, as real is. is_exact: operations with 0 and 1
    stay, which keeps signs of zeros. warn: gets warnings.
    """

    def __init__(
        self,
        program: Program,
        graph: Graph,
        doubles_move: bool = True,
        is_exact: bool = True,
        warn: Callable[[str], None] = print,
    ) -> None:
        self.program, self.graph, self.warn = program, graph, warn
        self.types = Types(program)
        self.conditions = Conditions(graph)
        self.doubles_move = doubles_move
        self.operation = graph.value if is_exact else graph.simple
        self.names: dict[Value, str] = {}  # of values, by the variables that got them
        self.inputs: dict[int, tuple[str, LeafOf]] = {}
        self.objects: dict[int, Any] = {}  # types
        self.titles: dict[int, str] = {}  # names of variables
        self.read: set[Address] = set()  # parts of arguments that were read before they were set
        self.checked: set[str] = set()
        self.calls: list[str] = []
        self.rounds = 0
        self.still: dict[Value, bool] = {}
        self.globals = Scope(None)

    # ---- Functions -------------------------------------------------------------------------------

    def run(self, name: str, leaf_of: LeafOf) -> tuple[Any, dict[tuple[str | int, ...], Any]]:
        """What a function returns, and what it writes to its arguments, by their paths.

        leaf_of gives the parts of arguments that the function reads.
        """
        try:
            return self._run(name, leaf_of)
        except RecursionError:
            raise CTextError(f"{name}: is nested too deeply") from None

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
        """Declarations of parameters, with their types."""
        listed = function.decl.type.args
        found = []
        for parameter in listed.params if listed else []:
            if isinstance(parameter, c_ast.EllipsisParam):
                raise refused(parameter, "... is not read: declare each argument")
            kind = self.types.of(parameter, self.size)
            if kind != VOID:
                found.append((parameter, kind))
        return found

    def call(
        self, function: c_ast.FuncDef, arguments: list[Any], state: State, place: c_ast.Node
    ) -> tuple[State, Any]:
        """The state after a call, and what it returns."""
        name = function.decl.name
        if name not in self.checked:
            check_function(function)
            self.checked.add(name)
        if name in self.calls:
            raise refused(place, f"{name} calls itself: write a loop with a fixed number of rounds")
        parameters = self.parameters(function)
        if len(parameters) != len(arguments):
            raise refused(place, f"{name} has {len(parameters)} arguments, not {len(arguments)}")
        scope = Scope(self.globals)
        first = len(self.objects)
        for (parameter, kind), argument in zip(parameters, arguments, strict=True):
            kind = Pointer(kind.of) if isinstance(kind, Array) else kind
            self.declare(scope, parameter.name, kind, argument, state)
        self.calls.append(name)
        state, result = self.execute(Todo(function.body, scope, None), state)
        self.calls.pop()
        kind = self.types.of(function.decl.type.type, self.size)
        if result is None and kind != VOID:
            raise refused(function.decl, f"{name} does not return a value on every path")
        local = [a for a in state.memory if a.object >= first]
        if len(self.calls) or local:
            state.memory = {a: v for a, v in state.memory.items() if a.object < first}
        return state, result

    def new_object(self, kind: Any) -> Address:
        self.objects[len(self.objects)] = kind
        return Address(len(self.objects) - 1)

    def declare(self, scope: Scope, name: str, kind: Any, value: Any, state: State) -> None:
        """A new variable with a value, of its type."""
        address = self.new_object(kind)
        self.titles[address.object] = name
        scope.own[name] = (address, kind)
        if value is not UNSET:
            self.set_all(address, value, state)

    # ---- Statements ------------------------------------------------------------------------------

    def execute(self, todo: Todo | None, state: State) -> tuple[State, Any]:
        """The state at the end, and what is returned: None where the end is reached without."""
        while todo is not None:
            node, scope, after = todo.statement, todo.scope, todo.after
            match node:
                case c_ast.Compound():
                    inner = Scope(scope)
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
        if node.expr is None:
            return None
        function = self.program.functions[self.calls[-1]]
        kind = self.types.of(function.decl.type.type, self.size)
        return self.scalar(*self.value(node.expr, scope, state), kind, state, node.expr)

    def branch(
        self, node: c_ast.If, scope: Scope, after: Todo | None, state: State
    ) -> Todo | None | tuple[State, Any]:
        """What is to run after an if, or the end of the function."""
        condition = self.condition(node.cond, scope, state)
        branches = [Todo(b, Scope(scope), None) if b else None for b in (node.iftrue, node.iffalse)]
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
        """The end of two paths."""
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

    def chosen(self, condition: Value, first: Any, second: Any) -> Any:
        """The first value where the condition holds, else the second."""
        if isinstance(first, dict):
            return {k: self.chosen(condition, first[k], second[k]) for k in first}
        if isinstance(first, list):
            pairs = zip(first, second, strict=True)
            return [self.chosen(condition, a, b) for a, b in pairs]
        if first is second:
            return first
        if first is UNSET or second is UNSET:
            return UNSET
        if isinstance(first, Value):
            return self.conditions.select(condition, first, second)
        return self.conditions.choice(condition, first, second)

    def loop(self, todo: Todo, state: State) -> Todo | None:
        """What is to run after the head of a loop."""
        node, scope = todo.statement, todo.scope
        if not todo.is_round:
            scope = Scope(scope)
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
        self.rounds += 1
        if self.rounds > MOST_ROUNDS:
            raise refused(node, f"loops have more than {MOST_ROUNDS} rounds in all")
        if not condition.number:
            return todo.after
        return Todo(node.stmt, Scope(scope), replace(todo, scope=scope, is_round=True))

    def declaration(self, node: c_ast.Decl, scope: Scope, state: State) -> None:
        if node.name is None or isinstance(node.type, c_ast.FuncDecl):
            return
        kind = self.types.of(node, self.size)
        if isinstance(kind, Array) and kind.length is None:
            if not isinstance(node.init, c_ast.InitList):
                raise refused(node, f"the array {node.name} has no size")
            kind = Array(kind.of, len(node.init.exprs))
        value = UNSET
        if isinstance(node.init, c_ast.InitList):
            value = self.initialized(node.init, kind, scope, state)
        elif node.init is not None:
            value = self.scalar(*self.value(node.init, scope, state), kind, state, node.init)
        self.declare(scope, node.name, kind, value, state)

    def initialized(self, node: c_ast.Node, kind: Any, scope: Scope, state: State) -> Any:
        """Value of an initializer, of this type."""
        if not isinstance(node, c_ast.InitList):
            return self.converted(*self.value(node, scope, state), kind, state, node)
        if isinstance(kind, Structure):
            fields = self.types.fields(kind, node, self.size)
            parts = self._parts(node, list(fields))
            return {
                name: self.initialized(parts[name], of, scope, state) if name in parts
                else self.zero(of, node)
                for name, of in fields.items()
            }  # fmt: skip
        if isinstance(kind, Array):
            parts = self._parts(node, list(range(kind.length)))
            return [
                self.initialized(parts[i], kind.of, scope, state) if i in parts
                else self.zero(kind.of, node)
                for i in range(kind.length)
            ]  # fmt: skip
        if len(node.exprs) != 1:
            raise refused(node, "one value is expected between the braces")
        return self.initialized(node.exprs[0], kind, scope, state)

    def _parts(self, node: c_ast.InitList, names: list[Any]) -> dict[Any, c_ast.Node]:
        """Initializers by the fields or indices that they are for."""
        found, at = {}, 0
        for item in node.exprs:
            if isinstance(item, c_ast.NamedInitializer):
                (designator,) = item.name if len(item.name) == 1 else (None,)
                if designator is None:
                    raise refused(item, "write nested braces instead of .a.b = ...")
                is_name = isinstance(designator, c_ast.ID)
                name = designator.name if is_name else self.size(designator)
                if name not in names:
                    raise refused(item, f"there is no {name} to initialize")
                at, item = names.index(name), item.expr
            if at >= len(names):
                raise refused(node, f"{len(node.exprs)} initializers for {len(names)} places")
            found[names[at]] = item
            at += 1
        return found

    def zero(self, kind: Any, node: c_ast.Node) -> Any:
        """What an initializer leaves out."""
        if isinstance(kind, Structure):
            fields = self.types.fields(kind, node, self.size)
            return {name: self.zero(of, node) for name, of in fields.items()}
        if isinstance(kind, Array):
            return [self.zero(kind.of, node) for _ in range(kind.length)]
        if isinstance(kind, Pointer):
            return UNSET
        return self.graph.number(0.0) if is_real(kind) else 0

    # ---- Memory ----------------------------------------------------------------------------------

    def kind_at(self, address: Address, node: c_ast.Node | None) -> Any:
        """Type of a part of an object."""
        kind = self.objects[address.object]
        for part in address.path:
            if isinstance(kind, Structure) and isinstance(part, str):
                fields = self.types.fields(kind, node, self.size)
                if part not in fields:
                    raise refused(node, f"struct {kind.name} has no field {part}")
                kind = fields[part]
            elif isinstance(kind, Array) and isinstance(part, int):
                if part < 0 or (kind.length is not None and part >= kind.length):
                    raise refused(node, f"index {part} is outside of an array of {kind.length}")
                kind = kind.of
            else:
                raise refused(node, "this pointer points to one value, not to an array")
        return kind

    def _leaf(self, address: Address) -> Any:
        name, leaf_of = self.inputs[address.object]
        kind = self.kind_at(address, None)
        return leaf_of((name, *address.path), kind)

    def get(self, address: Address, kind: Any, state: State, node: c_ast.Node) -> Any:
        """What is at an address."""
        if isinstance(kind, Structure):
            fields = self.types.fields(kind, node, self.size)
            return {name: self.get(address + name, of, state, node) for name, of in fields.items()}
        if isinstance(kind, Array):
            return [self.get(address + i, kind.of, state, node) for i in range(kind.length or 0)]
        value = state.memory.get(address, UNSET)
        if value is UNSET and address not in state.memory and address.object in self.inputs:
            if isinstance(kind, Pointer):
                raise refused(node, "an argument has a pointer in it: pass what it points to")
            value = state.memory[address] = self._leaf(address)
            self.read.add(address)
        return value

    def set_all(self, address: Address, value: Any, state: State) -> None:
        """Store a value with all of its parts."""
        if isinstance(value, dict):
            for name, part in value.items():
                self.set_all(address + name, part, state)
        elif isinstance(value, list):
            for i, part in enumerate(value):
                self.set_all(address + i, part, state)
        else:
            state.memory[address] = value
            if isinstance(value, Value) and value.arguments:
                self.names.setdefault(value, self._name_of(address))

    def _name_of(self, address: Address) -> str:
        """The last field of a path with its indices, or the variable's name."""
        names = [self.titles.get(address.object, "t"), *address.path]
        last = max(i for i, part in enumerate(names) if isinstance(part, str))
        return "_".join(map(str, names[last:]))

    def store(self, places: Any, value: Any, state: State, node: c_ast.Node) -> None:
        """Store a value where the places, an address or choices of some, say."""
        for address, condition in self.alternatives(places, state.known):
            if condition is None:
                self.set_all(address, value, state)
                continue
            before = self.get(address, self.kind_at(address, node), state, node)
            if before is UNSET:
                raise refused(node, "set all elements before one is chosen by a condition")
            self.set_all(address, self.chosen(condition, value, before), state)

    def alternatives(
        self, places: Any, known: Known, condition: Value | None = None
    ) -> list[tuple[Address, Value | None]]:
        """Addresses with the conditions under which they are meant; None: always."""
        places = self.conditions.simplified(places, known)
        if isinstance(places, Table):
            places = self.conditions.as_choice(places, known)
        if not isinstance(places, Choice):
            return [(places, condition)]
        c, both = places.condition, self.conditions.both
        no = self.conditions.no(c)
        return [
            *self.alternatives(places.first, known, c if condition is None else both(condition, c)),
            *self.alternatives(
                places.second, known, no if condition is None else both(condition, no)
            ),
        ]

    def load(self, places: Any, state: State, node: c_ast.Node) -> tuple[Any, Any]:
        """Type and value of what is at an address or at choices of some."""
        places = self.conditions.simplified(places, state.known)
        if isinstance(places, Table):
            places = self.conditions.as_choice(places, state.known)
        if isinstance(places, Choice):
            kind, first = self.load(places.first, state, node)
            _, second = self.load(places.second, state, node)
            return kind, self.chosen(places.condition, first, second)
        kind = self.kind_at(places, node)
        if isinstance(kind, Array):  # as a value, it is a pointer to its first element
            return Pointer(kind.of), places + 0
        return kind, self.get(places, kind, state, node)

    # ---- Expressions -----------------------------------------------------------------------------

    def size(self, node: c_ast.Node) -> int:
        """A whole number that is known: length of an array, value of an enumerator."""
        kind, value = self.value(node, self.globals, State())
        if not is_whole(kind) or not isinstance(value, int):
            raise refused(node, "a whole number is expected that is known here")
        return value

    def condition(self, node: c_ast.Node, scope: Scope, state: State) -> Value:
        """An expression as a condition."""
        kind, value = self.value(node, scope, state)
        if isinstance(kind, Pointer | Structure) or kind == VOID:
            raise refused(node, "this is no condition")
        if is_real(kind):
            raise refused(node, "a real number is no condition: compare it with 0.0")
        return self.conditions.resolve(self.conditions.truth(value, state.known), state.known)

    def place(self, node: c_ast.Node, scope: Scope, state: State) -> Any:
        """Address of what can be assigned to, or choices of addresses."""
        match node:
            case c_ast.ID():
                found = scope.find(node.name) or self.constant(node)
                return found[0]
            case c_ast.StructRef(type="."):
                places = self.place(node.name, scope, state)
                return self.each(lambda a, _: a + node.field.name, places, state)
            case c_ast.StructRef():
                _, places = self.pointer(node.name, scope, state)
                return self.each(lambda a, _: a + node.field.name, places, state)
            case c_ast.ArrayRef():
                _, places = self.pointer(node.name, scope, state)
                kind, index = self.value(node.subscript, scope, state)
                if not is_whole(kind):
                    raise refused(node.subscript, "an index is a whole number")
                return self.moved(places, index, state, node)
            case c_ast.UnaryOp(op="*"):
                return self.pointer(node.expr, scope, state)[1]
            case c_ast.CompoundLiteral() | c_ast.FuncCall():
                kind, value = self.value(node, scope, state)
                address = self.new_object(kind)
                self.set_all(address, value, state)
                return address
        raise refused(node, "this cannot be assigned to")

    def each(self, function: Callable[[Any, Known], Any], value: Any, state: State) -> Any:
        return self.conditions.each(function, value, state.known)

    def pointer(self, node: c_ast.Node, scope: Scope, state: State) -> tuple[Any, Any]:
        kind, value = self.value(node, scope, state)
        if not isinstance(kind, Pointer):
            raise refused(node, "this is no pointer and no array")
        return kind, value

    def moved(self, places: Any, index: Any, state: State, node: c_ast.Node) -> Any:
        """A pointer by some elements further."""

        def moved_by(address: Address, by: int) -> Address:
            if by == 0:
                return address
            if not address.path or not isinstance(address.path[-1], int):
                raise refused(node, "this pointer points to one value, not to an array")
            return Address(address.object, (*address.path[:-1], address.path[-1] + by))

        def moved_each(address: Address, known: Known) -> Any:
            return self.conditions.each(lambda by, _: moved_by(address, by), index, known)

        return self.each(moved_each, places, state)

    def value(self, node: c_ast.Node, scope: Scope, state: State) -> tuple[Any, Any]:
        """Type and value of an expression."""
        kind, value = self._value(node, scope, state)
        if value is UNSET:
            raise refused(node, f"{_shown(node)} has no value here on every path")
        return kind, value

    def _value(self, node: c_ast.Node, scope: Scope, state: State) -> tuple[Any, Any]:
        match node:
            case c_ast.Constant():
                return self.number(node)
            case c_ast.ID(name="true" | "false"):
                return BOOL, int(node.name == "true")
            case c_ast.ID() if node.name in self.program.enumerators and not scope.find(node.name):
                return INT, self.enumerator(node.name)
            case c_ast.ID() | c_ast.StructRef() | c_ast.ArrayRef():
                return self.load(self.place(node, scope, state), state, node)
            case c_ast.UnaryOp():
                return self.unary(node, scope, state)
            case c_ast.BinaryOp():
                return self.binary(node, scope, state)
            case c_ast.TernaryOp():
                return self.ternary(node, scope, state)
            case c_ast.Assignment():
                return self.assignment(node, scope, state)
            case c_ast.FuncCall():
                return self.function_call(node, scope, state)
            case c_ast.CompoundLiteral():
                kind = self.types.of(node.type, self.size)
                return kind, self.initialized(node.init, kind, scope, state)
            case c_ast.ExprList():
                results = [self.value(item, scope, state) for item in node.exprs]
                return results[-1]
        raise refused(node, f"{type(node).__name__} is no part of the equations' C")

    def number(self, node: c_ast.Constant) -> tuple[Any, Any]:
        if node.type == "int":
            return INT, int(node.value, 0)
        if node.type in ("double", "float"):
            if node.value[-1] in "fFlL" and not node.value.lower().startswith("0x"):
                raise refused(node, f"{node.value}: write it without the last letter")
            hexadecimal = node.value.lower().startswith("0x")
            number = float.fromhex(node.value) if hexadecimal else float(node.value)
            return DOUBLE, self.graph.number(number)
        raise refused(node, f"{node.value} is no number")

    def enumerator(self, name: str) -> int:
        """Value of an enumerator: written, or one more than that before it."""
        for enum in self.program.enums.values():
            at = -1
            for enumerator in enum.values.enumerators:
                at = at + 1 if enumerator.value is None else self.size(enumerator.value)
                if enumerator.name == name:
                    return at
        raise CTextError(f"{name} is not defined")

    def constant(self, node: c_ast.ID) -> tuple[Address, Any]:
        """A constant at the top of a file."""
        declared = self.program.constants.get(node.name)
        if declared is None:
            raise refused(node, f"{node.name} is not declared")
        kind = self.types.of(declared, self.size)
        address = self.new_object(kind)
        value = self.initialized(declared.init, kind, self.globals, State())

        def part(path: tuple[str | int, ...], _: Any) -> Any:
            found = value
            for step in path[1:]:
                found = found[step]
            return found

        self.inputs[address.object] = (node.name, part)
        return address, kind

    def unary(self, node: c_ast.UnaryOp, scope: Scope, state: State) -> tuple[Any, Any]:
        if node.op == "&":
            places = self.place(node.expr, scope, state)
            kinds = [self.kind_at(a, node) for a, _ in self.alternatives(places, state.known)]
            return Pointer(kinds[0]), places
        if node.op == "*":
            return self.load(self.place(node, scope, state), state, node)
        if node.op == "!":
            condition = self.conditions.no(self.condition(node.expr, scope, state))
            return INT, self.conditions.choice(condition, 1, 0)
        if node.op in ("++", "--", "p++", "p--"):
            kind, before = self.value(node.expr, scope, state)
            if not is_whole(kind):
                raise refused(node, "++ and -- are for whole numbers: use += 1.0")
            by = 1 if "+" in node.op else -1
            after = self.each(lambda a, _: a + by, before, state)
            self.store(self.place(node.expr, scope, state), after, state, node)
            return kind, before if node.op[0] == "p" else after
        kind, value = self.value(node.expr, scope, state)
        if node.op == "+":
            return kind, value
        if node.op == "-" and is_real(kind):
            if value.op == "number":
                return kind, self.graph.number(-value.number)
            return kind, self.graph.value("negative", value)
        if node.op == "-" and is_whole(kind):
            return INT, self.each(lambda a, _: -a, value, state)
        raise refused(node, f"{node.op} is not read here")

    def binary(self, node: c_ast.BinaryOp, scope: Scope, state: State) -> tuple[Any, Any]:
        if node.op in ("&&", "||"):
            return self.logical(node, scope, state)
        left, right = self.value(node.left, scope, state), self.value(node.right, scope, state)
        return self.operated(node.op, left, right, state, node)

    def operated(
        self, op: str, left: tuple[Any, Any], right: tuple[Any, Any], state: State, node: c_ast.Node
    ) -> tuple[Any, Any]:
        """An operation on two values."""
        (kind, a), (other, b) = left, right
        if isinstance(kind, Pointer) and is_whole(other) and op in ("+", "-"):
            by = b if op == "+" else self.each(lambda x, _: -x, b, state)
            return kind, self.moved(a, by, state, node)
        for given in (kind, other):
            if not (is_real(given) or is_whole(given)):
                raise refused(node, f"{op} is for numbers")
        if is_whole(kind) and is_whole(other):
            return INT, self.whole(op, a, b, state, node)
        a = a if is_real(kind) else self.conditions.real(a, state.known)
        b = b if is_real(other) else self.conditions.real(b, state.known)
        if op in RELATION:
            condition = self.conditions.resolve(self.relation(op, a, b, node), state.known)
            return INT, self.conditions.choice(condition, 1, 0)
        if op not in ("+", "-", "*", "/"):
            raise refused(node, f"{op} is for whole numbers")
        is_moving = REAL if REAL in (kind, other) else DOUBLE
        if a.op == "number" and b.op == "number" and not (op == "/" and b.number == 0.0):
            calculate: Any = {
                "+": float.__add__, "-": float.__sub__, "*": float.__mul__, "/": float.__truediv__,
            }[op]  # fmt: skip
            return is_moving, self.graph.number(calculate(a.number, b.number))
        return is_moving, self.operation(op, a, b)

    def whole(self, op: str, a: Any, b: Any, state: State, node: c_ast.Node) -> Any:
        """An operation on two whole numbers."""
        if op in RELATION:
            return self.conditions.compare(op, a, b, state.known)

        def calculate(x: int, y: int) -> int:
            if op in ("/", "%"):
                if y == 0:
                    raise refused(node, "division by 0")
                quotient = abs(x) // abs(y) * (1 if (x < 0) == (y < 0) else -1)
                if op == "/" and quotient * y != x:
                    place = f"{node.coord.file}:{node.coord.line}"
                    self.warn(
                        f"{place}: warning: {x} / {y} of whole numbers is {quotient}: "
                        f"write {x}.0 / {y}.0"
                    )
                return quotient if op == "/" else x - quotient * y
            if op not in ("+", "-", "*"):
                raise refused(node, f"{op} is not read")
            return {"+": x + y, "-": x - y, "*": x * y}[op]

        return self.conditions.binary(calculate, a, b, state.known)

    def relation(self, op: str, a: Value, b: Value, node: c_ast.Node) -> Value:
        """A comparison of real numbers."""
        if not self.graph.has_switches:
            a, b = (v.arguments[0] if v.op == "value_of" else v for v in (a, b))
        if a.op == "number" and b.op == "number":
            return self.conditions.constant(RELATION[op](a.number, b.number))
        if op in RELATIONS:
            return self.graph.relation(op, a, b)
        if self.graph.has_switches and (a.moves or b.moves):
            raise refused(node, f"{op} is for whole numbers: compare moving values by < or >")
        equal = self.graph.value("==", a, b)
        return equal if op == "==" else self.conditions.no(equal)

    def logical(self, node: c_ast.BinaryOp, scope: Scope, state: State) -> tuple[Any, Any]:
        """&& and ||: the second is looked at where the first does not decide."""
        first = self.condition(node.left, scope, state)
        is_and = node.op == "&&"
        if first.op == "number":
            if bool(first.number) is not is_and:
                return INT, int(not is_and)
            second = self.condition(node.right, scope, state)
            return INT, self.conditions.choice(second, 1, 0)
        known = self.conditions.assume(first, is_and, state.known)
        if known is None:
            return INT, int(not is_and)
        second = self.condition(node.right, scope, State(state.memory, known))
        combined = (self.conditions.both if is_and else self.conditions.either)(first, second)
        combined = self.conditions.resolve(combined, state.known)
        return INT, self.conditions.choice(combined, 1, 0)

    def ternary(self, node: c_ast.TernaryOp, scope: Scope, state: State) -> tuple[Any, Any]:
        condition = self.condition(node.cond, scope, state)
        if condition.op == "number":
            return self.value(node.iftrue if condition.number else node.iffalse, scope, state)
        found = []
        for branch, holds in ((node.iftrue, True), (node.iffalse, False)):
            known = self.conditions.assume(condition, holds, state.known)
            if known is not None:
                found.append((*self.value(branch, scope, State(state.memory, known)), known))
        if len(found) == 1:
            return found[0][:2]
        (kind, a, known_a), (other, b, known_b) = found
        if is_real(kind) != is_real(other) and is_whole(kind) != is_whole(other):
            a = a if is_real(kind) else self.conditions.real(a, known_a)
            b = b if is_real(other) else self.conditions.real(b, known_b)
            kind = DOUBLE if is_whole(kind) else kind
        kind = REAL if REAL in (kind, other) else kind
        return kind, self.chosen(condition, a, b)

    def assignment(self, node: c_ast.Assignment, scope: Scope, state: State) -> tuple[Any, Any]:
        right = self.value(node.rvalue, scope, state)
        if node.op != "=":
            left = self.value(node.lvalue, scope, state)
            right = self.operated(node.op[:-1], left, right, state, node)
        places = self.place(node.lvalue, scope, state)
        kind = self.kind_at(self.alternatives(places, state.known)[0][0], node)
        if isinstance(kind, Array):
            raise refused(node, "arrays are not assigned: assign each element")
        convert = self.scalar if isinstance(node.lvalue, c_ast.ID) else self.converted
        value = convert(*right, kind, state, node.rvalue)
        self.store(places, value, state, node)
        return kind, value

    def converted(self, kind: Any, value: Any, to: Any, state: State, node: c_ast.Node) -> Any:
        """A value as one of another type."""
        if is_real(to) and is_real(kind):
            return value
        if is_real(to) and is_whole(kind):
            return self.conditions.real(value, state.known)
        if to == BOOL and is_whole(kind):
            return self.conditions.choice(self.conditions.truth(value, state.known), 1, 0)
        if is_whole(to) and is_whole(kind):
            return value
        if is_whole(to) and is_real(kind):
            raise refused(node, "a real number becomes a whole one here: that has no derivatives")
        if isinstance(to, Pointer) and isinstance(kind, Pointer):
            return value
        if to == kind:
            return value
        raise refused(node, "the types do not fit")

    def scalar(self, kind: Any, value: Any, to: Any, state: State, node: c_ast.Node) -> Any:
        """As `converted`, for a variable, an argument or a result."""
        value = self.converted(kind, value, to, state, node)
        if to == DOUBLE and not self.doubles_move and self.carries(value):
            raise refused(
                node,
                "a real becomes a double here and loses its derivatives: declare it as real, "
                "or write value_of(...)",
            )
        return value

    def carries(self, value: Value) -> bool:
        """Whether a value has derivatives."""
        for v in in_order([value], self.still):
            is_leaf = v.op in ("parameter", "input", "state", "time")
            moving = v.arguments[-1:] if v.op == "moving_as" else v.arguments
            self.still[v] = is_leaf or (v.op != "value_of" and any(self.still[a] for a in moving))
        return self.still[value]

    # ---- Calls -----------------------------------------------------------------------------------

    def function_call(self, node: c_ast.FuncCall, scope: Scope, state: State) -> tuple[Any, Any]:
        if not isinstance(node.name, c_ast.ID):
            raise refused(node, "pointers to functions are not read: call the function")
        name = node.name.name
        given = [self.value(a, scope, state) for a in (node.args.exprs if node.args else [])]
        if name in ARGUMENTS and (name in BUILT_IN or name not in self.program.functions):
            return self.built_in(name, given, state, node)
        function = self.program.functions.get(name)
        if function is None:
            known = ", ".join(sorted(DERIVATIVES))
            has = "has no body here" if name in self.program.declared else "is not known"
            raise refused(node, f"{name} {has}: besides functions of the text there are {known}")
        parameters = self.parameters(function)
        if len(parameters) != len(given):
            raise refused(node, f"{name} has {len(parameters)} arguments, not {len(given)}")
        arguments = []
        for (_, kind), value, at in zip(
            parameters, given, node.args.exprs if node.args else [], strict=True
        ):
            kind = Pointer(kind.of) if isinstance(kind, Array) else kind
            arguments.append(self.scalar(*value, kind, state, at))
        after, result = self.call(function, arguments, State(state.memory, state.known), node)
        state.memory = after.memory
        kind = self.types.of(function.decl.type.type, self.size)
        return kind, result[0] if result and result[0] is not UNSET else 0

    def built_in(
        self, name: str, given: list[tuple[Any, Any]], state: State, node: c_ast.Node
    ) -> tuple[Any, Any]:
        """A function of libm or of real.h."""
        if len(given) != ARGUMENTS[name]:
            raise refused(node, f"{name} has {ARGUMENTS[name]} arguments, not {len(given)}")
        if name == "abs":
            if not is_whole(given[0][0]):
                raise refused(node, "abs is for whole numbers: use fabs")
            return INT, self.each(lambda a, _: abs(a), given[0][1], state)
        reals = []
        for (kind, value), at in zip(given, node.args.exprs, strict=True):
            if not (is_real(kind) or is_whole(kind)):
                raise refused(at, f"{name} is for numbers")
            reals.append(value if is_real(kind) else self.conditions.real(value, state.known))
        zero = self.graph.number(0.0)
        if name == "fabs":
            is_negative = self.relation("<", reals[0], zero, node)
            is_negative = self.conditions.resolve(is_negative, state.known)
            negative = self.graph.value("negative", reals[0])
            return REAL, self.conditions.select(is_negative, negative, reals[0])
        if name == "value_of":
            value = self.graph.value("value_of", *reals) if self.carries(reals[0]) else reals[0]
            return DOUBLE, value
        if name == "moving_as" and reals[0] is reals[1]:
            return REAL, reals[0]
        return REAL, self.graph.value(name, *reals)


def _shown(node: c_ast.Node) -> str:
    """A variable as messages name it."""
    match node:
        case c_ast.ID():
            return node.name
        case c_ast.StructRef():
            return f"{_shown(node.name)}{node.type}{node.field.name}"
        case c_ast.ArrayRef():
            return f"{_shown(node.name)}[{_shown(node.subscript)}]"
        case c_ast.Constant():
            return node.value
    return "this"
