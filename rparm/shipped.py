"""The built files of an installed package, assembled or unpacked on first use.

It has the bytes of FMUs and systems in pieces, each once: FMUs share most of their sources, and
systems contain FMUs. The files keep every byte of the release.

share/pieces         contents of files in archives, as they are compressed there
share/files.json.xz  "files": by VERSION OF FMI/NAME its SHA-256 and the numbers of its pieces;
                     "places": the first byte of each piece, in `pieces` if negative (~first),
                     else in "between", and its length
share/loop           the library that steps FMUs, for each platform
share/built.tar.xz   all else that is built for each platform (fmu/built.py)
"""

import functools
import hashlib
import io
import json
import lzma
from pathlib import Path, PurePosixPath

from rparm.errors import UserError, reason
from rparm.files import whole

SHARE = Path(__file__).resolve().parent / "share"
PIECES = SHARE / "pieces"
FILES = SHARE / "files.json.xz"
BUILT = SHARE / "built.tar.xz"


def names() -> list[str]:
    """Return all files, as VERSION OF FMI/NAME."""
    return list(_listed()["files"])


def file(name: str, cache: Path) -> Path:
    """Return a file of the release in `cache`; UserError if it cannot be written or is damaged."""
    entry = _listed()["files"][name]
    path = cache / entry["sha256"][:16] / PurePosixPath(name).name
    try:
        if path.is_file() and _digest(path.read_bytes()) == entry["sha256"]:
            return path
    except OSError:
        pass  # writing it says what is wrong
    content = _joined(entry["pieces"])
    if _digest(content) != entry["sha256"]:
        raise UserError(f"{PIECES}: damaged, install rparm again")
    _write(path, content)
    return path


@functools.cache
def unpacked(archive: Path, cache: Path) -> Path:
    """Unpack an archive into a folder below `cache`; UserError if it cannot be written."""
    import tarfile  # takes long

    try:
        content = archive.read_bytes()
        folder = cache / _digest(content)[:16]
        with tarfile.TarFile(fileobj=io.BytesIO(lzma.decompress(content))) as opened:
            for entry in opened:
                file = opened.extractfile(entry)
                assert file is not None  # the archive has no folders
                _write(folder / entry.name, file.read())
    except (OSError, lzma.LZMAError, tarfile.TarError) as error:
        raise UserError(f"{archive}: damaged, install rparm again: {reason(error)}") from error
    return folder


def _write(path: Path, content: bytes) -> None:
    """Write a file that is not there or has other bytes; UserError if it cannot be written."""
    try:
        if path.is_file() and path.read_bytes() == content:
            return
    except OSError:
        pass  # writing it says what is wrong
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as temporary:
            temporary.write_bytes(content)
    except OSError as error:
        text = f"{reason(error)}; RPARM_CACHE names another folder"
        raise UserError(f"{path}: cannot be written: {text}") from error


@functools.cache
def _listed() -> dict:
    try:
        return json.loads(lzma.decompress(FILES.read_bytes()))
    except (OSError, lzma.LZMAError, ValueError) as error:
        raise UserError(f"{FILES}: damaged, install rparm again: {error}") from error


def _joined(pieces: list[int]) -> bytes:
    content, between = bytearray(), bytes.fromhex(_listed()["between"])
    try:
        with PIECES.open("rb") as stored:
            for first, length in map(_listed()["places"].__getitem__, pieces):
                stored.seek(~min(first, -1))
                content += stored.read(length) if first < 0 else between[first : first + length]
    except OSError as error:
        raise UserError(f"{PIECES}: cannot be read: {reason(error)}") from error
    return bytes(content)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
