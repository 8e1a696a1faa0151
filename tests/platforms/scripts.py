"""Writes scripts of FMI calls for platform_host (script.h says how they look).

A script is made from modelDescription.xml, so that the calls of every FMU come from here. Real
numbers are bits: every platform gets the same.
"""

import math
import struct
import xml.etree.ElementTree as ET
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

MODEL_EXCHANGE, CO_SIMULATION = 0, 1
METHODS = (1, 2, 3, 4)  # cvode_adams, cvode_bdf, erk, taylor
# the models that taylor, the last method, can integrate
WITH_SERIES = ("RPManipulator", "RPPlant", "BouncingBall", "DcMotor")
STEPS = 200
VARIANTS = (1, 2, 3)  # of a run


def bits(value: float) -> str:
    """The 16 hex digits of a double."""
    return struct.pack(">d", value).hex()


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
    """What a script needs of modelDescription.xml."""

    name: str
    guid: str
    variables: tuple[Variable, ...]
    states: int
    indicators: int

    def __getitem__(self, name: str) -> Variable:
        return next(v for v in self.variables if v.name == name)

    def reals(self, *causalities: str) -> list[int]:
        """References of Real variables, each once."""
        found = (
            v.reference
            for v in self.variables
            if v.kind == "Real" and (not causalities or v.causality in causalities)
        )
        return list(dict.fromkeys(found))

    @property
    def integers(self) -> list[int]:
        return [v.reference for v in self.variables if v.kind in {"Integer", "Enumeration"}]

    @property
    def booleans(self) -> list[int]:
        return [v.reference for v in self.variables if v.kind == "Boolean"]

    @property
    def boolean_inputs(self) -> list[int]:
        return [
            v.reference for v in self.variables if (v.kind, v.causality) == ("Boolean", "input")
        ]

    @property
    def methods(self) -> tuple[int, ...]:
        """The solver methods that can integrate this model."""
        return METHODS if self.name in WITH_SERIES else METHODS[:-1]

    @property
    def inputs(self) -> list[int]:
        return self.reals("input")

    @property
    def outputs(self) -> list[int]:
        """Those that have derivatives."""
        discrete = {v.reference for v in self.variables if v.variability == "discrete"}
        return [r for r in self.reals("output") if r not in discrete]


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


@dataclass
class Script:
    """Lines of calls, and the status that each has to return."""

    lines: list[str] = field(default_factory=list)
    statuses: list[str] = field(default_factory=list)

    def call(self, name: str, *words: object, expect: str = "OK") -> int:
        """Add a call; returns the number of its line."""
        self.lines.append(" ".join([name, *map(str, words)]))
        self.statuses.append(expect)
        return len(self.lines)

    def extend(self, other: "Script") -> None:
        self.lines += other.lines
        self.statuses += other.statuses

    @property
    def text(self) -> str:
        return "\n".join(self.lines) + "\n"


def joined(*parts: Script) -> Script:
    script = Script()
    for part in parts:
        script.extend(part)
    return script


# ---- Values --------------------------------------------------------------------------------------


def pairs(references: list[int], values: list[float]) -> list[object]:
    """Value references, each with the bits of its value."""
    return [word for r, v in zip(references, values, strict=True) for word in (r, bits(v))]


def input_values(model: Model, step: int, shift: int = 0) -> list[float]:
    """Fractions with small denominators, other ones at every step."""
    return [((step * (7 + 3 * j) + 5 * j + shift) % 23 - 11) / 8 for j in range(len(model.inputs))]


# by name; a list has a value for each variant of a run
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
    "DcMotor": {"R": 1.5, "i": 0.5, "solver_method": [1, 2, 3, 4]},
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


def change(script: Script, model: Model, place: int, variant: int, shift: float = 0.0) -> None:
    """Set start values and parameters; shift is added to the first Real one."""
    for name, value in CHANGED[model.name].items():
        variable = model[name]
        if isinstance(value, list):
            script.call("SetInteger", place, variable.reference, value[variant - 1])
        else:
            script.call("SetReal", place, variable.reference, bits(value + shift))
            shift = 0.0


def get_all(script: Script, model: Model, place: int) -> None:
    script.call("GetReal", place, *model.reals())
    script.call("GetInteger", place, *model.integers)
    if model.booleans:
        script.call("GetBoolean", place, *model.booleans)


def instantiate(
    script: Script, model: Model, place: int, kind: int = CO_SIMULATION, logged: bool = True
) -> None:
    script.call("Instantiate", place, kind, model.guid, int(logged), f"{model.name}{place}")


def initialize(script: Script, place: int, start: float = 0.0, tolerance: str = "-") -> None:
    script.call("SetupExperiment", place, tolerance, bits(start), "-")
    script.call("EnterInitializationMode", place)
    script.call("ExitInitializationMode", place)


# ---- Co-Simulation -------------------------------------------------------------------------------

LENGTHS = (0.01, 1 / 64, 0.003, 0.02, 0.01)  # s, of steps


def derivatives(script: Script, model: Model, place: int) -> None:
    """Of all outputs by time, twice, and by all inputs."""
    orders = [word for r in model.outputs for word in (r, 1, r, 2)]
    script.call("GetRealOutputDerivatives", place, *orders)
    values = [(3 * j + 1) / 4 for j in range(len(model.inputs))]
    known = pairs(model.inputs, values)
    script.call("GetDirectionalDerivative", place, *model.outputs, "/", *known)


def step(script: Script, model: Model, place: int, i: int, time: float, shift: int = 0) -> float:
    """Step number i with its inputs and all values after it; returns the time of its end."""
    if model.inputs and i % 4 != 3:
        script.call("SetReal", place, *pairs(model.inputs, input_values(model, i, shift)))
    if model.inputs and i % 5 == 0:
        slopes = [
            word
            for j, r in enumerate(model.inputs)
            for word in (r, 1 + (i // 5 + j) % 3, bits((i % 13 - 6) / 4))
        ]
        script.call("SetRealInputDerivatives", place, *slopes)
    for boolean in model.boolean_inputs:
        if i % 9 == 4:
            script.call("SetBoolean", place, boolean, 1 - i // 9 % 2)
    length = LENGTHS[i // 7 % len(LENGTHS)]
    script.call("DoStep", place, bits(time), bits(length))
    get_all(script, model, place)
    return time + length


def co_simulation(
    model: Model, variant: int, shift: float = 0.0, places: tuple[int, int] = (0, 1)
) -> Script:
    """All steps, with derivatives, rollbacks and moves to a second instance by serialization."""
    script = Script()
    place, other = places
    instantiate(script, model, other)
    instantiate(script, model, place)
    change(script, model, place, variant, shift)
    time = 0.5
    script.call("SetupExperiment", place, bits(1e-6), bits(time), "-")
    script.call("EnterInitializationMode", place)
    get_all(script, model, place)
    parameters = [
        v.reference
        for v in model.variables
        if v.causality == "parameter" and v.variability == "tunable"
    ]
    for parameter in parameters:
        if parameter in model.reals():
            script.call(
                "GetDirectionalDerivative", place, *model.outputs, "/", parameter, bits(1.0)
            )
    script.call("ExitInitializationMode", place)
    get_all(script, model, place)
    for i in range(STEPS):
        if i == 80 and parameters:
            script.call("SetReal", place, parameters[0], bits(2.125))
        if i % 60 == 59:
            rollback(script, model, places, i, time)
        time = step(script, model, place, i, time)
        if i % 10 == 0:
            derivatives(script, model, place)
    script.call("GetRealStatus", place, 2)
    script.call("Terminate", place)
    get_all(script, model, place)
    script.call("FreeInstance", place)
    script.call("FreeInstance", other)
    return script


def rollback(script: Script, model: Model, places: tuple[int, int], i: int, time: float) -> None:
    """Steps that are undone, and the same steps in the second instance."""
    place, other = places
    script.call("GetFMUstate", place, place)
    script.call("SerializedFMUstateSize", place, place)
    script.call("SerializeFMUstate", place, place, place)
    script.call("DeSerializeFMUstate", other, place, other)
    script.call("SetFMUstate", other, other)
    for each in (place, other):
        later = time
        for k in range(3):
            later = step(script, model, each, i + k, later, shift=9)
    script.call("SetFMUstate", place, place)
    get_all(script, model, place)
    script.call("FreeFMUstate", place, place)
    script.call("FreeFMUstate", other, other)


# ---- Model Exchange ------------------------------------------------------------------------------


def model_exchange(model: Model) -> Script:
    """Euler's method with steps of a power of two, with events and a rollback."""
    script = Script()
    place = 2
    length = 1 / 256
    instantiate(script, model, place, MODEL_EXCHANGE)
    change(script, model, place, 1)
    initialize(script, place)
    script.call("NewDiscreteStates", place)
    script.call("GetNominalsOfContinuousStates", place, model.states)
    script.call("EnterContinuousTimeMode", place)
    for i in range(STEPS):
        if i % 50 == 49:
            script.call("EnterEventMode", place)
            for boolean in model.boolean_inputs:
                script.call("SetBoolean", place, boolean, 1 - i // 50 % 2)
            script.call("NewDiscreteStates", place)
            script.call("EnterContinuousTimeMode", place)
        if i == 100:
            script.call("GetFMUstate", place, place)
        script.call("SetTime", place, bits(i * length))
        if model.inputs:
            script.call("SetReal", place, *pairs(model.inputs, input_values(model, i)))
        script.call("GetEventIndicators", place, model.indicators)
        script.call("GetDerivatives", place, model.states)
        script.call("Euler", place, model.states, bits(length))
        get_all(script, model, place)
    script.call("SetFMUstate", place, place)
    script.call("GetContinuousStates", place, model.states)
    script.call("SerializeFMUstate", place, place, place)
    script.call("Terminate", place)
    script.call("FreeInstance", place)
    return script


# ---- Messages ------------------------------------------------------------------------------------

# quiet and signalling NaN of both signs, as bits: Python would make all of them quiet
NOT_FINITE = (
    "7ff8000000000000", "fff8000000000000", "7ff0000000000001", "fff8dead0000beef",
    bits(math.inf), bits(-math.inf),
)  # fmt: skip
EXTREME = (1e300, -1e300, 5e-324, 1e22, 100000.5, 1000000.5, 2.5, 0.1, 1 / 3, 123456789.0)
CATEGORIES = (
    "logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal",
    "logAll",
)  # fmt: skip


def messages(model: Model) -> Script:
    """Refused numbers, steps with too many internal steps, and the log by categories."""
    script = Script()
    place = 3
    instantiate(script, model, place)
    parameter = next(v for v in model.variables if (v.kind, v.causality) == ("Real", "parameter"))
    for digits in NOT_FINITE:
        script.call("SetReal", place, parameter.reference, digits, expect="Discard")
        script.call("Reset", place)
    times = [pair for x in NOT_FINITE for pair in ((bits(0.0), x), (x, bits(0.1)))]
    times += [(bits(value), bits(-abs(value))) for value in EXTREME]
    for time, length in times:
        initialize(script, place)
        script.call("DoStep", place, time, length, expect="Error")
        script.call("Reset", place)
    for method in model.methods if model.states else ():
        script.call("SetInteger", place, model["max_internal_steps"].reference, 2)
        script.call("SetInteger", place, model["solver_method"].reference, method)
        initialize(script, place)
        script.call("SetReal", place, *pairs(model.inputs, [0.3] * len(model.inputs)))
        script.call("DoStep", place, bits(0.0), bits(10.0), expect="Discard")
        script.call("GetRealStatus", place, 2)
        get_all(script, model, place)
        script.call("Reset", place)
    script.call("FreeInstance", place)
    for name in ("plain", "ünïcödé", "100%d#r1#"):
        script.call("Instantiate", 0, CO_SIMULATION, model.guid, 1, name)
        script.call("SetDebugLogging", 0, 1, "logN%sthing#r1#", expect="Error")
        script.call("FreeInstance", 0)
    script.call("Instantiate", 0, CO_SIMULATION, model.guid, 0, "logger")
    for on, *categories in ((1,), (0,), *((1, c) for c in CATEGORIES), (0, "logAll")):
        script.call("SetDebugLogging", 0, on, *categories)
        script.call("SetupExperiment", 0, bits(1e-2), bits(0.1), "-")
        script.call("EnterInitializationMode", 0)
        script.call("ExitInitializationMode", 0)
        script.call("DoStep", 0, bits(0.1), bits(0.1))
        script.call("GetStatus", 0, 0, expect="Discard")
        script.call("DoStep", 0, bits(0.1), bits(0.1), expect="Error")
        script.call("Reset", 0)
    script.call("FreeInstance", 0)
    return script


def everything(model: Model) -> Script:
    """Return one script with all that a platform may do differently."""
    return joined(
        *(co_simulation(model, variant) for variant in VARIANTS),
        model_exchange(model),
        messages(model),
    )


# ---- States that go to another platform ----------------------------------------------------------


def save(model: Model, variant: int, steps: int) -> tuple[Script, float]:
    """Some steps and the serialized state after them, in the last line; and the time then."""
    script = Script()
    instantiate(script, model, 0, logged=False)
    change(script, model, 0, variant)
    initialize(script, 0)
    time = 0.0
    for i in range(steps):
        time = step(script, model, 0, i, time)
    script.call("GetFMUstate", 0, 0)
    script.call("SerializeFMUstate", 0, 0, 0)
    return script, time


def go_on(model: Model, steps: int, time: float) -> Script:
    """Further steps, of the instance that save has left."""
    script = Script()
    for i in range(steps, 2 * steps):
        time = step(script, model, 0, i, time)
    script.call("FreeInstance", 0)
    return script


def restore(model: Model, state: str) -> Script:
    """A new instance in a state from elsewhere, given as hex digits."""
    script = Script()
    instantiate(script, model, 0, logged=False)
    script.call("bytes", 0, state)
    script.call("DeSerializeFMUstate", 0, 0, 0)
    script.call("SetFMUstate", 0, 0)
    return script
