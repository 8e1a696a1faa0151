"""The tutorial, typed in a checkout and in an environment with the wheel, and its figures."""

import os
import re
import shlex
import shutil
import sys
import sysconfig
import venv
from pathlib import Path

import numpy as np
import pandas
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from tests.support.installed import wheel_of_release
from tests.support.paths import ROOT
from tests.support.programs import ENVIRONMENT, run

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", TUTORIAL, re.MULTILINE | re.DOTALL)
M, D, G, STEP, STOP = 20.0, 5.0, 9.81, 0.01, 8.0
KP, KD, KA = 125.0, 175.0, 500.0


def largest_load(m: float, length: float, ka: float) -> float:
    """Largest position of the load, by scipy: the force of each step holds from the next one on."""

    def motion(_: float, y: np.ndarray, force: float) -> list[float]:
        _, v, phi, omega = y
        s, c = np.sin(phi), np.cos(phi)
        # masses and accelerations of trolley and rope, from the Lagrangian
        mass = [[M + m, m * length * c], [c, length]]
        a, alpha = np.linalg.solve(mass, [force - D * v + m * length * omega**2 * s, -G * s])
        return [v, a, omega, alpha]

    y, force, last, largest = np.zeros(4), 0.0, 0.0, 0.0
    for _ in range(round(STOP / STEP)):
        following = KP * (1.0 - y[0]) - KD * (y[0] - last) / STEP + ka * y[2]
        last = y[0]
        y = solve_ivp(motion, (0, STEP), y, args=(force,), rtol=1e-8, atol=1e-11).y[:, -1]
        force, largest = following, max(largest, y[0] + length * np.sin(y[2]))
    return largest


def grows(gain: float = 1.0, late: int = 0) -> bool:
    """Whether small deviations of the sampled loop at rest grow, of `late` steps more delay."""
    m, length = 12.0, 1.5
    rows = [[0, 1, 0, 0, 0], [0, -D / M, m * G / M, 0, 1 / M], [0, 0, 0, 1, 0]]
    rows += [[0, D / M / length, -(M + m) * G / M / length, 0, -1 / M / length], [0] * 5]
    held = expm(np.array(rows) * STEP)
    loop = np.eye(6 + late, k=-1)  # trolley and rope, position one step ago, forces on their way
    loop[:4] = 0.0
    loop[:4, :4], loop[:4, -1] = held[:4, :4], gain * held[:4, 4]
    loop[4, :4] = 1.0, 0.0, 0.0, 0.0
    loop[5, :5] = -KP - KD / STEP, 0.0, KA, 0.0, KD / STEP
    return bool(abs(np.linalg.eigvals(loop)).max() > 1.0)


@pytest.fixture(scope="module", params=["checkout", "wheel"])
def typed(request: pytest.FixtureRequest, tmp_path_factory) -> tuple[Path, str]:
    """The folder of someone who has typed all, and what was printed."""
    folder, where = (tmp_path_factory.mktemp(name) for name in ("typed", "environment"))
    given = ENVIRONMENT | {"BROWSER": "true", "HOME": str(folder)}
    if request.param == "wheel":
        shutil.copy(wheel_of_release(), folder)
        venv.create(where, symlinks=True, with_pip=True)
        packages = sysconfig.get_path("purelib", vars={"base": str(where)})
        # what the wheel needs comes from the environment of the tests
        Path(packages, "others.pth").write_text(f"{sysconfig.get_path('purelib')}\n")
        given |= {"PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1", "RPARM_CACHE": str(where / "cache")}
        given |= {"PATH": str(where / "bin"), "PYTHONPATH": ""}
    else:
        given |= {"PATH": f"{where}{os.pathsep}{os.environ['PATH']}"}
        own = {"pip": "true", "python": sys.executable, "rparm": f"{sys.executable} -P -m rparm"}
        for name, command in own.items():
            (where / name).write_text(f'#!/bin/sh\nexec {command} "$@"\n')
            (where / name).chmod(0o755)
    printed = ""
    for kind, block in BLOCKS:
        if kind != "sh":
            (folder / block.split()[1]).write_text(block)
            continue
        ran = run(*shlex.split(block), cwd=folder, env=given)
        assert ran.returncode == 0, (block, ran.stdout, ran.stderr)
        printed += ran.stdout
    return folder, printed


def test_the_tutorial_does_what_it_says(typed: tuple[Path, str]) -> None:
    folder, printed = typed
    assert sum(block.count("\n") for _, block in BLOCKS) <= 90 and len(TUTORIAL.split()) <= 1200
    # of heavy.py
    heavy = float(printed.splitlines()[-1])
    assert heavy == pytest.approx(largest_load(40.0, 3.0, ka=300.0), abs=1e-6)
    # of the campaign
    runs = pandas.read_parquet(folder / "cranes" / "blocks")
    assert len(runs) == 1000 and set(runs["failure"]) == {""}
    for row in runs.iloc[[0, 999]].to_dict("records"):
        largest = largest_load(row["crane.m"], row["crane.l"], ka=KA)
        assert row["maximum(crane.load)"] == pytest.approx(largest, abs=1e-6)
    overshoot = runs["maximum(crane.load)"][runs["crane.l"] > 2.9] - 1.0
    assert overshoot.min() > 0.08 and overshoot.max() < 0.13
    # of the margins, whose delay is 117 ms
    assert "9.14" in printed and not grows(9.14) and grows(9.15)
    assert "117." in printed and not grows(late=11) and grows(late=12)
    # at 1.5 m it hardly overshoots
    assert largest_load(12.0, 1.5, ka=KA) < 1.01
