"""RPActuator.fmu: values of the equations, worth of its scenarios.

The closed forms are in test_rp_actuator.c.
"""

import random

import numpy as np
import pytest

from rparm.runs import comparison
from tests.support.instances import Instance, LoadedFmu
from tests.support.paths import ROOT
from tests.support.rparm_project import declared, load, names_of

UNIT = "RPActuator"

FOLDER = ROOT / "models" / "rp_actuator"
SCENARIOS = names_of(FOLDER.name)

PER_JOINT = (
    "torque_constant", "gear_ratio", "resistance", "current_max", "voltage_max", "time_constant",
)  # fmt: skip
PARAMETERS = tuple(f"{name}{joint}" for name in PER_JOINT for joint in (1, 2))
INPUTS = ("tau1_cmd", "f2_cmd", "dq1", "dq2")
KNOWNS = (*PARAMETERS, *INPUTS, "current1", "current2")
LIMITS = ("command", "current", "voltage")

Values = dict[str, float]


# ---- Values --------------------------------------------------------------------------------------


def random_point(limit: str, seed: int) -> Values:
    """A point at which the command or a limit decides both currents."""
    source = random.Random(f"{limit} {seed}")
    point = {name: source.uniform(0.5, 2.0) for name in KNOWNS}
    for joint in (1, 2):
        point[f"gear_ratio{joint}"] *= source.choice((-1.0, 1.0))
        point[f"dq{joint}"] *= source.choice((-1.0, 1.0))
        point[f"current_max{joint}"] *= 1e4 if limit == "voltage" else 32.0
        point[f"voltage_max{joint}"] *= 1e5 if limit == "current" else 128.0
    if limit != "command":
        for name in INPUTS[:2]:
            point[name] *= source.choice((-1e6, 1e6))
    return point


def expected(point: Values, limit: str) -> dict[str, float]:
    """All calculated variables where `limit` decides the currents."""
    result = {}
    for joint, (command, effort) in enumerate((("tau1_cmd", "tau1"), ("f2_cmd", "f2")), start=1):
        k, n, resistance, i_max, u_max, time_constant = (
            point[f"{name}{joint}"] for name in PER_JOINT
        )
        current, back_emf = point[f"current{joint}"], n * k * point[f"dq{joint}"]
        commanded = point[command] / (n * k)
        limited = {
            "command": commanded,
            "current": np.copysign(i_max, commanded),
            "voltage": (np.copysign(u_max, commanded) - back_emf) / resistance,
        }[limit]
        result |= {
            effort: n * k * current,
            f"current{joint}": current,
            f"voltage{joint}": resistance * current + back_emf,
            f"dcurrent{joint}": (limited - current) / time_constant,
            f"current{joint}_limited": limited,
        }
    return result


@pytest.mark.parametrize("limit", LIMITS)
def test_values_are_those_of_the_equations(loaded: LoadedFmu, limit: str) -> None:
    for seed in range(20):
        point = random_point(limit, seed)
        values = expected(point, limit)
        with Instance(loaded).begin(**point) as instance:
            assert instance.get(*values) == pytest.approx([*values.values()], rel=1e-12)


# ---- References ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "joint", "limits"),
    [
        ("actuator_torque_steps", 2, {"current"}),
        ("actuator_torque_speed", 1, {"current", "voltage"}),
        ("actuator_torque_speed", 2, {"current", "voltage", "both"}),
        ("actuator_limits_irregular", 1, {"command", "current", "voltage"}),
        ("actuator_limits_irregular", 2, {"command", "current", "voltage"}),
    ],
)
def test_scenarios_meet_the_limits(name: str, joint: int, limits: set[str]) -> None:
    """Each limit decides at 5 communication points or more, and so it is left again."""
    scenario = load(name)
    value = scenario.start_values
    k, n, resistance, i_max, u_max, _ = (value[f"{p}{joint}"] for p in PER_JOINT)
    commanded = scenario.input("tau1_cmd" if joint == 1 else "f2_cmd") / (n * k)
    back_emf = n * k * scenario.input(f"dq{joint}")
    needed = resistance * np.clip(commanded, -i_max, i_max) + back_emf
    decides = {
        "both": np.abs(back_emf) > u_max + resistance * i_max,
        "voltage": (np.abs(needed) > u_max) & (np.abs(back_emf) < u_max + resistance * i_max),
        "current": (np.abs(commanded) > i_max) & (np.abs(needed) < u_max),
        "command": (np.abs(commanded) < i_max) & (np.abs(needed) < u_max),
    }
    for limit in limits:
        assert 5 <= decides[limit].sum() < len(commanded), limit


def test_currents_of_the_scenarios_end_within_their_limit() -> None:
    for name in SCENARIOS:
        scenario = load(name)
        table = comparison.load_reference(scenario, declared(FOLDER.name))
        for joint in (1, 2):
            limit = scenario.start_values[f"current_max{joint}"]
            settled = scenario.times[scenario.reference_rows] > scenario.start + 0.04
            assert np.abs(table.column(f"current{joint}")[settled]).max() <= limit * 1.0001
