"""The damping that the wall needs: measured with the machine, within 2 % of the theory."""

from pathlib import Path

import numpy as np
import pytest
from rparm.models.machine import wall_limit
from rparm.models.machine.systems import changed
from rparm.models.machine.wall_limit import (
    CASES,
    DEPTH,
    MASS,
    MOVED,
    PUSH,
    STEP,
    STEPS,
    Contact,
    Measure,
    exact_least_damping,
    least_damping,
    pressed,
)

from rparm.fmi.fmu_file import Fmu
from rparm.systems import ssp_writer
from rparm.systems.structure import OpenedSystem
from tests.importers.osp import libcosim

STIFFNESS = 1e4  # N/m


def check(measure: Measure, stiffness: float, order: str, inputs: str) -> None:
    contact = Contact(MASS, stiffness)
    theory = least_damping(contact, STEP, order, inputs)
    found = wall_limit.limit(theory, measure, stiffness)
    assert found == pytest.approx(theory, rel=0.02)
    assert found == pytest.approx(exact_least_damping(contact, STEP, order, inputs), rel=3e-3)


@pytest.mark.parametrize("stiffness", [2e3, STIFFNESS, 2e4])
def test_ecos(opened: OpenedSystem, stiffness: float) -> None:
    check(wall_limit.in_ecos(opened), stiffness, "jacobi", "held")


def test_libcosim(opened: OpenedSystem, tmp_path: Path) -> None:
    def measure(stiffness: float, damping: float) -> np.ndarray:
        path = tmp_path / "Pressed.ssp"
        ssp_writer.write(path, changed(opened, pressed(stiffness, damping), STEPS * STEP, STEP))
        return libcosim(path, [DEPTH], STEPS, tmp_path)[DEPTH]

    check(measure, STIFFNESS, "jacobi", "held")


@pytest.mark.parametrize(("order", "inputs"), CASES)
def test_master(opened: OpenedSystem, fmus: dict[str, Fmu], order: str, inputs: str) -> None:
    check(wall_limit.under_master(opened, fmus, order, inputs), STIFFNESS, order, inputs)


def test_ecos_and_the_master_in_its_order_move_alike(
    opened: OpenedSystem, fmus: dict[str, Fmu]
) -> None:
    """Depths are those of both engines, read after and before inputs are set."""
    master = wall_limit.under_master(opened, fmus, "jacobi", "held")(STIFFNESS, 30.0)
    engine = wall_limit.in_ecos(opened)(STIFFNESS, 30.0)
    assert np.abs(engine[1:-1] - master[2:]).max() < 1e-4 * MOVED
    # about the depth of the equilibrium, without leaving the wall
    assert master.min() > 0.9 * PUSH / STIFFNESS
    assert np.ptp(master) > MOVED
