"""Intervals of parameters: by the scatter between segments, and as textbooks have them.

The classical covariance trusts that what is left is white noise on the measured values. Where
inputs are noisy or the model is not quite right, the residuals of a segment belong together, and it
is too small. How much independent segments pull the parameters in different directions shows the
covariance whatever happens within them: the "sandwich" of robust statistics. As there are few
segments, it has the corrections that Bell and McCaffrey proposed (Survey Methodology 28, 2002): it
is unbiased for white noise, and each parameter has its own degrees of freedom.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from rparm.identification.residuals import Linear

LEVEL = 0.95
SUSPICIOUS = 1.5  # ratio of the standard deviations
SMALL = 1e-8  # of the largest singular value of the states' columns: such a state has no effect
FULL = 1 - 1e-9  # share of a segment in what is known: it cannot be checked by others


@dataclass(frozen=True, eq=False)
class Reduced:
    """A segment whose start state is as good as can be, whatever the parameters."""

    by_parameters: np.ndarray  # (rows, parameters)
    residuals: np.ndarray  # (rows,)
    basis: np.ndarray  # (rows, n) orthonormal: what the states can explain


def reduced(linear: Linear) -> Reduced:
    """Take the start state out of a segment's equations."""
    left, values, _ = np.linalg.svd(linear.by_states, full_matrices=False)
    basis = left[:, values > SMALL * max(values.max(initial=0.0), 1e-300)]
    rest, residuals = linear.by_parameters, linear.residuals
    return Reduced(
        rest - basis @ (basis.T @ rest), residuals - basis @ (basis.T @ residuals), basis
    )


@dataclass(frozen=True, eq=False)
class Covariances:
    """Of the fit's numbers of the parameters that are known."""

    scatter: np.ndarray  # (known, known)
    classical: np.ndarray  # (known, known)
    degrees: np.ndarray  # (known,) of freedom, of the scatter; 0: there is one segment
    variance: float  # of the residuals, as multiples of their noise

    @property
    def ratio(self) -> float:
        """Ratio of the standard deviations, scatter to classical: root mean square of all."""
        ratios = np.diag(self.scatter) / np.diag(self.classical)
        return float(np.sqrt(ratios.mean())) if len(ratios) else 1.0

    @property
    def is_suspicious(self) -> bool:
        """Whether the classical intervals would be too small."""
        return self.ratio > SUSPICIOUS

    @property
    def halves(self) -> np.ndarray:
        """Half the width (known,) of the intervals by scatter."""
        factors = stats.t.ppf((1 + LEVEL) / 2, np.maximum(self.degrees, 1.0))
        return factors * np.sqrt(np.diag(self.scatter))

    @property
    def classical_halves(self) -> np.ndarray:
        """Half the width (known,) of the classical intervals."""
        return stats.norm.ppf((1 + LEVEL) / 2) * np.sqrt(np.diag(self.classical))


def covariances(segments: Sequence[Reduced], known: np.ndarray) -> Covariances:
    """Covariances of the parameters at the indices `known`; the others are taken as given."""
    n = len(known)
    tables = [segment.by_parameters[:, known] for segment in segments]
    inverse = np.linalg.inv(sum(table.T @ table for table in tables)) if n else np.empty((0, 0))
    rows = sum(len(s.residuals) - s.basis.shape[1] for s in segments) - n
    variance = sum(float(s.residuals @ s.residuals) for s in segments) / max(rows, 1)
    classical = variance * inverse
    if len(segments) < 2:
        return Covariances(classical, classical, np.zeros(n), variance)
    root = np.linalg.cholesky(inverse) if n else inverse  # inverse = root root'
    moves = np.empty((len(segments), n))
    norms = np.empty((len(segments), n))
    overlaps = np.empty((len(segments), n, n))
    for i, (segment, table) in enumerate(zip(segments, tables, strict=True)):
        # in coordinates where the sum of all shares is the unit matrix
        scaled = table @ root
        shares, axes = np.linalg.eigh(scaled.T @ scaled)
        shares = np.clip(shares, 0.0, FULL)
        weight = (axes / np.sqrt(1 - shares)) @ axes.T
        moves[i] = root @ weight @ scaled.T @ segment.residuals
        overlaps[i] = (axes * shares / np.sqrt(1 - shares)) @ axes.T @ root.T
        norms[i] = np.sum((root @ axes) ** 2 * shares / (1 - shares), axis=1)
    return Covariances(moves.T @ moves, classical, _degrees(norms, overlaps), variance)


def _degrees(norms: np.ndarray, overlaps: np.ndarray) -> np.ndarray:
    """Degrees of freedom (known,): the first two moments are those of a chi-squared number.

    Parameters
    ----------
    norms : ndarray, shape (segments, known)
        Variance of the move by a segment, if segments were independent.
    overlaps : ndarray, shape (segments, known, known)
        What they share, as they are fitted together; the last axis is the parameter.
    """
    found = np.empty(norms.shape[1])
    for k in range(len(found)):
        shared = overlaps[:, :, k]
        matrix = np.diag(norms[:, k]) - shared @ shared.T
        found[k] = np.trace(matrix) ** 2 / np.sum(matrix**2)
    return found
