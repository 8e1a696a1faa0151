"""Plants of textbooks: against scipy from event to event, or exact recursions from tick to tick."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from tests.equations.examples import METHODS, quick, simulated

BUILT = TemporaryDirectory(prefix="rparm-textbook-")
EACH_METHOD = pytest.mark.parametrize("method", METHODS)
ONE_STEP = pytest.mark.parametrize("method", ["erk", "taylor"])
BOTH_KINDS = pytest.mark.parametrize("method", ["cvode_bdf", "taylor"])


@cache
def fmus() -> dict[str, Path]:
    with ThreadPoolExecutor(2) as pool:
        files = Path(__file__).parent.glob("*.toml")
        return {fmu.stem: fmu for fmu in pool.map(lambda f: quick(f, Path(BUILT.name)), files)}


def run_of(
    name: str, method: str, stop: float, step: float, *also: str, **start: float
) -> np.ndarray:
    """With a tolerance of 1e-11; bounds are some 100 times that, by the size of values."""
    start["solver_method"] = METHODS[method]
    also = [*also, "event_count"]
    return simulated(fmus()[name], stop, step, start, relative_tolerance=1e-11, also=also)


def columns(run: np.ndarray, *names: str) -> np.ndarray:
    return np.array([run[name] for name in names])


def followed(
    times: np.ndarray, x: list[float], mode: Any, rates: Callable, guards: Callable, jump: Callable
) -> tuple[np.ndarray, list, int]:
    """States (states, times), modes and number of events; guards of a mode rise through 0."""
    t, x, modes, count = 0.0, np.array(x, float), [mode], 0
    found = [x[:, None]]
    while True:
        events = [lambda t, x, _, g=g: g(t, x) for g in guards(mode)]
        for event in events:
            event.terminal, event.direction = True, 1
        left = times[times > t]
        part = solve_ivp(
            rates, (t, times[-1]), x, "DOP853", left, events=events or None, args=(mode,),
            rtol=1e-12, atol=1e-13 * max(1, *abs(x)),
        )  # fmt: skip
        if len(part.t):
            found, modes = [*found, part.y], modes + [mode] * len(part.t)
        hits = [k for k, at in enumerate(part.t_events or []) if at.size]
        if not hits:
            return np.hstack(found), modes, count
        t, x, count = part.t_events[hits[0]][0], part.y_events[hits[0]][0], count + 1
        x, mode = jump(hits[0], x, mode)


@EACH_METHOD
def test_brakes_keep_the_slip(method: str) -> None:
    run = run_of("Abs", method, 4.0, 0.05, "valve")

    def slip(x: np.ndarray) -> float:
        return 1 - 0.3 * x[1] / x[0]

    def rates(_: float, x: np.ndarray, mode: int) -> list[float]:
        """Modes: 1 raises, 2 lowers, 3 parked."""
        if mode == 3:
            return [0, 0, 0]
        grip = 0.6 * 9.81 * np.sin(1.9 * np.arctan(10 * slip(x)))
        wheel = 0.3 * 300 * grip - x[2] - 5 * np.tanh(x[1] / 0.5)
        return [-grip, wheel, 8000 if mode == 1 else -x[2] / 0.04]

    def guards(mode: int) -> list[Callable]:
        valve = [lambda t, x: slip(x) - 0.2, lambda t, x: 0.08 - slip(x)][mode - 1 : mode]
        return [*valve, lambda t, x: 2 - x[0]] if valve else []

    x, modes, count = followed(
        run["time"], [15, 50, 0], 1, rates, guards,
        lambda k, x, mode: (0 * x, 3) if k else (x, 3 - mode),
    )  # fmt: skip
    assert np.all(np.abs(columns(run, *"vwT") - x).max(axis=1) < [1e-9, 1e-7, 3e-6])
    assert run["valve"].tolist() == modes and modes[-1] == 3
    assert run["is_sliding"].tolist() == [mode < 3 for mode in modes]
    assert run["event_count"][-1] == count > 30


@ONE_STEP
def test_an_elevator_serves_the_nearest_call(method: str) -> None:
    """At half ticks; it moves at its limit, then its distance decays."""
    h, most, K, Ts, press = 3.0, 1.4, 1.6, 0.25, [20.1, 9.6, 0.6, 1.1, 30.3, 12.2]
    run = run_of("Elevator", method, 59.875, Ts / 2)[1::2]
    calls, x, target, served, wait, count = set(), 0.0, 1, 0, 0, 0

    def moved(span: float) -> tuple[float, int, int]:
        """The place, its storey and the number of events on the way."""
        goal = h * (target - 1)
        limited = max(0, (abs(goal - x) - most / K) / most)
        way = goal - x - np.copysign(most * min(span, limited), goal - x)
        end = goal - way * np.exp(-K * max(0, span - limited))
        first, last = (int(np.floor(at / h + 0.5)) + 1 for at in (x, end))
        return end, last, abs(last - first) + (0 < limited < span)

    for k, row in enumerate(run):
        calls |= {i for i, t in enumerate(press, 1) if t <= k * Ts < t + Ts}
        is_here = target in calls and abs(x - h * (target - 1)) < 0.01
        leaves = wait == 0 and calls and target not in calls
        wait, served = wait - 1 if wait else 12 * is_here, served + is_here
        calls -= {target} if is_here else set()
        target = min(calls, key=lambda i: (abs(x - h * (i - 1)), i)) if leaves else target
        half, storey, events = moved(Ts / 2)
        names = ("target", "served", "wait", "lowest", "is_idle", "storey", "event_count")
        exact = [target, served, wait, min(calls, default=7), not calls, storey, count + events]
        assert [row[name] for name in names] == exact
        assert row["x"] == pytest.approx(half, abs=1e-11)
        x, _, events = moved(Ts)
        count += events + 1
    assert served == 6


@BOTH_KINDS
def test_a_loop_slips_cycles_until_it_locks(method: str) -> None:
    run = run_of("Pll", method, 0.3, 0.00103, "e")

    def error(t: float, x: np.ndarray, slips: int) -> float:
        return 1600 * t + np.pi / 2 - x[0] - 2 * np.pi * slips

    def rates(t: float, x: np.ndarray, slips: int) -> list[float]:
        return [1000 + 60 * error(t, x, slips) + x[1], 3600 * error(t, x, slips)]

    x, slips, count = followed(
        run["time"], [0, 0], 0, rates, lambda n: [lambda t, x: error(t, x, n) - np.pi],
        lambda k, x, n: (x, n + 1),
    )  # fmt: skip
    assert np.all(np.abs(columns(run, "phase", "u") - x).max(axis=1) < [1e-8, 1e-7])
    assert run["slips"].tolist() == slips
    assert run["e"] == pytest.approx(error(run["time"], x, np.array(slips)), abs=1e-8)
    assert run["event_count"][-1] == count > 10 and abs(run["e"][-1]) < 0.1


@EACH_METHOD
def test_a_kalman_filter_corrects_what_it_integrates(method: str) -> None:
    """Against Van Loan's discrete model; its covariance ends at that of Riccati's equation."""
    run, h = run_of("Kalman", method, 10.0, 0.5), 0.5
    A, Q, zero = np.array([[0, 1], [-1.44, -0.1]]), np.diag([0, 0.05]), np.zeros((2, 2))
    truth = expm(h * np.block([[A, np.diag([0, 0.2])], [zero, np.array([[0, -2], [2, 0]])]]))
    both, F = expm(h * np.block([[-A, Q], [zero, A.T]])), expm(h * A)
    noise = both[2:, 2:].T @ both[:2, 2:]
    x, z, P = np.array([1, 0, 1, 0]), np.zeros(2), np.array([[1, 0.2], [0.2, 2]])
    for k, row in enumerate(run):
        gain = P[:, 0] / (P[0, 0] + 0.04)
        z = z + gain * (x[0] + 0.1 * (k % 3 - 1) - z[0])
        P = P - np.outer(gain, P[0])
        names = [f"{name}[{i}]" for name in ("x", "z", "gain") for i in (1, 2)]
        names += [f"P[{i},{j}]" for i in (1, 2) for j in (1, 2)]
        exact = [*x[:2], *z, *gain, *P.ravel()]
        assert [row[name] for name in names] == pytest.approx(exact, abs=1e-10)
        assert row["k"] == k + 1 == row["event_count"] + 1
        x, z, P = truth @ x, F @ z, F @ P @ F.T + noise
    assert np.abs(P - solve_discrete_are(F.T, np.eye(2)[:, :1], noise, [[0.04]])).max() < 1e-4


@BOTH_KINDS
def test_a_diode_blocks_until_the_switch_closes(method: str) -> None:
    run, V, T = run_of("Buck", method, 1.993e-3, 7.31e-6, "phase"), 24, 2e-5

    def rates(t: float, x: np.ndarray, mode: tuple) -> list[float]:
        """Modes: 1 charging, 2 free, 3 blocked; with the number of the period."""
        phase, period = mode
        di = 0 if phase == 3 else ((V if phase == 1 else 0) - x[1]) / 47e-6
        return [di, (x[0] - x[1] / (60 if period < 50 else 4)) / 22e-6]

    def guards(mode: tuple) -> list[Callable]:
        clock = T * (mode[1] + (0.35 if mode[0] == 1 else 1))
        return [lambda t, x: t - clock, *([lambda t, x: -x[0]] if mode[0] == 2 else [])]

    def jump(k: int, x: np.ndarray, mode: tuple) -> tuple:
        phase, period = mode
        if k:
            return x * [0, 1], (3, period)
        return x, ((2, period) if phase == 1 else (1, period + 1))

    x, modes, count = followed(run["time"], [0, 0], (1, 0), rates, guards, jump)
    assert np.abs(columns(run, "i", "u") - x).max() < 3e-9
    assert run["phase"].tolist() == [phase for phase, _ in modes]
    assert run["event_count"][-1] == count > 200


@EACH_METHOD
def test_a_quaternion_turns_as_a_matrix(method: str) -> None:
    run, J = run_of("Quadrotor", method, 5.0, 0.1, "f[3]"), [0.01, 0.012, 0.02]
    share = np.array([[0, -2, 5], [2, 0, -5], [0, 2, 5], [-2, 0, -5]])

    def parts(t: float, x: np.ndarray) -> tuple:
        w, R = x[6:9], x[9:].reshape(3, 3)
        q = Rotation.from_matrix(R).as_quat(canonical=True)
        return w, R, q, 12 * (1 + 0.1 * np.cos(3 * t)), -0.3 * q[:3] - 0.08 * w

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        w, R, _, thrust, torque = parts(t, x)
        turned = (torque + 0.05 * np.sin(2 * t * np.arange(1, 4)) - np.cross(w, J * w)) / J
        lifted = thrust / 1.2 * R[:, 2] - [0, 0, 9.81]
        return np.concatenate([x[3:6], lifted, turned, (R @ np.cross(np.eye(3), w)).ravel()])

    turn = Rotation.from_quat([0.4, -0.4, 0.2, 0.8]).as_matrix()
    start = np.concatenate([np.zeros(6), [1, -2, 0.5], turn.ravel()])
    x = solve_ivp(rates, (0, 5), start, "DOP853", run["time"], rtol=1e-12, atol=1e-13).y
    names = [f"{base}[{i}]" for base in "pvw" for i in (1, 2, 3)]
    assert np.abs(columns(run, *names) - x[:9]).max() < 1e-9
    for row, at in zip(run, x.T, strict=True):
        *_, q, thrust, torque = parts(row["time"], at)
        f = thrust / 4 + share @ torque
        found = [row[name] for name in ("q[1]", "q[2]", "q[3]", "q[0]", "f[3]", "strongest")]
        assert found == pytest.approx([*q, f[2], f.max()], abs=1e-10)
        assert row["is_strained"] == any((f > 4) | (f < 1))


@ONE_STEP
def test_smith_predicts_the_loop_without_dead_time(method: str) -> None:
    """At half ticks, by that loop's transfer function in 1 / z."""
    n, h, K, Kp, Ki, a = 8, 0.1, 2.0, 1.5, 2.0, np.exp(-0.1)
    run = run_of("Smith", method, 9.95, h / 2)[1::2]
    law, plant = np.array([Kp, Ki * h - Kp]), np.array([0, K * (1 - a)])
    whole = np.convolve([1, -1], [1, -a]) + np.convolve(law, plant)
    y, u = (lfilter(np.convolve(law, part), whole, np.ones(len(run))) for part in (plant, [1, -a]))
    late_y, late_u = (np.append(np.zeros(n), each[:-n]) for each in (y, u))
    between = K * late_u + np.sqrt(a) * (late_y - K * late_u)
    exact = [between, u, late_u]
    assert np.abs(columns(run, "y", "d[0]", f"d[{n}]") - exact).max() < 1e-11
    assert run["event_count"].tolist() == [*range(len(run))]


@BOTH_KINDS
def test_four_tanks_stop_their_pumps(method: str) -> None:
    """Without that they rest where the paper says, cm."""
    run, names = run_of("FourTanks", method, 600.0, 5.3), [f"h[{i}]" for i in range(1, 5)]
    A, a = np.array([28, 32, 28, 32]), np.array([0.071, 0.057, 0.071, 0.057])
    feed = np.array([[2.331, 0], [0, 2.01], [0, 1.34], [0.999, 0]])

    def rates(t: float, h: np.ndarray, runs: bool) -> np.ndarray:
        out = a * np.sqrt(2 * 981 * h)
        pump = np.ones(2) * runs * (3 + 0.5 * np.sin(0.05 * t))
        return (np.append(out[2:], [0, 0]) - out + feed @ pump) / A

    x, _, count = followed(
        run["time"], [1, 2, 3, 4], True, rates,
        lambda runs: [lambda t, h: max(h) - 12.5 if runs else 11.5 - max(h)],
        lambda k, h, runs: (h, not runs),
    )  # fmt: skip
    assert count > 5 and np.abs(100 * columns(run, *names) - x).max() < 1e-9
    assert run["highest"] == pytest.approx(x.max(axis=0) / 100, abs=1e-10)
    assert run["fullest"].tolist() == (x.argmax(axis=0) + 1).tolist()
    last = 100 * columns(run_of("FourTanks", method, 3e3, 3e3, swing=0, full=0.2), *names)[:, -1]
    assert rates(0.0, last, True) == pytest.approx(np.zeros(4), abs=1e-9)
    assert last == pytest.approx([12.4, 12.7, 1.8, 1.4], abs=0.2)


@EACH_METHOD
def test_an_encoder_counts_at_ticks_only(method: str) -> None:
    h, k, J, count, x, last = 5e-3, 0.05, 1e-4, np.pi / 1000, np.zeros(3), 0
    half = expm(np.array([[0, 1, 0], [0, -k * k / J / 2, k / J / 2], [0, 0, 0]]) * h / 2)
    for i, row in enumerate(run_of("Servo", method, 0.9975, h / 2)[1::2]):
        counts = np.floor(x[0] / count + 0.5)
        assert abs(x[0] / count - counts) < 0.5 - 1e-5  # above the bound below
        target = np.pi / 2 if i % 160 < 80 else -np.pi / 18
        asked = 20 * (target - counts * count) - 0.3 * (counts - last) * count / h
        x[2], last = np.clip(asked, -12, 12), counts
        x = half @ x
        assert [row["phi"], row["w"], row["u"]] == pytest.approx(x, abs=1e-9)
        assert [row["last"], row["is_limited"], row["event_count"]] == [last, abs(asked) > 12, i]
        x = half @ x


@BOTH_KINDS
def test_thermostats_are_set_back_at_night(method: str) -> None:
    run, zero, G = run_of("House", method, 172800.0, 1700.0), 273.15, np.array([90, 120])

    def target(changes: int) -> float:
        return zero + (20 if changes % 2 else 16)

    def rates(t: float, T: np.ndarray, mode: tuple) -> np.ndarray:
        """Modes: whether each room is heated, and how often the target has changed."""
        outside = zero + 4 + 6 * np.sin(2 * np.pi * t / 86400)
        return (3e3 * np.array(mode[:2]) - G * (T - outside) + 60 * (T[::-1] - T)) / 2e6

    def guards(mode: tuple) -> list[Callable]:
        middle, clock = target(mode[2]), 43200 * mode[2] + (21600, 36000)[mode[2] % 2]
        rooms = [(i, 1 if mode[i] else -1) for i in (0, 1)]
        rooms = [lambda t, T, i=i, sign=sign: sign * (T[i] - middle) - 0.5 for i, sign in rooms]
        return [*rooms, lambda t, T: t - clock]

    def jump(k: int, T: np.ndarray, mode: tuple) -> tuple:
        if k < 2:
            return T, tuple(not m if i == k else m for i, m in enumerate(mode))
        above = T - target(mode[2] + 1)
        heats = [above[i] < -0.5 or (mode[i] and above[i] <= 0.5) for i in (0, 1)]
        return T, (*heats, mode[2] + 1)

    T, _, count = followed(
        run["time"], [15 + zero, 17 + zero], (True, False, 0), rates, guards, jump
    )
    assert count > 50 and np.abs(columns(run, "T[1]", "T[2]") - T).max() < 1e-7
    assert run["coldest"] == pytest.approx(T.min(axis=0), abs=1e-7)
    assert run["is_warm"].tolist() == (T.min(axis=0) > 17 + zero).tolist()
    assert run["day"].tolist() == (run["time"] // 86400).tolist()
