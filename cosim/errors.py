"""Errors whose text is meant for the user, and functions that form such texts."""

import difflib
from collections.abc import Iterable, Sequence

SHORTEST_PART = 3  # letters of a longer name that may be meant


class UserError(Exception):
    """Something the user can put right.

    Its text is one line: the file, the key, what was wrong and what was expected.
    """


class WrongValueError(Exception):
    """Why a variable does not take a value, or is not of a kind, in one line."""


def together(errors: Sequence[UserError]) -> UserError:
    """One error for all of a command's."""
    return UserError("; ".join(dict.fromkeys(map(str, errors))))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of an error message that proposes the closest of `known`, or nothing."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1)
    if not close and len(name) >= SHORTEST_PART:
        close = [other for other in known if name.lower() in other.lower()]
    return f", did you mean {close[0]!r}?" if close else ""


def reason(error: Exception) -> str:
    """The system's message about a file, without error number and file name."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def one_line(text: object) -> str:
    """`text` with each run of white space replaced by a single space."""
    return " ".join(str(text).split())
