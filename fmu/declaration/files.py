"""Reads a variables.toml and what it includes: one file after the other, each checked by itself."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from program import WrongInputError
from pydantic import ValidationError

from declaration.schema import (
    TYPES,
    Change,
    Experiment,
    File,
    Include,
    Item,
    Model,
    Table,
    Terminal,
    Unit,
    Variable,
)

LONGEST_SHOWN = 60  # characters of a value in a message


class DeclarationError(WrongInputError):
    """A variables.toml that cannot be used: file, place and reason in one line."""


def files_of(
    path: Path, file: File, including: tuple[Path, ...] = ()
) -> Iterator[tuple[Path, File]]:
    """What a file, included by others, includes and changes, and the file itself at the end."""
    if path.resolve() in including:
        raise DeclarationError(f"{path}: includes itself")
    left = dict(file.changes)
    for include in file.include:
        included = path.parent / include.file
        for source, other in files_of(included, read(included), (*including, path.resolve())):
            taken = {
                name: changed(variable, include, left.pop(name, Change()), f"{path}: change {name}")
                for name, variable in other.variables.items()
                if include.only is None or name in include.only
            }
            yield source, other.model_copy(update={"variables": taken})
    for name in left:
        raise DeclarationError(f"{path}: change {name}: is not included")
    yield path, file


def changed(variable: Variable, include: Include, change: Change, place: str) -> Variable:
    """A variable of an included file as the including one has it."""
    keys = variable.model_dump(by_alias=True, exclude_unset=True)
    for old, new in include.fields.items():
        if variable.owner == "model" and variable.field.startswith(old):
            keys["field"] = new + variable.field.removeprefix(old)
            break
    keys["description"] = include.description.replace("{}", variable.description)
    keys |= change.model_dump(exclude_unset=True, exclude={"more_dependencies", "more_parameters"})
    if change.more_dependencies:
        keys["dependencies"] = [*(variable.dependencies or []), *change.more_dependencies]
    if change.more_parameters:
        keys["parameters"] = [*variable.parameters, *change.more_parameters]
    try:
        return type(variable).model_validate(keys)
    except ValidationError as error:
        mistake = error.errors(include_url=False)[0]
        key = ".".join(str(word) for word in mistake["loc"])
        raise DeclarationError(f"{place}: {reason(mistake, type(variable), key)}") from None


def read(path: Path) -> File:
    """Read one file and check each of its tables."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # of the parser, and of reading as UTF-8
        raise DeclarationError(f"{path}: is not valid TOML: {error}") from None
    return check(path, document)


def check(path: Path, document: dict[str, Any]) -> File:
    """Check each table of a file, which is or could be at this path."""
    try:
        return File.model_validate(document)
    except ValidationError as error:
        raise DeclarationError(f"{path}: {first_mistake(error)}") from None


def first_mistake(error: ValidationError) -> str:
    """Place and reason of one mistake; a misspelt key comes before what is then missing."""
    mistakes = error.errors(include_url=False)
    mistake = min(mistakes, key=lambda m: m["type"] != "extra_forbidden")
    words, table, key = place_of(list(mistake["loc"]))
    return ": ".join([*words, reason(mistake, table, key)])


def place_of(location: list[str | int]) -> tuple[list[str], type[Table], str]:
    """Words for a table of the file, its class, and the path of the value within it."""
    match location:
        case ["model", *keys]:
            words, table = ["[model]"], Model
        case ["experiment", *keys]:
            words, table = ["[experiment]"], Experiment
        case ["include", number, *keys]:
            words, table = [f"include[{number}]"], Include
        case ["changes", name, *keys]:
            words, table = [f"change {name}"], Change
        case ["units", name, *keys]:
            words, table = [f"unit {name}"], Unit
        case ["variables", name, kind, "items", item, *keys] if kind in TYPES:
            words, table = [f"variable {name}", f"item {item}"], Item
        case ["variables", name, kind, *keys] if kind in TYPES:
            words, table = [f"variable {name}"], TYPES[kind]
        case ["variables", name, *keys]:
            words, table = [f"variable {name}"], Variable
        case ["terminals", name, *keys]:
            while len(keys) > 1 and keys[0] == "terminals":
                name, keys = f"{name}.{keys[1]}", keys[2:]
            words, table = [f"terminal {name}"], Terminal
        case keys:
            words, table = [], File
    path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys)
    return words, table, path.removeprefix(".")


def reason(mistake: Any, table: type[Table], key: str) -> str:
    """Say why the value of a key is wrong, or why the table is, if `key` is empty."""
    context = mistake.get("ctx", {})
    subject = f"{key} = {shown(mistake['input'])} " if key else ""
    match mistake["type"]:
        case "missing":
            return f"{key} is missing"
        case "extra_forbidden":
            for kind, of_kind in TYPES.items():
                if table is of_kind and any(key in keys_of(other) for other in TYPES.values()):
                    return f"{kind} variables have no {key}"
            return f"unknown key '{key}', expected one of {', '.join(keys_of(table))}"
        case "model_type" | "dict_type":
            return f"{subject}is not a table"
        case "union_tag_invalid":
            return f"type = {shown(context['tag'])} should be one of {', '.join(TYPES)}"
        case "value_error":
            subject = "the name " if mistake["loc"][-1] == "[key]" else subject
            return f"{subject}{context['error']}"
    return subject + mistake["msg"].removeprefix("Input ")


def keys_of(table: type[Table]) -> list[str]:
    return [field.alias or name for name, field in table.model_fields.items()]


def shown(value: object) -> str:
    """Short form of a value; an integer may have more digits than Python writes."""
    try:
        text = repr(value)
    except ValueError:
        return "a very large number"
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."
