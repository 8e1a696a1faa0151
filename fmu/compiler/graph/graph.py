"""A graph of operations on doubles and conditions: each operation once, in the order of the text.

Operations on numbers: number, the leaves of `LEAVES`, + - * / negative, pow, "if" and functions of
one or two arguments; in derivatives also the functions of src/model/slopes.h. Conditions: the leaf
mode, relations, and, or, not, isnan, isfinite. abs, min, max and squares have become others.
From C come the leaf integer, the condition ==, and two operations that differ in derivatives only:
value_of(x) rests, and moving_as(x, y) moves as y; and the functions ceil, floor, trunc, round.
Of tables: entry, of an array by one or two segments, and locate, the segment of a number. Of
arrays: element, one of the arguments behind the first one, which is its place from 0 on. Of
equations that need each other: algebraic.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial, reduce

from ..expressions.expression import PARTIAL, RANDOM, RELATIONS, Node, in_order
from ..expressions.parser import parse
from . import algebraic, undefined
from .algebraic import GIVEN, UNKNOWN, Linear, System
from .contacts import Contacts
from .derived import derived
from .tables import FAR, LookupTable

ENDS = ("bounds", "ends")  # arrays of a table: where segments begin and end

# along a curve, "first" and "second" are the derivatives of the other leaves
LEAVES = (
    *("parameter", "input", "state", "discrete", "time", "mode", "integer"),
    "later",  # time, of what has switched by the time at an instant
    *("first", "second"),
    "shift",  # derivative of the time of an event by a parameter
    "anchor",  # where a solution is searched
    *(UNKNOWN, GIVEN),
)
MOVING = ("input", "state", "time", "later", UNKNOWN, GIVEN)
RUNTIME = ("first", "second")  # derivatives that may be 0 in one call and not in another
CONDITIONS = ("mode", "and", "or", "not", "isnan", "isfinite", "==", *RELATIONS)
OPPOSITE = {"<": ">=", ">=": "<", ">": "<=", "<=": ">"}
SWITCHING = ("floor", "locate", *RELATIONS)  # results jump
STILL = (*CONDITIONS, *RANDOM, "value_of", "entry", "locate", "floor")  # derivatives are 0
PRODUCTS_UP_TO = 8  # whole exponents that are repeated multiplication
MOST_COUNTED = 2**30  # by floor of what moves
WHOLE_UP_TO = 64  # whole exponents whose derivatives are defined at 0
# derivatives of y = f(x) or f(x, z) by each argument
DERIVATIVES = {
    "sin": ["cos(x)"],
    "cos": ["-sin(x)"],
    "tan": ["1 + y * y"],
    "asin": ["1 / sqrt(1 - x * x)"],
    "acos": ["-1 / sqrt(1 - x * x)"],
    "atan": ["1 / (1 + x * x)"],
    "atan2": ["z / (x * x + z * z)", "-(x / (x * x + z * z))"],
    "sinh": ["cosh(x)"],
    "cosh": ["sinh(x)"],
    "tanh": ["1 - y * y"],
    "exp": ["y"],
    "log": ["1 / x"],
    "sqrt": ["0.5 / y"],
    "hypot": ["x / y", "z / y"],
    "pow": ["z * (y / x)", "y * log(x)"],
}
# of finite arguments, some results are not finite
FALLIBLE = ("/", "sqrt", "log", "asin", "acos", "pow", "exp", "sinh", "cosh", "solution", "linear")
GROWING = ("exp", "sinh", "cosh")  # results overflow
# slopes may be infinite or undefined
STEEP = ("sqrt", "log", "asin", "acos", "pow", "atan2", "hypot")
NOTED = frozenset((*FALLIBLE, *STEEP))
RULES = {function: [parse(rule) for rule in rules] for function, rules in DERIVATIVES.items()}


@dataclass(frozen=True, eq=False, slots=True)
class Value:
    """An operation with its arguments; a leaf has a name, a number its value."""

    op: str
    arguments: tuple[Value, ...]
    name: str
    number: float
    leaves: frozenset[tuple[str, str]]  # operation and name of all leaves that it follows from
    functions: frozenset[str]  # of FALLIBLE, STEEP and "element", those that it follows from
    moves: bool  # it may change while parameters and modes stay


@dataclass(frozen=True)
class Relation:
    """It holds where the distance is above 0 or, if it includes 0, not below."""

    distance: Value
    includes_zero: bool
    limit: Value | None  # the side that does not move
    time: Value | None  # where the time is compared with what does not move: that
    mode: Value | None = field(default=None, compare=False)  # whether it holds

    @property
    def name(self) -> str:
        """The name of its mode."""
        return self.mode.name

    @property
    def is_of_time(self) -> bool:
        """It moves by the time only."""
        return is_of_time(self.distance)

    @property
    def rises(self) -> bool:
        """It is timed and holds after its time."""
        return self.time is not None and self.distance.arguments[0].op == "time"


@dataclass(frozen=True)
class Segment:
    """The segment of a table, or the whole number, at a value that moves; events change it."""

    leaf: Value
    argument: Value
    bounds: str  # array of them; "" of whole numbers
    first: int  # number of the first one
    count: int  # of the table's segments
    low: Relation  # holds above its begin
    high: Relation  # holds from its end on


@dataclass
class Graph:
    """Makes values, and finds those that exist.

    A relation of values that move is a switch: its result is a mode, which changes at events only;
    `relations` has them by mode. `functions` take values, and whether this is an instant.
    """

    known: dict[tuple, Value] = field(default_factory=dict)
    relations: dict[str, Relation] = field(default_factory=dict)
    tables: Mapping[str, LookupTable] = field(default_factory=dict)
    functions: Mapping[str, Callable[[list[Value], bool], Value]] = field(default_factory=dict)
    unknowns: dict[Value, Value | None] = field(default_factory=dict)  # by condition
    nodes: list[Node] = field(default_factory=list)  # of a text, for each relation
    segments: dict[str, Segment] = field(default_factory=dict)  # by the names of their leaves
    # at instants
    looked_up: dict[Value, tuple[LookupTable, list[Value]]] = field(default_factory=dict)
    of_inputs: dict[Value, bool] = field(default_factory=dict)  # of distances
    systems: dict[str, System] = field(default_factory=dict)  # by name
    linear: list[Linear] = field(default_factory=list)  # systems of the file
    contacts: Contacts | None = None
    has_switches: bool = True  # else relations are evaluated with the values
    has_times: bool = False  # without switches: relations of the time with constants are some
    is_guarded: bool = True  # else an infinite slope makes derivatives infinite, as in C
    names: dict[Value, str] = field(default_factory=dict)  # in the source, of what it calculates
    arrays: set[str] = field(default_factory=set)  # of tables, that C reads

    @property
    def located(self) -> list[Relation]:
        """Relations with an indicator: those whose time is not known before."""
        return [relation for relation in self.relations.values() if relation.time is None]

    def is_of_inputs(self, value: Value) -> bool:
        """Return whether inputs move a value and nothing else, also by way of relations."""
        if value not in self.of_inputs:
            found = {op for op, _ in self._reached(value)}
            self.of_inputs[value] = not found & {"state", "time", "later"}
        return self.of_inputs[value]

    def _reached(self, value: Value) -> set[tuple[str, str]]:
        """All leaves that a value follows from, also by way of relations."""
        found = {*value.leaves}
        todo = [*found]
        for _, name in todo:
            if name in self.relations:
                more = self.relations[name].distance.leaves
            else:
                more = self.segments[name].argument.leaves if name in self.segments else ()
            todo += [leaf for leaf in more if leaf not in found]
            found.update(more)
        return found

    def is_circular(self, relation: Relation) -> bool:
        """Return whether the distance follows from the mode."""
        return (relation.mode.op, relation.name) in self._reached(relation.distance)

    def value(self, op: str, *arguments: Value, name: str = "", number: float = 0.0) -> Value:
        """The operation as it is."""
        key = (op, tuple(map(id, arguments)), name, number.hex())
        if key not in self.known:
            own, used = {(op, name)} if op in LEAVES else (), NOTED & {op}
            if op == "element" or name and math.isnan(number):
                used = {"element"}
            leaves = frozenset(own).union(*[argument.leaves for argument in arguments])
            functions = used.union(*[argument.functions for argument in arguments])
            moves = op in MOVING or any([argument.moves for argument in arguments])
            self.known[key] = Value(op, arguments, name, number, leaves, functions, moves)
        return self.known[key]

    def number(self, number: float) -> Value:
        """A constant."""
        return self.value("number", number=number)

    # ---- Texts -------------------------------------------------------------------------------

    def of_tree(self, root: Node, names: Mapping[str, Value], is_instant: bool = False) -> Value:
        """What an expression calculates; is_instant: at an event, where nothing moves."""
        compare = self.value if is_instant else self.relation
        relate = self._at_instant if is_instant else self.relation
        found: dict[Node, Value] = {}
        for node in in_order([root]):
            given = [found[argument] for argument in node.arguments]
            match node.op:
                case "number":
                    value = self.number(node.value)
                case "literal":
                    value = self.value("<", self.number(0.0), self.number(node.value))
                case "name":
                    value = names[node.name]
                case "**":
                    value = self._power(*given)
                case "abs":
                    is_negative = compare("<", given[0], self.number(0.0))
                    value = self.value("if", is_negative, self.negative(given[0]), given[0])
                case "min" | "max":
                    is_first = compare("<" if node.op == "min" else ">", *given)
                    value = self.choice(is_first, *given)
                case "if":
                    value = self.choice(*given)
                case "floor":
                    value = self._whole(*given, is_instant)
                case "!=":
                    value = self.value("not", self.value("==", *given))
                case "table":
                    value = self.in_table(self.tables[node.name], given, is_instant)
                case "element":
                    value = self._element(node, given)
                case "call":
                    value = self.functions[node.name](given, is_instant)
                case "unit":
                    value = given[0]
                case op if op == PARTIAL:
                    value = derived(self, node, *given)
                case op:
                    value = (relate if op in RELATIONS else self.value)(op, *given)
            found[node] = value
            self.nodes += [node] * (len(self.relations) - len(self.nodes))
        return found[root]

    def _element(self, node: Node, given: list[Value]) -> Value:
        """The element at indexes that follow from variables; not a number where there is none."""
        count = len(given) - len(node.of)
        indexes, elements = given[:count], given[count:]
        is_row = count == 1 and node.of == tuple((node.of[0][0] + i,) for i in range(len(node.of)))
        if is_row and not any(e.moves or e.op in CONDITIONS for e in elements):
            place = self.simple("-", indexes[0], self.number(float(node.of[0][0])))
            return self.value("element", place, *elements)
        places = [
            reduce(
                partial(self.value, "and"),
                (
                    self.value("==", index, self.number(float(i)))
                    for index, i in zip(indexes, at, strict=True)
                    if index.op != "number"
                ),
            )
            for at in node.of
        ]
        if elements[0].op in CONDITIONS:
            chosen = [self.value("and", *pair) for pair in zip(places, elements, strict=True)]
            value = reduce(partial(self.value, "or"), chosen)
            undefined.unknown_without(self, value, places)
            return value
        value = self.value("number", name="none", number=math.nan)
        for place, element in zip(places[::-1], elements[::-1], strict=True):
            value = self.value("if", place, element, value)
        return value

    def in_table(self, table: LookupTable, given: list[Value], is_instant: bool) -> Value:
        """The value of a table, which `looked_up` knows at an instant."""
        value = self.polynomial(table, given, is_instant)
        if is_instant:
            self.looked_up[value] = table, given
        return value

    def polynomial(self, table: LookupTable, given: list[Value], is_instant: bool) -> Value:
        """The value of a table, by the distance from its segment's origin."""
        places = [self._segment(table, i, x, is_instant) for i, x in enumerate(given)]
        distances = [
            self.value("-", x, self.value("entry", k, name=table.array("origins", i)))
            for i, (x, k) in enumerate(zip(given, places, strict=True))
        ]
        powers = range(len(table.coefficients))
        number = math.nan if table.ends else 0.0  # outside there is no value
        found = [
            self.value("entry", *places, name=table.array("c", i), number=number) for i in powers
        ]
        if len(given) == 1:
            return reduce(
                lambda sum_, c: self.value("+", c, self.value("*", sum_, distances[0])), found[::-1]
            )
        value, by_x, by_y, both = found
        slope = self.value("+", by_x, self.value("*", both, distances[1]))
        rest = self.value("+", value, self.value("*", by_y, distances[1]))
        return self.value("+", rest, self.value("*", slope, distances[0]))

    def _segment(self, table: LookupTable, axis: int, x: Value, is_instant: bool) -> Value:
        """The segment of a number: it stays between events if the number moves."""
        bounds = table.array("bounds", axis)
        if is_instant or not (self.has_switches and x.moves):
            return self.value("locate", x, name=bounds)
        ends = [table.array(end, axis) for end in ENDS]
        count = len(table.axes[axis].origins)
        return self._between(
            x, bounds, 0, count, lambda leaf: [self.value("entry", leaf, name=end) for end in ends]
        )

    def _whole(self, x: Value, is_instant: bool) -> Value:
        """The largest whole number up to x, which stays between events if x moves."""
        if is_instant or not (self.has_switches and x.moves):
            return self.value("floor", x)
        end = self.number(float(MOST_COUNTED))

        def is_inside(leaf: Value) -> list[Value]:
            return [self.value("<", self.negative(end), leaf), self.value("<", leaf, end)]

        def ends(leaf: Value) -> list[Value]:
            bounds = [leaf, self.value("+", leaf, self.number(1.0))]
            far = [self.number(-FAR), self.number(FAR)]
            choices = zip(is_inside(leaf), bounds, far, strict=True)
            return [self.value("if", *choice) for choice in choices]

        leaf = self._between(x, "", -MOST_COUNTED, 2 * MOST_COUNTED + 1, ends)
        is_known = self.value("and", *is_inside(leaf))
        return self.value("if", is_known, leaf, self.number(math.nan))

    def _between(
        self, x: Value, bounds: str, first: int, count: int, ends: Callable[[Value], list[Value]]
    ) -> Value:
        """The number of the segment of x, whose ends follow from it."""
        for known in self.segments.values():
            if known.argument is x and known.bounds == bounds:
                return known.leaf
        name = f"segment {len(self.segments) + 1}"
        leaf = self.value("integer", name=name)
        low, high = (self.relations[self.switch(">=", x, end).name] for end in ends(leaf))
        self.segments[name] = Segment(leaf, x, bounds, first, count, low, high)
        return leaf

    def choice(self, condition: Value, first: Value, second: Value) -> Value:
        """The "if" of a text: not a number where a relation that decides is not defined."""
        if first.op in CONDITIONS:
            otherwise = self.value("and", self.value("not", condition), second)
            return self.value("or", self.value("and", condition, first), otherwise)
        chosen, unknown = self.value("if", condition, first, second), self.unknown(condition)
        return (
            chosen if unknown is None else self.value("if", unknown, self.number(math.nan), chosen)
        )

    def unknown(self, condition: Value) -> Value | None:
        """Whether a condition has no value, as undefined.py says; None: it always has one."""
        return undefined.unknown(self, condition)

    def relation(self, op: str, left: Value, right: Value) -> Value:
        """A comparison of two values: a switch if one of them moves and the graph has switches."""
        if self.has_switches and (left.moves or right.moves):
            return self.switch(op, left, right)
        if self.has_times and self._switch(op, left, right).time is not None:
            return self.switch(op, left, right)
        return self.value(op, left, right)

    def _at_instant(self, op: str, left: Value, right: Value) -> Value:
        """A comparison at an event, as switches of this limit say: rounding decides where it is."""
        value = self.value(op, left, right)
        if not (self.has_switches and (left.moves or right.moves)):
            return value
        if (same := self._known_switch(self._switch(op, left, right))) is not None:
            return same
        if (no := self._known_switch(self._switch(OPPOSITE[op], left, right))) is not None:
            return self.value("not", no)
        turned = self._known_switch(self._switch(op, right, left))
        if turned is None:
            return value
        return self.value("or" if "=" in op else "and", value, self.value("not", turned))

    def passed(self, root: Value) -> Value:
        """The value at an instant, where what the time switches has switched."""
        if "time" not in {op for op, _ in root.leaves}:
            return root
        now: dict[Value, Value] = {}
        later: dict[Value, Value] = {}
        for v in in_order([root]):
            later[v] = self.value("later") if v.op == "time" else self._with(v, later)
            has_passed = v.op in SWITCHING and is_of_time(v)
            now[v] = later[v] if has_passed else self._with(v, now)
        return now[root]

    def given(self, value: Value, number: int) -> Value:
        """A leaf that stands for a value in equations of a system."""
        op = "mode" if value.op in CONDITIONS else GIVEN
        return self.value(op, name=f"{GIVEN} {number}")

    def _with(self, value: Value, found: Mapping[Value, Value]) -> Value:
        """The same operation on what has been found for its arguments."""
        arguments = [found[argument] for argument in value.arguments]
        return self.value(value.op, *arguments, name=value.name, number=value.number)

    def switch(self, op: str, left: Value, right: Value) -> Value:
        """The mode of a comparison: its result, which changes at events only."""
        relation = self._switch(op, left, right)
        if (known := self._known_switch(relation)) is not None:
            return known
        mode = self.value("mode", name=f"{len(self.relations) + 1}")
        self.relations[mode.name] = replace(relation, mode=mode)
        return mode

    def _known_switch(self, relation: Relation) -> Value | None:
        return next((known.mode for known in self.relations.values() if known == relation), None)

    def _switch(self, op: str, left: Value, right: Value) -> Relation:
        if op in ("<", "<="):
            left, right = right, left
        still = [side for side in (left, right) if not side.moves]
        other = right if left in still else left
        return Relation(
            distance=self.value("-", left, right),
            includes_zero=op in ("<=", ">="),
            limit=still[0] if still else None,
            time=still[0] if still and other.op == "time" else None,
        )

    def _power(self, base: Value, exponent: Value) -> Value:
        whole = exponent.op == "number" and exponent.number in range(1, PRODUCTS_UP_TO + 1)
        if not whole:
            return self.value("pow", base, exponent)
        result = base
        for _ in range(int(exponent.number) - 1):
            result = self.value("*", result, base)
        return result

    # ---- Derivatives -------------------------------------------------------------------------

    def simple(self, op: str, a: Value, b: Value) -> Value:
        """The operation in a derivative, where 0 and 1 are frequent."""
        match op:
            case "+" | "-" if is_number(b, 0.0):
                return a
            case "+" if is_number(a, 0.0):
                return b
            case "-" if is_number(a, 0.0):
                return self.negative(b)
            case "*" | "/" if is_number(a, 0.0) or is_number(b, 1.0):
                return a
            case "*" if is_number(b, 0.0) or is_number(a, 1.0):
                return b
        return self.value(op, a, b)

    def negative(self, a: Value) -> Value:
        """-a."""
        return a if is_number(a, 0.0) else self.value("negative", a)

    def partials(self, y: Value) -> list[Value]:
        """Derivatives of a function by each of its arguments."""
        x, z = y.arguments[0], y.arguments[-1]
        if y.op == "pow" and z.op == "number":
            lower = self._lower_power(y) or self.value("/", y, x)
            return [self.simple("*", z, lower), self.number(0.0)]
        return [self.of_tree(rule, {"x": x, "y": y, "z": z}) for rule in RULES[y.op]]

    def _less(self, z: Value) -> Value:
        """z - 1."""
        if z.op == "number":
            return self.number(z.number - 1.0)
        return self.value("-", z, self.number(1.0))

    def _lower_power(self, y: Value) -> Value | None:
        """The power whose exponent is less by 1, if that is a whole number."""
        x, z = y.arguments
        is_whole = z.op == "number" and z.number in range(WHOLE_UP_TO + 1)
        return self._power(x, self._less(z)) if is_whole else None

    def derivatives(
        self,
        roots: Iterable[Value],
        seeds: Mapping[Value, Value],
        found: dict[Value, Value] | None = None,
    ) -> list[Value]:
        """Derivatives where each leaf has its own in `seeds`, or 0 if it is not there.

        found: gets those of all values that the roots follow from.
        """
        roots, zero = list(roots), self.number(0.0)
        moving = {(leaf.op, leaf.name) for leaf in seeds}
        found = {} if found is None else found
        for y in in_order(roots):
            if not y.leaves & moving or y.op in STILL:
                found[y] = zero
            elif y in seeds:
                found[y] = seeds[y]
            else:
                found[y] = self.chain(y, [found[argument] for argument in y.arguments])
        return [found[root] for root in roots]

    def gradients(
        self,
        roots: Iterable[Value],
        by: Iterable[Value],
        found: dict[Value, dict[Value, Value]] | None = None,
    ) -> list[dict[Value, Value]]:
        """For each root its derivatives by these leaves, where it follows from them.

        found: gets those of all values that the roots follow from.
        """
        roots, one, zero = list(roots), self.number(1.0), self.number(0.0)
        leaves = {(leaf.op, leaf.name): leaf for leaf in by}
        found = {} if found is None else found
        for y in in_order(roots):
            if (y.op, y.name) in leaves:
                found[y] = {y: one}
            elif y.op in STILL:
                found[y] = {}
            else:
                given = [found[argument] for argument in y.arguments]
                found[y] = {
                    x: self.chain(y, [slopes.get(x, zero) for slopes in given])
                    for x in dict.fromkeys(x for slopes in given for x in slopes)
                }
        return [found[root] for root in roots]

    def derivative(self, y: Value, x: Value) -> Value:
        """The partial derivative of y by a leaf."""
        return self.derivatives([y], {x: self.number(1.0)})[0]

    def chain(self, y: Value, d: list[Value]) -> Value:
        """Derivative of an operation whose arguments have the derivatives d."""
        a, b = y.arguments[0], y.arguments[-1]
        match y.op:
            case "+" | "-":
                return self.simple(y.op, *d)
            case "negative":
                return self.negative(d[0])
            case "moving_as":
                return d[1]
            case "component" | "factors" | "slopes" | "linear" | "solution":
                return algebraic.chain(self, y, d)
            case "element":
                rests = all(is_number(slope, 0.0) for slope in d[1:])
                return d[1] if rests else self.value("element", a, *d[1:])
            case "if":
                of_first = y.arguments[1] if is_unknown(y) else d[1]
                return of_first if of_first is d[2] else self.value("if", a, of_first, d[2])
            case "/" | "slopes_over":
                rest = self.simple("-", d[0], self.scaled(y, d[1], is_runtime(d[1])))
                return self.over(rest, b)
            case "*" | "slopes_product":
                b = y.arguments[1]
                return self.simple("+", self.product(b, d[0], d[1]), self.product(a, d[1], d[0]))
            case "slopes_bounded":
                return d[0]
            case "slopes_scaled":
                return self.simple("+", self.scaled(d[0], b), self.scaled(a, d[1]))
        total = self.number(0.0)
        for slope, of_argument in zip(self.slopes(y), d, strict=True):
            total = self.simple("+", total, self.scaled(slope, of_argument, is_steep(y)))
        return total

    def scaled(self, slope: Value, d: Value, is_steep: bool = True) -> Value:
        """slope d; is_steep: it may not be finite, and is 0 where d is 0."""
        is_plain = not is_steep or not self.is_guarded or "number" in (slope.op, d.op)
        return self.simple("*", slope, d) if is_plain else self.value("slopes_scaled", slope, d)

    def over(self, product: Value, b: Value) -> Value:
        """product / b; in the derivative of a quotient, 0 where the product is 0."""
        is_plain = b.op == "number" or not self.is_guarded or not is_runtime(product)
        return self.simple("/", product, b) if is_plain else self.value("slopes_over", product, b)

    def product(self, a: Value, of_b: Value, of_a: Value) -> Value:
        """a db, in the derivative of the product a b."""
        known = a.functions.intersection(FALLIBLE) | of_b.functions.intersection(STEEP)
        is_plain = known <= {"/"} if not is_runtime(of_b) else not known
        if "number" in (a.op, of_b.op) or is_plain or not self.is_guarded:
            return self.simple("*", a, of_b)
        return self.value("slopes_product", a, of_b, of_a)

    def slopes(self, y: Value) -> list[Value]:
        """Derivatives as `partials`, which are finite where they exist."""
        if not self.is_guarded:
            return self.partials(y)
        if y.op in GROWING:
            return [self.value("slopes_bounded", *self.partials(y))]
        if y.op == "hypot":  # at 0 it has a corner, as abs
            is_corner, zero = self.value("==", y, self.number(0.0)), self.number(0.0)
            return [self.value("if", is_corner, zero, slope) for slope in self.partials(y)]
        if y.op == "pow":
            x, z = y.arguments
            lower = self._lower_power(y) or self.value("slopes_reduced", y, x, z)
            return [self.simple("*", z, lower), self.value("slopes_logged", y, x, z)]
        if y.op == "slopes_reduced":
            _, x, z = y.arguments
            less = self._less(z)
            by_base = self.simple("*", less, self.value("slopes_reduced", y, x, less))
            return [self.number(0.0), by_base, self.value("slopes_logged", y, x, less)]
        if y.op == "slopes_logged":
            p, x, z = y.arguments
            lower, log = self.value("slopes_reduced", p, x, z), self.value("log", x)
            by_base = self.value("+", self.value("*", lower, self.value("*", z, log)), lower)
            return [self.number(0.0), by_base, self.value("*", y, log)]
        return self.partials(y)


def is_of_time(value: Value) -> bool:
    """Return whether, between events, it moves by the time only."""
    ops = {op for op, _ in value.leaves}
    return "time" in ops and not ops & {"input", "state"}


def is_runtime(value: Value) -> bool:
    """Return whether it may be 0 in one call and not in another."""
    return any(op in RUNTIME for op, _ in value.leaves)


def is_steep(value: Value) -> bool:
    """Return whether slopes of the operation may be infinite or undefined."""
    return value.op in STEEP or value.op.startswith("slopes_")


def is_unknown(value: Value) -> bool:
    """Return whether it is an "if" whose first branch says that a relation is not defined."""
    return value.op == "if" and math.isnan(value.arguments[1].number)


def is_number(value: Value, number: float) -> bool:
    """Return whether it is this constant."""
    return value.op == "number" and value.number == number


def unsigned(value: Value) -> Value:
    """The value, without the minus in front."""
    return value.arguments[0] if value.op == "negative" else value
