"""Matrices of linear models: eigenvalues and zeros, with units and rates many decades apart."""

import numpy as np

CANCELLED = 1e-13  # of the terms of a sum: what rounding leaves if it is 0
ROUNDING = 1e-15  # relative, for each row and column: of singular values that are 0


def eigenvalues(A: np.ndarray) -> np.ndarray:
    """Eigenvalues of A, shape (n,): those that are 0 exactly so, also if they are multiple.

    States that influence each other form a block. Blocks are taken one by one, each in units that
    suit it: so neither units nor fast poles of other blocks cost accuracy.
    """
    both = closure(A.T != 0)
    both &= both.T
    found = [
        _of_block(A[np.ix_(block, block)])
        for i in range(len(A))
        if not (block := np.flatnonzero(both[i]))[0] < i
    ]
    return np.concatenate([np.zeros(0, complex), *found])


def _of_block(A: np.ndarray) -> np.ndarray:
    """Eigenvalues of states that all influence each other."""
    if len(A) == 1:
        return A[0].astype(complex)
    scale = scales(A)
    A = A * scale / scale[:, None]
    size, zeros = np.linalg.norm(A, 2), 0
    while len(A):  # take poles at 0 out, which rounding would spread if they are multiple
        _, values, rows = np.linalg.svd(A)
        if values[-1] > len(A) * ROUNDING * size:
            break
        v = rows[-1]
        k = int(np.abs(v).argmax())
        rest = np.arange(len(A)) != k
        A = A[np.ix_(rest, rest)] - np.outer(v[rest] / v[k], A[k, rest])
        zeros += 1
    return np.concatenate([np.zeros(zeros, complex), np.linalg.eigvals(A)])


def zeros(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray) -> np.ndarray:
    """Finite zeros of C (s - A)^-1 B + D, which has one input and one output."""
    from scipy.linalg import eigvals

    n = len(A)
    found = eigvals(np.block([[A, B], [C, D]]), np.diag([1.0] * n + [0.0]))
    return found[np.isfinite(found)]


def cleared(entries: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Entries with 0 where their terms, whose sizes add up to `terms`, cancel but for rounding."""
    return np.where(np.abs(entries) > CANCELLED * terms, entries, 0.0)


def closure(arrows: np.ndarray) -> np.ndarray:
    """Which nodes can be reached from which, (nodes, nodes), in no step or more."""
    reached = arrows | np.eye(len(arrows), dtype=bool)
    while True:
        further = reached @ reached
        if np.array_equal(further, reached):
            return reached
        reached = further


def scales(A: np.ndarray) -> np.ndarray:
    """Units of states, powers of 2, that make rows and columns of about the same size."""
    from scipy.linalg import matrix_balance

    return matrix_balance(A, permute=False, separate=True)[1][0] if len(A) else np.ones(0)
