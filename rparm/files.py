"""Files of users, read with care, and files that appear complete or not at all.

A file that is given may be damaged, endless or no file. Trajectories are CSV files in the layout of
the FMI cross-check.
"""

import codecs
import csv
import json
import lzma
import math
import os
import re
import shutil
import stat
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from decimal import Decimal
from itertools import islice
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from rparm.errors import UnplacedError, UserError, closest, placed, reason
from rparm.interruption import uninterrupted

if TYPE_CHECKING:
    import numpy as np

LARGEST_TOML = 10_000_000  # bytes: some seconds of parsing
MOST_GUESSED = 1000  # files of a folder that are compared with a name: milliseconds
# the parser's time grows with the square of a key's parts: a.b.c
LONG_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){32}""")
NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)
# names that Windows keeps for devices, with any suffix
DEVICES = {"CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$"}
DEVICES |= {f"{port}{number}" for port in ("COM", "LPT") for number in "123456789\xb9\xb2\xb3"}
LARGEST_CSV = 50_000_000  # bytes; references of the project stay below 1 MB
Failure = Callable[[str, int | None], Exception]  # made from the mistake and its line, if known


class UnreadableError(UnplacedError):
    """Reason why a file cannot be read, in a few words without its name."""


# ---- Files that are given ------------------------------------------------------------------------
def check_regular(path: Path) -> None:
    """Refuse a device, pipe or socket, whose content may never end; a folder is allowed."""
    try:
        mode = Path(path).stat().st_mode
    except FileNotFoundError:
        raise UnreadableError(missing(path)) from None
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise UnreadableError(f"cannot be read: {reason(error)}") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise UnreadableError("cannot be read: is a device or a pipe, expected a file")


def missing(path: Path) -> str:
    """Return the message for a missing file, with a guess at a file of its kind."""
    path, beside = Path(path), []
    with suppress(OSError, ValueError):  # no folder, or one that cannot be read
        others = islice(path.parent.iterdir(), MOST_GUESSED)
        beside = sorted(other.stem for other in others if other.suffix == path.suffix)
    guess = closest(path.stem, beside)
    return f"no such file, did you mean {guess + path.suffix!r}?" if guess else "no such file"


def is_file(path: Path) -> bool:
    """Return whether it is a file; False for a name that no file can have."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def read_bytes(path: Path, largest: int) -> bytes:
    """Read a file of at most `largest` bytes; UnreadableError if that fails."""
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
    """Read UTF-8 text of at most `largest` bytes; UnreadableError or UnicodeDecodeError."""
    return decoded(read_bytes(path, largest))


def decoded(content: bytes) -> str:
    """Decode UTF-8 and drop a byte order mark; UnicodeDecodeError for other bytes."""
    return content.decode("utf-8").removeprefix(codecs.BOM_UTF8.decode("utf-8"))


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file; UserError if it cannot be read or parsed."""
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
    """Return a value from a file in one line of at most `longest` characters."""
    try:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a very large number"
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


def toml_value(value: Any) -> str:
    """Write a text, number or truth as TOML does; UserError for a name that is not UTF-8."""
    if not isinstance(value, str):
        return str(value).lower() if isinstance(value, bool) else repr(value)
    try:
        value.encode()
    except UnicodeEncodeError:
        raise UserError(f"{value}: TOML has no such name, which is not UTF-8") from None
    return json.dumps(value, ensure_ascii=False)


def toml_key(name: str) -> str:
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else toml_value(name)


def number_in(text: str) -> float:
    """Return the number in a text; ValueError if it has none, also for Python's 1_000."""
    if "_" in text:
        raise ValueError(f"could not convert string to float: {text!r}")
    return float(text)


def difference(later: float, earlier: float) -> float:
    """Subtract decimals as written: doubles of times since 1970 are 0.2 microseconds apart."""
    return float(Decimal(repr(float(later))) - Decimal(repr(float(earlier))))


# ---- Files that are written ----------------------------------------------------------------------
@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a temporary path to write to; it becomes `path` at the end, or is removed on failure."""
    path = Path(path)
    # the suffix stays the last: matplotlib takes the format of a picture from it
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def written(path: str | Path) -> Iterator[None]:
    """Turn a failure of the system inside into the user's error: `path` cannot be written."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {reason(error)}") from error


def write_text(path: Path, text: str) -> None:
    """Write a text, complete or not at all, to a folder that is made; escape bytes not of UTF-8."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def create(path: Path, text: str) -> None:
    """Write a file that must not exist yet, in a folder that does; UserError if that fails."""
    try:
        path.touch(exist_ok=False)  # so that no file is ever overwritten
    except FileExistsError:
        raise UserError(f"{path}: exists already, choose another name") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be written: {reason(error)}") from error
    try:
        with written(path):
            write_text(path, text)
    except UserError:
        path.unlink(missing_ok=True)
        raise


def copied(file: Path, path: Path) -> Path:
    """Copy a file to `path`, whose folder is made; return it. UserError if that fails."""
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as temporary:
            shutil.copyfile(file, temporary)
    return path


def check_for_windows(name: str) -> None:
    """Refuse the name of a device of Windows, which no file there can have."""
    if name.partition(".")[0].rstrip().upper() in DEVICES:
        raise UserError(f"{name!r}: Windows keeps this name for a device, choose another one")


def check_writable(folder: Path) -> None:
    """Refuse a folder that cannot be made or written, before anything runs."""
    with written(folder):
        existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        with uninterrupted(), TemporaryFile(dir=existing, prefix="rparm-"):
            pass


def from_here(path: Path) -> Path:
    """Return `path` relative to the current folder if it is inside."""
    try:
        here = Path.cwd()
    except OSError:  # it has been removed
        return path
    return path.relative_to(here) if path.is_relative_to(here) else path


def from_folder(path: Path, folder: Path) -> str:
    """Return a path relative to a folder; absolute if it is on another drive."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return path.absolute().as_posix()


# ---- Trajectories --------------------------------------------------------------------------------
def csv_failure(path: Path, way_out: str = "") -> Failure:
    """Return a function that makes the user's errors of a file; they end with the way out."""

    def wrong(message: str, line: int | None = None) -> UserError:
        where = f"{path}, line {line}" if line else f"{path}"
        return UserError(f"{where}: {message}{way_out}")

    return wrong


def write_trajectory(
    path: Path,
    times: "np.ndarray",
    names: Sequence[str],
    values: "np.ndarray",
    digits: int | None = 17,
    short_times: bool = False,
) -> None:
    """Write (rows, names) over times (s), complete or not at all; None: all digits of doubles."""
    import numpy as np  # takes long

    form = _shortest if digits is None else f"{{:.{digits}g}}".format
    of_time = _shortest if short_times else form
    with whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(f'"{name}"' for name in ("time", *names)) + "\n")
        lists = (np.asarray(x, float).tolist() for x in (times, values))
        for time, row in zip(*lists, strict=True):
            file.write(",".join([of_time(time), *map(form, row)]) + "\n")


def _shortest(value: float) -> str:
    return repr(value).removesuffix(".0")


def read_trajectory(path: Path, failure: Failure) -> tuple[tuple[str, ...], "np.ndarray"]:
    """Read names, "time" first, and a finite table (rows, names); installed, it is compressed."""
    import numpy as np  # takes long

    try:
        text = _csv_text(path)
    except UnreadableError as error:
        raise failure(str(error), None) from None
    except lzma.LZMAError:
        raise failure("is damaged", None) from None
    except UnicodeDecodeError:
        raise failure("not a text file", None) from None
    if not text:
        raise failure("is empty", None)
    if not text.endswith("\n"):
        raise failure("is cut off in the middle", text.count("\n") + 1)
    lines = text.splitlines()
    try:
        names = tuple(next(csv.reader(lines[:1])))
    except csv.Error as error:
        raise failure(f"not a header: {error}", 1) from None
    if not names or names[0] != "time":
        found = f"{names[0]:.40}" if names else ""
        raise failure(f"expected a header whose first column is 'time', found {found!r}", 1)
    rows = [
        _csv_numbers(row.split(","), len(names), line, failure)
        for line, row in enumerate(lines[1:], start=2)
    ]
    if not rows:
        raise failure("has no values", 1)
    return names, np.array(rows)


def _csv_text(path: Path) -> str:
    packed = path.with_name(f"{path.name}.xz")
    if is_file(packed) and not is_file(path):
        return decoded(lzma.decompress(read_bytes(packed, LARGEST_CSV)))
    return read_text(path, LARGEST_CSV)


def _csv_numbers(row: list[str], columns: int, line: int, failure: Failure) -> list[float]:
    if len(row) != columns:
        raise failure(f"expected {columns} values, found {len(row)}", line)
    try:
        values = [number_in(literal) for literal in row]
    except ValueError as error:
        raise failure(f"expected numbers, {error}", line) from None
    if not all(map(math.isfinite, values)):
        raise failure("expected finite numbers", line)
    return values
