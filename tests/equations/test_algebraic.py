"""Equations that need each other: derivatives against mpmath, published problems, failures."""

import os
import random
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
import mpmath
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipj, lambertw

from tests.equations import test_equation_derivatives as plain
from tests.equations.compiled import Model
from tests.equations.examples import METHODS, quick
from tests.equations.hybrid_runs import Exchange, Unit, co_simulation, model_exchange
from tests.equations.test_equation_derivatives import (  # noqa: F401
    test_jacobian,
    test_series_fits_the_equations,
    test_values_and_derivatives_along_a_curve,
)
from tests.support.tables import tables

# ---- Derivatives ---------------------------------------------------------------------------------

UNKNOWNS = ("v", "w", "m", "n", "k")
TIGHT = {"v": "0.4 * sin(v + 0.5 * w) + ({a})", "w": "({b}) - 0.3 * tanh(v * w)"}
LINEAR = {"m": "0.5 * n + ({a})", "n": "2 - 0.3 * m * sin({b}) + 0.1 * v"}
SINGLE = {"k": "0.25 * cos(k) * ({a})"}


class Solutions:
    """The unknowns by mpmath, as functions of all that is given."""

    def __init__(self, texts: dict[str, str]) -> None:
        self.sides = [
            plain.reference(text, (*plain.NAMES, "time", *UNKNOWNS)) for text in texts.values()
        ]
        self.known: dict[tuple, mpmath.matrix] = {}

    def of(self, number: int, *given: mpmath.mpf) -> mpmath.mpf:
        key = (mpmath.mp.dps, *given)
        if key not in self.known:
            at = dict(zip((*plain.NAMES, "time"), given, strict=True))

            def missed(*z: mpmath.mpf) -> list[mpmath.mpf]:
                named = at | dict(zip(UNKNOWNS, z, strict=True))
                return [side(**named) - own for side, own in zip(self.sides, z, strict=True)]

            guess = [0.5] * len(UNKNOWNS)
            self.known[key] = mpmath.findroot(missed, guess, tol=16 * mpmath.eps, maxsteps=50)
        return self.known[key][number]


@pytest.fixture(scope="module", params=range(3))
def case(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple]:
    """A model with systems, nonlinear and linear, texts of its equations, and a point."""
    chance = random.Random(request.param)
    inner = [plain.expression(chance, 3) for _ in range(5)]
    texts = {n: t.format(a=inner[0], b=inner[1]) for n, t in TIGHT.items()}
    texts |= {n: t.format(a=inner[2], b=inner[3]) for n, t in LINEAR.items()}
    texts |= {n: t.format(a=inner[4]) for n, t in SINGLE.items()}

    def mixed(depth: int) -> str:
        named = rf"\b({'|'.join(plain.NAMES[1:])})\b"
        return re.sub(
            named,
            lambda m: chance.choice([m[0], *UNKNOWNS]),
            plain.expression(chance, depth),
        )

    sides = {name: mixed(3) for name in ("x", "y", *(f"z{i}" for i in range(8)))}
    outputs = "".join(f'{n} = {{ value = "{t}" }}\n' for n, t in sides.items() if n[0] == "z")
    tight = "".join(f'{n} = {{ start = 0.5, equation = "{n} - ({texts[n]})" }}\n' for n in TIGHT)
    where = "".join(f'{n} = {{ value = "{texts[n]}", start = 0.5 }}\n' for n in [*LINEAR, *SINGLE])
    model = Model(
        tmp_path_factory.mktemp("model"),
        'name = "Random"\n[parameters]\np = { start = 1 }\n[inputs]\nu = {}\n[states]\n'
        f'x = {{ derivative = "{sides["x"]}" }}\ny = {{ derivative = "{sides["y"]}" }}\n'
        f"[algebraic]\n{tight}[where]\n{where}[outputs]\n{outputs}",
    )
    solutions, call = Solutions(texts), f"({', '.join(plain.NAMES)}, time)"
    functions = {
        f"solved_{n}": (lambda *a, i=i: solutions.of(i, *a)) for i, n in enumerate(UNKNOWNS)
    }
    plain.PYTHON.update(functions)
    called = {
        name: re.sub(rf"\b({'|'.join(UNKNOWNS)})\b", rf"solved_\1{call}", text)
        for name, text in sides.items()
    }
    point = {name: chance.uniform(-1.5, 1.5) for name in (*plain.NAMES, "time")}
    yield model, called, point, chance
    for name in functions:
        del plain.PYTHON[name]


# ---- Published problems --------------------------------------------------------------------------

PROBLEMS = tables(str(Path(__file__).with_name("algebraic")))
Solution = dict[str, np.ndarray | float]


def robertson(_t: np.ndarray) -> Solution:
    """By scipy, as ordinary differential equations."""

    def rates(_t: float, y: np.ndarray) -> list[float]:
        a, b, c = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
        return [b - a, a - b - c, c]

    found = solve_ivp(rates, (0, 400), [1, 0, 0], "Radau", rtol=1e-13, atol=1e-18).y[:, -1]
    return dict(zip(("y1", "y2", "y3"), found, strict=True))


def akzo_nobel(_t: np.ndarray) -> Solution:
    """Reference of the test set for IVP solvers."""
    numbers = "0.1150794920661702 0.1203831471567715e-2 0.1611562887407974"
    numbers += " 0.3656156421249283e-3 0.1708010885264404e-1 0.4873531310307455e-2"
    return {f"y{i}": float(number) for i, number in enumerate(numbers.split(), 1)}


def transistor_amplifier(_t: np.ndarray) -> Solution:
    """Reference of the test set for IVP solvers."""
    numbers = "-0.5562145012262709e-2 3.006522471903042 2.849958788608128 2.926422536206241"
    numbers += " 2.704617865010554 2.761837778393145 4.770927631616772 1.236995868091548"
    return {f"y{i}": float(number) for i, number in enumerate(numbers.split(), 1)}


def diode(t: np.ndarray) -> Solution:
    saturation, thermal, resistance, u = 1e-9, 0.026, 5, 1.2 * np.sin(t)
    argument = saturation * resistance / thermal * np.exp((u + saturation * resistance) / thermal)
    return {"i": thermal / resistance * lambertw(argument).real - saturation}


def solar_cell(t: np.ndarray) -> Solution:
    """The voltage by how long it takes to reach it."""
    light, dark, thermal, series, parallel = 3.8, 2e-9, 0.0335, 0.02, 15
    both = series + parallel

    def current(v: float) -> float:
        most = parallel * (series * (light + dark) + v) / (thermal * both)
        argument = series * dark * parallel / (thermal * both) * np.exp(most)
        first = (parallel * (light + dark) - v) / both
        return first - thermal / series * lambertw(argument).real

    def late(v: float) -> float:
        return quad(lambda at: 12 / current(at), 0, v, epsabs=1e-14, epsrel=1e-14)[0] - t[-1]

    end = brentq(late, 0.1, 0.64, xtol=1e-15)
    return {"v": end, "i": current(end)}


def four_bars(t: np.ndarray) -> Solution:
    a, b, c, d = 1, 3, 2.5, 3

    def angles(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        k1, k2, k3 = d / a, d / c, (a**2 - b**2 + c**2 + d**2) / (2 * a * c)
        first = np.cos(phi) - k1 - k2 * np.cos(phi) + k3
        second, third = -2 * np.sin(phi), k1 - (k2 + 1) * np.cos(phi) + k3
        psi = 2 * np.arctan((-second - np.sqrt(second**2 - 4 * first * third)) / (2 * first))
        coupler = d + c * np.exp(1j * psi) - a * np.exp(1j * phi)
        return np.angle(coupler), psi

    theta, psi = angles(0.5 + 1.9 * t)

    def height(at: float) -> float:
        theta, psi = angles(0.5 + 1.9 * at)
        return b * np.sin(theta) + c * np.sin(psi)

    whole = quad(height, 0, t[-1], epsabs=1e-13, epsrel=1e-13, limit=200)[0]
    return {"theta": theta, "psi": psi, "s": whole}


def slider_crank(t: np.ndarray) -> Solution:
    r, length = 0.3, 0.8

    def rate(phi: float) -> float:
        return 4 + np.sqrt(1 - (r / length * np.sin(phi)) ** 2)

    def late(phi: float) -> float:
        return quad(lambda at: 1 / rate(at), 0, phi, epsabs=1e-14, epsrel=1e-14)[0] - t[-1]

    phi = brentq(late, 10, 20, xtol=1e-14)
    x = r * np.cos(phi) + np.sqrt(length**2 - (r * np.sin(phi)) ** 2)
    return {"phi": phi, "beta": np.arcsin(r / length * np.sin(phi)), "x": x}


def kepler(t: np.ndarray) -> Solution:
    e = 0.6
    of = [
        brentq(lambda at, M=M: at - e * np.sin(at) - M, M - 1, M + 1, xtol=1e-15) for M in 0.1 + t
    ]

    def area(at: float) -> float:
        return (1 - e * np.cos(at)) ** 3 / 2

    return {"E": np.array(of), "A": quad(area, of[0], of[-1], epsabs=1e-13, epsrel=1e-13)[0]}


def pendulum(t: np.ndarray) -> Solution:
    """By elliptic functions: from the horizontal, k = sin(45 deg)."""
    g, m = 9.81, 0.5
    _, cn, dn, _ = ellipj(np.sqrt(g) * t, m)
    theta = 2 * np.arcsin(np.sqrt(m) * cn / dn)
    return {"x": np.sin(theta), "y": -np.cos(theta), "T": 3 * g * np.cos(theta)}


def ladder(t: np.ndarray) -> Solution:
    fibonacci = [0, 1]
    while len(fibonacci) < 42:
        fibonacci.append(sum(fibonacci[-2:]))
    u = np.exp(-t * fibonacci[40] / fibonacci[41])
    of = {f"w[{i}]": u * fibonacci[2 * (20 - i) + 1] / fibonacci[41] for i in (1, 7, 20)}
    return of | {"u": u}


def enzyme(t: np.ndarray) -> Solution:
    half, most = 4 / 5, 2.5 * 0.2
    s = half * lambertw(2 / half * np.exp((2 - most * t) / half)).real
    return {"s": s, "c": 0.2 * s / (half + s)}


def van_der_pol(t: np.ndarray) -> Solution:
    left = 2 - np.log(2) - t
    y = np.sqrt(-lambertw(-np.exp(-2 * left), -1).real)
    return {"y": y, "z": y**3 / 3 - y}


SOLUTIONS = [
    robertson, akzo_nobel, transistor_amplifier, diode, solar_cell, four_bars, slider_crank,
    kepler, pendulum, ladder, enzyme, van_der_pol,
]  # fmt: skip


def made(folder: Path, text: str) -> tuple[Path, Path]:
    """The unpacked FMUs of both versions of FMI."""
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    fmu = quick(path, folder)
    found = fmu, fmu.parent / "fmi3" / fmu.name
    return tuple(
        Path(fmpy.extract(str(each), str(folder / f"{i}"))) for i, each in enumerate(found)
    )


def run(
    unpacked: Path, method: str, tolerance: float, stop: float, step: float, names: list[str]
) -> np.ndarray:
    return fmpy.simulate_fmu(
        str(unpacked),
        stop_time=stop,
        output_interval=step,
        relative_tolerance=tolerance,
        start_values={"solver_method": METHODS[method]},
        output=names,
    )


@pytest.mark.parametrize("solution", SOLUTIONS, ids=lambda solution: solution.__name__)
def test_a_published_problem(solution: Callable[[np.ndarray], Solution], tmp_path: Path) -> None:
    """In every method that suits; FMI 3.0 has the bits of FMI 2.0."""
    problem = PROBLEMS[solution.__name__]
    units, times = made(tmp_path, problem["text"]), (problem["stop"], problem["step"])
    t = np.linspace(0, problem["stop"], 1 + round(problem["stop"] / problem["step"]))
    expected = solution(t)
    for method in problem["methods"]:
        for tolerance in (1e-8, 1e-12):
            rows, other = (run(unit, method, tolerance, *times, [*expected]) for unit in units)
            np.testing.assert_array_equal(rows, other)
            for name, of in expected.items():
                found = rows[name][-1:] if np.ndim(of) == 0 else rows[name]
                error = np.max(np.abs(found - of)) / np.max(np.abs(of))
                print(solution.__name__, method, tolerance, name, error)
                assert error <= 10 * tolerance, (
                    method,
                    tolerance,
                    name,
                    error,
                )


# ---- Guesses -------------------------------------------------------------------------------------

# sin(z - x) + sin(x) / 5 = 0: its solutions are 2 pi apart, so that one from far away is another
BRANCHES = """
name = "Branches"
[states]
x = {{ derivative = "1" }}
y = {{ derivative = "cos(z) / (1.5 + sin(z / 3))" }}
[algebraic]
z = {{ {start}equation = "sin(z - x) + 0.2 * sin(x)" }}
"""


def branch(t: float) -> float:
    return t - np.arcsin(0.2 * np.sin(t))


@pytest.mark.parametrize("start", ["", 'start = "x", '], ids=["anchor", "start"])
def test_a_solution_stays_on_its_branch(start: str, tmp_path: Path) -> None:
    """In steps of any length, up to one of 40 s."""

    def rate(t: float) -> float:
        return np.cos(branch(t)) / (1.5 + np.sin(branch(t) / 3))

    y = quad(rate, 0, 40, limit=500, epsabs=1e-12)[0]
    unit, _ = made(tmp_path, BRANCHES.format(start=start))
    for method in METHODS:
        for step in (0.1, 8.0, 40.0):
            end = run(unit, method, 1e-9, 40, step, ["y", "z"])[-1]
            assert abs(end["z"] - branch(40)) < 1e-9, (method, step)
            assert abs(end["y"] - y) < 1e-7, (method, step)


KEPLER = PROBLEMS["kepler"]["text"]


@pytest.mark.parametrize(
    "text", [KEPLER, BRANCHES.format(start=""), PROBLEMS["four_bars"]["text"]],
    ids=["kepler", "branches", "four_bars"],
)  # fmt: skip
def test_snapshots_change_no_bit(text: str, tmp_path: Path) -> None:
    """Nor do bytes, points at which a step is tried and undone, or outputs in between."""
    unit = Unit(tmp_path, text)
    for method in METHODS:
        fmu = unit.instance(FMU2Slave)
        fmu.instantiate()
        fmu.setupExperiment(tolerance=1e-8)
        fmu.setInteger(unit.of("solver_method"), [METHODS[method]])
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        step, rows, saved = 0.31, [], {}
        asked = unit.of(*unit.states, *unit.unknowns)

        def advance(first: int, last: int, fmu=fmu, step=step, asked=asked) -> list:
            found = []
            for k in range(first, last):
                fmu.doStep(k * step, step)
                found.append(fmu.getReal(asked))
            return found

        for k in range(60):
            saved[k] = fmu.getFMUState()
            rows += advance(k, k + 1)
        for k in (0, 7, 31, 50):
            state = saved[k]
            if k % 2:
                state = fmu.deSerializeFMUstate(fmu.serializeFMUState(state))
            fmu.setFMUState(state)
            advance(k, min(60, k + 3))  # undone
            fmu.setFMUState(state)
            assert advance(k, k + 10) == rows[k : k + 10], (method, k)
        fmu.freeInstance()


def test_model_exchange_tries_steps(tmp_path: Path) -> None:
    """Only completed steps move the point from which solutions are searched."""
    unit = Unit(tmp_path, BRANCHES.format(start=""))

    def go(tries: bool) -> list[np.ndarray]:
        exchange, rows, h = Exchange(unit, 1e-8, {}), [], 0.2
        fmu, x = exchange.fmu, np.zeros(2)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        x = exchange.settle(x)
        for k in range(100):
            if tries:
                exchange.rates(k * h + 5, x + 1.7)
                exchange.rates(k * h, x)
            k1 = exchange.rates(k * h, x)
            x = exchange.moved(k * h, x, h, k1)
            exchange.put((k + 1) * h, x)
            fmu.completedIntegratorStep()
            rows.append([*x, *fmu.getReal(unit.of("z"))])
        fmu.freeInstance()
        return rows

    rows = go(tries=False)
    assert rows == go(tries=True)
    assert abs(rows[-1][-1] - branch(20)) < 1e-6


# ---- Random models -------------------------------------------------------------------------------

COUNT = int(os.environ.get("ALGEBRAIC_MODELS", "12"))


@dataclass(frozen=True)
class Mixed:
    """States, a nonlinear and a linear block with corners, and an event on an unknown."""

    a: list[float]

    @classmethod
    def of(cls, seed: int) -> "Mixed":
        chance = random.Random(seed)
        return cls([round(chance.uniform(0.2, 1.0), 3) for _ in range(10)])

    def text(self) -> str:
        a = self.a
        return f"""
name = "Mixed"
[states]
x = {{ derivative = "-{a[0]} * x + {a[1]} * z + {a[2]} * sin(3 * time)" }}
y = {{ start = 0.3, derivative = "{a[3]} * m - 2 * y" }}
[algebraic]
z = {{ equation = "z + {a[4]} * tanh(z + x) + 0.6 * {a[5]} * abs(z - 0.1) - drive" }}
[where]
drive = "{a[6]} * y + sin(2 * time)"
m = "0.5 * n + z"
n = "2 - 0.3 * m - min(x, {a[7]})"
[events.high]
when = "z > {a[8]}"
reinit = {{ x = "x + {a[9]} * (1 + m**2 / 9)" }}
"""

    def unknowns(self, t: float, x: float, y: float) -> tuple[float, float]:
        a = self.a

        def missed(z: float) -> float:
            left = z + a[4] * np.tanh(z + x) + 0.6 * a[5] * abs(z - 0.1)
            return left - a[6] * y - np.sin(2 * t)

        z = brentq(missed, -30, 30, xtol=1e-15, rtol=1e-15)
        return z, (0.5 * (2 - min(x, a[7])) + z) / 1.15

    def motion(self, stop: float, times: np.ndarray) -> tuple[np.ndarray, list[float]]:
        """The states by scipy, and the times of the events."""
        a = self.a

        def rates(t: float, s: np.ndarray) -> list[float]:
            z, m = self.unknowns(t, *s)
            return [-a[0] * s[0] + a[1] * z + a[2] * np.sin(3 * t), a[3] * m - 2 * s[1]]

        def high(t: float, s: np.ndarray) -> float:
            return self.unknowns(t, *s)[0] - a[8]

        high.terminal, high.direction = True, 1.0
        t, state, found, events = 0.0, np.array([0.0, 0.3]), np.full((len(times), 2), np.nan), []
        while t < stop and not (len(events) > 5 or (events[1:] and events[-1] - events[-2] < 0.05)):
            part = solve_ivp(
                rates, (t, stop), state, "DOP853", events=high, rtol=1e-10, atol=1e-12,
                max_step=0.02, dense_output=True,
            )  # fmt: skip
            inside = (times >= t) & (times <= part.t[-1])
            if inside.any():
                found[inside] = part.sol(times[inside]).T
            t, state = part.t[-1], part.y[:, -1].copy()
            if part.status == 1:
                events.append(t)
                state[0] += a[9] * (1 + self.unknowns(t, *state)[1] ** 2 / 9)
                found[times >= t] = np.nan
        return found, events


def failure(seed: int) -> str:
    """What is wrong with the runs of a random model; nothing if they follow scipy."""
    mixed, step, count = Mixed.of(seed), 0.05, 80
    times = step * np.arange(1, count + 1)
    expected, events = mixed.motion(step * count, times)
    away = np.array([all(abs(t - at) > 1e-5 for at in events) for t in times])
    away &= np.isfinite(expected[:, 0])  # events that follow each other fast are not judged
    with TemporaryDirectory() as folder:
        unit = Unit(Path(folder), mixed.text())
        for kind in [*METHODS, "model_exchange"]:
            if kind == "model_exchange":
                found = model_exchange(unit, 1e-10, step, count, {})
            else:
                found = co_simulation(unit, kind, 1e-10, step, count, {}, events)
            if found.failure or found.differences:
                return f"{seed} {kind}: {found.failure} {found.differences}"
            error = np.max(np.abs(np.array(found.x) - expected)[away])
            if not error < 1e-6:
                return f"{seed} {kind}: error {error}, events at {events}"
    return ""


def test_random_models_follow_scipy() -> None:
    """Each in all methods with snapshots, and in Model Exchange."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = [text for text in pool.map(failure, range(COUNT)) if text]
    assert not found, "\n".join(found)


# ---- Limits of unknowns --------------------------------------------------------------------------

# x falls through 0; z has the sign of x, and what its branch calculates beyond 0 is no solution, or
# one that clings to 0, or a root of a negative number
LIMITS = {
    "clings": ("z + z / sqrt(abs(z) + 0.01)", lambda z: z + z / np.sqrt(np.abs(z) + 0.01)),
    "edge": (
        "z + (sqrt(z) if z > 0 else -sqrt(-z))",
        lambda z: z + np.sign(z) * np.sqrt(np.abs(z)),
    ),
    "one_edge": (
        "z + (sqrt(z) if z > 0 else z)",
        lambda z: z + (np.sqrt(z) if z > 0 else z),
    ),
    "ends_behind": (
        "z + (sqrt(z + 1e-3) if z > 0 else 2 * sqrt(1e-3) - sqrt(1e-3 - z)) - sqrt(1e-3)",
        lambda z: z + np.sign(z) * (np.sqrt(np.abs(z) + 1e-3) - np.sqrt(1e-3)),
    ),
}


@pytest.mark.parametrize("name", LIMITS)
@pytest.mark.parametrize("guess", ["", "start = 1, "], ids=["anchor", "start"])
def test_unknowns_pass_their_limits(name: str, guess: str, tmp_path: Path) -> None:
    text, of = LIMITS[name]
    model = 'name = "M"\n[states]\nx = { start = 1, derivative = "-0.9 * x - 1" }\n[algebraic]\n'
    unit, _ = made(tmp_path, model + f'z = {{ {guess}equation = "{text} - x" }}\n')
    for method in METHODS:
        if name == "edge" and method in ("cvode_bdf", "taylor"):
            continue  # between two vertical tangents one takes seconds, the other may not pass
        rows = run(unit, method, 1e-8, 3, 0.1, ["z", "event_count"])
        x = (1 + 1 / 0.9) * np.exp(-0.9 * rows["time"]) - 1 / 0.9
        expected = [brentq(lambda z, at=at: of(z) - at, -2, 2, xtol=1e-15) for at in x]
        np.testing.assert_allclose(rows["z"], expected, atol=1e-8, err_msg=method)
        if name == "clings":
            assert list(rows["event_count"][[0, -1]]) == [0, 1], method


# Three tanks at a junction with the pressure p; each pipe may flow either way
TANKS = """
name = "Tanks"
[states]
h1 = { start = 2, derivative = "sin(time) - q1" }
h2 = { start = 0.1, derivative = "q2 - 0.3 * flow(p - 0.5)" }
h3 = { start = 1, derivative = "q3 + 0.3 * cos(2 * time) - 0.1 * h3" }
[functions]
flow = { arguments = ["x"], value = "x / sqrt(abs(x) + 1e-3)" }
[where]
q1 = "0.5 * flow(h1 - p)"
q2 = "0.5 * flow(p - h2)"
q3 = "flow(p - h3)"
[algebraic]
p = { equation = "q1 - q2 - q3" }
"""


def test_flows_that_turn_at_a_junction(tmp_path: Path) -> None:
    """The guess for p is 0, from where all pipes would flow to the junction."""

    def flow(x: float) -> float:
        return x / np.sqrt(abs(x) + 1e-3)

    def rates(t: float, h: np.ndarray) -> list[float]:
        def missing(p: float) -> float:
            return 0.5 * flow(h[0] - p) - 0.5 * flow(p - h[1]) - flow(p - h[2])

        p = brentq(missing, min(h), max(h), xtol=1e-15)
        return [
            np.sin(t) - 0.5 * flow(h[0] - p),
            0.5 * flow(p - h[1]) - 0.3 * flow(p - 0.5),
            flow(p - h[2]) + 0.3 * np.cos(2 * t) - 0.1 * h[2],
        ]

    expected = solve_ivp(rates, (0, 20), [2, 0.1, 1], "LSODA", rtol=1e-11, atol=1e-12).y[:, -1]
    names, events = ["h1", "h2", "h3"], set()
    unit, _ = made(tmp_path, TANKS)
    for method in METHODS:
        for step in (0.05, 2.0):
            end = run(unit, method, 1e-9, 20, step, [*names, "event_count"])[-1]
            np.testing.assert_allclose([end[n] for n in names], expected, atol=1e-7)
            events.add(end["event_count"])
    assert len(events) == 1 and events.pop() >= 5


UNTAKEN = """
name = "Untaken"
[states]
x = { derivative = "1" }
y = { derivative = "z if x > 2 else 0.5" }
[algebraic]
z = { start = 1, equation = "z**2 - (x - 1.5)" }
"""
BOUNDED = """
name = "Bounded"
[parameters]
u = { start = 1 }
[algebraic]
z = { min = 0, max = 10, equation = "z + w - u" }
w = { start = 1, equation = "w**2 + z - 3" }
"""
ENDS = PROBLEMS["van_der_pol"]["text"].replace(", min = 1", "")


@pytest.mark.parametrize("method", METHODS)
def test_a_block_in_a_branch_that_is_not_taken_needs_no_solution(
    method: str, tmp_path: Path
) -> None:
    """It has none before x = 1.5."""
    unit, _ = made(tmp_path, UNTAKEN)
    end = run(unit, method, 1e-10, 4, 0.1, ["y"])[-1]
    assert abs(end["y"] - (1 + (2.5**1.5 - 0.5**1.5) * 2 / 3)) < 1e-8


def test_unknowns_stay_within_their_bounds(tmp_path: Path) -> None:
    """Without them w = 2, z = -1 is the nearer solution."""
    unit, _ = made(tmp_path, BOUNDED)
    end = fmpy.simulate_fmu(str(unit), output=["z", "w"])[-1]
    assert abs(end["z"] - 2) < 1e-15 and abs(end["w"] + 1) < 1e-15


@pytest.mark.parametrize("method", METHODS)
def test_where_a_solution_ends_one_message_says_so(
    method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At the fold of van der Pol's equation, t = 3/2 - log 2."""
    unit, _ = made(tmp_path, ENDS)
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(
            str(unit), stop_time=2, output_interval=2, relative_tolerance=1e-8,
            start_values={"solver_method": METHODS[method]},
        )  # fmt: skip
    (said,) = [text for text in capsys.readouterr().out.splitlines() if "no solution" in text]
    found = re.search(r"ended at ([\d.]+): y: no solution at t = [\d.]+, .* 0 = z - y", said)
    assert found and abs(float(found[1]) - (1.5 - np.log(2))) < 1e-6


def test_modes_that_contradict_each_other_end_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = 'name = "M"\n[states]\nx = { start = 4, derivative = "-1" }\n[where]\n'
    text += 'a = "1 if b > 0 else -1"\nb = "x - 2 * a"\n'
    unit, _ = made(tmp_path, text)
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(str(unit), stop_time=4)
    said = capsys.readouterr().out
    found = re.search(r"at t = ([\d.]+): b > 0 of \[where\] a contradicts itself", said)
    assert found and abs(float(found[1]) - 2) < 1e-9
