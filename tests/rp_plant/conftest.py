"""What the tests of the plant share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from rparm.fmi.fmu_file import Fmu
from tests.rp_plant.plant_in_c import PlantInC
from tests.support.rparm_project import fmi3_fmu


@pytest.fixture(scope="session")
def plant_in_c(tmp_path_factory: pytest.TempPathFactory) -> PlantInC:
    """struct model of RPPlant."""
    return PlantInC(tmp_path_factory.mktemp("plant"))


@pytest.fixture(scope="session")
def fmi2_plant(fmu: Path) -> Iterator[Fmu]:
    """RPPlant of FMI 2.0."""
    with Fmu(fmu.with_name("RPPlant.fmu")) as opened:
        yield opened


@pytest.fixture(scope="session", params=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> str:
    """Of FMI."""
    return request.param


@pytest.fixture(scope="session")
def plant(fmi2_plant: Fmu, version: str) -> Iterator[Fmu]:
    """RPPlant of both versions of FMI."""
    if version == "fmi2":
        yield fmi2_plant
        return
    with Fmu(fmi3_fmu(fmi2_plant.path)) as opened:
        yield opened


@pytest.fixture(scope="session")
def arm(fmu: Path, version: str) -> Iterator[Fmu]:
    """RPManipulator, in the same version of FMI."""
    with Fmu(fmu if version == "fmi2" else fmi3_fmu(fmu)) as opened:
        yield opened
