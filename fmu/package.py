"""Packs an FMU: a zip archive whose bytes depend only on the contents of its files."""

import argparse
import struct
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

from program import atomic_write, program

FIXED_DATE = (1980, 1, 1, 0, 0, 0)
UNIX = 3

LIBRARY = b"\xcf\xfa\xed\xfe"  # magic of a file for one processor with 64 bits
UNIVERSAL = 0xCAFEBABE  # of one for several
# by the first number of the processor: pages have 2**n bytes
PAGES = {0x01000007: 12, 0x0100000C: 14}  # x86_64, Arm


def collect(entries: list[str]) -> list[tuple[str, Path]]:
    """Archive names and files; an entry is NAME=PATH, a folder stands for all files below it."""
    files: list[tuple[str, Path]] = []
    for entry in entries:
        name, separator, source = entry.partition("=")
        path = Path(source)
        if not (name and separator and path.exists()):
            raise ValueError(f"'{entry}' is not NAME=PATH with an existing file or folder")
        if path.is_dir():
            below = (p for p in path.rglob("*") if p.is_file())
            files += [(f"{name}/{p.relative_to(path).as_posix()}", p) for p in below]
        else:
            files.append((name, path))
    return files


def pack(archive: Path, files: list[tuple[str, Path]]) -> None:
    """Write the archive to a temporary name and rename it; join libraries for macOS of one name."""
    contents: dict[str, list[bytes]] = {}
    for name, path in files:
        contents.setdefault(name, []).append(path.read_bytes())
    archive.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(archive) as temporary, zipfile.ZipFile(temporary, "w") as target:
        for name, parts in sorted(contents.items()):
            info = zipfile.ZipInfo(name, FIXED_DATE)
            info.create_system = UNIX
            # an FMU is compressed already, and can so be shared with the file beside the system
            stored = name.endswith(".fmu")
            info.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
            executable = name.startswith("binaries/")
            info.external_attr = (0o100755 if executable else 0o100644) << 16
            # the level of the archive would not hold for a ZipInfo
            content = parts[0] if len(parts) == 1 else universal(parts)
            target.writestr(info, content, compresslevel=9)


def universal(libraries: Sequence[bytes]) -> bytes:
    """Join libraries for macOS as lipo does; ValueError for others, or two for one processor."""
    parts = {}
    for library in libraries:
        processor, kind = struct.unpack_from("<II", library.ljust(12, b"\0"), 4)
        if not library.startswith(LIBRARY) or processor not in PAGES or processor in parts:
            raise ValueError("only libraries for macOS, each for another processor, can be joined")
        parts[processor] = (kind, library)
    head = struct.pack(">II", UNIVERSAL, len(parts))
    end = len(head) + 20 * len(parts)
    body = b""
    for processor, (kind, library) in sorted(parts.items()):
        page = PAGES[processor]
        gap = -(end + len(body)) % 2**page
        body += bytes(gap) + library
        place = end + len(body) - len(library), len(library), page
        head += struct.pack(">IIIII", processor, kind, *place)
    return head + body


@program(ValueError)
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("archive", type=Path)
    parser.add_argument("entries", nargs="+", metavar="NAME=PATH")
    arguments = parser.parse_args()
    pack(arguments.archive, collect(arguments.entries))


if __name__ == "__main__":
    sys.exit(main())
