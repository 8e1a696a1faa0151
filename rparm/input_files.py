"""Files that users give, read with care: they may be damaged, endless or no files at all."""

import codecs
import re
import stat
import tomllib
from contextlib import suppress
from decimal import Decimal
from itertools import islice
from pathlib import Path
from typing import Any

from rparm.errors import UnplacedError, UserError, closest, placed, reason

LARGEST_TOML = 10_000_000  # bytes: some seconds of parsing
MOST_GUESSED = 1000  # files of a folder that are compared with a name: milliseconds
# the parser's time grows with the square of a key's parts: a.b.c
LONG_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){32}""")


class UnreadableError(UnplacedError):
    """Why a file cannot be read, in a few words without its name."""


def check_regular(path: Path) -> None:
    """UnreadableError for what may never end: a device, pipe or socket; not for a folder."""
    try:
        mode = Path(path).stat().st_mode
    except FileNotFoundError:
        raise UnreadableError(missing(path)) from None
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise UnreadableError(f"cannot be read: {reason(error)}") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise UnreadableError("cannot be read: is a device or a pipe, expected a file")


def missing(path: Path) -> str:
    """What to say of a file that is not there; guesses which one of its kind may be meant."""
    path, beside = Path(path), []
    with suppress(OSError, ValueError):  # no folder, or one that cannot be read
        others = islice(path.parent.iterdir(), MOST_GUESSED)
        beside = sorted(other.stem for other in others if other.suffix == path.suffix)
    guess = closest(path.stem, beside)
    return f"no such file, did you mean {guess + path.suffix!r}?" if guess else "no such file"


def is_file(path: Path) -> bool:
    """Whether it is a file; False for a name that no file can have."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, largest: int) -> bytes:
    """Content of a file of at most `largest` bytes; UnreadableError if it cannot be read."""
    check_regular(path)
    try:
        with Path(path).open("rb") as file:
            content = file.read(largest + 1)
    except OSError as error:
        raise UnreadableError(f"cannot be read: {reason(error)}") from None
    if len(content) > largest:
        raise UnreadableError(f"is larger than {largest / 1e6:g} MB")
    return content


def read_text(path: Path, largest: int) -> str:
    """UTF-8 text of a file of at most `largest` bytes; UnreadableError or UnicodeDecodeError."""
    return decoded(read_bytes(path, largest))


def decoded(content: bytes) -> str:
    """Text of what is in UTF-8, without a byte order mark; or else UnicodeDecodeError."""
    return content.decode("utf-8").removeprefix(codecs.BOM_UTF8.decode("utf-8"))


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file; UserError for whatever keeps it from being read."""
    try:
        with placed(path):
            text = read_text(path, LARGEST_TOML)
        long = LONG_KEY.search(text)
        if long:
            line = text.count("\n", 0, long.start()) + 1
            raise UserError(f"{path}, line {line}: a key of more than 32 parts")
        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not UTF-8 text, at byte {error.start}") from None
    except (ValueError, RecursionError) as error:  # TOMLDecodeError is a ValueError
        raise UserError(f"{path}: not valid TOML: {error}") from None


def show(value: Any, longest: int = 40) -> str:
    """Short, one-line form of a value from a file, of at most `longest` characters."""
    try:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a very large number"
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def number_in(text: str) -> float:
    """The number in a text; ValueError for others, and for 1_000, which only Python reads."""
    if "_" in text:
        raise ValueError(f"could not convert string to float: {text!r}")
    return float(text)


def difference(later: float, earlier: float) -> float:
    """Difference of two numbers as they are written, rounded once.

    Doubles of times that count from 1970 are 0.2 microseconds apart, and so would be theirs.
    """
    return float(Decimal(repr(float(later))) - Decimal(repr(float(earlier))))
