"""Reads the variable declarations of a model: variables.toml and the files that it includes."""

import tomllib
from pathlib import Path
from typing import Any

from cosim.errors import UserError

FILE_NAME = "variables.toml"


def load(model_folder: Path) -> dict[str, dict[str, Any]]:
    """Read the variables of the model in `model_folder`.

    Returns
    -------
    dict
        The tables ``[variables.*]`` by name, in order of value reference. ``type`` is filled in
        where the file leaves it to its default, Real. The start value of an Enumeration, which the
        file gives by the item's name, is its number, as it is for the FMU; so are min and max.

    Raises
    ------
    UserError
        If a file cannot be read or a variable is declared twice.
    """
    found: dict[str, dict[str, Any]] = {}
    origin: dict[str, Path] = {}
    waiting = [Path(model_folder) / FILE_NAME]
    seen: set[Path] = set()
    while waiting:
        path = waiting.pop(0)
        if path.resolve() in seen:
            continue
        seen.add(path.resolve())
        content = read_toml(path)
        waiting += [path.parent / name for name in content.get("include", [])]
        for name, variable in content.get("variables", {}).items():
            if name in found:
                raise UserError(f"{path}: [variables.{name}] is already in {origin[name]}")
            if not isinstance(variable, dict) or "reference" not in variable:
                raise UserError(f"{path}: [variables.{name}] needs a value reference")
            found[name] = _numbered({"type": "Real"} | variable, f"{path}: [variables.{name}]")
            origin[name] = path
    return dict(sorted(found.items(), key=lambda item: item[1]["reference"]))


def _numbered(variable: dict[str, Any], where: str) -> dict[str, Any]:
    """`variable` with the numbers of an Enumeration: its items count from 1."""
    if variable["type"] != "Enumeration":
        return variable
    items = variable.get("items")
    if not isinstance(items, dict) or not items:
        raise UserError(f"{where}: an Enumeration needs items")
    variable |= {"min": 1, "max": len(items)}
    if "start" in variable:
        if variable["start"] not in items:
            raise UserError(f"{where}: start must be one of {', '.join(items)}")
        variable["start"] = list(items).index(variable["start"]) + 1
    return variable


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file; whatever keeps it from being read becomes a UserError."""
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not UTF-8 text, at byte {error.start}") from None
    except (
        ValueError,
        RecursionError,
    ) as error:  # TOMLDecodeError, and what else the parser lets out
        raise UserError(f"{path}: not valid TOML: {error}") from None
