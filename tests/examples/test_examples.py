"""The examples run as their page says, and what they print is what other ways give."""

import io
import os
import re
import shlex
import shutil
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import numpy as np
import pandas
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import rparm
from tests.support.installed import wheel_of_release
from tests.support.paths import FMI_HEADERS, ROOT
from tests.support.programs import ENVIRONMENT, printed, python, run

EXAMPLES = ROOT / "examples"
# warnings of the project's own build, without those for code of GNU
STRICT = ("-std=c11", "-D_GNU_SOURCE", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
PNG = b"\x89PNG"


@pytest.fixture(scope="module", params=[2, 3])
def importer(request: pytest.FixtureRequest, fmu: Path, tmp_path_factory) -> tuple[Path, Path]:
    """The compiled importer of a version of FMI, and the folder of its FMU."""
    version, folder = request.param, tmp_path_factory.mktemp("importer")
    program = folder / "importer"
    source = EXAMPLES / f"fmi{version}_importer.c"
    command = ("cc", *STRICT, *SANITIZED, "-I", FMI_HEADERS, source, "-o", program, "-ldl", "-lm")
    run(*command, check=True)
    archive = fmu if version == 2 else fmu.parent / "fmi3" / fmu.name
    with zipfile.ZipFile(archive) as opened:
        opened.extractall(folder / "arm")
    return program, folder / "arm"


def test_an_importer_of_c_gives_what_python_gives(importer: tuple[Path, Path], fmu: Path) -> None:
    """No leak either: the sanitizer would end it."""
    ran = run(*importer)
    assert (ran.returncode, ran.stderr) == (0, "")
    printed = np.genfromtxt(io.StringIO(ran.stdout), delimiter=",", names=True)
    table = rparm.simulate(
        fmu,
        stop_time=1.0,
        step=0.01,
        start_values={"m2": 1.2},
        inputs={"tau1": lambda time: 15.0 * np.cos(time), "f2": -2.0},
    )
    for name in ("time", "q1", "q2"):
        assert printed[name] == pytest.approx(table[name], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [([], "usage: "), (["/nowhere"], "cannot open shared object file"), (["a", "b"], "usage: ")],
)
def test_an_importer_says_what_is_wrong(
    importer: tuple[Path, Path], arguments: list[str], words: str
) -> None:
    ran = run(importer[0], *arguments)
    assert ran.returncode == 1 and words in ran.stderr


def test_the_slide_sticks_and_slips_in_fmpy(fmu: Path, tmp_path: Path) -> None:
    picture = tmp_path / "slide.png"
    ran = python(EXAMPLES / "with_fmpy.py", fmu.with_name("RPPlant.fmu"), picture)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[-1].startswith("q1 = ")
    assert picture.read_bytes().startswith(PNG)


def test_friction_takes_energy_and_nothing_else_does(tmp_path: Path) -> None:
    picture = tmp_path / "swings.png"
    ran = python(EXAMPLES / "with_rparm.py", picture)
    assert ran.returncode == 0, ran.stderr
    lost = {}
    for line in ran.stdout.splitlines():
        friction, _, rest = line.partition(" N.m: loses ")
        lost[float(friction)] = float(rest.removesuffix(" J"))
    assert sorted(lost) == [0.0, 0.5, 1.0]
    assert lost[0.0] == 0.0 and min(lost[0.5], lost[1.0]) > 1.0
    assert picture.read_bytes().startswith(PNG)


# ---- HELICS --------------------------------------------------------------------------------------


FAILING = """
import sys
from examples import helics_federate

def fail(*arguments):
    raise ValueError("this one fails")

if sys.argv[1] == "arm":
    helics_federate.Arm.step = fail
else:
    helics_federate.control = fail
helics_federate.in_federation()
"""


def test_the_federate_has_the_bits_of_a_plain_loop(tmp_path: Path) -> None:
    end, difference = printed("helics_federate.py", tmp_path)
    reached = [float(number) for number in re.findall(r"= (\S+)", end)]
    assert reached == pytest.approx([0.5, 0.1], abs=1e-3)  # the controller's goal
    assert difference == "largest difference from a plain loop: 0"


@pytest.mark.parametrize("who", ["arm", "controller"])
def test_no_federate_waits_for_one_that_failed(who: str, tmp_path: Path) -> None:
    ran = python("-c", FAILING, who, folder=tmp_path)
    assert ran.returncode == 1
    assert ran.stderr.splitlines()[-1] == "ValueError: this one fails"


# ---- the tutorial

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
