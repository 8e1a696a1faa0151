"""Measured outputs beside simulated ones."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rparm.runs.simulation import Result
from rparm.scenarios.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Comparison:
    """An output that was measured, at the times of a run's rows."""

    name: str
    source: str  # file and column of the log
    measured: np.ndarray  # (rows,); NaN where the log has no values
    simulated: np.ndarray  # (rows,)

    @property
    def rms(self) -> float:
        """Root of the mean square of the differences, in the variable's unit."""
        # scaled, so that no square overflows
        largest = self.largest
        return largest * float(np.sqrt(np.mean((self._differences / (largest or 1.0)) ** 2)))

    @property
    def largest(self) -> float:
        """Largest difference, in the variable's unit."""
        return float(np.max(np.abs(self._differences)))

    @property
    def _differences(self) -> np.ndarray:
        rows = ~np.isnan(self.measured)
        return self.simulated[rows] - self.measured[rows]


def comparisons(scenario: Scenario, result: Result) -> Iterator[Comparison]:
    """What a scenario has measured, compared with a run of it."""
    elapsed = scenario.elapsed[scenario.reference_rows][: len(result.times)]
    for name, log in scenario.measured.items():
        measured = np.where(log.covers(elapsed), log.values(elapsed), np.nan)
        simulated = result.values[:, result.names.index(name)]
        yield Comparison(name, log.source, measured, simulated)
