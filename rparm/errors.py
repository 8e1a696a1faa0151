"""Errors whose text is meant for the user, and functions that form such texts."""

import difflib
import re
from collections.abc import Iterable, Iterator, Sequence, Sized
from contextlib import contextmanager
from typing import Any

GAP = ".."  # in a text that is shortened
SHORTEST_PART = 3  # letters of a longer name that may be meant


class UserError(Exception):
    """Something the user can put right, in one line: file, key, what is wrong, what is expected."""

    code = 2  # of a command that ends with it
    result: Any = None  # of a run that failed after its start: its rows up to there


class CodeError(UserError):
    """What the user's own Python code raised or returned wrongly, with its file and line."""

    code = 1


class StoppedError(UserError):
    """A run that failed after its start; `result` may still be None."""

    def __init__(self, text: str, result: Any) -> None:
        super().__init__(text)
        self.result = result


class UnplacedError(Exception):
    """A mistake, in one line without its place, which `placed` adds."""


class WrongValueError(UnplacedError):
    """A value that a variable does not take, or a variable of another kind."""


@contextmanager
def placed(where: object) -> Iterator[None]:
    """Turn an `UnplacedError` inside into the user's error, which begins with `where`."""
    try:
        yield
    except UnplacedError as error:
        raise UserError(f"{where}: {error}") from error


def together(errors: Sequence[UserError]) -> UserError:
    """Join all errors of a command to one."""
    return UserError("; ".join(dict.fromkeys(map(str, errors))))


def closest(name: str, known: Iterable[str]) -> str:
    """Return the one of `known` that `name` may be meant for, or nothing."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1)
    if not close and len(name) >= SHORTEST_PART:
        close = [other for other in known if name.lower() in other.lower()]
    if not close:
        plain = {_plain(other): other for other in reversed(known)}
        close = [plain[found] for found in difflib.get_close_matches(_plain(name), plain, n=1)]
    return close[0] if close else ""


def _plain(name: str) -> str:
    """Remove what is easily mistaken in a name: case, underscores, hyphens and blanks."""
    return re.sub("[_ -]", "", name).casefold()


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of an error message that proposes the closest of `known`, or nothing."""
    guess = closest(name, known)
    return f", did you mean {guess!r}?" if guess else ""


def hint(name: str, known: Iterable[str], label: str = "known") -> str:
    """Return the end of an error message that proposes one of `known`, and names them all."""
    known = list(known)
    return f"{did_you_mean(name, known)} ({label}: {', '.join(known) or 'none'})"


def reason(error: Exception) -> str:
    """Return the system's message about a file, without error number and file name."""
    return getattr(error, "strerror", None) or str(error) or type(error).__name__


def one_line(text: object) -> str:
    """Replace each run of white space by a single space."""
    return " ".join(str(text).split())


def shortened(text: str, width: int) -> str:
    """Return at most `width` characters: the begin and the end of a longer text."""
    if len(text) <= width:
        return text
    begin = (width - len(GAP) + 1) // 2
    return text[:begin] + GAP + text[len(text) - (width - len(GAP) - begin) :]


def counted(things: Sized, name: str) -> str:
    """Write 1 scenario, 2 scenarios."""
    return f"{len(things)} {name}" + ("s" if len(things) != 1 else "")
