"""Delays: the end effector's error with held inputs, measured and predicted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rparm.models.closed_loop.coupling.loop import (
    CONTROLLER_FIRST,
    FINEST,
    METHODS,
    REFERENCE_AHEAD,
    TRAJECTORY_FIRST,
    ClosedLoop,
    Columns,
    Method,
)

LARGEST_ERROR = 1e-3  # m, of the end effector on the circle at 1 ms in Jacobi order
PREDICTED_WITHIN = 0.1  # of the measured error


@dataclass(frozen=True, eq=False)
class Tracking:
    """Error of the end effector over time, measured and predicted by the delays of the order."""

    method: Method
    step: float  # s
    times: np.ndarray  # s
    measured: np.ndarray  # (rows,) m
    predicted: np.ndarray  # (rows,) m

    @property
    def largest(self) -> float:
        """Largest measured error, m."""
        return float(self.measured.max())

    @property
    def deviation(self) -> float:
        """Of the largest predicted error from the largest measured one, relative."""
        return float(self.predicted.max() / self.measured.max() - 1)

    @property
    def predicts(self) -> bool:
        """Whether the prediction is as close as expected."""
        return abs(self.deviation) <= PREDICTED_WITHIN


def study_tracking(loop: ClosedLoop, step: float = 1e-3) -> list[Tracking]:
    """End effector on the nominal circle with held inputs, in the orders of stepping."""
    smooth = loop.run(FINEST, step)[0]
    found = []
    for method in (METHODS[0], METHODS[1], REFERENCE_AHEAD):
        columns = loop.run(method, step)[0]
        error = path_error(columns)
        found.append(
            Tracking(method, step, columns["time"], error, predicted_error(loop, smooth, method))
        )
    return found


def tracking_passed(tracking: Sequence[Tracking]) -> bool:
    """Whether the errors are small, ordered and predicted."""
    jacobi, gauss_seidel, _ = tracking
    return (
        jacobi.largest < LARGEST_ERROR
        and gauss_seidel.largest < jacobi.largest
        and all(t.predicts for t in tracking)
    )


def path_error(columns: Columns) -> np.ndarray:
    """Distance of the end effector from its reference at the same time, m."""
    return np.hypot(
        columns["arm.ee_x"] - columns["trajectory.ee_x_ref"],
        columns["arm.ee_y"] - columns["trajectory.ee_y_ref"],
    )


def predicted_error(loop: ClosedLoop, smooth: Columns, method: Method) -> np.ndarray:
    """First-order prediction of the end effector's error along a motion without coupling error.

    e'' + Kd e' + Kp e = D^-1 delta, where delta is what the efforts lack: those applied are the
    law's of references and measurements of other times, on the average over a step.
    """
    step = smooth["time"][1] - smooth["time"][0]
    ages = {  # mean ages of references and measurements in steps
        ("jacobi", CONTROLLER_FIRST): (1.5, 1.5),
        ("gauss_seidel", CONTROLLER_FIRST): (0.5, 0.5),
        ("gauss_seidel", TRAJECTORY_FIRST): (-0.5, 0.5),
    }[method.order, method.sequence]

    # gains (2, 2) by Kp and Kd, mass matrix (rows, 2, 2)
    gains = np.array([[loop.gain(f"{kind}{i}") for i in (1, 2)] for kind in ("Kp", "Kd")])
    mass = np.array(
        [[smooth["arm.D11"], smooth["arm.D12"]], [smooth["arm.D12"], smooth["arm.D22"]]]
    )
    mass = np.moveaxis(mass, 2, 0)

    # rate of the efforts, and the part of it that the references cause, (rows, 2)
    efforts = np.array([smooth["controller.tau1"], smooth["controller.f2"]]).T
    total = np.gradient(efforts, step, axis=0)
    reference = [
        np.array([smooth[f"trajectory.{d}q{i}_ref"] for i in (1, 2)]).T for d in ("d", "dd")
    ]
    jerk = np.gradient(reference[1], step, axis=0)
    commanded = jerk + gains[1] * reference[1] + gains[0] * reference[0]
    by_reference = np.einsum("nij,nj->ni", mass, commanded)

    # error of the joints
    lacking = step * (ages[0] * by_reference + ages[1] * (total - by_reference))
    forcing = np.linalg.solve(mass, lacking[:, :, None])[:, :, 0]
    error = _error_motion(forcing, gains, step)

    # error of the end effector: J(q) times that of the joints
    turn = np.array([-smooth["arm.ee_y"], smooth["arm.ee_x"]]) * error[:, 0]
    slide = np.array([np.cos(smooth["arm.q1"]), np.sin(smooth["arm.q1"])]) * error[:, 1]
    return np.hypot(*(turn + slide))


def _error_motion(forcing: np.ndarray, gains: np.ndarray, step: float) -> np.ndarray:
    """Solves e'' + Kd e' + Kp e = forcing from rest by the trapezoidal rule, (rows, 2)."""
    error, rate = np.zeros_like(forcing), np.zeros(2)
    half = step / 2
    for i in range(1, len(forcing)):
        before = error[i - 1]
        old = forcing[i - 1] - gains[1] * rate - gains[0] * before
        known = before + half * rate
        right = rate + half * (old + forcing[i] - gains[0] * known)
        rate = right / (1 + half * gains[1] + half**2 * gains[0])
        error[i] = known + half * rate
    return error
