"""What the native transcripts say is right, so that others are not compared with nonsense.

platform_host itself requires each status that the standard has; values are tested where the FMUs
are, here that they vary and that limits, stops and events are met.
"""

from collections import Counter
from pathlib import Path

import pytest

from tests.platforms.model import CHANGED, VARIANTS, Model
from tests.platforms.platforms import Runner, runner
from tests.platforms.transcript import Answer, first_difference, read
from tests.support.paths import EVERY

each_fmu = pytest.mark.parametrize("name", EVERY)


@pytest.fixture
def native(fmu: Path, tmp_path: Path, name: str) -> Runner:
    return runner(None, name, fmu, tmp_path)


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


@each_fmu
def test_messages_have_the_values_that_were_refused(native: Runner, name: str) -> None:
    texts = [text for answer in answers_of(native, "everything") for *_, text in answer.log]
    found = Counter(
        word for text in texts for word in ("nan", "inf", "-inf") if f" {word} " in text
    )
    assert found == {"nan": 3 * 4, "inf": 3, "-inf": 3}
    assert not [text for text in texts if "-nan" in text or "nan(" in text]
    # six digits, and as many as it takes
    assert any("-1e+300 s from t = 1e+300" in text for text in texts)
    assert any("-0.333333 s from t = 0.3333333333333333" in text for text in texts)


@each_fmu
def test_how_much_is_compared(native: Runner, name: str) -> None:
    """Values by their bits, of which many differ, and bytes of states that all differ."""
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


# ---- The tools -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["RPManipulator"])
def test_a_single_bit_is_found(native: Runner, name: str) -> None:
    (transcript,) = native.run("steps:1:0")
    assert first_difference(transcript, transcript) is None
    last = transcript.rindex(b" GetReal ") + 20
    digit = b"1" if transcript[last : last + 1] == b"0" else b"0"
    other = transcript[:last] + digit + transcript[last + 1 :]
    assert first_difference(transcript, other).startswith("1 of ")
    shorter = transcript[: transcript.rindex(b"\n", 0, -1) + 1]
    assert "ends before" in first_difference(transcript, shorter)


@pytest.mark.parametrize("name", ["RPManipulator"])
def test_a_status_that_is_not_expected_fails(
    native: Runner, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(CHANGED[name], "m2", -1.0)
    with pytest.raises(AssertionError, match="SetReal: Discard in place of OK"):
        native.run("steps:1:0")
