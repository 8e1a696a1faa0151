"""RPSensor.fmu: what is refused, event mode, scenarios."""

from pathlib import Path

import fmpy
import numpy as np
import pytest
from rparm.models.rp_sensor.references.make_references import Encoder

from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from tests.rp_sensor.sensor_runs import COUNTS, MODEL, start_values, started
from tests.support.instances import DISCARD, Instance, LoadedFmu, instantiated, status_of
from tests.support.rparm_project import declared, fmi3_fmu, load, names_of

SCENARIOS = names_of(MODEL.name)

# ---- What is refused ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", start_values())
def test_parameters_are_fixed(sensor: Fmu, name: str) -> None:
    with started(sensor) as instance, pytest.raises(UserError):
        instance.set(name, declared(MODEL.name).variables[name].start)


def test_a_start_that_swallows_the_sample_time(sensor: Fmu) -> None:
    with started(sensor, start=1e9) as instance:
        instance.do_step(1e9, 0.0021)
    with (
        pytest.raises(UserError, match="sample_time = 0.001 s is refused: at a start"),
        started(sensor, start=1e10),
    ):
        pass
    with pytest.raises(UserError), started(sensor, start=-1e300, sample_time=1.0):
        pass


def test_positions_that_overflow_within_a_step(fmu: Path, tmp_path: Path) -> None:
    """The step is discarded; from a saved state the instance continues."""
    with Instance(LoadedFmu(fmu.with_name("RPSensor.fmu"), tmp_path), logging_on=True) as instance:
        instance.initialize()
        instance.step(0.0, 0.01)
        state = instance.fmi.getFMUstate()
        instance.set(q1=1e308)
        instance.set_input_derivatives(q1=[1.7e308])
        assert status_of(instance.step, 0.01, 10.0) == DISCARD
        assert "t = 0." in instance.messages[-1].text
        instance.fmi.setFMUstate(state)
        instance.fmi.freeFMUstate(state)
        instance.step(0.01, 10.0)


# ---- FMI 3.0's event mode ----------------------------------------------------------------------

STILL = {"q1": 0.4, "q2": -0.01}


def assert_counts(result: np.ndarray, values: dict[str, float]) -> None:
    """Of joints at STILL, with ticks every 0.00737 s."""
    encoder = Encoder(start_values() | values)
    expected = []
    for _ in range(70):
        encoder.sample([*STILL.values()])
        expected.append(encoder.counts())
    for t, *counts in result:
        ticks = t / 0.00737
        if abs(ticks - round(ticks)) > 1e-6:  # at a tick both rows are right
            assert counts == expected[int(ticks)], t


@pytest.mark.parametrize("event_mode", [False, True])
@pytest.mark.parametrize("early_return", [False, True])
def test_steps_that_return_at_ticks(fmu: Path, event_mode: bool, early_return: bool) -> None:
    """The counts are the same; a step that may return early does so at each tick within it."""
    values = {"sample_time": 0.00737, "noise1": 0.01, "noise2": 1e-4, "seed": 9, "latency": 1}
    result = fmpy.simulate_fmu(
        str(fmi3_fmu(fmu.with_name("RPSensor.fmu"))),
        fmi_type="CoSimulation",
        use_event_mode=event_mode,
        early_return_allowed=early_return,
        stop_time=0.3,
        output_interval=0.01,
        start_values=values | STILL,
        output=COUNTS,
    )
    assert_counts(result, values)
    within = [k * 0.00737 for k in range(1, 41)]
    found = [np.abs(result["time"] - t).min() < 1e-12 for t in within]
    assert all(found) if early_return else not any(found)


def test_inputs_set_at_a_tick_in_event_mode_are_sampled(fmu: Path) -> None:
    path = fmi3_fmu(fmu.with_name("RPSensor.fmu"))
    options = {"early_return_allowed": True, "event_mode_used": True}
    with instantiated(path, "CoSimulation", **options) as (sensor, description):
        reference = {v.name: v.valueReference for v in description.modelVariables}
        sensor.enterInitializationMode(startTime=0.0)
        sensor.setFloat64([reference["resolution1"], reference["sample_time"]], [0.25, 0.125])
        sensor.exitInitializationMode()
        assert sensor.updateDiscreteStates()[-2:] == (True, 0.125)
        sensor.enterStepMode()
        t = 0.0
        for k in range(1, 9):
            has_event, _, early, t = sensor.doStep(t, 2.0 - t)
            assert (bool(has_event), bool(early), t) == (True, True, k * 0.125)
            sensor.enterEventMode()
            sensor.setFloat64([reference["q1"]], [0.25 * k * k])
            assert sensor.getInt32([reference["counts1"]]) == [(k - 1) ** 2]
            assert sensor.updateDiscreteStates()[-2:] == (True, (k + 1) * 0.125)
            assert sensor.getInt32([reference["counts1"]]) == [k * k]
            sensor.enterStepMode()


# ---- Scenarios --------------------------------------------------------------------------------


def test_scenarios_cover_the_parameters() -> None:
    found = [load(name).start_values for name in SCENARIOS]
    for name in set(start_values()) - {"max_internal_steps"}:
        assert len({values[name] for values in found}) > 1, name
