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
        where the file leaves it to its default, Real.

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
            found[name] = {"type": "Real"} | variable
            origin[name] = path
    return dict(sorted(found.items(), key=lambda item: item[1]["reference"]))


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
