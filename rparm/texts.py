"""Numbers and verdicts as text, the same on the console, on pages and in pictures."""

import math
import re
from collections.abc import Sequence, Sized
from decimal import ROUND_CEILING, Context

SMALLEST = 1e-99  # smaller numbers are shown as ~0
GAP = ".."  # in a text that is shortened


def short(number: float, digits: int | None = None) -> str:
    """1e-8 for 1e-08: so many digits behind the point, or up to three as needed; 0, ~0 if tiny."""
    if not number or not math.isfinite(number):
        return f"{number:g}"
    if abs(number) < SMALLEST:
        return "~0"
    mantissa, exponent = f"{number:.{3 if digits is None else digits}e}".split("e")
    if digits is None:
        mantissa = mantissa.rstrip("0").rstrip(".")
    return f"{mantissa}e{int(exponent)}"


def rounded_up(value: float, digits: int) -> str:
    """1.3e-08 for 1.21e-8 and one digit behind the point: an upper bound, rounded up."""
    upwards = Context(prec=digits + 1, rounding=ROUND_CEILING)
    return f"{float(upwards.create_decimal_from_float(value)):.{digits}e}"


def shortened(text: str, width: int) -> str:
    """A text of at most `width` characters: begin and end of a longer one."""
    if len(text) <= width:
        return text
    begin = (width - len(GAP) + 1) // 2
    return text[:begin] + GAP + text[len(text) - (width - len(GAP) - begin) :]


def seconds(time: float) -> str:
    """0.123 s, 12.3 s, 1234 s."""
    return f"{time:.3f} s" if time < 10 else f"{time:.1f} s" if time < 100 else f"{time:.0f} s"


def milliseconds(seconds: float) -> str:
    """2 ms for 0.002."""
    return f"{1e3 * seconds:.6g} ms"


def ordinal(number: int) -> str:
    """2nd, 3rd, 10th."""
    teen = number // 10 % 10 == 1
    return f"{number}{'th' if teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"


def minus(text: object) -> str:
    """A text with minus signs for the hyphens before digits, as the plots have them."""
    return re.sub(r"(?<![\w.-])-(?=\d)|(?<=\de)-(?=\d)", "\N{MINUS SIGN}", str(text))


def unit(text: str | None) -> str:
    """A unit of FMI as it is written: N·m for N.m, m/s² for m/s2; nothing for none."""
    raised = re.sub(r"(?<=[a-z])[23]", lambda found: {"2": "²", "3": "³"}[found[0]], text or "")
    return raised.replace(".", "·")


def counted(things: Sized, name: str) -> str:
    """1 scenario, 2 scenarios."""
    return f"{len(things)} {name}" + ("s" if len(things) != 1 else "")


def bits(differing: Sequence[str]) -> str:
    """How the outputs of two FMUs compare, of which some may differ."""
    return "other bits" if differing else "same bits"


def sentence(text: str) -> str:
    """A text with a capital letter at its beginning."""
    return text[:1].upper() + text[1:]


def verdict(passed: bool) -> str:
    """What a check says of itself."""
    return "passed" if passed else "FAILED"


def number(value: float) -> str:
    """At most nine digits, as short as they get."""
    return f"{value:.9g}"
