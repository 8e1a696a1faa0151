"""Checks all that a variables.toml and its included files declare, together."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from declaration.files import DeclarationError, files_of, read
from declaration.schema import Experiment, File, Float64, Model, Terminal, Unit, Variable

UNITS = Path(__file__).with_name("units.toml")  # of all models


@dataclass(frozen=True)
class Declaration:
    """All that is declared of a model; its variables are sorted by value reference."""

    path: Path  # of its variables.toml
    model: Model
    experiment: Experiment
    units: dict[str, Unit]
    variables: dict[str, Variable]
    terminals: dict[str, Terminal]

    @property
    def guid(self) -> str:
        """Hash of the interface: of all but texts, C names, terminals and experiment."""
        return self.token()

    def token(self, *versions: str) -> str:
        """Hash of the interface in the form of a GUID, other than `guid` if versions are named."""
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


def assemble(path: Path, file: File) -> Declaration:
    """All that a file, which is or could be at this path, declares with what it includes."""
    units = dict(read(UNITS).units)
    variables: dict[str, Variable] = {}
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
    used = {v.unit: units[v.unit] for v in variables.values() if isinstance(v, Float64)}
    return Declaration(path, file.model, file.experiment, used, dict(by_reference), file.terminals)


def check_references(variables: dict[str, Variable], places: dict[str, str]) -> None:
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
    variables: dict[str, Variable], units: dict[str, Unit], places: dict[str, str]
) -> None:
    """Check that units and variables that are referred to are declared."""
    for name, variable in variables.items():
        if isinstance(variable, Float64) and variable.unit not in units:
            where = f"neither in {UNITS.name} nor among [units]"
            raise DeclarationError(f"{places[name]}: unit '{variable.unit}' is {where}")
        listed = [
            *(variable.dependencies or []),
            *variable.parameters,
            *(variable.initially or []),
        ]
        listed += [variable.derivative_of] if variable.derivative_of is not None else []
        for other in listed:
            if other not in variables:
                raise DeclarationError(f"{places[name]}: '{other}' is not declared")


def check_dependencies(variables: dict[str, Variable], places: dict[str, str]) -> None:
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


def check_indicators(names: list[str], variables: dict[str, Variable], place: str) -> None:
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
    terminals: dict[str, Terminal], variables: dict[str, Variable], place: str
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
