"""Writes the XML files of FMI 3.0: modelDescription.xml (section 2.4 of the specification),
terminalsAndIcons.xml (section 2.4.9) and buildDescription.xml (section 2.5.1.4.1)."""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

from compiler.interface import Declaration, Variable
from description_parts import described, display_unit, filled, type_names, values
from program import Provenance

TYPES = {"float64": "Float64", "int32": "Int32", "enumeration": "Enumeration", "boolean": "Boolean"}
HALF_WIDTH = 100.0  # of the icon, in units of the coordinate system
PNG_START = b"\x89PNG\r\n\x1a\n"


def model_description(declaration: Declaration, provenance: Provenance) -> str:
    variables = declaration.variables
    types = type_names(variables)
    floats = {float_type_name(v): v for v in variables.values() if v.unit}

    def keys(name: str, variable: Variable) -> dict[str, object]:
        """Return the attributes of a variable."""
        found = {"name": name, "valueReference": variable.reference}
        texts = ("description", "causality", "variability", "initial")
        found |= {key: getattr(variable, key) for key in texts}
        found["declaredType"] = float_type_name(variable) if variable.unit else types.get(name)
        found["intermediateUpdate"] = has_intermediate_update(variable) or None
        if variable.derivative_of is not None:
            found["derivative"] = variables[variable.derivative_of].reference
        return found | values(variable)

    return described(
        "fmi3",
        declaration,
        provenance,
        variables=variables,
        types=types,
        floats=floats,
        names=TYPES,
        keys=keys,
        shown=display_unit,
        structure=structure(declaration),
    )


def float_type_name(variable: Variable) -> str:
    """Return the name of the type of a floating-point number, for example "Float64 in rad/s"."""
    nominal = "" if variable.nominal is None else f", nominal {variable.nominal!r}"
    shown = "" if variable.display is None else f", shown in {variable.display.name}"
    return f"Float64 in {variable.unit}{nominal}{shown}"


def has_intermediate_update(variable: Variable) -> bool:
    """Return whether the variable can be accessed inside a step, as fmi3.c has it."""
    is_continuous = variable.variability == "continuous"
    return is_continuous and variable.owner == "model" and variable.causality in ("input", "output")


def structure(declaration: Declaration) -> Iterator[tuple[str, int, list[int]]]:
    """Yield exact dependencies (section 2.4.8): parameters are knowns, too."""
    variables = declaration.variables
    derivatives = {v.derivative_of: n for n, v in variables.items() if v.derivative_of is not None}
    calculated = [n for n, v in variables.items() if v.is_unknown and v.initial == "calculated"]
    for section, names in (
        ("Output", [n for n, v in variables.items() if v.causality == "output"]),
        ("ContinuousStateDerivative", [derivatives[n] for n in variables if n in derivatives]),
        ("InitialUnknown", calculated),
        ("EventIndicator", declaration.indicators),
    ):
        for unknown in map(variables.__getitem__, names):
            later = (*(unknown.dependencies or ()), *unknown.parameters)
            knowns = unknown.initial_knowns if section == "InitialUnknown" else later
            yield section, unknown.reference, sorted(variables[x].reference for x in knowns)


def terminals_and_icons(declaration: Declaration, icon: Path | None = None) -> str:
    """Return the text of terminalsAndIcons.xml; icon: a picture in PNG."""
    corners = icon_corners(icon) if icon else None
    template = "fmi3/terminalsAndIcons.xml.in"
    return filled(template, corners=corners, terminals=declaration.terminals)


def icon_corners(icon: Path) -> dict[str, float]:
    """Return where the icon is: it fills the coordinate system and keeps its shape."""
    width, height = png_size(icon)
    half_height = HALF_WIDTH * height / width
    return {"x1": -HALF_WIDTH, "y1": -half_height, "x2": HALF_WIDTH, "y2": half_height}


def png_size(path: Path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    if len(head) < 24 or not head.startswith(PNG_START):
        raise OSError(f"{path}: is not a PNG file")
    return struct.unpack(">II", head[16:])


def build_description(identifier: str, sources: Sequence[str]) -> str:
    """Return the text of buildDescription.xml; `sources` beside it are compiled one by one."""
    return filled("fmi3/buildDescription.xml.in", identifier=identifier, sources=sources)
