"""Fits parameters, and a start state of each segment, by Levenberg and Marquardt's method.

Segments share the parameters only. So the equations of a step are an arrow: orthogonal
transformations take the start states out, segment by segment.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rparm.identification.residuals import Linear, Problem

MOST_STEPS = 60
LONGEST = 1.0  # step of a parameter: e times its distance from a limit, or once its scale
FIRST_RIDGE, LEAST_RIDGE, MOST_RIDGE = 1e-3, 1e-10, 1e8
NEGLIGIBLE = 1e-3  # what a step may still gain, in standard deviations squared
ROUGH = 0.01  # of the cost: what a step gains where the first steps end
FLAT = 0.05  # the same, what a step has gained: less ends the fit
UNKNOWN = 1e-6  # singular value of a direction that the fit cannot know
SMALLEST = 1e-3  # of the largest effect of a state: its weight in the ridge where it has none


@dataclass(frozen=True, eq=False)
class Solution:
    """Where the fit has ended."""

    z: np.ndarray  # (parameters,)
    x: np.ndarray  # (segments, states), of their scales
    cost: float  # sum of the squares of the residuals
    steps: int
    has_converged: bool


def fit(problem: Problem, x: np.ndarray) -> Solution:
    """Fit from the parameters' starts and the states `x` (segments, states).

    An output that is measured much more exactly than others would lead the first steps astray: at
    first each is weighted by how far it is off.
    """
    z = np.zeros(len(problem.parameters))
    rough = replace(problem, noise=np.maximum(problem.noise, problem.misfit(z, x)))
    near = _descended(rough, z, x, ROUGH)
    found = _descended(problem, near.z, near.x)
    return replace(found, steps=near.steps + found.steps)


def _descended(problem: Problem, z: np.ndarray, x: np.ndarray, enough: float = 0.0) -> Solution:
    """Steps from a point, until they gain no more; or less than a share `enough` of the cost."""
    (cost, x), ridge = problem.tried(z, x, x), FIRST_RIDGE
    refused = np.zeros(x.shape)  # direction in which the FMU refuses a step of a state, or 0
    rows = max(sum(int(s.counts.sum()) for s in problem.segments) * len(problem.noise), 1)
    for step in range(MOST_STEPS):
        arrow = _Arrow(problem.linear(z, x), refused)
        if arrow.gain() <= NEGLIGIBLE * cost / rows:
            return Solution(z, x, cost, step, True)
        while True:
            to_x, to_z = arrow.step(ridge)
            to_z *= LONGEST / max(LONGEST, np.abs(to_z).max(initial=0.0))
            new_z = problem.parameters.kept(z + to_z)
            new_cost, new_x = problem.tried(new_z, x + to_x, x)
            refused = np.where((new_x == x) & (to_x != 0), np.sign(to_x), arrow.refused)
            if new_cost < cost:
                break
            if ridge > MOST_RIDGE:  # nothing is to be gained
                return Solution(z, x, cost, step, arrow.gain() < rows * 1e-6 * cost)
            ridge *= 10
        gained, z, x, cost = cost - new_cost, new_z, new_x, new_cost
        ridge = max(ridge / 10, LEAST_RIDGE)
        if gained < max(FLAT / rows, enough) * cost:
            return Solution(z, x, cost, step + 1, True)
    return Solution(z, x, cost, MOST_STEPS, False)


class _Arrow:
    """The linear least squares problem of a step, each segment as a triangle."""

    def __init__(self, linear: Sequence[Linear], refused: np.ndarray) -> None:
        self.states = linear[0].by_states.shape[1]
        # a state stays where it is if it would again go where the FMU refuses it
        downhill = -np.array([each.by_states.T @ each.residuals for each in linear])
        self.refused = np.where(downhill * refused > 0, refused, 0.0)
        tables = [each.table for each in linear]
        for table, held in zip(tables, self.refused != 0, strict=True):
            table[:, : self.states][:, held] = 0.0
        self.triangles = np.stack([np.linalg.qr(table, mode="r") for table in tables])
        squares = np.sum(self.triangles**2, axis=1)  # (segments, columns)
        of_states = squares[:, : self.states]
        least = SMALLEST**2 * of_states.max(axis=0)
        self.state_weights = np.sqrt(np.maximum(of_states, np.where(least > 0, least, 1.0)))
        of_parameters = squares[:, self.states : -1].sum(axis=0)
        self.weights = np.sqrt(np.where(of_parameters > 0, of_parameters, 1.0))

    def _eliminated(self, ridge: float) -> tuple[np.ndarray, np.ndarray]:
        """Triangles with damped states, and what they leave: rows (n, parameters + 1)."""
        n, (count, _, columns) = self.states, self.triangles.shape
        damped = np.zeros((count, n, columns))
        damped[:, range(n), range(n)] = np.sqrt(ridge) * self.state_weights
        triangles = np.linalg.qr(np.concatenate([self.triangles, damped], axis=1), mode="r")
        return triangles, triangles[:, n:, n:].reshape(-1, columns - n)

    def step(self, ridge: float) -> tuple[np.ndarray, np.ndarray]:
        """Steps of states (segments, states) and parameters (parameters,)."""
        n = self.states
        triangles, rest = self._eliminated(ridge)
        damped = np.sqrt(ridge) * np.diag(self.weights)
        rows = np.vstack([rest[:, :-1], damped])
        right = np.append(rest[:, -1], np.zeros(len(damped)))
        to_z = -np.linalg.lstsq(rows, right)[0] if len(damped) else np.empty(0)
        left = triangles[:, :n, -1] + triangles[:, :n, n:-1] @ to_z
        to_x = -np.linalg.solve(triangles[:, :n, :n], left[..., None])[..., 0]
        return to_x, to_z

    def gain(self) -> float:
        """By how much the cost would fall by a step without ridge, if all were linear."""
        n = self.states
        triangles, rest = self._eliminated(LEAST_RIDGE)
        left, values, _ = np.linalg.svd(rest[:, :-1] / self.weights, full_matrices=False)
        kept = left[:, values > UNKNOWN]
        return float(np.sum((kept.T @ rest[:, -1]) ** 2) + np.sum(triangles[:, :n, -1] ** 2))
