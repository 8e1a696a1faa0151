"""What platform_host needs to know of a model, from modelDescription.xml, and its start values.

Real numbers are given by their bits: every platform gets the same.
"""

import struct
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

METHODS = (1, 2, 3, 4)  # cvode_adams, cvode_bdf, erk, taylor
# the models that taylor, the last method, can integrate
WITH_SERIES = ("RPManipulator", "RPPlant", "BouncingBall", "Rectifier")
VARIANTS = (1, 2, 3)  # of a run
NAMES_OF_SOLVER = ("solver_method", "max_internal_steps")

# By name; a list has a value for each variant of a run.
CHANGED: dict[str, dict[str, float | list[int]]] = {
    "RPManipulator": {
        "m2": 1.25, "a": 0.15, "q1": 0.3, "q2": 0.1, "dq1": -0.4, "dq2": 0.2,
        "solver_method": [1, 2, 3, 4],
    },
    "RPController": {
        "Ki1": 20.0, "Ki2": 10.0, "tau1_max": 300.0, "f2_max": 200.0, "integral1": 0.01,
        "mode": [1, 2, 3, 3], "solver_method": [1, 2, 3, 1],
    },
    "RPActuator": {
        "gear_ratio1": -80.0, "current_max1": 0.25, "voltage_max2": 30.0, "time_constant1": 0.02,
        "current2": 12.0, "solver_method": [1, 2, 3, 1],
    },
    "RPTrajectory": {"start_time": 0.6, "radius": 0.09, "motion": [1, 2, 3, 1]},
    "RPSensor": {
        "noise1": 0.01, "sample_time": 0.003, "resolution1": 1e-4, "latency": [0, 1, 2, 3],
        "seed": [7, -8, 9, 10],
    },
    "BouncingBall": {"e": 0.8, "h": 0.5, "solver_method": [1, 2, 3, 4]},
    "Rectifier": {"R": 1.5, "u": 0.5, "solver_method": [1, 2, 3, 4]},
    "RPEnvironment": {"position": 0.5, "tip_x": 0.1, "stiffness": 2000.0},
    # falls onto its stops, rigid or compliant ones, slides and is held
    "RPPlant": {
        "m2": 1.25, "a": 0.15, "q1": 0.3, "q2": 0.1, "dq1": -0.4, "dq2": 0.2, "g": 2.5,
        "armature1": 0.03, "damping2": 0.2,
        "coulomb_friction1": 0.25, "breakaway_friction1": 0.375, "stribeck_velocity1": 0.1,
        "coulomb_friction2": 0.125, "stops1": [2, 2, 3, 1], "lower1": -0.75, "upper1": 0.5,
        "restitution1": 0.5, "stops2": [2, 3, 2, 3], "lower2": -0.1, "upper2": 0.2,
        "restitution2": 0.625, "stop_stiffness1": 40.0, "stop_damping1": 0.5,
        "stop_stiffness2": 500.0, "stop_damping2": 1.5, "payload_mass": 0.75,
        "payload_inertia": 0.01, "payload_x": 0.05, "payload_z": -0.1, "grasp": [1, 2, 2, 1],
        "solver_method": [1, 2, 3, 1],
    },
}  # fmt: skip


@dataclass(frozen=True)
class Variable:
    name: str
    reference: int
    kind: str  # Real, Integer, Enumeration or Boolean
    causality: str
    variability: str
    initial: str | None


@dataclass(frozen=True)
class Model:
    """What a run needs of modelDescription.xml."""

    name: str
    guid: str
    variables: tuple[Variable, ...]
    states: int
    indicators: int

    def __getitem__(self, name: str) -> Variable:
        return next(v for v in self.variables if v.name == name)

    def references(self, *kinds: str, causality: str = "", variability: str = "") -> list[int]:
        """References of variables, each once."""
        found = (
            v.reference
            for v in self.variables
            if v.kind in kinds
            and causality in ("", v.causality)
            and variability in ("", v.variability)
        )
        return list(dict.fromkeys(found))

    def reals(self) -> list[int]:
        return self.references("Real")

    def text(self) -> str:
        """The file for platform_host: numbers in hex digits, in the order that it reads."""
        discrete = set(self.references("Real", variability="discrete"))
        outputs = self.references("Real", causality="output")
        method, limit = ([self[name].reference] if self.states else [] for name in NAMES_OF_SOLVER)
        methods = METHODS if self.name in WITH_SERIES else METHODS[:-1]
        lists = (
            self.reals(),
            self.references("Integer", "Enumeration"),
            self.references("Boolean"),
            self.references("Real", causality="input"),
            self.references("Boolean", causality="input"),
            [r for r in outputs if r not in discrete],  # which have derivatives
            self.references("Real", causality="parameter", variability="tunable"),
            [*method, *methods] if method else [],
            limit,
        )
        first = self.references("Real", causality="parameter")[0]
        numbers = [self.states, self.indicators, first]
        for references in lists:
            numbers += [len(references), *references]
        changes = CHANGED[self.name]
        numbers.append(len(changes))
        for name, value in changes.items():
            items = [*value, *[0] * 4][:4] if isinstance(value, list) else [bits(value)]
            numbers += [self[name].reference, not isinstance(value, list), *items]
        return f"{self.guid}\n{self.name}\n{joined(numbers)}\n"


def joined(numbers: Iterable[int]) -> str:
    return " ".join(f"{number % 2**64:x}" for number in numbers)


def bits(value: float) -> int:
    """The bits of a double."""
    return int.from_bytes(struct.pack(">d", value))


def read_model(fmu: Path) -> Model:
    with zipfile.ZipFile(fmu) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    variables = tuple(
        Variable(
            element.attrib["name"],
            int(element.attrib["valueReference"]),
            element[0].tag,
            element.attrib.get("causality", "local"),
            element.attrib.get("variability", "continuous"),
            element.attrib.get("initial"),
        )
        for element in root.iter("ScalarVariable")
    )
    states = len(root.findall("ModelStructure/Derivatives/Unknown"))
    indicators = int(root.attrib.get("numberOfEventIndicators", "0"))
    return Model(root.attrib["modelName"], root.attrib["guid"], variables, states, indicators)
