"""How near the machine's samples are to others: the references hold as long as none of them flips.

A position that falls to another count, or a tick that falls to another step, makes another motion,
which differs by the size of a count. So errors must be below the margins, tick by tick.
"""

from fractions import Fraction

import numpy as np
import pytest
from rparm.models.machine.experiment import STEPS_PER_SECOND, STOP
from rparm.models.machine.references import make_references

from tests.support.systems import MACHINE_SYSTEM as MACHINE

LEAST = 4.0  # times the error that a margin is, at the worst sample
CLEAR = 100.0  # times the largest error that the margins of all samples are that are not listed
PARAMETERS = make_references.variants()
RESOLUTION = {1: 2 * np.pi / 2**20, 2: 1.25e-6}  # rad, m


@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize("variant", MACHINE.variants)
def test_no_count_is_near_enough_to_flip(variant: str, joint: int) -> None:
    """The samples with the least margins one by one, all others against the largest error."""
    tightest, result = MACHINE.reference(variant, "tightest.csv"), MACHINE.run(variant)
    margins = tightest[f"margin{joint}"]
    assert 0 < margins.min() < 1e-3 * RESOLUTION[joint]  # of 4000 samples one is that near
    rows = np.rint(tightest["time"] * STEPS_PER_SECOND).astype(int)
    errors = np.abs(result[f"plant.q{joint}"][rows] - tightest[f"plant.q{joint}"])
    assert np.all(margins > LEAST * errors)
    # those that are left out have larger margins than any of the 200 that are in
    others = np.sort(margins)[make_references.TIGHTEST - 1]
    every = MACHINE.reference(variant)
    rows = np.rint(every["time"] * STEPS_PER_SECOND).astype(int)
    largest = np.abs(result[f"plant.q{joint}"][rows] - every[f"plant.q{joint}"]).max()
    assert others > CLEAR * max(largest, errors.max())


@pytest.mark.parametrize("variant", MACHINE.variants)
def test_ticks_and_changes_of_efforts_are_between_the_points(variant: str) -> None:
    """Exactly, against what rounding does to the times of an engine that sums up steps."""
    summed = np.cumsum(np.full(MACHINE.steps, 1 / STEPS_PER_SECOND))
    rounding = np.abs(summed - np.arange(1, MACHINE.steps + 1) / STEPS_PER_SECOND).max()
    parameters = PARAMETERS[variant]
    step, stop = Fraction(1, STEPS_PER_SECOND), Fraction(STOP)
    clocks = [("sensor", Fraction(0))]
    if parameters["controller.sample_time"] > 0:
        delay = Fraction(parameters["controller.delay"])
        clocks += [("controller", Fraction(0)), ("controller", delay)]
    for component, offset in clocks:
        period = Fraction(parameters[f"{component}.sample_time"])
        times = [offset + k * period for k in range(1, int(stop / period) + 1)]
        margin = min(abs(time - round(time / step) * step) for time in times)
        assert margin > 1e4 * rounding
    for name in ("grasp_time", "release_time"):
        time = Fraction(parameters[f"trajectory.{name}"])
        assert time == 0 or abs(time - round(time / step) * step) > 1e4 * rounding
