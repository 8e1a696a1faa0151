"""Reads a variables.toml and what it includes, file by file, and checks all of it together."""

import hashlib
import json
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compiler.units import DISPLAYED, STANDARD, parsed
from program import WrongInputError
from pydantic import ValidationError

from declaration import schema

LONGEST_SHOWN = 60  # characters of a value in a message


class DeclarationError(WrongInputError):
    """A variables.toml that cannot be used: file, place and reason in one line."""


def files_of(
    path: Path, file: schema.File, including: tuple[Path, ...] = ()
) -> Iterator[tuple[Path, schema.File]]:
    """Yield the files that a file includes, with their changes, and the file itself at the end."""
    if path.resolve() in including:
        raise DeclarationError(f"{path}: includes itself")
    left = dict(file.changes)
    for include in file.include:
        included = path.parent / include.file
        for source, other in files_of(included, read(included), (*including, path.resolve())):
            taken = {
                name: changed(
                    variable, include, left.pop(name, schema.Change()), f"{path}: change {name}"
                )
                for name, variable in other.variables.items()
                if include.only is None or name in include.only
            }
            yield source, other.model_copy(update={"variables": taken})
    for name in left:
        raise DeclarationError(f"{path}: change {name}: is not included")
    yield path, file


def changed(
    variable: schema.Variable, include: schema.Include, change: schema.Change, place: str
) -> schema.Variable:
    """Return a variable of an included file as the including one has it."""
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


def read(path: Path) -> schema.File:
    """Read one file and check each of its tables."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DeclarationError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # of the parser, and of reading as UTF-8
        raise DeclarationError(f"{path}: is not valid TOML: {error}") from None
    return check(path, document)


def check(path: Path, document: dict[str, Any]) -> schema.File:
    """Check each table of a file, which is or could be at this path."""
    try:
        return schema.File.model_validate(document)
    except ValidationError as error:
        raise DeclarationError(f"{path}: {first_mistake(error)}") from None


def first_mistake(error: ValidationError) -> str:
    """Explain one mistake; a misspelt key comes before the one that is then missing."""
    mistakes = error.errors(include_url=False)
    mistake = min(mistakes, key=lambda m: m["type"] != "extra_forbidden")
    words, table, key = place_of(list(mistake["loc"]))
    return ": ".join([*words, reason(mistake, table, key)])


def place_of(location: list[str | int]) -> tuple[list[str], type[schema.TomlTable], str]:
    """Return words for a table of the file, its class, and the path of the value within it."""
    match location:
        case ["model", *keys]:
            words, table = ["[model]"], schema.Model
        case ["experiment", *keys]:
            words, table = ["[experiment]"], schema.Experiment
        case ["include", number, *keys]:
            words, table = [f"include[{number}]"], schema.Include
        case ["changes", name, *keys]:
            words, table = [f"change {name}"], schema.Change
        case ["units", name, *keys]:
            words, table = [f"unit {name}"], schema.UnitEntry
        case ["variables", name, kind, "items", item, *keys] if kind in schema.TYPES:
            words, table = [f"variable {name}", f"item {item}"], schema.Item
        case ["variables", name, kind, *keys] if kind in schema.TYPES:
            words, table = [f"variable {name}"], schema.TYPES[kind]
        case ["variables", name, *keys]:
            words, table = [f"variable {name}"], schema.Variable
        case ["terminals", name, *keys]:
            while len(keys) > 1 and keys[0] == "terminals":
                name, keys = f"{name}.{keys[1]}", keys[2:]
            words, table = [f"terminal {name}"], schema.Terminal
        case keys:
            words, table = [], schema.File
    path = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys)
    return words, table, path.removeprefix(".")


def reason(mistake: Any, table: type[schema.TomlTable], key: str) -> str:
    """Say why the value of a key is wrong, or why the table is, if `key` is empty."""
    context = mistake.get("ctx", {})
    subject = f"{key} = {shown(mistake['input'])} " if key else ""
    match mistake["type"]:
        case "missing":
            return f"{key} is missing"
        case "extra_forbidden":
            for kind, of_kind in schema.TYPES.items():
                if table is of_kind and any(
                    key in keys_of(other) for other in schema.TYPES.values()
                ):
                    return f"{kind} variables have no {key}"
            return f"unknown key '{key}', expected one of {', '.join(keys_of(table))}"
        case "model_type" | "dict_type":
            return f"{subject}is not a table"
        case "union_tag_invalid":
            return f"type = {shown(context['tag'])} should be one of {', '.join(schema.TYPES)}"
        case "value_error":
            subject = "the name " if mistake["loc"][-1] == "[key]" else subject
            return f"{subject}{context['error']}"
    return subject + mistake["msg"].removeprefix("Input ")


def keys_of(table: type[schema.TomlTable]) -> list[str]:
    return [field.alias or name for name, field in table.model_fields.items()]


def shown(value: object) -> str:
    """Write a value in short; an integer may have more digits than Python writes."""
    try:
        text = repr(value)
    except ValueError:
        return "a very large number"
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


@dataclass(frozen=True)
class Declaration:
    """All that is declared of a model; its variables are sorted by value reference."""

    path: Path  # of its variables.toml
    model: schema.Model
    experiment: schema.Experiment
    units: dict[str, schema.UnitEntry]
    variables: dict[str, schema.Variable]
    terminals: dict[str, schema.Terminal]

    @property
    def guid(self) -> str:
        """Hash of the interface: of all but texts, C names, terminals and experiment."""
        return self.token()

    def token(self, *versions: str) -> str:
        """Hash the interface in the form of a GUID, other than `guid` if versions are named."""
        interface = {
            "model": self.model.name,
            "units": {name: unit.model_dump() for name, unit in self.units.items()},
            "variables": {name: v.interface for name, v in self.variables.items()},
        }
        if self.model.event_indicators:
            interface["event_indicators"] = self.model.event_indicators
        if self.model.time_events:
            interface["time_events"] = True
        text = json.dumps(interface, sort_keys=True) + "".join(versions)
        digest = hashlib.sha256(text.encode()).hexdigest()
        parts = (digest[0:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])
        return "{" + "-".join(parts) + "}"


def load(path: Path) -> Declaration:
    """Read variables.toml and what it includes; DeclarationError if something in them is wrong."""
    return assemble(path, read(path))


def assemble(path: Path, file: schema.File) -> Declaration:
    """Read all that a file, which is or could be at this path, declares with its includes."""
    units = {name: _standard_unit(name) for name in STANDARD}
    variables: dict[str, schema.Variable] = {}
    places: dict[str, str] = {}
    for source, part in files_of(path, file):
        for name, unit in part.units.items():
            if units.setdefault(name, unit) != unit:
                raise DeclarationError(f"{source}: unit {name}: is declared otherwise elsewhere")
        for name, variable in part.variables.items():
            place = f"{source}: variable {name}"
            if name in variables:
                raise DeclarationError(f"{place}: is declared twice")
            variables[name], places[name] = variable, place
    for section in ("model", "experiment", "variables"):
        if not getattr(file, section):
            raise DeclarationError(f"{path}: the section [{section}] is missing")
    check_references(variables, places)
    check_names(variables, units, places)
    check_dependencies(variables, places)
    check_indicators(file.model.event_indicators, variables, f"{path}: [model]")
    check_terminals(file.terminals, variables, f"{path}: terminal ")
    by_reference = sorted(variables.items(), key=lambda item: item[1].reference)
    real = [v for v in variables.values() if isinstance(v, schema.Float64)]
    further: dict[str, dict[str, schema.Display]] = {v.unit: {} for v in real}
    for variable in real:
        if variable.display is not None:
            further[variable.unit][variable.display.name] = variable.display
    used = {
        name: units[name].model_copy(update={"further": displays}) if displays else units[name]
        for name, displays in further.items()
    }
    return Declaration(path, file.model, file.experiment, used, dict(by_reference), file.terminals)


def _standard_unit(name: str) -> schema.UnitEntry:
    shown = {other: float(1 / parsed(other).factor) for other in DISPLAYED.get(name, ())}
    return schema.UnitEntry(**parsed(name).exponents, display=shown)


def check_references(variables: dict[str, schema.Variable], places: dict[str, str]) -> None:
    """Check that value references are unique, and that there is one independent variable."""
    owners: dict[int, str] = {}
    for name, variable in variables.items():
        owner = owners.setdefault(variable.reference, name)
        if owner != name:
            reference = variable.reference
            raise DeclarationError(f"{places[name]}: value reference {reference} is {owner}'s")
    independent = [n for n, v in variables.items() if v.causality == "independent"]
    if len(independent) > 1:
        time, other = independent[:2]
        raise DeclarationError(f"{places[other]}: {time} is the independent variable already")


def check_names(
    variables: dict[str, schema.Variable],
    units: dict[str, schema.UnitEntry],
    places: dict[str, str],
) -> None:
    """Check that units and variables that are referred to are declared."""
    for name, variable in variables.items():
        if isinstance(variable, schema.Float64) and variable.unit not in units:
            where = f"{places[name]}: unit '{variable.unit}'"
            raise DeclarationError(f"{where} is neither a standard one nor among [units]")
        listed = [*(variable.dependencies or []), *variable.parameters, *(variable.initially or [])]
        listed += [variable.derivative_of] if variable.derivative_of is not None else []
        for other in listed:
            if other not in variables:
                raise DeclarationError(f"{places[name]}: '{other}' is not declared")


def check_dependencies(variables: dict[str, schema.Variable], places: dict[str, str]) -> None:
    """Check that variables depend on what the model structure knows, and that events can."""
    states = {v.derivative_of for v in variables.values()}
    for name, variable in variables.items():
        if variable.reinit and name not in states:
            raise DeclarationError(f"{places[name]}: reinit is for states only")
        for other in variable.dependencies or []:
            causality = variables[other].causality
            if causality not in ("input", "independent") and other not in states:
                raise DeclarationError(f"{places[name]}: '{other}' is no input, state or time")
        for other in variable.parameters:
            if variables[other].causality != "parameter":
                raise DeclarationError(f"{places[name]}: '{other}' is not a parameter")


def check_indicators(names: list[str], variables: dict[str, schema.Variable], place: str) -> None:
    """Check that the event indicators are calculated locals that can cross 0."""
    for i, name in enumerate(names):
        where = f"{place}: event_indicators[{i}]"
        variable = variables.get(name)
        if variable is None:
            raise DeclarationError(f"{where}: '{name}' is not declared")
        if name in names[:i]:
            raise DeclarationError(f"{where}: '{name}' is there twice")
        kind = (variable.causality, variable.variability, variable.initial)
        if kind != ("local", "continuous", "calculated"):
            raise DeclarationError(f"{where}: '{name}' is not local, continuous and calculated")
        if variable.dependencies is None:
            raise DeclarationError(f"{where}: dependencies of '{name}' is missing")


def check_terminals(
    terminals: dict[str, schema.Terminal], variables: dict[str, schema.Variable], place: str
) -> None:
    """Check that members are inputs and outputs, and that flows are continuous."""
    for name, terminal in terminals.items():
        for kind, member, variable in terminal.members:
            where = f"{place}{name}: {kind} {member}"
            if variable not in variables:
                raise DeclarationError(f"{where}: '{variable}' is not declared")
            if variables[variable].causality not in ("input", "output"):
                raise DeclarationError(f"{where}: '{variable}' is no input or output")
            if kind != "signal" and variables[variable].variability != "continuous":
                raise DeclarationError(f"{where}: '{variable}' is not continuous")
        check_terminals(terminal.terminals, variables, f"{place}{name}.")
