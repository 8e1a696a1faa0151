"""Units: the symbols that files and FMUs may have, and what their numbers are in SI.

A unit is a product of symbols such as kg.m2/s2; rad stands beside the base units. Factors and
offsets are exact, and a number is rounded once; degrees are those of `math.radians`.
"""

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
ANGLE = "rad"
Exponents = Mapping[str, int | Fraction]  # of base units and rad, if not 0; halves are fractions
DEGREE = Fraction(math.pi) / 180  # rad
SAME = Fraction(1, 10**12)  # FMUs write as many digits of it as they like
ROOT_DIGITS = 10**60  # in front of the point, of roots that are no fractions

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
    "deg": (DEGREE, ANGLE), "rev": (DEGREE * 360, ANGLE),
    "rpm": (DEGREE * 6, "rad/s"), "bar": (Fraction(10**5), "Pa"),
    "g": (Fraction(1, 1000), "kg"), "t": (Fraction(1000), "kg"), "l": (Fraction(1, 1000), "m3"),
}  # fmt: skip
CELSIUS, ZERO_CELSIUS = "degC", Fraction("273.15")
OTHER_SIGN = re.compile(r"\d\d|\.\d|\d/\d|[\^*·√]|sqrt")
POINT = r"\.(?![0-9])"  # that multiplies, and is not that of m0.5
FACTOR = re.compile(r"([A-Za-z]+)(-?(?:[1-9]|[0-9]\.5))?", re.ASCII)
# a.b, a/b or a/(b.c)
PRODUCT = re.compile(rf"([^/()]+)(?:/(?:((?:(?!{POINT})[^/()])+)|\(([^/()]+)\)))?")
# in declarations without a word; what has no name gets the first with the same exponents
STANDARD = (
    "1", "1/s", "1/s2", "1/s3", "A", "A/s", "Hz", "J", "kg", "kg.m", "kg.m2", "m", "m/s", "m/s2",
    "m/s3", "m2/s2", "N", "N.m", "N.m.s", "N.m.s/rad", "N.m/A", "N.m/rad", "N.s", "N.s/m", "N/m",
    "ohm", "rad", "rad/m", "rad/s", "rad/s2", "rad/s3", "s", "s/m", "s/rad", "V", "W",
)  # fmt: skip
DISPLAYED = {"rad": ["deg"], "rad/s": ["deg/s"]}  # in tools, unless a file says otherwise


@dataclass(frozen=True)
class Unit:
    """A unit, in which a number stands for the value factor * number + offset of another one."""

    exponents: Exponents
    factor: Fraction = Fraction(1)
    offset: Fraction = Fraction(0)
    base: str = ""  # the other one: of SI, with prefixes left out; "": it has no name in the text

    @property
    def is_display(self) -> bool:
        """Whether it is no unit of SI."""
        return (self.factor, self.offset) != (1, 0)

    def value(self, number: float | str, is_difference: bool = False) -> float:
        """Return the value of a finite number, or a literal; a difference has no offset.

        ValueError if it is no double.
        """
        if not self.offset and abs(self.factor - DEGREE) <= SAME * DEGREE:
            return math.radians(float(number))
        # only 0 may have an exponent of any size
        exact = Fraction(str(number)) if float(number) else Fraction(0)
        exact = exact * self.factor + (0 if is_difference else self.offset)
        try:
            return float(exact) if exact else math.copysign(0.0, float(number))
        except OverflowError:
            raise ValueError(f"{number} is too large") from None

    def of(self, other: "Unit") -> "Unit":
        """Return this unit with its values in another one; ValueError if that cannot be."""
        if self.exponents != other.exponents:
            raise ValueError("they measure different things")
        offset = (self.offset - other.offset) / other.factor
        return Unit(self.exponents, self.factor / other.factor, offset)


def parsed(text: str) -> Unit:
    """Read a product of symbols; ValueError if it is none."""
    if text == CELSIUS:
        return Unit({"K": 1}, offset=ZERO_CELSIUS, base="K")
    hint = ": exponents are whole or halves, as in Hz0.5, up to 9.5, and a point multiplies"
    hint = hint if OTHER_SIGN.search(text) else ""
    product = PRODUCT.fullmatch(text)
    if product is None or (text.startswith("1") and text != "1" and not text.startswith("1/")):
        raise ValueError(f"unit {text!r} is no product of SI symbols such as kg.m/s2{hint}")
    found: dict[str, Fraction] = {}
    square, bases = Fraction(1), text  # of the factor
    for part, sign in ((product[1], 1), (product[2] or product[3], -1)):
        for factor in re.split(POINT, part) if part and part != "1" else ():
            symbol = FACTOR.fullmatch(factor)
            known = _scaled(symbol[1]) if symbol else None
            if known is None:
                expected = f"SI symbol with an exponent, such as s2{hint}"
                raise ValueError(f"unit {text!r}: {factor!r} is no {expected}")
            power = sign * Fraction(symbol[2] or 1)
            scale, base = known
            square *= scale ** int(2 * power)
            bases = re.sub(rf"(?<![A-Za-z]){symbol[1]}(?![A-Za-z])", base, bases)
            of_base = SYMBOLS[base] if base in SYMBOLS else parsed(base).exponents
            for unit, exponent in of_base.items():
                found[unit] = found.get(unit, Fraction(0)) + power * exponent
    exponents = {unit: whole(exponent) for unit, exponent in found.items() if exponent}
    has_name = square == 1 or _is_of_si(bases, exponents)
    return Unit(exponents, _root(square), base=bases if has_name else "")


def whole(exponent: Fraction) -> int | Fraction:
    """Return an exponent as a whole number, if it is one."""
    return int(exponent) if exponent.denominator == 1 else exponent


def _root(square: Fraction) -> Fraction:
    """Return the root of a fraction: exact if it is one itself, else its first digits."""
    above, below = math.isqrt(square.numerator), math.isqrt(square.denominator)
    if Fraction(above, below) ** 2 == square:
        return Fraction(above, below)
    digits = square.denominator * ROOT_DIGITS
    return Fraction(math.isqrt(square.numerator * digits * ROOT_DIGITS), digits)


def _is_of_si(text: str, expected: Exponents) -> bool:
    """Return whether a text is the unit of SI with these exponents."""
    with suppress(ValueError):
        return parsed(text) == Unit(expected, base=text)
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


for _symbol, _product in DERIVED.items():
    SYMBOLS[_symbol] = parsed(_product).exponents


def shown(exponents: Exponents) -> str:
    """Write exponents as a message names a unit: kg.m/s2."""
    above = [f"{b}{_shown(e)}" for b, e in exponents.items() if e > 0]
    below = [f"{b}{_shown(-e)}" for b, e in exponents.items() if e < 0]
    text = ".".join(above) or "1"
    if not below:
        return text
    return f"{text}/{below[0]}" if len(below) == 1 else f"{text}/({'.'.join(below)})"


def _shown(exponent: int | Fraction) -> str:
    if exponent == 1:
        return ""
    return f"{float(exponent)}" if exponent.denominator == 2 else f"{exponent}"
