"""The arm as an environment of Gymnasium: efforts are actions, the FMU makes the steps.

Beside rparm it needs: pip install gymnasium

PYTHONPATH=. build/venv/bin/python examples/gymnasium_environment.py [PICTURE]
"""

import shutil
import sys
from typing import Any

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description
from gymnasium.spaces import Box

import rparm

STATES, EFFORTS = ("q1", "q2", "dq1", "dq2"), ("tau1", "f2")
LIMITS = np.array([20.0, 20.0])  # N.m, N
GOAL = np.array([np.pi / 2, 0.1])  # rad, m: the arm stands
PERIOD, STEPS = 0.02, 200  # s; of an episode


class ArmEnvironment(gymnasium.Env):
    """Bring the arm from a random pose at rest to its goal and keep it there.

    Observations are q1 (rad), q2 (m) and their rates, actions the efforts divided by LIMITS.
    """

    def __init__(self) -> None:
        self.observation_space = Box(-np.inf, np.inf, (4,), np.float64)
        self.action_space = Box(-1.0, 1.0, (2,), np.float64)
        path = rparm.fmu("RPManipulator")
        description = read_model_description(path)
        references = {v.name: v.valueReference for v in description.modelVariables}
        self._states = [references[name] for name in STATES]
        self._efforts = [references[name] for name in EFFORTS]
        self._folder = extract(path)
        self._fmu = instantiate_fmu(self._folder, description, fmi_type="CoSimulation")

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        self._fmu.reset()
        self._fmu.setupExperiment()
        self._fmu.enterInitializationMode()
        pose = self.np_random.uniform([-np.pi, 0.0], [np.pi, 0.2])
        self._fmu.setReal(self._states, [*pose, 0.0, 0.0])
        self._fmu.exitInitializationMode()
        self._steps = 0
        return self._observe(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self._fmu.setReal(self._efforts, list(LIMITS * action))
        self._fmu.doStep(self._steps * PERIOD, PERIOD)
        self._steps += 1
        state = self._observe()
        cost = np.sum((state[:2] - GOAL) ** 2) + 0.01 * np.sum(np.square(action))
        return state, -float(cost), False, self._steps >= STEPS, {}

    def close(self) -> None:
        if self._fmu is not None:
            self._fmu.freeInstance()
            shutil.rmtree(self._folder)
            self._fmu = None

    def _observe(self) -> np.ndarray:
        return np.array(self._fmu.getReal(self._states))


def by_hand(state: np.ndarray) -> np.ndarray:
    """Action of a PD controller that also carries the slide: what learning has to beat."""
    efforts = [60.0, 100.0] * (GOAL - state[:2]) - [15.0, 20.0] * state[2:] + [0.0, 9.81]
    return np.clip(efforts / LIMITS, -1.0, 1.0)


def main() -> None:
    environment = ArmEnvironment()
    figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
    for seed in range(3):
        state, _ = environment.reset(seed=seed)
        angles, total, ended = [state[0]], 0.0, False
        while not ended:
            state, reward, _, ended, _ = environment.step(by_hand(state))
            angles.append(state[0])
            total += reward
        print(f"seed {seed}: return {total:.3f}, ends at {state[0]:.3f} rad, {state[1]:.3f} m")
        axis.plot(PERIOD * np.arange(len(angles)), angles, label=f"seed {seed}")
    environment.close()
    axis.axhline(GOAL[0], ls="--", color="k", label="goal")
    axis.set(xlabel="time (s)", ylabel="q1 (rad)")
    axis.legend()
    if len(sys.argv) > 1:
        figure.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()
