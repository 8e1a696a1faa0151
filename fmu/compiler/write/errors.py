"""By how much values in C may be wrong, from errors of what they follow from and by rounding.

Running error analysis: Higham, Accuracy and Stability of Numerical Algorithms, section 3.3. Where
derivatives are 0 or infinite, a function is evaluated at the ends of what its arguments may be.
"""

from collections.abc import Sequence
from itertools import product

from ..expressions.expression import in_order
from ..graph.graph import CONDITIONS, Graph, Value
from ..graph.tables import LookupTable
from .c_code import Code, Leaves, formula

NONE = "0.0"
ROUNDING = "DBL_EPSILON"  # of an operation and of a function, over its result
NEVER_STEEPER_THAN_1 = ("sin", "cos", "atan", "tanh", "hypot")


class Errors:
    """C expressions of errors, as constants of a code; leaves without `given` errors are exact."""

    def __init__(self, graph: Graph, code: Code, given: Leaves) -> None:
        self.graph, self.code, self.given = graph, code, given
        self.known: dict[Value, str] = {}

    def _arguments(self, value: Value) -> Sequence[Value]:
        """Return what it follows from; of a table what is looked up."""
        return self.graph.looked_up.get(value, (None, value.arguments))[1]

    def of(self, root: Value) -> str:
        """Return the error of a value, >= 0 in its unit."""
        for value in in_order([root], self.known, self._arguments):
            error = self._error(value)
            is_name = error == NONE or error.isidentifier()
            self.known[value] = error if is_name else self.code.constant(error)
        return self.known[root]

    def _error(self, value: Value) -> str:
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
            case "if":
                return (
                    errors[1]
                    if errors[1] == errors[2]
                    else formula("if", arguments[0], *errors[1:])
                )
            case "+" | "-":
                parts = errors
            case "*":
                a, b = arguments
                parts = [
                    _product(errors[0], f"(fabs({b}) + {errors[1]})"),
                    _product(errors[1], f"fabs({a})"),
                ]
            case "/":
                parts = [
                    _product(error, f"fabs({of} / {arguments[1]})")
                    for error, of in zip(errors, ("1.0", y), strict=True)
                ]
            case op if op in NEVER_STEEPER_THAN_1:
                parts = errors
            case op:
                ends = [
                    [f"{a} - {e}", f"{a} + {e}"] if e != NONE else [a]
                    for a, e in zip(arguments, errors, strict=True)
                ]
                table = self.graph.looked_up[value][0] if op == "table" else None
                corners = [
                    self._in_table(table, corner) if table else formula(op, *corner)
                    for corner in product(*ends)
                ]
                pairs = zip(corners[::2], corners[1::2], strict=True)
                spreads = [f"relations_spread({y}, {low}, {high})" for low, high in pairs]
                parts = [" + ".join(spreads)]
        parts = [part for part in parts if part != NONE]
        return " + ".join([*parts, f"{ROUNDING} * fabs({y})"])

    def _in_table(self, table: LookupTable, corner: Sequence[str]) -> str:
        """Return the value of a table for arguments in C."""
        given = [self.graph.value("parameter", name=f"({at})") for at in corner]
        self.code.known |= {x: x.name for x in given}  # in brackets no name of the file
        return self.code.of(self.graph.polynomial(table, given, True))


def _product(error: str, factor: str) -> str:
    return NONE if error == NONE else f"{error} * {factor}"
