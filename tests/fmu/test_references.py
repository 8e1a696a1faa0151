"""Scenarios that the FMUs carry: the manifest, the files, and a check of an FMU by these only."""

import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from io import BytesIO, StringIO
from pathlib import Path

import fmpy
import numpy as np
import pytest
from lxml import etree

from tests.support.generator import change
from tests.support.instances import STATES, instantiated
from tests.support.paths import CARRIED, FOLDERS, ROOT
from tests.support.programs import run
from tests.support.rparm_project import BUILD
from tests.support.tables import tables

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = "fmi-ls-manifest.xml"
SCHEMAS = Path(fmpy.__file__).parent
MODELS = {name: (FOLDERS[name], scenarios) for name, scenarios in CARRIED.items()}
LS = "{http://fmi-standard.org/fmi-ls-manifest}"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
ERROR = 1e-6  # of each state's maximum, at the default tolerance


class Carried:
    """An FMU with the files that it carries."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.model = path.stem
        with zipfile.ZipFile(path) as archive:
            names = [n for n in archive.namelist() if n.startswith(f"{FOLDER}/")]
            self.files = {n.removeprefix(f"{FOLDER}/"): archive.read(n) for n in names}
        self.manifest = ET.fromstring(self.files[MANIFEST])

    def one(self, scenario: str, role: str) -> bytes:
        """The file of a scenario that has a role."""
        (source,) = (
            related.get("source")
            for related in self.manifest
            if related.get("role") == role and related.get("source").startswith(f"{scenario}/")
        )
        return self.files[source]

    def table(self, scenario: str, role: str) -> np.ndarray:
        text = StringIO(self.one(scenario, role).decode().replace('"', ""))
        return np.atleast_1d(np.genfromtxt(text, delimiter=",", names=True, deletechars=""))

    def options(self, scenario: str) -> dict[str, float]:
        lines = self.one(scenario, "configuration").decode().split()
        return {key: float(value) for key, value in (line.split(",") for line in lines)}

    def parameters(self, scenario: str) -> dict[str, ET.Element]:
        root = ET.fromstring(self.one(scenario, "parameter"))
        return {p.get("name"): p[0] for p in root.iter(f"{SSV}Parameter")}


@pytest.fixture(params=["fmi2", "fmi3"])
def folder(request: pytest.FixtureRequest, fmu: Path) -> Path:
    return fmu.parent if request.param == "fmi2" else fmu.parent / request.param


@pytest.fixture(params=MODELS)
def carried(request: pytest.FixtureRequest, folder: Path) -> Carried:
    return Carried(folder / f"{request.param}.fmu")


# ---- manifest and files --------------------------------------------------------------------------


def test_the_manifest_names_its_layered_standard(carried: Carried) -> None:
    assert carried.manifest.tag == "fmiReferences"
    assert carried.manifest.attrib == {
        f"{LS}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
        f"{LS}fmi-ls-version": "1.0.0-alpha.1",
        f"{LS}fmi-ls-description": "Layered Standard providing information on related files "
        "included in an FMU.",
    }
    # with the root that the standard proposes, since a schema of this one's is in no package
    root = etree.Element(f"{LS}fmiLayeredStandardManifest", carried.manifest.attrib)
    schema = SCHEMAS / "schema" / "fmi3" / "fmi3LayeredStandardManifest.xsd"
    etree.XMLSchema(etree.parse(schema)).assertValid(root)


def test_the_manifest_lists_each_file_once(carried: Carried) -> None:
    sources = [related.get("source") for related in carried.manifest]
    assert sorted(sources) == sorted({*carried.files} - {MANIFEST})
    _, scenarios = MODELS[carried.model]
    listed = {
        (r.get("source").split("/")[0], r.get("role"), r.get("type")) for r in carried.manifest
    }
    assert listed == {
        (scenario, role, kind)
        for scenario in scenarios
        for role, kind in (
            ("other", "text/csv"),
            ("result", "text/csv"),
            ("configuration", "text/csv"),
            ("parameter", "application/x-ssp-parameter-set"),
        )
    }
    for related in carried.manifest:
        assert related.tag == "Related" and related.get("description")
        assert set(related.attrib) == {"source", "role", "type", "description"}


def test_tables_are_those_of_the_project(carried: Carried) -> None:
    model, scenarios = MODELS[carried.model]
    for scenario in scenarios:
        references = ROOT / "models" / model / "references" / scenario
        for path in references.iterdir():
            assert carried.files[f"{scenario}/{path.name}"] == path.read_bytes()


def test_parameter_sets_follow_the_schema_and_the_variables(carried: Carried) -> None:
    schema = SCHEMAS / "ssp" / "schema" / "SystemStructureParameterValues.xsd"
    description = fmpy.read_model_description(str(carried.path))
    variables = {v.name: v for v in description.modelVariables}
    for scenario in MODELS[carried.model][1]:
        text = carried.one(scenario, "parameter")
        etree.XMLSchema(etree.parse(schema)).assertValid(etree.parse(BytesIO(text)))
        units = {u.get("name"): u[0].attrib for u in ET.fromstring(text).iter(f"{SSC}Unit")}
        for name, value in carried.parameters(scenario).items():
            variable = variables[name]
            assert variable.causality == "parameter" or variable.initial == "exact"
            unit = variable.unit or (variable.declaredType.unit if variable.declaredType else None)
            assert value.get("unit") == unit
            assert unit is None or unit in units


@pytest.mark.parametrize("scenario", MODELS["RPManipulator"][1])
def test_an_fmu_can_be_checked_by_what_it_carries(folder: Path, scenario: str) -> None:
    carried = Carried(folder / "RPManipulator.fmu")
    inputs, expected = carried.table(scenario, "other"), carried.table(scenario, "result")
    options = carried.options(scenario)
    values = {n: float(v.get("value")) for n, v in carried.parameters(scenario).items()}
    assert values and inputs["time"][0] == options["StartTime"]
    assert inputs["time"][-1] == options["StopTime"]

    times, names = inputs["time"], [n for n in inputs.dtype.names if n != "time"]
    held = [{name: float(row[name]) for name in names} for row in inputs]
    with instantiated(carried.path, "CoSimulation") as (arm, description):
        references = {v.name: v.valueReference for v in description.modelVariables}
        is_fmi2, begin = description.fmiVersion == "2.0", {"startTime": options["StartTime"]}
        put, get = (arm.setReal, arm.getReal) if is_fmi2 else (arm.setFloat64, arm.getFloat64)
        states = [references[name] for name in STATES]
        if is_fmi2:
            arm.setupExperiment(**begin)
        for given in (values, held[0]):
            put([references[name] for name in given], [*given.values()])
        arm.enterInitializationMode(**({} if is_fmi2 else begin))
        arm.exitInitializationMode()
        rows = [get(states)]
        for i in range(len(times) - 1):
            put([references[name] for name in names], [*held[i].values()])
            arm.doStep(times[i], times[i + 1] - times[i])
            rows.append(get(states))
    for name, reached in zip(STATES, np.transpose(rows), strict=True):
        error = np.abs(reached - expected[name]).max() / np.abs(expected[name]).max()
        assert error <= ERROR, name


# ---- what cannot be carried ----------------------------------------------------------------------


def collect(model: Path, output: Path, *names: str) -> subprocess.CompletedProcess[str]:
    """Collect the scenarios of a copy of the controller as the build does."""
    program = ROOT / "fmu" / "references.py"
    description = BUILD / "fmu" / "RPController" / "modelDescription.xml"
    return run(sys.executable, program, description, *names, "--folder", model, "--output", output)


@pytest.fixture
def controller(tmp_path: Path) -> Path:
    """A copy of the controller's folder, with one scenario and its reference."""
    model = ROOT / "models" / "rp_controller"
    scenario = Path("scenarios") / "controller_pd_gravity.toml"
    reference = Path("references") / "controller_pd_gravity"
    (tmp_path / "scenarios").mkdir()
    shutil.copy(model / scenario, tmp_path / scenario)
    shutil.copytree(model / reference, tmp_path / reference)
    return tmp_path


def test_a_copy_is_collected(controller: Path, tmp_path: Path) -> None:
    result = collect(controller, tmp_path / "out", "controller_pd_gravity")
    assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "out" / MANIFEST).is_file()


@pytest.mark.parametrize(
    ("old", "new", "words"), tables(str(Path(__file__).with_name("mistakes")))["references"]["rows"]
)
def test_a_wrong_scenario_is_named(
    controller: Path, tmp_path: Path, old: str, new: str, words: str
) -> None:
    scenario = controller / "scenarios" / "controller_pd_gravity.toml"
    change(scenario, old, new)
    result = collect(controller, tmp_path / "out", "controller_pd_gravity")
    assert result.returncode == 2
    assert result.stderr.startswith(f"references.py: {scenario}: ") and words in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("missing", ["scenarios", "references"])
def test_what_is_missing_is_named(controller: Path, tmp_path: Path, missing: str) -> None:
    shutil.rmtree(controller / missing)
    result = collect(controller, tmp_path / "out", "controller_pd_gravity")
    assert result.returncode == 2
    assert result.stderr.startswith(f"references.py: {controller / missing}")
    assert result.stderr.endswith(": cannot be read: No such file or directory\n")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
