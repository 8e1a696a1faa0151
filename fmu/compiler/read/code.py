"""The C file of a file with equations: its functions, which expressions call by their names.

Nothing of it is compiled or run: plain_c interprets it, and what a call calculates becomes a part
of the graph, as if it stood in the expression. Every mistake is a ValueError, in one line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from pycparser import c_ast
from pycparser.c_generator import CGenerator

from ..expressions.expression import RELATIONS, ExpressionError, Node, in_order
from ..expressions.parser import Lookup, parse
from ..graph.graph import DERIVATIVES, Graph, Value
from ..plain_c.expressions import ROUNDING
from ..plain_c.interpreter import Interpreter
from ..plain_c.memory import DOUBLE, LeafOf, is_real
from ..plain_c.text import CTextError, Program, check_function, refused
from ..plain_c.text import read as read_c

MOST_OPERATIONS = 10_000  # that a call stands for
MOST_STEPS, MOST_STEPS_IN_ALL = 100_000, 500_000  # of the interpreter in a call, and in all
MOST_RELATIONS = 1000  # of values that move, in the whole model
# functions of math.h that are no operations of the graph, as expressions of x and y
EXPRESSIONS = {
    name: parse(text)
    for name, text in {
        "fabs": "abs(x)",
        "fmin": "min(x, y)",
        "fmax": "max(x, y)",
        "pow": "x**y",
        "hypot": "hypot(x, y)",
        "cbrt": "cbrt(x)",
        "log10": "log10(x)",
        "floor": "floor(x)",
        "ceil": "ceil(x)",
        "round": "floor(x + 0.5) if x >= 0 else ceil(x - 0.5)",
    }.items()
}
ARGUMENTS = {name: len(rules) for name, rules in DERIVATIVES.items()} | {"abs": 1}
OF_REAL = {"value_of": 1, "moving_as": 2}  # of models/real.h
ARGUMENTS |= {name: 1 + (name in ("fmin", "fmax", "hypot", "pow")) for name in EXPRESSIONS}


@dataclass(frozen=True)
class Called(Lookup):
    """A function with its file and line; is_helper: only functions of the C file call it."""

    place: str = ""
    is_helper: bool = False

    def of(self, given: Sequence[Node], column: int) -> Node:
        """Return the call."""
        if self.is_helper:
            what = "expressions call functions of doubles that return a double"
            raise ExpressionError(column, f"{self.name}: {self.place}: {what}")
        return super().of(given, column)


@dataclass(frozen=True)
class CodeFile:
    """A C file with its functions."""

    program: Program
    functions: dict[str, Called]
    warnings: list[str]
    flat: dict[str, set[str]]  # functions without slope that a function calls


def read(paths: Iterable[Path], made: Callable[[Path], str | None]) -> CodeFile:
    """Read and check C files: each function, as far as its arguments do not matter.

    `made` gives headers that are made.
    """
    program = read_c(paths, made=made)
    graph = Graph(has_switches=False)
    calls = Calls(program, graph)
    own = {
        name: function
        for name, function in program.functions.items()
        if not (name in OF_REAL and "real" in program.typedefs)
    }
    for name, function in own.items():
        check_function(function)
        if name in calls.known or name in ROUNDING:
            reason = f"{name} is a function of math.h: give this one another name"
            raise refused(function.decl, reason)
    found = {name: calls.called(name, f) for name, f in own.items()}
    for function in found.values():
        if not function.is_helper:
            given = [graph.value("parameter", name=a) for a in function.arguments]
            calls.result(function, given, False)
    warnings = [warning.replace(" warning:", "") for warning in dict.fromkeys(calls.warnings)]
    return CodeFile(program, found, warnings, calls.flat)


class Calls(Interpreter):
    """Calls of functions of a program, as values of a graph."""

    most_steps = MOST_STEPS

    def __init__(self, program: Program, graph: Graph, is_exact: bool = True) -> None:
        self.warnings: list[str] = []
        super().__init__(program, graph, is_exact=is_exact, warn=self.warnings.append)
        self.known = ARGUMENTS | (OF_REAL if "real" in program.typedefs else {})
        if is_exact:
            self.conditions.decided = graph.choice
        self.results: dict[tuple[object, ...], Value] = {}
        self.is_instant, self.steps_in_all = False, 0
        self.flat: dict[str, set[str]] = {}
        self.relation_texts: dict[str, str] = {}  # with their places in C

    def called(self, name: str, function: c_ast.FuncDef) -> Called:
        """Return how expressions call a function."""
        try:
            parameters = self.parameters(function)
            kinds = [kind for _, kind in parameters] + [self.types.of(function.decl.type.type)]
        except RecursionError:
            raise refused(function.decl, "the types are nested too deeply") from None
        if any(parameter.name is None for parameter, _ in parameters):
            raise refused(function.decl, "each argument needs a name")
        arguments = tuple(parameter.name for parameter, _ in parameters)
        place = f"{function.decl.coord.file}:{function.decl.coord.line}"
        is_helper = not all(map(is_real, kinds))
        return Called(name, arguments, "call", place=place, is_helper=is_helper)

    def result(self, function: Called, given: Sequence[Value], is_instant: bool) -> Value:
        """Call a function; is_instant: at an event, where nothing moves."""
        key = (function.name, is_instant, *given)
        if key not in self.results:
            self.is_instant = is_instant
            self.flat.setdefault(function.name, set())
            arguments = dict(zip(function.arguments, given, strict=True))
            (found,), _ = self.run(function.name, lambda place, _: arguments[place[0]])
            self.results[key], self.steps_in_all = found, self.steps_in_all + self.steps
            if len(in_order([found], {*given})) > MOST_OPERATIONS:
                reason = f"a call makes more than {MOST_OPERATIONS} operations"
                raise CTextError(f"{function.place}: {reason}")
            if self.steps_in_all > MOST_STEPS_IN_ALL:
                raise CTextError(
                    f"{function.place}: calls take more than {MOST_STEPS_IN_ALL} steps"
                )
        return self.results[key]

    def written(self, name: str, leaf_of: LeafOf) -> dict[tuple[str | int, ...], Any]:
        """Call a function of a struct; return what it writes, by the paths of fields."""
        self.is_instant = False
        self.flat.setdefault(name, set())
        _, found = self.run(name, leaf_of)
        self.steps_in_all += self.steps
        return {place[1:]: value for place, value in found.items()}

    def of(
        self, functions: Mapping[str, Called]
    ) -> Mapping[str, Callable[[list[Value], bool], Value]]:
        """Return the functions of arguments, and of whether this is an instant."""
        return {name: partial(self.result, function) for name, function in functions.items()}

    def relation(self, op: str, a: Value, b: Value, node: c_ast.Node) -> Value:
        """Compare real numbers: at an instant there are no switches."""
        is_open = op in RELATIONS and not (a.op == b.op == "number")
        if self.is_instant and is_open:
            return self.graph.value(op, a, b)
        if len(self.graph.relations) > MOST_RELATIONS:
            raise refused(node, f"the model has more than {MOST_RELATIONS} conditions that move")
        before = len(self.graph.relations)
        found = super().relation(op, a, b, node)
        for name in islice(self.graph.relations, before, None):
            place = f"{node.coord.file}:{node.coord.line}"
            self.relation_texts[name] = f"{CGenerator().visit(node)} of {place}"
        return found

    def built_in(
        self, name: str, given: list[tuple[Any, Any]], state: Any, node: c_ast.FuncCall
    ) -> tuple[Any, Any]:
        """Call a function of math.h as expressions do."""
        if name not in EXPRESSIONS or len(given) != ARGUMENTS[name]:
            return super().built_in(name, given, state, node)
        reals = []
        for (kind, value), at in zip(given, node.args.exprs, strict=True):
            reals.append(self.scalar(kind, value, DOUBLE, state, at))
        if name in ROUNDING:
            self.flat[self.calls[0]].add(name)
        names = dict(zip("xy", reals, strict=False))
        return DOUBLE, self.graph.of_tree(EXPRESSIONS[name], names, self.is_instant)
