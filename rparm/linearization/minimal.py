"""The part of a linear model that lies between its inputs and its outputs.

Units do not decide what belongs to it: a small entry of A may be the inverse of a large mass.
"""

from dataclasses import dataclass, replace

import numpy as np

from rparm.linearization.linear import Linear
from rparm.linearization.matrices import cleared, closure, eigenvalues, scales

ROUNDING = 1e-11  # relative, of what is 0
SPREAD = 1e-6  # relative, of poles that are equal, by rounding
REFINEMENTS = 3  # of such a pole


def minimal(model: Linear) -> Linear:
    """Leave out states that inputs do not move or outputs do not see: `dropped`, `hidden`.

    If several move together, some of them stand for all.
    """
    ways = closure(model.A.T != 0)
    is_between = (model.B.any(axis=1) @ ways) & (ways @ model.C.any(axis=0))
    kept, rest = np.flatnonzero(is_between), np.flatnonzero(~is_between)
    hidden = [eigenvalues(model.A[np.ix_(rest, rest)])]
    A, B, C = model.A[np.ix_(kept, kept)], model.B[kept], model.C[:, kept]
    scale = suited(A, B, C)
    A, B, C = A * scale / scale[:, None], B / scale[:, None], C * scale
    while (found := _rule(A, B)) is not None:
        A, B, C, kept, scale = _ruled(found, A, B, C, kept, scale)
        hidden.append(found.poles)
    while (found := _rule(A.T, C.T)) is not None:
        A, C, B, kept, scale = (each.T for each in _ruled(found, A.T, C.T, B.T, kept, scale))
        hidden.append(found.poles)
    return replace(
        model,
        states=tuple(model.states[i] for i in kept),
        A=A / scale * scale[:, None],
        B=B * scale[:, None],
        C=C / scale,
        x=model.x[kept],
        rates=model.rates[kept],
        dropped=tuple(name for i, name in enumerate(model.states) if i not in kept),
        hidden=np.concatenate(hidden),
    )


def suited(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Units of states that suit the ways from inputs to outputs, too, shape (n,)."""
    sizes = np.block(
        [
            [np.abs(A), np.abs(B).sum(axis=1, keepdims=True)],
            [np.abs(C).sum(axis=0, keepdims=True), np.zeros((1, 1))],
        ]
    )
    found = scales(sizes)
    return found[:-1] / found[-1]


@dataclass(frozen=True, eq=False)
class _Rule:
    """Sums of states, W^T x, that no input moves, shape (n, 1 or 2), with their poles."""

    weights: np.ndarray
    poles: np.ndarray


def _rule(A: np.ndarray, B: np.ndarray) -> _Rule | None:
    """Sums of states that are 0 for ever if they are at first, if there are any.

    Such a sum is a left eigenvector of A that B is orthogonal to: w^T [A - p, B] = 0. Rows and
    columns of this matrix are scaled, as a fast mode behind a chain of slow states moves them
    little, but not by rounding.
    """
    one = np.eye(len(A))
    for found in eigenvalues(A):
        p = found if abs(found.imag) > SPREAD * abs(found) else found.real
        for _ in range(REFINEMENTS):
            moved = cleared(A - p * one, np.abs(A) + abs(p) * one)
            whole, rows = _equilibrated(np.hstack([moved, B]))
            left, values, _ = np.linalg.svd(whole)
            w = left[:, -1].conj()
            w = np.where(np.abs(w) > ROUNDING * np.abs(w).max(), w, 0) * rows
            w /= np.linalg.norm(w)
            if values[-1] < ROUNDING * values[0]:
                parts = [w.real, w.imag] if np.iscomplex(p) else [w]
                return _Rule(np.column_stack(parts), np.array([p, np.conj(p)][: len(parts)]))
            p = w @ A @ w.conj()
    return None


def _equilibrated(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale rows and columns so that entries are near 1; return the matrix and the rows' factors.

    The sum of the squares of the entries' logarithms is least.
    """
    i, j = np.nonzero(matrix)
    count, n = len(i), len(matrix)
    places = np.zeros((count, sum(matrix.shape)))
    places[np.arange(count), i] = places[np.arange(count), n + j] = 1.0
    factors = np.exp(np.linalg.lstsq(places, -np.log(np.abs(matrix[i, j])), rcond=None)[0])
    return matrix * factors[:n, None] * factors[n:], factors[:n]


def _ruled(
    rule: _Rule, A: np.ndarray, B: np.ndarray, C: np.ndarray, kept: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, ...]:
    """The same without the states that a rule gives by others, as many as it has sums."""
    from scipy.linalg import qr

    order = qr(rule.weights.T, pivoting=True)[2]
    count = rule.weights.shape[1]
    rest, own = order[:count], np.sort(order[count:])
    by_own = -np.linalg.solve(rule.weights[rest].T, rule.weights[own].T)
    whole = np.vstack([A[own], C])
    terms = np.abs(whole[:, own]) + np.abs(whole[:, rest]) @ np.abs(by_own)
    whole = cleared(whole[:, own] + whole[:, rest] @ by_own, terms)
    return whole[: len(own)], B[own], whole[len(own) :], kept[own], scale[own]
