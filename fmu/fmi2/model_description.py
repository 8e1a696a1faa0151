"""Writes modelDescription.xml of FMI 2.0 (section 2.2 of the specification)."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import description_parts
from declaration.load import Declaration, DeclarationError
from declaration.schema import Float64, UnitEntry, Variable
from program import Provenance

TYPES = {"float64": "Real", "int32": "Integer", "enumeration": "Enumeration", "boolean": "Boolean"}


def model_description(
    declaration: Declaration, provenance: Provenance, sources: Sequence[str] = ()
) -> str:
    """Text of modelDescription.xml; `sources`: files in the FMU's sources/ that are compiled."""
    model = declaration.model
    variables = with_aliases(declaration)
    index = {name: str(i) for i, name in enumerate(variables, start=1)}
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=declaration.guid,
        **description_parts.texts_of(declaration, provenance),
        variableNamingConvention=model.naming,
        numberOfEventIndicators=str(len(model.event_indicators)),
    )
    add_interfaces(root, model.name, sources)
    description_parts.add_units(root, declaration.units)
    types = description_parts.type_names(variables)
    add_types(root, variables, types)
    description_parts.add_log_categories(root, "fmi2")
    description_parts.add_experiment(root, declaration.experiment)
    description_parts.add_annotation(root, ("VendorAnnotations", "Tool"), "name", model)
    scalars = ET.SubElement(root, "ModelVariables")
    for name, variable in variables.items():
        add_variable(scalars, name, variable, types.get(name), index, declaration.units)
    add_structure(root, variables, index)
    return description_parts.document(root)


def with_aliases(declaration: Declaration) -> dict[str, Variable]:
    """Return all variables, and after each state that is the derivative of another one its alias.

    Importers expect each state derivative among the initial unknowns, and no variable that has a
    start value, as states do. So the alias, der_STATE, is the derivative, with the state's value
    reference and no start value; marked themselves, states would be for a further state.
    """
    variables: dict[str, Variable] = {}
    for name, variable in declaration.variables.items():
        variables[name] = variable
        if variable.derivative_of is None or variable.initial != "exact":
            continue
        variables[name] = variable.model_copy(update={"derivative_of": None})
        alias = f"der_{variable.derivative_of}"
        if alias in declaration.variables:
            place = f"{declaration.path}: variable {alias}"
            raise DeclarationError(f"{place}: FMI 2.0 needs the name for an alias of {name}")
        changes = {
            "causality": "local",
            "initial": "calculated",
            "start": None,
            "reinit": False,
            "description": f"Time derivative of {variable.derivative_of}: alias of {name}",
        }
        variables[alias] = variable.model_copy(update=changes)
    return variables


def add_interfaces(root: ET.Element, identifier: str, sources: Sequence[str]) -> None:
    """Write ModelExchange and CoSimulation with what they can do, and their SourceFiles."""
    shared = {
        "modelIdentifier": identifier,
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    co_simulation = {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": "2",
    }
    for kind, capabilities in (("ModelExchange", shared), ("CoSimulation", shared | co_simulation)):
        interface = ET.SubElement(root, kind, capabilities)
        if sources:
            files = ET.SubElement(interface, "SourceFiles")
            for name in sources:
                ET.SubElement(files, "File", name=name)


def add_types(root: ET.Element, variables: dict[str, Variable], types: dict[str, str]) -> None:
    """Write TypeDefinitions: one type for each enumeration."""
    if not types:
        return
    definitions = ET.SubElement(root, "TypeDefinitions")
    for name, type_name in types.items():
        simple = ET.SubElement(definitions, "SimpleType", name=type_name)
        description_parts.add_items(ET.SubElement(simple, "Enumeration"), variables[name])


def add_variable(
    parent: ET.Element,
    name: str,
    variable: Variable,
    type_name: str | None,
    index: dict[str, str],
    units: dict[str, UnitEntry],
) -> None:
    keys = {"name": name, "valueReference": str(variable.reference)}
    for key in ("description", "causality", "variability", "initial"):
        if text := getattr(variable, key):
            keys[key] = text
    scalar = ET.SubElement(parent, "ScalarVariable", keys)
    element = ET.SubElement(scalar, TYPES[variable.type])
    if type_name is not None:
        element.set("declaredType", type_name)
    if isinstance(variable, Float64):
        element.set("unit", variable.unit)
        element.attrib |= description_parts.display_unit(variable, units)
    if variable.derivative_of is not None:
        element.set("derivative", index[variable.derivative_of])
    if variable.reinit:
        element.set("reinit", "true")
    for key, text in description_parts.value_attributes(variable).items():
        element.set(key, text)
    if isinstance(variable, Float64) and variable.nominal is not None:
        element.set("nominal", repr(variable.nominal))


def add_structure(root: ET.Element, variables: dict[str, Variable], index: dict[str, str]) -> None:
    """Write ModelStructure with exact dependencies (section 2.2.8 of the specification)."""
    structure = ET.SubElement(root, "ModelStructure")
    calculated = {n: v for n, v in variables.items() if v.is_unknown and v.initial == "calculated"}
    for section, unknowns, is_initial in (
        ("Outputs", {n: v for n, v in variables.items() if v.causality == "output"}, False),
        ("Derivatives", {n: v for n, v in calculated.items() if v.derivative_of}, False),
        ("InitialUnknowns", calculated, True),
    ):
        if not unknowns:
            continue
        element = ET.SubElement(structure, section)
        for name, unknown in unknowns.items():
            later = unknown.dependencies or []
            knowns = unknown.initial_knowns(variables) if is_initial else later
            indices = sorted(int(index[known]) for known in knowns)
            dependencies = " ".join(map(str, indices))
            ET.SubElement(element, "Unknown", index=index[name], dependencies=dependencies)
