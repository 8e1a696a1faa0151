"""The FMUs of FMI 3.0 and 2.0 give the same bits on every scenario, by co-simulation and by model
exchange."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import fmi2, fmi3

from cosim.project import model_folder
from cosim.scenarios.scenario import Scenario
from tests.support.cosim_project import FILES, FMUS, NAMES, load

MODES = {  # eventModeUsed, earlyReturnAllowed
    "plain": (False, False),
    "early return": (False, True),
    "event mode": (True, False),
    "both": (True, True),
}


def fmi3_fmu(path: Path) -> Path:
    """The FMU of FMI 3.0 beside one of FMI 2.0."""
    return path.parent / "fmi3" / path.name


def float_names(path: Path) -> list[str]:
    """All floating-point variables."""
    description = fmpy.read_model_description(path)
    return [v.name for v in description.modelVariables if v.type in ("Real", "Float64")]


def references(path: Path) -> dict[str, int]:
    description = fmpy.read_model_description(path)
    return {v.name: v.valueReference for v in description.modelVariables}


@contextmanager
def opened(path: Path, folder: Path, kind: type) -> Iterator:
    """The FMU, unpacked and loaded, not instantiated."""
    description = fmpy.read_model_description(path)
    token = getattr(description, "instantiationToken", None) or description.guid
    fmpy.extract(path, folder)
    fmu = kind(
        guid=token,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="same bits",
    )
    yield fmu
    fmu.terminate()
    fmu.freeInstance()


def set_start(fmu, path: Path, scenario: Scenario, set_real, set_integer) -> None:
    """Parameters and initial states of a scenario; enumerations are integers of FMI 2.0."""
    variables = {v.name: v for v in fmpy.read_model_description(path).modelVariables}
    for name, value in (scenario.parameters | scenario.initial).items():
        real = variables[name].type in ("Real", "Float64")
        (set_real if real else set_integer)([variables[name].valueReference], [value])


def set_inputs_at(scenario: Scenario, i: int, known: dict[str, int], set_real, set_boolean) -> None:
    """Inputs of step i, each by the call for its type."""
    for name, values in scenario.inputs.items():
        setter = set_boolean if values.dtype == bool else set_real
        setter([known[name]], [values[i].item()])


def step_through(scenario: Scenario, do_step, set_inputs, get) -> np.ndarray:
    """Values (points, variables) at all communication points."""
    rows = [get()]
    for i, length in enumerate(np.diff(scenario.times)):
        if scenario.inputs:
            set_inputs(i)
        do_step(scenario.times[i], length)
        rows.append(get())
    return np.array(rows)


def run_fmi2(path: Path, folder: Path, scenario: Scenario, names: Sequence[str]) -> np.ndarray:
    known = references(path)
    read = [known[name] for name in names]

    def set_inputs(i: int) -> None:
        set_inputs_at(scenario, i, known, fmu.setReal, fmu.setBoolean)

    with opened(path, folder, fmi2.FMU2Slave) as fmu:
        fmu.instantiate()
        fmu.setupExperiment(
            tolerance=scenario.tolerance, startTime=scenario.start, stopTime=scenario.stop
        )
        set_start(fmu, path, scenario, fmu.setReal, fmu.setInteger)
        fmu.enterInitializationMode()
        set_inputs(0)
        fmu.exitInitializationMode()
        return step_through(
            scenario,
            lambda time, length: fmu.doStep(time, length),
            set_inputs,
            lambda: fmu.getReal(read),
        )


def run_fmi3(
    path: Path, folder: Path, scenario: Scenario, names: Sequence[str], mode: str = "plain"
) -> np.ndarray:
    event_mode, early_return = MODES[mode]
    known = references(path)
    read = [known[name] for name in names]

    def set_inputs(i: int) -> None:
        if event_mode:
            fmu.enterEventMode()
        set_inputs_at(scenario, i, known, fmu.setFloat64, fmu.setBoolean)
        if event_mode:
            assert fmu.updateDiscreteStates()[:5] == (False,) * 5
            fmu.enterStepMode()

    def do_step(time: float, length: float) -> None:
        event, terminate, early, reached = fmu.doStep(time, length)
        assert (event, terminate, early) == (False, False, False)
        assert reached == time + length

    with opened(path, folder, fmi3.FMU3Slave) as fmu:
        fmu.instantiate(eventModeUsed=event_mode, earlyReturnAllowed=early_return)

        def set_integer(reference: list[int], value: list[int]) -> None:
            types = {v.valueReference: v.type for v in description.modelVariables}
            enumeration = types[reference[0]] == "Enumeration"
            (fmu.setInt64 if enumeration else fmu.setInt32)(reference, value)

        description = fmpy.read_model_description(path)
        set_start(fmu, path, scenario, fmu.setFloat64, set_integer)
        fmu.enterInitializationMode(
            tolerance=scenario.tolerance, startTime=scenario.start, stopTime=scenario.stop
        )
        set_inputs_at(scenario, 0, known, fmu.setFloat64, fmu.setBoolean)
        fmu.exitInitializationMode()
        if event_mode:
            fmu.updateDiscreteStates()
            fmu.enterStepMode()
        return step_through(scenario, do_step, set_inputs, lambda: fmu.getFloat64(read))


@pytest.mark.parametrize("name", NAMES)
def test_co_simulation(name: str, tmp_path: Path) -> None:
    path = FMUS[model_folder(FILES[name]).name]
    scenario = load(name)
    names = float_names(fmi3_fmu(path))
    expected = run_fmi2(path, tmp_path / "2", scenario, names)
    actual = run_fmi3(fmi3_fmu(path), tmp_path / "3", scenario, names)
    assert expected.shape == (len(scenario.times), len(names))
    np.testing.assert_array_equal(actual.view(np.uint64), expected.view(np.uint64))


@pytest.mark.parametrize("mode", MODES)
def test_event_mode_and_early_return_change_nothing(mode: str, tmp_path: Path) -> None:
    """Where the model has no events."""
    name = "sixtieth"
    path = FMUS["rp_manipulator"]
    scenario = load(name)
    names = float_names(fmi3_fmu(path))
    expected = run_fmi2(path, tmp_path / "2", scenario, names)
    actual = run_fmi3(fmi3_fmu(path), tmp_path / "3", scenario, names, mode)
    np.testing.assert_array_equal(actual.view(np.uint64), expected.view(np.uint64))


def staircase(scenario: Scenario, points: int) -> np.ndarray | None:
    """Inputs held over each of the first steps, with an event wherever one of them changes."""
    if not scenario.inputs:
        return None
    values = np.column_stack([*scenario.inputs.values()])[:points]
    rows = [(scenario.times[0], *values[0])]
    for i in range(1, len(values)):
        if np.any(values[i] != values[i - 1]):
            rows += [(scenario.times[i], *values[i - 1]), (scenario.times[i], *values[i])]
    rows.append((scenario.times[points], *values[-1]))
    return np.array(rows, dtype=[("time", float), *((name, float) for name in scenario.inputs)])


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
