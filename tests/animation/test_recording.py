"""The recording is what the player draws, as a file that other programs show."""

import base64
import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rparm.report import recording
from tests.animation.player_page import show, synthetic
from tests.support.browser import Browser
from tests.support.paths import ROOT

COMMITTED = ROOT / "models" / "rp_plant" / "motion.png"


def frames_of(file: Path) -> tuple[list[np.ndarray], list[float]]:
    """Frames (height, width, 3) of a picture, and how long each is shown in ms."""
    frames, durations = [], []
    with Image.open(file) as picture:
        for i in range(picture.n_frames):
            picture.seek(i)
            frames.append(np.asarray(picture.convert("RGB"), int))
            durations.append(picture.info["duration"])
    return frames, durations


def test_frames_are_those_of_the_player(browser: Browser, tmp_path: Path) -> None:
    motion = synthetic()
    file = tmp_path / "motion.png"
    drawn = recording.frames(motion, 0.3, 400)
    recording.write(file, drawn, 0.1)
    frames, durations = frames_of(file)
    assert durations == [100, 100, 100, 100, 1000 * recording.REST]
    show(browser, tmp_path, motion)
    browser.run("element.style.width = '400px'")
    browser.wait("player.view.width === 400")
    for frame, time in zip(frames, (0, 0.3, 0.6, 0.9, 1), strict=True):
        png = browser.run(
            "player.seek(arguments[0]); return player.canvas.toDataURL().split(',')[1]", time
        )
        shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB"), int)
        assert frame.shape == shown.shape
        off = np.abs(frame - shown).max(axis=2)
        assert (off == 0).mean() > 0.97  # areas; edges have fewer colours
        assert off.max() < 70
    for one, other in zip(frames, frames[1:], strict=False):
        assert (one != other).any(axis=2).sum() > 200


def test_a_file_that_is_too_large_is_not_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "LARGEST", 50)
    with pytest.raises(recording.UserError, match="more than 50: take a smaller --width"):
        recording.write(tmp_path / "a.png", [Image.new("RGB", (50, 40), "red")], 0.1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rubber_bufers", "a.png"], "no scenario or variant 'rubber_bufers'"),
        (["wall_touch_and_release", "a.png"], "wall_touch_and_release: nothing to animate"),
        (["spin_up", "a.png", "--speed", "0"], "expected numbers above 0"),
        (["spin_up", "a.gif"], "a.gif: expected a name that ends with .png"),
        (["spin_up", "no_such_folder/a.png"], "a.png: its folder does not exist"),
    ],
)
def test_mistakes_are_explained(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert recording.main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert message in error
    assert error.count("\n") == 1


def test_a_variant_of_a_system_can_be_recorded() -> None:
    data = recording.data_of("wall_contact")
    assert data["arm"]["wall"]["position"] == 0.02
    assert data["time"][-1] == pytest.approx(4.0)


def test_the_picture_in_the_documentation() -> None:
    assert COMMITTED.stat().st_size < recording.LARGEST
    assert f"]({COMMITTED.name})" in (COMMITTED.parent / "README.md").read_text(encoding="utf-8")
    frames, durations = frames_of(COMMITTED)
    assert len(frames) > 20
    assert sum(durations) / 1000 == pytest.approx(4.0 + recording.REST, abs=0.2)
    with Image.open(COMMITTED) as picture:
        assert picture.info["loop"] == recording.PLAYS
