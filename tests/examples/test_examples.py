"""The examples run as their page says, and what they print is what other ways give."""

import io
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

import rparm
from tests.support.paths import FMI_HEADERS, ROOT
from tests.support.programs import printed, python, run

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
