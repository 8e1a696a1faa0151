"""Programs that tests run: what they print is kept."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tests.support.paths import ROOT

TIMEOUT = 600  # s, far above what a program takes on a busy machine
# on small matrices, threads only wait for each other
ENVIRONMENT = {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
RPARM = ("-P", "-m", "rparm")  # arguments of Python


def run(*command: object, **options: Any) -> subprocess.CompletedProcess:
    """Run a program; options of subprocess.run. Texts unless `text` is false."""
    kept = {"text": True, "capture_output": True}
    return subprocess.run(list(map(str, command)), **kept | options)


def run_checked(*command: object, folder: Path | None = None, **environment: str) -> str:
    """Run a program that must succeed; return its standard output."""
    done = run(*command, cwd=folder, env=os.environ | environment)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def python(
    *arguments: object, folder: Path = ROOT, environment: Mapping[str, str] | None = None, **options
) -> subprocess.CompletedProcess:
    """Run Python with the project's packages in a folder."""
    given = os.environ | ENVIRONMENT | dict(environment or {})
    return run(sys.executable, *arguments, cwd=folder, env=given, **{"timeout": TIMEOUT} | options)


def printed(example: str, folder: Path) -> list[str]:
    """Lines that an example prints; it leaves its picture and nothing else in the empty folder."""
    ran = python(ROOT / "examples" / example, "picture.png", folder=folder)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert [file.name for file in folder.iterdir()] == ["picture.png"]
    assert (folder / "picture.png").read_bytes().startswith(b"\x89PNG")
    return ran.stdout.splitlines()
