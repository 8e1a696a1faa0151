"""Systems without Ecos: the project's own master gives what the references say."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from rparm import project
from rparm.systems import comparison, ecos, master, ssp
from tests.support.rparm_project import Console

ABSENT = "ecospy is not installed"


def compared(name: str, variants: Sequence[str] | None = None) -> list[comparison.Outcome]:
    """Variants of a system, or all, stepped in this process."""
    folder = project.systems()[name]
    with ssp.unpacked(project.built(folder, ".ssp")) as opened:
        experiment = comparison.load_study(folder).EXPERIMENT
        return [
            comparison.simulate(
                opened,
                variant,
                comparison.load_reference(opened, variant, folder, experiment),
                master.run_in_master,
            )
            for variant in variants or opened.system.parameters
        ]


@pytest.mark.parametrize("name", ["closed_loop", "machine"])
def test_all_variants_are_within_the_bound(name: str) -> None:
    outcomes = compared(name)
    assert len(outcomes) == 5
    assert [outcome.variant for outcome in outcomes if not outcome.passed] == []


def test_the_command_says_who_steps(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ecos, "absent", lambda: ABSENT)
    monkeypatch.setattr(ecos, "run", None)  # nobody may call it
    code, out, _ = console("system", "nominal", "--report", tmp_path)
    assert code == 0
    assert f"{ABSENT}: the master of rparm steps closed_loop" in out
    assert "passed: 1 variant" in out


@pytest.mark.parametrize(
    ("system", "machine", "words"),
    [
        ("linux", "x86_64", ""),
        ("win32", "AMD64", ""),
        ("linux", "aarch64", "x86-64 only"),
        ("darwin", "x86_64", "x86-64 only"),
    ],
)
def test_where_ecos_has_no_library(
    monkeypatch: pytest.MonkeyPatch, system: str, machine: str, words: str
) -> None:
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    assert words in ecos.absent() and bool(words) == bool(ecos.absent())
