"""The FMUs of FMI 3.0 and 2.0 give the same bits on every scenario in model exchange; in
co-simulation: models/test_every_fmu.py, rp_plant/fmu/test_plant_event_mode.py."""

from pathlib import Path

import fmpy
import numpy as np
import pytest

from rparm.project import model_folder
from tests.support.rparm_project import FILES, FMUS, NAMES, fmi3_fmu, load, staircase


def float_names(path: Path) -> list[str]:
    """All floating-point variables."""
    description = fmpy.read_model_description(path)
    return [v.name for v in description.modelVariables if v.type in ("Real", "Float64")]


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
