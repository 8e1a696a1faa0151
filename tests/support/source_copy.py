"""Copies of the sources, built apart from them with the settings of a build that is there."""

import shutil
from pathlib import Path

from tests.support.paths import ROOT

SETTINGS = (
    "CMAKE_C_COMPILER:", "FMI_HEADERS_DIR:", "_Python3_EXECUTABLE:", "MUSL_SOURCE_DIR:",
    "OWN_LIBM:", "SUNDIALS_SOURCE_DIR:", "UNITY_DIR:",
)  # fmt: skip


def copy_sources(to: Path) -> Path:
    """What a build needs."""
    ignored = shutil.ignore_patterns("build", ".git", "__pycache__")
    return shutil.copytree(ROOT, to, ignore=ignored)


def settings_of(build: Path) -> list[str]:
    """Options for CMake: compiler, Python and the places of libraries as in the folder build."""
    lines = (build / "CMakeCache.txt").read_text().splitlines()
    return [f"-D{line.removeprefix('_')}" for line in lines if line.startswith(SETTINGS)]
