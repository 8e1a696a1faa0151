"""RPActuator.fmu: values of the equations, by the drives of the references.

The closed forms are in test_rp_actuator.c.
"""

import random

import pytest
from mpmath import mpf
from rparm.models.rp_actuator.references.make_references import Drive

from tests.support.instances import Instance, LoadedFmu

UNIT = "RPActuator"

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


def expected(point: Values) -> dict[str, float]:
    """All calculated variables."""
    result = {}
    for joint, effort in enumerate(("tau1", "f2"), start=1):
        drive = Drive({name: mpf(x) for name, x in point.items()}, joint)
        current = point[f"current{joint}"]
        result |= {
            effort: drive.constant * current,
            f"current{joint}": current,
            f"voltage{joint}": drive.voltage(current),
            f"dcurrent{joint}": (drive.limited - current) / drive.time_constant,
            f"current{joint}_limited": drive.limited,
        }
    return {name: float(x) for name, x in result.items()}


@pytest.mark.parametrize("limit", LIMITS)
def test_values_are_those_of_the_equations(loaded: LoadedFmu, limit: str) -> None:
    for seed in range(20):
        point = random_point(limit, seed)
        values = expected(point)
        with Instance(loaded).begin(**point) as instance:
            assert instance.get(*values) == pytest.approx([*values.values()], rel=1e-12)
