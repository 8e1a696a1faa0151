"""LQR and an extended Kalman filter bring the arm to a pose, with noise in encoders and drives.

All matrices are directional derivatives of the FMU. The filter predicts by the FMU itself: rolled
back into initialization mode, it starts from the estimate and makes one step.
Beside rparm it needs: pip install control

PYTHONPATH=. build/venv/bin/python examples/lqr_and_kalman.py [PICTURE]
"""

import shutil
import sys

import control
import matplotlib.pyplot as plt
import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description
from scipy.linalg import expm

import rparm

STATES, RATES = ("q1", "q2", "dq1", "dq2"), ("dq1", "dq2", "ddq1", "ddq2")
EFFORTS, MEASURED = ("tau1", "f2"), ("q1", "q2")
GOAL = np.array([0.5, 0.2, 0.0, 0.0])  # rad, m, rad/s, m/s
START = GOAL + [0.1, 0.0, 0.0, 0.0]
PERIOD, STEPS = 1e-3, 2000  # s; of control and filter
ENCODER_NOISE = np.array([2e-5, 2e-5])  # standard deviations; rad, m
DRIVE_NOISE = np.array([0.01, 0.01])  # N.m, N


class Arm:
    """The FMU for co-simulation, in initialization mode."""

    def __init__(self) -> None:
        path = rparm.fmu("RPManipulator")
        description = read_model_description(path)
        self._references = {v.name: v.valueReference for v in description.modelVariables}
        self._folder = extract(path)
        self.fmi = instantiate_fmu(self._folder, description, fmi_type="CoSimulation")
        self.fmi.setupExperiment()
        self.fmi.enterInitializationMode()

    def _of(self, names: tuple[str, ...]) -> list[int]:
        return [self._references[name] for name in names]

    def set(self, names: tuple[str, ...], values: np.ndarray) -> None:
        self.fmi.setReal(self._of(names), list(values))

    def get(self, names: tuple[str, ...]) -> np.ndarray:
        return np.array(self.fmi.getReal(self._of(names)))

    def jacobian(self, of: tuple[str, ...], by: tuple[str, ...]) -> np.ndarray:
        derivative, rows = self.fmi.getDirectionalDerivative, self._of(of)
        return np.transpose([derivative(rows, [column], [1.0]) for column in self._of(by)])

    def over_a_period(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the next states by states, (4, 4), and by held efforts, (4, 2)."""
        rates = np.hstack([self.jacobian(RATES, STATES), self.jacobian(RATES, EFFORTS)])
        both = expm(PERIOD * np.vstack([rates, np.zeros((2, 6))]))
        return both[:4, :4], both[:4, 4:]

    def close(self) -> None:
        self.fmi.terminate()
        self.fmi.freeInstance()
        shutil.rmtree(self._folder)


class KalmanFilter:
    """Estimate x of the states and its covariance p; it believes that the arm is at the goal."""

    def __init__(self, model: Arm) -> None:
        self.x, self.p = GOAL, np.diag([0.1, 0.1, 1.0, 1.0]) ** 2
        self.c = model.jacobian(MEASURED, STATES)
        self.model, self.beginning = model, model.fmi.getFMUState()

    def correct(self, measured: np.ndarray) -> float:
        """Use a measurement; return its normalized innovation squared: 2 on average."""
        innovation = measured - self.c @ self.x
        expected = self.c @ self.p @ self.c.T + np.diag(ENCODER_NOISE**2)
        gain = self.p @ self.c.T @ np.linalg.inv(expected)
        self.x = self.x + gain @ innovation
        self.p = self.p - gain @ expected @ gain.T
        return float(innovation @ np.linalg.solve(expected, innovation))

    def predict(self, effort: np.ndarray) -> None:
        """Go a period ahead."""
        self.model.fmi.setFMUState(self.beginning)
        self.model.set(STATES, self.x)
        self.model.set(EFFORTS, effort)
        f, g = self.model.over_a_period()
        self.model.fmi.exitInitializationMode()
        self.model.fmi.doStep(0.0, PERIOD)
        self.x = self.model.get(STATES)
        self.p = f @ self.p @ f.T + g @ np.diag(DRIVE_NOISE**2) @ g.T


def controlled(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """True and estimated states, (STEPS, 4), and squared innovations, (STEPS,)."""
    random = np.random.default_rng(seed)
    arm, model = Arm(), Arm()
    model.set(STATES, GOAL)
    holding = model.get(("gravity1", "gravity2"))
    model.set(EFFORTS, holding)
    # 0.01 rad or m off is as bad as 2 N.m or N
    gain, _, _ = control.dlqr(*model.over_a_period(), np.diag([1e4, 1e4, 0, 0]), np.eye(2) / 4)
    filtered = KalmanFilter(model)
    arm.set(STATES, START)
    arm.fmi.exitInitializationMode()
    rows = []
    for k in range(STEPS):
        squared = filtered.correct(random.normal(arm.get(MEASURED), ENCODER_NOISE))
        rows.append((arm.get(STATES), filtered.x, squared))
        effort = holding - gain @ (filtered.x - GOAL)
        arm.set(EFFORTS, random.normal(effort, DRIVE_NOISE))
        arm.fmi.doStep(k * PERIOD, PERIOD)
        filtered.predict(effort)
    model.fmi.freeFMUState(filtered.beginning)
    arm.close()
    model.close()
    return tuple(map(np.array, zip(*rows, strict=True)))


def main() -> None:
    true, estimated, squares = controlled(seed=1)
    late = slice(round(1.0 / PERIOD), None)  # after a second
    off, wrong = (np.abs(x[late, :2]).max() for x in (true - GOAL, estimated - true))
    print(f"after 1 s: at most {off:.1e} from the goal, the estimate {wrong:.1e} wrong")
    print(f"mean normalized innovation squared: {squares.mean():.3f}")

    times = PERIOD * np.arange(STEPS)
    figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
    axis.semilogy(times, np.abs(true - GOAL)[:, 0], label="q1 off its goal")
    axis.semilogy(times, np.abs(estimated - true)[:, 0], lw=0.5, label="estimate of q1 wrong")
    axis.axhline(ENCODER_NOISE[0], ls="--", color="k", label="noise of the encoder")
    axis.set(xlabel="time (s)", ylabel="rad", ylim=(1e-8, 1))
    axis.legend()
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()
