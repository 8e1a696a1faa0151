"""Reads the variable declarations of a model: variables.toml and the files that it includes."""

import re
import tomllib
from pathlib import Path
from typing import Any

from cosim.errors import UserError
from cosim.files import UnreadableError, read_text

FILE_NAME = "variables.toml"
LARGEST_FILE = 10_000_000  # bytes: some seconds of parsing
TYPE_NAMES = {"float64": "Real", "int32": "Integer", "enumeration": "Enumeration"}  # of FMI 2.0
# the parser's time grows with the square of a key's parts: a.b.c
LONG_KEY = re.compile(r"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){32}""")


def load(model_folder: Path) -> dict[str, dict[str, Any]]:
    """Read the variables of the model in `model_folder`.

    Returns
    -------
    dict
        The tables ``[variables.*]`` by name, in order of value reference. ``type`` is its name
        in FMI 2.0, Real where the file gives none. The start value of an Enumeration, which the
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
        includes, declared = content.get("include", []), content.get("variables", {})
        if not isinstance(includes, list) or not all(
            isinstance(name, str) and "\0" not in name for name in includes
        ):
            raise UserError(f"{path}: include: expected a list of files")
        if not isinstance(declared, dict):
            raise UserError(f"{path}: variables: expected tables [variables.NAME]")
        waiting += [path.parent / name for name in includes]
        for name, variable in declared.items():
            if name in found:
                raise UserError(f"{path}: [variables.{name}] is already in {origin[name]}")
            if not isinstance(variable, dict) or "reference" not in variable:
                raise UserError(f"{path}: [variables.{name}] needs a value reference")
            _check_types(variable, f"{path}: [variables.{name}]")
            kind = variable.get("type", "float64")
            typed = variable | {"type": TYPE_NAMES.get(kind, kind)}
            found[name] = _numbered(typed, f"{path}: [variables.{name}]")
            origin[name] = path
    return dict(sorted(found.items(), key=lambda item: item[1]["reference"]))


def _check_types(variable: dict[str, Any], where: str) -> None:
    """Check the keys that are used here; fmu/declaration checks all of them."""
    for key, kind, name in (
        ("reference", int, "a whole number"),
        ("type", str, "a text"),
        ("causality", str, "a text"),
        ("initial", str, "a text"),
        ("unit", str, "a text"),
        ("min", int | float, "a number"),
        ("max", int | float, "a number"),
    ):
        value = variable.get(key)
        if key in variable and (isinstance(value, bool) or not isinstance(value, kind)):
            raise UserError(f"{where}: {key}: expected {name}, got {show(value)}")


def show(value: Any) -> str:
    """Short, one-line form of a value from a TOML file."""
    try:
        text = str(value).lower() if isinstance(value, bool) else repr(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a very large number"
    return text if len(text) <= 40 else f"{text[:37]}..."


def _numbered(variable: dict[str, Any], where: str) -> dict[str, Any]:
    """`variable` with the numbers of an Enumeration: its items count from 1."""
    if variable["type"] != "Enumeration":
        return variable
    items = variable.get("items")
    if not isinstance(items, dict) or not items:
        raise UserError(f"{where}: an Enumeration needs items")
    variable |= {"min": 1, "max": len(items)}
    if "start" in variable:
        if not isinstance(variable["start"], str) or variable["start"] not in items:
            raise UserError(f"{where}: start must be one of {', '.join(items)}")
        variable["start"] = list(items).index(variable["start"]) + 1
    return variable


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file; whatever keeps it from being read becomes a UserError."""
    try:
        text = read_text(path, LARGEST_FILE)
        long = LONG_KEY.search(text)
        if long:
            line = text.count("\n", 0, long.start()) + 1
            raise UserError(f"{path}, line {line}: a key of more than 32 parts")
        return tomllib.loads(text)
    except UnreadableError as error:
        raise UserError(f"{path}: {error}") from None
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not UTF-8 text, at byte {error.start}") from None
    except (
        ValueError,
        RecursionError,
    ) as error:  # TOMLDecodeError, and what else the parser lets out
        raise UserError(f"{path}: not valid TOML: {error}") from None
