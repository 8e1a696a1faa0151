"""Runs the examples as their page does, but in another folder."""

import os
import subprocess
import sys
from pathlib import Path

from tests.support.paths import ROOT

TIMEOUT = 120  # s
# on matrices this small, threads only wait for each other
ENVIRONMENT = {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}


def python(folder: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Python with the project's packages in a folder."""
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=os.environ | ENVIRONMENT,
        cwd=folder,
        text=True,
        capture_output=True,
        timeout=TIMEOUT,
    )


def printed(example: str, folder: Path) -> list[str]:
    """Lines that an example prints; it leaves its picture and nothing else in the empty folder."""
    ran = python(folder, ROOT / "examples" / example, "picture.png")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert [file.name for file in folder.iterdir()] == ["picture.png"]
    assert (folder / "picture.png").read_bytes().startswith(b"\x89PNG")
    return ran.stdout.splitlines()
