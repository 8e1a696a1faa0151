"""What the tests of the plant share."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def program(fmu: Path) -> Path:
    """The program plant_rows of the same build as the FMU."""
    path = fmu.parent / "tests" / "plant_rows"
    if not path.is_file():
        pytest.fail(f"{path}: no such file, cmake --build builds it")
    return path
