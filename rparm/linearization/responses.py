"""Responses at frequencies, and the frequencies at which a response has to be looked at."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from rparm.linearization.linear import Linear, hold
from rparm.linearization.minimal import suited

ROUNDING = 1e-15  # relative, of entries and operations
PER_DECADE = 200  # frequencies of a grid, everywhere
STEEP = 12  # and of the distances from a pole or zero, in decades of these
NEAREST = 0.03  # of these distances, of the damped part of the pole or zero
UNDAMPED = 1e-9  # damping below which a pole or zero is taken to have this one
AT_ONCE = 10**6  # entries of matrices that are solved in one call

Response = Callable[[np.ndarray], np.ndarray]
Answers = tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class _Transfer:
    """C (p - A)^-1 B + D with one input and one output, in units that suit it."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    def values(self, p: np.ndarray) -> np.ndarray:
        """Values at p (k,)."""
        return self._in_parts(p, lambda matrices: (self._value(self._states(matrices)),))[0]

    def bounded(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values at p (k,), and bounds of their rounding."""
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
        left = np.abs(self.B - matrices @ x) + least * np.abs(matrices) @ np.abs(x)
        bounds = np.abs(z).transpose(0, 2, 1) @ left
        bounds = bounds + least * (np.abs(self.C) @ np.abs(x) + np.abs(self.D))
        return self._value(x), bounds[:, 0, 0]

    def _states(self, matrices: np.ndarray) -> np.ndarray:
        return _solved(matrices, self.B)

    def _value(self, states: np.ndarray) -> np.ndarray:
        return (self.C @ states + self.D)[:, 0, 0]


def _solved(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions (k, n, 1), refined once: so rounding is relative to each entry; nan at a pole."""
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
    """Values of a model with one input and one output at rad/s, and bounds of their rounding."""
    transfer = _transfer(model)
    return lambda w: transfer.bounded(1j * np.asarray(w))


def frequency_response(model: Linear) -> Response:
    """Values of a model with one input and one output at frequencies in rad/s; nan at a pole."""
    transfer = _transfer(model)
    return lambda w: transfer.values(1j * np.asarray(w))


def _transfer(model: Linear) -> _Transfer:
    scale = suited(model.A, model.B, model.C)
    A, B, C = model.A * scale / scale[:, None], model.B / scale[:, None], model.C * scale
    return _Transfer(A, B, C, model.D)


def sampled_response(model: Linear, step: float) -> Response:
    """As `frequency_response`, of the model that is sampled, with inputs held in between."""
    transition, forced, _ = hold(model.A, model.B, step)
    transfer = _Transfer(transition, forced, model.C, model.D)
    return lambda w: transfer.values(np.exp(1j * step * np.asarray(w)))


def frequencies(steep: Iterable[complex], further: Iterable[float], decades: float) -> np.ndarray:
    """Frequencies in rad/s, ascending, that show what a response does.

    They are dense around poles and zeros, lie on both sides of each, and go beyond all of them.

    Parameters
    ----------
    steep : iterable of complex
        Poles and zeros, 1/s; those that are 0 are none.
    further : iterable of float
        Other frequencies to have on both sides.
    decades : float
        How far to go beyond the slowest and the fastest.
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
