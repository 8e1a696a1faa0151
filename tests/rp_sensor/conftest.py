"""What the tests of the sensor share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from rparm.fmi.fmu_file import Fmu
from tests.support.rparm_project import fmi3_fmu


@pytest.fixture(scope="session", params=["fmi2", "fmi3"])
def sensor(request: pytest.FixtureRequest, fmu: Path) -> Iterator[Fmu]:
    """RPSensor, in each version of FMI."""
    path = fmu.with_name("RPSensor.fmu")
    with Fmu(path if request.param == "fmi2" else fmi3_fmu(path)) as opened:
        yield opened
