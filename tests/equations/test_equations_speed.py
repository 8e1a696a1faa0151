"""Instructions of the arm from a file with equations, by those of the one that is by hand."""

import re
import shutil
import subprocess
from pathlib import Path
from shutil import copy

import fmpy
import pytest

from tests.equations.examples import METHODS, build
from tests.support.missing import missing
from tests.support.paths import FMI_HEADERS, ROOT

MOST = {"cvode_bdf": 1.03, "erk": 1.03, "taylor": 1.10}
HARNESS = ROOT / "tests" / "fmi_harness"
SOURCE = Path(__file__).with_name("steps.c")
NAMES = ["solver_method", "q1", "q2", "dq1", "dq2", "tau1", "f2"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Has the FMU and the program that steps it."""
    if shutil.which("valgrind") is None:
        missing("valgrind: ./setup.sh --platforms")
    folder = tmp_path_factory.mktemp("speed")
    folders = FMI_HEADERS, HARNESS, ROOT / "fmu/fmi2", ROOT / "fmu/fmi3"
    command = ["cc", *(f"-I{path}" for path in folders), SOURCE, HARNESS / "fmu_library.c"]
    command += ["-o", folder / "steps", "-ldl", "-lm"]
    subprocess.run(command, check=True)
    build(copy(ROOT / "tests" / "equations" / "arm.toml", folder), folder)
    return folder


def instructions(fmu: Path, folder: Path, method: str) -> int:
    """In all steps of a run."""
    description = fmpy.read_model_description(fmu)
    references = {v.name: v.valueReference for v in description.modelVariables}
    place = folder / f"{fmu.stem}_{method}"
    fmpy.extract(str(fmu), str(place))
    (library,) = place.glob("binaries/*/*.so")
    counted = ["valgrind", "--tool=callgrind", "--toggle-collect=fmi2DoStep"]
    counted.append(f"--callgrind-out-file={place / 'out'}")
    program = [folder / "steps", library, description.guid, METHODS[method]]
    command = [*counted, *program, *(references[name] for name in NAMES)]
    ended = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    return int(re.search(r"Collected : (\d+)", ended.stderr)[1])


@pytest.mark.parametrize("method", MOST)
def test_it_is_as_fast_as_by_hand(fmu: Path, folder: Path, method: str) -> None:
    own, by_hand = (instructions(path, folder, method) for path in (folder / "Arm.fmu", fmu))
    print(f"{method}: {own} / {by_hand} = {own / by_hand:.4f}")
    assert by_hand > 10**6 and own <= MOST[method] * by_hand
