"""Archives of FMUs and their shared objects: bytes, dependencies, hardening; a run by fmpy."""

import os
import re
import struct
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import fmpy
import lief
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from tests.fmu.symbols import GLIBC, check_elf, listed
from tests.support.paths import EVERY, FOLDERS, NAMES, ROOT, SYSTEMS
from tests.support.programs import run_checked
from tests.support.rparm_project import check_near
from tests.support.source_copy import copy_sources, settings_of

# ---- Archive -------------------------------------------------------------------------------------


PACKAGE = ROOT / "fmu" / "package.py"


def test_packing_again_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(tmp_path / "content")
    entries = [f"{path.name}={path}" for path in (tmp_path / "content").iterdir()]
    run_checked(sys.executable, PACKAGE, tmp_path / "again.fmu", *entries)
    assert (tmp_path / "again.fmu").read_bytes() == fmu.read_bytes()


@pytest.mark.parametrize("entry", ["a=missing.txt", "no-equals-sign", "=x"])
def test_packing_what_is_not_there_is_refused(tmp_path: Path, entry: str) -> None:
    command = [sys.executable, PACKAGE, tmp_path / "x.fmu", entry]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert entry in result.stderr and len(result.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_the_folder_of_an_archive_is_made(tmp_path: Path) -> None:
    archive = tmp_path / "not" / "there" / "yet" / "x.fmu"
    subprocess.run([sys.executable, PACKAGE, archive, f"a={PACKAGE}"], check=True)
    assert zipfile.ZipFile(archive).namelist() == ["a"]


# ---- Libraries for macOS -------------------------------------------------------------------------


def library(processor: int, size: int) -> bytes:
    """As much of a file for macOS as joining looks at."""
    return struct.pack("<III", 0xFEEDFACF, processor, 3) + bytes(range(256)) * (size // 256)


def packed(folder: Path, *libraries: bytes) -> subprocess.CompletedProcess[str]:
    """All under one name."""
    command = [sys.executable, PACKAGE, folder / "x.fmu"]
    for i, content in enumerate(libraries):
        (folder / str(i)).write_bytes(content)
        command.append(f"lib={folder / str(i)}")
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_libraries_of_one_name_become_one_for_both_processors(tmp_path: Path) -> None:
    parts = {0x01000007: library(0x01000007, 9000), 0x0100000C: library(0x0100000C, 5000)}
    assert packed(tmp_path, *parts.values()).returncode == 0
    joined = zipfile.ZipFile(tmp_path / "x.fmu").read("lib")
    assert struct.unpack_from(">II", joined) == (0xCAFEBABE, 2)  # fat_header of <mach-o/fat.h>
    for i in range(2):
        processor, _, first, length, page = struct.unpack_from(">IIIII", joined, 8 + 20 * i)
        assert joined[first : first + length] == parts.pop(processor)
        assert first % 2**page == 0
    assert parts == {}


@pytest.mark.parametrize(
    "libraries", [(b"", b""), (b"\x7fELF" * 9, library(7, 512)), (library(0x01000007, 512),) * 2]
)
def test_other_files_of_one_name_are_refused(tmp_path: Path, libraries: tuple[bytes, ...]) -> None:
    result = packed(tmp_path, *libraries)
    assert result.returncode == 2 and "only libraries for macOS" in result.stderr
    assert not (tmp_path / "x.fmu").exists()


# ---- Shared object -------------------------------------------------------------------------------


FMUS = (*EVERY, *(f"fmi3/{name}" for name in EVERY))


@pytest.fixture(scope="module", params=FMUS)
def binary(
    request: pytest.FixtureRequest, fmu: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The shared object of each FMU, taken out of its archive."""
    with zipfile.ZipFile(fmu.parent / f"{request.param}.fmu") as archive:
        (name,) = [n for n in archive.namelist() if re.fullmatch(r"binaries/.*linux.*\.so", n)]
        return Path(archive.extract(name, tmp_path_factory.mktemp("fmu")))


def test_it_is_as_it_must_be(binary: Path) -> None:
    version = "fmi3" if binary.parent.name == "x86_64-linux" else "fmi2"
    check_elf(lief.ELF.parse(str(binary)), version)


def test_the_readme_states_the_glibc_that_it_needs(binary: Path) -> None:
    text = (ROOT / "README.md").read_text()
    stated = re.search(r"the binary needs glibc (\d+)\.(\d+)\s+or later", text)
    versions = re.findall(rb"GLIBC_(\d+)\.(\d+)", binary.read_bytes())
    newest = max((int(major), int(minor)) for major, minor in versions)
    assert newest == tuple(map(int, stated.groups())) <= GLIBC


def test_the_stack_is_protected(binary: Path) -> None:
    """By gcc for every function with an array, and where glibc knows the size of a buffer."""
    needed = listed("--dynamic", "--undefined-only", binary)
    assert {"__stack_chk_fail", "__vsnprintf_chk"} <= needed


def test_it_names_no_path_of_the_machine_that_built_it(binary: Path, fmu: Path) -> None:
    content = binary.read_bytes()
    for path in (ROOT, fmu.parent):
        assert os.fsencode(path) not in content


# ---- Two builds ----------------------------------------------------------------------------------


BOTH_VERSIONS = (*NAMES, *(f"fmi3/{name}" for name in NAMES))


@pytest.mark.long
def test_a_build_in_another_folder_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    """Copied to a folder of a longer name, at another time and under another umask."""
    sources = copy_sources(tmp_path / "a folder with a longer name" / "b")
    built = tmp_path / "elsewhere"
    for path in sources.rglob("*"):
        os.utime(path, (1_000_000_000, 1_000_000_000))
    before = os.umask(0o077)
    try:
        settings = settings_of(fmu.parent)
        run_checked("cmake", "-S", sources, "-B", built, "-DBUILD_TESTING=OFF", *settings)
        run_checked("cmake", "--build", built, "--parallel", "2")
    finally:
        os.umask(before)
    for name in (*(f"{name}.fmu" for name in BOTH_VERSIONS), *(f"{name}.ssp" for name in SYSTEMS)):
        assert (built / name).read_bytes() == (fmu.parent / name).read_bytes(), name


# ---- As importers see it -------------------------------------------------------------------------


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
    content = tomllib.loads((model / f"{folder}.toml").read_text(encoding="utf-8"))
    page = (model / "README.md").read_text(encoding="utf-8")
    for section in ("parameters", "inputs", "states", "outputs"):
        declared = [name for name, entry in content.get(section, {}).items() if "unit" in entry]
        assert {*declared} <= set(re.findall(r"`(\w+)`", page))  # others are included


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
