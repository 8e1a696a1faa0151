"""What the native transcripts say is right, so that others are not compared with nonsense.

Statuses are those of the standard; values are tested where the FMUs are, here that they vary and
that limits, stops and events are met.
"""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from tests.platforms import scripts
from tests.platforms.platforms import Runner, runner
from tests.platforms.scripts import VARIANTS, Model, Script, bits
from tests.platforms.transcript import Answer, first_difference, read
from tests.support.paths import EVERY

each_fmu = pytest.mark.parametrize("name", EVERY)


@pytest.fixture
def native(fmu: Path, tmp_path: Path, name: str) -> Runner:
    return runner(None, name, fmu, tmp_path)


@pytest.fixture
def arm(fmu: Path, tmp_path: Path) -> Runner:
    return runner(None, "RPManipulator", fmu, tmp_path)


def answers_of(native: Runner, script: Script) -> list[Answer]:
    (transcript,) = native.run(script)
    return read(script, transcript)


def rows(model: Model, answers: list[Answer], place: int) -> list[dict[str, float]]:
    """Values by name, for every time that all of one instance were read."""
    call = " ".join(["GetReal", str(place), *map(str, model.reals())])
    names = {v.reference: v.name for v in reversed(model.variables) if v.kind == "Real"}
    return [
        dict(zip((names[r] for r in model.reals()), a.reals, strict=True))
        for a in answers
        if a.call == call
    ]


# ---- Statuses and messages -----------------------------------------------------------------------


@each_fmu
def test_every_status_is_that_of_the_standard(native: Runner, name: str) -> None:
    script = scripts.everything(native.model)
    for answer, expected in zip(answers_of(native, script), script.statuses, strict=True):
        assert answer.status == expected, answer.call


@each_fmu
def test_messages_have_the_values_that_were_refused(native: Runner, name: str) -> None:
    texts = [
        text
        for answer in answers_of(native, scripts.messages(native.model))
        for *_, text in answer.log
    ]
    found = Counter(
        word for text in texts for word in ("nan", "inf", "-inf") if f" {word} " in text
    )
    assert found == {"nan": 3 * 4, "inf": 3, "-inf": 3}
    assert not [text for text in texts if "-nan" in text or "nan(" in text]
    # six digits, and as many as it takes
    assert any("-1e+300 s from t = 1e+300" in text for text in texts)
    assert any("-0.333333 s from t = 0.3333333333333333" in text for text in texts)


@each_fmu
def test_categories_are_logged_one_by_one(native: Runner, name: str) -> None:
    answers = answers_of(native, scripts.messages(native.model))
    answers = [answer for answer in answers if answer.call.split()[1] == "0"]
    names = {instance for a in answers for instance, *_ in a.log}
    assert names == {"plain", "ünïcödé", "100%d#r1#", "logger"}
    seen: dict[str, set[str]] = {}
    for answer in answers:
        if answer.call.startswith("SetDebugLogging 0"):
            chosen = " ".join(answer.call.split()[2:])
            seen.setdefault(chosen, set())
        elif seen:
            seen[chosen] |= {category for _, _, category, _ in answer.log}
    sent = {"logEvents", "logStatusDiscard", "logStatusError", "logAll"}
    if native.model.states:
        sent.add("logStatusWarning")  # of a coarse tolerance
    assert seen.pop("1") == sent
    assert seen.pop("1 logAll") == sent
    assert seen.pop("0") == seen.pop("0 logAll") == set()
    seen.pop("1 logN%sthing#r1#", None)
    for chosen, categories in seen.items():
        assert categories == sent & {chosen.split()[1]}, chosen


# ---- Values --------------------------------------------------------------------------------------


@each_fmu
def test_how_much_is_compared(native: Runner, name: str) -> None:
    """Values by their bits, of which many differ, and bytes of states that all differ."""
    answers = answers_of(native, scripts.everything(native.model))
    reals = [word for a in answers for word in a.words if len(word) == 16]
    expected = min(25_000, 500 * len(native.model.reals()))
    # inputs repeat after 23 steps, and some models are functions of them; a ball comes to rest
    different = 500 if name in ("RPEnvironment", "RPSensor", "BouncingBall") else 4_000
    assert len(reals) > expected and len(set(reals)) > different
    states = [a.words[0] for a in answers if a.call.startswith("SerializeFMUstate") and a.words]
    saved = [state for state in states if state.startswith(b"COSIMSTA".hex())]
    assert native.model.guid.encode().hex() in saved[0]
    has_variants = any(isinstance(value, list) for value in scripts.CHANGED[name].values())
    assert len(set(saved)) >= (3 * 3 + 1 if has_variants else 4) and min(map(len, saved)) > 2 * 300


@pytest.mark.parametrize("name", ["RPPlant"])
def test_the_plant_slides_strikes_and_is_held(native: Runner, name: str) -> None:
    """Events with every method, in modes of all kinds."""
    model = native.model
    names = [v.name for v in model.variables if v.kind in {"Integer", "Enumeration"}]
    ends, held = [], set()
    for variant in VARIANTS:
        answers = answers_of(native, scripts.co_simulation(model, variant))
        numbers = [
            dict(zip(names, map(int, a.words), strict=True))
            for a in answers
            if a.call.startswith("GetInteger 0")
        ]
        points = rows(model, answers, 0)
        modes = [{n[f"mode{joint}"] for n in numbers} for joint in (1, 2)]
        assert all({1, -1} <= found <= {0, 1, -1} for found in modes)
        held |= {0} & (modes[0] | modes[1])
        assert numbers[-1]["event_count"] > 20 and points[-1]["impact_loss"] > 0.0
        assert (points[-1]["grasp_loss"] > 0.0) == (variant > 1)  # at rest
        attached = [a.words for a in answers if a.call.startswith("GetBoolean 0")]
        assert {*map(tuple, attached)} == {("0",), ("1",)}
        for joint in (1, 2):
            is_compliant = scripts.CHANGED[name][f"stops{joint}"][variant - 1] == 3
            assert not is_compliant or any(point[f"stop_force{joint}"] for point in points)
        ends.append(points[-1]["last_event_time"])
    assert held and len(set(ends)) == 3 and min(ends) > 1.0


# ---- Rollback ------------------------------------------------------------------------------------


@each_fmu
def test_undone_steps_are_undone_and_repeated_elsewhere(native: Runner, name: str) -> None:
    model = native.model
    for variant in VARIANTS:
        script = scripts.co_simulation(model, variant)
        answers = answers_of(native, script)
        undone = 0
        for i, answer in enumerate(answers):
            if answer.call.startswith("SetFMUstate 1"):
                first, second = (
                    [a.words for a in answers[i:] if a.call.startswith(f"GetReal {place}")][:3]
                    for place in (0, 1)
                )
                assert first == second
            if answer.call.startswith("SetFMUstate 0"):
                before = [a.words for a in answers[:i] if a.call.startswith("GetReal 0")]
                assert answers[i + 1].words == before[-4] != before[-1]
                undone += 1
        assert undone == scripts.STEPS // 60


@each_fmu
def test_euler_steps_add_the_derivatives(native: Runner, name: str) -> None:
    """x + h x' as Python adds it: h is a power of two, so that there is one rounding."""
    script = scripts.model_exchange(native.model)
    answers = answers_of(native, script)
    steps = 0
    x: list[float] | None = None
    for before, answer in pairwise(answers):
        if answer.call.startswith("EnterEventMode"):
            x = None  # states may jump
        if answer.call.startswith("Euler"):
            stepped = answer.reals
            if x is not None:
                expected = [a + b / 256 for a, b in zip(x, before.reals, strict=True)]
                assert stepped == expected
                steps += 1
            x = stepped
    events = sum(answer.call.startswith("EnterEventMode") for answer in answers)
    assert events == scripts.STEPS // 50 and steps == scripts.STEPS - 1 - events


# ---- The tools -----------------------------------------------------------------------------------


def test_a_single_bit_is_found(arm: Runner) -> None:
    script = scripts.model_exchange(arm.model)
    (transcript,) = arm.run(script)
    assert first_difference(script, transcript, transcript) is None
    last = transcript.rindex(b" GetReal ") + 20
    digit = b"1" if transcript[last : last + 1] == b"0" else b"0"
    other = transcript[:last] + digit + transcript[last + 1 :]
    assert first_difference(script, transcript, other).startswith("1 of ")
    shorter = transcript[: transcript.rindex(b"\n", 0, -1) + 1]
    assert "ends before" in first_difference(script, transcript, shorter)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("Step 0", "there is no such command"),
        ("DoStep 0 3ff0000000000000", "a word is missing"),
        ("DoStep 0 1.0 2.0", "hex digits are expected"),
        ("FreeInstance 8", "places are 0 to 7"),
        ("FreeInstance x", "an integer is expected"),
        ("FreeInstance 0 1", "a word too many"),
        ("SetReal 0 " + "1 " * 520, "too many words"),
    ],
)
def test_a_mistake_in_a_script_is_no_answer(arm: Runner, line: str, text: str) -> None:
    script = Script()
    script.call("GetVersion")
    script.call(line)
    with pytest.raises(AssertionError, match=f"line 2: {text}"):
        arm.run(script)


def test_bits_are_those_of_the_number() -> None:
    assert bits(1.0) == "3ff0000000000000" and bits(-0.0) == "8000000000000000"
