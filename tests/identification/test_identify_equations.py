"""Files with equations, whose logs come from closed forms: modes, samplers, and what logs lack."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import rparm
from rparm.identification.identify import Identification
from tests.equations.examples import made
from tests.support.paths import ROOT
from tests.support.rparm_project import call

THERMOSTAT = ROOT / "examples/models/thermostat.toml"
LOSS, CAPACITY, POWER = 100.0, 4e5, 2000.0  # W/K, J/K, W
OSCILLATOR = """name = "Oscillator"
[parameters]
m = { start = 2.0, min = 1e-3 }
c = { start = 0.8, min = 0 }
k = { start = 30.0, min = 0 }
[inputs]
f = {}
[states]
x = { derivative = "v" }
v = { derivative = "(f - c * v - k * x) / m" }
"""
TRUE = {"m": 2.0, "c": 0.8, "k": 30.0}
SAMPLED = """name = "Sampled"
[parameters]
tau = { start = 3.0, min = 0.01 }
gain = { start = 2.0, min = 0 }
[inputs]
r = {}
[states]
y = { derivative = "(u - y) / tau" }
[discrete]
u = {}
sum = {}
[sampled.law]
every = "0.3"
set = { u = "gain * (r - y) + sum", sum = "sum + 0.2 * (r - y)" }
"""
NOISE = 2e-3, 1e-2


def room(times: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Return exact temperatures (rows,) in K: exponentials between switches at 292 and 294 K."""
    found, is_cooling = [293.0], False
    for begin, stop, ambient in zip(times[:-1], times[1:], outside[:-1], strict=True):
        time, value = begin, found[-1]
        while True:
            end = ambient + (0.0 if is_cooling else POWER / LOSS)
            limit = 292.0 if is_cooling else 294.0
            last = end + (value - end) * np.exp(-(stop - time) * LOSS / CAPACITY)
            if not (last < limit if is_cooling else last > limit):
                break
            time -= CAPACITY / LOSS * np.log((limit - end) / (value - end))
            value, is_cooling = limit, not is_cooling
        found.append(last)
    return np.array(found)


def oscillation(times: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return x and v (rows, 2) with held forces (rows,), by matrix exponentials."""
    m, c, k = TRUE.values()
    matrix = np.array([[0, 1, 0], [-k / m, -c / m, 1 / m], [0, 0, 0]])
    steps = {}
    found = [np.array([0.1, 0.0])]
    for h, value in zip(np.diff(times), force[:-1], strict=True):
        key = round(h, 9)
        steps.setdefault(key, expm(matrix * key))
        found.append((steps[key] @ [*found[-1], value])[:2])
    return np.array(found)


def random_log(
    path: Path, seed: int, *, dropped: float = 0.0, lost: float = 0.0, empty: float = 0.0
) -> Path:
    """Write a log of the oscillator; shares of rows never there, or lost, and of empty cells."""
    random = np.random.default_rng(seed)
    times = 0.01 * np.arange(501)
    times = times[(random.random(501) >= dropped) | np.isin(np.arange(501), (0, 500))]
    force = 20 * np.sin(4.4 * times + random.uniform(0, 6)) + 10 * np.sin(12 * times)
    if dropped:  # the force is held, and jumps from row to row
        force = 20 * random.normal(size=len(times))
    seen = oscillation(times, force) + random.normal(size=(len(times), 2)) * NOISE
    seen[random.random(seen.shape) < empty] = np.nan
    table = np.column_stack([times, force, seen])
    kept = (random.random(len(times)) >= lost) | (times == 0)
    rows = [";".join("" if np.isnan(x) else f"{x:.17g}" for x in row) for row in table[kept]]
    path.write_text("sep=;\ntime;f;x;v\n" + "\n".join(rows).replace(".", ",") + "\n;;;\n")
    return path


def oscillator(fmu: Path, log: Path, seed: int) -> Identification:
    """Identify from 20 % off."""
    signs = np.random.default_rng(99 + seed).choice([-1, 1], 3)
    start = {
        name: true * (1 + 0.2 * s) for (name, true), s in zip(TRUE.items(), signs, strict=True)
    }
    return rparm.identify(
        fmu, log, parameters=[*TRUE], inputs=["f"], measured=["x", "v"], start=start
    )


def holds(found: Identification, name: str, true: float) -> bool:
    estimate = found.estimates[name]
    return estimate.low < true < estimate.high


# ---- what an FMU remembers beside its states -----------------------------------------------------


def test_modes_are_carried_through_a_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without them the loss was 106 [100.2, 112.3] W/K, chi2 5100. In degC, as thermometers say."""
    random = np.random.default_rng(1)
    times = 10.0 * np.arange(721)
    outside = 278 + 5 * np.sin(times / 800)
    seen = room(times, outside) + 0.02 * random.normal(size=len(times))
    rows = zip(times, outside - 273.15, seen - 273.15, strict=True)
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["time,outside,room", *(f"{t},{o},{x}" for t, o, x in rows)]))
    given = "--parameters", "loss,capacity", "--start", "loss=120", "capacity=3.2e5"
    given += "--inputs", "outside", "--measured", "room", "--segment", "10min"
    given += "--units", "outside=degC", "room=degC", "--validate"
    second = tmp_path / "second.csv"
    second.write_text(log.read_text())
    code, out, _ = call(
        capsys, "identify", THERMOSTAT, log, *given, second, "--json", "--output", tmp_path
    )
    found = json.loads(out)
    assert code == 0 and 0.9 < found["chi2"] < 1.1 and found["warnings"] == []
    assert found["one_run"] and 0.9 < found["validation"]["chi2"] < 1.1
    for name, true in (("loss", LOSS), ("capacity", CAPACITY)):
        estimate = found["parameters"][name]
        assert estimate["low"] < true < estimate["high"] < estimate["low"] * 1.01
    code, out, _ = call(
        capsys, tmp_path / "scenario.toml", "--json", "--output", tmp_path / "report"
    )
    (scenario,) = json.loads(out)["scenarios"]
    assert code == 0 and 0.018 < scenario["runs"][0]["measured"]["room"]["rms"] < 0.022


def test_samplers_are_carried_through_a_log(tmp_path: Path) -> None:
    """A law with an integral every 0.3 s; 1 s of a segment is no multiple of it."""
    random, h = np.random.default_rng(2), 0.05
    times = h * np.arange(801)
    target = np.repeat(random.normal(size=9), 100)[1:802]  # moves between ticks
    y, u, total, seen = 0.0, 0.0, 0.0, []
    for row, r in enumerate(target):
        seen.append(y)
        if row % 6 == 0:
            u, total = 2.0 * (r - y) + total, total + 0.2 * (r - y)
        y = u + (y - u) * np.exp(-h / 3.0)
    rows = zip(times, target, seen + 1e-3 * random.normal(size=801), strict=True)
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["time,r,y", *(f"{t:.17g},{r},{x}" for t, r, x in rows)]))
    found = rparm.identify(
        made(SAMPLED), log, parameters=["tau", "gain"], inputs=["r"], measured=["y"],
        start={"tau": 2.4, "gain": 2.4}, segment=1.0,
    )  # fmt: skip
    assert found.is_one_run and 0.85 < found.chi2 < 1.15
    assert holds(found, "tau", 3.0) and holds(found, "gain", 2.0)
    assert found.estimates["tau"].high < 1.03 * found.estimates["tau"].low


# ---- what a log lacks ----------------------------------------------------------------------------


@pytest.mark.parametrize("missing", ["dropped", "lost", "empty"])
def test_intervals_hold_where_logs_have_gaps(missing: str, tmp_path: Path) -> None:
    """18 intervals of 95 % each: fewer than 15 hold by chance once in 100, with these seeds not."""
    fmu, inside, noted = made(OSCILLATOR), 0, 0
    for seed in range(6):
        versions = fmu, fmu.parent / "fmi3" / fmu.name
        log = random_log(tmp_path / "log.csv", seed, **{missing: 0.05})
        found = oscillator(versions[seed % 2], log, seed)
        assert found.has_converged and found.chi2 < 1.3 and not found.is_one_run
        noted += bool(found.notes)
        assert found.covariances.ratio < 2  # held ones, taken as linear: 3
        inside += sum(holds(found, name, true) for name, true in TRUE.items())
    assert inside >= 15
    assert (noted > 0) == (missing == "lost")  # a smooth input is better linear in lost rows


def test_a_channel_may_have_fewer_rows(tmp_path: Path) -> None:
    """Every tenth row has a velocity: all of the position counts."""
    log = random_log(tmp_path / "log.csv", 3)
    head, names, *rows = log.read_text().splitlines()
    slow = [row if i % 10 == 0 else f"{row.rpartition(';')[0]};NaN" for i, row in enumerate(rows)]
    log.write_text("\n".join([head, names, *slow[:-1]]))
    found = oscillator(made(OSCILLATOR), log, 3)
    counted = sum(segment.counts.sum(axis=0) for segment in found.segments)
    assert counted.tolist() == [501, 51] and found.chi2 < 1.3
    assert all(holds(found, name, true) for name, true in TRUE.items())


def test_other_commands_take_equations_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The room loses 80 W/K of 4e5 J/K: its pole is at -2e-4 1/s."""
    code, out, _ = call(capsys, "linearize", THERMOSTAT, "--json", "--output", tmp_path)
    assert code == 0 and json.loads(out)["A"] == [[pytest.approx(-2e-4, rel=1e-9)]]
    code, _, error = call(capsys, "system", THERMOSTAT, "--output", tmp_path)
    assert code == 2 and "expected a system: ./run.sh new-system" in error
