"""What the file of an estimator asks for: its plant, what is measured, and standard deviations."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

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
SHORTEST = 1e-9  # s, of periods
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

    def refuse(text: str) -> NoReturn:
        raise UserError(f"{path}: {text}")

    for key in given:
        if key not in KEYS:
            refuse(f"unknown key {show(key)}{did_you_mean(key, KEYS) or f', expected {KEYS}'}")
    for key in NEEDED:
        if key not in given:
            refuse(f"{key} is missing")
    for key in DEVIATIONS:
        if not isinstance(given.get(key, {}), dict):
            refuse(f"{key}: expected a table such as {{ phi = 0.02 }}, got {show(given[key])}")
    if not isinstance(given["name"], str) or not NAME.fullmatch(given["name"]):
        refuse(f"name: expected a letter, then letters, digits, _, got {show(given['name'])}")
    if not isinstance(given.get("description", ""), str):
        refuse(f"description: expected a text, got {show(given['description'])}")
    every = _positive(path, "every", given["every"], None)
    offset = _positive(path, "offset", given["offset"], None) if given.get("offset") else 0.0
    if every < SHORTEST:
        refuse(f"every: expected {SHORTEST:g} s or more, got {show(given['every'])}")
    plant, tables = _plant(path, given[PLANT])
    found = Request(path, given["name"], given.get("description", ""), every, offset, plant, tables)
    for key, what in (
        ("measure", "an output"), ("noise", "an input"), ("start", "a state"),
        ("unknown", "a parameter"),
    ):  # fmt: skip
        known = _known(plant, key)
        for name, sigma in given.get(key, {}).items():
            variable = _variable(path, key, name, known, what, plant)
            getattr(found, key)[name] = _positive(path, f"{key}: {name}", sigma, variable)
    if not found.measure:
        refuse("measure: expected outputs of the plant, each with its standard deviation")
    further = given.get("sigma", [])
    if not isinstance(further, list) or not all(isinstance(name, str) for name in further):
        refuse(f"sigma: expected a list of outputs, got {show(further)}")
    for name in further:
        _variable(path, "sigma", name, _known(plant, "measure"), "an output", plant)
    found.sigma = further
    return found


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


def _known(plant: ModelFile, key: str) -> dict[str, Variable]:
    """Return the variables that a key may name."""
    sections = {
        "measure": ("states", "outputs"), "noise": ("inputs",), "start": ("states",),
        "unknown": ("parameters",),
    }  # fmt: skip
    return {v.name: v for v in plant.of(*sections[key]) if v.is_real}


def _variable(
    path: Path, key: str, name: str, known: Mapping[str, Variable], what: str, plant: ModelFile
) -> Variable:
    if name in known:
        variable = known[name]
        if key == "unknown" and "[" in name:
            raise UserError(f"{path}: unknown: {name}: elements of arrays cannot be estimated")
        return variable
    other = plant.variables.get(name)
    if other is not None:
        where = "a parameter that follows from others" if other.section == FOLLOWS else "one"
        where = f"of {other.place}" if where == "one" else where
        raise UserError(f"{path}: {key}: {name} is {where}, expected {what} of {plant.path.name}")
    guess = did_you_mean(name, known)
    raise UserError(
        f"{path}: {key}: {plant.path.name} has no such {what.split()[1]}: {name}{guess}"
    )


def _positive(path: Path, place: str, given: object, variable: Variable | None) -> float:
    """Return a standard deviation, or a period, in SI; UserError unless it is above 0."""
    known = SECONDS if variable is None else units_of(variable.unit or None, {})
    try:
        value = quantity(given, known, is_difference=True)
    except WrongValueError as error:
        raise UserError(f"{path}: {place}: {error}") from None
    if not 0 < value < math.inf:
        what = "a period" if variable is None else "a standard deviation"
        raise UserError(f"{path}: {place}: expected {what} above 0, got {show(given)}")
    return value
