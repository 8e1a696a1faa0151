"""The systems of the project, their runs in Ecos, and their references."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rparm.systems import comparison, ecos, ssp
from tests.support.paths import ROOT
from tests.support.ssp_files import MACHINE, SSP, read_csv

BOUND = 1e-7  # of the largest value of a variable, or of SCALE where that is larger
SCALE = 1e-3
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class System:
    """A system, with the step size and stop time that its references are for."""

    folder: str
    path: Path  # of its SSP
    steps_per_second: int
    steps: int
    variants: tuple[str, ...]

    def reference(self, variant: str, name: str = "ecos.csv") -> Columns:
        """Read a reference of a variant."""
        return read_csv(ROOT / "models" / self.folder / "references" / variant / name)

    @functools.cache  # noqa: B019
    def run(self, variant: str, folder: str = "") -> Columns:
        """Run a variant in Ecos, of the SSP in a folder beside; return all recorded values."""
        with ssp.unpacked(self.path.parent / folder / self.path.name) as opened:
            names = [*comparison.recorded(opened), *comparison.discrete(opened)]
            result = ecos.run(opened, variant, names)
        assert len(result.times) == self.steps + 1
        return {"time": result.times} | dict(zip(result.names, result.values.T, strict=True))

    def rows(self, expected: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return the communication points that a reference has rows for."""
        rows = np.rint(expected["time"] * self.steps_per_second).astype(int)
        assert np.allclose(expected["time"], rows / self.steps_per_second, rtol=0, atol=1e-12)
        assert (rows[0], rows[-1]) == (0, self.steps) and len(rows) > 100
        return rows


def difference(values: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference, over the largest expected value or SCALE."""
    assert values.shape == expected.shape and np.isfinite(values).all()
    return float(np.abs(values - expected).max() / max(np.abs(expected).max(), SCALE))


CLOSED_LOOP = System(
    "closed_loop", SSP, 1000, 6000,
    ("nominal", "heavy_payload", "heavy_payload_integral", "horizontal_plane", "limited_effort"),
)  # fmt: skip
MACHINE_SYSTEM = System(
    "machine", MACHINE, 1000, 4000,
    ("pick_and_place", "pick_and_place_untold", "stick_slip", "wall_contact", "noisy_sensor"),
)  # fmt: skip
CASES = [
    (system, variant) for system in (CLOSED_LOOP, MACHINE_SYSTEM) for variant in system.variants
]
