"""Scripts of calls that an FMU must refuse, with the status of FMI 2.0 for each; and of its log."""

import math
import struct

from tests.platforms.scripts import (
    CO_SIMULATION,
    INCONSISTENT,
    METHODS,
    MODEL_EXCHANGE,
    Model,
    Script,
    Variable,
    bits,
    get_all,
    initialize,
    instantiate,
)

PLACE, OTHER = 3, 4


def real(digits: str) -> float:
    return struct.unpack(">d", bytes.fromhex(digits))[0]


# quiet and signalling NaN of both signs, as bits: Python would make all of them quiet
NOT_FINITE = (
    "7ff8000000000000", "fff8000000000000", "7ff0000000000001", "fff8dead0000beef",
    bits(math.inf), bits(-math.inf),
)  # fmt: skip
EXTREME = (1e300, -1e300, 5e-324, 1e22, 100000.5, 1000000.5, 2.5, 0.1, 1 / 3, 123456789.0)


class Refusals(Script):
    """Every refused call is followed by a reset, because an error may leave nothing else."""

    def __init__(self, model: Model) -> None:
        super().__init__()
        self.model = model

    def refuse(self, name: str, *words: object, expect: str = "Error") -> None:
        self.call(name, PLACE, *words, expect=expect)
        self.call("Reset", PLACE)

    def at_step(self, name: str, *words: object, expect: str = "Error") -> None:
        """A call between two steps of a Co-Simulation."""
        initialize(self, PLACE)
        self.refuse(name, *words, expect=expect)

    def in_initialization(self, name: str, *words: object, expect: str = "Error") -> None:
        self.call("SetupExperiment", PLACE, "-", bits(0.0), "-")
        self.call("EnterInitializationMode", PLACE)
        self.refuse(name, *words, expect=expect)


def first(model: Model, **wanted: str) -> Variable | None:
    """A variable whose attributes have these values."""
    return next(
        (v for v in model.variables if all(getattr(v, k) == x for k, x in wanted.items())), None
    )


def refusals(model: Model) -> Script:
    script = Refusals(model)
    instances(script)
    instantiate(script, model, PLACE)
    instantiate(script, model, OTHER)
    states_of_an_instance(script)
    accesses(script)
    experiments(script)
    steps(script)
    derivatives(script)
    snapshots(script)
    script.call("FreeInstance", PLACE)
    exchange(script)
    script.call("FreeInstance", OTHER)
    return script


def instances(script: Refusals) -> None:
    guid = script.model.guid
    for words in (
        (CO_SIMULATION, "{11111111-2222-3333-4444-555555555555}", 1, "unit"),
        (CO_SIMULATION, "-", 1, "unit"),
        (CO_SIMULATION, guid, 1, "-"),
        (7, guid, 1, "unit"),
    ):
        script.call("Instantiate", PLACE, *words, expect="NULL")
    for name in ("DoStep", "SetTime"):
        script.call(name, "-", *[bits(0.0)] * (2 if name == "DoStep" else 1), expect="Error")
    script.call("GetReal", "-", 0, expect="Error")
    script.call("FreeInstance", PLACE)  # of no instance


def states_of_an_instance(script: Refusals) -> None:
    model = script.model
    for name, *words in (
        ("GetReal", 0),
        ("ExitInitializationMode",),
        ("DoStep", bits(0.0), bits(0.1)),
        ("Terminate",),
        ("CancelStep",),
        ("GetStatus", 0),
        ("NewDiscreteStates",),
        ("SetTime", bits(0.0)),
        ("GetContinuousStates", model.states),
    ):
        script.refuse(name, *words)
    for name, *words in (
        ("SetupExperiment", "-", bits(0.0), "-"),
        ("EnterInitializationMode",),
        ("ExitInitializationMode",),
        ("EnterEventMode",),
        ("CancelStep",),
        ("GetDerivatives", model.states),
        ("SetDebugLogging", 1, "logNothing"),
    ):
        script.at_step(name, *words)
    # an error allows no call but those that look, reset or free
    initialize(script, PLACE)
    script.call("DoStep", PLACE, bits(0.0), bits(-1.0), expect="Error")
    script.call("DoStep", PLACE, bits(0.0), bits(0.1), expect="Error")
    script.refuse("SetReal", *[model.inputs[0], bits(1.0)] if model.inputs else [])
    for kind, expect in ((0, "Discard"), (1, "Discard"), (2, "OK"), (3, "Discard")):
        script.at_step("GetRealStatus", kind, expect=expect)
    for name in ("GetStatus", "GetIntegerStatus", "GetStringStatus"):
        script.at_step(name, 0, expect="Discard")
    script.at_step("GetBooleanStatus", 3, expect="OK")


def accesses(script: Refusals) -> None:
    model = script.model
    parameter = first(model, kind="Real", causality="parameter")
    calculated = first(model, kind="Real", causality="output", initial="calculated")
    number = first(model, kind="Enumeration")
    fixed = first(model, kind="Real", causality="parameter", variability="fixed")
    assert parameter and calculated
    known = {variable.reference for variable in model.variables}
    gap = next(n for n in range(100) if n not in known)
    for reference in (gap, 4711, 2_000_000_000):
        script.refuse("SetReal", reference, bits(1.0))
        script.in_initialization("GetReal", reference)
    if number:
        script.in_initialization("GetReal", number.reference)
    script.in_initialization("GetInteger", parameter.reference)
    for name in ("GetBoolean", "GetString"):
        script.in_initialization(name, parameter.reference)
    script.refuse("SetInteger", parameter.reference, 1)
    script.refuse("SetBoolean", parameter.reference, 1)
    script.refuse("SetString", parameter.reference, "text")
    script.refuse("SetReal", calculated.reference, bits(1.0))
    script.refuse("SetReal", model["time"].reference, bits(1.0))
    if fixed:
        script.at_step("SetReal", fixed.reference, bits(1.0))
    for wrong in (-1, 0, METHODS[-1] + 1, 2147483647, -2147483648) if number else ():
        script.refuse("SetInteger", number.reference, wrong, expect="Discard")
    for digits in NOT_FINITE:
        script.refuse("SetReal", parameter.reference, digits, expect="Discard")
        for reference in model.inputs[:1]:
            script.at_step("SetReal", reference, digits, expect="Discard")
    for name, value in INCONSISTENT.get(model.name, {}).items():
        script.call("SetReal", PLACE, model[name].reference, bits(value))
    script.call("SetupExperiment", PLACE, "-", bits(0.0), "-")
    script.call("EnterInitializationMode", PLACE)
    if model.name in INCONSISTENT:
        script.refuse("ExitInitializationMode")


def experiments(script: Refusals) -> None:
    for digits in NOT_FINITE:
        script.refuse("SetupExperiment", "-", digits, "-")
        script.refuse("SetupExperiment", "-", bits(0.0), digits)
        script.refuse("SetupExperiment", digits, bits(0.0), "-")
    for value in EXTREME:
        script.refuse("SetupExperiment", "-", bits(value), bits(-2e300))
        script.refuse("SetupExperiment", bits(-abs(value)), bits(0.0), "-")
    script.refuse("SetupExperiment", bits(0.0), bits(0.0), "-")


def steps(script: Refusals) -> None:
    model = script.model
    for digits in NOT_FINITE:
        script.at_step("DoStep", digits, bits(0.1))
        script.at_step("DoStep", bits(0.0), digits)
    for value in EXTREME:
        script.at_step("DoStep", bits(value), bits(-abs(value)))
        script.at_step("DoStep", bits(0.125 + abs(value)), bits(0.1))
    script.at_step("DoStep", bits(0.0), bits(0.0))
    # does not change the time
    initialize(script, PLACE, start=1e6)
    script.refuse("DoStep", bits(1e6), bits(1e-12))
    # beyond the stop time
    script.call("SetupExperiment", PLACE, "-", bits(0.0), bits(0.25))
    script.call("EnterInitializationMode", PLACE)
    script.call("ExitInitializationMode", PLACE)
    script.call("DoStep", PLACE, bits(0.0), bits(0.2))
    script.refuse("DoStep", bits(0.2), bits(0.2))
    if model.states:
        too_many_steps(script)


def too_many_steps(script: Refusals) -> None:
    """Each method stops on its way, and says where."""
    model = script.model
    for method in METHODS:
        script.call("SetInteger", PLACE, model["max_internal_steps"].reference, 2)
        script.call("SetInteger", PLACE, model["solver_method"].reference, method)
        if method not in model.methods:
            script.call("SetupExperiment", PLACE, "-", bits(0.0), "-")
            script.call("EnterInitializationMode", PLACE)
            script.call("ExitInitializationMode", PLACE, expect="Error")
            script.call("Reset", PLACE)
            continue
        initialize(script, PLACE)
        values = [word for r in model.inputs for word in (r, bits(0.3))]
        script.call("SetReal", PLACE, *values)
        script.call("DoStep", PLACE, bits(0.0), bits(10.0), expect="Discard")
        script.call("GetRealStatus", PLACE, 2)
        get_all(script, model, PLACE)
        script.call("DoStep", PLACE, bits(0.0), bits(0.1), expect="Error")
        script.call("Reset", PLACE)


def derivatives(script: Refusals) -> None:
    model = script.model
    variable = model["time"].reference
    output = next(iter(model.outputs), variable)  # where there is no continuous one: refused, too
    for order in (-1, 0, 3):
        script.at_step("GetRealOutputDerivatives", output, order)
    script.at_step("GetRealOutputDerivatives", variable, 1)
    script.at_step("GetDirectionalDerivative", variable, "/")
    script.at_step("GetDirectionalDerivative", output, "/", 4711, bits(1.0))
    script.at_step("GetDirectionalDerivative", output, "/", output + 500, bits(1.0))
    script.at_step("SetRealInputDerivatives", output, 1, bits(1.0))
    for reference in model.inputs[:1]:
        for order in (-1, 0, 4):
            script.at_step("SetRealInputDerivatives", reference, order, bits(1.0))
        for digits in NOT_FINITE:
            script.at_step("SetRealInputDerivatives", reference, 2, digits, expect="Discard")


def snapshots(script: Refusals) -> None:
    initialize(script, PLACE)
    for call in (("GetFMUstate", 0), ("SerializeFMUstate", 0, 0)):
        script.call(call[0], PLACE, *call[1:])
    script.refuse("SerializeFMUstate", 0, 1, 100)
    script.refuse("GetFMUstate", "-")
    script.refuse("SetFMUstate", "-")
    script.refuse("SetFMUstate", 7)
    for name, words in (
        ("magic", (0, "ff")),
        ("version", (8, "07")),
        ("length", (12, "00")),
        ("GUID", (24, "00")),
        ("contents", (150, "5a")),
    ):
        del name
        script.call("SerializeFMUstate", PLACE, 0, 1)
        script.call("poke", 1, *words)
        script.refuse("DeSerializeFMUstate", 1, 1)
    for size in (0, 1, 20, 100, 300):
        script.call("SerializeFMUstate", PLACE, 0, 1)
        script.call("cut", 1, size)
        script.refuse("DeSerializeFMUstate", 1, 1)
    # a state of another instance
    script.call("SetFMUstate", OTHER, 0, expect="Error")
    script.call("FreeFMUstate", OTHER, 0, expect="Error")
    script.call("Reset", OTHER)
    script.call("FreeFMUstate", PLACE, 0)
    script.call("FreeFMUstate", PLACE, 0)


def exchange(script: Refusals) -> None:
    """Of an instance for Model Exchange."""
    model = script.model
    instantiate(script, model, PLACE, MODEL_EXCHANGE)
    script.at_step("DoStep", bits(0.0), bits(0.1))
    script.at_step("CompletedIntegratorStep")
    script.at_step("GetContinuousStates", model.states + 1)
    script.at_step("GetEventIndicators", model.indicators + 1)
    for digits in NOT_FINITE:
        script.at_step("SetTime", digits, expect="Discard")
    if model.states:
        for digits in (*NOT_FINITE, None):
            initialize(script, PLACE)
            script.call("EnterContinuousTimeMode", PLACE)
            words = [digits or bits(0.0)] * (model.states + (digits is None))
            expect = "Error" if digits is None else "Discard"
            script.refuse("SetContinuousStates", *words, expect=expect)
    # the state of an instance of the other kind
    script.call("GetFMUstate", OTHER, 0)
    script.call("SerializeFMUstate", OTHER, 0, 0)
    script.call("FreeFMUstate", OTHER, 0)
    script.refuse("DeSerializeFMUstate", 0, 0)
    script.call("FreeInstance", PLACE)


# ---- Log -----------------------------------------------------------------------------------------

CATEGORIES = (
    "logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal",
    "logAll",
)  # fmt: skip


def logging(model: Model) -> Script:
    """The same calls with each category, none and all."""
    script = Script()
    script.call("GetVersion", expect="2.0")
    script.call("GetTypesPlatform", expect="default")
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
