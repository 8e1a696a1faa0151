"""Parameters of each run: points of the unit cube, by scipy and SALib, through distributions.

The points of a run depend only on the campaign's text, so that each block can be made by itself.
"""

import warnings
from functools import cached_property

import numpy as np
from SALib.sample import sobol as saltelli
from scipy import special
from scipy.stats import qmc

from rparm.campaign.campaign_file import WHOLE, Campaign, Distribution, grid_value

SMALLEST = 2.0**-54  # a normal distribution is cut there, where its values are still finite


class Sampler:
    def __init__(self, campaign: Campaign) -> None:
        self._campaign = campaign
        self._distributions = list(campaign.parameters.values())

    def points(self, runs: range) -> np.ndarray:
        """Values of the parameters of consecutive runs, (runs, parameters)."""
        if self._campaign.sampling == "grid":
            return self._grid(runs)
        cube = self._cube(runs)
        columns = [values(d, cube[:, i]) for i, d in enumerate(self._distributions)]
        return np.column_stack(columns)

    def _grid(self, runs: range) -> np.ndarray:
        """The last parameter changes fastest."""
        sizes = [d.size for d in self._distributions]
        indices = np.unravel_index(np.arange(runs.start, runs.stop), sizes)
        axes = zip(self._distributions, indices, strict=True)
        return np.column_stack([[grid_value(d, i) for i in axis.tolist()] for d, axis in axes])

    def _cube(self, runs: range) -> np.ndarray:
        """Points of the unit cube, (runs, parameters)."""
        sampling, seed = self._campaign.sampling, self._campaign.seed
        size = len(self._distributions)
        if sampling in WHOLE:
            return self._whole[runs.start : runs.stop]
        if sampling == "random":
            generator = np.random.PCG64(seed).advance(runs.start * size)
            return np.random.Generator(generator).random((len(runs), size))
        sequence = self._sobol
        if sequence.num_generated > runs.start:
            sequence.reset()
        if sequence.num_generated < runs.start:
            sequence.fast_forward(runs.start - sequence.num_generated)
        with warnings.catch_warnings():  # that their number should be a power of 2
            warnings.simplefilter("ignore", UserWarning)
            return sequence.random(len(runs))

    @cached_property
    def _sobol(self) -> qmc.Sobol:
        """The next points of the sequence: blocks are asked for in their order."""
        size = len(self._distributions)
        return qmc.Sobol(size, scramble=True, rng=self._campaign.seed)

    @cached_property
    def _whole(self) -> np.ndarray:
        """All points of the unit cube, (runs, parameters)."""
        campaign, size = self._campaign, len(self._distributions)
        if campaign.sampling == "latin":
            return qmc.LatinHypercube(size, rng=campaign.seed).random(campaign.runs)
        return saltelli.sample(
            problem(campaign), campaign.runs, calc_second_order=False, seed=campaign.seed
        )


def problem(campaign: Campaign) -> dict[str, object]:
    """The campaign's parameters as SALib wants them: each between 0 and 1."""
    names = list(campaign.parameters)
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def values(distribution: Distribution, probabilities: np.ndarray) -> np.ndarray:
    """Values of a distribution at `probabilities`, (n,)."""
    numbers = distribution.numbers
    match distribution.kind:
        case "uniform":
            return numbers[0] + (numbers[1] - numbers[0]) * probabilities
        case "log_uniform":
            low, high = np.log(numbers)
            return np.exp(low + (high - low) * probabilities)
        case "normal":
            inside = np.clip(probabilities, SMALLEST, 1 - SMALLEST / 2)
            return numbers[0] + numbers[1] * special.ndtri(inside)
    indices = np.minimum((probabilities * len(numbers)).astype(int), len(numbers) - 1)
    return np.array(numbers)[indices]
