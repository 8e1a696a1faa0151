"""The same runs on every platform: equal transcripts, byte for byte.

A transcript holds the bits of all values, the bytes of serialized states, every status and every
message. What the transcripts say is tested in test_transcripts.py, with the native one.
"""

import functools
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.platforms.model import VARIANTS
from tests.platforms.platforms import PLATFORMS, Platform, Runner, runner
from tests.platforms.transcript import first_difference
from tests.support.paths import NAMES

THREADS = 8

# of the examples the one with events: each takes about a minute
each_fmu = pytest.mark.parametrize(
    "name", (*NAMES, pytest.param("BouncingBall", marks=pytest.mark.long))
)
each_platform = pytest.mark.parametrize("row", PLATFORMS, ids=lambda row: row.name)
# and this one, whose library comes from the FMU in build/
everywhere = pytest.mark.parametrize(
    "row", (None, *PLATFORMS), ids=lambda row: row.name if row else "native"
)

Runners = Callable[[Platform | None, str], Runner]


@pytest.fixture(scope="module")
def runners(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Runners:
    folder = tmp_path_factory.mktemp("platforms")
    return functools.cache(lambda row, name: runner(row, name, fmu, folder))


@pytest.mark.parametrize("recompiled", [False, pytest.param(True, marks=pytest.mark.long)])
@each_platform
@each_fmu
def test_all_values_states_and_messages_are_the_same(
    runners: Runners, row: Platform, name: str, recompiled: bool, fmu: Path, tmp_path: Path
) -> None:
    """Of the library in the release, and of one that a foreign compiler makes of its sources."""
    native = runners(None, name)
    other = runner(row, name, fmu, tmp_path, recompiled=True) if recompiled else runners(row, name)
    (expected,), (actual,) = native.run("everything"), other.run("everything")
    difference = first_difference(expected, actual)
    assert difference is None, f"native and {row.name} differ in {difference}"


# ---- States --------------------------------------------------------------------------------------


# from here to another platform, from there to here, and here only
WAYS = [(None, None), *((None, row) for row in PLATFORMS), *((row, None) for row in PLATFORMS)]


@each_fmu
@pytest.mark.parametrize(("writer", "reader"), WAYS, ids=lambda row: row.name if row else "native")
def test_a_run_goes_on_on_another_platform(
    runners: Runners, writer: Platform | None, reader: Platform | None, name: str
) -> None:
    """From a serialized state, with the bits of the run that was not interrupted."""
    here, there = runners(writer, name), runners(reader, name)
    for variant in VARIANTS:
        (uninterrupted,) = here.run(f"write:{variant}:state")
        if here is not there:
            shutil.copy(here.folder / "state", there.folder)
        (resumed,) = there.run(f"read:{variant}:state")
        expected, actual = (each.partition(b"mark")[2] for each in (uninterrupted, resumed))
        assert len(expected) > 1000
        assert first_difference(expected, actual) is None


# ---- Threads -------------------------------------------------------------------------------------


@everywhere
@each_fmu
def test_threads_do_not_disturb_each_other(
    runners: Runners, row: Platform | None, name: str
) -> None:
    """Each gets the transcript of a single thread on this machine."""
    native, tested = runners(None, name), runners(row, name)
    several = [f"steps:{VARIANTS[i % len(VARIANTS)]}:{i}" for i in range(THREADS)]
    expected = [native.run(run)[0] for run in several]
    assert len(set(expected)) == THREADS
    for alone, transcript in zip(expected, tested.run(*several), strict=True):
        assert first_difference(alone, transcript) is None
