"""The tables of a file with equations, with those of the files that it includes.

An included file comes first: its entries are there, unless an entry of the same name replaces keys
of it. Name, description, experiment and sizes of the including file hold; paths in a file begin at
its own folder.
"""

import os
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .content import (
    ModelFileError,
    placed,
    shown,
)

LARGEST = 10**6  # bytes
MOST_LEVELS = 20
HEADS = ("name", "description", "include")  # what an included file does not give
INCLUDED = re.compile(r'[^\x00-\x1f\\"]+\.toml')


@dataclass(frozen=True)
class Source:
    """A file and those that it includes; its tables have what they give."""

    path: Path
    text: str
    tables: dict[str, Any]
    included: tuple["Source", ...]

    def all(self) -> Iterator["Source"]:
        """Yield the included files, each before those that include it, and this one."""
        for source in self.included:
            yield from source.all()
        yield self


def source_of(path: Path, above: tuple[Path, ...] = ()) -> Source:
    """Read a file and what it includes; ModelFileError."""
    text, own = tables_of(path)
    names = own.get("include", [])
    with placed("include"):
        if not isinstance(names, list) or not all(_is_file(name) for name in names):
            raise ModelFileError(f'expected a list such as ["arm.toml"], got {shown(names)}')
        if path.resolve() in above or len(above) > MOST_LEVELS:
            raise ModelFileError(f"{path.name} includes itself")
    included = []
    for name in names:
        with placed("include", name):
            included.append(source_of(path.parent / name, (*above, path.resolve())))
    tables: dict[str, Any] = {}
    for source in included:
        folder = Path(os.path.relpath(source.path.parent, path.parent))
        given = {key: value for key, value in source.tables.items() if key not in HEADS}
        tables = _merged(tables, moved(given, folder))
    return Source(path, text, _merged(tables, own), tuple(included))


def _is_file(name: object) -> bool:
    return isinstance(name, str) and INCLUDED.fullmatch(name) is not None


def tables_of(path: Path) -> tuple[str, dict[str, Any]]:
    """Read text and tables of a file."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"cannot be read: {error.strerror}") from None
    if len(content) > LARGEST:
        raise ModelFileError(f"has {len(content)} bytes, expected at most {LARGEST}")
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
        return text, tomllib.loads(text)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ModelFileError(f"line {line}: is not UTF-8: save it in this encoding") from None
    except tomllib.TOMLDecodeError as error:
        bare = re.search(r"(?m)^\s*(\w+\[[^]\n]+\])\s*=", text)
        hint = f'; write "{bare[1]}" in quotes' if bare else ""
        text = f"is not valid TOML: {' '.join(str(error).split()):.200}{hint}"
        raise ModelFileError(text) from None
    except (ValueError, RecursionError):
        raise ModelFileError("has a number or a table that is too long") from None


def _merged(below: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Put tables over others: entries of the same name replace keys, all else is added."""
    found = dict(below)
    for key, value in own.items():
        given = found.get(key)
        both = isinstance(given, dict) and isinstance(value, dict)
        found[key] = _merged(given, value) if both else value
    return found


def moved(tables: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return tables whose paths begin at another folder, from which `folder` leads to theirs."""
    found = dict(tables)
    code = found.get("code")
    if isinstance(code, str):
        found["code"] = (folder / code).as_posix()
    elif isinstance(code, list) and all(isinstance(name, str) for name in code):
        found["code"] = [(folder / name).as_posix() for name in code]
    if isinstance(data := found.get("tables"), dict):
        found["tables"] = {
            name: entry | {"file": (folder / entry["file"]).as_posix()}
            if isinstance(entry, dict) and isinstance(entry.get("file"), str)
            else entry
            for name, entry in data.items()
        }
    return found
