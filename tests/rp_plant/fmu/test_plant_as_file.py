"""RPPlant with friction and stops as elements (models/rp_plant/with_elements).

It has the motion of RPPlant.fmu.
"""

from dataclasses import replace

import numpy as np
import pytest

from rparm.fmi.fmu_file import Fmu
from rparm.runs import comparison, simulation
from tests.equations.examples import METHODS, quick
from tests.support.paths import ROOT
from tests.support.rparm_project import load, names_of

BUILD = ROOT / "build"


@pytest.fixture(scope="module")
def plants(tmp_path_factory: pytest.TempPathFactory) -> tuple[Fmu, Fmu]:
    """The FMU in C, and that of the file."""
    folder = tmp_path_factory.mktemp("as_file")
    file = ROOT / "models/rp_plant/with_elements/rp_plant.toml"
    return Fmu(BUILD / "RPPlant.fmu"), Fmu(quick(file, folder))


@pytest.mark.parametrize("method", ["cvode_adams", "taylor"])
@pytest.mark.parametrize("name", names_of("rp_plant"))
def test_references_and_modes(plants: tuple[Fmu, Fmu], name: str, method: str) -> None:
    given = load(name)
    parameters = given.parameters | {"solver_method": METHODS[method]}
    scenario = replace(given, parameters=parameters, panels=(("mode1", "mode2"),))
    in_c, as_file = (simulation.simulate(fmu, scenario) for fmu in plants)
    for mode in ("mode1", "mode2"):
        assert as_file.integers[mode].tolist() == in_c.integers[mode].tolist()
    reference = comparison.load_reference(given, plants[0].model)
    places = [as_file.names.index(output) for output in in_c.names]
    same = replace(as_file, names=in_c.names, values=as_file.values[:, places])
    worst = [max(comparison.errors_against(run, reference).values()) for run in (in_c, same)]
    assert worst[1] <= max(1.5 * worst[0], 1e-11)


def test_without_friction_and_stops_there_is_no_event(plants: tuple[Fmu, Fmu]) -> None:
    """And the motion is that of RPPlant.fmu to the last bit."""
    scenario = replace(load("spin_up"), parameters={}, initial={"dq1": 0.3, "q2": 0.1})
    in_c, as_file = (simulation.simulate(fmu, scenario) for fmu in plants)
    for state in ("q1", "q2", "dq1", "dq2"):
        columns = [run.values[:, run.names.index(state)] for run in (in_c, as_file)]
        np.testing.assert_array_equal(*columns)
