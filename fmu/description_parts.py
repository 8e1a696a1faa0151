"""What the model descriptions of all versions of FMI have in common."""

import xml.etree.ElementTree as ET

from declaration.load import Declaration
from declaration.schema import (
    Boolean,
    Display,
    Enumeration,
    Experiment,
    Float64,
    Model,
    UnitEntry,
    Variable,
)
from program import Provenance

LOG_CATEGORIES = {
    "logEvents": "Events, for example initialization and reset",
    "logStatusWarning": "Something to know about a call that succeeded",
    "logStatusDiscard": "Why a function returns {prefix}Discard",
    "logStatusError": "Why a function returns {prefix}Error",
    "logStatusFatal": "Why a function returns {prefix}Fatal",
    "logAll": "All messages, and every call",
}


def texts_of(declaration: Declaration, provenance: Provenance) -> dict[str, str]:
    """Return attributes of the root: what the model is and where it comes from."""
    model = declaration.model
    texts = {
        "author": provenance.author,
        "version": provenance.version,
        "copyright": provenance.copyright,
        "license": provenance.license,
        "generationTool": f"{model.name} {provenance.version}",
        "generationDateAndTime": provenance.date,
    }
    given = {key: text for key, text in texts.items() if text is not None}
    return {"description": model.description, **given}


def add_units(root: ET.Element, units: dict[str, UnitEntry]) -> None:
    """Write UnitDefinitions: SI base exponents, and the display units."""
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name, unit in sorted(units.items()):
        element = ET.SubElement(definitions, "Unit", name=name)
        exponents = {base: str(exponent) for base, exponent in unit.exponents.items()}
        ET.SubElement(element, "BaseUnit", exponents)
        displays = {name: Display(name=name, factor=f) for name, f in unit.display.items()}
        for display in (displays | unit.further).values():
            keys = {"name": display.name, "factor": repr(display.factor)}
            keys |= {"offset": repr(display.offset)} if display.offset else {}
            ET.SubElement(element, "DisplayUnit", keys)


def display_unit(variable: Float64, units: dict[str, UnitEntry]) -> dict[str, str]:
    """Return the attribute for the display unit of a variable, if it has one."""
    if variable.display:
        return {"displayUnit": variable.display.name}
    return dict(zip(["displayUnit"], units[variable.unit].display, strict=False))


def type_names(variables: dict[str, Variable]) -> dict[str, str]:
    """Types' names by enumerations, for example SolverMethodType for solver_method.

    a_b and aB have two, and no variable has the name of a type: _ is added where it is needed.
    """
    names: dict[str, str] = {}
    taken = set(variables)
    for variable in (name for name, v in variables.items() if isinstance(v, Enumeration)):
        words = variable.split("_")
        name = "".join(word[:1].upper() + word[1:] for word in words) + "Type"
        while name in taken:
            name += "_"
        names[variable] = name
        taken.add(name)
    return names


def add_items(parent: ET.Element, variable: Enumeration) -> None:
    """Write the items of an enumeration: their values count from 1."""
    for value, (item, keys) in enumerate(variable.items.items(), start=1):
        ET.SubElement(parent, "Item", name=item, value=str(value), description=keys.description)


def value_attributes(variable: Variable) -> dict[str, str]:
    """Return attributes start, min and max, of those that the variable has."""
    if isinstance(variable, Boolean):
        return {} if variable.start is None else {"start": str(variable.start).lower()}
    values = {key: getattr(variable, key) for key in ("start", "min", "max")}
    return {key: repr(value) for key, value in values.items() if value is not None}


def add_log_categories(root: ET.Element, prefix: str) -> None:
    """Write LogCategories; the version's constants begin with `prefix`."""
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        text = description.format(prefix=prefix)
        ET.SubElement(categories, "Category", name=name, description=text)


def add_experiment(root: ET.Element, experiment: Experiment) -> None:
    numbers = {"startTime": experiment.start, "stopTime": experiment.stop}
    numbers |= {"tolerance": experiment.tolerance, "stepSize": experiment.step}
    ET.SubElement(root, "DefaultExperiment", {key: repr(x) for key, x in numbers.items()})


def add_annotation(root: ET.Element, names: tuple[str, str], key: str, model: Model) -> None:
    """Write what `rparm linearize` should know; names and key: of the elements in this version."""
    notes = {"flat": model.flat, "modulated": model.modulated}
    if any(notes.values()):
        annotation = ET.SubElement(ET.SubElement(root, names[0]), names[1], {key: "rparm"})
        annotation = ET.SubElement(annotation, "linearize")  # FMI 2.0 allows a single element
        for tag, texts in notes.items():
            for text in texts:
                ET.SubElement(annotation, tag, text=text)


def document(root: ET.Element) -> str:
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
