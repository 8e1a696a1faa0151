"""The arm as an environment of Gymnasium (pip install gymnasium): the FMU makes the steps.

PYTHONPATH=. build/venv/bin/python examples/gymnasium_environment.py [PICTURE]
"""

import sys
from tempfile import TemporaryDirectory

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description
from gymnasium.spaces import Box

import rparm

LIMITS = np.array([20.0, 20.0])  # of the efforts: N.m, N
GOAL = np.array([np.pi / 2, 0.1])  # rad, m: the arm stands
PERIOD, STEPS = 0.02, 200  # s; of an episode


class ArmEnvironment(gymnasium.Env):
    """Observations are q1 (rad), q2 (m) and their rates, actions the efforts / LIMITS."""

    def __init__(self) -> None:
        self.observation_space = Box(-np.inf, np.inf, (4,), np.float64)
        self.action_space = Box(-1.0, 1.0, (2,), np.float64)
        path, self.folder = rparm.fmu("RPManipulator"), TemporaryDirectory()
        description = read_model_description(path)
        references = {v.name: v.valueReference for v in description.modelVariables}
        self.states = [references[name] for name in ("q1", "q2", "dq1", "dq2")]
        self.efforts = [references[name] for name in ("tau1", "f2")]
        self.fmu = instantiate_fmu(extract(path, self.folder.name), description)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple:
        super().reset(seed=seed)
        self.steps = 0
        self.fmu.reset()
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        pose = self.np_random.uniform([-np.pi, 0.0], [np.pi, 0.2])
        self.fmu.setReal(self.states, [*pose, 0.0, 0.0])
        self.fmu.exitInitializationMode()
        return np.array(self.fmu.getReal(self.states)), {}

    def step(self, action: np.ndarray) -> tuple:
        self.fmu.setReal(self.efforts, list(LIMITS * action))
        self.fmu.doStep(self.steps * PERIOD, PERIOD)
        self.steps += 1
        state = np.array(self.fmu.getReal(self.states))
        reward = -np.sum((state[:2] - GOAL) ** 2) - 0.01 * np.sum(np.square(action))
        return state, float(reward), False, self.steps >= STEPS, {}


def by_hand(state: np.ndarray) -> np.ndarray:
    """Action of a PD controller that also carries the slide: what learning has to beat."""
    efforts = [60.0, 100.0] * (GOAL - state[:2]) - [15.0, 20.0] * state[2:] + [0.0, 9.81]
    return np.clip(efforts / LIMITS, -1.0, 1.0)


if __name__ == "__main__":
    environment = ArmEnvironment()
    for seed in range(3):
        states, ended = [environment.reset(seed=seed)[0]], False
        while not ended:
            state, reward, _, ended, _ = environment.step(by_hand(states[-1]))
            states.append(state)
        print(f"seed {seed}: ends at {state[0]:.3f} rad, {state[1]:.3f} m, reward {reward:.2g}")
        plt.plot(PERIOD * np.arange(STEPS + 1), np.array(states)[:, 0])
    plt.gca().set(xlabel="time (s)", ylabel="q1 (rad)")
    if len(sys.argv) > 1:
        plt.savefig(sys.argv[1], dpi=80)
