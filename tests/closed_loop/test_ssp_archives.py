"""What holds for the SSP of every system, with FMUs of either version of FMI."""

import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from rparm import project
from rparm.project import VERSIONS
from rparm.systems import ssp
from rparm.systems.ssp import NAMESPACES
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fmu"))
import package  # noqa: E402

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
STRUCTURE = "SystemStructure.ssd"
KINDS = {".ssd": "SystemStructureDescription.xsd", ".ssv": "SystemStructureParameterValues.xsd"}


@pytest.fixture(scope="module", params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module", params=project.systems())
def archive(request: pytest.FixtureRequest, version: str) -> Path:
    return project.built(project.systems()[request.param], ".ssp", version=version)


def test_there_are_systems() -> None:
    assert {"closed_loop", "machine"} <= set(project.systems())


def test_files_are_valid_against_the_schemas(archive: Path) -> None:
    found = []
    with zipfile.ZipFile(archive) as files:
        for name in files.namelist():
            if Path(name).suffix in KINDS:
                schema = etree.XMLSchema(etree.parse(SCHEMAS / KINDS[Path(name).suffix]))
                schema.assertValid(etree.fromstring(files.read(name)).getroottree())
                found.append(name)
    with ssp.unpacked(archive) as opened:
        sets = opened.system.parameters
        assert len(sets) > 1
        assert len(found) == 1 + sum(map(len, sets.values()))


def test_the_archive_depends_on_its_contents_alone(archive: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(archive) as files:
        files.extractall(tmp_path / "files")
        names = files.namelist()
    again = tmp_path / "again.ssp"
    package.pack(again, [(name, tmp_path / "files" / name) for name in reversed(names)])
    assert again.read_bytes() == archive.read_bytes()


def test_it_has_the_fmus_beside_it(archive: Path, version: str) -> None:
    with ssp.unpacked(archive) as opened:
        for component in opened.system.components:
            built = archive.parent / Path(component.source).name
            assert opened.fmu(component.name).read_bytes() == built.read_bytes()
            assert opened.models[component.name].fmi_version == version
            # the model, and not only the file, has that name
            assert component.source == f"resources/{opened.models[component.name].name}.fmu"


def test_units_that_are_used_are_defined(archive: Path) -> None:
    with zipfile.ZipFile(archive) as files:
        for name in files.namelist():
            if name.endswith((".ssd", ".ssv")):
                root = etree.fromstring(files.read(name))
                used = set(root.xpath("//@unit"))
                defined = root.xpath("//ssc:Unit/@name", namespaces=NAMESPACES)
                assert set(defined) == used, name
                assert len(defined) == len(used)


def test_units_are_those_of_the_fmus(archive: Path) -> None:
    """Exponents of the SI base units, as the model descriptions define them."""
    bases = ("kg", "m", "s", "A", "rad")
    with ssp.unpacked(archive) as opened:
        for component in opened.models:
            description = fmpy.read_model_description(opened.fmu(component))
            units = {u.name: u.baseUnit for u in description.unitDefinitions}
            files = [opened.folder / STRUCTURE]
            files += sorted((opened.folder / "resources").glob(f"{component}_*.ssv"))
            assert len(files) > 1
            for path in files:
                for unit in etree.parse(path).iterfind(".//ssc:Unit", NAMESPACES):
                    if unit.get("name") in units:
                        wanted = [getattr(units[unit.get("name")], b) or 0 for b in bases]
                        given = [int(unit[0].get(b, 0)) for b in bases]
                        assert given == [int(x) for x in wanted], (path.name, unit.get("name"))


def test_omsimulator_finds_what_it_needs(archive: Path) -> None:
    """The type of each component, and its own annotation with the step that the others take too."""
    with ssp.unpacked(archive) as opened:
        step, count = opened.system.step, len(opened.system.components)
        root = etree.parse(opened.folder / STRUCTURE).getroot()
    types = [node.get("type") for node in root.iterfind(".//ssd:Component", NAMESPACES)]
    assert types == ["application/x-fmu-sharedlibrary"] * count
    system = root.find("ssd:System", NAMESPACES)
    assert system is not None
    assert system[-1].tag.endswith("}Annotations")
    masters = root.xpath(
        "//ssc:Annotation[@type='org.openmodelica']//*[local-name()='FixedStepMaster']",
        namespaces=NAMESPACES,
    )
    assert [float(master.get("stepSize")) for master in masters] == [step]


def test_every_importer_gets_a_whole_variant(archive: Path) -> None:
    """The first set, as libcosim reads it, is that of the first variant; so is what is left where
    all sets apply in turn, as the standard has it; in any order the last one gives all values."""
    with ssp.unpacked(archive) as opened:
        first, components = next(iter(opened.system.parameters)), list(opened.models)
        folder = opened.folder
        root = etree.parse(folder / STRUCTURE).getroot()
        for component in components:
            path = f".//ssd:Component[@name='{component}']//ssd:ParameterBinding"
            sources = [node.get("source") for node in root.iterfind(path, NAMESPACES)]
            assert sources[0] == sources[-1] == f"resources/{component}_{first}.ssv"
            names = [
                etree.parse(folder / source).xpath("//ssv:Parameter/@name", namespaces=NAMESPACES)
                for source in sources
            ]
            assert all(x == names[0] for x in names)
