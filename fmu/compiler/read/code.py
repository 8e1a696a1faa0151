"""The C file of a file with equations: its functions, which expressions call by their names.

Nothing of it is compiled or run: plain_c interprets it, and what a call calculates becomes a part
of the graph, as if it stood in the expression. Every mistake is a ValueError, in one line.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pycparser import c_ast

from ..expressions.expression import RELATIONS, ExpressionError, Lookup, Node, in_order, parse
from ..graph.graph import DERIVATIVES, Graph, Value
from ..plain_c.expressions import ROUNDING
from ..plain_c.interpreter import Interpreter
from ..plain_c.memory import DOUBLE, is_real
from ..plain_c.text import CTextError, Program, check_function, parsed, refused, without_comments

LARGEST_FILE = 200_000  # bytes
MOST_OPERATIONS = 10_000  # that a call stands for
MOST_STEPS, MOST_STEPS_IN_ALL = 100_000, 500_000  # of the interpreter in a call, and in all
MOST_RELATIONS = 1000  # of values that move, in the whole model
HEADERS = "#include <math.h> and <stdbool.h>"
NO_LINES = {  # of C, and what to write instead
    r"#\s*include\s*<(math|stdbool)\.h>\s*": "",
    r"#\s*include\b.*": f"only {HEADERS} are read: put all functions into this file",
    r"#\s*define\b.*": "macros are not read: write static const double NAME = ... or a function",
    r"(%:|\?\?=|#|(.*\W)?_Pragma\b).*": f"of directives, only {HEADERS} are read",
    r"(.*\W)?(__)?asm(__)?\b.*": "assembly is not read: write the equation in C",
}
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

    def called_by(self, graph: Graph) -> Mapping[str, Callable[[list[Value], bool], Value]]:
        """Return the functions of arguments in a graph, and of whether this is an instant."""
        calls = Calls(self.program, graph)
        return {name: partial(calls.result, f) for name, f in self.functions.items()}


def read(path: Path) -> CodeFile:
    """Read and check a C file: each function, as far as its arguments do not matter."""
    program = parsed(_lines(path), [path])
    graph = Graph(has_switches=False)
    calls = Calls(program, graph)
    for name, function in program.functions.items():
        check_function(function)
        if name in ARGUMENTS or name in ROUNDING:
            reason = f"{name} is a function of math.h: give this one another name"
            raise refused(function.decl, reason)
    found = {name: calls.called(name, f) for name, f in program.functions.items()}
    for function in found.values():
        if not function.is_helper:
            given = [graph.value("parameter", name=a) for a in function.arguments]
            calls.result(function, given, False)
    warnings = [warning.replace(" warning:", "") for warning in dict.fromkeys(calls.warnings)]
    return CodeFile(program, found, warnings, calls.flat)


def _lines(path: Path) -> str:
    """Return the text without comments and lines for the preprocessor, as the parser reads it."""
    name = path.name
    try:
        if not path.is_file():
            raise CTextError(f"{name}: no such file")
        content = path.read_bytes() if path.stat().st_size <= LARGEST_FILE else b""
        if not content:
            raise CTextError(f"{name}: is empty, or has more than {LARGEST_FILE} bytes")
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise CTextError(f"{name}:{line}: is not UTF-8: save it in this encoding") from None
    except OSError as error:
        raise CTextError(f"{name}: cannot be read: {error.strerror}") from None
    lines = [f'# 1 "{name}"']
    for number, line in enumerate(without_comments(text, name).split("\n"), 1):
        for pattern, reason in NO_LINES.items():
            if re.fullmatch(pattern, line.strip()):
                if reason:
                    raise CTextError(f"{name}:{number}: {reason}")
                line = ""
        lines.append(line)
    return "\n".join(lines)


class Calls(Interpreter):
    """Calls of functions of a program, as values of a graph."""

    known, most_steps = ARGUMENTS, MOST_STEPS

    def __init__(self, program: Program, graph: Graph) -> None:
        self.warnings: list[str] = []
        super().__init__(program, graph, warn=self.warnings.append)
        self.conditions.decided = graph.choice
        self.results: dict[tuple[object, ...], Value] = {}
        self.is_instant, self.steps_in_all = False, 0
        self.flat: dict[str, set[str]] = {}

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
        return Called(name, arguments, "call", place, not all(map(is_real, kinds)))

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

    def relation(self, op: str, a: Value, b: Value, node: c_ast.Node) -> Value:
        """Compare real numbers: at an instant there are no switches."""
        is_open = op in RELATIONS and not (a.op == b.op == "number")
        if self.is_instant and is_open:
            return self.graph.value(op, a, b)
        if len(self.graph.relations) > MOST_RELATIONS:
            raise refused(node, f"the model has more than {MOST_RELATIONS} conditions that move")
        return super().relation(op, a, b, node)

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
