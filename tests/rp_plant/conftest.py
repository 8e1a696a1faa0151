"""What the tests of the plant share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from cosim.fmi.fmu_file import Fmu
from tests.support.cosim_project import fmi3_fmu


@pytest.fixture(scope="session")
def program(fmu: Path) -> Path:
    """The program plant_rows of the same build as the FMU."""
    path = fmu.parent / "tests" / "plant_rows"
    if not path.is_file():
        pytest.fail(f"{path}: no such file, cmake --build builds it")
    return path


def opened_in(path: Path, version: str) -> Fmu:
    return Fmu(path if version == "fmi2" else fmi3_fmu(path))


@pytest.fixture(scope="session", params=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> str:
    """Of FMI."""
    return request.param


@pytest.fixture(scope="session")
def plant(fmu: Path, version: str) -> Iterator[Fmu]:
    """RPPlant."""
    with opened_in(fmu.with_name("RPPlant.fmu"), version) as opened:
        yield opened


@pytest.fixture(scope="session")
def arm(fmu: Path, version: str) -> Iterator[Fmu]:
    """RPManipulator, in the same version of FMI."""
    with opened_in(fmu, version) as opened:
        yield opened
