"""Writes the XML files of FMI 3.0: modelDescription.xml (section 2.4 of the specification),
terminalsAndIcons.xml (section 2.4.9) and buildDescription.xml (section 2.5.1.4.1)."""

import struct
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import description_parts
from declaration.load import Declaration
from declaration.schema import Float64, Terminal, UnitEntry, Variable
from program import Provenance

TYPES = {"float64": "Float64", "int32": "Int32", "enumeration": "Enumeration", "boolean": "Boolean"}
HALF_WIDTH = 100.0  # of the icon, in units of the coordinate system
MM_PER_UNIT = 0.1
PNG_START = b"\x89PNG\r\n\x1a\n"


def model_description(declaration: Declaration, provenance: Provenance) -> str:
    model, variables = declaration.model, declaration.variables
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=model.name,
        instantiationToken=declaration.token("fmi3"),
        **description_parts.texts_of(declaration, provenance),
        variableNamingConvention=model.naming,
    )
    add_interfaces(root, model.name, has_events=model.has_events)
    description_parts.add_units(root, declaration.units)
    types = description_parts.type_names(variables)
    add_types(root, declaration, types)
    description_parts.add_log_categories(root, "fmi3")
    description_parts.add_experiment(root, declaration.experiment)
    elements = ET.SubElement(root, "ModelVariables")
    for name, variable in variables.items():
        add_variable(elements, name, variable, types.get(name), declaration)
    add_structure(root, declaration)
    description_parts.add_annotation(root, ("Annotations", "Annotation"), "type", model)
    return description_parts.document(root)


def add_interfaces(root: ET.Element, identifier: str, *, has_events: bool) -> None:
    """Write ModelExchange and CoSimulation with what they can do."""
    shared = {
        "modelIdentifier": identifier,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
    }
    model_exchange = ET.SubElement(root, "ModelExchange", shared)
    co_simulation = ET.SubElement(
        root,
        "CoSimulation",
        shared,
        canHandleVariableCommunicationStepSize="true",
        maxOutputDerivativeOrder="2",
        providesIntermediateUpdate="true",
        canReturnEarlyAfterIntermediateUpdate="true",
        hasEventMode="true",
    )
    if has_events:
        model_exchange.set("needsCompletedIntegratorStep", "true")
        co_simulation.set("mightReturnEarlyFromDoStep", "true")


def add_types(root: ET.Element, declaration: Declaration, types: dict[str, str]) -> None:
    """Write TypeDefinitions: one type for each combination of unit and nominal value in use, since
    importers refuse these on variables, and one for each enumeration."""
    definitions = ET.SubElement(root, "TypeDefinitions")
    written: set[str] = set()
    for variable in declaration.variables.values():
        if isinstance(variable, Float64) and float_type_name(variable) not in written:
            written.add(float_type_name(variable))
            add_float_type(definitions, variable, declaration.units)
    for name, type_name in types.items():
        enumeration = ET.SubElement(definitions, "EnumerationType", name=type_name)
        description_parts.add_items(enumeration, declaration.variables[name])


def float_type_name(variable: Float64) -> str:
    """Return the name of the type of a floating-point number, for example "Float64 in rad/s"."""
    nominal = "" if variable.nominal is None else f", nominal {variable.nominal!r}"
    shown = "" if variable.display is None else f", shown in {variable.display.name}"
    return f"Float64 in {variable.unit}{nominal}{shown}"


def add_float_type(parent: ET.Element, variable: Float64, units: dict[str, UnitEntry]) -> None:
    keys = {"name": float_type_name(variable), "unit": variable.unit}
    element = ET.SubElement(parent, "Float64Type", keys)
    element.attrib |= description_parts.display_unit(variable, units)
    if variable.nominal is not None:
        element.set("nominal", repr(variable.nominal))


def has_intermediate_update(variable: Variable) -> bool:
    """Return whether the variable can be accessed inside a step, as fmi3.c has it."""
    is_continuous = isinstance(variable, Float64) and variable.variability == "continuous"
    return is_continuous and variable.owner == "model" and variable.causality in ("input", "output")


def add_variable(
    parent: ET.Element,
    name: str,
    variable: Variable,
    type_name: str | None,
    declaration: Declaration,
) -> None:
    keys = {"name": name, "valueReference": str(variable.reference)}
    keys |= {key: getattr(variable, key) for key in ("description", "causality", "variability")}
    element = ET.SubElement(parent, TYPES[variable.type], keys)
    if variable.initial is not None:
        element.set("initial", variable.initial)
    if type_name is not None:
        element.set("declaredType", type_name)
    if isinstance(variable, Float64):
        element.set("declaredType", float_type_name(variable))
    if has_intermediate_update(variable):
        element.set("intermediateUpdate", "true")
    if variable.derivative_of is not None:
        state = declaration.variables[variable.derivative_of]
        element.set("derivative", str(state.reference))
    if variable.reinit:
        element.set("reinit", "true")
    for key, text in description_parts.value_attributes(variable).items():
        element.set(key, text)


def add_structure(root: ET.Element, declaration: Declaration) -> None:
    """Write ModelStructure with exact dependencies (section 2.4.8): parameters are knowns, too."""
    variables = declaration.variables
    structure = ET.SubElement(root, "ModelStructure")
    states = {v.derivative_of for v in variables.values() if v.derivative_of is not None}
    derivatives = {v.derivative_of: n for n, v in variables.items() if v.derivative_of is not None}
    calculated = [n for n, v in variables.items() if v.is_unknown and v.initial == "calculated"]
    for section, names in (
        ("Output", [n for n, v in variables.items() if v.causality == "output"]),
        ("ContinuousStateDerivative", [derivatives[n] for n in variables if n in states]),
        ("InitialUnknown", calculated),
        ("EventIndicator", declaration.model.event_indicators),
    ):
        for name in names:
            unknown = variables[name]
            later = (unknown.dependencies or []) + unknown.parameters
            is_initial = section == "InitialUnknown"
            knowns = unknown.initial_knowns(variables) if is_initial else later
            dependencies = map(str, sorted(variables[known].reference for known in knowns))
            keys = {"valueReference": str(unknown.reference)}
            ET.SubElement(structure, section, keys, dependencies=" ".join(dependencies))


def terminals_and_icons(declaration: Declaration) -> str:
    """Return the text of terminalsAndIcons.xml; the icon is model.png beside the declaration."""
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    icon = declaration.path.with_name("model.png")
    if icon.is_file():
        add_icon(root, icon)
    if declaration.terminals:
        add_terminals(ET.SubElement(root, "Terminals"), declaration.terminals)
    return description_parts.document(root)


def add_icon(root: ET.Element, icon: Path) -> None:
    """Write GraphicalRepresentation: the icon fills the coordinate system and keeps its shape."""
    width, height = png_size(icon)
    half_height = HALF_WIDTH * height / width
    box = {"x1": -HALF_WIDTH, "y1": -half_height, "x2": HALF_WIDTH, "y2": half_height}
    corners = {key: repr(value) for key, value in box.items()}
    graphics = ET.SubElement(root, "GraphicalRepresentation")
    scale = {"suggestedScalingFactorTo_mm": repr(MM_PER_UNIT)}
    ET.SubElement(graphics, "CoordinateSystem", corners | scale)
    ET.SubElement(graphics, "Icon", corners)


def png_size(path: Path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    if len(head) < 24 or not head.startswith(PNG_START):
        raise OSError(f"{path}: is not a PNG file")
    return struct.unpack(">II", head[16:])


def add_terminals(parent: ET.Element, terminals: Mapping[str, Terminal]) -> None:
    """Write terminals, each with its members and the terminals in it."""
    for name, terminal in terminals.items():
        keys = {"name": name, "matchingRule": terminal.rule, "description": terminal.description}
        element = ET.SubElement(parent, "Terminal", keys)
        for kind, member, variable in terminal.members:
            keys = {"variableName": variable, "memberName": member, "variableKind": kind}
            ET.SubElement(element, "TerminalMemberVariable", keys)
        add_terminals(element, terminal.terminals)


def build_description(identifier: str, sources: Sequence[str]) -> str:
    """Return the text of buildDescription.xml; `sources` beside it are compiled one by one."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ET.SubElement(configuration, "SourceFileSet", language="C11")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    return description_parts.document(root)
