"""Units of expressions: every sum, comparison and argument of a function has to fit.

A unit is the exponents of the SI base units; rad counts as 1. A number without a name takes the
unit of what it is added to, compared with or assigned to; in products it is 1.
"""

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

from .expression import (
    EQUALITIES,
    RELATIONS,
    ExpressionError,
    Node,
    in_order,
    table_unit,
)

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
ANGLE = "rad"

Unit = tuple[Fraction, ...]  # exponents, in the order of BASE
LARGEST_ROOT = 100  # 0.3333333333333333 is 1/3
ONE: Unit = (Fraction(0),) * len(BASE)


def unit_of_exponents(exponents: Mapping[str, int]) -> Unit:
    """Return the unit with these exponents, by base unit."""
    return tuple(Fraction(exponents.get(base, 0)) for base in BASE)


def times(a: Unit, b: Unit, power: Fraction = Fraction(1)) -> Unit:
    """Return the product a b^power."""
    return tuple(x + power * y for x, y in zip(a, b, strict=True))


# units with a symbol, as products of those before
DERIVED = {
    "Hz": "1/s", "N": "kg.m/s2", "Pa": "N/(m.m)", "J": "N.m", "W": "J/s", "C": "A.s", "V": "W/A",
    "F": "C/V", "ohm": "V/A", "Ohm": "V/A", "S": "A/V", "Wb": "V.s", "T": "Wb/(m.m)", "H": "Wb/A",
    "lm": "cd", "lx": "lm/(m.m)", "Bq": "1/s", "Gy": "J/kg", "Sv": "J/kg", "kat": "mol/s",
}  # fmt: skip
SYMBOLS: dict[str, dict[str, int]] = {base: {base: 1} for base in (*BASE, ANGLE)}
PREFIXES = {prefix: Fraction(10) ** power for prefix, power in {
    "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "d": -1, "c": -2, "m": -3, "u": -6, "n": -9, "p": -12,
}.items()}  # fmt: skip
# further symbols, by how many of a product one is; their prefixes and products are display units
SCALED = {
    "min": (Fraction(60), "s"), "h": (Fraction(3600), "s"), "d": (Fraction(86400), "s"),
    "deg": (Fraction(math.pi) / 180, "rad"), "rev": (Fraction(math.pi) * 2, "rad"),
    "rpm": (Fraction(math.pi) / 30, "rad/s"), "bar": (Fraction(10**5), "Pa"),
    "g": (Fraction(1, 1000), "kg"), "t": (Fraction(1000), "kg"), "l": (Fraction(1, 1000), "m3"),
}  # fmt: skip
CELSIUS, ZERO_CELSIUS = "degC", Fraction("273.15")
OTHER_SIGN = re.compile(r"\d\.?\d|[\^*·]")
FACTOR = re.compile(r"([A-Za-z]+)(-?[1-9])?", re.ASCII)
PRODUCT = re.compile(r"([^/()]+)(?:/(?:([^./()]+)|\(([^/()]+)\)))?")  # a.b, a/b or a/(b.c)


@dataclass(frozen=True)
class Measure:
    """A unit as a user writes it: in SI a number is factor * number + offset of `base`."""

    exponents: dict[str, int]  # of base units and rad, if not 0
    factor: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    base: str = ""  # the unit of SI, with prefixes left out; "": it has no name in the text

    @property
    def is_display(self) -> bool:
        """Whether it is no unit of SI."""
        return (self.factor, self.offset) != (1, 0)

    def in_si(self, number: float, is_size: bool = False) -> float:
        """Return a number in SI, rounded once; is_size: it is a difference."""
        if not self.is_display:
            return number
        offset = 0 if is_size else self.offset
        return float(Fraction(repr(number)) * self.factor + offset)


def measured(text: str) -> Measure:
    """Read a product of symbols; ValueError if it is none."""
    if text == CELSIUS:
        return Measure({"K": 1}, offset=ZERO_CELSIUS, base="K")
    hint = ": exponents are whole, from -9 to 9, and a point multiplies"
    hint = hint if OTHER_SIGN.search(text) else ""
    product = PRODUCT.fullmatch(text)
    if product is None or (text.startswith("1") and text != "1" and not text.startswith("1/")):
        raise ValueError(f"unit {text!r} is no product of SI symbols such as kg.m/s2{hint}")
    found: dict[str, int] = {}
    total, bases = Fraction(1), text
    for part, sign in ((product[1], 1), (product[2] or product[3], -1)):
        for factor in part.split(".") if part and part != "1" else ():
            symbol = FACTOR.fullmatch(factor)
            known = _scaled(symbol[1]) if symbol else None
            if known is None:
                expected = f"SI symbol with an exponent, such as s2{hint}"
                raise ValueError(f"unit {text!r}: {factor!r} is no {expected}")
            power = sign * int(symbol[2] or 1)
            scale, base = known
            total *= scale**power
            bases = re.sub(rf"(?<![A-Za-z]){symbol[1]}(?![A-Za-z])", base, bases)
            of_base = SYMBOLS[base] if base in SYMBOLS else exponents(base)
            for unit, exponent in of_base.items():
                found[unit] = found.get(unit, 0) + power * exponent
    found = {unit: exponent for unit, exponent in found.items() if exponent}
    return Measure(found, total, base=bases if total == 1 or _is_of_si(bases, found) else "")


def _is_of_si(text: str, expected: dict[str, int]) -> bool:
    """Return whether a text is the unit of SI with these exponents."""
    with suppress(ValueError):
        return measured(text) == Measure(expected, base=text)
    return False


def _scaled(name: str) -> tuple[Fraction, str] | None:
    """Return how many of a unit of SI a symbol is; None for an unknown one."""
    if name in SYMBOLS:
        return Fraction(1), name
    if name in SCALED:
        return SCALED[name]
    prefix, rest = name[:1], name[1:]
    if prefix not in PREFIXES or rest not in (*SYMBOLS, *SCALED) or rest in ("kg", "t", "d", "h"):
        return None
    scale, base = _scaled(rest)
    return PREFIXES[prefix] * scale, base


def exponents(text: str) -> dict[str, int]:
    """Return exponents of base units and rad in a product of symbols; ValueError if it is none."""
    return measured(text).exponents


for _symbol, _product in DERIVED.items():
    SYMBOLS[_symbol] = exponents(_product)


def shown(unit: Unit | Mapping[str, int]) -> str:
    """Write a unit, or exponents, as a message names it: kg.m/s2."""
    exponents = unit if isinstance(unit, Mapping) else dict(zip(BASE, unit, strict=True))
    above = [f"{b}{e if e != 1 else ''}" for b, e in exponents.items() if e > 0]
    below = [f"{b}{-e if e != -1 else ''}" for b, e in exponents.items() if e < 0]
    text = ".".join(above) or "1"
    if not below:
        return text
    return f"{text}/{below[0]}" if len(below) == 1 else f"{text}/({'.'.join(below)})"


def unit_of(root: Node, units: Mapping[str, Unit], expected: Unit | None = None) -> Unit:
    """Return the unit of an expression of right kinds; 1 for a condition and for a number.

    `units` has all names that are numbers, `time` too. ExpressionError where units do not fit.
    """
    found: dict[Node, Unit | None] = {}  # None: a number, which takes any unit
    for node in in_order([root]):
        found[node] = _unit(node, [found[argument] for argument in node.arguments], units)
    unit = found[root]
    if expected is not None and unit is not None and unit != expected:
        raise ExpressionError(root.column, f"expected unit {shown(expected)}, got {shown(unit)}")
    return unit if unit is not None else expected or ONE


def _unit(node: Node, given: list[Unit | None], units: Mapping[str, Unit]) -> Unit | None:
    if node.op == "number":
        return None
    if node.op == "name":
        return units.get(node.name, ONE)
    if node.op == "negative":
        return given[0]
    if node.op in ("*", "/"):
        power = Fraction(1 if node.op == "*" else -1)
        if given == [None, None]:
            return None
        return times(given[0] or ONE, given[1] or ONE, power)
    if node.op in ("+", "-", "min", "max", "hypot"):
        return _same(node, given)
    if node.op in ("table", "call"):
        return _of_table(node, given, units)
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


def _of_table(node: Node, given: list[Unit | None], units: Mapping[str, Unit]) -> Unit:
    has_none = node.op == "call" and table_unit(node.name) not in units
    hint = ": write its units into [functions]" if has_none else ""
    for i, unit in enumerate(given):
        _checked(node, unit, units.get(table_unit(node.name, i), ONE), hint)
    return units.get(table_unit(node.name), ONE)


def _checked(node: Node, unit: Unit | None, expected: Unit, hint: str = "") -> Unit:
    """Return the unit that is expected, for a table or function that the node names."""
    if unit not in (None, expected):
        what = f"{node.name.partition('(')[0]} takes unit {shown(expected)}, got {shown(unit)}"
        raise ExpressionError(node.column, what + hint)
    return expected


def _same(node: Node, given: list[Unit | None]) -> Unit | None:
    known = [unit for unit in given if unit is not None]
    if len(set(known)) > 1:
        units = " and ".join(shown(unit) for unit in known)
        raise ExpressionError(node.column, f"{node.op!r}: units {units} do not fit")
    return known[0] if known else None


def _power(node: Node, given: list[Unit | None]) -> Unit | None:
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
    """Return a number that stands in the text, perhaps with a sign."""
    sign = 1
    while node.op == "negative":
        node, sign = node.arguments[0], -sign
    return sign * Fraction(node.value) if node.op == "number" else None
