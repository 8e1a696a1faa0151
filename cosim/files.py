"""Files that appear complete or not at all, and tables of numbers in them."""

import csv
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Temporary path to write to, which becomes `path` at the end and is removed on failure."""
    path = Path(path)
    # the suffix stays the last: pictures are written in the format that it tells
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


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
        text = Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise failure("no such file", None) from None
    except OSError as error:
        raise failure(f"cannot be read: {error.strerror or error}", None) from error
    except UnicodeDecodeError:
        raise failure("not a text file", None) from None
    if not text:
        raise failure("is empty", None)
    if not text.endswith("\n"):
        raise failure("is cut off in the middle", text.count("\n") + 1)
    lines = csv.reader(text.splitlines())
    names = tuple(next(lines))
    rows = [_numbers(row, len(names), line, failure) for line, row in enumerate(lines, start=2)]
    if not rows:
        raise failure("has no values", 1)
    if names[0] != "time":
        raise failure(f"expected a header whose first column is 'time', found {names[0]!r}", 1)
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
