"""Two joints at rest: the decision is the answer of a quadratic program solved in another way.

Gauss' principle, min a'Da/2 - b'a + sum F|a| with the stops as bounds, as its dual: friction is
what comes nearest to holding the joints, min over |lambda_i| <= F_i (one-sided at a stop) of
(b - lambda)' D^-1 (b - lambda) / 2, by accelerated projected gradients on 4000 cases at once.
"""

from pathlib import Path

import numpy as np

from tests.rp_plant.plant_rows import decide

CASES = 4000
MOST_ITERATIONS = 200_000


def random_cases(random: np.random.Generator) -> tuple[np.ndarray, ...]:
    """D11, D12, D22 (n, 3); forces, breakaway, at_rest, closed, (n, 2) each."""
    J, m = 10 ** random.uniform(-1.5, 1, (2, CASES))
    a = random.uniform(-1, 1, CASES)
    inertia = np.stack([J + m * a**2, -m * a, m + random.uniform(0, 0.5, CASES)], axis=1)
    sizes = np.sqrt(inertia[:, [0, 2]]) * 10 ** random.uniform(-0.5, 0.5, (CASES, 2))
    forces = sizes * random.uniform(-2, 2, (CASES, 2))
    breakaway = sizes * (random.integers(0, 8, (CASES, 2)) != 0)
    at_rest = random.integers(0, 8, (CASES, 2)) != 0
    closed = at_rest * random.integers(-1, 2, (CASES, 2)) * (random.integers(0, 2, (CASES, 2)))
    return inertia, forces, breakaway, at_rest, closed


def project(forces: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.minimum(np.maximum(forces, low), high)


def quadratic_program(
    inertia: np.ndarray, forces: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The holding forces, (n, 2), in coordinates in which D has a diagonal of ones."""
    unit = 1 / np.sqrt(inertia[:, [0, 2]])
    coupling = inertia[:, 1] * unit[:, 0] * unit[:, 1]
    inverse = np.empty((CASES, 2, 2))
    inverse[:, 0, 0] = inverse[:, 1, 1] = 1
    inverse[:, 0, 1] = inverse[:, 1, 0] = -coupling
    inverse /= (1 - coupling**2)[:, None, None]
    step = (1 - np.abs(coupling))[:, None]  # 1 by the largest eigenvalue
    b, bottom, top = forces * unit, low * unit, high * unit
    # strongly convex: the largest over the smallest eigenvalue gives the momentum
    root = np.sqrt((1 - np.abs(coupling)) / (1 + np.abs(coupling)))
    momentum = ((1 - root) / (1 + root))[:, None]
    now = ahead = project(b, bottom, top)
    for _ in range(MOST_ITERATIONS):
        gradient = np.einsum("nij,nj->ni", inverse, ahead - b)
        then = project(ahead - step * gradient, bottom, top)
        moved = np.max(np.abs(then - now))
        ahead = then + momentum * (then - now)
        now = then
        if moved < 1e-15:
            break
    return now / unit


def test_decision_is_that_of_the_quadratic_program(program: Path) -> None:
    inertia, forces, breakaway, at_rest, closed = random_cases(np.random.default_rng(16))
    found = decide(program, inertia, forces, breakaway, at_rest, closed)

    # lambda = friction - stop; a joint that moves has none
    low = np.where(at_rest, np.where(closed > 0, -np.inf, -breakaway), 0)
    high = np.where(at_rest, np.where(closed < 0, np.inf, breakaway), 0)
    held = quadratic_program(inertia, forces, low, high)
    left = forces - held
    D11, D12, D22 = inertia.T
    determinant = D11 * D22 - D12**2
    accelerations = (
        np.stack([D22 * left[:, 0] - D12 * left[:, 1], D11 * left[:, 1] - D12 * left[:, 0]], axis=1)
        / determinant[:, None]
    )

    scale = np.abs(forces) + breakaway + 1e-3
    np.testing.assert_array_less(np.abs(held - found.reactions), 1e-9 * scale)
    largest = np.sum(scale, axis=1, keepdims=True) * ((D11 + D22) / determinant)[:, None]
    np.testing.assert_array_less(np.abs(accelerations - found.accelerations) - 1e-9 * largest, 0)
    counts = [
        np.sum(np.all(found.pattern == [i, j], axis=1)) for i in (-1, 0, 1) for j in (-1, 0, 1)
    ]
    assert min(counts) > CASES / 100
