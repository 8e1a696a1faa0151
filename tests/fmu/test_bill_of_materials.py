"""The program that writes a release's checksums and its bill of materials, on two small files."""

import json
import sys
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path

import pytest

from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
from bill_of_materials import main  # noqa: E402

PART = "Solver,1.2.3,BSD-3-Clause,https://solver.example"


def write(folder: Path, *options: str) -> tuple[int, str]:
    """Exit code and standard error for the files of a folder; later options prevail."""
    arguments = [*map(str, sorted(folder.rglob("*.fmu"))), "--output", str(folder)]
    arguments += ["--version", "1.0.0", "--license", str(ROOT / "LICENSE"), *options]
    error = StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stderr(error):
        patch.setattr(sys, "argv", ["bill_of_materials.py", *arguments])
        return main(), error.getvalue()


@pytest.fixture
def release(tmp_path: Path) -> Path:
    """Folder with the files of a release, one of them in a folder below."""
    folder = tmp_path / "a release"
    (folder / "below").mkdir(parents=True)
    (folder / "One.fmu").write_bytes(b"one")
    (folder / "below" / "Two.fmu").write_bytes(b"two")
    return folder


def test_the_same_files_give_the_same_bytes_and_others_another_number(release: Path) -> None:
    def bill() -> bytes:
        assert write(release, "--part", PART) == (0, "")
        return (release / "sbom.cdx.json").read_bytes()

    first = bill()
    assert bill() == first
    (release / "One.fmu").write_bytes(b"another")
    numbers = [json.loads(each)["serialNumber"] for each in (first, bill())]
    assert numbers[0] != numbers[1]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--license", "nowhere"], "nowhere"),
        (["--output", "/nowhere"], "/nowhere"),
        (["--part", "Solver,1.2.3,BSD-3-Clause"], "Solver"),
        (["--part", PART.replace("BSD-3-Clause", "my own")], "my own"),
    ],
)
def test_what_cannot_be_written_is_told_in_a_line(
    release: Path, options: list[str], reason: str
) -> None:
    code, error = write(release, *options)
    (line,) = error.splitlines()
    assert code == 2
    assert line.startswith("bill_of_materials.py: ") and reason in line
    assert not (release / "SHA256SUMS").exists()


def test_a_file_that_cannot_be_read_is_told_in_a_line(release: Path) -> None:
    (release / "No.fmu").symlink_to("nowhere")
    code, error = write(release)
    assert code == 2 and "No.fmu" in error and error.count("\n") == 1
