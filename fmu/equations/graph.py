"""A graph of operations on doubles and conditions: each operation once, in the order of the text.

Operations on numbers: number, the leaves of `LEAVES`, + - * / negative, pow, "if" and functions of
one or two arguments. Conditions: the leaf mode, relations, and, or, not. abs, min, max and squares
have become others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from rparm.expressions.tree import RELATIONS, Node, in_order

LEAVES = ("parameter", "input", "state", "time", "mode")
MOVING = ("input", "state", "time")
LINEAR = ("+", "-", "negative", "if")
PRODUCTS_UP_TO = 8  # whole exponents that are repeated multiplication
WHOLE_UP_TO = 64  # whole exponents whose derivatives are defined at 0


@dataclass(frozen=True, eq=False, slots=True)
class Value:
    """An operation with its arguments; a leaf has a name, a number its value."""

    op: str
    arguments: tuple[Value, ...]
    name: str
    number: float
    leaves: frozenset[tuple[str, str]]  # operation and name of all leaves that it follows from

    @property
    def moves(self) -> bool:
        """Whether it may change while parameters and modes stay."""
        return any(op in MOVING for op, _ in self.leaves)


@dataclass(frozen=True)
class Relation:
    """It holds where the distance is above 0 or, if it includes 0, not below."""

    distance: Value
    includes_zero: bool
    limit: Value | None  # the side that does not move
    time: Value | None  # where the time is compared with what does not move: that


@dataclass
class Graph:
    """Makes values, and finds those that exist.

    A relation that compares what moves is a switch: a mode, `relations` has by its name what it
    follows from. It changes at events only.
    """

    known: dict[tuple, Value] = field(default_factory=dict)
    relations: dict[str, Relation] = field(default_factory=dict)
    has_switches: bool = True  # else relations are evaluated with the values

    def value(self, op: str, *arguments: Value, name: str = "", number: float = 0.0) -> Value:
        """The operation as it is."""
        key = (op, tuple(map(id, arguments)), name, number.hex())
        if key not in self.known:
            own = [(op, name)] if op in LEAVES else []
            leaves = frozenset(own).union(*(argument.leaves for argument in arguments))
            self.known[key] = Value(op, arguments, name, number, leaves)
        return self.known[key]

    def number(self, number: float) -> Value:
        """A constant."""
        return self.value("number", number=number)

    # ---- Texts -------------------------------------------------------------------------------

    def of_tree(self, root: Node, names: Mapping[str, Value], is_instant: bool = False) -> Value:
        """What an expression calculates; is_instant: at an event, where nothing moves."""
        compare = self.value if is_instant else self.relation
        found: dict[Node, Value] = {}
        for node in in_order([root]):
            given = [found[argument] for argument in node.arguments]
            found[node] = self._of_node(node, given, names, compare)
        return found[root]

    def _of_node(
        self,
        node: Node,
        given: list[Value],
        names: Mapping[str, Value],
        compare: Callable[[str, Value, Value], Value],
    ) -> Value:
        if node.op == "number":
            return self.number(node.value)
        if node.op == "name":
            return names[node.name]
        if node.op == "**":
            return self._power(*given)
        if node.op == "abs":
            is_negative = compare("<", given[0], self.number(0.0))
            return self.value("if", is_negative, self.negative(given[0]), given[0])
        if node.op in ("min", "max"):
            return self.value("if", compare("<" if node.op == "min" else ">", *given), *given)
        if node.op in RELATIONS:
            return compare(node.op, *given)
        return self.value(node.op, *given)

    def relation(self, op: str, left: Value, right: Value) -> Value:
        """A comparison: plain where nothing moves, else a switch."""
        if self.has_switches and (left.moves or right.moves):
            return self.switch(op, left, right)
        return self.value(op, left, right)

    def switch(self, op: str, left: Value, right: Value) -> Value:
        """A comparison whose result changes at events only."""
        if op in ("<", "<="):
            left, right = right, left
        still = [side for side in (left, right) if not side.moves]
        other = right if left in still else left
        relation = Relation(
            distance=self.value("-", left, right),
            includes_zero=op in ("<=", ">="),
            limit=still[0] if still else None,
            time=still[0] if still and other.op == "time" else None,
        )
        same = [name for name, known in self.relations.items() if known == relation]
        name = same[0] if same else f"{len(self.relations) + 1}"
        self.relations.setdefault(name, relation)
        return self.value("mode", name=name)

    def _power(self, base: Value, exponent: Value) -> Value:
        whole = exponent.op == "number" and exponent.number in range(1, PRODUCTS_UP_TO + 1)
        if not whole:
            return self.value("pow", base, exponent)
        result = base
        for _ in range(int(exponent.number) - 1):
            result = self.value("*", result, base)
        return result

    # ---- What derivatives consist of: with 0 and 1 they are simpler ----------------------------

    def plus(self, a: Value, b: Value) -> Value:
        """a + b."""
        if is_number(a, 0.0):
            return b
        return a if is_number(b, 0.0) else self.value("+", a, b)

    def minus(self, a: Value, b: Value) -> Value:
        """a - b."""
        if is_number(a, 0.0):
            return self.negative(b)
        return a if is_number(b, 0.0) else self.value("-", a, b)

    def negative(self, a: Value) -> Value:
        """-a."""
        return a if is_number(a, 0.0) else self.value("negative", a)

    def times(self, a: Value, b: Value) -> Value:
        """A product a b."""
        if is_number(a, 0.0) or is_number(b, 1.0):
            return a
        return b if is_number(b, 0.0) or is_number(a, 1.0) else self.value("*", a, b)

    def quotient(self, a: Value, b: Value) -> Value:
        """a / b."""
        return a if is_number(a, 0.0) or is_number(b, 1.0) else self.value("/", a, b)

    # ---- Derivatives ---------------------------------------------------------------------------

    def partials(self, y: Value) -> list[Value]:
        """Derivatives of a function or power by each of its arguments."""
        one, x = self.number(1.0), y.arguments[0]
        if y.op == "pow":
            return self._partials_of_power(y)
        if y.op == "atan2":
            a, b = y.arguments
            square = self.value("+", self.value("*", a, a), self.value("*", b, b))
            return [self.value("/", b, square), self.value("negative", self.value("/", a, square))]
        rules: dict[str, Callable[[], Value]] = {
            "sin": lambda: self.value("cos", x),
            "cos": lambda: self.value("negative", self.value("sin", x)),
            "tan": lambda: self.value("+", one, self.value("*", y, y)),
            "asin": lambda: self.quotient(one, self._root_of_rest(x)),
            "acos": lambda: self.quotient(self.number(-1.0), self._root_of_rest(x)),
            "atan": lambda: self.quotient(one, self.value("+", one, self.value("*", x, x))),
            "sinh": lambda: self.value("cosh", x),
            "cosh": lambda: self.value("sinh", x),
            "tanh": lambda: self.value("-", one, self.value("*", y, y)),
            "exp": lambda: y,
            "log": lambda: self.quotient(one, x),
            "sqrt": lambda: self.quotient(self.number(0.5), y),
        }
        return [rules[y.op]()]

    def _root_of_rest(self, x: Value) -> Value:
        one = self.number(1.0)
        return self.value("sqrt", self.value("-", one, self.value("*", x, x)))

    def _partials_of_power(self, y: Value) -> list[Value]:
        """c x^(c-1) and y log x. Of whole exponents the first is defined at x = 0, too."""
        x, c = y.arguments
        if c.op == "number" and c.number in range(WHOLE_UP_TO + 1):
            lower = self._power(x, self.number(c.number - 1.0)) if c.number else x
            by_base = self.times(c, lower)
        else:
            by_base = self.times(c, self.value("/", y, x))
        zero = self.number(0.0)
        return [by_base, zero if c.op == "number" else self.value("*", y, self.value("log", x))]

    def derivative(self, root: Value, seeds: Mapping[Value, Value]) -> Value:
        """Derivative where each leaf has its derivative in `seeds`, or 0 if it is not there."""
        zero = self.number(0.0)
        moving = {(leaf.op, leaf.name) for leaf in seeds}
        found: dict[Value, Value] = {}
        for y in ordered([root]):
            if not y.leaves & moving:
                found[y] = zero
            elif y in seeds:
                found[y] = seeds[y]
            else:
                found[y] = self._chain(y, [found[argument] for argument in y.arguments])
        return found[root]

    def _chain(self, y: Value, d: list[Value]) -> Value:
        if y.op in ("+", "-"):
            return (self.plus if y.op == "+" else self.minus)(*d)
        if y.op == "negative":
            return self.negative(d[0])
        if y.op == "if":
            return d[1] if d[1] is d[2] else self.value("if", y.arguments[0], *d[1:])
        if y.op == "*":
            a, b = y.arguments
            return self.plus(self.times(d[0], b), self.times(a, d[1]))
        if y.op == "/":
            b = y.arguments[1]
            return self.quotient(self.minus(d[0], self.times(y, d[1])), b)
        total = self.number(0.0)
        for partial, of_argument in zip(self.partials(y), d, strict=True):
            total = self.plus(total, self.times(partial, of_argument))
        return total


def is_number(value: Value, number: float) -> bool:
    """Whether it is this constant."""
    return value.op == "number" and value.number == number


def is_function(value: Value) -> bool:
    """Whether the chain rule with `Graph.partials` holds: no arithmetic, leaf or condition."""
    arithmetic = ("number", "*", "/", "and", "or", "not", *LINEAR, *LEAVES, *RELATIONS)
    return value.op not in arithmetic


def ordered(roots: Iterable[Value]) -> list[Value]:
    """All values that the roots follow from and the roots, arguments first."""
    done: dict[Value, None] = {}
    todo = list(roots)[::-1]
    while todo:
        left = [argument for argument in todo[-1].arguments if argument not in done]
        if left:
            todo += left[::-1]
        else:
            done.setdefault(todo.pop())
    return list(done)


def with_partials(
    graph: Graph, roots: Iterable[Value], changes: Callable[[Value], object]
) -> list[Value]:
    """All values that the roots and their derivatives of any order along a curve follow from.

    changes: whether a value changes along the curve.
    """
    done: dict[Value, None] = {}
    todo = list(roots)
    while todo:
        new = [value for value in ordered(todo) if value not in done]
        done |= dict.fromkeys(new)
        todo = [
            partial for value in new if is_function(value) and changes(value)
            for partial in graph.partials(value)
        ]  # fmt: skip
    return list(done)
