"""The problem for the program that encloses motions: a model's operations as they start.

A model comes as `fmu/compiler/write/motion.py` has it. Conditions and segments of tables stay as
they are at the start up to the first event: then branches and entries of tables are known, and what
is left is smooth. Guards are the distances of relations from 0, which must not get there before.
"""

import math
import operator
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from rparm.errors import UserError
from rparm.runs.scenario import Scenario

MOST_STATES = 64
Start = Mapping[str, tuple[float, float]]  # value of each state, and by how much it may be off

FUNCTIONS: dict[str, Callable[..., float]] = {
    name: getattr(math, name) for name in ("sin", "cos", "exp", "log", "sqrt", "atan", "tanh")
}
OPERATIONS: dict[str, Callable[..., Any]] = FUNCTIONS | {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "negative": operator.neg, "<": operator.lt, "<=": operator.le, ">": operator.gt,
    ">=": operator.ge, "==": operator.eq, "and": lambda a, b: a and b, "or": lambda a, b: a or b,
    "not": operator.not_, "if": lambda c, a, b: a if c else b, "isnan": math.isnan,
    "isfinite": math.isfinite, "floor": math.floor,
}  # fmt: skip
ENCLOSED = ("state", "input", "time", "+", "-", "*", "/", "negative", *FUNCTIONS)
NUMBERS = ("number", "parameter", "discrete", "mode", "integer", "entry", "locate", "floor")
# what a result without bounds means, by operation
UNBOUNDED = {
    "/": "the divisor may be 0", "sqrt": "sqrt of what may be 0 or less",
    "log": "log of what may be 0 or less",
}  # fmt: skip


class Problem:
    """A model with the numbers of a scenario, smooth up to the first event.

    Attributes
    ----------
    states, inputs : tuple of str
        The model's; inputs are real numbers.
    names : tuple of str
        What is enclosed: states, then outputs.
    guards : dict of int to tuple
        By the node of a distance: whether it is above 0, and what it is called.
    """

    def __init__(self, model: Mapping[str, Any], scenario: Scenario, with_outputs: bool) -> None:
        self.scenario, self.model, self.nodes = scenario, model, [*map(tuple, model["nodes"])]
        self.slopes = {int(function): slope for function, slope in model["slopes"].items()}
        self.places: list[str] = [*model["places"]]
        self.states = tuple(model["rates"])
        if not 0 < len(self.states) <= MOST_STATES:
            self._fail(f"has {len(self.states)} states, expected 1 to {MOST_STATES} for a proof")
        of_conditions = {name for op, _, name, _ in self.nodes if op in ("mode", "integer")}
        self.inputs = tuple(n for n in model["inputs"] if n not in of_conditions)
        outputs = model["outputs"] if with_outputs else {}
        self.names = (*self.states, *outputs)
        self.guards: dict[int, tuple[bool, str]] = {}
        self.known = dict(scenario.start_values)
        for name in set(model["inputs"]) - {*self.inputs}:
            self.known[name] = scenario.input(name)[0]
            if np.any(scenario.input(name) != self.known[name]):
                self._fail(f"inputs.{name}: expected a constant value of what is no real number")
        self.values: list[Any] = []
        self._evaluate()
        self.lines = [*self._numbered([*model["rates"].values()], [*outputs.values()])]

    def _fail(self, text: str) -> None:
        raise UserError(f"{self.scenario.path}: {text}")

    # ---- Values at the start, in doubles, by which an FMU decides ------------------------------

    def _evaluate(self) -> None:
        for name in self.inputs:
            self.known[name] = self.scenario.input(name)[0]
        for _ in range(2):  # in the second round with starts that follow from parameters
            self.values = []
            for node in self.nodes:
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
        return OPERATIONS[op](*given) if op in OPERATIONS else self.known[name]

    def _segment(self, bounds: str, x: float) -> int:
        return max(bisect_right(self.model["tables"][bounds], x) - 1, 0)

    # ---- What is needed --------------------------------------------------------------------------

    def _needed(self, roots: Iterable[int], found: dict[int, None]) -> None:
        """Add what these follow from, by the branches of the start."""
        todo = [*roots]
        while todo:
            i = todo.pop()
            op, arguments, _, _ = self.nodes[i]
            if i in found:
                continue
            found[i] = None
            if op == "if":
                self._keep(arguments[0])
                todo.append(arguments[1 if self.values[arguments[0]] else 2])
            elif op in NUMBERS:
                self._keep(i)
            elif op in ENCLOSED:
                todo += arguments
            else:
                self._fail(f"{self.places[i]}: {op} cannot be enclosed")

    def _keep(self, i: int) -> None:
        """Guard what a condition or a whole number follows from."""
        op, arguments, name, _ = self.nodes[i]
        if op == "mode" and name in self.model["relations"]:
            relation = self.model["relations"][name]
            self.guards[relation["distance"]] = bool(self.values[i]), relation["text"]
        elif op == "integer" and name in self.model["segments"]:
            for side, is_positive in (("low", True), ("high", False)):
                relation = self.model["relations"][self.model["segments"][name][side]]
                self.guards[relation["distance"]] = is_positive, f"{relation['text']}, {side}"
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
            tick = len(self.nodes)
            at = self.scenario.start + values[1]
            self.nodes += [("time", [], "", 0.0), ("number", [], "", at)]
            self.nodes.append(("-", [tick, tick + 1], "", 0.0))
            self.values += [self.scenario.start, at, -values[1]]
            self.places += [name] * 3
            self.guards[tick + 2] = False, name

    # ---- As the program reads it -----------------------------------------------------------------

    def _numbered(self, rates: list[int], outputs: list[int]) -> Iterator[str]:
        """Number the nodes in the order that the program wants; yield its lines."""
        of_rates: dict[int, None] = {}
        self._needed(rates, of_rates)
        self._guard_changes()
        moves = self._moving()
        of_outputs: dict[int, None] = {}
        starts = [x["node"] for x in map(self.model["starts"].get, self.states) if type(x) is dict]
        self._needed([*outputs, *starts], of_outputs)
        of_series, last = dict(of_rates), -1
        while len(of_series) > last:  # distances may follow from other relations
            last = len(of_series)
            functions = [i for i in of_series if moves[i] and i in self.slopes]
            self._needed([self.slopes[i] for i in functions], of_series)
            self._needed(self.guards, of_series)
        place = {i: self.states.index(node[2]) for i, node in enumerate(self.nodes)
                 if node[0] == "state"}  # fmt: skip
        rows: list[tuple[str, list[int], float]] = [
            ("state", [i], 0.0) for i in range(len(self.states))
        ]
        self.origins = [-1] * len(rows)  # nodes of the model by those of the program
        ends = []
        for group in (of_rates, of_series, of_outputs):
            for i in sorted(set(group) - place.keys()):
                op, arguments, name, number = self.nodes[i]
                if op == "if":
                    place[i] = place[arguments[1 if self.values[arguments[0]] else 2]]
                    continue
                place[i] = len(rows)
                self.origins.append(i)
                if op in NUMBERS:
                    if not math.isfinite(self.values[i]):
                        self._fail(f"{self.places[i]}: {name or op} has no finite value")
                    rows.append(("number", [], float(self.values[i])))
                elif op == "input":
                    rows.append((op, [self.inputs.index(name)], 0.0))
                else:
                    rows.append((op, [place[j] for j in arguments], 0.0))
            ends.append(len(rows))
        sizes = (len(self.states), len(self.inputs), len(self.names), len(self.guards))
        self.first_start = len(rows)  # of nodes for starts, numbers that are added later
        self.place, self.ends, self.sizes = place, ends, sizes
        in_series = set(of_series)
        for k, (op, arguments, number) in enumerate(rows):
            words = [op, *map(str, arguments)]
            if op == "number":
                words.append(number.hex())
            if op in FUNCTIONS:
                i = self.origins[k]
                has_slope = i in in_series and moves[i]
                words.append(str(place[self.slopes[i]] if has_slope else k))
            yield f"{' '.join(words)}\n"
        yield _line("rates", [place[i] for i in rates])
        yield _line("outputs", [*range(len(self.states)), *(place[i] for i in outputs)])
        signs = [int(is_positive) for is_positive, _ in self.guards.values()]
        yield _line("guards", [*(place[i] for i in self.guards), *signs])

    def _moving(self) -> list[bool]:
        """Whether each node changes along a motion."""
        found: list[bool] = []
        for op, arguments, _, _ in self.nodes:
            found.append(op in ("state", "time") or any(found[i] for i in arguments))
        return found

    def text(self, start: Start) -> Iterator[str]:
        """Write the question to the program, in lines."""
        scenario, count = self.scenario, self.first_start
        yield _line("model", [count + len(self.states), *self.ends[:2], *self.sizes])
        yield from self.lines[:count]
        numbers = []
        for name in self.states:
            yield f"number {float(start[name][0]).hex()}\n"
            given = self.model["starts"][name]
            exact = type(given) is dict and start[name][0] == self.known[name]
            numbers.append(self.place[given["node"]] if exact else count + len(numbers))
        yield from self.lines[count:]
        yield _line("starts", numbers)
        yield _line("start", [scenario.times[0], *(start[name][1] for name in self.states)])
        inputs = [scenario.input(name) for name in self.inputs]
        for i, end in enumerate(scenario.times[1:]):
            yield _line("to", [end, *(values[i] for values in inputs)])

    def reason(self, obstacle: str, where: int) -> str:
        """Say what ends a proof: an event, or what the program cannot go past."""
        if obstacle == "event":
            return [*self.guards.values()][where][1]
        if obstacle == "undefined" and self.origins[where] >= 0:
            node = self.origins[where]
            what = UNBOUNDED.get(self.nodes[node][0], "may grow beyond all bounds")
            return f"{self.places[node]}: {what}"
        return f"{self.states[where]} grows too fast, or is too uncertain"


def _line(name: str, numbers: Iterable[float]) -> str:
    words = (str(x) if isinstance(x, int) else float(x).hex() for x in numbers)
    return f"{' '.join((name, *words))}\n"
