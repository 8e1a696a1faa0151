"""What is to be enclosed: a model's operations as they start, with the numbers of a scenario.

Conditions and segments of tables stay as they are at the start up to the first event: then branches
and entries of tables are known, and what is left is smooth. Guards are the distances of relations
from 0, which must not get there before.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from flint import arb

from rparm.errors import UserError
from rparm.fmu_tools.compiler.expressions.expression import OPERATIONS, in_order
from rparm.fmu_tools.compiler.expressions.parser import parse
from rparm.fmu_tools.compiler.graph.graph import Graph, Value, is_number
from rparm.fmu_tools.compiler.read.content import NUMBER, ModelFile
from rparm.runs.scenario import Scenario

MOST_STATES = 64
Start = Mapping[str, tuple[float, float]]  # value of each state, and by how much it may be off

FUNCTIONS = ("sin", "cos", "exp", "log", "sqrt", "atan", "tanh")
ARITHMETIC = {op: OPERATIONS[op] for op in ("+", "-", "*", "/", "negative")}
OF_BALLS = ARITHMETIC | {name: getattr(arb, name) for name in FUNCTIONS}
OTHERS = {  # other functions of x, or of x and z, by these
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
NUMBERS = ("number", "parameter", "discrete", "mode", "integer", "entry", "locate", "floor")
OF_DOUBLES: dict[str, Callable[..., Any]] = OPERATIONS | {
    "if": lambda _, chosen: chosen, "isnan": math.isnan, "isfinite": math.isfinite,
    "pow": math.pow, "value_of": lambda x: x, "moving_as": lambda x, _: x,
}  # fmt: skip
# what a result without bounds means, by operation
UNBOUNDED = {
    "/": "the divisor may be 0", "sqrt": "sqrt of what may be 0 or less",
    "log": "log of what may be 0 or less",
}  # fmt: skip


class Node(NamedTuple):
    """An operation of the smooth model; its arguments are nodes before it."""

    op: str
    arguments: tuple[int, ...] = ()  # of an input, its place
    number: arb | None = None
    slope: int = -1  # of a function: the node of its derivative


class Problem:
    """A model with the numbers of a scenario, smooth up to the first event.

    Attributes
    ----------
    states, inputs : tuple of str
        The model's; inputs are real numbers.
    names : tuple of str
        What is enclosed: states, then outputs.
    nodes : list of Node
        The states come first, then up to `resting` what moves at communication points only, up to
        `of_rates` what rates follow from, up to `of_series` guards and slopes, up to `of_linear`
        the derivatives of the rates, up to the end outputs.
    rates, outputs : list of int
        Their nodes.
    linear : dict
        The nodes of the derivatives that are not 0, by the places of rate and state.
    guards : list of tuple
        The node of a distance, whether it is above 0, and what it is called.
    """

    def __init__(self, model: ModelFile, scenario: Scenario, with_outputs: bool) -> None:
        self.scenario, self.model = scenario, model
        states = model.of("states")
        self.states = tuple(v.name for v in states)
        if not 0 < len(states) <= MOST_STATES:
            self._fail(f"has {len(states)} states, expected 1 to {MOST_STATES} for a proof")
        inputs = {v.name: scenario.input(v.name) for v in model.of("inputs")}
        self.inputs = tuple(v.name for v in model.of("inputs") if v.kind == NUMBER)
        for name in inputs.keys() - {*self.inputs}:
            if np.any(inputs[name] != inputs[name][0]):
                self._fail(f"inputs.{name}: expected a constant value of what is no real number")
        if model.contacts:
            name = model.contacts[0].name
            self._fail(f"{name}: nothing can be proven of a motion with friction or stops")
        outputs = [v for v in model.of("outputs") if v.is_real] if with_outputs else []
        self.names = (*self.states, *(v.name for v in outputs))
        self.tables = {
            name: (numbers, len(table.axes[-1].origins))
            for table in model.tables.values() for name, _, numbers in table.arrays()
        }  # fmt: skip
        self.texts = dict(zip(model.graph.relations, model.relation_texts, strict=True))
        self.values: dict[Value, Any] = {}  # in doubles, by which an FMU decides
        self.known = {**scenario.start_values, **{name: x[0] for name, x in inputs.items()}}
        self.known |= model.modes
        for v in model.of("states", "discrete", "counts"):
            start = v.start if v.initial is None else self._start(v.initial.value)
            self.known[v.name] = scenario.initial.get(v.name, start)
        self.places: dict[Value, str] = {}
        for e in model.order:
            for value in in_order([e.value], self.places):
                self.places[value] = ": ".join((*e.place, e.text))
        self.graph, self.smooth = Graph(has_switches=False, is_guarded=False), {}
        self.guarded: dict[Value, tuple[bool, str]] = {}
        self._number(
            [self._smooth(v.value) for v in states],
            [self._smooth(v.value) for v in outputs],
            {v.name: self._smooth(v.initial.value) for v in states if v.initial is not None},
        )

    def _fail(self, text: str) -> None:
        raise UserError(f"{self.scenario.path}: {text}")

    # ---- Values at the start -----------------------------------------------------------------

    def _start(self, root: Value) -> Any:
        """Return a value at the start; not a number where there is none."""
        graph = self.model.graph

        def read(value: Value) -> tuple[Value, ...]:
            if value.name in graph.relations:
                return (graph.relations[value.name].distance,)
            if value.name in graph.segments:
                return (graph.segments[value.name].argument,)
            is_choice = value.op == "if"
            return (value.arguments[0], self._branch(value)) if is_choice else value.arguments

        for value in in_order([root], self.values, read):
            try:
                self.values[value] = self._calculated(value, *(self.values[x] for x in read(value)))
            except (ArithmeticError, ValueError, TypeError, IndexError):
                self.values[value] = math.nan
        return self.values[root]

    def _branch(self, choice: Value) -> Value:
        return choice.arguments[1 if self._start(choice.arguments[0]) else 2]

    def _calculated(self, value: Value, *given: Any) -> Any:
        name, graph = value.name, self.model.graph
        if name in graph.relations:
            return given[0] > 0 or (graph.relations[name].includes_zero and given[0] == 0)
        if name in graph.segments:
            bounds = graph.segments[name].bounds
            return self._segment(bounds, *given) if bounds else math.floor(*given)
        match value.op:
            case "number":
                return value.number
            case "time":
                return self.scenario.start
            case "locate":
                return self._segment(name, *given)
            case "entry":
                numbers, columns = self.tables[name]
                return numbers[given[0] if len(given) == 1 else given[0] * columns + given[1]]
        if value.op not in OF_DOUBLES and name not in self.known:
            self._fail(f"{self.places.get(value, value.op)}: {value.op} cannot be enclosed")
        return OF_DOUBLES[value.op](*given) if value.op in OF_DOUBLES else self.known[name]

    def _segment(self, bounds: str, x: float) -> int:
        return max(bisect_right(self.tables[bounds][0], x) - 1, 0)

    # ---- What is smooth ----------------------------------------------------------------------

    def _smooth(self, root: Value) -> Value:
        """Return what a value is by the branches of the start, in another graph."""

        def read(value: Value) -> Sequence[Value]:
            if value.op == "if":
                return (self._branch(value),)
            return () if value.op in NUMBERS else value.arguments

        for value in in_order([root], self.smooth, read):
            place = self.places.get(value, "")
            if value.op in NUMBERS:
                self._keep(value)
                number = float(self._start(value))
                if not math.isfinite(number):
                    self._fail(f"{place}: {value.name or value.op} has no finite value")
                found = self.graph.number(number)
            elif value.op == "if":
                self._keep(value.arguments[0])
                found = self.smooth[read(value)[0]]
            elif value.op in OF_BALLS or value.op in OTHERS:
                found = self._function(value.op, *(self.smooth[x] for x in value.arguments))
            elif value.op in ("state", "input", "time"):
                found = self.graph.value(value.op, name=value.name)
            else:
                self._fail(f"{place}: {value.op} cannot be enclosed")
            self.smooth[value] = found
            for new in in_order([found], self.places):
                self.places[new] = place
        return self.smooth[root]

    def _function(self, op: str, x: Value, *others: Value) -> Value:
        z = others[0] if others else x
        if op == "pow" and z.op == "number":
            if (whole := abs(z.number)) in range(1, MOST_MULTIPLIED):
                power = self._product(x, int(whole))
                return (
                    self.graph.value("/", self.graph.number(1.0), power) if z.number < 0 else power
                )
            if z.number == 0.5:
                return self.graph.value("sqrt", x)
        if op in OTHERS:
            return self.graph.of_tree(OTHERS[op], {"x": x, "z": z})
        return self.graph.value(op, x, *others)

    def _product(self, x: Value, count: int) -> Value:
        """x^count by squares."""
        if count == 1:
            return x
        half = self._product(x, count // 2)
        square = self.graph.value("*", half, half)
        return self.graph.value("*", square, x) if count % 2 else square

    # ---- What ends it ------------------------------------------------------------------------

    def _keep(self, value: Value) -> None:
        """Guard what a condition or a whole number follows from."""
        graph, holds = self.model.graph, self._start(value)
        if value.name in graph.relations:
            self.guarded[graph.relations[value.name].distance] = bool(holds), self.texts[value.name]
        elif value.name in graph.segments:
            segment = graph.segments[value.name]
            for side in ("low", "high"):
                relation = getattr(segment, side)
                text = f"{self.texts[relation.name]}, {side}"
                self.guarded[relation.distance] = side == "low", text
        elif value.op in ("and", "or") and bool(holds) == (value.op == "or"):  # one decides
            self._keep(next(x for x in value.arguments if bool(self._start(x)) == bool(holds)))
        elif value.op not in ("isnan", "isfinite"):  # what is bounded is finite
            for x in value.arguments:
                self._keep(x)

    def _guard_changes(self) -> None:
        """Guard the conditions of events, and ticks of samplers."""
        for event in self.model.events:
            conditions = [e.value for e in event.conditions]
            no = next((x for x in conditions if not self._start(x)), None)
            if no is None:
                self._fail(f"event {event.name} is at the start, nothing can be proven before it")
            self._keep(no)
        for sampler in self.model.sampled:
            every, offset = (self._start(e.value) for e in sampler.periods)
            name, graph = f"sampler {sampler.name}", self.model.graph
            if every == 0:  # it never ticks
                continue
            if not offset > 0:
                self._fail(f"{name} ticks at the start, nothing can be proven before it")
            at = graph.number(self.scenario.start + offset)
            self.guarded[graph.value("-", graph.value("time"), at)] = False, name

    # ---- As it is enclosed -------------------------------------------------------------------

    def _number(
        self, rates: list[Value], outputs: list[Value], starts: Mapping[str, Value]
    ) -> None:
        """Number the nodes that are needed."""
        self._guard_changes()
        while left := [x for x in self.guarded if x not in self.smooth]:
            for distance in left:  # which may follow from other relations
                self._smooth(distance)
        states = [self.graph.value("state", name=name) for name in self.states]
        of_rates = in_order([*states, *rates])
        of_series = [*of_rates, *in_order([self.smooth[x] for x in self.guarded], {*of_rates})]
        slopes: dict[Value, Value] = {}
        for value in of_series:  # which grows
            if value.op in FUNCTIONS and moves(value):
                (slopes[value],) = self.graph.partials(value)
                of_series += in_order([slopes[value]], {*of_series})
                for new in in_order([slopes[value]], self.places):
                    self.places[new] = self.places[value]
        linear = {
            (i, self.states.index(state.name)): slope
            for i, row in enumerate(self.graph.gradients(rates, states))
            for state, slope in row.items() if not is_number(slope, 0.0)
        }  # fmt: skip
        of_linear = in_order(linear.values(), {*of_series})
        last = in_order([*outputs, *starts.values()], {*of_series, *of_linear})
        groups = of_rates, of_series[len(of_rates) :], of_linear, last
        order = dict.fromkeys(states)
        order |= dict.fromkeys(x for group in groups for x in group if not moves(x))
        self.resting = len(order)
        ends = []
        for group in groups:
            order |= dict.fromkeys(group)
            ends.append(len(order))
        self.of_rates, self.of_series, self.of_linear, _ = ends
        self.order = [*order]
        place = {value: i for i, value in enumerate(order)}
        self.nodes = [
            Node(
                x.op,
                (self.inputs.index(x.name),)
                if x.op == "input"
                else tuple(place[y] for y in x.arguments),
                arb(x.number) if x.op == "number" else None,
                place[slopes[x]] if x in slopes else -1,
            )
            for x in order
        ]
        self.rates = [place[x] for x in rates]
        self.outputs = [*range(len(states)), *(place[x] for x in outputs)]
        self.linear = {at: place[x] for at, x in linear.items()}
        self.guards = [(place[self.smooth[x]], *guard) for x, guard in self.guarded.items()]
        self.starts = {name: place[x] for name, x in starts.items()}

    def balls(
        self,
        states: Sequence[arb],
        resting: Sequence[arb],
        time: arb,
        count: int,
        inputs: Sequence[arb] = (),
    ) -> list[arb]:
        """Return the values of the first nodes; `resting`: of those after the states."""
        found = [*states, *resting]
        for node in self.nodes[len(found) : count]:
            match node.op:
                case "number":
                    found.append(node.number)
                case "input":
                    found.append(inputs[node.arguments[0]])
                case "time":
                    found.append(time)
                case op:
                    found.append(OF_BALLS[op](*(found[i] for i in node.arguments)))
        return found

    def resting_balls(self, inputs: Sequence[arb]) -> list[arb]:
        """Return the values of nodes that move at communication points only."""
        none = [arb(0)] * len(self.states)
        return self.balls(none, [], arb(0), self.resting, inputs)[len(none) :]

    def start_balls(self, start: Start, resting: Sequence[arb]) -> list[arb]:
        """Return the states; exactly what follows from parameters, where that is asked for."""
        known = {n: resting[node - len(start)] for n, node in self.starts.items()}
        return [
            known[name] if name in known and value == self.known[name] else arb(value)
            for name, (value, _) in start.items()
        ]

    def held(self) -> list[list[arb]]:
        """Return the inputs in each communication step."""
        values = [self.scenario.input(name) for name in self.inputs]
        return [[arb(float(x[i])) for x in values] for i in range(len(self.scenario.times) - 1)]

    def reason(self, kind: str, where: int) -> str:
        """Say what ends a proof: an event, or what cannot be enclosed."""
        if kind == "event":
            return self.guards[where][2]
        if kind == "undefined":
            value = self.order[where]
            what = UNBOUNDED.get(value.op, "may grow beyond all bounds")
            return f"{self.places[value]}: {what}"
        return f"{self.states[where]} grows too fast, or is too uncertain"


def moves(value: Value) -> bool:
    """Return whether a value may change along a motion."""
    return any(op in ("state", "time") for op, _ in value.leaves)
