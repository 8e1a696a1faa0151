"""Values of a block's parameters, and what follows from them."""

import numpy as np

from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import Job
from rparm.campaign.sampling import Sampler


class Points:
    """Parameters and derived values of the runs; expressions may name `constants`."""

    def __init__(self, campaign: Campaign, constants: dict[str, float]) -> None:
        self._sampler, self._constants = Sampler(campaign), constants
        self._parameters = list(campaign.parameters)
        self._expressions = campaign.expressions
        self.names = [*self._parameters, *self._expressions]

    def of(self, runs: range) -> np.ndarray:
        """Values (runs, names); NaN where an expression is not defined."""
        given = self._sampler.points(runs)
        if not self._expressions:
            return given
        return np.array([self._with_derived(row) for row in given.tolist()])

    def _with_derived(self, row: list[float]) -> list[float]:
        known = self._constants | dict(zip(self._parameters, row, strict=True))
        result = list(row)
        for name, expression in self._expressions.items():
            try:
                known[name] = expression.value(known)
            except (ArithmeticError, ValueError):
                known[name] = np.nan
            result.append(known[name])
        return result

    def targets(self, points: np.ndarray, job: Job) -> np.ndarray:
        """Columns of `points` that go to the job's targets, in their order."""
        return points[:, [self.names.index(name) for name, _ in job.targets]]
