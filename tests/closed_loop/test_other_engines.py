"""Systems without Ecos: in the master of rparm and in libcosim they are what the references say,
also of FMUs of FMI 3.0; what is refused, of either version."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from rparm import project
from rparm.systems import comparison, ecos, master, ssp
from tests.importers.osp import libcosim, only_variant
from tests.support.rparm_project import Console
from tests.support.ssp_files import SSP, edited, replace
from tests.support.systems import BOUND, CASES, System, difference

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


SSP3 = SSP.parent / "fmi3" / SSP.name


def test_the_command_takes_the_fmus_of_fmi_3(tmp_path: Path, console: Console) -> None:
    code, out, err = console("system", "nominal", "--fmi", "3", "--report", tmp_path)
    assert (code, err) == (0, "") and "passed: 1 variant; " in out
    assert "ClosedLoop (FMI 3.0)" in (tmp_path / "index.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("source", [SSP, SSP3], ids=["2.0", "3.0"])
def test_what_ecos_would_not_set_is_refused(tmp_path: Path, console: Console, source: Path) -> None:
    """Enumerations of any version of FMI."""
    law = '<ssv:Parameter name="mode"><ssv:Integer value="1"/></ssv:Parameter>'
    added = replace("<ssv:Parameters>", f"<ssv:Parameters>{law}")
    path = edited(source, tmp_path / "law.ssp", {"resources/controller_nominal.ssv": added})
    error = console.failed("system", "nominal", "--ssp", path, "--report", tmp_path / "report")
    assert "component 'controller': 'mode' is an Enumeration, which Ecos does not set" in error


@pytest.mark.parametrize(
    ("system", "variant"),
    [CASES[0], CASES[4], CASES[5], CASES[8]],
    ids=lambda x: getattr(x, "folder", x),
)
def test_libcosim_is_at_the_reference_of_its_order(
    system: System, variant: str, tmp_path: Path
) -> None:
    """All Real variables are those of the sampled system."""
    path = system.path  # libcosim takes the first variant
    if variant != system.variants[0]:
        change = {"SystemStructure.ssd": only_variant(variant)}
        path = edited(system.path, tmp_path / "one.ssp", change)
    with ssp.unpacked(path) as opened:
        left_out = {"time", *comparison.discrete(opened)}
    expected = system.reference(variant, "sampled.csv")
    rows = system.rows(expected)[1:]
    names = [name for name in expected if name not in left_out]
    result = libcosim(path, names, system.steps, tmp_path)
    for name in names:
        assert difference(result[name][rows - 1], expected[name][1:]) <= BOUND, name
