"""Collects scenarios for an FMU: what goes into extra/org.fmi-standard.fmi-ls-ref.

For each scenario a folder with its inputs, reference and options in the format of the FMI
cross-check, and its parameters as a parameter set of SSP; beside them fmi-ls-manifest.xml, which
says what each file is (FMI Layered Standard References 1.0.0-alpha.1).
"""

import argparse
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from declaration.load import Declaration, load
from declaration.schema import Boolean, Enumeration, Float64, Variable
from description_parts import filled
from program import WrongInputError, atomic_write, program

MANIFEST = "fmi-ls-manifest.xml"
PARAMETERS = "parameters.ssv"

# of a scenario, by the ending of their names: role, type and what they are
FILES = {
    "_in.csv": ("other", "text/csv", "Inputs, each held until the next row"),
    "_ref.csv": ("result", "text/csv", "Reference: outputs at the end of each step"),
    "_ref.opt": ("configuration", "text/csv", "Start, stop and step in s, relative tolerance"),
    PARAMETERS: ("parameter", "application/x-ssp-parameter-set", "Parameters and initial values"),
}


@dataclass(frozen=True)
class Scenario:
    """What a parameter set and the manifest need of a scenario."""

    name: str
    path: Path
    title: str
    values: dict[str, Any]  # parameters and initial values as they stand in the file


def content_of(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise WrongInputError(f"{path}: cannot be read: {error.strerror}") from None


def read(path: Path) -> Scenario:
    """Read a scenario; the command line that runs it checks the rest."""
    content = content_of(path)
    try:
        keys = tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:  # of the parser, and of reading as UTF-8
        raise WrongInputError(f"{path}: is not valid TOML: {error}") from None
    title, parameters, initial = (keys.get(k, {}) for k in ("title", "parameters", "initial"))
    if not isinstance(title, str):
        raise WrongInputError(f"{path}: title is missing or not a text")
    if not isinstance(parameters, dict) or not isinstance(initial, dict):
        raise WrongInputError(f"{path}: parameters and initial must be tables")
    return Scenario(path.stem, path, title, parameters | initial)


def parameter_set(scenario: Scenario, declaration: Declaration) -> str:
    """Text of the .ssv (SSP 1.0) with the values that are not the start values of the FMU."""
    values, units = {}, set()
    for name, value in scenario.values.items():
        variable = declaration.variables.get(name)
        if variable is None:
            raise WrongInputError(f"{scenario.path}: '{name}' is not declared")
        values[name] = typed(variable, value, f"{scenario.path}: {name}")
        units |= {variable.unit} if isinstance(variable, Float64) else set()
    exponents = {name: declaration.units[name] for name in sorted(units)}
    return filled("parameters.ssv.in", scenario=scenario, values=values, units=exponents)


def typed(variable: Variable, value: Any, place: str) -> tuple[str, dict[str, Any]]:
    """Return the element for a value, with its attributes."""
    if isinstance(variable, Enumeration):
        if not isinstance(value, str) or value not in variable.items:
            known = ", ".join(variable.items)
            raise WrongInputError(f"{place} = {value!r:.40} is not one of {known}")
        return "Enumeration", {"value": value}
    wanted = {"float64": (int, float), "int32": (int,), "boolean": (bool,)}
    if type(value) not in wanted[variable.type]:
        raise WrongInputError(f"{place} = {value!r:.40} is not a value of type {variable.type}")
    if isinstance(variable, Float64):
        return "Real", {"value": float(value), "unit": variable.unit}
    return "Boolean" if isinstance(variable, Boolean) else "Integer", {"value": value}


def file_name(model: str, ending: str) -> str:
    """Return the name of a file of a scenario: after the model where the cross-check has it so."""
    return model + ending if ending.startswith("_") else ending


def files(
    declaration: Declaration, names: Sequence[str], folder: Path
) -> Iterator[tuple[str, bytes]]:
    """Return name and content of each file; folder: of the model."""
    model = declaration.model.name
    scenarios = [read(folder / "scenarios" / f"{name}.toml") for name in names]
    named = {"model": model, "scenarios": scenarios, "files": FILES, "file_name": file_name}
    yield MANIFEST, filled(f"{MANIFEST}.in", **named).encode()
    for scenario in scenarios:
        for ending in FILES:
            name = file_name(model, ending)
            if ending == PARAMETERS:
                content = parameter_set(scenario, declaration).encode()
            else:
                content = content_of(folder / "references" / scenario.name / name)
            yield f"{scenario.name}/{name}", content


def write(output: Path, contents: Mapping[str, bytes]) -> None:
    for name, content in contents.items():
        (output / name).parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(output / name) as temporary:
            temporary.write_bytes(content)


@program()
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variables", type=Path, help="variables.toml of the model")
    parser.add_argument("names", nargs="+", metavar="NAME", help="scenarios of the model")
    parser.add_argument("--folder", type=Path, help="of the model, if variables.toml is elsewhere")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    arguments = parser.parse_args()
    declaration = load(arguments.variables)
    folder = arguments.folder or arguments.variables.parent
    write(arguments.output, dict(files(declaration, arguments.names, folder)))


if __name__ == "__main__":
    sys.exit(main())
