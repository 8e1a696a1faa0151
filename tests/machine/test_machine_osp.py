"""The machine in libcosim is what the references say of values read before inputs are set."""

from pathlib import Path

import numpy as np
import pytest
from rparm.models.machine.experiment import STEPS_PER_SECOND, STOP

from tests.importers.osp import libcosim, only_variant
from tests.machine.test_machine import BOUND, DISCRETE, SCALE, SSP, VARIANTS, reference
from tests.support.ssp_files import edited


@pytest.mark.parametrize("variant", VARIANTS)
def test_libcosim_is_at_the_reference_of_its_order(variant: str, tmp_path: Path) -> None:
    path = SSP  # it takes the first variant
    if variant != VARIANTS[0]:
        path = edited(SSP, tmp_path / "one.ssp", {"SystemStructure.ssd": only_variant(variant)})
    expected = reference(variant, "sampled.csv")
    rows = np.rint(expected["time"] * STEPS_PER_SECOND).astype(int)[1:]
    names = [name for name in expected if name not in ("time", *DISCRETE)]
    result = libcosim(path, names, round(STOP * STEPS_PER_SECOND), tmp_path)
    worst = {
        name: np.abs(result[name][rows - 1] - expected[name][1:]).max()
        / max(np.abs(expected[name]).max(), SCALE)
        for name in names
    }
    assert max(worst.values()) <= BOUND, max(worst, key=worst.__getitem__)


def test_readings_before_and_after_inputs_are_set_differ() -> None:
    """So that a comparison with the wrong one fails."""
    before, after = (reference("wall_contact", name) for name in ("sampled.csv", "ecos.csv"))
    for name in ("controller.tau1", "environment.wall_force", "plant.ddq1", "actuator.voltage1"):
        assert np.abs(before[name] - after[name]).max() > 1e3 * BOUND * np.abs(after[name]).max()
    for name in ("plant.q1", "actuator.current1", "sensor.q1_measured", "trajectory.q1_ref"):
        np.testing.assert_array_equal(before[name], after[name])
