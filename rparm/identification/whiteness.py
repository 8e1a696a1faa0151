"""Whether residuals are white: the test of Ljung and Box."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from rparm.identification.intervals import Reduced

LAGS = 20
REJECTED = 0.01  # probability below which residuals are not taken for noise


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Of the residuals of one output."""

    correlations: np.ndarray  # (lags,): of 1, 2, ... rows
    bound: float  # 95 % of the correlations of noise are smaller
    statistic: float
    p: float  # the probability of one as large, if the residuals were noise

    @property
    def is_white(self) -> bool:
        """Whether they may be noise."""
        return self.p >= REJECTED


def whiteness(segments: Sequence[Reduced], outputs: int) -> list[Whiteness]:
    """Test the residuals of each output, over pairs of rows within segments.

    A start state that is estimated from a segment's rows makes its residuals a little correlated:
    by the projection of the noise, which is known and taken off.
    """
    return [_of_output(segments, outputs, k) for k in range(outputs)]


def _of_output(segments: Sequence[Reduced], outputs: int, k: int) -> Whiteness:
    residuals = [segment.residuals[k::outputs] for segment in segments]
    bases = [segment.basis[k::outputs] for segment in segments]
    count = sum(map(len, residuals))
    kept = sum(len(r) - float(np.sum(b**2)) for r, b in zip(residuals, bases, strict=True))
    power = sum(float(r @ r) for r in residuals)
    variance = power / max(kept, 1.0)
    lags = min(LAGS, min(map(len, residuals)) - 2)
    found = np.zeros(max(lags, 0))
    pairs = np.zeros(len(found))
    for lag in range(1, lags + 1):
        for r, b in zip(residuals, bases, strict=True):
            found[lag - 1] += r[lag:] @ r[:-lag] + variance * np.sum(b[lag:] * b[:-lag])
            pairs[lag - 1] += len(r) - lag
    found /= power or 1.0
    statistic = float(np.sum(found**2 * count**2 / np.maximum(pairs, 1)))
    p = float(stats.chi2.sf(statistic, max(len(found), 1)))
    return Whiteness(found, 1.96 / np.sqrt(count), statistic, p)
