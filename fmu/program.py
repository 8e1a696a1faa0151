"""What the programs of this folder share: how they end, and how they read texts."""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable
from pathlib import Path


class WrongInputError(Exception):
    """What is wrong with a file: its name, the place and the reason in one line."""


def program(
    *expected: type[Exception],
) -> Callable[[Callable[[], None]], Callable[[], int]]:
    """Makes `main` return 0, or 2 after a line on standard error for a mistake of the user's."""

    def decorate(main: Callable[[], None]) -> Callable[[], int]:
        @functools.wraps(main)
        def run() -> int:
            try:
                main()
            except (WrongInputError, OSError, *expected) as error:
                print(f"{Path(inspect.getfile(main)).name}: {error!s:.2000}", file=sys.stderr)
                return 2
            return 0

        return run

    return decorate


def read_text(path: Path) -> str:
    """Text of a file in UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise WrongInputError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise WrongInputError(f"{path}: is not UTF-8: {error}") from None
