"""Two builds of the FMUs and systems are the same, to the last byte."""

import os
from pathlib import Path

from tests.support.paths import NAMES, SYSTEMS
from tests.support.source_copy import copy_sources, run, settings_of

FMUS = (*NAMES, *(f"fmi3/{name}" for name in NAMES))


def test_a_build_in_another_folder_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    """Copied to a folder of a longer name, at another time and under another umask."""
    sources = copy_sources(tmp_path / "a folder with a longer name" / "b")
    built = tmp_path / "elsewhere"
    for path in sources.rglob("*"):
        os.utime(path, (1_000_000_000, 1_000_000_000))
    before = os.umask(0o077)
    try:
        settings = settings_of(fmu.parent)
        run("cmake", "-S", sources, "-B", built, "-DBUILD_TESTING=OFF", *settings)
        run("cmake", "--build", built, "--parallel", "2")
    finally:
        os.umask(before)
    for name in (*(f"{name}.fmu" for name in FMUS), *(f"{name}.ssp" for name in SYSTEMS)):
        assert (built / name).read_bytes() == (fmu.parent / name).read_bytes(), name
