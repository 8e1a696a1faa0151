"""Makes modelDescription.xml and the C tables of a unit from its variables.toml.

The keys of that file are told in description.py, which reads and checks it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

from atomic_write import atomic_write
from description import BASE_UNITS, DescriptionError, Table, is_unknown, load, type_name

LOG_CATEGORIES = (
    "logEvents",
    "logStatusWarning",
    "logStatusDiscard",
    "logStatusError",
    "logStatusFatal",
    "logAll",
)


def guid(description: Table) -> str:
    """Hash of what defines the interface: all but texts, C names and default experiment."""
    left_out = {"where", "description", "field", "owner", "items"}
    interface = {
        "model": description["model"]["name"],
        "units": description["units"],
        "variables": {
            name: {key: value for key, value in v.items() if key not in left_out}
            | ({"items": list(v["items"])} if "items" in v else {})
            for name, v in description["variables"].items()
        },
    }
    digest = hashlib.sha256(json.dumps(interface, sort_keys=True).encode()).hexdigest()
    parts = (digest[0:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])
    return "{" + "-".join(parts) + "}"


def number(value: float) -> str:
    """Text of a number that reads back as the same double, in C and in XML."""
    return repr(value)


def model_description(description: Table, version: str) -> str:
    """Text of modelDescription.xml (FMI 2.0, section 2.2)."""
    model, experiment = description["model"], description["experiment"]
    variables: Table = description["variables"]
    index = {name: str(i) for i, name in enumerate(variables, start=1)}

    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model["name"],
        guid=guid(description),
        description=model["description"],
        version=version,
        generationTool=f"{model['name']} {version}",
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    shared_flags = {
        "modelIdentifier": model["name"],
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    ET.SubElement(root, "ModelExchange", shared_flags)
    ET.SubElement(
        root,
        "CoSimulation",
        shared_flags,
        canHandleVariableCommunicationStepSize="true",
        canInterpolateInputs="true",
        maxOutputDerivativeOrder="2",
    )
    add_units(ET.SubElement(root, "UnitDefinitions"), description["units"])
    add_types(root, variables)
    categories = ET.SubElement(root, "LogCategories")
    for category in LOG_CATEGORIES:
        ET.SubElement(categories, "Category", name=category)
    ET.SubElement(
        root,
        "DefaultExperiment",
        startTime=number(experiment["start"]),
        stopTime=number(experiment["stop"]),
        tolerance=number(experiment["tolerance"]),
        stepSize=number(experiment["step"]),
    )
    scalars = ET.SubElement(root, "ModelVariables")
    for name, v in variables.items():
        add_variable(scalars, name, v, index, description["units"])
    add_structure(ET.SubElement(root, "ModelStructure"), variables, index)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def add_units(parent: ET.Element, units: Table) -> None:
    """Write UnitDefinitions: SI base exponents, and the display units."""
    for name, unit in sorted(units.items()):
        element = ET.SubElement(parent, "Unit", name=name)
        exponents = {base: str(unit[base]) for base in BASE_UNITS if base in unit}
        ET.SubElement(element, "BaseUnit", exponents)
        for display, factor in unit.get("display", {}).items():
            ET.SubElement(element, "DisplayUnit", name=display, factor=number(factor))


def add_types(root: ET.Element, variables: Table) -> None:
    """Write TypeDefinitions: one type for each Enumeration."""
    enumerations = {name: v for name, v in variables.items() if v["type"] == "Enumeration"}
    if not enumerations:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for name, v in enumerations.items():
        simple = ET.SubElement(definitions, "SimpleType", name=type_name(name))
        enumeration = ET.SubElement(simple, "Enumeration")
        for value, (item, keys) in enumerate(v["items"].items(), start=1):
            ET.SubElement(
                enumeration, "Item", name=item, value=str(value), description=keys["description"]
            )


def add_variable(
    parent: ET.Element, name: str, v: Table, index: dict[str, str], units: Table
) -> None:
    """Write one ScalarVariable."""
    attributes = {
        key: v[key] for key in ("description", "causality", "variability", "initial") if v.get(key)
    }
    scalar = ET.SubElement(
        parent, "ScalarVariable", name=name, valueReference=str(v["reference"]), **attributes
    )
    element = ET.SubElement(scalar, v["type"])
    if v["type"] == "Enumeration":
        element.set("declaredType", type_name(name))
    if "unit" in v:
        element.set("unit", v["unit"])
        for display in list(units[v["unit"]].get("display", {}))[:1]:
            element.set("displayUnit", display)
    if "derivative_of" in v:
        element.set("derivative", index[v["derivative_of"]])
    as_text = number if v["type"] == "Real" else lambda value: str(int(value))
    for key in ("start", "min", "max", "nominal"):
        if key in v:
            element.set(key, as_text(v[key]))


def add_structure(parent: ET.Element, variables: Table, index: dict[str, str]) -> None:
    """Write ModelStructure with exact dependencies (section 2.2.8 of the specification)."""
    outputs = [name for name, v in variables.items() if v["causality"] == "output"]
    derivatives = [name for name, v in variables.items() if "derivative_of" in v]
    initial = [n for n, v in variables.items() if is_unknown(v) and v["initial"] == "calculated"]
    for section, names, with_parameters in (
        ("Outputs", outputs, False),
        ("Derivatives", derivatives, False),
        ("InitialUnknowns", initial, True),
    ):
        if not names:
            continue
        element = ET.SubElement(parent, section)
        for name in names:
            v = variables[name]
            knowns = v["dependencies"] + (v.get("parameters", []) if with_parameters else [])
            ordered = sorted(knowns, key=lambda known: int(index[known]))
            dependencies = " ".join(index[known] for known in ordered)
            ET.SubElement(element, "Unknown", index=index[name], dependencies=dependencies)


def c_prefix(description: Table) -> str:
    """Prefix of the unit's macros, for example RP_MANIPULATOR for RPManipulator."""
    name = description["model"]["name"]
    words = [
        ("_" if i and c.isupper() and not name[i + 1 : i + 2].isupper() else "") + c.upper()
        for i, c in enumerate(name)
    ]
    return "".join(words)


def value_references(description: Table) -> str:
    """Text of value_references.h."""
    prefix = c_prefix(description)
    lines = [
        "/* Generated from variables.toml. */",
        f"#ifndef {prefix}_VALUE_REFERENCES_H",
        f"#define {prefix}_VALUE_REFERENCES_H",
        "",
        f'#define {prefix}_NAME "{description["model"]["name"]}"',
        f'#define {prefix}_GUID "{guid(description)}"',
        "",
        "enum {",
        *(f"    {prefix}_{n} = {v['reference']}," for n, v in description["variables"].items()),
        "};",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def variable_table(description: Table) -> str:
    """Text of variables.c: the rows, and the check that each field has the declared type."""
    model, variables = description["model"], description["variables"]
    structures = {"model": model["values"], "instance": "struct instance_values"}
    c_types = {"Real": "double", "Integer": "int", "Enumeration": "int"}
    checks, rows = [], []
    for name, v in variables.items():
        structure = structures[v["owner"]]
        checks.append(
            f"_Static_assert(_Generic((({structure} *)0)->{v['field']}, {c_types[v['type']]}: 1, "
            f'default: 0), "{name}: {v["field"]} must be of type {c_types[v["type"]]}");'
        )
        checks += [
            f'_Static_assert({item["constant"]} == {value}, "{name}: {item["constant"]} must be '
            f'{value}");'
            for value, item in enumerate(v.get("items", {}).values(), start=1)
        ]
        kind = "FLOAT64" if v["type"] == "Real" else "INT32"
        rows.append(
            f'    {{{v["reference"]}, "{name}", VARIABLE_{kind}, '
            f"VARIABLE_OF_{v['owner'].upper()}, offsetof({structure}, {v['field']}),\n"
            f"     CAUSALITY_{v['causality'].upper()}, VARIABILITY_{v['variability'].upper()}, "
            f"INITIAL_{(v['initial'] or 'none').upper()},\n"
            f"     {number(float(v.get('start', 0.0)))}, "
            f"{number(float(v['min'])) if 'min' in v else '-INFINITY'}, "
            f"{number(float(v['max'])) if 'max' in v else 'INFINITY'}, "
            f"{number(float(v.get('nominal', 1.0)))}}},"
        )
    row_of = {v["reference"]: row for row, v in enumerate(variables.values())}
    entries = [str(row_of.get(reference, -1)) for reference in range(max(row_of) + 1)]
    lines = [
        "/* Generated from variables.toml. */",
        '#include "instance.h"',
        f'#include "{model["header"]}"',
        '#include "model_description.h"',
        "",
        "#include <math.h>",
        "",
        *checks,
        "",
        "static const struct variable variables[] = {",
        *rows,
        "};",
        "",
        "static const short row_of_reference[] = {",
        *("    " + ", ".join(entries[i : i + 20]) + "," for i in range(0, len(entries), 20)),
        "};",
        "",
        "const struct model_description model_description = {",
        f'    .name = "{model["name"]}",',
        f'    .guid = "{guid(description)}",',
        f"    .default_tolerance = {number(float(description['experiment']['tolerance']))},",
        f"    .model = &{model['symbol']},",
        "    .variables = variables,",
        "    .variable_count = sizeof variables / sizeof variables[0],",
        "    .row_of_reference = row_of_reference,",
        "    .reference_count = sizeof row_of_reference / sizeof row_of_reference[0],",
        "};",
    ]
    return "\n".join(lines) + "\n"


def write_if_changed(path: Path, text: str) -> None:
    """Write a file, but leave an equal one alone so that nothing is rebuilt for it."""
    if not path.is_file() or path.read_bytes() != text.encode():
        with atomic_write(path) as temporary:
            temporary.write_bytes(text.encode())


def main() -> int:
    """Generate; 2 with a line on standard error where the description is wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("variables", type=Path, help="variables.toml of the model")
    parser.add_argument("--output", type=Path, required=True, help="folder for the files")
    parser.add_argument("--version", default="0.0.0", help="version of the project")
    arguments = parser.parse_args()
    try:
        description = load(arguments.variables)
        arguments.output.mkdir(parents=True, exist_ok=True)
        for name, text in (
            ("modelDescription.xml", model_description(description, arguments.version)),
            ("value_references.h", value_references(description)),
            ("variables.c", variable_table(description)),
        ):
            write_if_changed(arguments.output / name, text)
    except (DescriptionError, OSError) as error:
        print(f"generate.py: {error!s:.2000}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
