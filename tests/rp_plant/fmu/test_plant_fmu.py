"""RPPlant beside RPManipulator: the same interface, and with start values the same bits; its values
against its Lagrangian."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

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
INDICATORS = [
    kind
    for i in (1, 2)
    for kind in (f"slip{i}_forward", f"slip{i}_backward", f"stop{i}_lower", f"stop{i}_upper")
] + ["stop1_push", "stop2_push"]


# ---- Interface -------------------------------------------------------------------------------


def test_every_variable_of_the_arm_is_there(plant: Fmu, arm: Fmu) -> None:
    """With its value reference, type, unit, start value and limits; some mean more here."""
    for name, variable in arm.model.variables.items():
        known = replace(plant.model.variables[name], description=variable.description)
        assert known == variable
    further = set(plant.model.variables) - set(arm.model.variables)
    solver = {"event_count", "last_event_time", "max_events"}
    references = {name: plant.model.variables[name].reference for name in further}
    assert {references[name] for name in solver} == {93, 94, 95}
    assert min(references[name] for name in further - solver) == 100


def test_states_may_jump_and_indicators_are_counted(plant: Fmu) -> None:
    with ZipFile(plant.path) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    variables = {v.get("name"): v for v in root.find("ModelVariables")}
    if plant.model.fmi_version == "2.0":
        assert root.get("numberOfEventIndicators") == "10"
        jump = [name for name, v in variables.items() if v[0].get("reinit") == "true"]
    else:
        found = root.iterfind("ModelStructure/EventIndicator")
        names = {v.get("valueReference"): name for name, v in variables.items()}
        assert [names[e.get("valueReference")] for e in found] == INDICATORS
        jump = [name for name, v in variables.items() if v.get("reinit") == "true"]
    assert jump == ["q1", "q2", "dq1", "dq2"]


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


# ---- Terminals -------------------------------------------------------------------------------


def test_terminals_fit_those_of_the_arm(fmu: Path) -> None:
    """The joints have the same members; the end effector takes a wrench, too."""
    members = {}
    for name in ("RPPlant", "RPManipulator"):
        with ZipFile(fmu.parent / "fmi3" / f"{name}.fmu") as archive:
            root = ET.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
        members[name] = {
            terminal.get("name"): {
                m.get("variableName") for m in terminal.iter() if "variableName" in m.attrib
            }
            for terminal in root.find("Terminals")
        }
    plant, arm = members.values()
    assert plant["arm"] == arm["arm"]
    assert plant["end_effector"] > arm["end_effector"] | {"ee_fx", "ee_mz"}
