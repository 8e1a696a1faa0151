"""Dimensions of expressions: every sum, comparison and argument of a function has to fit.

A dimension is the exponents of the SI base units; rad counts as 1. A number without a name takes
the dimension of what it is added to, compared with or assigned to; in products it is 1. Messages
call it a unit.
"""

from collections.abc import Mapping
from fractions import Fraction

from .. import units as si
from ..units import BASE, Exponents
from .expression import EQUALITIES, PARTIAL, RELATIONS, ExpressionError, Node, in_order
from .parser import AS_SECOND, table_unit

Dimension = tuple[Fraction, ...]  # exponents, in the order of BASE
SUMS = ("+", "-", "min", "max", "hypot")
SAME = (*SUMS, *RELATIONS, *EQUALITIES, "if", "element")  # of arguments with one unit
LARGEST_ROOT = 100  # 0.3333333333333333 is 1/3
ONE: Dimension = (Fraction(0),) * len(BASE)
ANY: Dimension = ()  # of names in a file without units, and of what is made of them


def of_exponents(exponents: Exponents) -> Dimension:
    """Return the dimension with these exponents, by base unit."""
    return tuple(Fraction(exponents.get(base, 0)) for base in BASE)


def times(a: Dimension, b: Dimension, power: Fraction = Fraction(1)) -> Dimension:
    """Return the product a b^power."""
    return tuple(x + power * y for x, y in zip(a, b, strict=True))


def shown(dimension: Dimension) -> str:
    """Write a dimension as a message names a unit: kg.m/s2."""
    return si.shown(dict(zip(BASE, dimension, strict=True)))


def dimension_of(
    root: Node, units: Mapping[str, Dimension], expected: Dimension | None = None
) -> Dimension:
    """Return the dimension of an expression of right kinds; 1 for a condition and for a number.

    `units` has all names that are numbers, `time` too; `ANY` fits everything. ExpressionError where
    units do not fit.
    """
    found: dict[Node, Dimension | None] = {}  # None: a number, which takes any unit
    for node in in_order([root]):
        found[node] = _dimension(node, [found[argument] for argument in node.arguments], units)
    unit = found[root]
    if expected is not None and unit is not None and unit != expected:
        raise ExpressionError(root.column, f"expected unit {shown(expected)}, got {shown(unit)}")
    return unit if unit is not None else expected or ONE


def _dimension(
    node: Node, given: list[Dimension | None], units: Mapping[str, Dimension]
) -> Dimension | None:
    if node.op == "number":
        return None
    if node.op == "name":
        return units.get(node.name, ONE)
    if node.op == "negative":
        return given[0]
    if ANY in given and node.op not in SAME:
        return ANY
    if node.op in ("*", "/", PARTIAL):
        power = Fraction(1 if node.op == "*" else -1)
        if given == [None, None]:
            return None
        return times(given[0] or ONE, given[1] or ONE, power)
    if node.op in SUMS:
        return _same(node, given)
    if node.op in ("table", "call"):
        return _of_table(node, given, units)
    if node.op == "unit" and node.name == AS_SECOND:
        return given[1] if given[0] is None else given[0]
    if node.op == "unit" and node.of:
        return tuple(map(Fraction, node.of[0]))
    if node.op == "unit":
        return _checked(node, given[0], units.get(node.name, ONE))
    if node.op in (*RELATIONS, *EQUALITIES):
        _same(node, given)
        return ONE
    if node.op == "if":
        unit = _same(node, given[1:])
        return ONE if node.name else unit
    if node.op == "**":
        return _power(node, given)
    if node.op == "element":
        return _same(node, given[-len(node.of) :])
    if node.op == "sqrt":
        return times(ONE, given[0], Fraction(1, 2)) if given[0] is not None else None
    if node.op == "abs":
        return given[0]
    for unit in given:  # conditions have unit 1
        if unit not in (None, ONE):
            what = f"{node.function or node.op} takes a number of unit 1"
            if node.function == "mod":
                what = "mod takes two numbers of one unit: their quotient has unit 1"
            raise ExpressionError(node.column, f"{what}, got {shown(unit)}")
    return ONE


def _of_table(
    node: Node, given: list[Dimension | None], units: Mapping[str, Dimension]
) -> Dimension:
    has_none = node.op == "call" and table_unit(node.name) not in units
    hint = ": write its units into [functions]" if has_none else ""
    for i, unit in enumerate(given):
        _checked(node, unit, units.get(table_unit(node.name, i), ONE), hint)
    return units.get(table_unit(node.name), ONE)


def _checked(node: Node, unit: Dimension | None, expected: Dimension, hint: str = "") -> Dimension:
    """Return the unit that is expected, for a table or function that the node names."""
    if ANY not in (unit, expected) and unit not in (None, expected):
        what = f"{node.name.partition('(')[0]} takes unit {shown(expected)}, got {shown(unit)}"
        raise ExpressionError(node.column, what + hint)
    return expected


def _same(node: Node, given: list[Dimension | None]) -> Dimension | None:
    known = [unit for unit in given if unit not in (None, ANY)]
    if len(set(known)) > 1:
        units = " and ".join(shown(unit) for unit in known)
        raise ExpressionError(node.column, f"{node.op!r}: units {units} do not fit")
    return known[0] if known else ANY if ANY in given else None


def _power(node: Node, given: list[Dimension | None]) -> Dimension | None:
    base, exponent = given
    if exponent not in (None, ONE):
        raise ExpressionError(node.column, f"'**': exponent has unit {shown(exponent)}")
    if base in (None, ONE):
        return base
    value = _literal(node.arguments[1])
    if value is None:
        text = f"expected a number as exponent of what has unit {shown(base)}"
        raise ExpressionError(node.column, f"'**': {text}")
    return times(ONE, base, value.limit_denominator(LARGEST_ROOT))


def _literal(node: Node) -> Fraction | None:
    """Return a number that stands in the text, perhaps with a sign or a unit."""
    sign = 1
    while node.op in ("negative", "unit"):
        node, sign = node.arguments[0], -sign if node.op == "negative" else sign
    return sign * Fraction(node.value) if node.op == "number" else None
