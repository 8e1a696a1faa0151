"""The motion of a model as data, for proofs: operations that rates, outputs and events follow from.

A node is an operation with the numbers of its arguments, which are before it, and of what it
depends on: a mode on the distance that it compares with 0, a segment on the number that it holds.
Functions of the graph become those of `SLOPED`, whose slopes are nodes, too.
"""

from collections.abc import Iterator
from typing import Any

from ..expressions.expression import in_order
from ..expressions.parser import parse
from ..graph.graph import Graph, Value
from ..read.content import ModelFile, Variable

SLOPED = ("sin", "cos", "exp", "log", "sqrt", "atan", "tanh")
TEXTS = {  # other functions of x, or of x and z
    name: parse(text)
    for name, text in {
        "tan": "sin(x) / cos(x)",
        "asin": "atan(x / sqrt((1 - x) * (1 + x)))",
        "acos": "2 * atan(sqrt((1 - x) / (1 + x)))",
        "atan2": "2 * atan(x / (z + sqrt(x * x + z * z)))",
        "sinh": "(exp(x) - exp(-x)) / 2",
        "cosh": "(exp(x) + exp(-x)) / 2",
        "hypot": "sqrt(x * x + z * z)",
        "pow": "exp(z * log(x))",
        "value_of": "x",
        "moving_as": "x",
    }.items()
}
MOST_MULTIPLIED = 1024  # whole exponents that are products


def motion(file: ModelFile) -> dict[str, Any]:
    """Return the motion of a file with equations, as JSON has it."""
    found = _Motion(file)
    graph, add = file.graph, found.add
    texts = dict(zip(graph.relations, file.relation_texts, strict=True))
    changes = [("event", event, event.conditions) for event in file.events]
    changes += [("sampler", sampler, sampler.periods) for sampler in file.sampled]
    return {
        "name": file.name,
        "rates": {v.name: add(v.value) for v in file.of("states")},
        "inputs": [v.name for v in file.of("inputs")],
        "outputs": {v.name: add(v.value) for v in file.of("outputs") if v.is_real},
        "starts": {name: start for name, start in found.starts()},
        "changes": [
            {"kind": kind, "name": change.name, "values": [add(e.value) for e in expressions]}
            for kind, change, expressions in changes
        ],
        "relations": {
            name: {"distance": add(r.distance), "zero": r.includes_zero, "text": texts[name]}
            for name, r in graph.relations.items()
        },
        "segments": {
            name: {
                "argument": add(s.argument), "bounds": s.bounds,
                "low": s.low.name, "high": s.high.name,
            }
            for name, s in graph.segments.items()
        },
        "tables": {
            name: numbers for table in file.tables.values() for name, _, numbers in table.arrays()
        },
        "columns": {
            table.array("c", i): len(table.axes[-1].origins)
            for table in file.tables.values() for i in range(len(table.coefficients))
        },
        "slopes": found.slopes(),
        "nodes": found.rows,
        "places": found.places,
    }  # fmt: skip


class _Motion:
    """The nodes that were added."""

    def __init__(self, file: ModelFile) -> None:
        self.file = file
        self.graph: Graph = file.graph
        self.rows: list[tuple[str, list[int], str, float]] = []
        self.places: list[str] = []
        self.numbers: dict[Value, int] = {}
        self.simple: dict[Value, Value] = {}  # by the value of the file
        self.texts: dict[Value, str] = {}  # of values of the file: where they are first
        for expression in file.order:
            place = ": ".join((*expression.place, expression.text))
            for value in in_order([expression.value]):
                self.texts.setdefault(value, place)

    def starts(self) -> Iterator[tuple[str, Any]]:
        """Yield start values: numbers, and the nodes of those that follow from parameters."""
        for v in self.file.of("states", "discrete", "counts"):
            yield v.name, self._start(v)
        yield from self.file.modes.items()

    def _start(self, variable: Variable) -> Any:
        if variable.initial is None:
            return variable.start
        return {"node": self.add(variable.initial.value)}

    def add(self, root: Value) -> int:
        """Add what a value follows from; its number."""
        todo = [root]
        while todo:
            value = todo[-1]
            left = [x for x in self._before(value) if x not in self.simple]
            todo += left
            if not left:
                self.simple[value] = self._simple(value)
                self._add_all(self.simple[value], self.texts.get(value, ""))
                todo.pop()
        return self.numbers[self.simple[root]]

    def _before(self, value: Value) -> list[Value]:
        """What a value depends on."""
        if value.op == "mode" and value.name in self.graph.relations:
            return [self.graph.relations[value.name].distance]
        if value.op == "integer" and value.name in self.graph.segments:
            return [self.graph.segments[value.name].argument]
        return [*value.arguments]

    def _simple(self, value: Value) -> Value:
        """The same with other functions."""
        arguments = [self.simple[x] for x in value.arguments]
        if value.op == "pow" and arguments[1].op == "number":
            whole = abs(arguments[1].number)
            if whole in range(1, MOST_MULTIPLIED):
                power = self._product(arguments[0], int(whole))
                is_below = arguments[1].number < 0
                return self.graph.value("/", self.graph.number(1.0), power) if is_below else power
            if arguments[1].number == 0.5:
                return self.graph.value("sqrt", arguments[0])
        if value.op in TEXTS:
            return self.graph.of_tree(TEXTS[value.op], {"x": arguments[0], "z": arguments[-1]})
        return self.graph.value(value.op, *arguments, name=value.name, number=value.number)

    def _product(self, x: Value, count: int) -> Value:
        """x^count by squares."""
        half = self._product(x, count // 2) if count > 1 else x
        square = self.graph.value("*", half, half) if count > 1 else x
        return self.graph.value("*", square, x) if count > 1 and count % 2 else square

    def _add_all(self, root: Value, place: str) -> None:
        for value in in_order([root]):
            if value not in self.numbers:
                self.numbers[value] = len(self.rows)
                before = [self.simple.get(x, x) for x in self._before(value)]
                places = [self.numbers[x] for x in before]
                self.rows.append((value.op, places, value.name, value.number))
                self.places.append(place)

    def slopes(self) -> dict[int, int]:
        """Add the slopes of functions; their nodes by those of the functions."""
        found: dict[int, int] = {}
        values = [*self.numbers]
        for value in values:
            if value.op in SLOPED:
                (slope,) = self.graph.partials(value)
                self._add_all(slope, self.places[self.numbers[value]])
                found[self.numbers[value]] = self.numbers[slope]
                values += [x for x in in_order([slope]) if x.op in SLOPED and x not in values]
        return found
