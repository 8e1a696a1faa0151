"""Values that all FMUs refuse in both versions: out of their ranges, or not fitting each other.

All cases of the latter are in the C tests of each model; here the model's words reach the importer.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from math import inf, isfinite, nan
from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu

# by unit: values, each beyond a limit that its model needs
BEYOND = {
    "RPController": {
        "Kp1": [-1.0], "Ki2": [-1e-9], "inertia1": [0.0], "tracking_time": [0.0],
        "f2_max": [-1.0], "mode": [0, 4], "sample_time": [-1e-3], "delay": [-1e-3],
        "payload_mass": [-1e-3], "payload_inertia": [-1e-3],
    },
    "RPActuator": {
        f"{name}{joint}": [0.0, -1.5, 1e-10, inf, nan] for joint in (1, 2)
        for name in ("torque_constant", "resistance", "current_max", "voltage_max", "time_constant")
    },
    "RPTrajectory": {
        "radius": [-0.1], "turns": [-1.0], "ramp_time": [0.0], "duration": [0.0],
        "motion": [0, 4], "branch": [0, 3],
    },
    "RPEnvironment": {
        **{name: [nan] for name in ("angle", "tip_x", "tip_z", "ee_x", "ee_y", "ee_vx", "ee_vy",
                                    "ee_angle", "ee_rate")},
        "stiffness": [-1.0, nan], "damping": [-0.25, nan], "position": [inf, nan],
    },
    "RPSensor": {
        "sample_time": [0.0, 9.99e-7, -0.001, nan, inf, -inf], "latency": [-1, 65],
        "resolution1": [0.0, nan, inf, -inf], "resolution2": [-1e-6], "noise1": [-1e-9],
        "noise2": [-1.0, nan, inf, -inf], "q1": [nan, inf, -inf],
    },
    "RPPlant": {
        **{f"{name}{joint}": [-0.1] for joint in (1, 2) for name in (
            "armature", "damping", "coulomb_friction", "breakaway_friction", "stribeck_velocity",
            "stop_stiffness", "stop_damping")},
        "restitution1": [1.1], "restitution2": [-0.1], "stops1": [4], "stops2": [0],
        "payload_mass": [-0.1], "payload_inertia": [-0.1], "grasp": [3], "max_events": [0],
        "lower1": [nan], "upper2": [inf],
    },
}  # fmt: skip
CASES = [
    (unit, name, value)
    for unit, names in BEYOND.items()
    for name, values in names.items()
    for value in values
]


@pytest.fixture(scope="module")
def opened_unit(fmu: Path) -> Iterator[Callable[[str], Fmu]]:
    """Opens FMUs by their paths below the folder of the build, each once."""
    with ExitStack() as stack:
        yield cache(lambda name: stack.enter_context(Fmu(fmu.parent / name)))


@pytest.mark.parametrize("below", ["", "fmi3/"])
@pytest.mark.parametrize(("unit", "name", "value"), CASES)
def test_values_out_of_range_are_refused(
    opened_unit: Callable[[str], Fmu], below: str, unit: str, name: str, value: float
) -> None:
    opened = opened_unit(f"{below}{unit}.fmu")
    start = opened.model.variables[name].start
    with opened.instance("unit") as instance:
        with pytest.raises(UserError):
            instance.set(name, value)
        message = instance.messages[-1]
        assert f"{name} = {value:g} is refused" in message
        assert ": a value from " in message or not isfinite(value)
        instance.set_up(0.0, None)
        instance.enter_initialization()
        instance.exit_initialization()
        if isinstance(value, float) and start is not None:
            reals = instance.reals([name])
            reals.get()
            assert reals.view.item() == start


TOGETHER = [
    ("RPController", {"m1": 0.0, "I1z": 0.0, "I2z": 0.0}, "m1 lc1^2 + I1z + I2z = 0 is refused"),
    ("RPController", {"delay": 0.001},
     "delay = 0.001 s is refused: it must not be above sample_time = 0 s"),
    ("RPActuator", {"gear_ratio2": 0.0},
     "gear_ratio2 = 0 is refused: its magnitude must be 1e-09 or more"),
    ("RPTrajectory", {"turns": 0.25, "frequency": -0.5, "ramp_time": 0.75},
     "turns / |frequency| = 0.5 s is refused: it must be at least ramp_time = 0.75 s"),
    ("RPPlant", {"stops2": 2, "q2": 0.75}, "q2 = 0.75 is refused: a start must be within lower2"),
]  # fmt: skip


@pytest.mark.parametrize("below", ["", "fmi3/"])
@pytest.mark.parametrize(("unit", "values", "words"), TOGETHER)
def test_values_that_do_not_fit_each_other_are_refused(
    opened_unit: Callable[[str], Fmu], below: str, unit: str, values: dict[str, float], words: str
) -> None:
    with opened_unit(f"{below}{unit}.fmu").instance("unit") as instance:
        instance.set_up(0.0, None)
        for name, value in values.items():
            instance.set(name, value)
        with pytest.raises(UserError) as refusal:
            instance.enter_initialization()
            instance.exit_initialization()
        assert words in str(refusal.value)
