"""Texts of C: numbers, strings, declarations, lines, and files with blocks for them."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..expressions.expression import in_order, written
from ..graph.graph import MOST_COUNTED
from ..graph.tables import LookupTable
from ..names import Field
from ..read.content import Expression

LONGEST = 200  # characters of a text with indexes
WIDTH = 100


def declared(c_type: str, fields: Iterable[Field]) -> list[str]:
    """Return the declarations of fields, in arrays where they are elements."""
    sizes = Counter((field.base, field.index is not None) for field in fields)
    return [
        f"{c_type} {name}[{size}];" if is_array else f"{c_type} {name};"
        for (name, is_array), size in sizes.items()
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


def _character(byte: int) -> str:
    plain = 32 <= byte < 127 and chr(byte) not in '"\\?%'
    return chr(byte) if plain else f"\\{byte:03o}"


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


def indented(lines: Iterable[str]) -> list[str]:
    """Return lines of a block."""
    return [f"    {line}" for line in lines]


def wrapped(line: str, width: int = WIDTH) -> list[str]:
    """Break a statement into lines that are not too long, unless it has strings or a table."""
    lines: list[str] = []
    own = len(line) - len(line.lstrip()) + 4
    while len(line) > width and '"' not in line and not line.startswith("static const"):
        at = line.rfind(" ", own + 8, width)
        if at < 0:
            break
        lines.append(line[:at])
        line = " " * own + line[at + 1 :]
    return [*lines, line]


def filled(template: str, **parts: object) -> str:
    """Text of a file of this folder; a line that is only $NAME becomes the lines of that part."""

    def filled_in(found: re.Match[str]) -> str:
        indent, lines, within = found.groups()
        if within:
            return str(parts[within])
        return "".join(f"{indent}{line}\n" for line in parts[lines])

    text = (Path(__file__).parent / template).read_text(encoding="utf-8")
    return re.sub(r"^( *)\$(\w+)\n|\$(\w+)", filled_in, text, flags=re.MULTILINE)
