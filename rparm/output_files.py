"""Files that appear complete or not at all."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

from rparm.errors import UserError, reason
from rparm.interruption import uninterrupted

# what no file can be called on Windows, with any suffix
DEVICES = {"CON", "PRN", "AUX", "NUL", "CONIN$", "CONOUT$"}
DEVICES |= {f"{port}{number}" for port in ("COM", "LPT") for number in "123456789\xb9\xb2\xb3"}


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Temporary path to write to, which becomes `path` at the end and is removed on failure."""
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
    """Write a text; its folder is made, and the file appears complete or not at all.

    What stands for the bytes of a file name that is not UTF-8 is escaped, as JSON does it.
    """
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
    """`path` relative to the current folder if it is inside."""
    try:
        here = Path.cwd()
    except OSError:  # it has been removed
        return path
    return path.relative_to(here) if path.is_relative_to(here) else path


def from_folder(path: Path, folder: Path) -> str:
    """A path relative to a folder; absolute if it is on another drive."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return path.absolute().as_posix()
