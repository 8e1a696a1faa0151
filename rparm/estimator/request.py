"""What the file of an estimator asks for: its plant, what is measured, and standard deviations."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rparm.errors import UserError, WrongValueError, did_you_mean
from rparm.files import NAME, read_toml, show
from rparm.fmu_tools.compiler.read.content import FOLLOWS, ModelFile, ModelFileError, Variable
from rparm.fmu_tools.compiler.read.include import source_of
from rparm.fmu_tools.compiler.read.model_file import read
from rparm.units import SECONDS, quantity, units_of

PLANT = "estimator"  # the key that makes a file one of an estimator
DEVIATIONS = ("measure", "noise", "start", "unknown")
KEYS = ("name", "description", PLANT, "every", "offset", *DEVIATIONS, "sigma")
NEEDED = ("name", PLANT, "every", "measure")
NAMED = {  # sections whose real variables a key names
    "measure": (("states", "outputs"), "an output"),
    "sigma": (("states", "outputs"), "an output"),
    "noise": (("inputs",), "an input"),
    "start": (("states",), "a state"),
    "unknown": (("parameters",), "a parameter"),
}
SHORTEST = 1e-9  # s, of periods
SMALLEST, LARGEST = 1e-100, 1e100  # standard deviations whose squares are doubles
REFUSED = {  # sections of plants
    "friction": "sticks in ways that no covariance describes",
    "stops": "hits in ways that this filter does not follow: write an event",
    "gradients": "is for the plant itself: leave it out of the filter's plant",
    "hook": "has events in C, whose jumps cannot be derived",
    "components": "is not supported: write the plant in one file",
}


@dataclass
class Request:
    """The file, checked against its plant; standard deviations are in SI."""

    path: Path
    name: str
    description: str
    every: float  # s
    offset: float  # s, of the first measurement from the start
    plant: ModelFile
    tables: dict[str, Any]  # of the plant, with what it includes
    measure: dict[str, float] = field(default_factory=dict)  # in the order of the updates
    noise: dict[str, float] = field(default_factory=dict)  # of inputs
    start: dict[str, float] = field(default_factory=dict)  # of states at the start
    unknown: dict[str, float] = field(default_factory=dict)  # of parameters
    sigma: list[str] = field(default_factory=list)  # further outputs whose deviation is wanted


def is_estimator(content: Iterable[str]) -> bool:
    """Return whether a TOML file with these keys describes an estimator."""
    return PLANT in content


def load(path: Path) -> Request:
    """Read and check the file of an estimator; UserError."""
    given = read_toml(path)
    _check(path, given)
    every = _time(path, "every", given["every"])
    offset = _time(path, "offset", given.get("offset", 0.0))
    if every < SHORTEST:
        raise UserError(
            f"{path}: every: expected {SHORTEST:g} s or more, got {show(given['every'])}"
        )
    if offset < 0:
        raise UserError(f"{path}: offset: expected 0 or more, got {show(given['offset'])}")
    plant, tables = _plant(path, given[PLANT])
    if given["name"] == plant.name:
        what = f"{plant.path.name} has this name, too, and their FMUs would be one file"
        raise UserError(f"{path}: name: {given['name']}: {what}: choose another one")
    about = given.get("description", "")
    found = Request(path, given["name"], about, every, offset, plant, tables)
    for key in DEVIATIONS:
        for name, sigma in given.get(key, {}).items():
            variable = _variable(path, key, name, plant)
            getattr(found, key)[name] = _deviation(path, f"{key}: {name}", sigma, variable)
    if not found.measure:
        what = "expected outputs of the plant, each with its standard deviation"
        raise UserError(f"{path}: measure: {what}")
    found.sigma = given.get("sigma", [])
    for name in found.sigma:
        _variable(path, "sigma", name, plant)
    return found


def _check(path: Path, given: Mapping[str, Any]) -> None:
    """Check the keys, and the kinds of their values; UserError."""
    wrong = ""
    for key in given:
        if key not in KEYS:
            guess = did_you_mean(key, KEYS) or f", expected one of {', '.join(KEYS)}"
            raise UserError(f"{path}: unknown key {show(key)}{guess}")
    for key in NEEDED:
        if key not in given:
            raise UserError(f"{path}: {key} is missing")
    for key in DEVIATIONS:
        if not isinstance(given.get(key, {}), dict):
            wrong = f"{key}: expected a table such as {{ phi = 0.02 }}, got {show(given[key])}"
    name, about, further = given["name"], given.get("description", ""), given.get("sigma", [])
    if not isinstance(name, str) or not NAME.fullmatch(name):
        wrong = f"name: expected a letter, then letters, digits, _, got {show(name)}"
    if not isinstance(about, str):
        wrong = f"description: expected a text, got {show(about)}"
    if not isinstance(further, list) or not all(isinstance(name, str) for name in further):
        wrong = f"sigma: expected a list of outputs, got {show(further)}"
    if wrong:
        raise UserError(f"{path}: {wrong}")


def _plant(path: Path, given: object) -> tuple[ModelFile, dict[str, Any]]:
    """Read the plant; UserError for one that has no such filter."""
    if not isinstance(given, str) or not given.lower().endswith(".toml"):
        raise UserError(f"{path}: {PLANT}: expected a plant such as plant.toml, got {show(given)}")
    file = path.parent / given
    if not file.is_file():
        raise UserError(f"{path}: {PLANT}: {file}: no such file")
    content = read_toml(file)
    if is_estimator(content):
        raise UserError(f"{path}: {PLANT}: {file} is an estimator itself, expected its plant")
    try:
        tables = source_of(file).tables
        for section, why in REFUSED.items():
            if section in tables:
                raise UserError(f"{path}: {PLANT}: {file}: [{section}] {why}")
        plant = read(file)
    except ModelFileError as error:
        raise UserError(f"{path}: {PLANT}: {error}") from None
    if not plant.of("states"):
        raise UserError(f"{path}: {PLANT}: {file} has no states to estimate")
    return plant, tables


def _variable(path: Path, key: str, name: str, plant: ModelFile) -> Variable:
    """Return the variable that a key names; UserError for one that it cannot name."""
    sections, what = NAMED[key]
    known = {v.name: v for v in plant.of(*sections) if v.is_real}
    if name in known:
        if key == "unknown" and "[" in name:
            raise UserError(f"{path}: unknown: {name}: elements of arrays cannot be estimated")
        return known[name]
    other, wanted = plant.variables.get(name), f"expected {what} of {plant.path.name}"
    if other is None:
        elements = [x for x in known if x.startswith(f"{name}[")]
        guess = f", did you mean '{elements[0]}'?" if elements else did_you_mean(name, known)
        what = what.split()[1]
        raise UserError(f"{path}: {key}: {plant.path.name} has no such {what}: {name}{guess}")
    follows = other.section == FOLLOWS
    where = "a parameter that follows from others" if follows else f"of {other.place}"
    if other.section in sections or not other.is_real:
        where = "no real number"
    raise UserError(f"{path}: {key}: {name} is {where}, {wanted}")


def _time(path: Path, place: str, given: object) -> float:
    """Return a time in s; UserError unless it is a finite number."""
    try:
        value = quantity(given, SECONDS)
        if math.isfinite(value):
            return value
        raise WrongValueError(f"expected a finite number, got {show(given)}")
    except WrongValueError as error:
        raise UserError(f"{path}: {place}: {error}") from None


def _deviation(path: Path, place: str, given: object, variable: Variable) -> float:
    """Return a standard deviation in SI; UserError unless it is above 0 and has a square."""
    try:
        value = quantity(given, units_of(variable.unit or None, {}), is_difference=True)
    except WrongValueError as error:
        raise UserError(f"{path}: {place}: {error}") from None
    if not value > 0:
        what = "expected a standard deviation above 0"
        raise UserError(f"{path}: {place}: {what}, got {show(given)}")
    if not SMALLEST <= value <= LARGEST:
        what = f"expected a standard deviation from {SMALLEST:g} to {LARGEST:g}"
        raise UserError(f"{path}: {place}: {what}, got {show(given)}")
    return value
