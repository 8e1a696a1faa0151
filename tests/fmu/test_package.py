"""The packing of an FMU: its bytes depend only on the contents of its files."""

import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.paths import ROOT

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
