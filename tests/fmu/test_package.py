"""The packing of an FMU: its bytes depend only on the contents of its files."""

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
