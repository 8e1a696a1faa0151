"""Margins of a loop: by how much its gain, phase and delay may change until it becomes unstable.

The loop is broken at a signal: L is what comes back, with its sign changed, by what is sent in.

Where a sampled loop is looked at is found in the plane of w, z = (1 + w T/2) / (1 - w T/2): the
unit circle becomes the imaginary axis, and frequencies tan(omega T/2) 2/T. A further delay is exact
in whole samples.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rparm.linearization import responses
from rparm.linearization.linear import Linear, cleared

ROUNDING = 1e-12  # relative, of a real part that is 0
GROWING = 1e-6  # relative, of the real part of a hidden pole: above is growth
DECADES = 2  # below the slowest and above the fastest pole, zero or crossing: where to search
FARTHEST = 1e8  # beyond these: zeros and crossings at 0 and infinity, moved by rounding
BISECTIONS = 60
Seen = tuple[np.ndarray, np.ndarray, np.ndarray]  # frequencies, L there, and bounds of its rounding


@dataclass(frozen=True)
class Crossing:
    """A frequency at which L has the gain 1 or the phase -180 degrees."""

    frequency: float  # rad/s
    value: complex  # L there


@dataclass(frozen=True)
class Peak:
    """A largest gain, and where it is."""

    frequency: float  # rad/s
    value: float


@dataclass(frozen=True)
class Margins:
    """Margins of a loop; nan or inf if nothing of the kind makes it unstable.

    Of the disk margin a, gains between (2 - a) / (2 + a) and its inverse are borne together with
    phases up to 2 atan(a / 2): 1 / a is the largest |S - 1/2|, with S = 1 / (1 + L).
    """

    stable: bool  # without it, all margins are nan; with poles that are hidden from the break
    gain_up: float  # factor of the loop's gain at which it loses stability
    gain_down: float  # another one, below 1; 0: none
    phase: float  # further lag in degrees
    delay: float  # further one in s
    gain_crossings: tuple[Crossing, ...]  # where the gain is 1
    phase_crossings: tuple[Crossing, ...]  # where the phase is -180 degrees
    disk: Peak  # at its frequency
    sensitivity: Peak  # of S
    complementary: Peak  # of L / (1 + L)


def open_loop(broken: Linear) -> Linear:
    """Return L of a system that is broken: one input, and the output that fed it; minimal."""
    return responses.minimal(replace(broken, C=-broken.C, D=-broken.D))


def margins(loop: Linear) -> Margins:
    """Return the margins of a loop L, which has one input and one output and is minimal."""
    grid, ends = searched(loop), _ends(loop)
    values, bounds = responses.bounded_response(loop)(grid)
    seen = grid, values, bounds
    gains = tuple(_crossings(loop, seen, lambda value: np.abs(value) - 1))
    turns = (
        *_crossings(loop, seen, np.imag),
        *(end for end, bound in ends if abs(end.value.real) > bound),
    )
    turns = tuple(found for found in turns if found.value.real < 0)
    if not is_stable(loop):
        none = Peak(math.nan, math.nan)
        return Margins(False, *[math.nan] * 4, gains, turns, none, none, none)
    factors = [1 / abs(found.value) for found in turns]
    delays = [lag(found) / found.frequency for found in gains]
    if not all(abs(end.value.real) + bound < 1 for end, bound in ends if end.frequency):
        delays.append(loop.dt)  # at high frequencies any delay is too much, or one of a sample
    back = _peak(loop, seen, ends, lambda value: 1 / (1 + value) - 0.5)
    return Margins(
        stable=True,
        gain_up=min((factor for factor in factors if factor > 1), default=math.inf),
        gain_down=max((factor for factor in factors if factor < 1), default=0.0),
        phase=math.degrees(min(map(lag, gains), default=math.nan)),
        delay=min(delays, default=math.inf),
        gain_crossings=gains,
        phase_crossings=turns,
        disk=replace(back, value=1 / back.value),
        sensitivity=_peak(loop, seen, ends, lambda value: 1 / (1 + value)),
        complementary=_peak(loop, seen, ends, lambda value: value / (1 + value)),
    )


def is_stable(loop: Linear) -> bool:
    """Return whether deviations die out when the loop is closed, hidden ones too.

    Hidden ones may stay where they are; where the break does not come to them they may also ring.
    """
    if not 1 + loop.D[0, 0]:
        return False
    poles = closed(loop).poles
    dying = np.abs(poles) < 1 - ROUNDING if loop.dt else poles.real < -ROUNDING * np.abs(poles)
    return bool(dying.all()) and not len(growing(loop)) and not len(ringing(loop, loop.cancelled))


def growing(loop: Linear) -> np.ndarray:
    """Return the rates, 1/s, of hidden poles that grow."""
    rates = loop.rates_of(loop.hidden)
    return rates[rates.real > GROWING * np.abs(rates)]


def ringing(loop: Linear, hidden: np.ndarray) -> np.ndarray:
    """Return the rates, 1/s, of hidden poles that neither grow nor die out, except those at 0."""
    rates = loop.rates_of(hidden)
    rings = np.abs(rates.imag) > (GROWING / loop.dt if loop.dt else 0.0)
    return rates[rings & (np.abs(rates.real) <= GROWING * np.abs(rates.imag))]


def lag(crossing: Crossing) -> float:
    """Return the further lag in rad that makes a crossing of gain 1 one of phase -180 degrees."""
    return (math.pi + float(np.angle(crossing.value))) % (2 * math.pi)


def _ends(loop: Linear) -> list[tuple[Crossing, float]]:
    """Return the ends of L where it is real, with bounds of their rounding.

    They are at 0, if it has no pole there, and at infinity or the end of a sampled loop.
    """
    w = np.array([0.0, math.pi / loop.dt] if loop.dt else [0.0])
    found = zip(w.tolist(), *responses.bounded_response(loop)(w), strict=True)
    ends = [(Crossing(at, complex(value.real)), float(bound)) for at, value, bound in found]
    if loop.dt:
        return ends
    at_infinity = Crossing(math.inf, complex(loop.D[0, 0])), 0.0
    return [*(ends if loop.poles.all() else []), at_infinity]


def _peak(
    loop: Linear,
    seen: Seen,
    ends: list[tuple[Crossing, float]],
    function: Callable[[np.ndarray], np.ndarray],
) -> Peak:
    """Find the largest size of a function of L."""
    from scipy.optimize import minimize_scalar

    response = responses.frequency_response(loop)

    grid, values, _ = seen
    i = int(np.nan_to_num(np.abs(function(values))).argmax())
    around = tuple(np.log(grid[[max(i - 1, 0), min(i + 1, len(grid) - 1)]]))
    found = minimize_scalar(
        lambda x: -float(np.abs(function(response(np.exp([x])))[0])),
        bounds=around,
        method="bounded",
        options={"xatol": 1e-12},
    )
    peaks = [Peak(math.exp(found.x), -float(found.fun))]
    clear = [end for end, bound in ends if bound < ROUNDING + GROWING * abs(end.value.real)]
    peaks += [Peak(end.frequency, float(abs(function(np.array(end.value))))) for end in clear]
    return max(peaks, key=lambda peak: peak.value)


def closed(loop: Linear) -> Linear:
    """Close the loop: from the request at the break to the value there."""
    through = 1 + loop.D[0, 0]
    back = loop.B @ loop.C / through
    A = cleared(loop.A - back, np.abs(loop.A) + np.abs(back))
    return replace(loop, A=A, B=loop.B / through, C=loop.C / through, D=loop.D / through)


def searched(loop: Linear) -> np.ndarray:
    """Return frequencies in rad/s between which L has one crossing at most, ascending.

    Crossings are zeros of L(s) L(-s) - 1 and L(s) - L(-s) on the axis, or with 1/z for -s on the
    unit circle. Rounding moves them as eigenvalues, so they only say where to look, as poles and
    zeros do.
    """
    scale = responses.suited(loop.A, loop.B, loop.C)
    A, B, C, D = loop.A * scale / scale[:, None], loop.B / scale[:, None], loop.C * scale, loop.D
    none, one, still = np.zeros_like(A), np.eye(len(A)), np.zeros_like(B)

    def zeros(mirrored: list[np.ndarray], last: list[np.ndarray]) -> np.ndarray:
        back, own = np.hstack(mirrored), np.hstack([none, one, still])
        whole, lead = (own, back) if loop.dt else (-back, own)
        whole = np.vstack([np.hstack([A, none, B]), whole, np.hstack(last)])
        lead = np.vstack([np.hstack([one, none, still]), lead, np.zeros((1, len(whole)))])
        return _finite(whole, lead, loop.dt)

    gains = zeros([C.T @ C, A.T, C.T @ D], [D @ C, B.T, D @ D - 1])
    turns = zeros([none, A, B], [C, -C, np.zeros((1, 1))])
    own = _finite(np.block([[A, B], [C, D]]), np.diag([*[1.0] * len(A), 0.0]), loop.dt)
    poles = np.array([*loop.poles, *closed(loop).poles])
    if loop.dt:
        poles = poles[np.abs(poles + 1) > ROUNDING]
        poles = 2 / loop.dt * (poles - 1) / (poles + 1)
    rates = np.abs(poles[poles != 0]) if poles.any() else np.ones(1)

    def near(found: np.ndarray) -> np.ndarray:
        size = np.abs(found)
        return found[(size > rates.min() / FARTHEST) & (size < rates.max() * FARTHEST)]

    found = near(np.concatenate([gains, turns]))
    further = [*np.abs(found), *np.abs(found.imag)]
    grid = responses.frequencies([*poles, *near(own)], further, DECADES)
    return 2 / loop.dt * np.arctan(grid * loop.dt / 2) if loop.dt else grid


def _finite(whole: np.ndarray, lead: np.ndarray, dt: float) -> np.ndarray:
    """Return the finite s, or w for z if sampled, at which whole - s lead is singular."""
    from scipy.linalg import eigvals

    if dt:
        moving = lead.any(axis=1, keepdims=True)
        whole, lead = whole - lead, np.where(moving, dt / 2 * (whole + lead), 0.0)
    found = eigvals(whole, lead)
    return found[np.isfinite(found)]


def _crossings(
    loop: Linear, seen: Seen, function: Callable[[np.ndarray], np.ndarray]
) -> Iterator[Crossing]:
    """Find where a function of L changes its sign, also if it is 0 at a frequency of the grid."""
    response = responses.frequency_response(loop)
    grid, values, bounds = seen
    clear = np.flatnonzero(np.abs(function(values)) > bounds)
    signs = np.sign(function(values[clear]))
    changes = np.flatnonzero(signs[:-1] != signs[1:])
    if not len(changes):
        return
    low, high, sign = grid[clear[changes]], grid[clear[changes + 1]], signs[changes]
    for _ in range(BISECTIONS):
        middle = np.sqrt(low * high)
        is_before = np.sign(function(response(middle))) == sign
        low, high = np.where(is_before, middle, low), np.where(is_before, high, middle)
    before, after = response(low), response(high)
    is_smooth = (before * after.conj()).real > 0  # else it is a pole on the axis
    for frequency, value in zip(low[is_smooth].tolist(), before[is_smooth].tolist(), strict=True):
        yield Crossing(frequency, value)
