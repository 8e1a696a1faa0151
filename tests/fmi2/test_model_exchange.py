"""Model Exchange: fmpy's CVode follows the references. Single calls: test_fmi2_model_exchange.c."""

import fmpy
import numpy as np
import pytest

from rparm.runs import comparison
from rparm.runs.comparison import Reference
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import Result
from tests.support.instances import LoadedFmu
from tests.support.rparm_project import declared, load, names_of, staircase

NAMES = names_of("rp_manipulator")


def simulate(loaded: LoadedFmu, scenario: Scenario, expected: Reference, tolerance: float) -> float:
    """Largest relative error of all outputs, as for co-simulation.

    fmpy restarts CVode where two rows of the input have the same time, in event mode, and records
    there, before the event: the outputs with the input of the step that ends.
    """
    # fmpy gives up after 500 steps of CVode on the way to an output
    interval = min(max(scenario.steps), (scenario.stop - scenario.start) / 50)
    recorded = fmpy.simulate_fmu(
        str(loaded.folder),
        model_description=loaded.description,
        fmi_type="ModelExchange",
        solver="CVode",
        start_time=scenario.start,
        stop_time=scenario.stop,
        output_interval=interval,
        relative_tolerance=tolerance,
        start_values=scenario.parameters | scenario.initial,
        input=staircase(scenario, len(scenario.times) - 1),
        output=expected.names,
        record_events=True,
    )
    times = scenario.times[scenario.reference_rows]
    near = 1e-9 * np.maximum(np.abs(times), 1e-3)  # fmpy adds up its times
    rows = np.searchsorted(recorded["time"], times - near)
    assert np.all(np.abs(recorded["time"][rows] - times) <= near)
    values = np.column_stack([recorded[name][rows] for name in expected.names])
    result = Result(tolerance, times, expected.names, values, 0, 0.0, None, None, ())
    return max(comparison.errors_against(result, expected).values())


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_follows_the_reference(loaded: LoadedFmu, name: str) -> None:
    """Within 1e-5 at tolerance 1e-8, or at 1e-11 where fmpy's solver needs it.

    fmpy integrates with BDF formulas, whose errors add up. It restarts them at every change of an
    input, up to 5000 times, each with an error of the order of the tolerance. The error follows the
    tolerance, so it is the solver's.
    """
    scenario = load(name)
    expected = comparison.load_reference(scenario, declared(scenario.model))
    error = simulate(loaded, scenario, expected, 1e-8)
    if error > 1e-5:
        assert error <= 2e-3
        fine = simulate(loaded, scenario, expected, 1e-11)
        assert fine <= 1e-5 and fine <= error / 100


def test_inputs_at_rest_need_no_finer_tolerance(loaded: LoadedFmu) -> None:
    for name in ("coasting", "constant_effort", "constant_effort_single_step"):
        scenario = load(name)
        expected = comparison.load_reference(scenario, declared(scenario.model))
        assert simulate(loaded, scenario, expected, 1e-8) <= 1e-5
