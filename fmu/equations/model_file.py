"""The graph of a file with equations."""

import math
from collections.abc import Iterable
from pathlib import Path

import equations_file
from equations_content import COUNTS, OPTIONS, SWITCHES, ModelFile, ModelFileError

from equations.c_code import Fields
from equations.graph import Graph
from rparm.expressions.expression import CONDITION, RELATIONS, derivative_of

__all__ = ["ModelFile", "ModelFileError", "read"]
LEAVES = {
    "parameters": "parameter",
    "inputs": "input",
    "states": "state",
    "discrete": "discrete",
    OPTIONS: "integer",  # conditions are modes
    SWITCHES: "integer",
    COUNTS: "integer",
}


def read(path: Path, solver_names: Iterable[str] = ()) -> ModelFile:
    """Read and check a file for values of its expressions; ModelFileError if something is wrong."""
    file = equations_file.read(path, solver_names)
    # without states nothing is integrated: outputs follow at once
    has_switches = bool(file.of("states") or file.events)
    graph = file.graph = Graph(tables=file.tables, has_switches=has_switches)
    for variable in file.of(*LEAVES):
        op = "mode" if variable.kind == CONDITION else LEAVES[variable.section]
        variable.leaf = graph.value(op, name=variable.name)
    counts = [v.name for v in file.of(COUNTS)]
    calculated = [v.name for v in file.calculated]
    sections = ("parameters", "inputs", "states", "discrete", OPTIONS, SWITCHES)
    names = [[v.name for v in file.of(section)] for section in sections]
    file.fields = Fields([*names, calculated, [*file.modes, *counts]])
    known = {variable.name: variable.leaf for variable in file.of(*LEAVES)}
    known |= {mode: graph.value("mode", name=mode) for mode in file.modes}
    known |= {"time": graph.value("time"), "pi": graph.number(math.pi)}
    for expression in file.order:
        tree = expression.tree
        if expression.event == "when" and tree.op in RELATIONS:
            sides = [graph.of_tree(side, known) for side in tree.arguments]
            expression.value = graph.switch(tree.op, *sides)
        else:
            expression.value = graph.of_tree(tree, known, expression.event == "then")
        if expression.is_rate:
            known[derivative_of(expression.target)] = expression.value
        elif expression.target:
            known.setdefault(expression.target, expression.value)
    return file
