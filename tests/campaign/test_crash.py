"""A run that takes its worker down is a row that says so, and the others are as without it."""

import subprocess
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest

from rparm import __main__ as cli
from rparm.campaign import cluster, engine
from tests.campaign.files import HEAD
from tests.campaign.runners import engine_of
from tests.support.paths import ROOT

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Crashing" guid="0">
  <CoSimulation modelIdentifier="Crashing" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="1" causality="parameter" variability="fixed">
      <Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="2" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""
SCENARIO = 'title = "A"\ndescription = "B"\ntolerance = 1e-6\n'
SCENARIO += "[time]\nstart = 0.0\nstop = 1.0\nstep = 0.1\n"
CAMPAIGN = HEAD + (
    'scenario = "toy"\nsampling = "grid"\nblock = 3\n'
    "[parameters.x]\nvalues = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]\n[keep]\nfinal = ['y']\n"
)


@pytest.fixture
def crashing(tmp_path: Path) -> Path:
    """The FMU, compiled."""
    library = tmp_path / "Crashing.so"
    source = ROOT / "tests" / "campaign" / "crashing.c"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-isystem", headers]
    subprocess.run(["gcc", *map(str, flags), str(source), "-o", str(library)], check=True)
    path = tmp_path / "Crashing.fmu"
    with ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{fmpy.platform}/Crashing.so")
    return path


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A campaign whose run 3 crashes."""
    scenario = tmp_path / "models" / "crashing" / "scenarios" / "toy.toml"
    scenario.parent.mkdir(parents=True)
    scenario.write_text(SCENARIO)
    monkeypatch.setattr("rparm.project.ROOT", tmp_path)
    path = tmp_path / "test.toml"
    path.write_text(CAMPAIGN)
    return path


def test_a_run_that_takes_its_worker_down(
    crashing: Path, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(cluster.SETTINGS, "distributed.scheduler.allowed-failures", 1)
    with (
        cluster.opened(None, 1, tmp_path / "workers") as client,
        engine_of(client, file, tmp_path / "output", crashing) as (made, results),
    ):
        made.run(range(3), lambda _: None)
    table = results.table(["final(y)", "failure"])
    assert table["failure"].tolist() == ["", "", "", engine.DIED, "", "", "", ""]
    expected = np.arange(8.0)
    expected[3] = np.nan
    assert np.array_equal(table["final(y)"], expected, equal_nan=True)


def test_its_replay_ends_with_a_message(
    crashing: Path, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["campaign", str(file), "--fmu", str(crashing), "--output", str(file.parent / "o")]
    assert cli.main([*arguments, "--replay", "2"]) == 0
    assert "final(y) = 2.0" in capsys.readouterr().out.splitlines()
    assert cli.main([*arguments, "--replay", "3"]) == 1
    out = capsys.readouterr().out.splitlines()
    assert out == ["x = 3.0", "failed: the run takes its process down"]
