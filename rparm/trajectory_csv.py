"""Trajectories as CSV files in the layout of the FMI cross-check."""

import csv
import lzma
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from rparm.errors import UserError
from rparm.input_files import UnreadableError, decoded, is_file, number_in, read_bytes, read_text
from rparm.output_files import whole

LARGEST = 50_000_000  # bytes; references of the project stay below 1 MB

# Makes the exception to raise, from the mistake and the line number, if known.
Failure = Callable[[str, int | None], Exception]


def failure(path: Path, way_out: str = "") -> Failure:
    """Makes the user's errors of a file; they may end with a way out."""

    def wrong(message: str, line: int | None = None) -> UserError:
        where = f"{path}, line {line}" if line else f"{path}"
        return UserError(f"{where}: {message}{way_out}")

    return wrong


def write(
    path: Path,
    times: np.ndarray,
    names: Sequence[str],
    values: np.ndarray,
    digits: int | None = 17,
    short_times: bool = False,
) -> None:
    """Write trajectories, (rows, names), over times in s; the file appears complete or not at all.

    `digits` are the significant ones; None, and for times `short_times`: as many as are needed to
    read the same number back.
    """
    form = _shortest if digits is None else f"{{:.{digits}g}}".format
    of_time = _shortest if short_times else form
    with whole(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.write(",".join(f'"{name}"' for name in ("time", *names)) + "\n")
        for time, row in zip(
            *(np.asarray(x, float).tolist() for x in (times, values)), strict=True
        ):
            file.write(",".join([of_time(time), *map(form, row)]) + "\n")


def _shortest(value: float) -> str:
    return repr(value).removesuffix(".0")


def read(path: Path, failure: Failure) -> tuple[tuple[str, ...], np.ndarray]:
    """Read trajectories as `write` writes them; those of an installed package are compressed.

    Names of all columns, of which the first is "time", and the table (rows, names): at least one
    row, all finite.
    """
    try:
        text = _text(path)
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
        _numbers(row.split(","), len(names), line, failure)
        for line, row in enumerate(lines[1:], start=2)
    ]
    if not rows:
        raise failure("has no values", 1)
    return names, np.array(rows)


def _text(path: Path) -> str:
    packed = path.with_name(f"{path.name}.xz")
    if is_file(packed) and not is_file(path):
        return decoded(lzma.decompress(read_bytes(packed, LARGEST)))
    return read_text(path, LARGEST)


def _numbers(row: list[str], columns: int, line: int, failure: Failure) -> list[float]:
    if len(row) != columns:
        raise failure(f"expected {columns} values, found {len(row)}", line)
    try:
        values = [number_in(literal) for literal in row]
    except ValueError as error:
        raise failure(f"expected numbers, {error}", line) from None
    if not all(map(math.isfinite, values)):
        raise failure("expected finite numbers", line)
    return values
