"""The same scripts on every platform: equal transcripts, byte for byte.

A transcript holds the bits of all values, the bytes of serialized states, every status and every
message. What the transcripts say is tested in test_transcripts.py, with the native one.
"""

import functools
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.platforms import scripts
from tests.platforms.platforms import PLATFORMS, Platform, Runner, runner
from tests.platforms.scripts import VARIANTS, Script, joined
from tests.platforms.transcript import first_difference, read
from tests.support.paths import NAMES

THREADS = 8
STEPS = 40  # before a state is saved, and after

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
    script = scripts.everything(native.model)
    (expected,) = native.run(script)
    (actual,) = other.run(script)
    difference = first_difference(script, expected, actual)
    assert difference is None, f"native and {row.name} differ in {difference}"


# ---- States --------------------------------------------------------------------------------------


# from here to another platform, from there to here, and here only
WAYS = [(None, None), *((None, row) for row in PLATFORMS), *((row, None) for row in PLATFORMS)]


def answers_after(script: Script, transcript: bytes, line: int) -> list[tuple[str, str, list[str]]]:
    """All answers after a line, without the numbers of their own."""
    return [(a.call, a.status, a.words) for a in read(script, transcript)[line:]]


@each_fmu
@pytest.mark.parametrize(("writer", "reader"), WAYS, ids=lambda row: row.name if row else "native")
def test_a_run_goes_on_on_another_platform(
    runners: Runners, writer: Platform | None, reader: Platform | None, name: str
) -> None:
    """From a serialized state, with the bits of the run that was not interrupted."""
    here, there = runners(writer, name), runners(reader, name)
    for variant in VARIANTS:
        before, time = scripts.save(here.model, variant, STEPS)
        after = scripts.go_on(here.model, STEPS, time)
        whole = joined(before, after)
        (uninterrupted,) = here.run(whole)
        (state,) = read(whole, uninterrupted)[len(before.lines) - 1].words
        begin = scripts.restore(here.model, state)
        resumed = joined(begin, after)
        (transcript,) = there.run(resumed)
        assert answers_after(resumed, transcript, len(begin.lines)) == answers_after(
            whole, uninterrupted, len(before.lines)
        )


# ---- Threads -------------------------------------------------------------------------------------


@everywhere
@each_fmu
def test_threads_do_not_disturb_each_other(
    runners: Runners, row: Platform | None, name: str
) -> None:
    """Each gets the transcript of a single thread on this machine."""
    native, tested = runners(None, name), runners(row, name)
    several = [
        scripts.co_simulation(native.model, VARIANTS[i % len(VARIANTS)], shift=i / 1024)
        for i in range(THREADS)
    ]
    expected = [native.run(script)[0] for script in several]
    assert len(set(expected)) == THREADS
    for script, alone, transcript in zip(several, expected, tested.run(*several), strict=True):
        assert first_difference(script, alone, transcript) is None
