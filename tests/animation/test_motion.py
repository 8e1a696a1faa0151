"""What the player gets of a run: rows of its CSV file, inputs, parameters; its recording."""

import base64
import io
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rparm import files, project
from rparm.fmi.fmu_file import Fmu
from rparm.report import motion, recording
from rparm.runs.comparison import Run, Runs
from rparm.systems import comparison, ecos, ssp
from rparm.systems.comparison import Outcome
from rparm.systems.structure import OpenedSystem
from tests.animation.player_page import show, synthetic
from tests.support.browser import Browser
from tests.support.paths import ROOT
from tests.support.rparm_project import BUILD, FMUS, load, names_of

ANIMATED = ("rp_manipulator", "rp_plant", "rp_trajectory")
SYSTEMS = {"closed_loop": "ClosedLoop", "machine": "Machine"}
COLUMNS = ("q1", "q2", "tau1", "f2", "ee_fx", "ee_fy", "payload_attached", "mode1", "mode2")


def run(name: str) -> Run:
    """A scenario of the project, run now."""
    scenario = load(name)
    with Fmu(FMUS[scenario.model]) as fmu:
        return Runs({scenario.model: fmu}).run(scenario, scenario.tolerance)


@pytest.fixture(scope="module")
def grasp() -> Run:
    return run("grasp_at_rest")


@pytest.fixture(scope="module", params=SYSTEMS)
def variants(request: pytest.FixtureRequest) -> Iterator[tuple[str, OpenedSystem, list[Outcome]]]:
    """A system with its references in the place of runs: they have the same columns."""
    folder = ROOT / "models" / request.param
    with ssp.unpacked(BUILD / f"{SYSTEMS[request.param]}.ssp") as opened:
        outcomes = []
        for variant in opened.system.parameters:
            path = project.variant_reference_file(folder, variant)
            names, table = files.read_trajectory(path, lambda text, _: ValueError(text))
            done = ecos.Run(names[1:], table[:, 0], table[:, 1:], 0.0, ())
            outcomes.append(Outcome(variant, len(table) - 1, done, {}))
        yield request.param, opened, outcomes


def test_rows_are_those_of_the_csv_file(grasp: Run, tmp_path: Path) -> None:
    result = grasp.result
    file = tmp_path / "run.csv"
    files.write_trajectory(file, result.times, result.names, result.values)
    names, table = files.read_trajectory(file, lambda text, _: ValueError(text))
    rows = slice(None, None, 7)
    data = json.loads(json.dumps(motion.of_run(grasp, rows), allow_nan=False))
    assert data["time"] == table[rows, 0].tolist()
    for name in ("q1", "q2"):
        assert data[name] == table[rows, names.index(name)].tolist()
    assert data["mode1"] == result.integers["mode1"][rows].tolist()
    assert 0 in data["mode2"]


def test_inputs_are_those_of_the_step_that_ends_at_the_row(grasp: Run) -> None:
    data, scenario = motion.of_run(grasp), grasp.scenario
    times = np.array(data["time"])
    attached = np.array(data["payload_attached"])
    # set at 0.5 s, so in the step from there on, and taken back at 1.6 s
    np.testing.assert_array_equal(attached, (times > 0.5 + 1e-9) & (times < 1.6 + 1e-9))
    for name in ("tau1", "f2"):
        values = scenario.inputs[name]
        before = np.maximum(np.searchsorted(scenario.times, times) - 1, 0)
        assert data[name] == values[before].tolist()
    assert data["ee_fx"] is data["ee_fy"] is None  # it does not act


def test_geometry_is_that_of_the_parameters(grasp: Run) -> None:
    arm = motion.of_run(grasp)["arm"]
    assert (arm["a"], arm["l1"], arm["lc1"], arm["g"]) == (0.08, 0.5, 0.25, 0.0)
    assert arm["payload"] == {"x": 0.03, "z": 0.05, "at_rest": True}
    assert arm["stops"] == {"q1": None, "q2": None}
    assert motion.of_run(run("power_off"))["arm"]["payload"]["at_rest"] is False
    stops = motion.of_run(run("spin_up"))["arm"]["stops"]
    assert stops == {"q1": None, "q2": [-0.3, 0.3]}


def test_a_ghost_is_where_the_reference_is_elsewhere(grasp: Run) -> None:
    assert motion.of_run(grasp)["reference"] is None  # it would hide behind the arm
    column = grasp.result.names.index("q2")
    grasp.result.values[-1, column] += 2e-3
    try:
        reference = motion.of_run(grasp)["reference"]
    finally:
        grasp.result.values[-1, column] -= 2e-3
    assert reference["q2"] == grasp.reference.column("q2").tolist()
    assert reference["q1"] == grasp.reference.column("q1").tolist()


@pytest.mark.parametrize("model", FMUS)
def test_models_with_an_arm_are_animated(model: str) -> None:
    data = motion.of_run(run(names_of(model)[0]))
    assert (data is not None) == (model in ANIMATED)
    if data is not None:
        given = {name: data[name] for name in COLUMNS if data.get(name) is not None}
        assert {"q1", "q2"} <= set(given)
        assert {len(values) for values in given.values()} == {len(data["time"])}


def test_a_folder_that_is_none_is_not_animated(grasp: Run, monkeypatch) -> None:
    monkeypatch.setitem(grasp.scenario.__dict__, "model", "no_such_model")
    assert motion.of_run(grasp) is None


def test_systems_show_arm_and_reference_motion(
    variants: tuple[str, OpenedSystem, list[Outcome]],
) -> None:
    system, opened, outcomes = variants
    arm = {"closed_loop": "arm", "machine": "plant"}[system]
    for outcome in outcomes:
        rows = slice(None, None, 3)
        data = json.loads(json.dumps(motion.of_outcome(system, opened, outcome, rows)))
        assert data["time"] == outcome.run.times[rows].tolist()
        for name in ("q1", "q2"):
            assert data[name] == outcome.column(f"{arm}.{name}")[rows].tolist()
            wanted = outcome.column(f"trajectory.{name}_ref")[rows].tolist()
            assert data["reference"][name] == wanted
        given = opened.system.parameter_sets[outcome.variant][arm]
        assert data["arm"]["g"] == given.get("g", 9.81)
        assert data["arm"]["l1"] == 0.5  # the start value in the FMU


def test_the_machine_has_payload_and_wall(
    variants: tuple[str, OpenedSystem, list[Outcome]],
) -> None:
    system, opened, outcomes = variants
    if system != "machine":
        assert all(motion.of_outcome(system, opened, x)["arm"]["wall"] is None for x in outcomes)
        return
    data = {x.variant: motion.of_outcome(system, opened, x) for x in outcomes}
    wall = data["wall_contact"]
    assert wall["arm"]["wall"]["position"] == 0.02
    assert max(wall["ee_fy"]) > 5
    held = data["pick_and_place"]
    assert held["ee_fy"] is None
    assert held["payload_attached"][0] is False
    assert True in held["payload_attached"]
    assert set(data["stick_slip"]["mode1"]) >= {-1, 0, 1}


def test_systems_record_what_is_animated() -> None:
    """The references stand for runs above; runs have these columns as well."""
    for system, name in SYSTEMS.items():
        with ssp.unpacked(BUILD / f"{name}.ssp") as opened:
            recorded = {*comparison.recorded(opened), *comparison.discrete(opened)}
            path = project.variant_reference_file(
                ROOT / "models" / system, next(iter(opened.system.parameters))
            )
            names, _ = files.read_trajectory(path, lambda text, _: ValueError(text))
            assert set(names[1:]) <= recorded


def test_the_page_draws_these_rows(grasp: Run, browser: Browser, tmp_path: Path) -> None:
    data = motion.of_run(grasp, slice(None, None, 2))
    show(browser, tmp_path, data)
    for time in (0.0, 0.4, 0.501, 1.2, 2.4):
        browser.run("player.seek(arguments[0])", time)
        scene, shown = browser.run("return [player.scene, player.time]")
        row = int(np.argmin(np.abs(grasp.result.times - shown)))
        assert shown == grasp.result.times[row]
        assert abs(shown - time) <= 0.005
        for name in ("q1", "q2"):
            assert scene[name] == grasp.result.values[row, grasp.result.names.index(name)]
        for mode in ("mode1", "mode2"):
            assert scene[mode] == grasp.result.integers[mode][row]
        assert (scene["payload_waits"] is not None) == (time <= 0.5)
    waits = data["payload_attached"].index(True)
    browser.run("player.show(0)")
    assert browser.run("return player.scene.payload_waits.q1") == data["q1"][waits]


# ---- The recording -------------------------------------------------------------------------------


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
