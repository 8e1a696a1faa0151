"""Communication points of random sequences of steps, for tests of rollback."""

from collections.abc import Sequence
from typing import Any


def times(moves: Sequence[Any]) -> list[float]:
    """Communication points of a master that adds up its steps."""
    found = [0.0]
    for move in moves:
        found.append(found[-1] + move.length)
    return found
