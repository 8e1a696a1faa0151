"""Refusals when initialization ends, with the values in one line; ranges: fmu/test_ranges.py."""

import ctypes
import re

import pytest

from tests.rp_plant.plant_in_c import COMPLIANT, NONE, RELEASED, RIGID, PlantInC
from tests.support.paths import ROOT

HEADER = (ROOT / "src" / "model" / "status.h").read_text(encoding="utf-8")
STATUSES = re.findall(r"X\((STATUS_\w+)", HEADER)

INERTIA = "the inertia m1 lc1^2 + I1z + I2z is refused: it must be above 0 "
INERTIA += "(m1 = 0, lc1 = 0.25, I1z = 0, I2z = 0)"
BREAKAWAY = "breakaway_friction1 = 1.5 is refused: it must not be below coulomb_friction1 = 2 "
BREAKAWAY += "(0: the same)"
STRIBECK = "stribeck_velocity2 = 0 is refused: it must be above 0 where "
STRIBECK += "breakaway_friction2 = 2.5 is above coulomb_friction2 = 2"
LIMITS = "lower2 = 2 and upper2 = 2 are refused: with stops lower2 must be below upper2"
STIFFNESS = "stop_stiffness2 = 0 is refused: with compliant stops it must be above 0"
START = "q2 = {} is refused: a start must be within lower2 = -1 and upper2 = 2"
SOFT = {"stops2": COMPLIANT, "stop_stiffness2": 1e4}
LINK = {"l1": 0.5, "lc1": 0.25, "m1": 1.0, "m2": 1.0, "I1z": 0.1, "I2z": 0.05, "g": 9.81}
CASES = [
    ({}, ""),
    ({"m1": 0.0, "I1z": 0.0, "I2z": 0.0}, INERTIA),
    ({"coulomb_friction1": 2.0}, ""),
    ({"coulomb_friction1": 2.0, "breakaway_friction1": 2.0}, ""),
    ({"coulomb_friction1": 2.0, "breakaway_friction1": 1.5, "stribeck_velocity1": 1.0}, BREAKAWAY),
    ({"coulomb_friction2": 2.0, "breakaway_friction2": 2.5}, STRIBECK),
    ({"coulomb_friction2": 2.0, "breakaway_friction2": 2.5, "stribeck_velocity2": 0.1}, ""),
    ({"lower2": 2.0}, LIMITS),
    ({"lower2": 2.0, "stops2": NONE}, ""),
    ({"lower2": 2.0, "stops2": COMPLIANT}, STIFFNESS),
    ({"lower2": 2.0, **SOFT}, LIMITS),
    (SOFT, ""),
    *[({"q2": q}, "") for q in (-1.0, 0.5, 2.0)],
    *[({"q2": q}, START.format(q)) for q in (-1.5, 2.5)],
    *[({"q2": q, **SOFT}, "") for q in (-1.5, 2.5)],  # in compliant stops it can begin anywhere
    ({"q2": 2.5, "payload": RELEASED}, ""),  # while it runs a limit may pass the joint
]


@pytest.mark.parametrize(("given", "expected"), CASES)
def test_values_are_accepted_or_refused(
    plant_in_c: PlantInC, given: dict[str, float], expected: str
) -> None:
    plant, text = plant_in_c.plant(), ctypes.create_string_buffer(512)
    parameters, limits = plant.parameters, {"stops1": NONE, "stops2": RIGID, "grasp": 1}
    for name, value in {**LINK, **limits, "lower2": -1.0, "upper2": 2.0, **given}.items():
        joint = name[:-1] if name[-1] in "12" else ""
        for part in (plant, parameters, parameters.arm, plant.modes):
            if hasattr(part, name):
                setattr(part, name, value)
            elif joint and hasattr(part, joint) and name not in LINK:
                getattr(part, joint)[int(name[-1]) - 1] = value
    check = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t)
    status = check(plant_in_c.words.check)(ctypes.addressof(plant), text, len(text))
    assert text.value.decode() == expected
    assert STATUSES[status] == ("STATUS_INVALID_PARAMETERS" if expected else "STATUS_OK")
