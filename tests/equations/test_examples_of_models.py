"""The examples with equations: against closed forms, conservation laws and heyoka."""

import re
import tomllib
from functools import partial
from pathlib import Path

import heyoka
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import lambertw

from rparm.fmi.fmu_file import read_model
from rparm.runs import scenario
from tests.equations import examples
from tests.equations.examples import FOLDER, METHODS, build, simulated

example = partial(examples.example, make=build)


@pytest.mark.parametrize(
    "path",
    sorted(set(FOLDER.glob("*.toml")) - set(FOLDER.glob("*.lock.toml"))),
    ids=lambda p: p.stem,
)
def test_importers_find_no_problem(path: Path) -> None:
    fmu = example(path.stem)
    assert validate_fmu(str(fmu)) == []
    assert validate_fmu(str(fmu.parent / "fmi3" / fmu.name)) == []
    assert len(path.read_text().splitlines()) <= 30
    lock = path.with_suffix(".lock.toml")
    assert lock.read_text() == (fmu.parent / lock.name).read_text()


def by_heyoka(equations: list, start: list[float], times: np.ndarray) -> np.ndarray:
    """States (states, times) of an autonomous system in long double."""
    taylor = heyoka.taylor_adaptive(
        equations, np.array(start, np.longdouble), fp_type=np.longdouble
    )
    return np.array(taylor.propagate_grid(times.astype(np.longdouble))[-1], float).T


def van_der_pol(t: np.ndarray) -> dict[str, np.ndarray]:
    x, v = heyoka.make_vars("x", "v")
    return {"x": by_heyoka([(x, v), (v, 5.0 * (1.0 - x * x) * v - x)], [2.0, 0.0], t)[0]}


def lorenz(t: np.ndarray) -> dict[str, np.ndarray]:
    x, y, z = heyoka.make_vars("x", "y", "z")
    equations = [(x, 10.0 * (y - x)), (y, x * (28.0 - z) - y), (z, x * y - 2.6666666666666665 * z)]
    return dict(zip("xyz", by_heyoka(equations, [1.0, 1.0, 1.0], t), strict=True))


def dc_motor(t: np.ndarray) -> dict[str, np.ndarray]:
    R, L, k, J, d, ratio = 1.2, 2e-3, 0.05, 2e-5 + 0.02 / 400, 1e-5, 20.0
    A = np.array([[-R / L, -k / L], [k / J, -d / J]])
    rest = np.linalg.solve(A, [-12.0 / L, 0.5 / ratio / J])
    moved = np.array([rest - expm(A * time) @ rest for time in t])
    return {"i": moved[:, 0], "speed": moved[:, 1]}


def twin_drive(t: np.ndarray) -> dict[str, np.ndarray]:
    L, k, J, d, ratio, stiffness, damping = 2e-3, 0.05, 7e-5, 1e-5, 20.0, 4.0, 0.02
    A = np.zeros((5, 5))  # of the currents, the speeds and the twist
    effort = np.array([0, 0, damping / ratio, -damping / ratio, stiffness])
    for m, (R, sign) in enumerate([(1.2, -1), (1.5, 1)]):
        A[m, [m, m + 2]] = -R / L, -k / L
        A[m + 2, [m, m + 2]] = k / J, -d / J
        A[m + 2] += sign * effort / ratio / J
    A[4, 2:4] = 1 / ratio, -1 / ratio
    rest = np.linalg.solve(A, [-12.0 / L, -12.0 / L, 0, 0, 0])
    x = np.array([rest - expm(A * time) @ rest for time in t])
    return {"left.speed": x[:, 2], "right.i": x[:, 1], "twist": x[:, 4], "effort": x @ effort}


def rectifier(t: np.ndarray) -> dict[str, np.ndarray]:
    """The current by Lambert's W: R i + V_T ln(1 + i / I_s) is the voltage at both."""
    R, C, R_load, I_s, V_T, load = 2.0, 470e-6, 100.0, 1e-9, 46e-3, 0.05

    def current(time: float, u: float) -> float:
        at_both = 10.0 * np.sin(100 * np.pi * time) - u
        return V_T / R * lambertw(I_s * R / V_T * np.exp((at_both + I_s * R) / V_T)).real - I_s

    def motion(time: float, u: np.ndarray) -> np.ndarray:
        return (current(time, u[0]) - u / R_load - load) / C

    options = {"rtol": 1e-12, "atol": 1e-13, "max_step": 1e-4, "method": "DOP853"}
    u = solve_ivp(motion, (0, t[-1]), [0.0], t_eval=t, **options).y[0]
    return {"u": u, "i": np.array([current(*each) for each in zip(t, u, strict=True)])}


MU, R0, V0 = 3.986004418e14, 7e6, 9e3
MAJOR = 1 / (2 / R0 - V0**2 / MU)
PERIOD = 2 * np.pi * np.sqrt(MAJOR**3 / MU)


def kepler(t: np.ndarray) -> dict[str, np.ndarray]:
    e, means = 1 - R0 / MAJOR, 2 * np.pi * t / PERIOD
    E = np.array([brentq(lambda E, m=m: E - e * np.sin(E) - m, m - 1, m + 1) for m in means])
    return {"x": MAJOR * (np.cos(E) - e), "y": MAJOR * np.sqrt(1 - e**2) * np.sin(E)}


def masses(t: np.ndarray) -> dict[str, np.ndarray]:
    cosine = np.cos(2 * np.sqrt(40.0 / 0.25) * np.sin(np.pi / 42) * t)
    return {f"x[{i}]": 0.1 * np.sin(np.pi * i / 21) * cosine for i in (1, 7, 20)}


def pwm(t: np.ndarray, duty: float = 0.3) -> dict[str, np.ndarray]:
    """At a duty of 0 both samplers tick at one instant: the second one has the last word."""
    R, L, k, J, d, T = 2.0, 5e-3, 0.05, 2e-5, 1e-5, 1e-3
    off = np.array([[-R / L, -k / L, 0], [k / J, -d / J, -0.02 / J], [0, 0, 0]])
    on, moved = off + [[0, 0, 24.0 / L], [0, 0, 0], [0, 0, 0]], []
    for time in t:
        x = np.array([0, 0, 1.0])
        for begin in np.arange(0, time, T):
            charged = min(time - begin, duty * T)
            x = expm(off * (min(time - begin, T) - charged)) @ expm(on * charged) @ x
        moved.append(x)
    return {"i": np.array(moved)[:, 0], "w": np.array(moved)[:, 1]}


def drive(t: np.ndarray) -> dict[str, np.ndarray]:
    """The plant by scipy from sample to sample, with events where the curve has a knot."""
    J, d, Kp, Ki, Kd, Ts, target = 0.02, 0.02, 8.0, 5.0, 0.6, 0.002, np.pi / 2
    speeds = np.array([0, 1000, 3000, 4000]) * np.pi / 30

    def motion(_: float, x: np.ndarray, u: float) -> list[float]:
        most = np.interp(abs(x[1]), speeds, [2.5, 2.4, 1.0, 0.0])
        return [x[1], (np.clip(u, -most, most) - d * x[1] - 0.1) / J]

    x, total, exact = np.zeros(2), 0.0, []
    for _ in t:
        seen = np.floor(x[0] * 4000 / (2 * np.pi)) * 2 * np.pi / 4000
        u, total = Kp * (target - seen) + total - Kd * x[1], total + Ki * Ts * (target - seen)
        exact.append(x)
        options = {"args": (u,), "rtol": 1e-11, "atol": 1e-12, "max_step": Ts / 20}
        x = solve_ivp(motion, (0, Ts), x, method="DOP853", **options).y[:, -1]
    return dict(zip(("phi", "omega"), np.array(exact).T, strict=True))


# reference, stop and step in s, tolerance, start values, relative and absolute error
CASES = {
    "dahlquist": (
        lambda t: {"x": 3 * np.exp(-2.5 * t)}, 4.0, 0.5, 1e-10, {"k": 2.5, "x": 3.0}, 1e-8, 1e-11,
    ),
    "van_der_pol": (van_der_pol, 20.0, 0.5, 1e-10, {"mu": 5.0}, 0, 1e-6),
    "lorenz": (lorenz, 10.0, 0.1, 1e-13, {}, 0, 1e-9),
    "dc_motor": (dc_motor, 0.5, 0.05, 1e-10, {"torque": 0.5}, 1e-7, 1e-8),
    "twin_drive": (twin_drive, 0.5, 0.05, 1e-10, {}, 1e-7, 1e-8),
    "rectifier": (rectifier, 0.06, 0.001, 1e-10, {"load": 0.05}, 0, 1e-8),
    "two_body_orbit": (kepler, 2 * PERIOD, PERIOD / 8, 1e-11, {}, 0, 0.1),
    "masses": (masses, 20.0, 0.5, 1e-11, {}, 0, 1e-8),
    "pwm": (pwm, 0.02, 3.7e-4, 1e-11, {"load": 0.02}, 0, 1e-8),
    "pwm off": (partial(pwm, duty=0), 0.02, 3.7e-4, 1e-11, {"load": 0.02, "duty": 0.0}, 0, 1e-8),
    "drive": (drive, 149 * 0.002, 0.002, 1e-11, {"load": 0.1}, 0, 2e-6),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", CASES)
def test_an_example_follows_its_reference(name: str, method: str) -> None:
    reference, stop, step, tolerance, start, relative, absolute = CASES[name]
    if name == "lorenz" and method != "taylor":
        return  # chaos takes the best one
    values = start | {"solver_method": METHODS[method]}
    fmu = example(name.partition(" ")[0])
    run = simulated(fmu, stop, step, values, relative_tolerance=tolerance)
    for column, exact in reference(run["time"]).items():
        np.testing.assert_allclose(run[column], exact, rtol=relative, atol=absolute)
    if name == "masses":
        np.testing.assert_allclose(run["energy"], run["energy"][0], rtol=1e-7)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_the_cart_and_its_pole_take_the_work_of_the_force(method: int) -> None:
    force = 0.7
    start = {"force": force, "phi": 2.0, "omega": 0.3, "solver_method": method}
    run = simulated(example("cart_and_pole"), 10.0, 0.1, start, relative_tolerance=1e-11)
    kept = run["energy"] - force * run["x"]
    np.testing.assert_allclose(kept, kept[0], rtol=0, atol=1e-8)
    assert np.ptp(run["energy"]) > 1


N, J1, J2, PLAY, M, T = 20.0, 2e-5, 0.02, np.radians(3), 0.2, 0.02  # of the gearbox


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_gearbox_turns_back_through_its_backlash(method: int) -> None:
    """Plastic impacts keep the angular momentum: closed forms from one to the next."""
    both, alone, back = N**2 * J1 + J2, T / (N * J1), 0.4  # s, when the torque turns
    meet = np.sqrt(PLAY / alone)
    begin = N**2 * J1 * alone * meet / both  # rad/s, after the impact
    most = begin + (N * T - M) / both * (back - meet)
    load = (begin + most) / 2 * (back - meet)
    apart = np.sqrt(2 * PLAY / (alone - M / J2))
    speeds = np.array([most - alone * apart, most - M / J2 * apart])
    end = speeds @ [N**2 * J1, J2] / both
    slid, stop = load + (most + speeds[1]) / 2 * apart, end * both / (N * T + M)
    assert speeds[1] > 0 and end > 0  # the other flank is hit while the load still moves
    phases = [  # begin, angle of the load, its speed, its acceleration
        (0.0, 0.0, 0.0, 0.0),
        (meet, 0.0, begin, (N * T - M) / both),
        (back, load, most, -M / J2),
        (back + apart, slid, end, (-N * T - M) / both),
        (back + apart + stop, slid + end * stop / 2, 0.0, (-N * T + M) / both),
    ]
    torque = np.array([(0, T), (back, T), (back, -T), (1, -T)], [("time", "f8"), ("torque", "f8")])
    values = {"e": 0.0, "solver_method": method}
    options = {"relative_tolerance": 1e-11, "input": torque, "also": ["event_count"]}
    run = simulated(example("gearbox"), 0.8, 0.01, values, **options)
    for t, angle, speed, sticks in zip(
        run["time"], run["load"], run["load_speed"], run["friction.bearing.mode"] == 2, strict=True
    ):
        since, phi, omega, acceleration = [phase for phase in phases if phase[0] <= t][-1]
        s = t - since
        assert angle == pytest.approx(phi + omega * s + acceleration * s**2 / 2, abs=1e-9)
        assert speed == pytest.approx(omega + acceleration * s, abs=1e-8)
        assert sticks == (since == 0.0)
    assert run["event_count"][-1] == 3  # two impacts, and where the load turns back
    play = run["drive"] - run["load"]
    for first, last, side in ((meet, back - 1e-9, 1), (back + apart, 0.8, -1)):
        touches = (run["time"] > first) & (run["time"] < last)
        np.testing.assert_allclose(play[touches], side * PLAY / 2, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_gearbox_keeps_books_of_its_energy(method: int) -> None:
    """Work of the torque: kinetic energy, heat of the bearing and of impacts."""
    values = {"torque": T, "solver_method": method}
    run = simulated(example("gearbox"), 1.0, 0.01, values, relative_tolerance=1e-11)
    assert np.all(np.diff(run["load"]) >= 0) and run["stops.teeth.loss"][-1] > 1e-3
    kinetic = (J1 * run["motor_speed"] ** 2 + J2 * run["load_speed"] ** 2) / 2
    spent = kinetic + M * run["load"] + run["stops.teeth.loss"]
    np.testing.assert_allclose(spent, T * run["motor"], rtol=0, atol=1e-9)


def test_a_thousand_turns_keep_energy_and_momentum() -> None:
    start = {"solver_method": METHODS["taylor"], "max_internal_steps": 10**6}
    run = simulated(
        example("two_body_orbit"), 1000 * PERIOD, PERIOD, start, relative_tolerance=1e-15
    )
    for name in ("energy", "momentum"):
        assert np.max(np.abs(run[name] / run[name][0] - 1)) < 1e-12


def test_a_new_scenario_can_set_elements() -> None:
    text = scenario.template("a", "fmu", "Masses.fmu", read_model(example("masses")))
    given = tomllib.loads(re.sub(r"^# (?=\S+ = [0-9.e-]+(  #|$))", "", text, flags=re.MULTILINE))
    assert given["parameters"]["d[20]"] == 0.0 and given["parameters"]["m"] == 0.25
