"""The machine, unpacked."""

from collections.abc import Iterator

import pytest
from rparm.models.machine.systems import SEQUENCE

from rparm.fmi.fmu_file import Fmu
from rparm.systems import ssp
from rparm.systems.structure import OpenedSystem
from tests.support.ssp_files import MACHINE


@pytest.fixture(scope="module")
def opened() -> Iterator[OpenedSystem]:
    with ssp.unpacked(MACHINE) as machine:
        yield machine


@pytest.fixture(scope="module")
def fmus(opened: OpenedSystem) -> Iterator[dict[str, Fmu]]:
    with opened.unpacked_fmus(SEQUENCE) as found:
        yield found
