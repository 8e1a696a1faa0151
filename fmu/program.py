"""Shared by the programs of this folder: how they end, how they read and write files, and the
origin of an FMU (version, author, license, copyright, date)."""

import functools
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path


class WrongInputError(Exception):
    """A mistake in a file: its name, the place and the reason in one line."""


def program(*expected: type[Exception]) -> Callable[[Callable[[], None]], Callable[[], int]]:
    """Make `main` return 0, or 2 after a line on standard error for a mistake of the user's."""

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
    """Return the text of a file in UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise WrongInputError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise WrongInputError(f"{path}: is not UTF-8: {error}") from None


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path, which becomes `path` at the end, or is removed on failure."""
    temporary = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_if_changed(path: Path, text: str) -> None:
    """Write a file unless it has this text already, so that nothing is rebuilt for it."""
    if not path.is_file() or path.read_bytes() != text.encode():
        with atomic_write(path) as temporary:
            temporary.write_bytes(text.encode())


@dataclass(frozen=True)
class Provenance:
    """Texts for the model description; None is left out of it."""

    version: str = "0.0.0"
    author: str | None = None
    license: str | None = None  # by its SPDX identifier
    copyright: str | None = None
    date: str | None = None  # UTC, ISO 8601


def license_texts(path: Path) -> dict[str, str]:
    """Return author, license and copyright from a file with "NAME License" and "Copyright (c)"."""
    text = read_text(path)
    title = re.match(r"(.+) License\n", text)
    notice = re.search(r"^Copyright \(c\) [-\d]+, (.+)$", text, re.MULTILINE)
    if not title or not notice:
        raise WrongInputError(f"{path}: lacks 'NAME License' or 'Copyright (c) YEAR, AUTHOR'")
    return {"license": title[1].replace(" ", "-"), "copyright": notice[0], "author": notice[1]}


def build_date(environment: Mapping[str, str]) -> str | None:
    """Return the date by SOURCE_DATE_EPOCH, None without it: equal sources give equal bytes."""
    epoch = environment.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return None
    try:
        return datetime.fromtimestamp(int(epoch), UTC).isoformat()
    except (ValueError, OverflowError, OSError):
        raise WrongInputError(f"SOURCE_DATE_EPOCH = {epoch!r:.40} is not a time in s") from None
