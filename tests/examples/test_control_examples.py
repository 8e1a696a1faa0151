"""Examples of control: optimal control, LQR with a Kalman filter, an environment for learning."""

import re
import warnings
from pathlib import Path

import control
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import rparm
from examples import gymnasium_environment, lqr_and_kalman, optimal_control
from tests.support.paths import ROOT
from tests.support.programs import printed, python


@pytest.mark.parametrize("example", ["optimal_control.py", "lqr_and_kalman.py"])
def test_it_runs_in_any_folder(example: str, tmp_path: Path) -> None:
    assert printed(example, tmp_path)


@pytest.fixture(scope="module")
def swing() -> tuple[np.ndarray, np.ndarray]:
    """States and efforts of the optimal swing."""
    return optimal_control.optimal_swing()


def test_the_optimal_swing_ends_where_runge_kutta_errs(swing: tuple[np.ndarray, ...]) -> None:
    """Twice the Runge-Kutta steps give the error of the method: it predicts where the FMU ends."""
    _, u = swing
    ends = []
    for steps in (4, 8):
        state = optimal_control.START
        for effort in u.T:
            state = optimal_control.after_interval(state, effort, steps).full()[:, 0]
        ends.append(state)
    assert ends[0] == pytest.approx(optimal_control.END, abs=1e-6)
    expected = (ends[1] - ends[0]) * 16 / 15
    table = optimal_control.simulated(u)
    off = np.array([table[name][-1] for name in optimal_control.STATES]) - ends[0]
    assert 1e-7 < np.abs(expected).max() < 1e-4
    assert np.abs(off - expected).max() <= 0.1 * np.abs(expected).max()


def test_the_optimal_swing_keeps_its_limits(swing: tuple[np.ndarray, ...]) -> None:
    """The slide reaches its limit, so that without the constraint it would pass it."""
    x, u = swing
    lowest, highest = optimal_control.SLIDE
    for positions in (x[1], optimal_control.simulated(u)["q2"]):
        assert lowest - 1e-6 <= positions.min() < lowest + 1e-6
        assert positions.max() <= highest + 1e-6
    assert np.all(np.abs(u).T <= optimal_control.LIMITS)


def test_the_optimal_swing_beats_a_polynomial_that_ends_there_too(
    swing: tuple[np.ndarray, ...],
) -> None:
    step = 1e-3  # s
    times = np.arange(0.0, optimal_control.DURATION + step / 2, step)
    usual = np.transpose([optimal_control.usual_swing(t + step / 2)[1] for t in times])
    table = rparm.simulate(
        optimal_control.FMU,
        stop_time=optimal_control.DURATION,
        step=step,
        start_values=dict(zip(optimal_control.STATES, optimal_control.START, strict=True)),
        inputs={"tau1": usual[0], "f2": usual[1]},
    )
    end = [table[name][-1] for name in optimal_control.STATES]
    assert end == pytest.approx(optimal_control.END, abs=1e-4)
    assert np.all(np.abs(usual).T <= optimal_control.LIMITS)
    assert optimal_control.mean_square(swing[1]) < 0.75 * optimal_control.mean_square(usual)


@pytest.fixture(scope="module")
def controlled() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return lqr_and_kalman.controlled(seed=1)


def test_the_arm_is_at_its_goal_after_a_second(controlled: tuple[np.ndarray, ...]) -> None:
    true, estimated, _ = controlled
    assert true[0, 0] - lqr_and_kalman.GOAL[0] == pytest.approx(0.1)
    late = slice(round(1.0 / lqr_and_kalman.PERIOD), None)
    assert np.abs(true - lqr_and_kalman.GOAL)[late, :2].max() < 1e-4
    assert np.abs(estimated - true)[late, :2].max() < 1e-4


def test_the_filter_knows_how_wrong_it_is(controlled: tuple[np.ndarray, ...]) -> None:
    """Normalized innovations squared of two measurements have mean 2 and variance 4."""
    _, _, squares = controlled
    assert abs(squares.mean() - 2.0) < 4.0 * np.sqrt(4.0 / len(squares))


def test_the_filter_settles_at_the_riccati_equation() -> None:
    """At the goal it has the covariance of python-control's stationary filter."""
    model = lqr_and_kalman.Arm()
    model.set(lqr_and_kalman.STATES, lqr_and_kalman.GOAL)
    holding = model.get(("gravity1", "gravity2"))
    model.set(lqr_and_kalman.EFFORTS, holding)
    noises = lqr_and_kalman.DRIVE_NOISE, lqr_and_kalman.ENCODER_NOISE
    f, g = model.over_a_period()
    filtered = lqr_and_kalman.KalmanFilter(model)
    _, expected, _ = control.dlqe(f, g, filtered.c, *(np.diag(noise**2) for noise in noises))
    for _ in range(700):
        filtered.correct(lqr_and_kalman.GOAL[:2])
        filtered.predict(holding)
    np.testing.assert_allclose(filtered.p, expected, rtol=1e-6, atol=1e-6 * expected.max())
    model.close()


@pytest.fixture
def environment():
    made = gymnasium_environment.ArmEnvironment()
    yield made
    made.close()
    made.close()  # no effect


def test_gymnasium_accepts_the_environment(
    environment: gymnasium_environment.ArmEnvironment,
) -> None:
    """It warns of rates without bounds, and that it was given no name to make another one."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        check_env(environment)
    said = [str(warning.message) for warning in found]
    assert all("infinity" in line or "alternative render modes" in line for line in said), said


def energy(state: np.ndarray) -> float:
    """Energy (J) of point masses and inertias at the states of the arm with its start values."""
    m1, m2, inertia, l1, lc1, a, g = 2.0, 1.0, 0.15, 0.5, 0.25, 0.1, 9.81
    q1, q2, dq1, dq2 = state
    length = l1 + q2
    kinetic = (m1 * lc1**2 + inertia) * dq1**2 + m2 * ((dq2 - a * dq1) ** 2 + (length * dq1) ** 2)
    height = (m1 * lc1 + m2 * length) * np.sin(q1) + m2 * a * np.cos(q1)
    return kinetic / 2 + g * height


def test_a_free_motion_keeps_its_energy(environment: gymnasium_environment.ArmEnvironment) -> None:
    first, _ = environment.reset(seed=3)
    for _ in range(50):
        last, *_ = environment.step(np.zeros(2))
    assert np.abs(last - first).max() > 1.0
    assert energy(last) == pytest.approx(energy(first), abs=1e-6)


def test_episodes_by_hand_end_at_the_goal(tmp_path: Path) -> None:
    lines = printed("gymnasium_environment.py", tmp_path)
    assert len(lines) == 3
    for line in lines:
        _, q1, q2, reward = (float(x) for x in re.findall(r"-?\d[\d.e-]*", line))
        assert [q1, q2] == pytest.approx(gymnasium_environment.GOAL, abs=0.03)
        assert -0.1 < reward < 0.0


# ---- Models --------------------------------------------------------------------------------------


EXAMPLES = ROOT / "examples"


def test_a_run_of_each_model_is_drawn(tmp_path: Path) -> None:
    picture = tmp_path / "models.png"
    ran = python(EXAMPLES / "models" / "draw.py", picture, folder=tmp_path)
    assert ran.returncode == 0, ran.stderr
    files = {file.name.partition(".")[0] for file in (EXAMPLES / "models").glob("*.toml")}
    assert {line.partition(":")[0] for line in ran.stdout.splitlines()} == files
    assert picture.read_bytes().startswith(b"\x89PNG") and [*tmp_path.iterdir()] == [picture]
