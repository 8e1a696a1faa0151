"""Covariances against matrices of Kalman's filter, and through events against differences."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from rparm.building import build
from tests.estimator.filters import Slave, filter_of, opened
from tests.support.paths import ROOT

A = np.array([[0, 1, 0], [-3, -0.4, 0], [1, 0, -2.0]])
B = np.array([[0, 1], [1, 0], [0, 0.0]])
C, D = np.array([[1, 0, 0.5], [0, 0, 1.0]]), np.array([[0.1, 0.0], [0.0, 0.0]])
PERIOD, SIGMAS, NOISE = 0.1, np.array([0.1, 0.2]), np.array([0.3, 0.2])
LINEAR = """
name = "Linear"
[inputs]
u = {}
w = {}
[states]
a = { start = 1, derivative = "b + w" }
b = { derivative = "-3 * a - 0.4 * b + u" }
c = { derivative = "a - 2 * c" }
[outputs]
y = { value = "a + 0.5 * c + 0.1 * u" }
"""
OF_LINEAR = """every = 0.1
measure = { y = 0.1, c = 0.2 }
noise = { u = 0.3, w = 0.2 }
start = { a = 0.5, b = 0.7, c = 0.2 }
"""


def kalman(u: np.ndarray, y: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Estimates and covariances after each row of measurements, used from the `first` one on.

    Van Loan's integral of the noise; Joseph's form, one measurement after the other.
    """
    q = B @ np.diag(NOISE**2 * PERIOD) @ B.T
    integral = expm(np.block([[-A, q], [np.zeros((3, 3)), A.T]]) * PERIOD)
    phi = integral[3:, 3:].T
    held = expm(np.block([[A, B], [np.zeros((2, 5))]]) * PERIOD)[:3, 3:]
    x, p, found = np.array([1.0, 0, 0]), np.diag([0.5, 0.7, 0.2]) ** 2, []
    for k, measured in enumerate(y):
        before = u[max(k - 1, 0)]
        if k:
            x, p = phi @ x + held @ before, phi @ p @ phi.T + phi @ integral[:3, 3:]
        for c, d, sigma, value in zip(C, D, SIGMAS, measured, strict=True):
            if k >= first:
                r = sigma**2 + (d * NOISE) @ (d * NOISE)
                gain = p @ c / (c @ p @ c + r)
                x = x + gain * (value - c @ x - d @ before)
                left = np.eye(3) - np.outer(gain, c)
                p = left @ p @ left.T + r * np.outer(gain, gain)
        found.append((x, p))
    return tuple(map(np.array, zip(*found, strict=True)))


@pytest.mark.parametrize("offset", [0.0, PERIOD])
def test_a_linear_plant_has_the_matrices_of_kalman(offset: float, tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    u, y = random.normal(size=(31, 2)), random.normal(size=(31, 2))
    states, covariances = kalman(u, y, round(offset / PERIOD))
    with filter_of(LINEAR, OF_LINEAR + (f"offset = {offset}" if offset else ""), tmp_path) as slave:
        for method in (1, 2, 3, 4):
            for k, (x, p) in enumerate(zip(states, covariances, strict=True)):
                given = dict(zip(("u", "w"), u[max(k - 1, 0)], strict=True))
                given |= dict(zip(("y_measured", "c_measured"), y[k], strict=True))
                if k:
                    slave.step(PERIOD, given)
                else:
                    slave.start(given, tolerance=1e-13, method=method)
                size = max(1.0, np.abs(states).max())
                assert np.abs(slave.get("a", "b", "c") - x).max() < 1e-12 * size
                assert np.abs(slave.covariance("a", "b", "c") - p).max() < 1e-12
                assert slave.get("sigma_a")[0] == pytest.approx(np.sqrt(p[0, 0]), rel=1e-9)


# limits move, new values follow from states and time, a mode changes rates, a sampler resets T
JUMPS = """
name = "Jumps"
modes = ["slow"]
[parameters]
bounce = { start = 0.8 }
height = { start = 0.1 }
limit = { value = "2 * height" }
[tables.drag]
x = [-10, 0, 1, 10]
y = [-1.2, 0, 0.1, 1.5]
[states]
"h[i]" = { for = "i = 1..2", start = [1.0, 1.5], derivative = "v[i]" }
"v[i]" = { for = "i = 1..2", derivative = "-g - drag(v[i]) - 0.2 * (h[i] - h[3 - i])" }
T = { start = 1, derivative = "-0.3 * T + h[1] * v[2]" }
[where]
g = "4 if slow else 9"
[events."hit[i]"]
for = "i = 1..2"
when = "h[i] < limit * sin(3 * time) and v[i] < 0"
where = { r = "-bounce * v[i]" }
reinit = { "v[i]" = "r + 0.1 * T * cos(time)", T = "T + 0.1 * h[i] * v[i]" }
[events.late]
when = "T < 0.3"
set = { slow = "true" }
[sampled.kick]
every = "0.4"
offset = "0.25"
reinit = { T = "T * (0.9 + 0.1 * h[1])" }
"""
OF_JUMPS = """every = 10.0
offset = 10.0
measure = { T = 1.0 }
start = { "h[1]" = 0.1, "h[2]" = 0.2, "v[1]" = 0.3, T = 0.1 }
unknown = { bounce = 0.1, height = 0.05 }
"""
END = 0.85


def at_end(plant: Slave, starts: dict[str, float], names: list[str]) -> np.ndarray:
    plant.start({}, tolerance=1e-13, method=4, **starts)
    plant.step(END, {})
    return plant.get(*names)


def test_events_and_samplers_carry_it_as_differences_of_the_plant(tmp_path: Path) -> None:
    """P = F P F' with the slopes F of what the plant's FMU ends at, by central differences."""
    states, unknown = ["h[1]", "h[2]", "v[1]", "v[2]", "T"], ["bounce", "height"]
    starts = [1.0, 1.5, 0.0, 0.0, 1.0, 0.8, 0.1]
    spread, small = np.array([0.1, 0.2, 0.3, 0.0, 0.1, 0.1, 0.05]), 1e-5
    file = tmp_path / "jumps.toml"
    file.write_text(JUMPS, encoding="utf-8")
    path, _ = build(file, output=tmp_path, lock=False)
    slopes = np.eye(7)
    with opened(path, tmp_path) as plant:
        for j, (name, start) in enumerate(zip(states + unknown, starts, strict=True)):
            far, near = (at_end(plant, {name: start + d}, states) for d in (small, -small))
            slopes[:5, j] = (far - near) / (2 * small)
        found = at_end(plant, {}, states)
        assert plant.fmu.getBoolean([plant.references["slow"]]) == [1]
    with filter_of(JUMPS, OF_JUMPS, tmp_path) as slave:
        slave.start({}, tolerance=1e-13, method=4)
        slave.step(END, {})
        plain = [name.replace("[", "_").replace("]", "") for name in states + unknown]
        covariance = slave.covariance(*plain)
        assert slave.get(*states) == pytest.approx(found, abs=1e-11)
    expected = slopes @ np.diag(spread**2) @ slopes.T
    assert covariance == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
    assert found[2:4].min() > 0  # both have bounced


def test_the_end_effector_is_within_three_sigma_of_the_plant(tmp_path: Path) -> None:
    """The arm's equations, in C, with an unknown mass, beside RPPlant with friction."""
    plant = ROOT / "models" / "rp_manipulator" / "rp_manipulator.toml"
    estimator = tmp_path / "arm.toml"
    estimator.write_text(
        f"""name = "ArmObserver"
estimator = "{plant.as_posix()}"
every = "2 ms"
measure = {{ q1 = "0.2 mrad", q2 = "0.2 mm" }}
noise = {{ tau1 = "1 N.m", f2 = "1 N" }}
start = {{ q1 = "2 deg", q2 = "1 cm", dq1 = 0.1, dq2 = 0.1 }}
unknown = {{ m2 = "300 g" }}
sigma = ["ee_x", "ee_y"]
""",
        encoding="utf-8",
    )
    path, _ = build(estimator, output=tmp_path, lock=False)
    random, period = np.random.default_rng(4), 2e-3
    truth = {"m2": 1.2, "coulomb_friction1": 0.05, "coulomb_friction2": 0.05, "q1": 0.02}
    inside = []
    with (
        opened(path, tmp_path) as slave,
        opened(ROOT / "build" / "RPPlant.fmu", tmp_path) as arm,
    ):
        for k in range(1000):
            time = k * period
            efforts = {"tau1": 12 + 4 * np.sin(5 * time), "f2": 6 * np.sin(7 * time)}
            noisy = {name: value + random.normal() for name, value in efforts.items()}
            arm.step(period, noisy) if k else arm.start(noisy, **truth)
            y = arm.get("q1", "q2") + 2e-4 * random.normal(size=2)
            given = efforts | {"q1_measured": y[0], "q2_measured": y[1]}
            slave.step(period, given) if k else slave.start(given)
            sigmas = slave.get("sigma_ee_x", "sigma_ee_y")
            wrong = slave.get("ee_x", "ee_y") - arm.get("ee_x", "ee_y")
            inside.append(np.abs(wrong) < 3 * sigmas)
        mass, sigma = slave.get("m2", "sigma_m2")
    assert np.mean(inside) > 0.99 and np.max(sigmas) < 1e-3
    assert abs(mass - 1.2) < 3 * sigma < 0.2
