"""Collects scenarios for an FMU: what goes into extra/org.fmi-standard.fmi-ls-ref.

For each scenario a folder with its inputs, reference and options in the format of the FMI
cross-check, and its parameters as a parameter set of SSP; beside them fmi-ls-manifest.xml, which
says what each file is (FMI Layered Standard References 1.0.0-alpha.1).
"""

import argparse
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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


def parameter_set(scenario: Scenario, description: ET.Element) -> str:
    """Text of the .ssv (SSP 1.0) with the values that are not the start values of the FMU."""
    scalars = description.iterfind("ModelVariables/ScalarVariable")
    variables = {scalar.get("name"): scalar[0] for scalar in scalars}
    bases = {unit.get("name"): unit.find("BaseUnit") for unit in description.iter("Unit")}
    values, units = {}, {}
    for name, value in scenario.values.items():
        variable = variables.get(name)
        if variable is None:
            raise WrongInputError(f"{scenario.path}: '{name}' is not declared")
        items = items_of(description, variable.get("declaredType"))
        kind, keys = typed(variable, items, value, f"{scenario.path}: {name}")
        base = bases.get(keys.pop("unit", None))  # one with halves has none, which SSP needs
        if base is not None:
            keys["unit"] = variable.get("unit")
            units[keys["unit"]] = base.attrib
        values[name] = kind, keys
    units = dict(sorted(units.items()))
    return filled("parameters.ssv.in", scenario=scenario, values=values, units=units)


def items_of(description: ET.Element, name: str | None) -> list[str | None]:
    """Return the items of a type, if it is an enumeration."""
    path = f"TypeDefinitions/SimpleType[@name='{name}']/Enumeration/Item"
    return [item.get("name") for item in description.iterfind(path)]


def typed(
    variable: ET.Element, items: Sequence[str | None], value: Any, place: str
) -> tuple[str, dict[str, Any]]:
    """Return the element for a value, with its attributes."""
    kind = variable.tag
    if kind == "Enumeration":
        if value not in items:
            raise WrongInputError(f"{place} = {value!r:.40} is not one of {', '.join(items)}")
        return kind, {"value": value}
    wanted = {"Real": (int, float), "Integer": (int,), "Boolean": (bool,)}
    if type(value) not in wanted[kind]:
        raise WrongInputError(f"{place} = {value!r:.40} is not a value of type {kind}")
    if kind == "Real":
        return kind, {"value": float(value), "unit": variable.get("unit")}
    return kind, {"value": value}


def file_name(model: str, ending: str) -> str:
    """Return the name of a file of a scenario: after the model where the cross-check has it so."""
    return model + ending if ending.startswith("_") else ending


def files(
    description: ET.Element, names: Sequence[str], folder: Path
) -> Iterator[tuple[str, bytes]]:
    """Return name and content of each file; folder: of the model."""
    model = description.get("modelName", "")
    scenarios = [read(folder / "scenarios" / f"{name}.toml") for name in names]
    named = {"model": model, "scenarios": scenarios, "files": FILES, "file_name": file_name}
    yield MANIFEST, filled(f"{MANIFEST}.in", **named).encode()
    for scenario in scenarios:
        for ending in FILES:
            name = file_name(model, ending)
            if ending == PARAMETERS:
                content = parameter_set(scenario, description).encode()
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
    parser.add_argument("description", type=Path, help="modelDescription.xml of FMI 2.0")
    parser.add_argument("names", nargs="+", metavar="NAME", help="scenarios of the model")
    parser.add_argument("--folder", type=Path, required=True, help="folder of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    arguments = parser.parse_args()
    description = ET.parse(arguments.description).getroot()
    write(arguments.output, dict(files(description, arguments.names, arguments.folder)))


if __name__ == "__main__":
    sys.exit(main())
