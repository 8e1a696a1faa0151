"""Reads the file of a model, checks what its expressions mean, and makes a graph of them.

Every mistake is a ModelFileError: file, line, section, name, column and what was expected, in one
line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable
from pathlib import Path

from equations.file_tables import (
    Expression,
    ModelFile,
    ModelFileError,
    Variable,
    placed,
    read_tables,
    shown,
    tables_of,
)
from rparm.expressions.kinds import check_kinds
from rparm.expressions.tree import names
from rparm.expressions.units import ONE, times, unit_of, unit_of_exponents

__all__ = ["ModelFile", "ModelFileError", "read"]
LEAVES = {"parameters": "parameter", "inputs": "input", "states": "state"}
QUOTES = r"[\s\"']"
SECOND = unit_of_exponents({"s": 1})


def read(path: Path, solver_names: Iterable[str] = ()) -> ModelFile:
    """Read and check a file; solver_names: of the variables that every model has.

    ModelFileError if something in it is wrong.
    """
    with placed(path):
        text, tables = tables_of(path)
        try:
            file = read_tables(text, tables, solver_names)
            _check_names(file)
            _check_units(file)
            _make_graph(file)
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
        heads = [i for i, line in enumerate(plain, 1) if line == f"[{head}]"]
        heads = heads or [i for i, line in enumerate(plain, 1) if line.startswith(f"[{head}.")]
        if not heads:
            above, _, key = head.rpartition(".")
            heads = [i for i, line in enumerate(plain, 1) if line == f"[{above}]"]
        begin = heads[0] if len(heads) == 1 else len(lines)
    for i, line in enumerate(lines[begin:], begin + 1):
        if line.lstrip().startswith("["):
            break
        if key and re.match(rf"\s*[\"']?{key}\b.*=", line):
            return f"line {i}: "
    return f"line {begin}: " if 0 < begin < len(lines) else ""


def _check_names(file: ModelFile) -> None:
    """Check the names and kinds in all expressions."""
    known = {*file.variables, *file.modes, "time"}
    parameters = {variable.name for variable in file.of("parameters")}
    for expressions, allowed, mistake in (
        (_calculated(file), known, "unknown name {}"),
        (file.checks.values(), parameters, "{} is no parameter"),
    ):
        for expression in expressions:
            with placed(*expression.place):
                for name in sorted(names(expression.tree) - allowed):
                    raise ModelFileError(mistake.format(shown(name)))
                check_kinds(expression.tree, expression.kind, file.modes)


def _calculated(file: ModelFile) -> list[Expression]:
    """All expressions but conditions on parameters."""
    found = [variable.expression for variable in file.of("states", "where", "outputs")]
    return found + [expression for event in file.events for expression in event.expressions]


def _check_units(file: ModelFile) -> None:
    """Check that units fit, and find those of [where]."""
    units = {"time": SECOND}
    for variable in file.variables.values():
        with placed(f"[{variable.section}]", variable.name, "unit"):
            units[variable.name] = unit_of_exponents(file.exponents(variable.unit or "1"))
    file.found_units = dict.fromkeys(units, ONE)
    if file.has_units:
        order = [v.expression for v in in_order_of_use(file)]
        names_of = {v.expression.place: v.name for v in file.of("where")}
        for expression in [*order, *_calculated(file), *file.checks.values()]:
            with placed(*expression.place):
                expected = units.get(expression.target)
                if expression.is_rate:
                    expected = times(expected, SECOND, -1)
                unit = unit_of(expression.tree, units, expected)
                if expression.place in names_of:
                    units[names_of[expression.place]] = unit
        file.found_units = units


def in_order_of_use(file: ModelFile) -> list[Variable]:
    """Entries of [where] and [outputs], each after those that it names."""
    entries = {variable.name: variable for variable in file.of("where", "outputs")}
    needed_by = {
        name: sorted(names(v.expression.tree) & entries.keys()) for name, v in entries.items()
    }
    done: dict[str, Variable] = {}
    for first in entries:
        way = {first: None}  # a name and what it needs, down to one that needs nothing
        while way:
            name = next(reversed(way))
            needed = next((other for other in needed_by[name] if other not in done), None)
            if needed is None:
                done[name] = entries[name]
                way.popitem()
            elif needed in way:
                loop = " -> ".join([*list(way)[list(way).index(needed) :], needed])
                raise ModelFileError(
                    f"[{entries[name].section}]: {name}: algebraic loop {shown(loop)}: "
                    "solve these equations for one of them first"
                )
            else:
                way[needed] = None
    return list(done.values())


def _make_graph(file: ModelFile) -> None:
    """Give each expression its value."""
    graph = file.graph
    known = {v.name: graph.value(op, name=v.name) for s, op in LEAVES.items() for v in file.of(s)}
    known |= {mode: graph.value("mode", name=mode) for mode in file.modes}
    known |= {"time": graph.value("time"), "pi": graph.number(math.pi)}
    # without states nothing is integrated: outputs follow at once
    graph.has_switches = bool(file.of("states") or file.events)

    def find(expressions: Collection[Expression], is_instant: bool = False) -> None:
        for expression in expressions:
            expression.value = graph.of_tree(expression.tree, known, is_instant)

    for variable in in_order_of_use(file):
        find([variable.expression])
        known[variable.name] = variable.value
    find([state.expression for state in file.of("states")])
    for event in file.events:
        sides = [graph.of_tree(side, known) for side in event.when.tree.arguments]
        event.when.value = graph.switch(event.when.tree.op, *sides)
        find([event.during] if event.during else [])
        find([*event.reinit.values(), *event.set.values()], is_instant=True)
    find(file.checks.values())
