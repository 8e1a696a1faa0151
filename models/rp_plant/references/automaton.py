"""What the joints of the plant do at an instant, from the mathematics: who moves, who is held.

Gauss' principle and the impact law are minima of convex functions of two variables; each is found
by descent along the coordinates, in turn, until nothing changes.
"""

from collections.abc import Sequence

import numpy as np

from rparm.errors import UserError

MOST_SWEEPS = 20_000
MOST_IMPACTS = 50  # at one instant, of two joints that drive each other into their stops
real = np.longdouble


def descend(
    matrix: np.ndarray, vector: np.ndarray, cost: Sequence, low: Sequence, high: Sequence
) -> np.ndarray:
    """Return x in low <= 0 <= high with the least x' M x / 2 - vector' x + sum cost |x|, (2,)."""
    x = np.zeros(2, real)
    for _ in range(MOST_SWEEPS):
        before = x.copy()
        for i in (0, 1):
            pull = vector[i] - matrix[i, 1 - i] * x[1 - i]
            beyond = np.sign(pull) * max(abs(pull) - cost[i], real(0))
            x[i] = min(max(beyond / matrix[i, i], low[i]), high[i])
        if np.all(np.abs(x - before) <= 2 * np.finfo(real).eps * np.abs(x)):
            return x
    raise UserError("descent does not end")


def accelerations(
    inertia: np.ndarray,
    forces: np.ndarray,
    at_rest: Sequence[bool],
    breakaway: np.ndarray,
    closed: Sequence[int],
) -> np.ndarray:
    """Return accelerations of both joints by Gauss' principle, (2,); joints not `at_rest` move.

    `forces` are without stops and dry friction at rest. `closed`: a joint rests on its lower stop
    (+1), its upper one (-1), or none (0).
    """
    cost = [breakaway[i] if at_rest[i] else real(0) for i in (0, 1)]
    low = [real(0) if at_rest[i] and closed[i] > 0 else -np.inf for i in (0, 1)]
    high = [real(0) if at_rest[i] and closed[i] < 0 else np.inf for i in (0, 1)]
    return descend(inertia, forces, cost, low, high)


def impulses(
    inertia: np.ndarray, rates: np.ndarray, side: Sequence[int], restitution: Sequence[float]
) -> np.ndarray:
    """Return impulses P of the stops, (2,): P >= 0, dq+ + e dq- >= 0, away from them, one is 0.

    A contact is a joint on a stop (`side` as `closed` above) that stays: conditions of the minimum
    of P' D^-1 P / 2 + P' (1 + e) dq-.
    """
    determinant = inertia[0, 0] * inertia[1, 1] - inertia[0, 1] ** 2
    mobility = (
        np.array([[inertia[1, 1], -inertia[0, 1]], [-inertia[0, 1], inertia[0, 0]]], real)
        / determinant
    )
    away = np.array(side, real)
    approach = away * rates
    contact = [side[i] != 0 and approach[i] <= 0 for i in (0, 1)]
    high = [np.inf if contact[i] else real(0) for i in (0, 1)]
    wanted = -(1 + np.array(restitution, real)) * approach
    signed = mobility * np.outer(np.where(away == 0, 1, away), np.where(away == 0, 1, away))
    pushes = descend(signed, wanted, (real(0),) * 2, (real(0),) * 2, high)
    return away * pushes


def after_impact(inertia: np.ndarray, rates: np.ndarray, impulse: np.ndarray) -> np.ndarray:
    """Velocities dq- + D^-1 P, (2,)."""
    determinant = inertia[0, 0] * inertia[1, 1] - inertia[0, 1] ** 2
    change = np.array(
        [
            inertia[1, 1] * impulse[0] - inertia[0, 1] * impulse[1],
            inertia[0, 0] * impulse[1] - inertia[0, 1] * impulse[0],
        ]
    )
    return rates + change / determinant
