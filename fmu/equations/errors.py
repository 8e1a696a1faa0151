"""By how much values in C may be wrong, from errors of what they follow from and by rounding.

Running error analysis: Higham, Accuracy and Stability of Numerical Algorithms, section 3.3. Where
derivatives are 0 or infinite, a function is evaluated at the ends of what its arguments may be.
"""

from itertools import product

from equations.c_code import Code, Leaves, formula
from equations.graph import CONDITIONS, Value
from rparm.expressions.expression import in_order

NONE = "0.0"
ROUNDING = "DBL_EPSILON"  # of an operation and of a function, over its result
NEVER_STEEPER_THAN_1 = ("sin", "cos", "atan", "tanh")


class Errors:
    """C expressions of errors, as constants of a code; leaves without `given` errors are exact."""

    def __init__(self, code: Code, given: Leaves) -> None:
        self.code, self.given = code, given
        self.known: dict[Value, str] = {}

    def of(self, root: Value) -> str:
        """Return the error of a value, >= 0 in its unit."""
        for value in in_order([root], self.known):
            error = self._error(value)
            is_name = error == NONE or error.isidentifier()
            self.known[value] = error if is_name else self.code.constant(error)
        return self.known[root]

    def _error(self, value: Value) -> str:
        if value.op in CONDITIONS or value.leaves.isdisjoint(self.given):
            return NONE
        if (value.op, value.name) in self.given:
            return self.given[value.op, value.name]
        y, errors = self.code.of(value), [self.known[argument] for argument in value.arguments]
        arguments = [self.code.of(argument) for argument in value.arguments]
        match value.op:
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
                corners = [formula(op, *corner) for corner in product(*ends)]
                pairs = zip(corners[::2], corners[1::2], strict=True)
                spreads = [f"relations_spread({y}, {low}, {high})" for low, high in pairs]
                parts = [" + ".join(spreads)]
        parts = [part for part in parts if part != NONE]
        return " + ".join([*parts, f"{ROUNDING} * fabs({y})"])


def _product(error: str, factor: str) -> str:
    return NONE if error == NONE else f"{error} * {factor}"
