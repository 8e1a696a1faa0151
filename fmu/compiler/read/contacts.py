"""Dry friction and stops of a file: each decides an unknown force that the equations use."""

from collections.abc import Callable, Mapping

from ..expressions.dimensions import Dimension, dimension_of, of_exponents, times
from ..expressions.expression import Node, names
from ..expressions.kinds import CONDITION, NUMBER
from ..units import BASE, whole
from . import keys
from .content import (
    COUNTS,
    FORCES,
    Contact,
    Element,
    Expression,
    ModelFile,
    ModelFileError,
    Variable,
    placed,
    variable_of,
)

FRICTION, STOPS = "friction", "stops"
SECTIONS = {FRICTION: keys.FRICTION, STOPS: keys.STOPS}
NEEDED = {
    FRICTION: ("force", "velocity", "coulomb"),
    STOPS: ("force", "position", "velocity", "restitution"),
}
MODES = {
    FRICTION: {
        "backward": "Slides at a negative velocity",
        "stuck": "Is held",
        "forward": "Slides at a positive velocity, or without friction",
    },
    STOPS: {
        "free": "Touches no stop",
        "lower": "Rests on the lower stop",
        "upper": "Rests on the upper stop",
    },
}
POWER = of_exponents({"kg": 1, "m": 2, "s": -3})
NAMES_OF_TURNS = {  # of torques and their impulses
    of_exponents({"kg": 1, "m": 2, "s": -2}): "N.m",
    of_exponents({"kg": 1, "m": 2, "s": -1}): "N.m.s",
}


def read(
    file: ModelFile, section: str, element: Element, check_name: Callable[[str, ModelFile], None]
) -> None:
    """Read an element, and declare its force and what else it has as variables."""
    place = f"[{section}.{keys.named(element.shown)}]"
    name = f"{section}.{element.name}"
    with placed(place):
        if not keys.NAME.fullmatch(element.name.partition("[")[0]):
            raise ModelFileError("expected a name: a letter, then letters, digits, _")
        given = keys.entries(element.entry, SECTIONS[section], "force")
        for key in NEEDED[section]:
            if key not in given:
                raise ModelFileError(f"{key} is missing")
        if section == STOPS and not given.keys() & {"lower", "upper"}:
            raise ModelFileError("expected lower or upper: where it stops")
        if "stribeck" in given and "breakaway" not in given:
            raise ModelFileError("stribeck: expected breakaway, too, the friction at rest")
    text = given.pop("force")
    expression = file.expression(element, (place, "force"), text, None)
    with placed(place, "force"):
        if expression.tree.op != "name":
            raise ModelFileError(f"expected a name that the equations use, got {text!r}")
        force = expression.tree.name
        check_name(force, file)
    found = {
        key: file.expression(
            element, (place, key), text, CONDITION if key == "while" else NUMBER
        )
        for key, text in given.items()
    }  # fmt: skip
    file.contacts.append(Contact(name, section == FRICTION, force, found))
    file.variables[force] = Variable(force, FORCES, shown=False)
    _declare(file, section, name, force)


def _declare(file: ModelFile, section: str, name: str, force: str) -> None:
    """Declare what the FMU shows of an element."""
    items = keys.Items(MODES[section])
    own = [
        Variable(
            variable_of(name, "mode"), COUNTS, kind=items, start=1.0, description=f"Mode of {name}"
        )
    ]
    of_force = Variable(variable_of(name, "force"), "outputs", description=f"Force of {name}")
    place = (f"[{name}]", "force")
    of_force.expression = Expression(
        place, force, Node("name", 1, name=force), NUMBER, of_force.name
    )
    own.append(of_force)
    if section == STOPS:
        texts = {
            "impulse": "Impulse of the last impact",
            "impulses": "Sum of the impulses of all impacts",
            "loss": "Energy lost in all impacts",
        }
        own += [
            Variable(variable_of(name, key), "discrete", start=0.0, description=f"{text} of {name}")
            for key, text in texts.items()
        ]
    for variable in own:
        if variable.name in file.variables:
            raise ModelFileError(f"[{name}]: {variable.name}: this name is there already")
        file.variables[variable.name] = variable


def add_units(file: ModelFile, units: dict[str, Dimension | None]) -> dict[str, Dimension]:
    """Find the units of forces, whose power is what they take at their velocity.

    Returns what each expression of the elements has to have.
    """
    expected: dict[Expression, Dimension] = {}
    for contact in file.contacts:
        velocity = contact.given["velocity"]
        if velocity.is_checked:
            continue
        with placed(*velocity.place):
            unit = dimension_of(velocity.tree, _known(velocity.tree, units, file))
        if not unit:  # a file without units
            continue
        force, second = times(POWER, unit, -1), of_exponents({"s": 1})
        length = times(unit, second)
        found = dict.fromkeys(("coulomb", "breakaway"), force)
        found |= dict.fromkeys(("position", "lower", "upper"), length) | {"stribeck": unit}
        found["restitution"] = of_exponents({})
        expected |= {e: found[key] for key, e in contact.given.items() if key in found}
        own = {contact.force: force, contact.variable("force"): force}
        turns = any(
            file.variables[name].unit.startswith("rad") for name in names(velocity.tree)
            if name in file.variables
        )  # fmt: skip
        if not contact.is_friction:
            impulse = times(force, second)
            own |= {contact.variable("impulse"): impulse, contact.variable("impulses"): impulse}
            own |= {contact.variable("loss"): times(POWER, second)}
        for name, dimension in own.items():
            units[name] = dimension
            if turns and name != contact.variable("loss") and dimension in NAMES_OF_TURNS:
                file.variables[name].unit = NAMES_OF_TURNS[dimension]
            exponents = zip(BASE, dimension, strict=True)
            file.variables[name].exponents = {base: whole(x) for base, x in exponents}
    return expected


def _known(
    tree: Node, units: Mapping[str, Dimension | None], file: ModelFile
) -> dict[str, Dimension | None]:
    """Return units, with those of entries of [where] that the expression reads."""
    found = dict(units)
    for name in names(tree) - units.keys():
        of = file.variables[name].expression
        with placed(*of.place):
            found[name] = dimension_of(of.tree, _known(of.tree, found, file))
    return found
