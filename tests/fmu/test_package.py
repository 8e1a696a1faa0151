"""An archive of an FMU and the shared object in it: bytes, dependencies, hardening."""

import os
import re
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import lief
import pytest

from tests.fmu.symbols import GLIBC, check_elf, listed
from tests.support.paths import EVERY, NAMES, ROOT, SYSTEMS
from tests.support.programs import run_checked
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
