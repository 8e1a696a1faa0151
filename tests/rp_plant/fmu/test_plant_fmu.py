"""RPPlant beside RPManipulator: with start values the same bits; its values against its
Lagrangian. Their interfaces: tests/models/test_published_interface.py."""

import numpy as np
import pytest

from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.runs.scenario import Scenario
from rparm.runs.simulation import initialize
from tests.rp_plant.fmu.plant_runs import METHODS, each_method, read, started
from tests.support.rparm_project import load, names_of
from tests.support.symbolic import PLANT_MODES, plant_values

COUNTS = (
    "solver_steps",
    "solver_rhs_evaluations",
    "solver_restarts",
    "solver_failed_steps",
    "solver_last_order",
)
POINTS = 40


# ---- Start values ----------------------------------------------------------------------------


def record(fmu: Fmu, scenario: Scenario, names: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Real variables (points, names) and counters (points, COUNTS) at each communication point."""
    with fmu.instance("record") as instance:
        initialize(instance, scenario, scenario.tolerance)
        inputs = instance.reals(list(scenario.inputs))
        held = np.column_stack([*scenario.inputs.values()]) if scenario.inputs else None
        reals = instance.reals(names)
        values, counts = [], []

        def note(instance: Instance) -> None:
            reals.get()
            values.append(reals.view.copy())
            counts.append([instance.integer(name) for name in COUNTS])

        note(instance)
        for i, length in enumerate(np.diff(scenario.times)):
            if held is not None:
                inputs.view[:] = held[i]
                inputs.set()
            instance.do_step(scenario.times[i], length)
            note(instance)
    return np.array(values), np.array(counts)


@each_method
@pytest.mark.parametrize("version", ["fmi2"], indirect=True)
@pytest.mark.parametrize("name", names_of("rp_manipulator"))
def test_with_start_values_it_is_the_arm(plant: Fmu, arm: Fmu, name: str, method: str) -> None:
    """All Real variables, and all counters but of series, which are others, at each point."""
    scenario = load(name)
    scenario.parameters["solver_method"] = METHODS[method]
    reals = [v.name for v in arm.model.variables.values() if v.type == "Real"]
    expected, expected_counts = record(arm, scenario, reals)
    found, counts = record(plant, scenario, reals)
    assert np.isfinite(expected).all()
    largest = dict(zip(reals, np.abs(expected).max(axis=0), strict=True))
    units = {name: arm.model.variables[name].unit for name in reals}
    scale = [max(largest[other] for other in reals if units[other] == units[n]) for n in reals]
    assert (np.abs(found - expected) <= 1e-13 * np.array(scale)).all()
    if method != "taylor":
        np.testing.assert_array_equal(counts, expected_counts)
    assert counts[-1, 0] > 0


# ---- Values ----------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", PLANT_MODES)
def test_values_are_those_of_lagrange_and_newton(fmi2_plant: Fmu, mode: str) -> None:
    """Outputs, terms of the motion and joint loads at random points, in modes of all kinds."""
    for seed in range(POINTS):
        values, exact = plant_values(mode, seed)
        with started(fmi2_plant, **values) as instance:
            found = np.array(read(instance, *exact))
        expected = np.array([*exact.values()])
        largest = np.abs(expected) + np.abs(expected).max()
        np.testing.assert_array_less(np.abs(found - expected), 1e-13 * largest, str((mode, seed)))
