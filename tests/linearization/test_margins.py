"""Margins of loops with one input and one output, in any units and with any damping.

Compared with python-control, and with eigenvalues of the closed loop on both sides of each margin.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import factorial
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.linalg import block_diag, expm, solve_discrete_are

from rparm.errors import UserError
from rparm.linearization import page
from rparm.linearization.linear import Linear, law_model, participations
from rparm.linearization.margins import Margins, margins, open_loop
from rparm.linearization.responses import check_same, minimal
from rparm.linearization.sampling import Tick
from rparm.linearization.study import Study
from rparm.linearization.system import connected, sampled
from rparm.systems.python_component import PythonComponent
from rparm.systems.structure import Connection

LOOPS = int(os.environ.get("MARGIN_LOOPS", "60"))
ORDER = 10  # of the rational delay: exact within rounding up to frequency * delay = 2 pi
SHOWN = 1e-7  # of its size: the least real part that says whether a pole is stable


def linear(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: float = 0.0) -> Linear:
    n, zero = len(A), np.zeros(1)
    names = tuple(f"x{i}" for i in range(n))
    x = np.zeros(n)
    return Linear(names, ("u",), ("y",), A, B, C, np.full((1, 1), D), x, zero, zero, x)


def rational(num: list[float], den: list[float]) -> Linear:
    """A loop from its transfer function."""
    made = control.tf2ss(num, den)
    return linear(made.A, made.B, made.C)


# ---- Loops whose margins are known ---------------------------------------------------------------


def sampled_radius(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, gain: float = 1.0, delay: int = 0
) -> float:
    """The largest pole of a closed sampled loop, with a delay of whole samples as a chain."""
    n, chain = len(A), np.eye(delay, k=-1)
    whole = np.block([[A, np.zeros((n, delay))], [np.zeros((delay, n)), chain]])
    if delay:
        whole[:n, -1:] = B
        whole[n : n + 1, :n] = -gain * C
    else:
        whole -= gain * B @ C
    return float(np.abs(np.linalg.eigvals(whole)).max())


@pytest.mark.parametrize("seed", range(40))
def test_a_sampled_loop_is_stable_up_to_its_margins_and_not_beyond(seed: int) -> None:
    source = np.random.default_rng(1000 + seed)
    while True:
        n = int(source.integers(1, 5))
        A, B = 0.7 * source.normal(size=(n, n)), source.normal(size=(n, 1))
        C = source.normal(size=(1, n)) * source.choice([0.1, 1.0])
        if sampled_radius(A, B, C) < 1:
            break
    found = margins(replace(linear(A, B, C), dt=0.01))
    assert found.stable
    up, down = min(found.gain_up, 1e5), max(found.gain_down, 1e-5)
    for gain in np.geomspace(0.999 * up, 1.001 * down, 400):
        assert sampled_radius(A, B, C, gain) < 1
    assert found.gain_up == np.inf or sampled_radius(A, B, C, 1.001 * up) > 1
    assert found.gain_down == 0 or sampled_radius(A, B, C, 0.999 * down) > 1
    for delay in range(1, 6):
        if 0.01 * delay < found.delay:
            assert sampled_radius(A, B, C, delay=delay) < 1
    first = int(np.ceil(found.delay / 0.01)) if np.isfinite(found.delay) else 0
    if 0 < first <= 5 and len(found.gain_crossings) == 1:
        assert sampled_radius(A, B, C, delay=first) > 1


def test_margins_at_round_numbers() -> None:
    """1/s has the gain 1 at 1 rad/s; 1/s^2 swings for ever, 4/(s - 1)^2 grows: no margins."""
    one, double = np.ones((1, 1)), np.array([[0.0, 1.0], [0.0, 0.0]])
    found = margins(linear(0 * one, one, one))
    assert found.phase == pytest.approx(90.0) and found.delay == pytest.approx(np.pi / 2)
    enters, leaves = np.array([[0.0], [1.0]]), np.array([[1.0, 0.0]])
    for A in (double, double + np.eye(2)):
        found = margins(linear(A, enters, 4 * leaves))
        assert not found.stable
        assert np.isnan([found.gain_up, found.gain_down, found.phase, found.delay]).all()


def trapezoidal(c: float, plant: int) -> Linear:
    """L of c (z - 1) / (z + 1): with 1 / s it is one sample late, with 1 / s^2 not."""
    if plant == 1:  # c T / (z + 1) / z
        return replace(
            linear(np.array([[0, 1.0], [0, -1]]), np.array([[0], [1.0]]), c * np.eye(1, 2)), dt=0.1
        )
    A, B = np.array([[1, 1.0, 0], [0, 1, 0], [-2 * c, 0, -1]]), np.array([[0.5], [1], [0]])
    return replace(linear(A, B, np.array([[c + 0.1, 0, 1.0]])), dt=0.1)


def test_a_pole_at_the_end_of_frequencies() -> None:
    """0.1 / (z (z + 1)): -1 times c at 120 degrees; a further sample makes it unstable."""
    found = margins(minimal(trapezoidal(0.1, 1)))
    assert found.stable and found.gain_up == pytest.approx(10.0) and found.delay == 0.1
    (one,), angle = found.gain_crossings, 2 * np.arccos(0.05)
    assert one.frequency == pytest.approx(angle / 0.1)
    assert np.radians(found.phase) == pytest.approx(3 * np.pi - 1.5 * angle)
    assert sampled_radius(*(getattr(trapezoidal(0.1, 1), x) for x in "ABC"), delay=1) > 1


def test_a_hidden_pole_that_rings_or_grows_is_not_stable() -> None:
    """The zero of a sampled 1 / s^2 hides a pole at -1 from the break, which rings for ever."""
    loop = minimal(trapezoidal(0.1, 2))
    assert loop.cancelled == pytest.approx([-1.0]) and not margins(loop).stable
    lag = linear(np.diag([-1.0, 1.0]), np.array([[1.0], [0]]), np.ones((1, 2)))
    assert not margins(minimal(lag)).stable
    lag.A[1, 1] = 0.0  # a constant
    assert margins(minimal(lag)).stable
    with pytest.raises(UserError, match="--break u: rounding hides which states are in the loop"):
        check_same(loop, replace(loop, hidden=loop.hidden + 0.1))
    with pytest.raises(UserError, match="--break u: rounding hides"):
        check_same(loop, replace(loop, C=1.01 * loop.C))


def product(*factors: list[float]) -> list[float]:
    """Coefficients of a product of polynomials."""
    result = np.ones(1)
    for factor in factors:
        result = np.polymul(result, factor)
    return result.tolist()


W = 60.0  # rad/s
MODE = [1.0, 2 * 0.001 * W, W**2]
LAG = product([1.0, 0.0], [1 / 500, 1.0])
LOOPS_BY_NAME = {  # a mode adds its answer to a rigid body's
    "mode of damping 0.001": (0.9 * np.polyadd(MODE, [0.2 * W, 0]), product(LAG, MODE)),
    "slow zero": ([3.9e-4, 3.9e-5], [1.0, 2e-4, 1.0, 0.0]),
    "unstable alone": ([120.0, 1.2, 120 * 49.0**2], product([1, -1], [1, 40], [1, 1e-2, 2500])),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS_BY_NAME)
def test_disk_margin_and_peaks_are_those_of_python_control(name: str) -> None:
    num, den = LOOPS_BY_NAME[name]
    found, w = margins(rational(num, den)), np.geomspace(1e-3, 1e4, 2000)
    for peak in (found.disk, found.sensitivity, found.complementary):
        w = np.append(w, peak.frequency * (1 + np.linspace(-1e-4, 1e-4, 201)))
    plain = control.tf(num, den)
    disk, _, _ = control.disk_margins(plain, np.sort(w))
    assert found.disk.value == pytest.approx(disk, rel=1e-6)
    values = plain(1j * w)
    assert found.sensitivity.value == pytest.approx(np.abs(1 / (1 + values)).max(), rel=1e-6)
    back = np.abs(values / (1 + values)).max()
    assert found.complementary.value == pytest.approx(back, rel=1e-6)


def test_limits_at_0_and_infinity_count() -> None:
    """-(s + 4) / (2 s + 16): -1/4 at 0 and -1/2 at infinity; above 1 there, no delay is borne."""
    A, B = np.array([[-8.0]]), np.ones((1, 1))
    for gain, up in ((1.0, 2.0), (-0.5, np.inf)):
        loop = linear(A, gain * B, 2 * B, -0.5 * gain)
        found = margins(loop)
        assert found.stable and found.gain_up == pytest.approx(up) and found.delay == np.inf
    assert margins(linear(A, B, -2 * B, 3.0)).delay == 0.0
    assert margins(linear(A, -8 * B, 0.5 * B)).gain_up == pytest.approx(2.0)


def test_a_fast_mode_behind_slow_states_is_part_of_the_loop() -> None:
    """Seen a millionth of a millionth as much as they are, but not by rounding."""
    A = np.diag([-100.0, -1.0, -2.0, -3.0, -4.0, -5.0]) + np.diag([1e-4] * 5, -1)
    loop = linear(A, np.eye(6)[:, [0, 1]].sum(axis=1, keepdims=True), np.eye(6)[[5]])
    assert minimal(loop).states == loop.states


def test_what_is_dropped_is_named_and_its_growth_is_known() -> None:
    """A state that nothing moves, one that nothing sees, and one that copies another."""
    A = np.array([[-1.0, 0, 0, 1.0], [0, 0.5, 0, 0], [1.0, 0, -3.0, 0], [0, 0, 0, -2.0]])
    A = np.block([[A, np.zeros((4, 1))], [1e-7 * A[:1], 0.0]])
    B, C = np.array([[0, 0, 0, 1.0, 0]]).T, np.array([[1.0, 1.0, 0, 0, 1e7]])
    loop = minimal(linear(A, B, C))
    assert loop.dropped in (("x1", "x2", "x4"), ("x0", "x1", "x2"))
    assert sorted(loop.hidden.real) == pytest.approx([-3.0, 0.0, 0.5], abs=1e-12)
    at_rest = loop.C @ np.linalg.solve(-loop.A, loop.B)  # twice x0, which is half of the input
    assert at_rest == pytest.approx(1.0)


def test_poles_at_0_are_0_and_slow_ones_are_not() -> None:
    """Two masses and a spring: the pole at 0 is double, and 0; a slow pole beside a fast is not."""
    A = np.zeros((4, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1], A[3] = [-1e6, 0, 1e6, 0], [3e4, 0, -3e4, 0]
    poles = linear(A, np.eye(4)[:, [1]], np.eye(4)[[2]]).poles
    assert np.count_nonzero(poles) == 2 and np.abs(poles[2:]) == pytest.approx(np.sqrt(1.03e6))
    slow = linear(np.array([[-1e-7, 1.0], [0.0, -1e4]]), np.eye(2)[:, [1]], np.eye(2)[[0]])
    table = page.poles_table(Study(Path(), slow, {}))
    assert [row[0] for row in table.rows] == ["-1e-7", "-10000"]


def test_pictures_draw_the_peaks() -> None:
    """Bode to a hundredth of a dB, and Nyquist as a round loop."""
    loop = rational(*LOOPS_BY_NAME["mode of damping 0.001"])
    w = np.linspace(0.999, 1.001, 20001) * W
    peak = np.abs(loop.ss()(1j * w)).max()
    drawn = page.bode_chart(loop, None, margins(loop)).data["curves"][0]
    hertz, decibels = drawn["hertz"], drawn["gain"]
    near = np.abs(2 * np.pi * hertz / W - 1) < 0.1
    assert decibels[near].max() == pytest.approx(20 * np.log10(peak), abs=0.01)
    drawn = page.nyquist_chart(loop, None).data["curves"][0]
    real, imag = drawn["re"], drawn["im"]
    steps = np.hypot(np.diff(real), np.diff(imag))[np.hypot(real, imag)[1:] < 3]
    assert steps.max() < 0.15 * peak
    sampled = page.bode_chart(loop, 0.07).data["curves"][1]  # the mode folds to 29.8 rad/s
    near = np.abs(2 * np.pi * sampled["hertz"] / (2 * np.pi / 0.07 - W) - 1) < 0.01
    assert sampled["gain"][near].max() > 20 * np.log10(0.3)


def test_states_take_part_in_poles_as_by_hand() -> None:
    """x'' = -3 x' - 2 x: the pole -1 has the vectors (1, -1) and (2, 1), -2 (1, -2) and (1, 1)."""
    A, units = np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([1.0, 1e6])
    for matrix in (A, A * units / units[:, None]):
        parts = participations(matrix, np.array([-1.0, -2.0]))
        assert parts == pytest.approx(np.array([[2, 1], [1, 2]]) / 3, abs=1e-9)
    twice = np.array([[-5.0, 1.0, 0.0], [0.0, -5.0, 0.0], [0.0, 0.0, -1.0]])  # one eigenvector
    parts = participations(twice, np.array([-1.0, -5.0, -5.0]))
    assert parts == pytest.approx(np.array([[0, 0, 1], [0.5, 0.5, 0], [0.5, 0.5, 0]]), abs=1e-7)


def test_marks_are_the_margins_of_the_table() -> None:
    """L = 4 / (s + 1)^3: the phase is -180 degrees at sqrt(3) rad/s, where the gain is 1/2."""
    found = margins(rational([4.0], [1.0, 3.0, 3.0, 1.0]))
    at = {name: crossing.frequency for name, crossing in page.marks(found).items()}
    crossing = np.sqrt(4 ** (2 / 3) - 1)
    expected = {"up": np.sqrt(3), "phase": crossing, "delay": crossing}
    assert at == pytest.approx(expected)
    rows = {row[0]: row[1:] for row in page.margins_table(found).rows}
    assert rows["gain margin, up (times)"] == ["2", "0.275664"]
    for name in ("phase margin (degrees)", "delay margin"):
        assert rows[name][1] == f"{crossing / (2 * np.pi):.6g}"


# ---- Sampled systems -----------------------------------------------------------------------------
SAMPLED = int(os.environ.get("SAMPLED_LOOPS", "30"))


def closed_by(
    plant: tuple[np.ndarray, ...], law: np.ndarray, T: float, late: bool, units: np.ndarray
) -> tuple[Linear, Callable[[complex], np.ndarray]]:
    """L of a plant and a law [states, y] -> [states, u], and sizes of closed poles by the gain.

    The law is a sampler, or `late` as in Python; poles are those of the whole in plain units.
    """
    A, B, C = plant
    n, k = len(A), len(law)
    motion = expm(T * np.block([[A, B], [np.zeros((1, n + 1))]]))[:n]

    def sizes(gain: complex) -> np.ndarray:
        tick, after = np.eye(n + k, dtype=complex), np.eye(n + k, dtype=complex)
        tick[n:] = np.hstack([law[:, k:] @ C, law[:, :k]])
        after[:n, :n], after[:n, -1] = motion[:, :n], gain * motion[:, n]
        whole = tick - np.eye(n + k) + after if late else after @ tick
        if late:
            whole[n:] = tick[n:]
        return np.abs(np.linalg.eigvals(whole))

    zero = np.zeros
    own, other = units[:n], np.append(units[n : n + k - 1], 1.0)
    scaled = law * other[:, None] / np.append(other, 1.0)
    matrices = A * own[:, None] / own, B * own[:, None], C / own, zero((1, 1))
    names = [tuple(f"{name}{i}" for i in range(count)) for name, count in (("x", n), ("s", k))]
    parts = {"p": Linear(names[0], ("u",), ("y",), *matrices, *map(zero, (n, 1, 1, n)))}
    at = [*map(zero, (k, 1, 1, k))]
    leaves, through = np.eye(1, k, k - 1), zero((1, 1))
    wires = [Connection("p", "y", "l", "y"), Connection("l", "u", "p", "u")]
    if late:
        parts["l"] = Linear(
            names[1], ("y",), ("u",), scaled[:, :k], scaled[:, k:], leaves, through, *at, dt=T
        )
        whole = sampled(parts, wires[:1], T, ["p.y", "l.u"])
    else:
        tick = Tick("s", T, 0.0, [*range(k)], scaled, 0 * scaled, {}, [])
        still = zero((k, k)), zero((k, 1))
        parts["l"] = Linear(names[1], ("y",), ("u",), *still, leaves, through, *at, ticks=(tick,))
        whole = connected(parts, wires[:1]).discretized()
    return open_loop(whole.select(["p.u"], ["l.u"])), sizes


@pytest.mark.parametrize("late", [False, True])
def test_margins_of_random_observers_are_those_of_the_whole_loop(late: bool) -> None:
    """Integrators and lags in series, with a mode or without, in units 12 decades apart."""
    seen = 0
    for seed in range(SAMPLED):
        source = np.random.default_rng(3000 + seed)
        n, T = int(source.integers(1, 5)), 10 ** source.uniform(-2, -0.3)
        A = np.diag(source.choice([0.0, -1.0, -5.0, 0.3], n, p=[0.5, 0.2, 0.2, 0.1]))
        A, B, C = A + np.eye(n, k=-1), np.eye(n, 1), np.eye(1, n, n - 1)
        if n > 1 and source.random() < 0.5:
            A[:2, :2] = [[0.0, -8.0], [8.0, -0.1]]
        motion = expm(T * np.block([[A, B], [np.zeros((1, n + 1))]]))[:n]
        F, G = motion[:, :n], motion[:, n:]
        X = solve_discrete_are(F, G, 10 ** source.uniform(-2, 4) * C.T @ C, np.eye(1))
        Y = solve_discrete_are(F.T, C.T, 10 ** source.uniform(0, 4) * G @ G.T, np.eye(1))
        K, L = G.T @ X @ F / (1 + G.T @ X @ G), F @ Y @ C.T / (1 + C @ Y @ C.T)
        law = np.hstack([F - L @ C, G, L])
        law = np.vstack([law, -K @ law])
        loop, sizes = closed_by((A, B, C), law, T, late, 10 ** source.uniform(-6, 6, 2 * n + 1))
        found = margins(loop)
        assert found.stable == (sizes(1).max() < 1), seed
        if not found.stable:
            continue
        seen += 1
        for low, high in ((found.gain_up, 1), (1 / max(found.gain_down, 1e-9), -1)):
            if low < 1e3:
                inside, outside = ((x * low) ** high for x in (0.999, 1.001))
                assert sizes(inside).max() < 1 < sizes(outside).max(), (seed, low, high)
        if found.gain_crossings:
            turned = np.exp(-1j * np.radians(found.phase))
            assert np.abs(sizes(turned) - 1).min() < 1e-6, seed
    assert seen > SAMPLED / 3


def test_an_input_that_nothing_follows_in_this_step_is_named(tmp_path: Path) -> None:
    """A law that acts every fifth step sums y until then: differences see no way to u."""
    text = """class Law:
    inputs, outputs = ["y"], ["u"]
    count, total, u = 3, 0.0, 0.0
    def step(self, t, h, inputs):
        self.total, self.count = self.total + inputs["y"], self.count + 1
        if self.count % 5 == EVERY:
            self.u = -0.1 * self.total
        return {"u": self.u}
    def save(self):
        return [self.count, self.total, self.u]
    def restore(self, saved):
        self.count, self.total, self.u = saved
"""
    for every, flat in (("0", ("step in y",)), ("self.count % 5", ())):
        (tmp_path / "law.py").write_text(text.replace("EVERY", every), encoding="utf-8")
        with PythonComponent.read("law.py", tmp_path).instance("law") as law:
            law.enter_initialization()
            law.exit_initialization()
            model = law_model(law, 0.0, 0.1, np.zeros(1))
            assert model.flat == flat and bool(model.uneven) == (every == "0")


def test_a_number_that_each_step_changes_is_no_index(tmp_path: Path) -> None:
    text = """class Law:
    inputs, outputs = ["y"], ["u"]
    buffer, k = [0.0, 0.0, 0.0], 0
    def step(self, t, h, inputs):
        u, self.buffer[self.k] = self.buffer[self.k], -inputs["y"]
        self.k = (self.k + 1) % 3
        return {"u": u}
    def save(self):
        return {"buffer": self.buffer, "k": self.k}
    def restore(self, saved):
        self.buffer, self.k = list(saved["buffer"]), saved["k"]
"""
    (tmp_path / "law.py").write_text(text, encoding="utf-8")
    with PythonComponent.read("law.py", tmp_path).instance("law") as law:
        law.enter_initialization()
        law.exit_initialization()
        with pytest.raises(UserError, match="each step changes k, a whole number"):
            law_model(law, 0.0, 0.1, np.zeros(1))


# ---- Random loops --------------------------------------------------------------------------------


@dataclass
class Loop:
    """A random L in s and plain units, and the same in other units of time and states."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    second: float  # how long it is in the other unit of time
    other: Linear

    def growth(self, gain: float = 1.0, delay: float = 0.0) -> float:
        """The largest real part of a pole of the closed loop, of the pole's size."""
        poles = np.linalg.eigvals(closed_matrix(self.A, gain * self.B, self.C, delay))
        return float((poles.real / np.abs(poles)).max())


def closed_matrix(A: np.ndarray, B: np.ndarray, C: np.ndarray, delay: float) -> np.ndarray:
    """The closed loop; with a delay by Pade, whose gain is 1 at all frequencies."""
    whole = A, B, C, np.zeros((1, 1))
    factors = [
        factorial(2 * ORDER - k) / factorial(k) / factorial(ORDER - k) for k in range(ORDER + 1)
    ]
    for pole in np.roots(factors[::-1]):
        if delay and pole.imag > 0:  # a section of the second order, of gain 1
            size = abs(pole) / delay
            section = np.array([[0.0, size], [-size, 2 * pole.real / delay]])
            leaves = np.array([[0.0, 4 * pole.real / delay]])
            whole = series(whole, (section, np.array([[0.0], [1.0]]), leaves, np.ones((1, 1))))
    return whole[0] - whole[1] @ whole[2]


def series(first: tuple, second: tuple) -> tuple:
    """A, B, C and D of one model behind another."""
    (A, B, C, D), (E, F, G, H) = first, second
    return (
        np.block([[A, np.zeros((len(A), len(E)))], [F @ C, E]]),
        np.vstack([B, F @ D]),
        np.hstack([H @ C, G]),
        H @ D,
    )


def random_loop(seed: int) -> Loop:
    """Chains, flexible modes of damping 1e-5 to 1, filters; unstable by itself now and then."""
    source = np.random.default_rng(seed)

    def rate(low: float = -2, high: float = 2) -> float:
        return float(10 ** source.uniform(low, high))

    blocks = [
        np.array([[source.choice([0.0, -rate(), -rate(), 0.3 * rate()], p=[0.4, 0.3, 0.2, 0.1])]])
    ]
    enters, leaves = [np.ones((1, 1))], [np.array([[rate()]])]
    for _ in range(source.integers(0, 4)):
        w, damping = rate(), rate(-5, 0)
        blocks.append(np.array([[0.0, w], [-w, -2 * damping * w]]))
        enters.append(np.array([[0.0], [1.0]]))
        leaves.append(
            source.choice([-1, 1]) * rate(-3, 1) * np.roll([[w, 0.0]], source.integers(2))
        )
    A = block_diag(*blocks)
    whole = A, np.vstack(enters), np.hstack(leaves), np.zeros((1, 1))
    for _ in range(source.integers(0, 4)):  # an integrator, a lag, or a lead
        pole = -source.choice([0.0, rate(), rate()])
        zero, one = source.choice([0.0, rate()]), np.ones((1, 1))
        lead = (pole * one, one, (zero + pole) * one, one)
        whole = series(whole, lead if zero else (pole * one, one, one, 0 * one))
    A, B, C, _ = whole
    for _ in range(20):  # tries: most gains make the loop unstable
        w = rate(-2.5, 2.5)
        size = abs((C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B))[0, 0])
        C = source.choice([1, 1, 1, -1]) * C / size
        if np.linalg.eigvals(A - B @ C).real.max() < 0 or source.random() < 0.02:
            break
    second = rate(-6, 6)
    units = 10 ** source.uniform(-6, 6, len(A))
    other = [A * units[:, None] / units / second, B * units[:, None] / second, C / units]
    if source.random() < 0.3:  # a state that moves as another one does
        k, n = source.integers(len(A)), len(A)
        factor, share = rate(-6, 6), source.random()
        other[0] = np.block([[other[0], np.zeros((n, 1))], [factor * other[0][k], 0.0]])
        other[1] = np.vstack([other[1], factor * other[1][k]])
        other[2] = np.hstack([other[2], share * other[2][:, [k]] / factor])
        other[2][0, k] *= 1 - share
    return Loop(A, B, C, second, linear(*other))


@pytest.fixture(scope="module")
def random_loops() -> list[tuple[int, Loop, Margins]]:
    """Loops by their seeds, with their margins in the other units; none is at the verge."""
    made = [(seed, random_loop(seed)) for seed in range(LOOPS)]
    return [
        (seed, loop, margins(minimal(loop.other)))
        for seed, loop in made
        if abs(loop.growth()) > SHOWN
    ]


def test_a_state_that_moves_as_another_is_dropped_in_all_units() -> None:
    for seed in range(LOOPS):
        loop = random_loop(seed)
        assert len(minimal(loop.other).states) == len(loop.A), seed


def test_random_loops_are_stable_up_to_their_gains_and_not_beyond(random_loops: list) -> None:
    """Eigenvalues in plain units, between and on both sides of the margins."""
    seen = {"up": 0, "down": 0, "unstable": 0}
    for seed, loop, found in random_loops:
        assert found.stable == (loop.growth() < 0), seed
        if not found.stable:
            seen["unstable"] += 1
            continue
        up, down = found.gain_up, found.gain_down
        inside = np.geomspace(max(1.02 * down, 1e-4), min(0.98 * up, 1e4), 60)
        assert all(loop.growth(gain=gain) < SHOWN for gain in inside), seed
        factors = [1 / abs(x.value) for x in found.phase_crossings]
        if up < np.inf:
            after = min((x for x in factors if x > up * (1 + 1e-9)), default=np.inf)
            assert loop.growth(gain=min(1.02 * up, np.sqrt(up * after))) > 0, seed
            seen["up"] += 1
        if down > 0:
            after = max((x for x in factors if x < down * (1 - 1e-9)), default=0.0)
            assert loop.growth(gain=max(0.98 * down, np.sqrt(down * after))) > 0, seed
            seen["down"] += 1
    assert all(count > LOOPS / 30 for count in seen.values()), seen


def test_random_loops_are_stable_up_to_their_delay_and_not_beyond(random_loops: list) -> None:
    seen = 0
    for seed, loop, found in random_loops:
        if not found.stable:
            continue
        delay = found.delay / loop.second
        inside = [part * min(delay, 1e3) for part in (0.05, 0.2, 0.5, 0.8, 0.98)]
        assert all(loop.growth(delay=x) < SHOWN for x in inside), seed
        if delay < np.inf:
            after = [
                (np.angle(-x.value) % (2 * np.pi) + turn) / x.frequency / loop.second
                for x in found.gain_crossings
                for turn in (0.0, 2 * np.pi)
            ]
            after = min((x for x in after if x > delay * (1 + 1e-9)), default=np.inf)
            assert loop.growth(delay=min(1.02 * delay, (delay + after) / 2)) > 0, seed
            seen += 1
    assert seen > LOOPS / 3


def test_crossings_of_random_loops_are_those_of_python_control(random_loops: list) -> None:
    """In plain units, where its polynomials do well."""
    for seed, loop, found in random_loops:
        plain = linear(loop.A, loop.B, loop.C).ss()
        gains, _, _, turns, ones, _ = control.stability_margins(plain, returnall=True)
        ours = np.array([x.frequency for x in found.gain_crossings]) * loop.second
        for w in ones:
            if abs(abs(plain(1j * w)) - 1) < 1e-6:
                assert np.abs(ours / w - 1).min(initial=1.0) < 1e-5, seed
        ours = np.array([x.frequency for x in found.phase_crossings]) * loop.second
        for w, gain in zip(turns, gains, strict=True):
            if abs(plain(1j * w) * gain + 1) < 1e-6 and 1e-6 < gain < 1e6:
                assert np.abs(ours - w).min(initial=np.inf) <= 1e-5 * w, seed
