"""The shared object in each FMU: its dependencies and its hardening."""

import os
import re
import subprocess
import zipfile
from pathlib import Path

import pytest

from tests.fmu.symbols import libm, listed, standard
from tests.support.paths import EVERY, ROOT

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
