"""The built FMU as its importers see it: archive, binary, model description, a run by fmpy."""

import re
import sys
import tomllib
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from tests.support.paths import EVERY, FOLDERS, ROOT
from tests.support.programs import run_checked
from tests.support.rparm_project import check_near

CROSS_CHECK = ("_in.csv", "_ref.csv", "_ref.opt")  # endings of a reference's files


def test_the_archive_holds_what_importers_look_for(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        assert archive.testzip() is None
        entries = {info.filename: info for info in archive.infolist()}
        page = archive.read("documentation/index.html").decode()
        picture = archive.read("model.png")
    assert set(entries) == {
        "binaries/linux64/RPManipulator.so",
        "documentation/index.html",
        "documentation/model.svg",
        "documentation/licenses/license.txt",
        "documentation/licenses/musl.txt",
        "documentation/licenses/sundials.txt",
        "extra/org.fmi-standard.fmi-ls-ref/fmi-ls-manifest.xml",
        *(
            f"extra/org.fmi-standard.fmi-ls-ref/{scenario}/{name}"
            for scenario in ("irregular_steps", "sixtieth")
            for name in (*(f"RPManipulator{end}" for end in CROSS_CHECK), "parameters.ssv")
        ),
        "model.png",
        "modelDescription.xml",
    }
    for info in entries.values():
        assert info.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
        assert info.date_time == (1980, 1, 1, 0, 0, 0)
    assert picture.startswith(b"\x89PNG")
    assert "effective_relative_tolerance" in page and "<math" in page


EACH = [*(f"{name}.fmu" for name in EVERY), *(f"fmi3/{name}.fmu" for name in EVERY)]


@pytest.mark.parametrize("name", EACH)
def test_fmpy_finds_no_problem(fmu: Path, name: str) -> None:
    """In the schema, the names, the model structure and the units."""
    assert validate_fmu(str(fmu.parent / name)) == []


@pytest.mark.parametrize("folder", FOLDERS.values())
def test_the_page_of_a_model_names_the_variables_that_it_declares(folder: str) -> None:
    model = ROOT / "models" / folder
    path, sections = model / "variables.toml", ["variables"]
    if not path.exists():  # its equations declare them
        path, sections = model / f"{folder}.toml", ["parameters", "inputs", "outputs"]
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    page = (model / "README.md").read_text(encoding="utf-8")
    for section in sections:
        assert content[section].keys() <= set(re.findall(r"`(\w+)`", page))


def test_fmpy_simulates_it_by_default(fmu: Path, tmp_path: Path) -> None:
    result = tmp_path / "result.csv"
    command = Path(sys.executable).parent / "fmpy"
    run_checked(command, "simulate", fmu, "--output-file", result)
    rows = np.genfromtxt(result, delimiter=",", names=True)
    assert rows["time"][0] == 0.0
    assert rows["time"][-1] == 2.0
    # free motion conserves the energy that the arm has at rest
    energy = rows["total_energy"]
    scale = np.max(np.abs(rows["kinetic_energy"]) + np.abs(rows["potential_energy"]))
    assert np.max(np.abs(energy - energy[0])) <= 1e-6 * scale
    assert np.ptp(rows["q1"]) > 1.0


def test_the_sample_of_the_readme_runs(fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown = []
    monkeypatch.setattr(fmpy, "plot_result", shown.append)
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 1
    known: dict[str, np.ndarray] = {}
    exec(blocks[0].replace("build/RPManipulator.fmu", str(fmu)), known)
    assert shown[0] is known["result"] and known["result"]["time"][-1] == 2.0
    check_near(known["result"])


def test_the_page_names_the_fraction_of_the_tolerance_that_is_used(fmu: Path) -> None:
    page = (ROOT / "src" / "README.md").read_text()
    fraction = 1.0 / float(re.search(r"integrates at 1/(\d+) of", page).group(1))
    result = fmpy.simulate_fmu(
        str(fmu), stop_time=0.01, relative_tolerance=1e-6, output=["effective_relative_tolerance"]
    )
    assert result["effective_relative_tolerance"][0] == pytest.approx(1e-6 * fraction, rel=1e-14)
