"""rparm for programs: systems by all engines, campaigns, the study of a coupling."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import rparm
from rparm.errors import UserError
from rparm.systems import comparison


def test_a_system_runs_by_all_engines() -> None:
    loop = rparm.System("closed_loop")
    assert "nominal" in loop.variants
    ours, *others = (loop.run("nominal", engine=name) for name in ("master", "ecos", "helics"))
    assert ours.units["arm.q1"] == "rad"
    for other in others:
        assert ours["arm.q1"] == pytest.approx(other["arm.q1"], abs=1e-9)


def test_a_campaign_is_a_table_of_its_runs(tmp_path: Path) -> None:
    """Without gravity and offset the slide is pushed along a parabola: q2 = f2 t^2 / (2 m2)."""
    file = tmp_path / "pushed.toml"
    file.write_text(
        'title = "Pushed"\ndescription = "-"\nscenario = "constant_effort"\nsampling = "random"\n'
        "runs = 5\ntime = { stop = 1.0 }\n[set]\ng = 0.0\na = 0.0\nq1 = 0.0\nq2 = 0.0\n"
        "dq1 = 0.0\ndq2 = 0.0\ntau1 = 0.0\nf2 = 2.0\n[parameters.m2]\nuniform = [0.5, 1.5]\n"
        '[keep]\nfinal = ["q2"]\n'
    )
    runs = rparm.run_campaign(file, output=tmp_path / "out", workers=1)
    assert runs["run"].tolist() == list(range(5)) and set(runs["failure"]) == {""}
    assert runs["final(q2)"] == pytest.approx(1.0 / runs["m2"], abs=1e-8)
    assert len(set(runs["m2"])) == 5


def test_what_the_coupling_costs_is_asked_of_the_system_that_knows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    loop = rparm.System("closed_loop")
    asked: list[tuple[Path, Path]] = []
    folder, module = comparison.coupling_study()
    monkeypatch.setattr(
        module, "study_coupling", lambda *given: asked.append(given) or {"part": {"passed": True}}
    )
    assert loop.study_coupling(tmp_path) == {"part": {"passed": True}}
    assert asked == [(loop.path, tmp_path)]
    with pytest.raises(UserError, match="has no study of its coupling, closed_loop has one"):
        rparm.System("machine").study_coupling(tmp_path)


@pytest.mark.parametrize(
    ("package", "words", "call"),
    [
        ("distributed", "not installed", lambda: rparm.run_campaign("x.toml")),
        (
            "helics",
            "cannot be loaded",
            lambda: rparm.System("closed_loop").run("nominal", engine="helics"),
        ),
    ],
)
def test_a_package_that_is_missing_is_named(
    monkeypatch: pytest.MonkeyPatch, package: str, words: str, call: Callable[[], object]
) -> None:
    for name in [name for name in sys.modules if name.startswith(("rparm.campaign", package))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(UserError, match=rf"^{package}\b.* {words}.*\./setup\.sh --\w+ \w+ it\b"):
        call()
