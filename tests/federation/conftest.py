"""What these tests share. They end as the command does: HELICS may wait for ever at its end."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rparm.federation.network import KEY
from tests.federation.processes import Start, starting

_status = [0]
os.environ[KEY] = "known2all0processes"


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts commands; their temporary files are in the folder `temporary` of the test."""
    with starting(tmp_path / "temporary") as start:
        yield start


def pytest_sessionfinish(exitstatus: int) -> None:
    _status[0] = int(exitstatus)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure() -> None:
    if "helics" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_status[0])
