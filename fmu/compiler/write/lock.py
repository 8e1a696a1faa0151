"""Value references of a model's variables, which stay while its file changes.

NAME.lock.toml beside the file has a table for each kind, and in it a line for each variable that
ever was: its name and its value reference. It grows and never changes.
"""

import re
import tomllib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from ..read.content import ModelFileError
from ..read.file import INSTANCE

Key = tuple[str, str]  # name and kind of a variable
RESERVED = (0, *range(80, 100))  # the time, the variables of the integrator
LARGEST = 99_999
# longer than in a file: der_ and others stand in front
INDEXES = r"(\[[0-9]+(,[0-9]+)*\])"
# of gradients, x[2]_by_left.k[3], too
ELEMENT = re.compile(
    rf"[A-Za-z]\w*(\.\w+)*({INDEXES}|{INDEXES}?(_by_\w+(\.\w+)*{INDEXES}?)+)?", re.ASCII
)
BARE = re.compile(r"\w+", re.ASCII)  # names that stand without quotes
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


def of_instance() -> dict[Key, int]:
    """Return references of the variables that models have without declaring them."""
    return _read(INSTANCE / "variables.lock.toml", reserved=())


def text(name: str, found: dict[Key, int]) -> str:
    """Return the text of the lock file."""
    kinds: dict[str, list[str]] = {}
    for (variable, kind), reference in sorted(found.items(), key=lambda item: item[1]):
        kinds.setdefault(kind, []).append(f"{_key(variable)} = {reference}\n")
    tables = [f"[{_key(kind)}]\n{''.join(lines)}" for kind, lines in kinds.items()]
    return "\n".join([HEAD.format(name=name), *tables])


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else f'"{name}"'


def _read(path: Path, reserved: Collection[int] = RESERVED) -> dict[Key, int]:
    try:
        found: dict[Key, int] = {}
        for name, kind, reference in _entries(tomllib.loads(path.read_text(encoding="utf-8"))):
            _check(name, kind, reference, reserved)
            if (name, kind) in found or reference in found.values():
                raise ValueError(f"{name} or reference {reference} is there twice")
            found[name, kind] = reference
    except (OSError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise ModelFileError(
            f"{path}: is no lock file: {reason:.200}; restore it, or delete it if nobody uses the "
            "FMU's value references"
        ) from None
    return found


def _entries(content: dict[str, Any]) -> Iterator[tuple[Any, Any, Any]]:
    """Yield name, kind and reference of each variable, as written, or as a list: the older form."""
    if "variables" not in content:
        for kind, references in content.items():
            if not isinstance(references, dict):
                raise ValueError(f"expected tables of value references, but {kind} is none")
            yield from ((name, kind, reference) for name, reference in references.items())
        return
    entries = content.pop("variables")
    if content or not isinstance(entries, list):
        raise ValueError("expected [[variables]] and nothing else")
    for entry in entries:
        if not isinstance(entry, dict) or entry.keys() != {"name", "kind", "reference"}:
            raise ValueError(f"{str(entry)[:100]} has no name, kind and free reference")
        yield entry["name"], entry["kind"], entry["reference"]


def _check(name: Any, kind: Any, reference: Any, reserved: Collection[int]) -> None:
    """Raise ValueError where no such variable can be; True would be a number, too."""
    fine = isinstance(name, str) and ELEMENT.fullmatch(name)
    fine = fine and isinstance(kind, str) and kind.isalpha()
    if not (fine and type(reference) is int and 0 < reference <= LARGEST) or reference in reserved:
        entry = f"{name} = {reference} of kind {kind}"
        raise ValueError(f"{entry:.100} has no name, kind and free reference")
