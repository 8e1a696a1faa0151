"""Scenarios that name an FMU of own equations: every command takes them like any other."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import rparm
from rparm.fmi.fmu_file import read_model
from rparm.runs import scenario as scenarios
from tests.equations.examples import FOLDER, MODELS, quick
from tests.support.rparm_project import assert_one_line, call, repacked

TEXTS = MODELS["scenarios_of_own_fmus"]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario in another folder than its FMU."""
    folder = tmp_path_factory.mktemp("own")
    fmu = quick(FOLDER / "dahlquist.toml", folder / "dahlquist")
    path = folder / "runs" / "decay.toml"
    path.parent.mkdir()
    path.write_text(TEXTS["SCENARIO"].format(fmu=f"../{fmu.relative_to(folder).as_posix()}"))
    return path


def with_experiment(fmu: Path, path: Path, attributes: str) -> Path:
    """A copy of an FMU with another default experiment."""

    def changed(xml: str) -> str:
        return re.sub(r"<DefaultExperiment[^>]*/>", f"<DefaultExperiment {attributes}/>", xml)

    return repacked(fmu, path, changed)


@pytest.mark.parametrize(("attributes", "expected"), TEXTS["EXPERIMENTS"])
@pytest.mark.parametrize("version", ["", "fmi3"])
def test_a_new_scenario_has_the_default_experiment(
    scenario: Path,
    tmp_path: Path,
    attributes: str,
    expected: dict[str, float],
    version: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    built = fmu_of(scenario).parent / version / "Dahlquist.fmu"
    fmu = with_experiment(built, tmp_path / "other.fmu", attributes)
    path = tmp_path / "new.toml"
    code, _, err = call(capsys, "new", path, "--model", fmu)
    assert code == 0, err
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    found = content["time"] | {"tolerance": content["tolerance"]}
    assert {name: found[name] for name in expected} == expected
    scenarios.load(path, read_model(fmu))  # which refuses what cannot be run


def fmu_of(scenario: Path) -> Path:
    return scenario.parents[1] / "dahlquist" / "Dahlquist.fmu"


def test_it_runs_from_any_folder(
    scenario: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, _ = call(capsys, scenario, "--json", "--output", "report")
    (found,) = json.loads(out)["scenarios"]
    assert code == 0 and found["model"] == str(scenario.parent / "../dahlquist/Dahlquist.fmu")
    assert found["runs"][0]["error"] < 1e-8
    page = (tmp_path / "report" / "files" / "decay.html").read_text(encoding="utf-8")
    assert "player" not in page  # there is nothing to animate
    table = rparm.Scenario(scenario).run()
    np.testing.assert_allclose(table["x"], 2.0 * np.exp(-1.5 * table["time"]), rtol=1e-8)


def test_an_fmu_of_another_version_is_refused(
    scenario: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = call(capsys, scenario, "--fmi", "3")
    assert code == 2 and "is an FMU of FMI 2.0, --fmi wants 3.0" in err
    assert_one_line(err)


def test_a_campaign_names_its_file(scenario: Path) -> None:
    file = scenario.parent / "decays.toml"
    file.write_text(TEXTS["CAMPAIGN"].format(scenario=scenario.name))
    table = rparm.run_campaign(file, output=scenario.parent / "results", workers=1)
    np.testing.assert_allclose(table["final(x)"], 2.0 * np.exp(-2.0 * table["k"]), rtol=1e-8)


def test_new_writes_one(scenario: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = scenario.parent / "new.toml"
    assert call(capsys, "new", path, "--model", fmu_of(scenario))[0] == 0
    assert 'fmu = "../dahlquist/Dahlquist.fmu"' in path.read_text(encoding="utf-8")
    assert rparm.Scenario(path).run()["x"][-1] == pytest.approx(np.exp(-10.0), rel=1e-6)
