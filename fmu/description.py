"""Reads and checks the variables.toml of a unit.

Keys of variables.toml:

    include       further files whose [variables] and [units] are taken over, relative to this one
    [model]       name (also the identifier), description, header, values (C type of the value
                  structure), symbol (the C object of type struct model)
    [experiment]  start, stop, tolerance, step: the default experiment
    [units]       "name" = { exponents of the SI base units, display.NAME = factor }
    [variables.NAME]
        reference     value reference, unique, 0 to 9999
        owner         "model" (default) or "instance": the structure that holds the value
        field         C designator of the value in that structure
        type          "Real" (default), "Integer" or "Enumeration"
        causality, variability, initial, unit, start, min, max, nominal, description
                      as in section 2.2.7 of the FMI 2.0 specification
        items         of an Enumeration: [variables.NAME.items.ITEM] with description and constant,
                      the C constant of that value; the values are 1, 2, ... in the order of the
                      file, start is the name of an item
        derivative_of name of the variable that this one is the time derivative of
        dependencies  of outputs and derivatives: the inputs, states and time they depend on
        parameters    of calculated outputs and derivatives: the parameters they depend on
"""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any

Table = dict[str, Any]

BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
LARGEST_REFERENCE = 9999
INTEGERS = (-(2**31), 2**31 - 1)  # of the C type int
IDENTIFIER = re.compile("[A-Za-z_][A-Za-z0-9_]*")
RESERVED_NAMES = ("GUID", "NAME")  # with the prefix of the unit these are macros

# allowed values of initial, the default first (table in section 2.2.7 of the specification)
INITIALS = {
    ("parameter", "fixed"): ("exact",),
    ("parameter", "tunable"): ("exact",),
    ("input", "discrete"): (None,),
    ("input", "continuous"): (None,),
    ("output", "discrete"): ("calculated", "exact"),
    ("output", "continuous"): ("calculated", "exact"),
    ("local", "fixed"): ("calculated",),
    ("local", "tunable"): ("calculated",),
    ("local", "discrete"): ("calculated", "exact"),
    ("local", "continuous"): ("calculated", "exact"),
    ("independent", "continuous"): (None,),
}

KEYS = {
    "": {"include": list, "model": dict, "experiment": dict, "units": dict, "variables": dict},
    "model": {"name": str, "description": str, "header": str, "values": str, "symbol": str},
    "experiment": {"start": float, "stop": float, "tolerance": float, "step": float},
    "variable": {
        "reference": int,
        "owner": str,
        "field": str,
        "type": str,
        "causality": str,
        "variability": str,
        "initial": str,
        "unit": str,
        "start": float,
        "min": float,
        "max": float,
        "nominal": float,
        "description": str,
        "items": dict,
        "derivative_of": str,
        "dependencies": list,
        "parameters": list,
    },
    "item": {"description": str, "constant": str},
}
REQUIRED = ("reference", "field", "causality", "variability", "description")
TYPES = ("Real", "Integer", "Enumeration")


class DescriptionError(Exception):
    """A variables.toml that cannot be used: file, variable and reason in one line."""


def is_finite_number(value: object) -> bool:
    """Tell whether a value is a number that a double can hold."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def check_keys(where: str, table: Table, kinds: dict[str, type]) -> None:
    """Refuse keys that are unknown or whose value is of another type."""
    for key, value in table.items():
        if key not in kinds:
            raise DescriptionError(f"{where}: unknown key '{key}', expected {', '.join(kinds)}")
        if kinds[key] is float:
            if not is_finite_number(value):
                raise DescriptionError(f"{where}: {key} = {shown(value)} is not a finite number")
        elif not isinstance(value, kinds[key]) or isinstance(value, bool):
            kind = kinds[key].__name__
            raise DescriptionError(f"{where}: {key} = {shown(value)} is not a {kind}")
        elif isinstance(value, int) and not INTEGERS[0] <= value <= INTEGERS[1]:
            raise DescriptionError(f"{where}: {key} = {shown(value)} is not an int of 32 bits")
        elif isinstance(value, list) and not all(isinstance(item, str) for item in value):
            raise DescriptionError(f"{where}: {key} = {shown(value)} is not a list of strings")


def shown(value: object) -> str:
    """Short form of a value; an integer may have more digits than Python writes."""
    try:
        return f"{value!r:.40}"
    except ValueError:
        return "a very large number"


def read_toml(path: Path) -> Table:
    """Read one TOML file and check its top-level keys."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DescriptionError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError) as error:  # of the parser, and of reading as UTF-8
        raise DescriptionError(f"{path}: is not valid TOML: {error}") from None
    check_keys(str(path), content, KEYS[""])
    return content


def load(path: Path) -> Table:
    """Read variables.toml with what it includes, and check all of it.

    Returns
    -------
    dict
        model, experiment, units (name -> exponents) and variables (name -> keys, with defaults
        filled in), variables sorted by value reference.
    """
    description = read_toml(path)
    for section in ("model", "experiment", "variables"):
        if section not in description:
            raise DescriptionError(f"{path}: the section [{section}] is missing")
    units, variables = {}, {}
    sources = [path.parent / name for name in description.get("include", [])] + [path]
    for source in sources:
        content = read_toml(source)
        units |= content.get("units", {})
        for name, variable in content.get("variables", {}).items():
            where = f"{source}: variable {name}"
            if not isinstance(variable, dict):
                raise DescriptionError(f"{where}: is not a table")
            if name in variables:
                raise DescriptionError(f"{where}: is declared twice")
            if not IDENTIFIER.fullmatch(name):
                raise DescriptionError(f"{where}: the name must be a C identifier")
            if name in RESERVED_NAMES:
                raise DescriptionError(f"{where}: the name is reserved for the generated header")
            variables[name] = checked_variable(where, variable) | {"where": where}
    for section in ("model", "experiment"):
        check_keys(f"{path}: [{section}]", description[section], KEYS[section])
        for key in KEYS[section]:
            if key not in description[section]:
                raise DescriptionError(f"{path}: [{section}] lacks {key}")
    if not description["model"]["name"].isidentifier():
        raise DescriptionError(f"{path}: [model] name must be a C identifier")

    check_experiment(path, description["experiment"])
    check_units(path, units)
    check_together(variables, units)
    by_reference = sorted(variables.items(), key=lambda item: item[1]["reference"])
    return {**description, "units": units, "variables": dict(by_reference)}


def checked_variable(where: str, variable: Table) -> Table:
    """Check one variable by itself and fill in its defaults."""
    if variable.get("type") == "Enumeration":
        variable = numbered(where, variable)
    check_keys(where, variable, KEYS["variable"])
    for key in REQUIRED:
        if key not in variable:
            raise DescriptionError(f"{where}: lacks {key}")
    v = {"owner": "model", "type": "Real", **variable}
    if not 0 <= v["reference"] <= LARGEST_REFERENCE:
        raise DescriptionError(f"{where}: reference must be from 0 to {LARGEST_REFERENCE}")
    for key, allowed in (("owner", ("model", "instance")), ("type", TYPES)):
        if v[key] not in allowed:
            raise DescriptionError(f"{where}: {key} '{v[key]}' is not one of {', '.join(allowed)}")

    kind = (v["causality"], v["variability"])
    if kind not in INITIALS:
        raise DescriptionError(f"{where}: causality '{kind[0]}' with variability '{kind[1]}'"
                               " does not exist")  # fmt: skip
    v["initial"] = v.get("initial", INITIALS[kind][0])
    if v["initial"] not in INITIALS[kind]:
        allowed = " or ".join(str(initial) for initial in INITIALS[kind])
        raise DescriptionError(f"{where}: initial must be {allowed}, not {v['initial']}")
    needs_start = v["initial"] == "exact" or v["causality"] == "input"
    if needs_start != ("start" in v):
        raise DescriptionError(f"{where}: start is {'missing' if needs_start else 'not allowed'}")
    if ("items" in v) != (v["type"] == "Enumeration"):
        raise DescriptionError(f"{where}: items belong to an Enumeration, and to nothing else")
    if v["type"] != "Real":
        if v["variability"] == "continuous" or "unit" in v:
            raise DescriptionError(f"{where}: an {v['type']} is not continuous and has no unit")
        for key in ("start", "min", "max"):
            if key in v and not (v[key] == int(v[key]) and INTEGERS[0] <= v[key] <= INTEGERS[1]):
                raise DescriptionError(f"{where}: {key} = {v[key]} is not an integer of 32 bits")
    elif "unit" not in v:
        raise DescriptionError(f"{where}: lacks unit")
    if needs_start and not v.get("min", -math.inf) <= v["start"] <= v.get("max", math.inf):
        raise DescriptionError(f"{where}: start = {v['start']} is outside [min, max]")
    if v.get("nominal", 1.0) <= 0.0:
        raise DescriptionError(f"{where}: nominal must be above 0")
    return v


def numbered(where: str, variable: Table) -> Table:
    """Check the items of an Enumeration and give start, min and max as numbers."""
    items = variable.get("items")
    if not isinstance(items, dict) or not items:
        raise DescriptionError(f"{where}: an Enumeration needs [items.NAME] tables")
    for name, item in items.items():
        if not isinstance(item, dict):
            raise DescriptionError(f"{where}: item {name} is not a table")
        check_keys(f"{where}: item {name}", item, KEYS["item"])
        for key in KEYS["item"]:
            if key not in item:
                raise DescriptionError(f"{where}: item {name} lacks {key}")
        if not IDENTIFIER.fullmatch(item["constant"]):
            raise DescriptionError(f"{where}: item {name}: constant must be a C identifier")
    if "min" in variable or "max" in variable:
        raise DescriptionError(f"{where}: min and max follow from the items")
    v = {**variable, "min": 1, "max": len(items)}
    if "start" in variable:
        if not isinstance(variable["start"], str) or variable["start"] not in items:
            raise DescriptionError(
                f"{where}: start = {shown(variable['start'])} is not one of {', '.join(items)}"
            )
        v["start"] = list(items).index(variable["start"]) + 1
    return v


def type_name(variable: str) -> str:
    """Name of the type of an Enumeration, for example SolverMethod for solver_method."""
    return "".join(word[:1].upper() + word[1:] for word in variable.split("_")) + "Type"


def check_experiment(path: Path, experiment: Table) -> None:
    """Check that the default experiment can be run."""
    for key, possible in (
        ("stop", experiment["stop"] > experiment["start"]),
        ("tolerance", 0.0 < experiment["tolerance"] < 1.0),
        ("step", 0.0 < experiment["step"] <= experiment["stop"] - experiment["start"]),
    ):
        if not possible:
            raise DescriptionError(f"{path}: [experiment] {key} = {experiment[key]} is impossible")


def check_units(path: Path, units: Table) -> None:
    """Check that every unit is made of SI base units and display factors."""
    for name, unit in units.items():
        where = f"{path}: unit {name}"
        if not isinstance(unit, dict):
            raise DescriptionError(f"{where}: is not a table of exponents")
        kinds = dict.fromkeys(BASE_UNITS, int) | {"display": dict}
        check_keys(where, unit, kinds)
        check_keys(where, unit.get("display", {}), dict.fromkeys(unit.get("display", {}), float))


def check_together(variables: Table, units: Table) -> None:
    """Check what involves more than one variable."""
    by_reference: dict[int, str] = {}
    for name, v in variables.items():
        where = v["where"]
        if v["reference"] in by_reference:
            other = by_reference[v["reference"]]
            raise DescriptionError(f"{where}: value reference {v['reference']} is {other}'s")
        by_reference[v["reference"]] = name
        if "unit" in v and v["unit"] not in units:
            raise DescriptionError(f"{where}: unit '{v['unit']}' is not among [units]")

        listed = v.get("dependencies", []) + v.get("parameters", [])
        for other in [*listed, *([v["derivative_of"]] if "derivative_of" in v else [])]:
            if other not in variables:
                raise DescriptionError(f"{where}: refers to '{other}', which is not declared")
        for other in v.get("parameters", []):
            if variables[other]["causality"] != "parameter":
                raise DescriptionError(f"{where}: '{other}' is not a parameter")
    independent = [n for n, v in variables.items() if v["causality"] == "independent"]
    if len(independent) > 1:
        where = variables[independent[1]]["where"]
        raise DescriptionError(f"{where}: there is an independent variable already, time")
    knowns = [*states(variables), *inputs(variables), "time"]
    for v in variables.values():
        if is_unknown(v) and "dependencies" not in v:
            raise DescriptionError(f"{v['where']}: lacks dependencies")
        for other in v.get("dependencies", []):
            if other not in knowns:
                raise DescriptionError(f"{v['where']}: '{other}' is no input, state or time")


def states(variables: Table) -> list[str]:
    """Names of the continuous states: what other variables are the derivatives of."""
    return [v["derivative_of"] for v in variables.values() if "derivative_of" in v]


def inputs(variables: Table) -> list[str]:
    """Names of the inputs."""
    return [name for name, v in variables.items() if v["causality"] == "input"]


def is_unknown(v: Table) -> bool:
    """Tell whether ModelStructure lists the variable."""
    return v["causality"] == "output" or "derivative_of" in v
