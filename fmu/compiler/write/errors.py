"""By how much values in C may be wrong, from errors of what they follow from and by rounding.

Running error analysis: Higham, Accuracy and Stability of Numerical Algorithms, section 3.3. Where
derivatives are 0 or infinite, a function is evaluated at the ends of what its arguments may be.
"""

from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import product

from ..expressions.expression import in_order
from ..graph import algebraic
from ..graph.graph import CONDITIONS, Graph, Value
from ..graph.tables import LookupTable
from .c_code import Code, called
from .statements import Operand, Place

NONE = 0.0
ROUNDING = "DBL_EPSILON"  # of an operation and of a function, over its result
NEVER_STEEPER_THAN_1 = ("sin", "cos", "atan", "tanh", "hypot")


class Errors:
    """Operands of errors, with constants of a code; leaves without `given` errors are exact."""

    def __init__(self, graph: Graph, code: Code, given: Mapping[tuple[str, str], Operand]) -> None:
        self.graph, self.code, self.given = graph, code, given
        self.known: dict[Value, Operand] = {}
        self.corners: dict[Operand, Value] = {}  # leaves for operands, in brackets no names

    def _arguments(self, value: Value) -> Sequence[Value]:
        """Return what it follows from; of a table what is looked up."""
        return self.graph.looked_up.get(value, (None, value.arguments))[1]

    def of(self, root: Value) -> Operand:
        """Return the error of a value, >= 0 in its unit."""
        for value in in_order([root], self.known, self._arguments):
            error = self._error(value)
            is_name = not isinstance(error, tuple | Place)
            self.known[value] = error if is_name else self.code.constant(error)
        return self.known[root]

    def _error(self, value: Value) -> Operand:
        if value.op in CONDITIONS or value.leaves.isdisjoint(self.given):
            return NONE
        if (value.op, value.name) in self.given:
            return self.given[value.op, value.name]
        y, read = self.code.of(value), self._arguments(value)
        errors = [self.known[argument] for argument in read]
        arguments = [self.code.of(argument) for argument in read]
        match "table" if value in self.graph.looked_up else value.op:
            case "negative":
                return errors[0]
            case "component":
                return Place(f"{errors[0]}[", int(value.name), "]")
            case "linear" | "solution":
                return self._of_system(value, errors)
            case "factors":
                return NONE
            case "if":
                same = errors[1] == errors[2]
                return errors[1] if same else ("if", arguments[0], *errors[1:])
            case "+" | "-":
                parts = errors
            case "*":
                a, b = arguments
                parts = [
                    _product(errors[0], ("+", ("fabs", b), errors[1])),
                    _product(errors[1], ("fabs", a)),
                ]
            case "/":
                parts = [
                    _product(error, ("fabs", ("/", of, arguments[1])))
                    for error, of in zip(errors, (1.0, y), strict=True)
                ]
            case op if op in NEVER_STEEPER_THAN_1:
                parts = errors
            case op:
                ends = [
                    [("-", a, e), ("+", a, e)] if e != NONE else [a]
                    for a, e in zip(arguments, errors, strict=True)
                ]
                table = self.graph.looked_up[value][0] if op == "table" else None
                corners = [
                    self._in_table(table, corner) if table else called(op, *corner)
                    for corner in product(*ends)
                ]
                pairs = zip(corners[::2], corners[1::2], strict=True)
                spreads = [("relations_spread", y, low, high) for low, high in pairs]
                parts = [reduce(_sum, spreads)]
        parts = [part for part in parts if part != NONE]
        return reduce(_sum, [*parts, ("*", ROUNDING, ("fabs", y))])

    def _of_system(self, vector: Value, errors: Sequence[Operand]) -> str:
        """Return the name of an array with the errors of a system's results.

        Its equations have the errors of what they read, and of the rounding of their terms.
        """
        graph, code = self.graph, self.code
        if vector.op == "linear":
            factors = vector.arguments[0]
            sums = [*errors[1:]]
            results = [code.of(x) for x in algebraic.components(graph, vector, len(sums))]
            elements = zip(algebraic.places(factors), factors.arguments, strict=True)
            for (i, j), element in elements:
                own = _sum(
                    ("*", ("*", 4.0, ROUNDING), ("fabs", code.of(element))), self.of(element)
                )
                sums[i] = _sum(sums[i], ("*", own, ("fabs", results[j])))
            return code.bounds(code.of(factors), sums)
        rows = algebraic.placed(graph, vector).by_given
        terms = [
            [("*", ("fabs", code.of(slope)), errors[k]) for k, slope in row.items()
             if errors[k] != NONE]
            for row in rows
        ]  # fmt: skip
        return code.spread(vector, [reduce(_sum, each) if each else NONE for each in terms])

    def _in_table(self, table: LookupTable, corner: Sequence[Operand]) -> Operand:
        """Return the value of a table for operands."""
        for at in corner:
            if at not in self.corners:
                leaf = self.graph.value("parameter", name=f"({len(self.corners)})")
                self.corners[at] = leaf
                self.code.known[leaf] = self.code.constant(at)
        given = [self.corners[at] for at in corner]
        return self.code.of(self.graph.polynomial(table, given, True))


def _sum(a: Operand, b: Operand) -> Operand:
    return "+", a, b


def _product(error: Operand, factor: Operand) -> Operand:
    return NONE if error == NONE else ("*", error, factor)
