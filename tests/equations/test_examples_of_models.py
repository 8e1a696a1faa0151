"""The examples with equations: against closed forms, conservation laws and heyoka."""

import re
import tomllib
from pathlib import Path

import fmpy
import heyoka
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from rparm.fmi.fmu_file import read_model
from rparm.runs import scenario
from tests.equations.examples import FOLDER, METHODS, example, simulated

EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("examples")


@pytest.mark.parametrize(
    "path",
    sorted(set(FOLDER.glob("*.toml")) - set(FOLDER.glob("*.lock.toml"))),
    ids=lambda p: p.stem,
)
def test_importers_find_no_problem(path: Path, folder: Path) -> None:
    fmu = example(path.stem, folder)
    assert validate_fmu(str(fmu)) == []
    assert validate_fmu(str(fmu.parent / "fmi3" / fmu.name)) == []
    assert len(path.read_text().splitlines()) <= 30
    assert (
        path.with_suffix(".lock.toml").read_text()
        == (fmu.parent / f"{path.stem}.lock.toml").read_text()
    )


@EACH_METHOD
def test_dahlquist_decays(folder: Path, method: int) -> None:
    start = {"k": 2.5, "x": 3.0, "solver_method": method}
    run = simulated(example("dahlquist", folder), 4.0, 0.5, start, relative_tolerance=1e-10)
    np.testing.assert_allclose(run["x"], 3.0 * np.exp(-2.5 * run["time"]), rtol=1e-8, atol=1e-11)


def by_heyoka(equations: list, start: list[float], times: np.ndarray) -> np.ndarray:
    """States (times, states) of an autonomous system in long double."""
    taylor = heyoka.taylor_adaptive(
        equations, np.array(start, np.longdouble), fp_type=np.longdouble
    )
    return np.array(taylor.propagate_grid(times.astype(np.longdouble))[-1], float)


@EACH_METHOD
def test_van_der_pol_is_that_of_heyoka(folder: Path, method: int) -> None:
    x, v = heyoka.make_vars("x", "v")
    exact = by_heyoka(
        [(x, v), (v, 5.0 * (1.0 - x * x) * v - x)], [2.0, 0.0], np.arange(0, 20.5, 0.5)
    )
    start = {"mu": 5.0, "solver_method": method}
    run = simulated(example("van_der_pol", folder), 20.0, 0.5, start, relative_tolerance=1e-10)
    np.testing.assert_allclose(run["x"], exact[:, 0], rtol=0, atol=1e-6)


def test_lorenz_is_that_of_heyoka(folder: Path) -> None:
    x, y, z = heyoka.make_vars("x", "y", "z")
    equations = [(x, 10.0 * (y - x)), (y, x * (28.0 - z) - y), (z, x * y - 2.6666666666666665 * z)]
    exact = by_heyoka(equations, [1.0, 1.0, 1.0], np.arange(0, 10.1, 0.1))
    start = {"solver_method": METHODS["taylor"]}
    run = simulated(example("lorenz", folder), 10.0, 0.1, start, relative_tolerance=1e-13)
    for name, column in zip("xyz", exact.T, strict=True):
        np.testing.assert_allclose(run[name], column, rtol=0, atol=1e-9)


@EACH_METHOD
def test_the_cart_and_its_pole_take_the_work_of_the_force(folder: Path, method: int) -> None:
    force = 0.7
    start = {"force": force, "phi": 2.0, "omega": 0.3, "solver_method": method}
    run = simulated(example("cart_and_pole", folder), 10.0, 0.1, start, relative_tolerance=1e-11)
    kept = run["energy"] - force * run["x"]
    np.testing.assert_allclose(kept, kept[0], rtol=0, atol=1e-8)
    assert np.ptp(run["energy"]) > 1


@EACH_METHOD
def test_the_motor_follows_its_matrix_exponential(folder: Path, method: int) -> None:
    R, L, k, J, d, ratio = 1.2, 2e-3, 0.05, 2e-5 + 0.02 / 400, 1e-5, 20.0
    A = np.array([[-R / L, -k / L, 0], [k / J, -d / J, 0], [0, 1 / ratio, 0]])
    rest = np.linalg.solve(A[:2, :2], [-12.0 / L, 0.5 / ratio / J])
    start = {"torque": 0.5, "solver_method": method}
    run = simulated(example("dc_motor", folder), 0.5, 0.05, start, relative_tolerance=1e-10)
    for row in run:
        i, speed = rest + expm(A[:2, :2] * row["time"]) @ -rest
        assert row["i"] == pytest.approx(i, rel=1e-7, abs=1e-8)
        assert row["speed"] == pytest.approx(speed, rel=1e-7, abs=1e-8)


MU, R0, V0 = 3.986004418e14, 7e6, 9e3
MAJOR = 1 / (2 / R0 - V0**2 / MU)
PERIOD = 2 * np.pi * np.sqrt(MAJOR**3 / MU)


@EACH_METHOD
def test_the_orbit_is_kepler_s(folder: Path, method: int) -> None:
    start = {"solver_method": method}
    run = simulated(
        example("two_body_orbit", folder), 2 * PERIOD, PERIOD / 8, start, relative_tolerance=1e-11
    )
    eccentricity = 1 - R0 / MAJOR
    for row in run:
        mean = 2 * np.pi * row["time"] / PERIOD
        anomaly = brentq(
            lambda e, m=mean: e - eccentricity * np.sin(e) - m, mean - 1, mean + 1, xtol=1e-14
        )
        assert row["x"] == pytest.approx(MAJOR * (np.cos(anomaly) - eccentricity), abs=0.1)
        minor = MAJOR * np.sqrt(1 - eccentricity**2)
        assert row["y"] == pytest.approx(minor * np.sin(anomaly), abs=0.1)


def test_a_thousand_turns_keep_energy_and_momentum(folder: Path) -> None:
    start = {"solver_method": METHODS["taylor"], "max_internal_steps": 10**6}
    run = simulated(
        example("two_body_orbit", folder), 1000 * PERIOD, PERIOD, start, relative_tolerance=1e-15
    )
    for name in ("energy", "momentum"):
        assert np.max(np.abs(run[name] / run[name][0] - 1)) < 1e-12


@EACH_METHOD
def test_twenty_masses_keep_their_mode(folder: Path, method: int) -> None:
    start = {"solver_method": method}
    run = simulated(example("masses", folder), 20.0, 0.5, start, relative_tolerance=1e-11)
    frequency = 2 * np.sqrt(40.0 / 0.25) * np.sin(np.pi / 42)
    for i in (1, 7, 20):
        mode = 0.1 * np.sin(np.pi * i / 21) * np.cos(frequency * run["time"])
        np.testing.assert_allclose(run[f"x[{i}]"], mode, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run["energy"], run["energy"][0], rtol=1e-7)


@EACH_METHOD
def test_the_drive_is_that_of_a_loop_over_its_samples(folder: Path, method: int) -> None:
    """The plant by scipy from sample to sample, with events where the curve has a knot."""
    J, d, Kp, Ki, Kd, Ts, target = 0.02, 0.02, 8.0, 5.0, 0.6, 0.002, np.pi / 2
    speeds = np.array([0, 1000, 3000, 4000]) * np.pi / 30

    def motion(_: float, x: np.ndarray, u: float) -> list[float]:
        most = np.interp(abs(x[1]), speeds, [2.5, 2.4, 1.0, 0.0])
        return [x[1], (np.clip(u, -most, most) - d * x[1] - 0.1) / J]

    x, total, exact = np.zeros(2), 0.0, []
    for _ in range(150):
        seen = np.floor(x[0] * 4000 / (2 * np.pi)) * 2 * np.pi / 4000
        u, total = Kp * (target - seen) + total - Kd * x[1], total + Ki * Ts * (target - seen)
        exact.append(x)
        options = {"args": (u,), "rtol": 1e-11, "atol": 1e-12, "max_step": Ts / 20}
        x = solve_ivp(motion, (0, Ts), x, method="DOP853", **options).y[:, -1]
    start = {"load": 0.1, "solver_method": method}
    run = simulated(example("drive", folder), 149 * Ts, Ts, start, relative_tolerance=1e-11)
    found = np.array([run["phi"], run["omega"]]).T
    assert np.max(np.abs(exact)) > 5.0
    np.testing.assert_allclose(found, exact, rtol=0, atol=2e-6)


OF_RP = {
    "controller": ("RPController", ["tau1", "f2", "integral1", "integral2"]),
    "encoder": ("RPSensor", ["q1_measured", "q2_measured", "dq1_measured", "dq2_measured"]),
}
VALUES = {
    "sample_time": (0.001, 0.0031, 0.01),
    "delay": (0.0, 0.0004, 0.001),
    "latency": (0, 1, 64),
    "resolution1": (0.01, 6.283185307179586e-4, 1e-12),
    "mode": (1, 2, 3),
    "tau1_max": (3.0, 100.0, 20.0),
    "Ki2": (900.0, 0.0, 50.0),
    "payload_attached": (True, False, True),
    "payload_mass": (0.7, 0.0, 0.3),
    "payload_inertia": (0.02, 0.0, 0.01),
    "payload_x": (0.05, 0.0, -0.3),
}


@pytest.mark.parametrize("case", range(6))
@pytest.mark.parametrize("name", OF_RP)
def test_files_have_the_bits_and_references_of_c(
    folder: Path, fmu: Path, name: str, case: int
) -> None:
    chance, (rp, outputs) = np.random.default_rng(case), OF_RP[name]
    paths = fmu.with_name(f"{rp}.fmu"), example(f"rp/{name}", folder)
    theirs, own = (read_model(path).variables for path in paths)
    both = theirs.keys() & own.keys()
    assert {n: own[n].reference for n in both} == {n: theirs[n].reference for n in both}
    start = {n: v[chance.integers(3)] for n, v in VALUES.items() if n in both}
    inputs = [n for n in own if own[n].causality == "input" and own[n].type == "Real"]
    signals = np.zeros(40, [(n, "f8") for n in ("time", *inputs)])
    signals["time"] = np.linspace(0.0, 0.3, 40)
    for n in inputs:
        signals[n] = np.cumsum(chance.normal(size=40)) / 4
    first, second = (
        fmpy.simulate_fmu(
            str(path), fmi_type="CoSimulation", stop_time=0.3, output_interval=0.0037,
            start_values=start, input=signals, output=outputs,
        )
        for path in paths
    )  # fmt: skip
    assert np.array_equal(first, second) and np.unique(first[outputs[1]]).size > 20


def test_a_new_scenario_can_set_elements(folder: Path) -> None:
    text = scenario.template("a", "fmu", "Masses.fmu", read_model(example("masses", folder)))
    given = tomllib.loads(re.sub(r"^# (?=\S+ = [0-9.e-]+(  #|$))", "", text, flags=re.MULTILINE))
    assert given["parameters"]["d[20]"] == 0.0 and given["parameters"]["m"] == 0.25
