"""Responses at frequencies, the frequencies to look at, and the minimal part of a linear model.

The minimal part lies between inputs and outputs. Which entries are 0 decides what belongs to it,
and of states that last also which sums cancel, each compared with its own terms: a small entry of A
may be the inverse of a large mass.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from rparm.errors import UserError
from rparm.linearization.linear import Linear, cleared, closure, eigenvalues, scales

ROUNDING = 1e-15  # relative, of entries and operations
PER_DECADE = 200  # frequencies of a grid, everywhere
STEEP = 12  # and of the distances from a pole or zero, in decades of these
NEAREST = 0.03  # of these distances, of the damped part of the pole or zero
UNDAMPED = 1e-9  # damping below which a pole or zero is taken to have this one
AT_ONCE = 10**6  # entries of matrices that are solved in one call
Response = Callable[[np.ndarray], np.ndarray]
Answers = tuple[np.ndarray, ...]
NEGLIGIBLE = 1e-11  # of its terms: a sum that is 0
SPREAD = 1e-6  # relative, of poles that are equal, by rounding
REFINEMENTS = 3  # of such a pole
CHECKED, SAME = 30, 1e-4  # frequencies, and relative difference, of what should be the same


@dataclass(frozen=True, eq=False)
class _Transfer:
    """C (p - A)^-1 B + D with one input and one output, in units that suit it."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    size: float  # of the points, whose difference to A rounds; 0: it is exact

    def values(self, p: np.ndarray) -> np.ndarray:
        """Return values at p (k,)."""
        return self._in_parts(p, lambda matrices: (self._value(self._states(matrices)),))[0]

    def bounded(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the values at p (k,), and bounds of their rounding."""
        return self._in_parts(p, self._bounded)

    def _in_parts(self, p: np.ndarray, function: Callable[[np.ndarray], Answers]) -> Answers:
        n = len(self.A)
        size = max(1, AT_ONCE // max(1, n) ** 2)
        parts = [p[i : i + size, None, None] * np.eye(n) - self.A for i in range(0, len(p), size)]
        answers = [function(matrices) for matrices in parts]
        return tuple(np.concatenate(each) for each in zip(*answers, strict=True))

    def _bounded(self, matrices: np.ndarray) -> Answers:
        x = self._states(matrices)
        z = _solved(matrices.transpose(0, 2, 1), self.C.T)
        least = ROUNDING * (2 + len(self.A))
        sizes = np.abs(matrices) + 2 * self.size * np.eye(len(self.A))
        left = np.abs(self.B - matrices @ x) + least * sizes @ np.abs(x)
        bounds = np.abs(z).transpose(0, 2, 1) @ left
        bounds = bounds + least * (np.abs(self.C) @ np.abs(x) + np.abs(self.D))
        return self._value(x), bounds[:, 0, 0]

    def _states(self, matrices: np.ndarray) -> np.ndarray:
        return _solved(matrices, self.B)

    def _value(self, states: np.ndarray) -> np.ndarray:
        return (self.C @ states + self.D)[:, 0, 0]


def _solved(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve for (k, n, 1), refined once: rounding is relative to each entry; nan at a pole."""
    right = np.broadcast_to(right.astype(complex), (len(matrices), *right.shape[-2:]))
    try:
        x = np.linalg.solve(matrices, right)
        return x + np.linalg.solve(matrices, right - matrices @ x)
    except np.linalg.LinAlgError:  # one of them is singular
        if len(matrices) == 1:
            return np.full_like(right, np.nan)
        middle = len(matrices) // 2
        halves = [_solved(matrices[part], right[part]) for part in np.s_[:middle, middle:]]
        return np.concatenate(halves)


def bounded_response(model: Linear) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Return the response of one output to one input over rad/s, and bounds of its rounding."""
    transfer = _transfer(model)
    return lambda w: transfer.bounded(model.points(w))


def frequency_response(model: Linear) -> Response:
    """Return the response of one output to one input over frequencies in rad/s; nan at a pole."""
    transfer = _transfer(model)
    return lambda w: transfer.values(model.points(w))


def _transfer(model: Linear) -> _Transfer:
    scale = suited(model.A, model.B, model.C)
    A, B, C = model.A * scale / scale[:, None], model.B / scale[:, None], model.C * scale
    return _Transfer(A, B, C, model.D, float(model.dt > 0))


def frequencies(steep: Iterable[complex], further: Iterable[float], decades: float) -> np.ndarray:
    """Choose ascending frequencies in rad/s, dense around poles and zeros, on both sides of each.

    `steep` are poles and zeros in 1/s, without 0; `further` are other frequencies to surround. The
    result goes `decades` beyond the slowest and the fastest.
    """
    steep = np.array([p for p in steep if p != 0], complex)
    sides = np.abs([*steep, *steep.imag, *further])
    sides = np.unique(sides[(sides > 0) & np.isfinite(sides)])
    sides = sides if len(sides) else np.ones(1)
    low, high = np.log10(sides[[0, -1]]) + [-decades, decades]
    parts = [np.logspace(low, high, 1 + int(PER_DECADE * (high - low)))]
    parts.append(np.sqrt(sides[:-1] * sides[1:]))
    for p in steep[(steep.imag > 0) & (np.abs(steep.real) < steep.imag)]:
        width = max(abs(p.real), UNDAMPED * p.imag)
        count = 1 + int(STEEP * np.log10(p.imag / (NEAREST * width)))
        distances = np.geomspace(NEAREST * width, p.imag, count)
        parts += [p.imag - distances[:-1], p.imag + distances]
    return np.unique(np.concatenate(parts))


# ---- The minimal part ----------------------------------------------------------------------------
def minimal(model: Linear) -> Linear:
    """Leave out states that inputs do not move or outputs do not see.

    Of states that do not die out some may stand for others, whose poles zeros cancel. UserError if
    what is left answers otherwise.
    """
    ways = closure(model.A.T != 0)
    is_between = (model.B.any(axis=1) @ ways) & (ways @ model.C.any(axis=0))
    kept, rest = np.flatnonzero(is_between), np.flatnonzero(~is_between)
    hidden, cancelled = eigenvalues(model.A[np.ix_(rest, rest)]), [np.zeros(0, complex)]
    A, B, C = model.A[np.ix_(kept, kept)], model.B[kept], model.C[:, kept]
    scale = suited(A, B, C)
    A, B, C = A * scale / scale[:, None], B / scale[:, None], C * scale
    while (found := _rule(A, B, model.dt)) is not None:
        A, B, C, kept, scale = _ruled(found, A, B, C, kept, scale)
        cancelled.append(found.poles)
    while (found := _rule(A.T, C.T, model.dt)) is not None:
        A, C, B, kept, scale = (each.T for each in _ruled(found, A.T, C.T, B.T, kept, scale))
        cancelled.append(found.poles)
    result = replace(
        model,
        states=tuple(model.states[i] for i in kept),
        A=A / scale * scale[:, None],
        B=B * scale[:, None],
        C=C / scale,
        x=model.x[kept],
        rates=model.rates[kept],
        dropped=tuple(name for i, name in enumerate(model.states) if i not in kept),
        hidden=np.concatenate([hidden, *cancelled]),
        cancelled=np.concatenate(cancelled),
    )
    check_same(model, result)
    return result


def check_same(model: Linear, part: Linear) -> None:
    """Refuse a part whose responses, or poles with those that it hides, are not the model's."""
    rates = np.abs(model.rates_of(model.poles))
    rates = rates[(rates > 0) & np.isfinite(rates)]
    low, high = (rates.min(), rates.max()) if len(rates) else (1.0, 1.0)
    if model.dt:
        low, high = min(low, 0.1 / model.dt), math.pi / model.dt / 1.5
    w = np.geomspace(low / 3, high * 1.5, CHECKED)
    (values, bounds), (others, further) = (bounded_response(each)(w) for each in (model, part))
    size = np.maximum(np.abs(values), np.abs(others))
    is_same = ~(np.abs(values - others) > SAME * size + bounds + further)
    p = model.points(w)[:, None]
    (signs, sizes, rounding), (turned, logs, more) = (
        _characteristic(each.A, p[..., None]) for each in (model, part)
    )
    away = p - part.hidden
    logs = logs + np.log(np.abs(away)).sum(axis=1)
    turned = turned * (away / np.abs(away)).prod(axis=1)
    is_same &= ~(np.abs(turned / signs * np.exp(logs - sizes) - 1) > SAME + rounding + more)
    if not is_same.all():
        why = "rounding hides which states are in the loop, and its margins"
        raise UserError(f"--break {model.inputs[0]}: {why}: expected another break")


def _characteristic(A: np.ndarray, p: np.ndarray) -> Answers:
    """Return the sign and the logarithm of det(p - A) at p (k, 1, 1), and its relative rounding."""
    scale, one = scales(A), np.eye(len(A))
    A = A * scale / scale[:, None]
    matrices = p * one - A
    try:
        back = np.abs(np.linalg.inv(matrices)).transpose(0, 2, 1)
    except np.linalg.LinAlgError:  # p is a pole
        back = np.full(matrices.shape, np.inf)
    terms = (back * (np.abs(A) + np.abs(p) * one)).sum(axis=(1, 2))
    return *np.linalg.slogdet(matrices), ROUNDING * (2 + len(A)) * terms


def suited(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> np.ndarray:
    """Return units of states that suit the ways from inputs to outputs, too, shape (n,)."""
    above = [np.abs(A), np.abs(B).sum(axis=1, keepdims=True)]
    below = [np.abs(C).sum(axis=0, keepdims=True), np.zeros((1, 1))]
    found = scales(np.block([above, below]))
    return found[:-1] / found[-1]


@dataclass(frozen=True, eq=False)
class _Rule:
    """Sums of states, W^T x, that no input moves, shape (n, 1 or 2), with their poles."""

    weights: np.ndarray
    poles: np.ndarray


def _rule(A: np.ndarray, B: np.ndarray, dt: float) -> _Rule | None:
    """Find sums of states that are 0 for ever if they are at first; of a sampled A lasting ones.

    Such a sum is a left eigenvector of A that B is orthogonal to: w^T [A - p, B] = 0. Scaling shows
    what moves them little, but not by rounding.
    """
    one = np.eye(len(A))
    for found in eigenvalues(A):
        if dt and abs(found) < 1 - SPREAD:  # it dies out, and sampling rounds what cancels
            continue
        p = found if abs(found.imag) > SPREAD * abs(found) else found.real
        if dt and abs(abs(p) - 1) < SPREAD and np.isreal(p):
            p = np.sign(p)
        for _ in range(REFINEMENTS):
            moved = cleared(A - p * one, np.abs(A) + abs(p) * one)
            whole, rows = _equilibrated(np.hstack([moved, B]))
            left = np.linalg.svd(whole)[0]
            w = left[:, -1].conj()
            w = np.where(np.abs(w) > NEGLIGIBLE * np.abs(w).max(), w, 0) * rows
            w /= np.linalg.norm(w)
            terms = np.abs(w) @ np.hstack([np.abs(A) + abs(p) * one, np.abs(B)])
            if (np.abs(w @ np.hstack([moved, B])) <= NEGLIGIBLE * terms).all():
                parts = [w.real, w.imag] if np.iscomplex(p) else [w]
                return _Rule(np.column_stack(parts), np.array([p, np.conj(p)][: len(parts)]))
            p = w @ A @ w.conj()
    return None


def _equilibrated(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale rows and columns so that entries are near 1; return matrix and factors of rows."""
    i, j = np.nonzero(matrix)
    count, n = len(i), len(matrix)
    places = np.zeros((count, sum(matrix.shape)))
    places[np.arange(count), i] = places[np.arange(count), n + j] = 1.0
    factors = np.exp(np.linalg.lstsq(places, -np.log(np.abs(matrix[i, j])), rcond=None)[0])
    return matrix * factors[:n, None] * factors[n:], factors[:n]


def _ruled(
    rule: _Rule, A: np.ndarray, B: np.ndarray, C: np.ndarray, kept: np.ndarray, scale: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Remove the states that a rule gives by others, as many as it has sums."""
    from scipy.linalg import qr

    order = qr(rule.weights.T, pivoting=True)[2]
    count = rule.weights.shape[1]
    rest, own = order[:count], np.sort(order[count:])
    by_own = -np.linalg.solve(rule.weights[rest].T, rule.weights[own].T)
    whole = np.vstack([A[own], C])
    terms = np.abs(whole[:, own]) + np.abs(whole[:, rest]) @ np.abs(by_own)
    whole = cleared(whole[:, own] + whole[:, rest] @ by_own, terms)
    return whole[: len(own)], B[own], whole[len(own) :], kept[own], scale[own]
