"""Checks the names, kinds and units of all expressions in a file.

Every mistake is a ModelFileError: file, line, section, name, column and what was expected, in one
line.
"""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from declaration.files import shown

from equations_file.tables import (
    Expression,
    ModelFile,
    ModelFileError,
    placed,
    read_tables,
    tables_of,
)
from rparm.expressions.expression import CONSTANTS, ExpressionError, check_kinds, in_order, names
from rparm.expressions.units import BASE, Unit, times, unit_of, unit_of_exponents
from rparm.expressions.units import shown as unit_shown

QUOTES = r"[\s\"']"
SECOND = unit_of_exponents({"s": 1})


def read(path: Path, solver_names: Iterable[str] = ()) -> ModelFile:
    """Read and check a file; solver_names: of the variables that every model has.

    ModelFileError if something in it is wrong.
    """
    with placed(path):
        text, tables = tables_of(path)
        try:
            file = read_tables(path, text, tables, solver_names)
            _check_names(file)
            file.order = _in_order(file)
            if file.has_units:
                _check_units(file)
        except ModelFileError as error:
            raise ModelFileError(f"{_line(text, str(error))}{error}") from None
    return file


def _line(text: str, message: str) -> str:
    """In which line the message's section and name are, as far as that is sure."""
    place = re.match(r"(\[.*?\])(?:: ['\"]?(\w+))?|(\w+): ", message)
    lines = text.split("\n")
    begin, key = 0, place and (place[2] or place[3])
    if place and place[1]:
        head = re.sub(QUOTES, "", place[1][1:-1])
        plain = [re.sub(QUOTES, "", line.partition("#")[0]) for line in lines]
        # the table itself, else one below it, else its line in the table above
        heads = [i for i, line in enumerate(plain, 1) if line in (f"[{head}]", f"[[{head}]]")]
        heads = heads or [i for i, line in enumerate(plain, 1) if line.startswith(f"[{head}.")]
        if not heads:
            above, _, key = head.rpartition(".")
            heads = [i for i, line in enumerate(plain, 1) if line == f"[{above}]"]
            heads = heads if above else [0]
        begin = heads[0] if len(heads) == 1 else len(lines) + 1
    for i, line in enumerate(lines[begin:], begin + 1):
        if line.lstrip().startswith("["):
            break
        if key and re.match(rf"\s*[\"']?{re.escape(key)}(?![\w-]).*=", line):
            return f"line {i}: "
    return f"line {begin}: " if 0 < begin <= len(lines) else ""


def _check_names(file: ModelFile) -> None:
    """Check the names and kinds in all expressions."""
    known = {*file.variables, *file.modes, "time", *CONSTANTS}
    parameters = {variable.name for variable in file.of("parameters")} | {*CONSTANTS}
    for expressions, allowed, mistake in (
        (file.assigned, known, "unknown name {}"),
        (file.checks.values(), parameters, "{} is no parameter"),
    ):
        for expression in expressions:
            with placed(*expression.place):
                for node in in_order([expression.tree]):
                    if node.name and node.name not in allowed:
                        meant = get_close_matches(node.name, allowed, n=1)
                        hint = f", did you mean {meant[0]!r}?" if meant else ""
                        raise ExpressionError(node.column, mistake.format(shown(node.name)) + hint)
                check_kinds(expression.tree, expression.kind, file.modes)


def _in_order(file: ModelFile) -> list[Expression]:
    """All expressions: those of [where] and [outputs] first, each after those that it names."""
    entries = {variable.name: variable for variable in file.of("where", "outputs")}
    for variable in entries.values():
        used = names(variable.expression.tree) & entries.keys()
        variable.arguments = tuple(entries[name] for name in sorted(used))
    try:
        TopologicalSorter({v: v.arguments for v in entries.values()}).prepare()
    except CycleError as error:
        loop = error.args[1][::-1]
        way = shown(" -> ".join(variable.name for variable in loop))
        raise ModelFileError(
            f"[{loop[0].section}]: {loop[0].name}: algebraic loop {way}: "
            "solve these equations for one of them first"
        ) from None
    variables = [*in_order(entries.values()), *file.of("states")]
    happening = [expression for event in file.events for expression in event.expressions]
    return [*(v.expression for v in variables), *happening, *file.checks.values()]


def _check_units(file: ModelFile) -> None:
    """Check that units fit, and find those of [where]."""
    declared = [v for v in file.variables.values() if v.section != "where"]
    units = {v.name: unit_of_exponents(v.exponents) for v in declared} | {"time": SECOND}
    for expression in file.order:
        with placed(*expression.place):
            expected = units.get(expression.target)
            if expression.is_rate:
                expected = times(expected, SECOND, -1)
            unit = unit_of(expression.tree, units, expected)
        if expression.target:
            units.setdefault(expression.target, unit)
    for variable in file.of("where"):
        with placed("[where]", variable.name):
            variable.exponents = _whole(units[variable.name])


def _whole(unit: Unit) -> dict[str, int]:
    if any(exponent.denominator > 1 for exponent in unit):
        raise ModelFileError(
            f"has unit {unit_shown(unit)}, whose exponents are no whole numbers: use its square"
        )
    return {base: int(exponent) for base, exponent in zip(BASE, unit, strict=True)}
