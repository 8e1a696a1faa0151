"""The systems in libcosim are what the references say of values read before inputs are set."""

from pathlib import Path

import numpy as np
import pytest

from rparm.systems import comparison, ssp
from tests.importers.osp import libcosim, only_variant
from tests.support.ssp_files import edited
from tests.support.systems import BOUND, CASES, CLOSED_LOOP, MACHINE_SYSTEM, System, difference

ROUNDING = 1e-9  # two engines with the same order


@pytest.mark.parametrize(("system", "variant"), CASES, ids=lambda x: getattr(x, "folder", x))
def test_libcosim_is_at_the_reference_of_its_order(
    system: System, variant: str, tmp_path: Path
) -> None:
    """All Real variables are those of the sampled system."""
    path = system.path  # libcosim takes the first variant
    if variant != system.variants[0]:
        change = {"SystemStructure.ssd": only_variant(variant)}
        path = edited(system.path, tmp_path / "one.ssp", change)
    with ssp.unpacked(path) as opened:
        left_out = {"time", *comparison.discrete(opened)}
    expected = system.reference(variant, "sampled.csv")
    rows = system.rows(expected)[1:]
    names = [name for name in expected if name not in left_out]
    result = libcosim(path, names, system.steps, tmp_path)
    for name in names:
        assert difference(result[name][rows - 1], expected[name][1:]) <= BOUND, name


def test_libcosim_differs_from_ecos_by_the_time_of_reading_alone(tmp_path: Path) -> None:
    """Efforts without integral action show up one step later, and nothing else differs."""
    result, steps = CLOSED_LOOP.run("nominal"), 2000
    with ssp.unpacked(CLOSED_LOOP.path) as opened:
        names = comparison.recorded(opened)
    other = libcosim(CLOSED_LOOP.path, names, steps, tmp_path)
    late = {f"controller.{name}" for name in ("tau1", "f2")}
    late |= {name for name in names if name.startswith("controller.") and "error" in name}
    direct = {"arm.ddq1", "arm.ddq2", "arm.actuator_power"}
    for name in names:
        if name in late:
            assert difference(other[name], result[name][:steps]) <= ROUNDING, name
        elif name not in direct:
            assert difference(other[name], result[name][1 : steps + 1]) <= ROUNDING, name
    for name in direct | late:
        assert difference(other[name], result[name][1 : steps + 1]) > 1e4 * ROUNDING, name


def test_readings_before_and_after_inputs_are_set_differ() -> None:
    """So that a comparison with the wrong one fails."""
    before, after = (
        MACHINE_SYSTEM.reference("wall_contact", name) for name in ("sampled.csv", "ecos.csv")
    )
    for name in ("controller.tau1", "environment.wall_force", "plant.ddq1", "actuator.voltage1"):
        assert np.abs(before[name] - after[name]).max() > 1e3 * BOUND * np.abs(after[name]).max()
    for name in ("plant.q1", "actuator.current1", "sensor.q1_measured", "trajectory.q1_ref"):
        np.testing.assert_array_equal(before[name], after[name])
