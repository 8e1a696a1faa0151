"""Fits by gradients: the same results as by differences, in fewer runs, through impacts too."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rparm
from rparm import gradients
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.model import ARE_EXACT
from rparm.identification import identify as identification
from rparm.identification import simulator
from rparm.identification.fit import Problem
from rparm.identification.identify import Identification
from rparm.identification.request import Request
from tests.identification.test_identify_equations import OSCILLATOR, TRUE, holds, random_log

G, RESTITUTION, NOISE = 9.81, 0.8, 1e-3
BALL = """name = "Ball"
[parameters]
e = { start = 0.6, min = 0, max = 1 }
[states]
h = { start = 1.0, derivative = "v" }
v = { derivative = "-9.81" }
[events.impact]
when = "h < 0"
reinit = { h = "0", v = "-e * v" }
"""
REQUEST = {"parameters": [*TRUE], "inputs": ["f"], "measured": ["x", "v"]}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("oscillator") / "oscillator.toml"
    path.write_text(OSCILLATOR)
    return path


@pytest.fixture(scope="module")
def fmu(file: Path) -> Path:
    """One that has the gradients itself."""
    by = [*TRUE, "start(x)", "start(v)"]
    return rparm.build(file, output=file.parent / "with", gradients=by)[0]


@contextmanager
def counted(patch: pytest.MonkeyPatch) -> Iterator[list[bool]]:
    """Yield a list that gets whether each run has gradients."""
    found, run = [], simulator._Runner.run

    def noted(runner: simulator._Runner, *given: np.ndarray) -> np.ndarray:
        found.append(ARE_EXACT in runner._wiring.fmu.model.variables)
        return run(runner, *given)

    with patch.context() as patched:
        patched.setattr(simulator._Runner, "run", noted)
        yield found


def without(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(gradients, "opened", lambda *_: None)


def fitted(path: Path, log: Path, **more: object) -> Identification:
    start = {name: 1.2 * true for name, true in TRUE.items()}
    return rparm.identify(path, log, **REQUEST, start=start, **more)


@pytest.mark.parametrize("delay", [False, True])
def test_half_of_the_runs_gives_the_same(
    delay: bool, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = random_log(tmp_path / "log.csv", 1)
    with counted(monkeypatch) as runs:
        found = fitted(file, log, delay=delay)
    without(monkeypatch)
    with counted(monkeypatch) as others:
        by_differences = fitted(file, log, delay=delay)
    assert any(runs) and not any(others) and 2 * len(runs) < len(others)
    assert found.notes == [] and found.chi2 == pytest.approx(by_differences.chi2, rel=1e-6)
    for name, estimate in found.estimates.items():
        other = by_differences.estimates[name]
        width = other.high - other.low
        for end in ("value", "low", "high"):
            assert getattr(estimate, end) == pytest.approx(getattr(other, end), abs=1e-3 * width)


def test_an_fmu_with_gradients_is_used_as_it_is(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with counted(monkeypatch) as runs:
        found = fitted(fmu, random_log(tmp_path / "log.csv", 2))
    assert any(runs) and found.states == ["x", "v"]
    assert all(holds(found, name, true) for name, true in TRUE.items())


def test_what_is_not_there_is_noted(file: Path, tmp_path: Path) -> None:
    other = tmp_path / "of_v.toml"
    other.write_text(f'{OSCILLATOR}[gradients]\nby = ["m"]\nof = ["v"]\n')
    found = fitted(other, random_log(tmp_path / "log.csv", 2))
    (note,) = found.notes
    assert note.startswith("Derivatives are difference quotients") and "'x_by_m'" in note
    assert found.has_converged


@pytest.mark.parametrize("near", [None, np.array([0.3, 0.0, 0.1, 0.0])])
def test_derivatives_are_those_of_differences(
    near: np.ndarray | None, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By states, parameters with limits and the delay; central differences leave 1e-5."""
    problems: list[tuple[Problem, np.ndarray]] = []

    @contextmanager
    def kept(*given: object) -> Iterator[tuple[Problem, np.ndarray]]:
        with opened_problem(*given) as made:
            problems.append((replace(made[0], near=near), made[1]))
            z = np.array([0.2, -0.1, 0.1, 0.3])
            tables.append([each.table for each in problems[-1][0].linear(z, made[1])])
            patched.setattr(made[0].simulator, "run_with_gradients", lambda *_: None)
            tables.append([each.table for each in problems[-1][0].linear(z, made[1], True)])
            yield made

    opened_problem, tables = identification._problem, []
    log = random_log(tmp_path / "log.csv", 3)
    with monkeypatch.context() as patched, Fmu(fmu) as opened:
        patched.setattr(identification, "_problem", kept)
        identification.identify(opened, Request(logs=[log], **REQUEST, with_delay=True))
    for by_gradients, by_differences in zip(*tables, strict=True):
        size = np.abs(by_differences).max(axis=0)
        assert (np.abs(by_gradients - by_differences) < 1e-5 * size).all()


def bounced(times: np.ndarray) -> np.ndarray:
    """Heights of a ball that falls from 1 m, in closed form."""
    since, speed = times - np.sqrt(2 / G), RESTITUTION * np.sqrt(2 * G)
    found = np.where(since < 0, 1 - G * times**2 / 2, 0.0)
    for _ in range(8):
        flies = (since >= 0) & (since < 2 * speed / G)
        found = np.where(flies, speed * since - G * since**2 / 2, found)
        since, speed = since - 2 * speed / G, RESTITUTION * speed
    return found


def test_a_restitution_is_found_from_short_segments(tmp_path: Path) -> None:
    """Of 0.4 s, of which each has one impact or none."""
    file, log, times = tmp_path / "ball.toml", tmp_path / "log.csv", 0.005 * np.arange(401)
    file.write_text(BALL)
    noise = NOISE * np.random.default_rng(1).normal(size=len(times))
    rows = np.column_stack([times, bounced(times) + noise])
    np.savetxt(log, rows, delimiter=",", header="time,h", comments="")
    found = rparm.identify(file, log, parameters=["e"], inputs=[], measured=["h"])
    assert found.has_converged and found.chi2 < 1.3 and holds(found, "e", RESTITUTION)
    assert found.estimates["e"].value == pytest.approx(RESTITUTION, rel=2e-3)
