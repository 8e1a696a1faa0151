"""The plant in Model Exchange: event mode, and Euler's method, which passes events by up to a step.

test_plant_random_motions.py has motions under CVode.
"""

from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.fmu.plant_model_exchange import STATES, model
from tests.rp_plant.fmu.plant_runs import BOUNCY_STOPS, FRICTION

STEP = 0.01  # s
OUTPUTS = [*STATES, "event_count", "mode1", "mode2"]

# that of the plant, which ends bouncing where CVode can still follow it
COARSE = {"relative_tolerance": 1e-6}
STOPS = BOUNCY_STOPS | {"restitution2": 0.5}
MOTIONS = {
    "both joints": FRICTION | STOPS | {"dq1": 1.2, "dq2": -0.4},
    "thrown out": {"coulomb_friction2": 3.0, "tau1": 2.0, "g": 0.0, "a": 0.0},
    "slides to rest": FRICTION | {"g": 0.0, "dq1": 1.0, "dq2": -0.8},
}


def simulate(
    path: Path, kind: str, stop: float, values: dict[str, float], step: float = STEP, **options: Any
) -> np.ndarray:
    """What fmpy records every `step` (s) up to the time `stop` (s)."""
    return fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        start_values=values,
        output=OUTPUTS,
        stop_time=stop,
        output_interval=step,
        record_events=False,
        **options,
    )


# ---- Event mode ------------------------------------------------------------------------------


def test_what_is_set_in_event_mode_is_no_event(plant: Fmu) -> None:
    """As in Co-Simulation, also where the other joint's motion pulls already."""
    with model(plant.path, coulomb_friction2=3.0, g=0.0, dq1=1.0, tau1=2.0) as instance:
        instance.handle_event({"f2": 5.0})
        assert (instance.get("mode2"), instance.get("event_count")) == (1, 0)
        instance.set_states(np.array([0.0, 0.0, 1.0, 0.0]))
        instance.handle_event({"f2": 0.0})
        assert (instance.get("mode2"), instance.get("event_count")) == (0, 0)


def test_an_effort_set_in_event_mode_can_hold_the_joint(plant: Fmu) -> None:
    with model(plant.path, coulomb_friction2=3.0, g=0.0) as instance:
        instance.set("f2", 4.0)
        instance.handle_event({"f2": 3.0})
        assert (instance.get("mode2"), instance.get("event_count")) == (0, 1)


def test_a_saved_state_holds_the_event_that_is_due(plant: Fmu) -> None:
    """Saved after the importer has entered event mode; it is over where that is left again."""
    with model(plant.path, coulomb_friction2=3.0, g=0.0) as instance:
        fmu = instance.fmu

        def saved() -> bytes:
            return fmu.serializeFMUState(fmu.getFMUState())

        instance.set("f2", 4.0)
        fmu.enterEventMode()
        due = saved()
        fmu.enterContinuousTimeMode()
        fmu.setFMUState(fmu.deserializeFMUState(saved()))
        for f2, mode in (4.0, 1), (3.0, 0):
            fmu.setFMUState(fmu.deserializeFMUState(due))
            instance.update({"f2": f2})
            assert (instance.get("mode2"), instance.get("event_count")) == (mode, 1)


def test_a_joint_past_its_stop_that_leaves_is_no_event(plant: Fmu) -> None:
    """An importer may enter event mode there; the joint is put on its stop and moves on."""
    upper = STOPS["upper2"]
    with model(plant.path, **STOPS, dq2=0.1) as instance:
        for dq, count in (-0.1, 0), (0.1, 1):
            instance.set_states(np.array([0.0, upper + 1e-3, 0.0, dq]))
            instance.handle_event({})
            assert instance.get("q2") == upper
            assert instance.get("event_count") == count
        assert instance.get("dq2") == pytest.approx(-0.1 * STOPS["restitution2"], rel=1e-14)


# ---- Euler's method --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "motion"),
    [("fmi2", "both joints"), ("fmi3", "slides to rest"), ("fmi2", "thrown out")],
    indirect=["version"],
)
def test_the_error_of_eulers_method_falls_with_its_step(plant: Fmu, motion: str) -> None:
    """It passes stops and zeros of velocities by up to a step; joints are put back on them."""
    stop, steps = 0.5, (1e-3, 1e-4)
    values = MOTIONS[motion] | COARSE
    expected = simulate(plant.path, "CoSimulation", stop, values)
    errors = []
    for step in steps:
        found = simulate(
            plant.path, "ModelExchange", stop, values, step, solver="Euler", step_size=step
        )
        for joint in "12":
            if "stops1" in values:
                passed = np.abs(found[f"dq{joint}"]).max() * step
                assert found[f"q{joint}"].min() >= STOPS[f"lower{joint}"] - passed
                assert found[f"q{joint}"].max() <= STOPS[f"upper{joint}"] + passed
            assert set(found[f"mode{joint}"]) <= {-1, 0, 1, 2}
        errors.append(max(abs(found[name][-1] - expected[name][-1]) for name in ("q1", "q2")))
    assert errors[1] < errors[0] / 5
    assert errors[1] < 1e-3
