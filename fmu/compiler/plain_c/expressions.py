"""Expressions of interpreted C: their types and values."""

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from pycparser import c_ast

from ..expressions.expression import RELATIONS, in_order
from ..graph.graph import DERIVATIVES, Graph, Value
from .memory import (
    BOOL,
    DOUBLE,
    INT,
    REAL,
    UNSET,
    VOID,
    Address,
    Array,
    Memory,
    Pointer,
    Scope,
    State,
    Structure,
    is_real,
    is_whole,
)
from .text import CTextError, Program, refused, walk
from .values import RELATION, Known

BUILT_IN = ("fabs", "abs", "value_of", "moving_as")
ROUNDING = ("ceil", "floor", "trunc", "round")  # of what has no derivatives
ARGUMENTS = {name: len(rules) for name, rules in DERIVATIVES.items() if name != "hypot"}
ARGUMENTS |= {"fabs": 1, "abs": 1, "value_of": 1, "moving_as": 2}
ARGUMENTS |= dict.fromkeys(ROUNDING, 1)


class Expressions(Memory):
    """Calculates expressions; `known` are functions of libm and real.h with their arguments.

    doubles_move: double has derivatives, as real. is_exact: operations with 0 and 1 stay, which
    keeps signs of zeros. warn: gets warnings.
    """

    known: Mapping[str, int] = ARGUMENTS

    def __init__(
        self,
        program: Program,
        graph: Graph,
        doubles_move: bool = True,
        is_exact: bool = True,
        warn: Callable[[str], None] = print,
    ) -> None:
        super().__init__(program, graph)
        self.warn, self.doubles_move = warn, doubles_move
        self.operation = graph.value if is_exact else graph.simple
        self.still: dict[Value, bool] = {}
        self.globals = Scope()

    def call(
        self, function: c_ast.FuncDef, arguments: list[Any], state: State, place: c_ast.Node
    ) -> tuple[State, Any]:
        """Return the state after a call, and its result."""
        raise NotImplementedError

    def parameters(self, function: c_ast.FuncDef) -> list[tuple[c_ast.Decl, Any]]:
        """Return declarations of parameters, with their types."""
        raise NotImplementedError

    def size(self, node: c_ast.Node) -> int:
        """Evaluate a whole number that is known: length of an array, value of an enumerator."""
        for name in (each.name for each in walk(node) if isinstance(each, c_ast.ID)):
            if name not in self.program.enumerators and name not in self.program.constants:
                raise refused(node, f"{name} has no value here: write a number or an enumerator")
        kind, value = self.value(node, self.globals, State())
        if not is_whole(kind) or not isinstance(value, int):
            raise refused(node, "a whole number is expected that is known here")
        return value

    def condition(self, node: c_ast.Node, scope: Scope, state: State) -> Value:
        """Evaluate an expression as a condition."""
        kind, value = self.value(node, scope, state)
        if isinstance(kind, Pointer | Structure) or kind == VOID:
            raise refused(node, "this is no condition")
        if is_real(kind):
            raise refused(node, "a real number is no condition: compare it with 0.0")
        return self.conditions.resolve(self.conditions.truth(value, state.known), state.known)

    def place(self, node: c_ast.Node, scope: Scope, state: State) -> Any:
        """Return the address of an assignable expression, or choices of addresses."""
        match node:
            case c_ast.ID():
                found = scope.get(node.name) or self.constant(node)
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
        """Move a pointer by some elements."""

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
        """Return type and value of an expression."""
        self.here = node
        self.spend()
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
            case c_ast.ID() if node.name in self.program.enumerators and not scope.get(node.name):
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
                kind = self.declared_kind(node)
                return kind, self.initialized(node.init, kind, scope, state)
            case c_ast.ExprList():
                raise refused(node, "the comma operator is not read: write two statements")
        raise refused(node, f"{type(node).__name__} is no part of the equations' C: use a function")

    def number(self, node: c_ast.Constant) -> tuple[Any, Any]:
        if node.type == "int" and not re.fullmatch("0[0-9]+|.{30,}", node.value):
            return INT, self.in_range(int(node.value, 0), node)
        if node.type in ("double", "float"):
            if node.value[-1] in "fFlL" and not node.value.lower().startswith("0x"):
                raise refused(node, f"{node.value}: write it without the last letter")
            hexadecimal = node.value.lower().startswith("0x")
            try:
                number = float.fromhex(node.value) if hexadecimal else float(node.value)
            except (OverflowError, ValueError):
                number = math.inf
            if math.isfinite(number):
                return DOUBLE, self.graph.number(number)
        raise refused(node, f"{node.value:.30} is no number that is read")

    def in_range(self, number: int, node: c_ast.Node) -> int:
        """Return a whole number, if an int has room for it."""
        if not -(2**31) <= number < 2**31:
            raise refused(node, "this whole number is too large for an int: use a double")
        return number

    def enumerator(self, name: str) -> int:
        """Evaluate an enumerator: written, or one more than the one before it."""
        for enum in self.program.enums.values():
            at = -1
            for enumerator in enum.values.enumerators:
                at = at + 1 if enumerator.value is None else self.size(enumerator.value)
                if enumerator.name == name:
                    return at
        raise CTextError(f"{name} is not defined")

    def declared_kind(self, node: c_ast.Decl | c_ast.CompoundLiteral) -> Any:
        """Return the type of a variable; its initializer may give it its length."""
        kind = self.types.of(node.type)
        if isinstance(kind, Array) and kind.length is None:
            if not isinstance(node.init, c_ast.InitList):
                raise refused(node, "this array has no size")
            kind = Array(kind.of, len(node.init.exprs))
        return kind

    def constant(self, node: c_ast.ID) -> tuple[Address, Any]:
        """Evaluate a constant at the top of a file."""
        declared = self.program.constants.get(node.name)
        if declared is None:
            raise refused(node, f"{node.name} is not declared")
        kind = self.declared_kind(declared)
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
            after = self.each(lambda a, _: self.in_range(a + by, node), before, state)
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
        """Apply an operation to two values."""
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
            result = calculate(a.number, b.number)
            if math.isfinite(result):
                return is_moving, self.graph.number(result)
        return is_moving, self.operation(op, a, b)

    def whole(self, op: str, a: Any, b: Any, state: State, node: c_ast.Node) -> Any:
        """Apply an operation to two whole numbers."""
        if op in RELATION:
            return self.conditions.compare(op, a, b, state.known)

        def calculate(x: int, y: int) -> int:
            if op == "/":
                if y == 0:
                    raise refused(node, "division by 0")
                quotient = abs(x) // abs(y) * (1 if (x < 0) == (y < 0) else -1)
                if quotient * y != x:
                    place = f"{node.coord.file}:{node.coord.line}"
                    self.warn(
                        f"{place}: warning: {x} / {y} of whole numbers is {quotient}: "
                        f"write {x}.0 / {y}.0"
                    )
                return quotient
            if op not in ("+", "-", "*"):
                raise refused(node, f"{op} is not read")
            return self.in_range({"+": x + y, "-": x - y, "*": x * y}[op], node)

        return self.conditions.binary(calculate, a, b, state.known)

    def relation(self, op: str, a: Value, b: Value, node: c_ast.Node) -> Value:
        """Compare real numbers."""
        is_decided = "value_of" in (a.op, b.op)  # at each evaluation, without an event
        a, b = (v.arguments[0] if v.op == "value_of" else v for v in (a, b))
        if a.op == "number" and b.op == "number":
            return self.conditions.constant(RELATION[op](a.number, b.number))
        if op in RELATIONS:
            compare = self.graph.value if is_decided else self.graph.relation
            return compare(op, a, b)
        if self.graph.has_switches and (a.moves or b.moves):
            raise refused(node, f"{op} is for whole numbers: compare moving values by < or >")
        equal = self.graph.value("==", a, b)
        return equal if op == "==" else self.conditions.no(equal)

    def logical(self, node: c_ast.BinaryOp, scope: Scope, state: State) -> tuple[Any, Any]:
        """Evaluate && and ||: the second operand only where the first does not decide."""
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
        elif kind != other and not all(is_real(k) or is_whole(k) for k in (kind, other)):
            raise refused(node, "the types of both branches do not fit")
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
        """Convert a value to another type."""
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
        """Convert a value for a variable, an argument or a result."""
        value = self.converted(kind, value, to, state, node)
        if to == DOUBLE and not self.doubles_move and self.carries(value):
            raise refused(
                node,
                "a real becomes a double here and loses its derivatives: declare it as real, "
                "or write value_of(...)",
            )
        return value

    def carries(self, value: Value) -> bool:
        """Return whether a value has derivatives."""
        for v in in_order([value], self.still):
            is_leaf = v.op in ("parameter", "input", "state", "time")
            moving = v.arguments[-1:] if v.op == "moving_as" else v.arguments
            self.still[v] = is_leaf or (v.op != "value_of" and any(self.still[a] for a in moving))
        return self.still[value]

    # ---- Initializers ----------------------------------------------------------------------------

    def initialized(self, node: c_ast.Node, kind: Any, scope: Scope, state: State) -> Any:
        """Evaluate an initializer of this type."""
        if not isinstance(node, c_ast.InitList):
            return self.converted(*self.value(node, scope, state), kind, state, node)
        if isinstance(kind, Structure):
            fields = self.types.fields(kind, node)
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
        """Map fields or indices to their initializers."""
        found, at = {}, 0
        for item in node.exprs:
            if isinstance(item, c_ast.NamedInitializer):
                (designator,) = item.name if len(item.name) == 1 else (None,)
                if designator is None:
                    raise refused(item, "write nested braces instead of .a.b = ...")
                is_name = isinstance(designator, c_ast.ID)
                inner = getattr(designator, "expr", designator)  # pycparser has a node for it
                name = designator.name if is_name else self.size(inner)
                if name not in names:
                    raise refused(item, f"there is no {name} to initialize")
                at, item = names.index(name), item.expr
            if at >= len(names):
                raise refused(node, f"{len(node.exprs)} initializers for {len(names)} places")
            found[names[at]] = item
            at += 1
        return found

    def zero(self, kind: Any, node: c_ast.Node) -> Any:
        """Return the value of parts that an initializer leaves out."""
        self.spend()
        if isinstance(kind, Structure):
            fields = self.types.fields(kind, node)
            return {name: self.zero(of, node) for name, of in fields.items()}
        if isinstance(kind, Array):
            return [self.zero(kind.of, node) for _ in range(kind.length)]
        if isinstance(kind, Pointer):
            return UNSET
        return self.graph.number(0.0) if is_real(kind) else 0

    # ---- Calls -----------------------------------------------------------------------------------

    def function_call(self, node: c_ast.FuncCall, scope: Scope, state: State) -> tuple[Any, Any]:
        if not isinstance(node.name, c_ast.ID):
            raise refused(node, "pointers to functions are not read: call the function")
        name = node.name.name
        given = [self.value(a, scope, state) for a in (node.args.exprs if node.args else [])]
        if name in self.known and (name in BUILT_IN or name not in self.program.functions):
            return self.built_in(name, given, state, node)
        function = self.program.functions.get(name)
        if function is None:
            known = ", ".join(sorted(self.known))
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
        kind = self.types.of(function.decl.type.type)
        return kind, result[0] if result and result[0] is not UNSET else 0

    def built_in(
        self, name: str, given: list[tuple[Any, Any]], state: State, node: c_ast.Node
    ) -> tuple[Any, Any]:
        """Call a function of libm or of real.h."""
        if len(given) != self.known[name]:
            raise refused(node, f"{name} has {self.known[name]} arguments, not {len(given)}")
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
        if name in ROUNDING and self.carries(reals[0]):
            raise refused(node, f"{name} has no derivatives: write {name}(value_of(...))")
        if name == "moving_as" and reals[0] is reals[1]:
            return REAL, reals[0]
        return REAL, self.graph.value(name, *reals)


def _shown(node: c_ast.Node) -> str:
    """Write a variable as messages name it."""
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
