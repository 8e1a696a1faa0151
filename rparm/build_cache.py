"""A cache of builds: files by a hash of all that they are made from.

An entry is one file: the SHA-256 of what follows, a line of JSON with its key and the names and
sizes of its files, and their bytes. What is damaged or another's is built again. Where the folder
cannot be written, builds do without it.
"""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rparm import fmu_tools, project
from rparm.files import whole
from rparm.fmu_tools.compiler.names import OF_VALUES

LARGEST = 2**30  # bytes of all entries
LARGEST_NAMED = 10**7  # bytes of a file that a model names: a larger one is refused
COMPILERS = ("gcc", "clang", "zig", "as", "ld")
# variables that lead compilers to other files, or change what they write
VARIABLES = ("CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH", "COMPILER_PATH", "GCC_EXEC_PREFIX")
VARIABLES += ("GCC_COMPARE_DEBUG", "SOURCE_DATE_EPOCH", "SDKROOT", "ZIG_LIB_DIR")
Files = Mapping[str, bytes]  # by name, in their order


class BuildCache:
    """The entries in a folder; None: there are none, and none are kept."""

    def __init__(self, folder: Path | None, largest: int = LARGEST) -> None:
        self.folder, self.largest = folder, largest

    def get(self, key: str) -> dict[str, bytes] | None:
        """Return the files of a key, or None."""
        if self.folder is None:
            return None
        path = self.folder / key
        with suppress(OSError, ValueError, KeyError, TypeError):
            if hasattr(os, "geteuid") and path.stat().st_uid not in (0, os.geteuid()):
                return None  # others may have put anything there
            head, _, content = path.read_bytes().partition(b"\n")
            if head.decode() != hashlib.sha256(content).hexdigest():
                return None
            head, _, content = content.partition(b"\n")
            listed = json.loads(head)
            if listed["key"] != key:
                return None
            with suppress(OSError):
                os.utime(path)  # the oldest are removed first
            files, end = {}, 0
            for name, size in listed["files"]:
                files[name] = content[end : end + size]
                end += size
            return files
        return None

    def put(self, key: str, files: Files) -> None:
        """Keep files, and remove the entries that were used least recently if all are too large."""
        if self.folder is None:
            return
        listed = {"key": key, "files": [(name, len(content)) for name, content in files.items()]}
        content = b"".join([json.dumps(listed).encode(), b"\n", *files.values()])
        with suppress(OSError):
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with whole(self.folder / key) as temporary:
                temporary.write_bytes(hashlib.sha256(content).hexdigest().encode())
                with temporary.open("ab") as file:
                    file.write(b"\n" + content)
            self._trim()

    def _trim(self) -> None:
        entries = []
        for entry in os.scandir(self.folder):
            with suppress(OSError):  # another process has removed it
                entries.append((entry.stat().st_mtime_ns, entry.stat().st_size, entry.path))
        left = sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if left <= self.largest:
                break
            with suppress(OSError):
                Path(path).unlink()
            left -= size


def of_user() -> BuildCache:
    """Return the cache in the user's folder, or none if a variable or an option switches it off."""
    return BuildCache(project.builds_folder())


# ---- Keys ----------------------------------------------------------------------------------------
def digest(parts: Iterable[object]) -> str:
    """Return a hash of texts, bytes and other values, in their order."""
    found = hashlib.sha256()
    for part in parts:
        content = (
            part if isinstance(part, bytes) else repr(part).encode("utf-8", "backslashreplace")
        )
        found.update(b"%d:" % len(content) + content)
    return found.hexdigest()


def key(parts: list[object], lock: Path) -> str:
    """Return the key of FMUs by the parts that they are made from, and their lock file."""
    return digest([lock.read_bytes() if lock.is_file() else None, *parts])


def parts_of(
    file: Path, runtimes: list[Path], of_this_machine: bool, packages: Iterable[str]
) -> list[object]:
    """Return what FMUs of a file with equations are made from; nothing if that cannot be read."""
    try:
        return [*_parts(file, runtimes, of_this_machine, packages)]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []  # who builds says what is wrong


def _parts(
    file: Path, runtimes: list[Path], of_this_machine: bool, packages: Iterable[str]
) -> Iterator[object]:
    yield from _texts(file)
    fmu = Path(fmu_tools.__path__[0])
    own = [*fmu.parent.glob("src/instance/*.toml"), *fmu.rglob("*")]
    yield from _files(own, fmu.parent)
    yield from (sys.version, zlib.ZLIB_RUNTIME_VERSION, of_this_machine)
    yield sorted(_packages(packages))
    for path in runtimes:
        yield str(path)
        yield from _runtime(path)


def compilers(first: str) -> Iterator[object]:
    """Yield what the output of compilers depends on: files, variables, the first's version."""
    found = [path for path in map(shutil.which, (first, *COMPILERS)) if path]
    for path in (Path(name).resolve() for name in found):
        yield str(path), path.stat().st_size, path.stat().st_mtime_ns
    yield [os.environ.get(name) for name in VARIABLES]
    for name in found[:1]:  # it may be a script that leads to another one, as of ccache
        yield subprocess.run([name, "--version"], capture_output=True, check=False).stdout


def files_of(file: Path) -> Iterator[tuple[Path, bytes, list[str]]]:
    """Yield a file with equations and all that it leads to: path, content, and names in it."""
    todo, found = [file], {file.resolve()}
    while todo:
        path = todo.pop()
        is_there = path.is_file() and path.stat().st_size <= LARGEST_NAMED
        content = path.read_bytes() if is_there else b""
        names = [*_named(path, content)]
        yield path, content, names
        for other in (path.parent / name for name in names):
            if other.resolve() not in found:
                found.add(other.resolve())
                todo.append(other)


def _texts(file: Path) -> Iterator[object]:
    """Yield a file with equations and all files that it leads to, each with its name."""
    for path, content, names in files_of(file):
        yield os.path.relpath(path, file.parent) if path != file else ""
        yield content if path.is_file() else None
        if path == file and any(name.endswith((".c", ".h")) for name in names):
            yield file.stem  # names in C begin as the file's


def _named(path: Path, content: bytes) -> Iterator[str]:
    """Yield the files that a file names: what it includes, its C, and files of its tables."""
    if path.suffix == ".toml":
        yield from _in_tables(tomllib.loads(content.decode("utf-8-sig")))
    elif path.suffix in (".c", ".h"):
        for name in re.findall(r'^\s*#\s*include\s*"([^"]+)"', content.decode("latin-1"), re.M):
            yield name
            if name.endswith(OF_VALUES):  # made of that file
                yield f"{name.removesuffix(OF_VALUES)}.toml"


def _in_tables(content: Any) -> Iterator[str]:
    if isinstance(content, dict):
        for name, value in content.items():
            if name in ("code", "file") and isinstance(value, str):
                yield value
            if name == "components" and isinstance(value, dict):
                yield from (each for each in value.values() if isinstance(each, str))
            if name in ("include", "sources", "code") and isinstance(value, list):
                yield from (each for each in value if isinstance(each, str))
            yield from _in_tables(value)


def _packages(names: Iterable[str]) -> set[str]:
    """Return names and versions of all packages beside these."""
    specs = [spec for spec in map(find_spec, names) if spec is not None]
    folders = {Path(spec.origin).parents[1] for spec in specs if spec.origin is not None}
    return {path.name for folder in folders for path in folder.glob("*.dist-info")}


def _runtime(path: Path) -> Iterator[object]:
    """Yield all that a runtime.json names: what is linked, and what becomes sources/."""
    content = json.loads(path.read_bytes())
    yield path.read_bytes()
    yield from compilers(content["compiler"][0])
    versions = content["versions"].values()
    listed = [*content["libraries"], *content["licenses"].values()]
    listed += [name for version in versions for name in version["objects"]]
    folders = {*content["include"]}
    for library in (*content["sources"], *(version["sources"] for version in versions)):
        listed += [*library["sources"], library["prelude"]]
        folders |= {*library["include"]}
    found = [path.parent / name for name in listed if name]
    found += [Path(name) for name in content["options"] if name.endswith(".h")]
    for folder in sorted(filter(None, folders)):
        found += (path.parent / folder).rglob("*.h")
    yield from _files(found, path.parent)


def _files(paths: Iterable[Path], folder: Path) -> Iterator[object]:
    for path in sorted({*paths}):
        if path.suffix != ".pyc" and path.is_file():
            yield os.path.relpath(path, folder)
            yield path.read_bytes()
