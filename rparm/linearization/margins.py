"""Margins of a loop: by how much its gain, phase and delay may change until it becomes unstable.

The loop is broken at a signal: L is what comes back, with its sign changed, by what is sent in.

A sampled loop is taken to the plane of w by z = (1 + w T/2) / (1 - w T/2): the unit circle becomes
the imaginary axis, where gains and phases of L are the same and frequencies are tan(omega T/2) 2/T.
A further delay is exact in whole samples.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from rparm.errors import UserError
from rparm.linearization import responses
from rparm.linearization.linear import Linear, cleared, zeros

ROUNDING = 1e-12  # relative, of a real part that is 0
DECADES = 2  # below the slowest and above the fastest pole, zero or crossing: where to search
FARTHEST = 1e8  # beyond these: zeros and crossings at 0 and infinity, moved by rounding
BISECTIONS = 60


@dataclass(frozen=True)
class Crossing:
    """A frequency at which L has the gain 1 or the phase -180 degrees."""

    frequency: float  # rad/s
    value: complex  # L there


@dataclass(frozen=True)
class Margins:
    """Margins of a loop; nan or inf if nothing of the kind makes it unstable."""

    stable: bool  # without it, all margins are nan
    gain_up: float  # factor of the loop's gain at which it loses stability
    gain_down: float  # another one, below 1; 0: none
    phase: float  # further lag in degrees
    delay: float  # further one in s
    gain_crossings: tuple[Crossing, ...]  # where the gain is 1
    phase_crossings: tuple[Crossing, ...]  # where the phase is -180 degrees


def open_loop(broken: Linear) -> Linear:
    """Return L of a system that is broken: one input, and the output that fed it; minimal."""
    return responses.minimal(replace(broken, C=-broken.C, D=-broken.D))


def margins(loop: Linear) -> Margins:
    """Return the margins of a loop L, which has one input and one output and is minimal."""
    if loop.dt:
        in_w = _in_w(loop)
        found = margins(in_w)
        gains, turns = (
            tuple(_real(crossing, loop.dt) for crossing in crossings)
            for crossings in (found.gain_crossings, found.phase_crossings)
        )
        found = replace(found, gain_crossings=gains, phase_crossings=turns)
        # with a gain of 1 or more at the end of frequencies, a delay of one sample is too much
        delays = [*_delays(found), *([loop.dt] if abs(in_w.D[0, 0]) >= 1 else [])]
        delay = min(delays, default=math.inf)
        return replace(found, delay=delay) if found.stable else found
    grid = searched(loop)
    gains = tuple(_crossings(loop, grid, lambda value: np.abs(value) - 1))
    turns = (*_crossings(loop, grid, np.imag), *_ends(loop))
    turns = tuple(found for found in turns if found.value.real < 0)
    poles = closed(loop).poles if 1 + loop.D[0, 0] else np.zeros(1)
    if not np.all(poles.real < -ROUNDING * np.abs(poles)):
        return Margins(False, math.nan, math.nan, math.nan, math.nan, gains, turns)
    factors = [1 / abs(found.value) for found in turns]
    found = Margins(
        stable=True,
        gain_up=min((factor for factor in factors if factor > 1), default=math.inf),
        gain_down=max((factor for factor in factors if factor < 1), default=0.0),
        phase=math.degrees(min(map(lag, gains), default=math.nan)),
        delay=math.inf,
        gain_crossings=gains,
        phase_crossings=turns,
    )
    # at high frequencies any delay is too much
    delays = [*_delays(found), *([0.0] if abs(loop.D[0, 0]) >= 1 else [])]
    return replace(found, delay=min(delays, default=math.inf))


def lag(crossing: Crossing) -> float:
    """Return the further lag in rad that makes a crossing of gain 1 one of phase -180 degrees."""
    return (math.pi + float(np.angle(crossing.value))) % (2 * math.pi)


def _delays(found: Margins) -> list[float]:
    return [lag(crossing) / crossing.frequency for crossing in found.gain_crossings]


def _in_w(loop: Linear) -> Linear:
    """Take a sampled loop to the plane of w."""
    half, one = loop.dt / 2, np.eye(len(loop.A))
    try:
        inverse = np.linalg.inv(one + loop.A)
    except np.linalg.LinAlgError:
        raise UserError("the broken loop has a pole at -1: its margins are not known") from None
    A, B = inverse @ (loop.A - one) / half, inverse @ loop.B
    return replace(loop, A=A, B=B, C=2 / half * loop.C @ inverse, D=loop.D - loop.C @ B, dt=0.0)


def _real(crossing: Crossing, step: float) -> Crossing:
    """Return a crossing in the plane of w at its frequency."""
    return replace(crossing, frequency=2 / step * math.atan(crossing.frequency * step / 2))


def _ends(loop: Linear) -> Iterator[Crossing]:
    """Return the ends of L where it is real: at 0, if it has no pole there, and at infinity."""
    value, bound = (each[0] for each in responses.bounded_response(loop)(np.zeros(1)))
    if loop.poles.all() and abs(value) > bound:
        yield Crossing(0.0, complex(value))
    if loop.D[0, 0]:
        yield Crossing(math.inf, complex(loop.D[0, 0]))


def closed(loop: Linear) -> Linear:
    """Close the loop: from the request at the break to the value there."""
    through = 1 + loop.D[0, 0]
    back = loop.B @ loop.C / through
    A = cleared(loop.A - back, np.abs(loop.A) + np.abs(back))
    return replace(loop, A=A, B=loop.B / through, C=loop.C / through, D=loop.D / through)


def searched(loop: Linear) -> np.ndarray:
    """Return frequencies in rad/s between which L has one crossing at most, ascending.

    Crossings are zeros of L(s) L(-s) - 1 and L(s) - L(-s) on the axis. Rounding moves them as
    eigenvalues, so they only say where to look, as poles and zeros do.
    """
    if loop.dt:
        return 2 / loop.dt * np.arctan(searched(_in_w(loop)) * loop.dt / 2)
    scale = responses.suited(loop.A, loop.B, loop.C)
    A, B, C, D = loop.A * scale / scale[:, None], loop.B / scale[:, None], loop.C * scale, loop.D
    none = np.zeros_like(A)
    whole = np.block([[A, none], [-C.T @ C, -A.T]])
    gains = zeros(whole, np.vstack([B, -C.T @ D]), np.hstack([D @ C, B.T]), D @ D - 1)
    whole = np.block([[A, none], [none, -A]])
    turns = zeros(whole, np.vstack([B, -B]), np.hstack([C, -C]), np.zeros((1, 1)))
    poles = np.array([*loop.poles, *closed(loop).poles])
    rates = np.abs(poles[poles != 0]) if poles.any() else np.ones(1)

    def near(found: np.ndarray) -> np.ndarray:
        size = np.abs(found)
        return found[(size > rates.min() / FARTHEST) & (size < rates.max() * FARTHEST)]

    found = near(np.concatenate([gains, turns]))
    steep = [*poles, *near(zeros(A, B, C, D))]
    return responses.frequencies(steep, [*np.abs(found), *np.abs(found.imag)], DECADES)


def _crossings(
    loop: Linear, grid: np.ndarray, function: Callable[[np.ndarray], np.ndarray]
) -> Iterator[Crossing]:
    """Find where a function of L changes its sign, also if it is 0 at a frequency of the grid."""
    response = responses.frequency_response(loop)
    values, bounds = responses.bounded_response(loop)(grid)
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
