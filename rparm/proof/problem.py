"""What is to be enclosed: a model's operations as they start, with the numbers of a scenario.

A model comes as `fmu/compiler/write/motion.py` has it. Conditions and segments of tables stay as
they are at the start up to the first event: then branches and entries of tables are known, and what
is left is smooth. Guards are the distances of relations from 0, which must not get there before.
"""

import math
import operator
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from flint import arb

from rparm.errors import UserError
from rparm.runs.scenario import Scenario

MOST_STATES = 64
Start = Mapping[str, tuple[float, float]]  # value of each state, and by how much it may be off

FUNCTIONS = ("sin", "cos", "exp", "log", "sqrt", "atan", "tanh")
ARITHMETIC: dict[str, Callable[..., Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "negative": operator.neg,
}  # fmt: skip
OF_DOUBLES: dict[str, Callable[..., Any]] = ARITHMETIC | {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq,
    "and": lambda a, b: a and b, "or": lambda a, b: a or b, "not": operator.not_,
    "if": lambda c, a, b: a if c else b, "isnan": math.isnan, "isfinite": math.isfinite,
    "floor": math.floor, **{name: getattr(math, name) for name in FUNCTIONS},
}  # fmt: skip
OF_BALLS = ARITHMETIC | {name: getattr(arb, name) for name in FUNCTIONS}
NUMBERS = ("number", "parameter", "discrete", "mode", "integer", "entry", "locate", "floor")
# what a result without bounds means, by operation
UNBOUNDED = {
    "/": "the divisor may be 0", "sqrt": "sqrt of what may be 0 or less",
    "log": "log of what may be 0 or less",
}  # fmt: skip


class Node(NamedTuple):
    """An operation of the smooth model; its arguments are nodes before it."""

    op: str
    arguments: tuple[int, ...]  # of an input, its place
    moves: bool  # along a motion
    number: arb | None = None
    slope: int | None = None  # of a function: the node of its derivative
    origin: int = -1  # the node of the model that it is


class Problem:
    """A model with the numbers of a scenario, smooth up to the first event.

    Attributes
    ----------
    states, inputs : tuple of str
        The model's; inputs are real numbers.
    names : tuple of str
        What is enclosed: states, then outputs.
    nodes : list of Node
        The states come first, then what rates follow from, then guards and slopes.
    rates, outputs : list of int
        Their nodes.
    guards : list of tuple
        The node of a distance, whether it is above 0, and what it is called.
    """

    def __init__(self, model: Mapping[str, Any], scenario: Scenario, with_outputs: bool) -> None:
        self.scenario, self.model, self.given = scenario, model, [*map(tuple, model["nodes"])]
        self.slopes = {int(function): slope for function, slope in model["slopes"].items()}
        self.places: list[str] = [*model["places"]]
        self.states = tuple(model["rates"])
        if not 0 < len(self.states) <= MOST_STATES:
            self._fail(f"has {len(self.states)} states, expected 1 to {MOST_STATES} for a proof")
        of_conditions = {name for op, _, name, _ in self.given if op in ("mode", "integer")}
        self.inputs = tuple(n for n in model["inputs"] if n not in of_conditions)
        outputs = model["outputs"] if with_outputs else {}
        self.names = (*self.states, *outputs)
        self.guarded: dict[int, tuple[bool, str]] = {}
        self.known = dict(scenario.start_values)
        for name in set(model["inputs"]) - {*self.inputs}:
            self.known[name] = scenario.input(name)[0]
            if np.any(scenario.input(name) != self.known[name]):
                self._fail(f"inputs.{name}: expected a constant value of what is no real number")
        self.values: list[Any] = []
        self._evaluate()
        self._number([*model["rates"].values()], [*outputs.values()])

    def _fail(self, text: str) -> None:
        raise UserError(f"{self.scenario.path}: {text}")

    # ---- Values at the start, in doubles, by which an FMU decides ------------------------------

    def _evaluate(self) -> None:
        for name in self.inputs:
            self.known[name] = self.scenario.input(name)[0]
        for _ in range(2):  # in the second round with starts that follow from parameters
            self.values = []
            for node in self.given:
                try:
                    self.values.append(self._value(*node))
                except (ArithmeticError, ValueError, TypeError, KeyError, IndexError):
                    self.values.append(math.nan)
            for name, start in self.model["starts"].items():
                value = self.values[start["node"]] if isinstance(start, dict) else start
                self.known[name] = self.scenario.initial.get(name, value)

    def _value(self, op: str, arguments: list[int], name: str, number: float) -> Any:
        given = [self.values[i] for i in arguments]
        if op == "number":
            return number
        if op == "time":
            return self.scenario.start
        if op == "mode" and name in self.model["relations"]:
            return given[0] > 0 or (self.model["relations"][name]["zero"] and given[0] == 0)
        if op == "integer" and name in self.model["segments"]:
            bounds = self.model["segments"][name]["bounds"]
            return self._segment(bounds, given[0]) if bounds else math.floor(given[0])
        if op == "locate":
            return self._segment(name, given[0])
        if op == "entry":
            place = (
                given[0] if len(given) == 1 else given[0] * self.model["columns"][name] + given[1]
            )
            return self.model["tables"][name][place]
        return OF_DOUBLES[op](*given) if op in OF_DOUBLES else self.known[name]

    def _segment(self, bounds: str, x: float) -> int:
        return max(bisect_right(self.model["tables"][bounds], x) - 1, 0)

    # ---- What is needed --------------------------------------------------------------------------

    def _needed(self, roots: Iterable[int], found: dict[int, None]) -> None:
        """Add what these follow from, by the branches of the start."""
        todo = [*roots]
        while todo:
            i = todo.pop()
            op, arguments, _, _ = self.given[i]
            if i in found:
                continue
            found[i] = None
            if op == "if":
                self._keep(arguments[0])
                todo.append(arguments[1 if self.values[arguments[0]] else 2])
            elif op in NUMBERS:
                self._keep(i)
            elif op in OF_BALLS or op in ("state", "input", "time"):
                todo += arguments
            else:
                self._fail(f"{self.places[i]}: {op} cannot be enclosed")

    def _keep(self, i: int) -> None:
        """Guard what a condition or a whole number follows from."""
        op, arguments, name, _ = self.given[i]
        if op == "mode" and name in self.model["relations"]:
            relation = self.model["relations"][name]
            self.guarded[relation["distance"]] = bool(self.values[i]), relation["text"]
        elif op == "integer" and name in self.model["segments"]:
            for side, is_positive in (("low", True), ("high", False)):
                relation = self.model["relations"][self.model["segments"][name][side]]
                self.guarded[relation["distance"]] = is_positive, f"{relation['text']}, {side}"
        elif op in ("and", "or") and bool(self.values[i]) == (op == "or"):  # one decides
            self._keep(next(j for j in arguments if bool(self.values[j]) == (op == "or")))
        elif op not in ("isnan", "isfinite"):  # what is bounded is finite
            for j in arguments:
                self._keep(j)

    def _guard_changes(self) -> None:
        """Guard the conditions of events, and ticks of samplers."""
        for change in self.model["changes"]:
            name, nodes = f"{change['kind']} {change['name']}", change["values"]
            values = [self.values[i] for i in nodes]
            if change["kind"] == "event":
                no = next((i for i, value in zip(nodes, values, strict=True) if not value), None)
                if no is None:
                    self._fail(f"{name} is at the start, nothing can be proven before it")
                self._keep(no)
                continue
            if not values[1] > 0:
                self._fail(f"{name} ticks at the start, nothing can be proven before it")
            tick = len(self.given)
            at = self.scenario.start + values[1]
            self.given += [("time", [], "", 0.0), ("number", [], "", at)]
            self.given.append(("-", [tick, tick + 1], "", 0.0))
            self.values += [self.scenario.start, at, -values[1]]
            self.places += [name] * 3
            self.guarded[tick + 2] = False, name

    # ---- As it is enclosed -----------------------------------------------------------------------

    def _number(self, rates: list[int], outputs: list[int]) -> None:
        """Number the nodes that are needed anew."""
        of_rates: dict[int, None] = {}
        self._needed(rates, of_rates)
        self._guard_changes()
        starts = {
            n: x["node"] for n, x in self.model["starts"].items()
            if n in self.states and isinstance(x, dict)
        }  # fmt: skip
        of_outputs: dict[int, None] = {}
        self._needed([*outputs, *starts.values()], of_outputs)
        of_series, last = dict(of_rates), -1
        while len(of_series) > last:  # distances may follow from other relations
            last = len(of_series)
            self._needed([self.slopes[i] for i in of_series if i in self.slopes], of_series)
            self._needed(self.guarded, of_series)
        place = {i: self.states.index(name) for i, (op, _, name, _) in enumerate(self.given)
                 if op == "state"}  # fmt: skip
        self.nodes = [Node("state", (), moves=True) for _ in self.states]
        ends = []
        for group in (of_rates, of_series, of_outputs):
            for i in sorted(set(group) - place.keys()):
                node = self._node(i, place)
                if node is not None:
                    place[i] = len(self.nodes)
                    self.nodes.append(node)
            ends.append(len(self.nodes))
        self.of_rates, self.of_series, _ = ends  # how many nodes these follow from
        for k, node in enumerate(self.nodes[: self.of_series]):
            if node.op in FUNCTIONS and node.moves:
                self.nodes[k] = node._replace(slope=place[self.slopes[node.origin]])
        self.rates = [place[i] for i in rates]
        self.outputs = [*range(len(self.states)), *(place[i] for i in outputs)]
        self.guards = [(place[i], *guard) for i, guard in self.guarded.items()]
        self.starts = {name: place[i] for name, i in starts.items()}

    def _node(self, i: int, place: dict[int, int]) -> Node | None:
        """Return what is enclosed of an operation; None: it is one of its branches."""
        op, arguments, name, _ = self.given[i]
        if op == "if":
            place[i] = place[arguments[1 if self.values[arguments[0]] else 2]]
            return None
        if op in NUMBERS:
            if not math.isfinite(self.values[i]):
                self._fail(f"{self.places[i]}: {name or op} has no finite value")
            return Node("number", (), moves=False, number=arb(float(self.values[i])), origin=i)
        if op == "input":
            return Node(op, (self.inputs.index(name),), moves=False, origin=i)
        given = tuple(place[j] for j in arguments)
        moves = op == "time" or any(self.nodes[j].moves for j in given)
        return Node(op, given, moves, origin=i)

    def start(self, start: Start) -> list[arb]:
        """Return the states; exactly what follows from parameters, where that is asked for."""
        inputs, time = [arb(0)] * len(self.inputs), arb(self.scenario.times[0])
        known = self.balls([arb(0)] * len(self.states), inputs, time, len(self.nodes))
        return [
            known[self.starts[name]] if name in self.starts and value == self.known[name]
            else arb(value)
            for name, (value, _) in start.items()
        ]  # fmt: skip

    def held(self) -> list[list[arb]]:
        """Return the inputs in each communication step."""
        values = [self.scenario.input(name) for name in self.inputs]
        return [[arb(float(x[i])) for x in values] for i in range(len(self.scenario.times) - 1)]

    def balls(
        self, states: Sequence[arb], inputs: Sequence[arb], time: arb, count: int
    ) -> list[arb]:
        """Return the values of the first nodes."""
        found = [*states]
        for node in self.nodes[len(states) : count]:
            match node.op:
                case "number":
                    found.append(node.number)
                case "input":
                    found.append(inputs[node.arguments[0]])
                case "time":
                    found.append(time)
                case _:
                    found.append(OF_BALLS[node.op](*(found[i] for i in node.arguments)))
        return found

    def reason(self, kind: str, where: int) -> str:
        """Say what ends a proof: an event, or what cannot be enclosed."""
        if kind == "event":
            return self.guards[where][2]
        if kind == "undefined":
            node = self.nodes[where].origin
            what = UNBOUNDED.get(self.given[node][0], "may grow beyond all bounds")
            return f"{self.places[node]}: {what}"
        return f"{self.states[where]} grows too fast, or is too uncertain"
