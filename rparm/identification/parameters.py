"""What is estimated, as numbers without unit and limits that the fit works with.

A parameter with a limit is its distance from it, times the exponential of such a number: no step
leads across. One with two limits is a logistic function between them, one without any is linear.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rparm.errors import WrongValueError

CLOSEST = np.log(1e-6)  # to a limit, of the distance at the start: what comes here is at it
LARGEST = 700.0  # whose exponential is a double: ends of intervals of what is hardly known
DELAY = "delay"  # between the outputs and what was measured of them


@dataclass(frozen=True)
class Parameter:
    """A parameter of the FMU, or the delay of what was measured."""

    name: str
    start: float
    least: float = -np.inf
    greatest: float = np.inf
    above: str = ""  # the parameter that is its limit from below, in place of `least`
    unit: str | None = None
    scale: float = 0.0  # of one without limits; 0: its start

    def check(self, low: float) -> None:
        """Check that the start is inside; `low` is its limit from below.

        WrongValueError if it is not, or lies on the limit.
        """
        unit = f" {self.unit}" if self.unit else ""
        for limit, is_in, word in (
            (low, self.start > low, "above"),
            (self.greatest, self.start < self.greatest, "below"),
        ):
            if not is_in:
                raise WrongValueError(
                    f"expected a start {word} its limit {limit:g}{unit}, got {self.start:g}{unit}"
                )


class Parameters:
    """All that are estimated.

    Parameters
    ----------
    fixed : mapping
        Values of the parameters that are not estimated, for those that are `above` them.
    """

    def __init__(self, every: Sequence[Parameter], fixed: Mapping[str, float]) -> None:
        self.every, self._fixed = tuple(every), fixed
        self.names = tuple(parameter.name for parameter in every)
        start = dict(zip(self.names, (p.start for p in every), strict=True))
        self._low = {
            p.name: (fixed | start)[p.above] if p.above else p.least for p in every
        }  # at the start
        self._order = sorted(range(len(every)), key=lambda i: bool(every[i].above))

    def __len__(self) -> int:
        return len(self.every)

    def check(self) -> None:
        """Check all starts; WrongValueError names the parameter."""
        for parameter in self.every:
            try:
                parameter.check(self._low[parameter.name])
            except WrongValueError as error:
                raise WrongValueError(f"{parameter.name}: {error}") from None

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (parameters,) in their units; `z` is 0 at the start."""
        return self._mapped(z)[0]

    def slopes(self, z: np.ndarray) -> np.ndarray:
        """Derivatives (parameters, parameters) of the values by `z`."""
        return self._mapped(z)[1]

    def _mapped(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = np.empty(len(z)), np.zeros((len(z), len(z)))
        z = np.clip(z, -LARGEST, LARGEST)
        for i in self._order:  # those above others come after these
            parameter = self.every[i]
            low, high = self._low[parameter.name], parameter.greatest
            if parameter.above in self.names:
                other = self.names.index(parameter.above)
                slopes[i] = slopes[other]
                base = values[other]
            else:
                base = low
            if np.isfinite(low) and np.isfinite(high):
                odds = (parameter.start - low) / (high - parameter.start) * np.exp(z[i])
                values[i] = low + (high - low) * odds / (1 + odds)
                slopes[i, i] = (high - low) * odds / (1 + odds) ** 2
            elif np.isfinite(low):
                distance = (parameter.start - low) * np.exp(z[i])
                values[i], slopes[i, i] = base + distance, distance
            elif np.isfinite(high):
                distance = (high - parameter.start) * np.exp(z[i])
                values[i], slopes[i, i] = high - distance, -distance
            else:
                scale = parameter.scale or abs(parameter.start) or 1.0
                values[i], slopes[i, i] = parameter.start + scale * z[i], scale
        return values, slopes

    @property
    def is_limited(self) -> np.ndarray:
        """Which (parameters,) have a limit."""
        return np.array([np.isfinite([self._low[p.name], p.greatest]).any() for p in self.every])

    def at_limit(self, z: np.ndarray) -> np.ndarray:
        """Which (parameters,) have come to a limit."""
        return self.is_limited & (np.abs(z) >= -CLOSEST)

    def kept(self, z: np.ndarray) -> np.ndarray:
        """`z` where no parameter is closer to a limit than counts."""
        return np.where(self.is_limited, np.clip(z, CLOSEST, -CLOSEST), z)
