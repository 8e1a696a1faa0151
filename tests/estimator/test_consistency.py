"""Errors of filters over many runs are as large as the filters say (NEES, NIS).

The truth are Runge-Kutta steps of the same equations, written here, and the closed form of a ball.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tests.estimator.filters import EXAMPLES, Rates, ahead, bounds, filter_of, nees

RUNS = 300
G = 9.81


@dataclass(frozen=True)
class Case:
    plant: Path | str
    request: str
    rates: Rates
    states: tuple[str, ...]  # with unknown parameters
    start: tuple[float, ...]
    spread: tuple[float, ...]
    measured: dict[str, float]  # states, with standard deviations
    inputs: dict[str, tuple[Callable[[float], float], float]]  # with standard deviations
    period: float
    substeps: int = 5


def pendulum(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    phi, omega, length = x
    return np.array([omega, (u[0] - 0.1 * omega - G * length * np.sin(phi)) / length**2, 0 * phi])


def cart(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    _, phi, v, omega = x
    pull = 0.1 * np.sin(phi) * (0.5 * omega**2 + G * np.cos(phi))
    a = (u[0] + pull) / (1 + 0.1 * np.sin(phi) ** 2)
    return np.array([v, omega, a, -(a * np.cos(phi) + G * np.sin(phi)) / 0.5])


def motor(x: np.ndarray, u: np.ndarray) -> np.ndarray:
    i, speed, _, load = x
    rate = (0.05 * i - 1e-5 * speed - u[1] / 20) / (2e-5 + load / 400)
    return np.array([(u[0] - 1.2 * i - 0.05 * speed) / 2e-3, rate, speed / 20, 0 * i])


PENDULUM = """
name = "Pendulum"
[parameters]
m = { start = 1.0, unit = "kg" }
l = { start = 1.0, unit = "m" }
inertia = { value = "m * l**2", unit = "kg.m2" }
[inputs]
torque = { unit = "N.m" }
[states]
phi = { start = 1.0, unit = "rad", derivative = "omega" }
omega = { unit = "rad/s", derivative = "(torque - drag - weight * sin(phi)) / inertia" }
[where]
drag = "0.1[N.m.s] * omega"
weight = "m * 9.81[m/s2] * l"
[check]
"the length must be above 0" = "inertia > 0"
"""
CASES = {
    "a pendulum of unknown length": Case(
        PENDULUM,
        """every = "20 ms"
measure = { phi = "0.02 rad" }
noise = { torque = "0.05 N.m" }
start = { phi = "0.2 rad", omega = "0.5 rad/s" }
unknown = { l = "50 mm" }""",
        pendulum, ("phi", "omega", "l"), (1.0, 0.0, 1.0), (0.2, 0.5, 0.05), {"phi": 0.02},
        {"torque": (lambda t: np.sin(3 * t), 0.05)}, 0.02,
    ),
    "cart and pole": Case(
        EXAMPLES / "cart_and_pole.toml",
        """every = "10 ms"
measure = { x = "2 mm", phi = "0.5 deg" }
noise = { force = "0.5 N" }
start = { x = "5 mm", phi = "3 deg", v = 0.1, omega = 0.1 }""",
        cart, ("x", "phi", "v", "omega"), (0.0, 3.0, 0.0, 0.0), (0.005, np.radians(3), 0.1, 0.1),
        {"x": 0.002, "phi": np.radians(0.5)}, {"force": (lambda t: 2 * np.sin(3 * t), 0.5)}, 0.01,
    ),
    "a motor with an unknown load": Case(
        EXAMPLES / "dc_motor.toml",
        """every = "1 ms"
measure = { speed = "2 rad/s" }
noise = { voltage = "0.5 V", torque = "0.05 N.m" }
start = { i = "100 mA", speed = 5, angle = 0.05 }
unknown = { J_load = 0.002 }""",
        motor, ("i", "speed", "angle", "J_load"), (0.0, 0.0, 0.0, 0.02), (0.1, 5.0, 0.05, 0.002),
        {"speed": 2.0},
        {"voltage": (lambda t: 12 + 6 * np.sin(20 * t), 0.5), "torque": (lambda _: 0.0, 0.05)},
        1e-3,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_errors_are_as_large_as_it_says(case: Case, tmp_path: Path) -> None:
    random, steps, looked_at = np.random.default_rng(1), 100, (0, 30, 60, 100)
    x = np.array(case.start) + np.array(case.spread) * random.normal(size=(RUNS, len(case.start)))
    true, y = [x.T], []
    for k in range(steps + 1):
        u = [of(k * case.period) + s * random.normal(size=RUNS) for of, s in case.inputs.values()]
        now = dict(zip(case.states, true[-1], strict=True))
        noisy = {x: now[x] + s * random.normal(size=RUNS) for x, s in case.measured.items()}
        y.append({f"{x}_measured": values for x, values in noisy.items()})
        true.append(ahead(case.rates, true[-1], np.array(u), case.period, case.substeps))
    errors, squares = np.zeros((RUNS, len(looked_at))), []
    with filter_of(case.plant, case.request, tmp_path) as slave:
        for run in range(RUNS):
            for k in range(steps + 1):
                before = max(k - 1, 0) * case.period
                given = {name: of(before) for name, (of, _) in case.inputs.items()}
                given |= {name: values[run] for name, values in y[k].items()}
                slave.step(case.period, given) if k else slave.start(given)
                squares.append(slave.get(*(f"nis_{name}" for name in case.measured)))
                if k in looked_at:
                    errors[run, looked_at.index(k)] = nees(slave, case.states, true[k][:, run])
    low, high = bounds(len(case.states), RUNS)
    assert np.all((low < errors.mean(axis=0)) & (errors.mean(axis=0) < high)), errors.mean(axis=0)
    assert np.mean(squares, axis=0) == pytest.approx(1.0, abs=0.05)


def fallen(h: float, v: float, duration: float) -> tuple[float, float]:
    """Return height and speed of a ball that bounces, from impact to impact."""
    while duration > 0:
        flight = (v + np.sqrt(v * v + 2 * G * h)) / G
        if flight > duration:
            return h + v * duration - G * duration**2 / 2, v - G * duration
        duration, h, v = duration - flight, 0.0, 0.7 * (G * flight - v)
    return h, v


def test_it_follows_a_ball_through_impacts(tmp_path: Path) -> None:
    """Where no run is within 50 ms of an impact: 0.35 s, 0.65 s; the next one is about 1.08 s."""
    text = (EXAMPLES / "bouncing_ball.toml").read_text(encoding="utf-8")
    plant = text.replace('"not resting"', '"not resting and v < 0"')
    request = 'every = "50 ms"\nmeasure = { h = "20 mm" }\nstart = { h = "50 mm", v = "0.1 m/s" }'
    random, looked_at = np.random.default_rng(2), (0, 7, 13, 18, 25)
    errors = np.zeros((RUNS, len(looked_at)))
    with filter_of(plant, request, tmp_path) as slave:
        for run in range(RUNS):
            h, v = 1 + 0.05 * random.normal(), 0.1 * random.normal()
            for k in range(max(looked_at) + 1):
                h, v = fallen(h, v, 0.05) if k else (h, v)
                given = {"h_measured": h + 0.02 * random.normal()}
                slave.step(0.05, given) if k else slave.start(given)
                if k in looked_at:
                    errors[run, looked_at.index(k)] = nees(slave, ("h", "v"), np.array([h, v]))
    low, high = bounds(2, RUNS)
    assert np.all((low < errors.mean(axis=0)) & (errors.mean(axis=0) < high)), errors.mean(axis=0)
