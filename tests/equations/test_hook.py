"""Events in C: a bead that bounces until it rests, built as users build, and what is refused."""

import math
import shutil
from pathlib import Path

import fmpy
import pytest

from tests.equations.compiled import ModelFileError, read
from tests.equations.examples import METHODS, build, simulated

BEAD = Path(__file__).with_name("bead")
EVENT = '[events.e]\nwhen = "x < 0"\nreinit = { v = "0" }\n\n[outputs]'
MISTAKES = [
    ('code = "bead.h"', "", "expected code with a function bead_calculate"),
    ("[hook]", 'modes = ["m"]\n\n[hook]', "decides all events, but there is modes"),
    ("[outputs]", EVENT, "decides all events, but there is events"),
    ('sources = ["bead_events.c"]', "", "sources is missing"),
    ("bead_events.c", "missing.c", "sources: expected a C file, got 'missing.c'"),
    ('indicators = ["way", "load"]', 'indicators = ["way"]', "series: load is none of indicators"),
    (
        '["way", "load"]',
        '["wey", "load"]',
        "expected a real entry of [where] or [outputs], got 'wey'",
    ),
    ("{ mode = [] }", "{ mood = [] }", "reads: expected a variable, got 'mood'"),
    ('["way", "load"]', '["g", "load"]', "expected a real entry of [where] or [outputs], got 'g'"),
    ('["way", "load"]', '["way", "way"]', "indicators: expected different names"),
    ("{ mode = [] }", '{ mode = "x" }', "reads: 'mode': expected a list of names"),
    ("{ mode = [] }", "[]", "reads: expected a table"),
    ("motion[1]", "motion", "field: 'motion' is not of the type of x"),
    ("motion[1]", "motion[0]", "field: 'motion[0]' is the place of x"),
    ("motion[1]", "motion[", "field: expected a field of C such as damping[0]"),
]
G, RESTITUTION, SLOW, HEIGHT = 9.81, 0.5, 0.1, 1.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Has the files of the bead, and its FMUs."""
    folder = shutil.copytree(BEAD, tmp_path_factory.mktemp("hook") / "bead")
    build(folder / "bead.toml", folder)
    return folder


def height(t: float) -> tuple[float, int]:
    """Return height and impacts so far, by the closed form."""
    impact, v, impacts = math.sqrt(2 * HEIGHT / G), 0.0, 0
    if t < impact:
        return HEIGHT - G * t**2 / 2, 0
    v = G * impact * RESTITUTION
    while True:
        impacts += 1
        if v < SLOW:
            return 0.0, impacts
        if t < impact + 2 * v / G:
            return v * (t - impact) - G * (t - impact) ** 2 / 2, impacts
        impact, v = impact + 2 * v / G, v * RESTITUTION


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("place", ["", "fmi3"])
def test_a_bead_bounces_until_it_rests(folder: Path, place: str, method: str) -> None:
    fmu = folder / place / "Bead.fmu"
    rows = simulated(fmu, 2.0, 0.01, {"solver_method": METHODS[method]})
    for row in rows:
        x, impacts = height(row["time"])
        assert row["x"] == pytest.approx(x, abs=1e-7)
        assert row["impacts"] == impacts
    assert rows["mode"][0] == 1 and rows["mode"][-1] == 2
    assert rows["a"][0] == -G and rows["a"][-1] == 0.0


def test_the_hook_is_in_the_sources_and_checks_the_start(folder: Path) -> None:
    unpacked = Path(fmpy.extract(str(folder / "Bead.fmu")))
    assert (unpacked / "sources" / "hook_bead_events.c").is_file()
    shutil.rmtree(unpacked)
    with pytest.raises(fmpy.fmi1.FMICallException):
        simulated(folder / "Bead.fmu", 1.0, 0.1, {"x": -1.0})


@pytest.mark.parametrize(("old", "new", "said"), MISTAKES)
def test_what_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    folder = shutil.copytree(BEAD, tmp_path / "bead")
    text = (folder / "bead.toml").read_text(encoding="utf-8")
    assert old in text
    (folder / "bead.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ModelFileError) as error:
        read(folder / "bead.toml")
    assert said in str(error.value)
    assert "\n" not in str(error.value)
