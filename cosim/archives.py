"""FMUs and SSPs as zip archives: refused before they fill the disk or crash the process."""

import struct
import zipfile
from pathlib import Path

from cosim.input_files import UnreadableError, check_regular

LARGEST_CONTENT = 2**30  # bytes of all files in an archive
LARGEST_XML = 64_000_000  # bytes; parsed it takes some twenty times as much memory
MOST_FILES = 10_000  # in an archive


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
    """Refuse a shared object (ELF, 64 bit) that is cut off: using it would kill the process.

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
