"""The arm as an environment of Gymnasium (pip install gymnasium): the FMU makes the steps."""

import sys
from tempfile import TemporaryDirectory

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from fmpy import extract, instantiate_fmu, read_model_description
from gymnasium.spaces import Box

import rparm

STATES, EFFORTS = [10, 11, 12, 13], [20, 21]  # value references: q1, q2, dq1, dq2; tau1, f2
LIMIT = 20.0  # of the efforts: N.m, N
GOAL = np.array([np.pi / 2, 0.1])  # rad, m: the arm stands
PERIOD, STEPS = 0.02, 200  # s; of an episode


class ArmEnvironment(gymnasium.Env):
    """Observations are q1 (rad), q2 (m) and their rates, actions the efforts / LIMIT."""

    def __init__(self) -> None:
        self.observation_space = Box(-np.inf, np.inf, (4,), np.float64)
        self.action_space = Box(-1.0, 1.0, (2,), np.float64)
        path, self.folder = rparm.fmu("RPManipulator"), TemporaryDirectory()
        self.fmu = instantiate_fmu(extract(path, self.folder.name), read_model_description(path))

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple:
        super().reset(seed=seed)
        self.steps, pose = 0, self.np_random.uniform([-np.pi, 0.0], [np.pi, 0.2])
        self.fmu.reset()
        self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.setReal(STATES, [*pose, 0.0, 0.0])
        self.fmu.exitInitializationMode()
        return np.array(self.fmu.getReal(STATES)), {}

    def step(self, action: np.ndarray) -> tuple:
        self.fmu.setReal(EFFORTS, list(LIMIT * action))
        self.fmu.doStep(self.steps * PERIOD, PERIOD)
        self.steps, state = self.steps + 1, np.array(self.fmu.getReal(STATES))
        reward = -np.sum((state[:2] - GOAL) ** 2) - 0.01 * np.sum(np.square(action))
        return state, float(reward), False, self.steps >= STEPS, {}


if __name__ == "__main__":  # three episodes of a PD controller, the baseline for learning
    environment = ArmEnvironment()
    for seed in range(3):
        states, ended = [environment.reset(seed=seed)[0]], False
        while not ended:
            state = states[-1]
            efforts = [60, 100] * (GOAL - state[:2]) - [15, 20] * state[2:] + [0, 9.81]
            state, reward, _, ended, _ = environment.step(np.clip(efforts / LIMIT, -1, 1))
            states.append(state)
        print(f"seed {seed}: ends at {state[0]:.3f} rad, {state[1]:.3f} m, reward {reward:.2g}")
        plt.plot(PERIOD * np.arange(STEPS + 1), np.array(states)[:, 0])
    plt.gca().set(xlabel="time (s)", ylabel="q1 (rad)")
    if len(sys.argv) > 1:
        plt.savefig(sys.argv[1], dpi=80)
