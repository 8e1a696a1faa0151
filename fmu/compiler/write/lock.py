"""Value references of a model's variables, which stay while its file changes.

NAME.lock.toml beside the file has a line for each variable that ever was: its name, its kind and
its value reference. It grows and never changes.
"""

import re
import tomllib
from pathlib import Path

from ..read.content import ModelFileError
from .declaration import Key

RESERVED = (0, *range(80, 100))  # the time, the variables of the integrator
LARGEST = 99_999
# longer than in a file: der_ and others stand in front
ELEMENT = re.compile(r"[A-Za-z]\w*(\[[0-9]+(,[0-9]+)*\])?", re.ASCII)
HEAD = "# Value references of {name}: written by the build. Keep it with the model.\n"


def path_of(model: Path) -> Path:
    """The lock file of a model's file."""
    return model.with_suffix(".lock.toml")


def references(path: Path, wanted: list[Key]) -> dict[Key, int]:
    """Return references of all variables in the lock file, or wanted; ModelFileError."""
    found = _read(path) if path.exists() else {}
    following = max([0, *found.values()]) + 1
    for key in wanted:
        if key not in found:
            while following in RESERVED:
                following += 1
            found[key] = following
            following += 1
    if following > LARGEST:
        raise ModelFileError(f"{path}: all value references up to {LARGEST} have been used")
    return found


def text(name: str, found: dict[Key, int]) -> str:
    """Return the text of the lock file."""
    lines = [
        f'[[variables]]\nname = "{key[0]}"\nkind = "{key[1]}"\nreference = {reference}\n'
        for key, reference in sorted(found.items(), key=lambda item: item[1])
    ]
    return "\n".join([HEAD.format(name=name), *lines])


def _read(path: Path) -> dict[Key, int]:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = content.pop("variables", [])
        if content or not isinstance(entries, list):
            raise ValueError("expected [[variables]] and nothing else")
        found: dict[Key, int] = {}
        for entry in entries:
            key, reference = _entry(entry)
            if key in found or reference in found.values():
                raise ValueError(f"{key[0]} or reference {reference} is there twice")
            found[key] = reference
    except (OSError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise ModelFileError(
            f"{path}: is no lock file: {reason:.200}; restore it, or delete it if nobody uses the "
            "FMU's value references"
        ) from None
    return found


def _entry(entry: object) -> tuple[Key, int]:
    match entry:
        case {"name": str(name), "kind": str(kind), "reference": int(reference)}:
            fine = len(entry) == 3 and ELEMENT.fullmatch(name) and kind.isalpha()
            if fine and reference not in RESERVED and 0 < reference <= LARGEST:
                return (name, kind), reference
    raise ValueError(f"{str(entry)[:100]} has no name, kind and free reference")
