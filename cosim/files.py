"""Files that are read, whatever they are, and tables of numbers in them."""

import codecs
import csv
import math
import stat
import struct
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cosim.outputs import reason, whole

LARGEST_TABLE = 50_000_000  # bytes; references of the project stay below 1 MB
LARGEST_CONTENT = 2**30  # bytes of all files in an archive
LARGEST_XML = 64_000_000  # bytes; parsed it takes some twenty times as much memory
MOST_FILES = 10_000  # in an archive


class UnreadableError(Exception):
    """Why a file cannot be read, in a few words without its name."""


def check_regular(path: Path) -> None:
    """Refuse what may never end when it is read: devices, pipes, sockets; not a folder.

    Raises
    ------
    UnreadableError
    """
    try:
        mode = Path(path).stat().st_mode
    except FileNotFoundError:
        raise UnreadableError("no such file") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        raise UnreadableError(f"cannot be read: {reason(error)}") from None
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise UnreadableError("cannot be read: is a device or a pipe, expected a file")


def is_file(path: Path) -> bool:
    """Whether it is a file; not, where the name is impossible."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path, largest: int) -> str:
    """Text of a file of at most `largest` bytes in UTF-8, without a byte order mark.

    Raises
    ------
    UnreadableError
    UnicodeDecodeError
        With the position in the file.
    """
    check_regular(path)
    try:
        with Path(path).open("rb") as file:
            content = file.read(largest + 1)
    except OSError as error:
        raise UnreadableError(f"cannot be read: {reason(error)}") from None
    if len(content) > largest:
        raise UnreadableError(f"is larger than {largest / 1e6:g} MB")
    return content.decode("utf-8").removeprefix(codecs.BOM_UTF8.decode("utf-8"))


def check_archive(path: Path) -> None:
    """Refuse a zip archive whose contents would fill the disk or the memory.

    Raises
    ------
    UnreadableError
        Or what zipfile raises for a file that is no archive, or a damaged one.
    """
    check_regular(path)
    with zipfile.ZipFile(path) as archive:
        files = archive.infolist()
    # unpacking ends at the sizes that the archive declares: they can be relied on
    if len(files) > MOST_FILES:
        raise UnreadableError(f"has {len(files)} files inside, expected at most {MOST_FILES}")
    content = sum(file.file_size for file in files)
    if content > LARGEST_CONTENT:
        raise UnreadableError(
            f"has {content / 1e6:.0f} MB inside, expected at most {LARGEST_CONTENT / 1e6:.0f} MB"
        )
    for file in files:
        if file.filename.startswith("/") or ".." in file.filename.split("/"):
            raise UnreadableError(f"{file.filename!r} would be unpacked outside of its folder")
        if file.filename.endswith((".xml", ".ssd", ".ssv")) and file.file_size > LARGEST_XML:
            raise UnreadableError(
                f"{file.filename} has {file.file_size / 1e6:.0f} MB, expected at most "
                f"{LARGEST_XML / 1e6:.0f} MB"
            )


def check_library(path: Path) -> None:
    """Refuse a shared object (ELF, 64 bit) that is cut off: the process would die where it is used.

    Raises
    ------
    UnreadableError
    """
    with path.open("rb") as file:
        header = file.read(64)
        if header[:6] != b"\x7fELF\x02\x01" or len(header) < 64:
            return  # of another kind: the loader says what is wrong
        table = struct.unpack_from("<Q", header, 32)[0]
        entry_size, count = struct.unpack_from("<HH", header, 54)
        file.seek(table)
        entries = file.read(entry_size * count)
    size = path.stat().st_size
    for at in range(0, len(entries) - 39, max(entry_size, 40)):
        kind, _, offset, _, _, length = struct.unpack_from("<IIQQQQ", entries, at)
        if kind == 1 and offset + length > size:
            raise UnreadableError(f"is cut off: {size} bytes, {offset + length} are loaded")
    if len(entries) < entry_size * count:
        raise UnreadableError(f"is cut off: {size} bytes")


def write_csv(path: Path, times: np.ndarray, names: Sequence[str], values: np.ndarray) -> None:
    """Write trajectories in the layout of the FMI cross-check, 17 significant digits.

    The file appears complete or not at all.

    Parameters
    ----------
    path : Path
        Its folder exists.
    times : ndarray, shape (rows,)
        s.
    names : sequence of str
        One name per column of `values`.
    values : ndarray, shape (rows, len(names))
        In the variables' units.
    """
    header = ",".join(f'"{name}"' for name in ("time", *names))
    with whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        table = np.column_stack((times, values))
        np.savetxt(file, table, fmt="%.17g", delimiter=",", header=header, comments="")


def read_csv(
    path: Path, failure: Callable[[str, int | None], Exception]
) -> tuple[tuple[str, ...], np.ndarray]:
    """Read trajectories as `write_csv` writes them, with the names of all columns.

    Parameters
    ----------
    path : Path
    failure : callable
        What to raise, from what is wrong with the file and the number of the line, if there is one.

    Returns
    -------
    names : tuple of str
        Of all columns, the first of which should be the time.
    table : ndarray, shape (rows, len(names))
        At least one row; finite.
    """
    try:
        text = read_text(path, LARGEST_TABLE)
    except UnreadableError as error:
        raise failure(str(error), None) from None
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
        _numbers(row.split(","), len(names), line, failure)
        for line, row in enumerate(lines[1:], start=2)
    ]
    if not rows:
        raise failure("has no values", 1)
    return names, np.array(rows)


def _numbers(
    row: list[str], columns: int, line: int, failure: Callable[[str, int | None], Exception]
) -> list[float]:
    if len(row) != columns:
        raise failure(f"expected {columns} values, found {len(row)}", line)
    try:
        values = [float(literal) for literal in row]
    except ValueError as error:
        raise failure(f"expected numbers, {error}", line) from None
    if not all(map(math.isfinite, values)):
        raise failure("expected finite numbers", line)
    return values
