"""A platform that cannot be run is skipped and named; in CI it fails."""

import dataclasses
import os
import zipfile
from pathlib import Path

import pytest

from tests.platforms import platforms
from tests.platforms.platforms import PLATFORMS, Missing, Platform, runner

NAME = "RPManipulator"


@pytest.fixture
def row() -> Platform:
    """A platform of a machine that is not this one."""
    return dataclasses.replace(PLATFORMS[1], name="moon", system="Moon", emulator=("moonwalk",))


@pytest.fixture
def release(row: Platform, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A release FMU with a library for this platform only, in a project with one source."""
    monkeypatch.setattr(platforms, "ROOT", tmp_path)
    monkeypatch.setattr(platforms, "BUILD", tmp_path / "build")
    monkeypatch.setattr(platforms, "SCRATCH", tmp_path / "build" / "platforms")
    platforms.newest_source.cache_clear()
    source = tmp_path / "src" / "a.c"
    release = tmp_path / "build" / "release" / f"{NAME}.fmu"
    for path in (source, release):
        path.parent.mkdir(parents=True)
    source.touch()
    with zipfile.ZipFile(release, "w") as archive:
        archive.writestr(f"binaries/{row.folder}/{NAME}{row.suffix}", b"")
    yield release
    platforms.newest_source.cache_clear()


@pytest.mark.parametrize(("ci", "outcome"), [("", "skipped"), ("true", "failed")])
def test_without_an_emulator(
    fmu: Path, tmp_path: Path, row: Platform, monkeypatch: pytest.MonkeyPatch, ci: str, outcome: str
) -> None:
    monkeypatch.setenv("CI", ci)
    expected = {"skipped": pytest.skip.Exception, "failed": pytest.fail.Exception}[outcome]
    with pytest.raises(expected, match="moonwalk, which runs moon: ./setup.sh --platforms"):
        runner(row, NAME, fmu, tmp_path)


def test_without_a_compiler(row: Platform, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    row = dataclasses.replace(row, compiler="moon-gcc")
    with pytest.raises(Missing, match="zig or moon-gcc, for the host of moon"):
        platforms.compiler_of(row)


def test_a_build_for_one_platform_is_found(row: Platform, release: Path) -> None:
    only = platforms.SCRATCH / row.preset / release.name
    only.parent.mkdir(parents=True)
    assert platforms.archive_with(row, NAME) == release
    release.rename(only)
    assert platforms.archive_with(row, NAME) == only


def test_a_release_of_other_sources_is_not_tested(row: Platform, release: Path) -> None:
    os.utime(release, (1_000_000_000, 1_000_000_000))
    with pytest.raises(Missing, match=f"{NAME}.fmu is older than the sources: ./release.sh"):
        platforms.archive_with(row, NAME)
