"""Margins of a loop: by how much its gain, phase and delay may change until it becomes unstable.

The loop is broken at a signal: L is what comes back, with its sign changed, by what is sent in.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rparm.linearization.linear import Linear

SAME = 1e-9  # of the largest direction: states that inputs do not reach, or outputs do not see
AT_ZERO = 1e-5  # of the fastest pole: slower ones are multiple poles at 0, moved by rounding
ROUNDING = 1e-12  # relative: of a real part, a gain or a phase that is 0
MEANINGFUL = 1e6  # factors of the gain beyond it are those of rounding
PER_DECADE = 400  # frequencies that are searched for crossings
DECADES = 3  # below the slowest and above the fastest pole
BISECTIONS = 80

Response = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Crossing:
    """A frequency at which L has the gain 1 or the phase -180 degrees.

    Attributes
    ----------
    frequency : float
        rad/s.
    value : complex
        L there.
    """

    frequency: float
    value: complex


@dataclass(frozen=True)
class Margins:
    """What a loop bears; nan or inf if nothing of the kind makes it unstable.

    Attributes
    ----------
    stable : bool
        Whether the closed loop is stable; if not, it has no margins: they are nan.
    gain_up, gain_down : float
        Factors of the loop's gain, above and below 1, at which it loses stability; inf and 0 if
        none does.
    phase : float
        Further lag in degrees.
    delay : float
        Further delay in s.
    gain_crossings, phase_crossings : tuple of Crossing
        Where the gain is 1, and where the phase is -180 degrees.
    """

    stable: bool
    gain_up: float
    gain_down: float
    phase: float
    delay: float
    gain_crossings: tuple[Crossing, ...]
    phase_crossings: tuple[Crossing, ...]


def open_loop(broken: Linear) -> Linear:
    """L of a system that is broken: one input, and the output that fed it; minimal."""
    return minimal(replace(broken, C=-broken.C, D=-broken.D))


def margins(loop: Linear) -> Margins:
    """Margins of a loop L, which has one input and one output and is minimal."""
    response = frequency_response(loop)
    grid = frequencies(loop)
    gains = tuple(_crossings(response, grid, lambda value: np.log(np.abs(value))))
    turns = tuple(
        found
        for found in (
            *_crossings(response, grid, lambda value: np.sin(np.angle(value))),
            *_ends(loop),
        )
        if found.value.real < 0
    )
    factors = [1 / abs(found.value) for found in turns if abs(found.value) > 1 / MEANINGFUL]
    factors = [factor for factor in factors if factor > 1 / MEANINGFUL]
    lags = [(math.pi + float(np.angle(found.value))) % (2 * math.pi) for found in gains]
    delays = [lag / found.frequency for lag, found in zip(lags, gains, strict=True)]
    closed = closed_poles(loop)
    if not np.all(closed.real < -ROUNDING * np.abs(closed)):
        return Margins(False, math.nan, math.nan, math.nan, math.nan, gains, turns)
    return Margins(
        stable=True,
        gain_up=min((factor for factor in factors if factor > 1), default=math.inf),
        gain_down=max((factor for factor in factors if factor < 1), default=0.0),
        phase=math.degrees(min(lags, default=math.nan)),
        delay=min(delays, default=math.inf),
        gain_crossings=gains,
        phase_crossings=turns,
    )


def _ends(loop: Linear) -> Iterator[Crossing]:
    """Where L is real at its ends: at 0, if it has no pole there, and at infinity."""
    fastest = np.abs([*loop.poles, *closed_poles(loop)]).max(initial=0.0)
    if np.all(np.abs(loop.poles) > AT_ZERO * fastest):
        yield Crossing(0.0, complex(frequency_response(loop)(np.zeros(1))[0]))
    yield Crossing(math.inf, complex(loop.D[0, 0]))


def closed_poles(loop: Linear) -> np.ndarray:
    """Poles of the loop when it is closed, 1/s."""
    return np.linalg.eigvals(loop.A - loop.B @ loop.C / (1 + loop.D[0, 0]))


def frequency_response(model: Linear) -> Response:
    """The value of a model with one input and one output at frequencies in rad/s."""
    one = np.eye(len(model.A))

    def at(w: np.ndarray) -> np.ndarray:
        s = 1j * np.asarray(w)[:, None, None]
        return (model.C @ np.linalg.solve(s * one - model.A, model.B + 0 * s) + model.D)[:, 0, 0]

    return at


def frequencies(loop: Linear) -> np.ndarray:
    """Frequencies in rad/s at which something may happen, ascending."""
    rates = sizes([*loop.poles, *closed_poles(loop)])
    low, high = math.log10(rates.min()) - DECADES, math.log10(rates.max()) + DECADES
    return np.logspace(low, high, 1 + int(PER_DECADE * (high - low)))


def sizes(poles: Sequence[complex] | np.ndarray) -> np.ndarray:
    """Sizes of poles that are not 0, in 1/s; 1 if there is none."""
    rates = np.abs(poles)
    rates = rates[rates > AT_ZERO * rates.max(initial=0.0)]
    return rates if len(rates) else np.ones(1)


def _crossings(
    response: Response, grid: np.ndarray, function: Callable[[np.ndarray], np.ndarray]
) -> Iterator[Crossing]:
    """Where a function of L changes its sign, also if it is 0 at a frequency of the grid."""
    values = function(response(grid))
    clear = np.flatnonzero(np.abs(values) > ROUNDING)
    for i, j in zip(clear[:-1].tolist(), clear[1:].tolist(), strict=True):
        if np.sign(values[i]) == np.sign(values[j]):
            continue
        low, high = math.log(grid[i]), math.log(grid[j])
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            same = np.sign(function(response(np.array([math.exp(middle)])))[0])
            low, high = (middle, high) if same == np.sign(values[i]) else (low, middle)
        frequency = math.exp(low)
        yield Crossing(frequency, complex(response(np.array([frequency]))[0]))


def minimal(model: Linear) -> Linear:
    """The same response from inputs to outputs with as few states as it takes.

    States are combinations of the model's: they have no names of their own.
    """
    scale = _balance(model.A)
    A, B, C = model.A * scale / scale[:, None], model.B / scale[:, None], model.C * scale
    reached = _reached(A, B)
    A, B, C = reached.T @ A @ reached, reached.T @ B, C @ reached
    seen = _reached(A.T, C.T)
    A, B, C = seen.T @ A @ seen, seen.T @ B, C @ seen
    zeros = np.zeros(len(A))
    return Linear(
        states=tuple(f"z{i + 1}" for i in range(len(A))),
        inputs=model.inputs,
        outputs=model.outputs,
        A=A,
        B=B,
        C=C,
        D=model.D,
        x=zeros,
        u=model.u,
        y=model.y,
        rates=zeros,
    )


def _balance(A: np.ndarray) -> np.ndarray:
    """Scales of states that make rows and columns of about the same size."""
    from scipy.linalg import matrix_balance

    return matrix_balance(A, permute=False, separate=True)[1][0] if len(A) else np.ones(0)


def _reached(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the states that inputs reach, (n, r)."""
    n = len(A)
    basis = np.zeros((n, 0))
    new = B
    size = max(np.linalg.norm(A, 2), 1e-300) if n else 1.0
    while new.shape[1] and basis.shape[1] < n:
        for _ in range(2):  # twice is enough against rounding
            new = new - basis @ (basis.T @ new)
        directions, sizes, _ = np.linalg.svd(new, full_matrices=False)
        least = SAME * (size if basis.shape[1] else max(sizes.max(initial=0.0), 1e-300))
        kept = directions[:, sizes > least]
        basis = np.hstack([basis, kept])[:, :n]
        new = A @ kept
    return basis
