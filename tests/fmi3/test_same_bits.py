"""The FMUs of FMI 3.0 and 2.0 give the same bits on every scenario, by co-simulation and by model
exchange."""

from collections.abc import Sequence
from pathlib import Path

import fmpy
import numpy as np
import pytest

from rparm.project import model_folder
from rparm.runs.scenario import Scenario
from tests.support.instances import instantiated, set_value
from tests.support.rparm_project import FILES, FMUS, NAMES, fmi3_fmu, load, staircase

MODES = {  # eventModeUsed, earlyReturnAllowed
    "plain": (False, False),
    "early return": (False, True),
    "event mode": (True, False),
    "both": (True, True),
}


def float_names(path: Path) -> list[str]:
    """All floating-point variables."""
    description = fmpy.read_model_description(path)
    return [v.name for v in description.modelVariables if v.type in ("Real", "Float64")]


def run(path: Path, scenario: Scenario, names: Sequence[str], mode: str = "plain") -> np.ndarray:
    """Values (points, names) at all communication points."""
    event_mode, early_return = MODES[mode]
    options = {"event_mode_used": event_mode, "early_return_allowed": early_return}
    with instantiated(path, "CoSimulation", **options) as (fmu, description):
        is_fmi3 = description.fmiVersion != "2.0"
        variables = {v.name: v for v in description.modelVariables}
        references = [variables[name].valueReference for name in names]

        def set_inputs(i: int) -> None:
            for name, values in scenario.inputs.items():
                set_value(fmu, variables[name], values[i].item())

        def values() -> list[float]:
            return (fmu.getFloat64 if is_fmi3 else fmu.getReal)(references)

        start = {"startTime": scenario.start, "stopTime": scenario.stop}
        start["tolerance"] = scenario.tolerance
        if not is_fmi3:
            fmu.setupExperiment(**start)
        for name, value in (scenario.parameters | scenario.initial).items():
            set_value(fmu, variables[name], value)
        fmu.enterInitializationMode(**(start if is_fmi3 else {}))
        set_inputs(0)
        fmu.exitInitializationMode()
        if event_mode:
            fmu.updateDiscreteStates()
            fmu.enterStepMode()
        rows = [values()]
        for i, (time, length) in enumerate(
            zip(scenario.times, np.diff(scenario.times), strict=False)
        ):
            if event_mode:
                fmu.enterEventMode()
            set_inputs(i)
            if event_mode:
                assert fmu.updateDiscreteStates()[:5] == (False,) * 5
                fmu.enterStepMode()
            answer = fmu.doStep(time, length)
            assert not is_fmi3 or answer == (False, False, False, time + length)
            rows.append(values())
        fmu.terminate()
    return np.array(rows)


@pytest.mark.parametrize("name", NAMES)
def test_co_simulation(name: str) -> None:
    path = FMUS[model_folder(FILES[name]).name]
    scenario = load(name)
    names = float_names(fmi3_fmu(path))
    expected = run(path, scenario, names)
    actual = run(fmi3_fmu(path), scenario, names)
    assert expected.shape == (len(scenario.times), len(names))
    np.testing.assert_array_equal(actual.view(np.uint64), expected.view(np.uint64))


@pytest.mark.parametrize("mode", MODES)
def test_event_mode_and_early_return_change_nothing(mode: str) -> None:
    """Where the model has no events."""
    name = "sixtieth"
    path = FMUS["rp_manipulator"]
    scenario = load(name)
    names = float_names(fmi3_fmu(path))
    expected = run(path, scenario, names)
    actual = run(fmi3_fmu(path), scenario, names, mode)
    np.testing.assert_array_equal(actual.view(np.uint64), expected.view(np.uint64))


@pytest.mark.parametrize("name", NAMES)
def test_model_exchange(name: str) -> None:
    """By fmpy's CVode, over the first steps; fmpy gives no tolerance to the FMU."""
    path = FMUS[model_folder(FILES[name]).name]
    scenario = load(name)
    if any(values.dtype == bool for values in scenario.inputs.values()):
        pytest.skip("fmpy's CVode sets Booleans in continuous-time mode")
    points = min(300, len(scenario.times) - 1)
    stop = float(scenario.times[points])
    outputs = [n for n in float_names(fmi3_fmu(path)) if n != "effective_relative_tolerance"]
    results = [
        fmpy.simulate_fmu(
            str(fmu),
            fmi_type="ModelExchange",
            start_time=scenario.start,
            stop_time=stop,
            output_interval=(stop - scenario.start) / 100,
            start_values=scenario.parameters | scenario.initial,
            input=staircase(scenario, points),
            output=outputs,
            relative_tolerance=scenario.tolerance,
        )
        for fmu in (path, fmi3_fmu(path))
    ]
    assert len(results[0]) > 100
    assert results[0].dtype.names == results[1].dtype.names
    for column in results[0].dtype.names:
        np.testing.assert_array_equal(results[1][column], results[0][column], err_msg=column)
