"""Circuits with diodes, whose equations are nearly singular or hardly bounded, against scipy."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import root
from scipy.special import lambertw

from tests.equations.examples import METHODS, made, simulated

# a source that only leaks and a large resistance tie to the ground; nodes are at 0 up to rounding
BRIDGE = """
name = "Bridge"
[parameters]
Is = { start = 1e-9 }
Vt = { start = 0.04 }
G = { start = 1e-7 }
[states]
v = { derivative = "(i1 + i3 - v / 100) / 0.01" }
[where]
i = "(10 * sin(2 * pi * time) - (a - b)) / 2"
i1 = "Is * (exp((a - v - n) / Vt) - 1) + G * (a - v - n)"
i2 = "Is * (exp((n - a) / Vt) - 1) + G * (n - a)"
i3 = "Is * (exp((b - v - n) / Vt) - 1) + G * (b - v - n)"
i4 = "Is * (exp((n - b) / Vt) - 1) + G * (n - b)"
[algebraic]
a = { equation = "i - i1 + i2" }
b = { equation = "-i - i3 + i4 - b / 1e6" }
n = { equation = "i1 + i3 - i2 - i4" }
"""
HALF_WAVE = """
name = "HalfWave"
[states]
v = { derivative = "(i - v / 100) / 0.01" }
[where]
source = "10 * sin(2 * pi * time)"
i = "1e-9 * (exp((a - v) / 0.04) - 1)"
[algebraic]
a = { equation = "(source - a) / 2 - i" }
"""


def by_scipy(motion: Callable[[float, np.ndarray], np.ndarray], t: np.ndarray) -> np.ndarray:
    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-11, "max_step": 1e-3}
    return solve_ivp(motion, (0, t[-1]), [0.0], t_eval=t, **options).y[0]


def bridge(t: np.ndarray) -> np.ndarray:
    """Currents into a, b and n vanish; the search begins where it has ended before."""
    into = np.array([[-1, 1, 0, 0], [0, 0, -1, 1], [1, -1, 1, -1]])  # of the diodes' currents
    drop = np.array([[1, 0, -1], [-1, 0, 1], [0, 1, -1], [0, -1, 1]])  # of a, b, n
    nodes = np.zeros(3)

    def of_diodes(x: np.ndarray, v: float) -> tuple[np.ndarray, np.ndarray]:
        u = drop @ x - v * np.array([1, 0, 1, 0])
        e = 1e-9 * np.exp(np.minimum(u / 0.04, 600))
        return e - 1e-9 + 1e-7 * u, e / 0.04 + 1e-7

    def motion(time: float, v: np.ndarray) -> np.ndarray:
        nonlocal nodes

        def missing(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            currents, slopes = of_diodes(x, v[0])
            i = (10 * np.sin(2 * np.pi * time) - x[0] + x[1]) / 2
            source = np.array([[-0.5, 0.5, 0], [0.5, -0.5, 0], [0, 0, 0]])
            source[1, 1] -= 1e-6
            of = into @ currents + np.array([i, -i - x[1] / 1e6, 0])
            return of, into @ (slopes[:, None] * drop) + source

        found = root(missing, nodes, jac=True, method="lm", options={"xtol": 1e-13, "ftol": 1e-15})
        nodes = found.x
        currents, _ = of_diodes(nodes, v[0])
        return (currents[0] + currents[2] - v / 100) / 0.01

    return by_scipy(motion, t)


def half_wave(t: np.ndarray) -> np.ndarray:
    def motion(time: float, v: np.ndarray) -> np.ndarray:
        at_both = 10 * np.sin(2 * np.pi * time) - v[0]
        argument = 1e-9 * 2 / 0.04 * np.exp((at_both + 2e-9) / 0.04)
        return (0.04 / 2 * lambertw(argument).real - 1e-9 - v / 100) / 0.01

    return by_scipy(motion, t)


@pytest.mark.parametrize(
    ("text", "reference", "stop"), [(BRIDGE, bridge, 0.3), (HALF_WAVE, half_wave, 1.4)]
)
def test_a_rectifier(text: str, reference: Callable[[np.ndarray], np.ndarray], stop: float) -> None:
    """At the end, which fmpy sets, no internal step passes the time."""
    t = np.linspace(0, stop, 15)
    exact = reference(t)
    for method in METHODS.values():
        for tolerance in (1e-5, 1e-8, 1e-10):
            start = {"solver_method": method}
            run = simulated(
                made(text), stop, stop / 14, start, relative_tolerance=tolerance, also=["v"]
            )
            np.testing.assert_allclose(run["v"], exact, atol=20 * tolerance + 1e-8)


@pytest.mark.parametrize("method", ["cvode_adams", "cvode_bdf", "erk"])
def test_an_anchor_costs_no_steps(method: str) -> None:
    """A guess that knows the circuit needs as many: a far solution is found along a path."""
    guess = 'a = { start = "min(source, v + 0.6)", '
    counts = []
    for text in (HALF_WAVE, HALF_WAVE.replace("a = { ", guess).replace("HalfWave", "Guess")):
        start = {"solver_method": METHODS[method]}
        run = simulated(made(text), 1.4, 0.1, start, relative_tolerance=1e-8, also=["solver_steps"])
        counts.append(run["solver_steps"][-1])
    assert counts[0] <= 1.2 * counts[1], counts


def test_a_time_event_without_a_search() -> None:
    """Nothing but the time ends a step: x' = -z, then 1 - z, where z + z^3 = x."""
    text = """
name = "TimeEvent"
[states]
x = { start = 1, derivative = "-z + (1 if time > 0.1 else 0)" }
[algebraic]
z = { equation = "z + z**3 - x" }
"""

    def motion(time: float, z: np.ndarray) -> np.ndarray:
        return ((time > 0.1) - z) / (1 + 3 * z**2)

    z = np.array([0.6823278038280193])  # of x = 1
    for begin, end in ((0, 0.1), (0.1 + 1e-15, 0.6)):
        z = solve_ivp(motion, (begin, end), z, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    for method in METHODS.values():
        run = simulated(
            made(text), 0.6, 0.15, {"solver_method": method}, relative_tolerance=1e-9, also=["x"]
        )
        assert abs(run["x"][-1] - z[0] - z[0] ** 3) < 1e-7
