"""What the model descriptions of all versions of FMI share, and how their templates are filled."""

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from compiler.interface import Declaration, Display, Variable
from compiler.units import DISPLAYED, parsed
from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup
from program import Provenance


def filled(template: str, **values: object) -> str:
    """Return the text of a template of this folder."""
    return _templates.get_template(template).render(values)


def described(
    version: str, declaration: Declaration, provenance: Provenance, **values: object
) -> str:
    """Return the text of modelDescription.xml; `values`: what this version of FMI adds."""
    origin = {
        "description": declaration.description,
        "author": provenance.author,
        "version": provenance.version,
        "copyright": provenance.copyright,
        "license": provenance.license,
        "generationTool": f"{declaration.name} {provenance.version}",
        "generationDateAndTime": provenance.date,
    }
    shared = {"declaration": declaration, "origin": origin, "prefix": version}
    shared["displays"] = {unit: display_units(unit, declaration) for unit in declaration.units}
    shared["without_base"] = without_base(declaration)
    return filled(f"{version}/modelDescription.xml.in", **shared, **values)


def without_base(declaration: Declaration) -> set[str]:
    """Return the units with halves as exponents: those of a BaseUnit are whole."""
    units = declaration.units.items()
    return {name for name, of in units if any(e.denominator > 1 for e in of.values())}


def display_units(unit: str, declaration: Declaration) -> list[Display]:
    """Return the display units of a unit: those of all its variables, and those of some."""
    usual = DISPLAYED.get(unit, ())
    found = {name: Display(name, float(1 / parsed(name).factor)) for name in usual}
    own = [v.display for v in declaration.variables.values() if v.unit == unit and v.display]
    return [*(found | {display.name: display for display in own}).values()]


def display_unit(variable: Variable) -> str | None:
    """Return the name of the display unit of a variable, if it has one."""
    if variable.display:
        return variable.display.name
    return next(iter(DISPLAYED.get(variable.unit, ())), None)


def type_names(variables: Mapping[str, Variable]) -> dict[str, str]:
    """Types' names by enumerations, for example SolverMethodType for solver_method.

    a_b and aB have two, and no variable has the name of a type: _ is added where it is needed.
    """
    names: dict[str, str] = {}
    taken = set(variables)
    for variable in (name for name, v in variables.items() if v.type == "enumeration"):
        words = variable.split("_")
        name = "".join(word[:1].upper() + word[1:] for word in words) + "Type"
        while name in taken:
            name += "_"
        names[variable] = name
        taken.add(name)
    return names


def values(variable: Variable) -> dict[str, object]:
    """Return attributes reinit, start, min and max, None for those that the variable lacks."""
    keys = ("start",) if variable.type == "boolean" else ("start", "min", "max")
    found = {key: getattr(variable, key) for key in keys}
    return {"reinit": variable.reinit or None, **found}


def quoted(value: object) -> Markup:
    """Write the value of an attribute."""
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return Markup(quoteattr(text, {'"': "&quot;"}))


def attributes(given: Mapping[str, object]) -> Markup:
    """Write attributes, without those that are None."""
    known = {name: quoted(value) for name, value in given.items() if value is not None}
    return Markup("").join(Markup(f" {name}={value}") for name, value in known.items())


_templates = Environment(
    loader=FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
_templates.filters |= {"attributes": attributes, "quoted": quoted}
