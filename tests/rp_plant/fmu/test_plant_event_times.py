"""Events of the built FMU do not depend on communication points, bit for bit; too many of them.

Rollback across them: test_plant_event_mode.py, and tests/models/test_every_fmu.py by every method.
"""

import random
import re
from pathlib import Path

import pytest

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_runs import (
    BOUNCY_STOPS,
    COMPLIANT,
    FIRM,
    FRICTION,
    METHODS,
    RIGID,
    each_method,
    events,
    last_event,
    started,
)
from tests.support.instances import DISCARD, Instance, LoadedFmu, status_of

# stops that give way, one of them damped
BUFFERS = {
    "stops1": COMPLIANT, "lower1": -0.6, "upper1": 0.9, "stop_stiffness1": 500.0,
    "stops2": COMPLIANT, "lower2": -0.1, "upper2": 0.2, "stop_stiffness2": 4000.0,
    "stop_damping2": 0.5,
}  # fmt: skip


# ---- The same bits of every event time -------------------------------------------------------

MOTIONS = {
    "bounces": BOUNCY_STOPS
    | {"q1": 0.7, "dq2": 0.5, "coulomb_friction1": FIRM, "restitution2": 0.8},
    "slides": FRICTION | {"tau1": 14.0, "f2": 3.0, "dq1": -1.0, "dq2": 0.8},
    "buffers": BUFFERS
    | {"dq1": 1.2, "dq2": -0.8, "coulomb_friction1": 0.5, "coulomb_friction2": 0.5},
    "everything": FRICTION | BOUNCY_STOPS | {"dq1": 1.2, "dq2": -0.4},
}


@pytest.mark.parametrize("method", ["cvode_adams", "cvode_bdf", "taylor"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_later_communication_points_do_not_matter(plant: Fmu, method: str, motion: str) -> None:
    """With constant inputs and the same first step: all event times, and the state at the end."""
    stop, first = 3.0, 1e-3
    with started(plant, method, **MOTIONS[motion]) as instance:
        expected = dict(events(instance, first, stop))
        end = last_event(instance)
    assert end.count >= 3
    for seed in range(4):
        chance = random.Random(seed)
        longest = (2e-3, 0.02, 0.3, 2.0)[seed]
        with started(plant, method, **MOTIONS[motion]) as instance:
            t, h = 0.0, first
            while t < stop:
                instance.do_step(t, h)
                t += h
                event = last_event(instance)
                if event.count > 0:
                    assert event.time == expected.get(event.count, event.time)
                h = min(chance.uniform(1e-6, longest), stop - t) if stop - t > 1e-6 else stop - t
            assert last_event(instance) == end


# ---- Too many events -------------------------------------------------------------------------


@each_method
def test_one_event_too_many_discards_the_step(fmu: Path, tmp_path: Path, method: str) -> None:
    """The message names indicator and time; FMI 2.0 says how far the step came."""
    g, height, e = 9.81, 0.5, 0.5
    t1 = (2 * height / g) ** 0.5
    third = t1 * (1 + 2 * e + 2 * e**2)
    loaded = LoadedFmu(fmu.with_name("RPPlant.fmu"), tmp_path)
    with Instance(loaded) as instance:
        integers = {"solver_method": METHODS[method], "stops2": RIGID, "max_events": 2}
        references = [loaded.references[name] for name in integers]
        instance.fmi.setInteger(references, [*integers.values()])
        start = {"a": 0.0, "q1": 1.5707963267948966, "q2": height, "coulomb_friction1": FIRM}
        limits = {"lower2": 0.0, "upper2": 2.0, "restitution2": e}
        instance.initialize(tolerance=1e-10, **start, **limits)
        before = instance.fmi.getFMUstate()
        assert status_of(instance.fmi.doStep, 0.0, 10.0) == DISCARD
        text = instance.messages[-1].text
        assert "stop2_lower" in text and "max_events = 2" in text
        named = float(text.split("t = ")[1].split(":")[0])
        assert named == pytest.approx(third, rel=0, abs=1e-9)
        assert instance.fmi.getRealStatus(2) == named  # fmi2LastSuccessfulTime
        # a shorter step has fewer of them
        instance.fmi.setFMUstate(before)
        instance.step(0.0, named - 1e-6)
        assert instance.count("event_count") == 2
        instance.step(named - 1e-6, 2e-6)
        assert instance.count("event_count") == 3


def test_the_message_of_both_versions_names_indicator_and_time(plant: Fmu) -> None:
    stops = {"stops2": RIGID, "lower2": 0.0, "upper2": 2.0, "restitution2": 0.5, "max_events": 2}
    with started(plant, q1=1.5, q2=0.5, coulomb_friction1=FIRM, **stops) as instance:
        assert status_of(instance.do_step, 0.0, 10.0) == DISCARD
        assert re.search(
            r"ended at t = 0\.\d+: stop2_lower.* more than max_events = 2", instance.messages[-1]
        )
