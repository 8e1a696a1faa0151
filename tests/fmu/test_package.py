"""An archive of an FMU and the shared object in it: bytes, dependencies, hardening."""

import os
import re
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.fmu.symbols import libm, listed, standard
from tests.support.paths import EVERY, NAMES, ROOT, SYSTEMS
from tests.support.programs import run_checked
from tests.support.source_copy import copy_sources, settings_of

# ---- Archive -------------------------------------------------------------------------------------


PACKAGE = ROOT / "fmu" / "package.py"


def test_packing_again_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(tmp_path / "content")
    entries = [f"{path.name}={path}" for path in (tmp_path / "content").iterdir()]
    command = [sys.executable, PACKAGE, tmp_path / "again.fmu", *entries]
    subprocess.run(command, check=True)
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


def readelf(*arguments: object) -> str:
    """What readelf says, in lines of any width."""
    command = ["readelf", "--wide", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_it_needs_libc_and_nothing_else(binary: Path) -> None:
    needed = set(re.findall(r"\(NEEDED\).*\[(.*)\]", readelf("--dynamic", binary)))
    assert needed == {"libc.so.6"}


def test_no_result_depends_on_the_elementary_functions_of_the_system(binary: Path) -> None:
    assert not listed("--dynamic", "--undefined-only", binary) & libm()


def test_it_exports_the_functions_of_the_standard_and_nothing_else(binary: Path) -> None:
    version = "fmi3" if binary.parent.name == "x86_64-linux" else "fmi2"
    assert listed("--dynamic", "--defined-only", binary) == standard(version)


def test_it_names_no_folder_to_load_from(binary: Path) -> None:
    assert not re.search(r"\((RPATH|RUNPATH)\)", readelf("--dynamic", binary))


def test_it_needs_the_glibc_that_the_readme_states(binary: Path) -> None:
    stated = re.search(
        r"The binary needs glibc (\d+)\.(\d+)\s+or later", (ROOT / "README.md").read_text()
    )
    versions = re.findall(r"GLIBC_(\d+)\.(\d+)", readelf("--version-info", binary))
    newest = max((int(major), int(minor)) for major, minor in versions)
    assert newest == tuple(map(int, stated.groups()))
    assert newest <= (2, 17)


def test_relocations_are_read_only_when_it_is_loaded(binary: Path) -> None:
    assert re.search(r"^ *GNU_RELRO ", readelf("--segments", binary), re.MULTILINE)
    dynamic = readelf("--dynamic", binary)
    assert "BIND_NOW" in dynamic and re.search(r"FLAGS_1\).*NOW", dynamic)


def test_no_memory_is_writable_and_executable(binary: Path) -> None:
    segments = re.findall(
        r"^ *(LOAD|GNU_STACK)(?: +0x\w+){5} ([RWE ]{3}) ",
        readelf("--segments", binary),
        re.MULTILINE,
    )
    assert {name for name, _ in segments} == {"LOAD", "GNU_STACK"}
    assert not [segment for segment in segments if {"W", "E"} <= set(segment[1])]


def test_code_is_not_relocated(binary: Path) -> None:
    assert "TEXTREL" not in readelf("--dynamic", binary)


def test_the_stack_is_protected(binary: Path) -> None:
    """By gcc for every function with an array, and where glibc knows the size of a buffer."""
    symbols = readelf("--dyn-syms", binary)
    assert "__stack_chk_fail" in symbols
    assert "__vsnprintf_chk" in symbols


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
