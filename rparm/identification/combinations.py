"""Combinations of parameters without effect on what was measured.

The singular values of the residuals' derivatives show how many there are. They are named by as few
parameters as possible: sets of columns that depend on each other, of which no column can be left
out.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

NOTHING = 3e-6  # singular value of columns of length 1; differences leave 1e-7 where there is none
COARSE = 1e-3  # the same at most, where rounding is seen
EQUAL = 1e-3  # of two effects a unit, so that a sum of parameters is known
MOST = 6  # parameters in a combination that is looked for
TAKES_PART = 1e-4  # weight of a column in a combination of columns of length 1


@dataclass(frozen=True, eq=False)
class Combination:
    """Parameters of which the log shows the joint effect only, or one without effect."""

    names: tuple[str, ...]
    effects: np.ndarray | None  # (names,) of each a unit, relative: their sum is known; or None

    def __str__(self) -> str:
        if len(self.names) == 1:
            return f"{self.names[0]} has no effect"
        if self.effects is None:
            return f"{', '.join(self.names)} together"
        first, *others = self.names
        signs = [" + " if effect > 0 else " - " for effect in self.effects[1:]]
        return first + "".join(map("".join, zip(signs, others, strict=True)))


class Effects:
    """Effects of parameters on the residuals, as columns that may depend on each other.

    Parameters
    ----------
    effects : ndarray, shape (rows, parameters)
        Derivatives of the residuals by numbers of order 1.
    rounding : float
        Length that a column of these has where there is no effect.
    """

    def __init__(self, effects: np.ndarray, rounding: float) -> None:
        self.table = np.linalg.qr(effects, mode="r")
        self.lengths = np.linalg.norm(self.table, axis=0)
        self.units = self.table / np.where(self.lengths > 0, self.lengths, 1.0)
        self.there = self.lengths > max(rounding, NOTHING * self.lengths.max(initial=0.0))
        self._rounding = rounding

    def depend(self, columns: Sequence[int]) -> bool:
        """Whether columns depend on each other, to the precision that they have."""
        return self._smallest(self.units[:, columns]) <= self.precision(columns)

    def precision(self, columns: Sequence[int]) -> float:
        """Smallest singular value of columns of length 1 that is not rounding."""
        shortest = self.lengths[list(columns)].min(initial=np.inf)
        return min(max(NOTHING, self._rounding / max(shortest, 1e-300)), COARSE)

    @staticmethod
    def _smallest(table: np.ndarray) -> float:
        if table.shape[1] > table.shape[0]:
            return 0.0
        return float(np.linalg.svd(table, compute_uv=False)[-1])

    @property
    def basis(self) -> np.ndarray:
        """Indices of as many parameters as can be known if the others are."""
        found: list[int] = []
        # the strongest first: those with clear effects are chosen before weak ones
        for i in sorted(np.flatnonzero(self.there), key=lambda i: -self.lengths[i]):
            if not self.depend([*found, int(i)]):
                found.append(int(i))
        return np.array(sorted(found), int)


def combinations(effects: Effects, slopes: np.ndarray, names: Sequence[str]) -> list[Combination]:
    """Name what cannot be known.

    Parameters
    ----------
    slopes : ndarray, shape (parameters,)
        Derivatives of the parameters by the numbers of `effects`, in their units.
    """
    found = [Combination((names[i],), None) for i in np.flatnonzero(~effects.there)]
    classes = _classes(effects)
    found += [_sum(effects.table, slopes, names, group) for group in classes if len(group) > 1]
    found += [
        Combination(tuple(names[i] for i in circuit), None)
        for circuit in _circuits(effects, classes)
    ]
    return found


def _classes(effects: Effects) -> list[list[int]]:
    """Columns that are multiples of each other, together."""
    found: list[list[int]] = []
    for column in np.flatnonzero(effects.there).tolist():
        for group in found:
            if effects.depend([group[0], column]):
                group.append(column)
                break
        else:
            found.append([column])
    return found


def _sum(
    table: np.ndarray, slopes: np.ndarray, names: Sequence[str], group: Sequence[int]
) -> Combination:
    """Parameters whose effects are multiples of each other."""
    by_unit = table[:, group] / slopes[list(group)]
    relative = by_unit.T @ by_unit[:, 0] / (by_unit[:, 0] @ by_unit[:, 0])
    is_sum = np.allclose(np.abs(relative), 1.0, atol=EQUAL)
    return Combination(tuple(names[i] for i in group), relative if is_sum else None)


def _circuits(effects: Effects, classes: Sequence[Sequence[int]]) -> list[list[int]]:
    """Sets of three columns or more, one of a class, that depend on each other; small ones first.

    As many as there are combinations without effect, each with something that the others lack.
    """
    columns = [group[0] for group in classes]
    if len(columns) < 3:
        return []
    values, right = np.linalg.svd(effects.units[:, columns])[1:]
    values = np.append(values, np.zeros(len(columns) - len(values)))
    null = right[values <= effects.precision(columns)]
    weights = np.abs(null).max(axis=0, initial=0.0)
    part = [column for column, weight in zip(columns, weights, strict=True) if weight > TAKES_PART]
    found: list[list[int]] = []
    vectors = np.empty((0, len(part)))
    for size in range(3, min(len(part), MOST) + 1):
        for places in itertools.combinations(range(len(part)), size):
            if len(found) == len(null):
                return found
            chosen = [part[i] for i in places]
            vector = np.zeros((1, len(part)))
            vector[0, list(places)] = np.linalg.svd(effects.units[:, chosen])[2][-1]
            is_smallest = np.abs(vector[0, list(places)]).min() > TAKES_PART
            both = np.vstack([vectors, vector])
            is_new = np.linalg.svd(both, compute_uv=False)[-1] > TAKES_PART
            if effects.depend(chosen) and is_smallest and is_new:
                found.append(chosen)
                vectors = both
    return found if len(found) == len(null) else [*found, part]  # of more than is looked through
