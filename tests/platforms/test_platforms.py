"""The same runs on every platform: equal transcripts, byte for byte.

A transcript holds the bits of all values, the bytes of serialized states, every status and every
message. platform_host itself requires each status that the standard has. Values are tested where
the FMUs are; here that they vary and that limits, stops and events are met.
"""

import functools
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.platforms.model import CHANGED, VARIANTS, Model
from tests.platforms.platforms import PLATFORMS, Platform, Runner, runner
from tests.platforms.transcript import Answer, first_difference, read
from tests.support.paths import EVERY, NAMES

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
    """Of the library in the release, and of one that a foreign compiler makes of its sources.

    A run that goes on from a serialized state has the same bits, too: so states can move from one
    platform to another.
    """
    native = runners(None, name)
    other = runner(row, name, fmu, tmp_path, recompiled=True) if recompiled else runners(row, name)
    (expected,), (actual,) = native.run("everything"), other.run("everything")
    difference = first_difference(expected, actual)
    assert difference is None, f"native and {row.name} differ in {difference}"


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


# ---- What the native transcripts say -------------------------------------------------------------


@pytest.fixture
def native(runners: Runners, name: str) -> Runner:
    return runners(None, name)


def answers_of(native: Runner, run: str) -> list[Answer]:
    (transcript,) = native.run(run)
    return read(transcript)


def rows(model: Model, answers: list[Answer]) -> list[dict[str, float]]:
    """Values by name, for every time that all were read."""
    names = {v.reference: v.name for v in reversed(model.variables) if v.kind == "Real"}
    columns = [names[reference] for reference in model.reals()]
    return [
        dict(zip(columns, answer.reals, strict=True))
        for answer in answers
        if answer.call == "GetReal"
    ]


@pytest.mark.parametrize("name", EVERY)
def test_how_much_is_compared(native: Runner, name: str) -> None:
    """Values by their bits, bytes of states that all differ, messages with what was refused."""
    answers = answers_of(native, "everything")
    reals = [word for a in answers for word in a.words if len(word) == 16]
    expected = min(25_000, 500 * len(native.model.reals()))
    # inputs repeat after 23 steps, and some models are functions of them; a ball comes to rest
    different = 500 if name in ("RPEnvironment", "RPSensor", "BouncingBall") else 4_000
    assert len(reals) > expected and len(set(reals)) > different
    states = [a.words[0] for a in answers if a.call == "SerializeFMUstate"]
    saved = [state for state in states if state.startswith(b"COSIMSTA".hex())]
    assert native.model.guid.encode().hex() in saved[0]
    has_variants = any(isinstance(value, list) for value in CHANGED[name].values())
    assert len(set(saved)) >= (3 * 3 + 1 if has_variants else 4) and min(map(len, saved)) > 2 * 300
    texts = [text for answer in answers for *_, text in answer.log]
    found = Counter(word for text in texts for word in re.findall(r"(?<= )-?(?:nan|inf)\b", text))
    assert found == {"nan": 3 * 4, "inf": 3, "-inf": 3}
    # six digits, and as many as it takes
    assert any("-1e+300 s from t = 1e+300" in text for text in texts)
    assert any("-0.333333 s from t = 0.3333333333333333" in text for text in texts)


@pytest.mark.parametrize("name", ["RPPlant"])
def test_the_plant_slides_strikes_and_is_held(native: Runner, name: str) -> None:
    """Events with every method, in modes of all kinds."""
    model = native.model
    names = [v.name for v in model.variables if v.kind in {"Integer", "Enumeration"}]
    ends, held = [], set()
    for variant in VARIANTS:
        answers = answers_of(native, f"steps:{variant}:0")
        numbers = [
            dict(zip(names, map(int, a.words), strict=True))
            for a in answers
            if a.call == "GetInteger"
        ]
        points = rows(model, answers)
        modes = [{n[f"mode{joint}"] for n in numbers} for joint in (1, 2)]
        assert all({1, -1} <= found <= {0, 1, -1} for found in modes)
        held |= {0} & (modes[0] | modes[1])
        assert numbers[-1]["event_count"] > 20 and points[-1]["impact_loss"] > 0.0
        assert (points[-1]["grasp_loss"] > 0.0) == (variant > 1)  # at rest
        attached = [a.words for a in answers if a.call == "GetBoolean"]
        assert {*map(tuple, attached)} == {("0",), ("1",)}
        for joint in (1, 2):
            is_compliant = CHANGED[name][f"stops{joint}"][variant - 1] == 3
            assert not is_compliant or any(point[f"stop_force{joint}"] for point in points)
        ends.append(points[-1]["last_event_time"])
    assert held and len(set(ends)) == 3 and min(ends) > 1.0
