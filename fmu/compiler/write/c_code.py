"""Values of a graph as statements in C: a constant for each operation, in the order of the text."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..expressions.expression import RELATIONS, in_order, written
from ..graph.graph import CONDITIONS, LEAVES, MOST_COUNTED, Value
from ..graph.tables import LookupTable
from ..read.content import Expression

# operations as C writes them; a function is written as its call
FORMULAS = {op: f"{{}} {op} {{}}" for op in ("+", "-", "*", "/", "==", *RELATIONS)}
FORMULAS |= {"and": "{} && {}", "or": "{} || {}", "not": "!{}"}
FORMULAS |= {"negative": "-{}", "if": "{} ? {} : {}", "hypot": "slopes_hypot({}, {})"}
FORMULAS |= {"noise": "random_normal({}, {}, {})", "uniform": "random_uniform({}, {}, {})"}

LONGEST = 200  # characters of a text with indexes
Leaves = Mapping[tuple[str, str], str]  # where C has a leaf, by its operation and name


def declared(c_type: str, fields: Iterable[str]) -> list[str]:
    """Return the declarations of fields, in arrays where they are elements."""
    sizes = Counter(field.partition("[")[:2] for field in fields)
    return [
        f"{c_type} {name}[{size}];" if bracket else f"{c_type} {name};"
        for (name, bracket), size in sizes.items()
    ]


def number(value: float) -> str:
    """Return a double that reads back as the same."""
    if not math.isfinite(value):
        infinity = "(double)INFINITY" if value > 0.0 else "(-(double)INFINITY)"
        return "(double)NAN" if math.isnan(value) else infinity  # the macros are floats
    return f"({value!r})" if math.copysign(1.0, value) < 0 else repr(value)


def text(value: str) -> str:
    """A string of C with any characters."""
    return '"' + "".join(_character(byte) for byte in value.encode()) + '"'


def shortened(name: str, expression: Expression, tables: Mapping[str, LookupTable]) -> str:
    """A string of C of an assignment, in one line; indexes have their values.

    Limits follow, beyond which it is not finite.
    """
    has_indexes = "[" in expression.text
    value = f"{written(expression.tree):.{LONGEST}}" if has_indexes else expression.text
    limits = {}
    for node in in_order([expression.tree]):
        if node.op == "floor":
            of = " of its quotient" if node.function == "mod" else ""
            limits[node.function] = f"up to 2^{MOST_COUNTED.bit_length() - 1}{of}"
        elif node.op == "element":
            ends = (",".join(map(str, of)) for of in (node.of[0], node.of[-1]))
            limits[f"index of {node.name.partition('[')[0]}"] = "..".join(ends)
        elif node.op == "table" and (ends := tables[node.name].ends):
            limits[f"table {node.name}"] = "{:.6g}..{:.6g}".format(*ends)
    shown = "; ".join(f"{what}: {limit}" for what, limit in limits.items())
    return text(" ".join(f"{name}{value}{shown and f' [{shown}]'}".split()))


def _character(byte: int) -> str:
    plain = 32 <= byte < 127 and chr(byte) not in '"\\?%'
    return chr(byte) if plain else f"\\{byte:03o}"


def formula(op: str, *given: str) -> str:
    """An operation on C expressions without operators: "-" in front of another would be "--"."""
    return FORMULAS[op].format(*given) if op in FORMULAS else f"{op}({', '.join(given)})"


def located(bounds: str, x: str) -> str:
    """The segment of x in C; without bounds the largest whole number up to it."""
    if not bounds:
        return f"relations_floor({x})"
    return f"relations_locate({bounds}, sizeof {bounds} / sizeof *{bounds}, {x})"


class Code:
    """Statements, each value once; values that do not move are calculated in an `outer` code."""

    def __init__(self, leaves: Leaves, prefix: str = "n", outer: Code | None = None) -> None:
        self.leaves, self.prefix, self.outer = leaves, prefix, outer
        self.lines: list[str] = []
        self.known: dict[Value, str] = {}

    def of(self, root: Value) -> str:
        """Return the C expression of a value, without operators."""
        if self.outer and not root.moves:
            return self.outer.of(root)
        for value in () if root in self.known else in_order([root], self.known):
            self.known[value] = self._expression(value)
        return self.known[root]

    def _expression(self, value: Value) -> str:
        if value.op == "number":
            return number(value.number)
        if value.op in LEAVES:
            return self.leaves[value.op, value.name]
        if self.outer and not value.moves:
            return self.outer.of(value)
        c_type = "int" if value.op in (*CONDITIONS, "locate") else "double"
        given = [self.known[argument] for argument in value.arguments]
        if value.op in ("value_of", "moving_as"):  # which differ in derivatives only
            return given[0]
        if value.op == "entry":
            return self.constant(value.name + "".join(f"[{index}]" for index in given))
        if value.op == "element":
            row = f"(const double[]){{{', '.join(given[1:])}}}, {len(given) - 1}"
            return self.constant(f"relations_element({row}, {given[0]})")
        if value.op == "locate":
            return self.constant(located(value.name, given[0]), c_type)
        return self.constant(formula(value.op, *given), c_type)

    def constant(self, of: str, c_type: str = "double") -> str:
        """Return the name of a new constant."""
        name = f"{self.prefix}{len(self.lines)}"
        self.lines.append(f"const {c_type} {name} = {of};")
        return name

    def assign(self, values: Mapping[str, Value]) -> Code:
        """Give lvalues their values, after all of them have been calculated."""
        found = [f"{target} = {self.of(value)};" for target, value in values.items()]
        self.lines += found
        return self


def indented(lines: list[str]) -> list[str]:
    """Return lines of a block."""
    return [f"    {line}" for line in lines]


def filled(template: str, **parts: object) -> str:
    """Text of a file of this folder; a line that is only $NAME becomes the lines of that part."""

    def filled_in(found: re.Match[str]) -> str:
        indent, lines, within = found.groups()
        if within:
            return str(parts[within])
        return "".join(f"{indent}{line}\n" for line in parts[lines])

    text = (Path(__file__).parent / template).read_text(encoding="utf-8")
    return re.sub(r"^( *)\$(\w+)\n|\$(\w+)", filled_in, text, flags=re.MULTILINE)
