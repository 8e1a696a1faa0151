"""Numbers of files, whose parsers give whole numbers, truth values and infinities, too."""

import math
from typing import Any


def finite_number(given: Any) -> float:
    """`given` as a float; ValueError says what was expected if it is not a finite number."""
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise ValueError("expected a number")
    try:
        number = float(given)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("expected a finite number")
    return number
