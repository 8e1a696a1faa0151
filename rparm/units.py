"""Values with units as users write them, and as messages, tables and pages show them.

Users may write "90 deg", "300 mm" or "2kN". Known for a variable are its own unit, the display
units that its FMU declares for it, and what the compiler knows of the same dimension.
"""

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context
from fractions import Fraction
from typing import Any

from rparm.errors import WrongValueError, did_you_mean
from rparm.files import show
from rparm.fmu_tools.compiler.expressions import expression
from rparm.fmu_tools.compiler.units import Unit, parsed

USUAL = {  # units that messages name
    "m": "mm cm km", "s": "ms us min h", "rad": "deg mrad", "Hz": "mHz kHz", "kg": "g t",
    "N": "mN kN", "N.m": "mN.m kN.m", "m/s": "mm/s km/h", "rad/s": "deg/s rpm",
    "K": "degC mK", "degC": "K", "Pa": "kPa bar",
}  # fmt: skip
NONE = (None, "", "1")  # units of variables without one
LONGEST = 100  # characters of a value with its unit
MOST_SHOWN = 20  # units in a message
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
QUANTITY = re.compile(rf"({NUMBER})[ \t]*([^\s\d.,+-].*|1/.*)?", re.ASCII)
TYPED = str.maketrans({"·": ".", "²": "2", "³": "3"})  # as pages write units
PREFIXABLE = re.compile(r"(m|s|rad|N|J|W|V|A|Hz|Pa|H)(?!\w)")
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6}  # s
SMALLEST = 1e-99  # smaller numbers are shown as ~0


@dataclass(frozen=True)
class Scale:
    """What the numbers of a column mean: values are factor * number + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def values(self, numbers: Any) -> Any:
        """Return the values (rows,) of numbers (rows,)."""
        scaled = numbers * self.factor
        return scaled + self.offset if self.offset else scaled  # a sum would lose the sign of -0.0


Units = Mapping[str, Unit]  # by name, the variable's own first
Displays = Mapping[str, Units]  # display units, by the unit that they belong to


def display_unit(factor: object, offset: object) -> Unit:
    """Return the unit that an FMU declares: a number is factor * value + offset in it.

    ValueError if these are of no use.
    """
    numbers = [float(str(number)) for number in (factor, offset)]
    if not all(map(math.isfinite, numbers)) or not numbers[0]:
        raise ValueError(f"display unit with factor {factor} and offset {offset}")
    exact, below = (Fraction(repr(number)) for number in numbers)
    return Unit({}, 1 / exact, -below / exact)


def units_of(name: str | None, displays: Displays) -> Units:
    """Return the units that messages name, for a value whose own unit is `name`; empty for none."""
    if name in NONE:
        return {}
    known = {name: Unit({})} | dict(displays.get(name, {}))
    for other in USUAL.get(name, "").split():
        known.setdefault(other, parsed(other).of(parsed(name)))
    return known


# units of other values in scenarios and campaigns than variables of models
SECONDS = units_of("s", {})
HERTZ = units_of("Hz", {})
RADIANS = units_of("rad", {})


def finite_number(given: Any) -> float:
    """Return `given` as a float; WrongValueError if it is not a finite number."""
    try:
        return expression.finite_number(given)
    except ValueError as error:
        raise WrongValueError(f"{error}, got {show(given)}") from None


def quantity(given: Any, known: Units, is_difference: bool = False) -> float:
    """Return the value of a number, or of a text with a `known` unit; else WrongValueError."""
    if not isinstance(given, str):
        return finite_number(given)
    number, unit = _parts(given, known)
    if not unit:
        raise WrongValueError(
            f"expected a unit after the number, or no quotation marks{_known(known)}, "
            f"got {show(given)}"
        )
    return _value(given, number, unit, known, is_difference)


def scale(given: Any, known: Units) -> Scale:
    """Return the scale of a column whose 1 is `given`, as `quantity`; 1 degC has its offset."""
    factor = quantity(given, known, True)
    if not isinstance(given, str):
        return Scale(factor)
    return Scale(factor, _value(given, "0", _parts(given, known)[1], known))


def typed_quantity(text: str, known: Units) -> float:
    """Return the value of a text of the command line, with or without a unit, as `quantity`."""
    number, unit = _parts(text, known)
    return _value(text, number, unit or next(iter(known), ""), known)


def _parts(text: str, known: Units) -> tuple[str, str]:
    found = QUANTITY.fullmatch(text.strip()) if len(text) <= LONGEST else None
    if not found:
        form = f"a number, or a number and its unit{_known(known)}" if known else "a number"
        raise WrongValueError(f"expected {form}, got {show(text)}")
    if found[2] and not known:
        raise WrongValueError(f"expected a number without a unit, got {show(text)}")
    return found[1], found[2] or ""


def _value(given: str, number: str, name: str, known: Units, is_difference: bool = False) -> float:
    unit = _unit(name, known) if name else Unit({})
    if unit is None:
        guess = did_you_mean(name, known)
        raise WrongValueError(f"unknown unit {show(name)}{guess}{_known(known)}")
    with suppress(ValueError):
        if math.isfinite(float(number)):
            return unit.value(number, is_difference)
    raise WrongValueError(f"expected a finite number, got {show(given)}")


def _unit(name: str, known: Units) -> Unit | None:
    name = name if name in known else name.translate(TYPED)
    if name in known:
        return known[name]
    with suppress(ValueError):
        unit = parsed(name).of(parsed(next(iter(known))))
        return unit if not unit.offset else None
    return None


def _known(known: Units) -> str:
    names = [*list(known)[:MOST_SHOWN], *(["..."] if len(known) > MOST_SHOWN else [])]
    return f" (known: {', '.join(names)})" if names else ""


def short(number: float, digits: int | None = None) -> str:
    """Write 1e-8 for 1e-08: with `digits` behind the point, or up to three; 0, and ~0 if tiny."""
    if not number or not math.isfinite(number):
        return f"{number:g}"
    if abs(number) < SMALLEST:
        return "~0"
    mantissa, exponent = f"{number:.{3 if digits is None else digits}e}".split("e")
    if digits is None:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}e{int(exponent)}" if int(exponent) else mantissa


def exponents(text: str) -> str:
    """Write 1e-8 for 1e-08, and 1e6 for 1e+06."""
    return re.sub(r"(?<=\d)e(?:\+|(-))0*(?=\d)", r"e\1", text)


def rounded_up(value: float, digits: int) -> str:
    """Write an upper bound, rounded up: 1.3e-8 for 1.21e-8 and one digit behind the point."""
    upwards = Context(prec=digits + 1, rounding=ROUND_CEILING)
    return exponents(f"{float(upwards.create_decimal_from_float(value)):.{digits}e}")


def seconds(time: float) -> str:
    """Write a time as 0.123 s, 12.3 s or 1234 s."""
    return f"{time:.3f} s" if time < 10 else f"{time:.1f} s" if time < 100 else f"{time:.0f} s"


def duration(seconds: float) -> str:
    """Write 2 ms for 0.002, and us, ns or s where these fit."""
    size = abs(float(f"{seconds:.6g}"))  # 0.9999999 s is 1 s
    fitting = ((name, unit) for name, unit in TIMES.items() if size >= unit)
    name, unit = next(fitting, ("ns", 1e-9)) if size else ("s", 1.0)
    return exponents(f"{seconds / unit:.6g} {name}")


def ordinal(number: int) -> str:
    """Write 2nd, 3rd, 10th."""
    teen = number // 10 % 10 == 1
    return f"{number}{'th' if teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"


def minus(text: object) -> str:
    """Replace the hyphens before digits by minus signs, as plots have them."""
    return re.sub(r"(?<![\w.-])-(?=\d)|(?<=\de)-(?=\d)", "\N{MINUS SIGN}", exponents(str(text)))


def unit(text: str | None) -> str:
    """Write a unit of FMI as N·m for N.m, m/s² for m/s2; nothing for none."""
    powers = {"2": "²", "3": "³"}
    raised = re.sub(r"(?<=[a-z])[23](?!\.?\d)", lambda found: powers[found[0]], text or "")
    return re.sub(r"\.(?!\d)", "·", raised)


def prefixed(text: str, largest: float) -> tuple[str, float]:
    """Return a unit for values of this size, mm for m, and how many of it are one of the other."""
    if not PREFIXABLE.match(text) or not 1e-12 < largest < 0.1:
        return text, 1.0
    thousands = min(math.ceil(-(math.log10(largest) + 1) / 3), 4)
    return " mµnp"[thousands] + text, 1e3**thousands


def bits(differing: Sequence[str]) -> str:
    """Say how the outputs of two FMUs compare, given those that differ."""
    return "other bits" if differing else "same bits"


def sentence(text: str) -> str:
    """Begin a text with a capital letter."""
    return text[:1].upper() + text[1:]


def verdict(passed: bool) -> str:
    """Name the result of a check."""
    return "passed" if passed else "FAILED"


def number(value: float) -> str:
    """Write a number with at most nine digits."""
    return exponents(f"{value:.9g}")
