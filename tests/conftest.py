"""What the Python tests share."""

import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))


@pytest.fixture(scope="session")
def fmu() -> Path:
    """The built FMU: $RP_FMU, or the one in build/."""
    path = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).absolute()
    if not path.is_file():
        pytest.fail(f"{path}: no such file, ./run.sh builds it")
    return path
