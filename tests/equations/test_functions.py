"""Functions of files with equations: further ones, the file's own, derivatives, compound events."""

from pathlib import Path

import mpmath
import numpy as np
import pytest

from tests.equations.compiled import Model
from tests.equations.examples import METHODS, MODELS, made, simulated

TEXTS = MODELS["functions"]
EACH_METHOD = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("functions")


def test_functions_have_their_values_and_derivatives(tmp_path: Path) -> None:
    model = Model(tmp_path, TEXTS["VALUES"])
    a, b = 0.7, -1.9
    values = model.values(a=a, b=b, hypot=3.0)
    model.outputs(values, 0.0)
    found = dict(zip(model.names, values, strict=False))
    exact = {
        "sign_b": -0.75,
        "length": mpmath.hypot(a, b),
        "decades": mpmath.log10(a),
        "root": mpmath.cbrt(a) - mpmath.cbrt(-b),
        "share": mpmath.mpf(2 * a) ** 3 / (1 + mpmath.mpf(2 * a) ** 3),
        "both": 2 * mpmath.mpf(a) ** 2 / (1 + mpmath.mpf(a) ** 2),
        "own": 8.0,
    }
    for name, value in exact.items():
        assert found[name] == pytest.approx(float(value), rel=4e-16, abs=4e-16), name
    first, second = model.values(a=1.0), model.values()
    model.propagate(values, 0.0, 0.0, first, second)
    slopes = dict(zip(model.names, first, strict=False))
    assert slopes["length"] == pytest.approx(a / np.hypot(a, b), rel=1e-15)
    assert slopes["decades"] == pytest.approx(1 / (a * np.log(10)), rel=1e-15)
    assert slopes["root"] == pytest.approx(a ** (-2 / 3) / 3, rel=1e-14)
    assert slopes["both"] == pytest.approx(4 * a / (1 + a * a) ** 2, rel=1e-14)


@EACH_METHOD
def test_sign_of_a_velocity_switches_where_it_turns(folder: Path, method: int) -> None:
    """Half a swing about k x = F after the other, each shorter by 4 F / k in its range."""
    fmu = made(folder, TEXTS["FRICTION"].replace("start = 2.0", "start = 0.3"))
    run = simulated(fmu, 6.0, 0.01, {"solver_method": method}, relative_tolerance=1e-11)
    w, center, half = np.sqrt(3.0 / 0.5), 0.1, np.pi / np.sqrt(3.0 / 0.5)
    n = np.floor(run["time"] / half)
    amplitude = (1.9 - center - 2 * center * n) * (-1) ** n
    exact = center * (-1) ** n + amplitude * np.cos(w * (run["time"] - n * half))
    assert np.max(np.abs(run["x"] - exact)) < 1e-8
    assert np.max(np.abs(run["power"] - run["force"] * run["v"])) < 1e-12


@EACH_METHOD
def test_an_event_of_several_relations_happens_when_the_whole_comes_true(
    folder: Path, method: int
) -> None:
    """x = sin t: armed above 0.5, left above 0.95; armed again below 0.9, left below -0.5."""
    fmu = made(folder, TEXTS["GATE"])
    run = simulated(fmu, 12.0, 0.01, {"solver_method": method}, also=["armed", "open"])
    assert np.all(run["open"])
    t = run["time"]
    up, top, back = np.arcsin(0.5), np.arcsin(0.95), np.pi - np.arcsin(0.9)
    low = np.pi + np.arcsin(0.5)
    armed = np.zeros(len(t), bool)
    passed = np.zeros(len(t))
    for turn in (0, 2 * np.pi):
        armed |= ((t > up + turn) & (t < top + turn)) | ((t > back + turn) & (t < low + turn))
        passed += 1.0 * (t > top + turn) + (t > low + turn)
    assert np.array_equal(run["armed"] != 0, armed)
    assert np.array_equal(run["passed"], passed)


def room(stop: float, is_enabled: bool) -> np.ndarray:
    """Temperature each second: exponentials from switch to switch; open from 30 s to 40 s."""
    T, t, heating, found = 18.0, 0.0, True, [18.0]
    for second in range(int(stop)):
        while t < second + 1:
            is_open = 30 <= t < 40
            heating = heating and not is_open
            rate = (4 if is_open else 1) / 50
            goal = 5 + (30 if heating and is_enabled else 0)
            limit = 21.0 if heating else 19.0
            there = second + 1.0
            is_ahead = not is_open and (limit - T) * (goal - limit) > 0
            if is_ahead:
                there = min(there, t + np.log((T - goal) / (limit - goal)) / rate)
            if not is_open and not heating and T < 19.0:
                heating = True
                continue
            switches = is_ahead and there < second + 1.0
            T = limit if switches else goal + (T - goal) * np.exp(-rate * (there - t))
            t, heating = there, heating != switches
        found.append(T)
    return np.array(found)


@EACH_METHOD
@pytest.mark.parametrize("is_enabled", [True, False])
def test_a_thermostat_sees_an_open_window(folder: Path, method: int, is_enabled: bool) -> None:
    fmu = made(folder, TEXTS["ROOM"])
    times = [(0.0, 0), (30.0, 0), (30.0, 1), (40.0, 1), (40.0, 0), (100.0, 0)]
    run = simulated(
        fmu, 100.0, 1.0, {"solver_method": method, "enabled": is_enabled},
        input=np.array(times, [("time", "f8"), ("open", "?")]), relative_tolerance=1e-10,
    )  # fmt: skip
    assert np.max(np.abs(run["T"] - room(100.0, is_enabled))) < 1e-8


@EACH_METHOD
@pytest.mark.parametrize("version", ["", "fmi3"])
def test_a_clutch_locks_slips_and_opens(folder: Path, version: str, method: int) -> None:
    """Speeds are straight lines. Closed from 1 s to 8 s; too strong a drive from 3 s to 5 s."""
    fmu = made(folder, TEXTS["CLUTCH"])
    given = [(0, 0, 4), (1, 0, 4), (1, 1, 4), (3, 1, 4), (3, 1, 20), (5, 1, 20), (5, 1, 4)]
    given += [(8, 1, 4), (8, 0, 4), (9, 0, 4)]
    run = simulated(
        fmu.parent / version / fmu.name, 9.0, 0.25, {"solver_method": method}, also=["locked"],
        input=np.array(given, [("time", "f8"), ("closed", "?"), ("drive", "f8")]),
        relative_tolerance=1e-10,
    )  # fmt: skip
    met, again = 1 + 28 / (12 + 20 / 3), 5 + (80 / 3) / (12 + 20 / 3)
    locked = 51 - 12 * (again - 5)
    end = locked + 2 * (8 - again)
    times = [0, 1, met, 3, 5, again, 8, 9]
    w1 = np.interp(run["time"], times, [20, 28, 10, 11, 51, locked, end, end + 8])
    w2 = np.interp(run["time"], times, [0, 0, 10, 11, 11 + 40 / 3, locked, end, end])
    np.testing.assert_allclose([run["w1"], run["w2"]], [w1, w2], rtol=0, atol=1e-7)
    t = run["time"]
    is_locked = ((t > met + 1e-9) & (t < 3)) | ((t > again) & (t < 8))
    is_inside = np.min(np.abs(t[:, None] - times), axis=1) > 1e-6
    assert np.array_equal((run["locked"] != 0)[is_inside], is_locked[is_inside])
