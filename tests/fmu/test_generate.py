"""The generator: what it writes, and that a variable is declared in one place."""

import os
import xml.etree.ElementTree as ET
import zipfile
from datetime import datetime
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from tests.support.generator import ARM, WHEEL, generate, generated, scalars, unknowns
from tests.support.paths import NAMES, ROOT
from tests.support.tables import tables

TABLES = tables(str(Path(__file__).with_name("mistakes")))["generate"]


@pytest.fixture(scope="module")
def description(tmp_path_factory: pytest.TempPathFactory) -> ET.Element:
    """Model description of the manipulator."""
    return generated(ARM, tmp_path_factory.mktemp("generated"))


def test_the_published_interface_stays(description: ET.Element) -> None:
    """Of others, none has a start value or a bound."""
    found = {}
    for name, v in scalars(description).items():
        numbers = [float(v[0].get(key)) for key in ("start", "min") if key in v[0].attrib]
        found[name] = [v.get("valueReference"), v.get("causality"), v[0].get("unit", "-"), *numbers]
    assert found | TABLES["published"] == found
    assert all(len(found[name]) == 3 for name in found.keys() - TABLES["published"])


def test_flags_are_those_that_work(description: ET.Element) -> None:
    flags = TABLES["flags"]
    assert description.find("ModelExchange").attrib == flags["of_both"]
    assert description.find("CoSimulation").attrib == flags["of_both"] | flags["of_co_simulation"]


@pytest.mark.parametrize("name", NAMES)
def test_each_state_has_one_derivative(fmu: Path, name: str) -> None:
    """The one in Derivatives, an initial unknown: fmi4c counts the attributes."""
    with zipfile.ZipFile(fmu.with_name(f"{name}.fmu")) as archive:
        description = ET.fromstring(archive.read("modelDescription.xml"))
    states = {n: v[0].get("derivative") for n, v in scalars(description).items()}
    states = {name: state for name, state in states.items() if state is not None}
    listed = unknowns(description, "Derivatives")
    assert set(listed) == set(states)
    assert len(listed) == len(set(states.values()))
    assert set(listed) <= set(unknowns(description, "InitialUnknowns"))


def test_states_that_are_derivatives_have_aliases(description: ET.Element) -> None:
    """Importers expect each of Derivatives among InitialUnknowns, where no state may be."""
    variables = scalars(description)
    for alias, state in (("der_q1", "dq1"), ("der_q2", "dq2")):
        wanted = dict(variables[state][0].attrib)
        assert wanted.pop("start") == "0.0"
        wanted["derivative"] = str([*variables].index(alias.replace("der_", "")) + 1)
        assert variables[alias][0].attrib == wanted
        assert variables[alias].get("valueReference") == variables[state].get("valueReference")
        assert variables[alias].get("causality") == "local"
        assert variables[alias].get("initial") == "calculated"
    references = [v.get("valueReference") for v in variables.values()]
    assert len(references) - len(set(references)) == 2


def test_units_are_defined_and_angles_have_degrees(description: ET.Element) -> None:
    units = {u.get("name"): u for u in description.iterfind("UnitDefinitions/Unit")}
    for variable in scalars(description).values():
        unit = variable[0].get("unit")
        assert unit is None or units[unit].find("BaseUnit") is not None
    assert units["W"].find("BaseUnit").attrib == {"kg": "1", "m": "2", "s": "-3"}
    degree = units["rad"].find("DisplayUnit")
    assert degree.get("name") == "deg"
    assert float(degree.get("factor")) * 3.141592653589793 == pytest.approx(180, rel=1e-15)
    assert scalars(description)["q1"][0].get("displayUnit") == "deg"


def test_where_the_fmu_comes_from(tmp_path: Path) -> None:
    root = generated(WHEEL, tmp_path, "--version", "1.2.3", "--license", ROOT / "LICENSE")
    assert root.get("version") == "1.2.3"
    assert root.get("generationTool") == "Wheel 1.2.3"
    assert root.get("license") == "BSD-3-Clause"
    notice = root.get("copyright", "")
    assert notice in (ROOT / "LICENSE").read_text().splitlines()
    assert notice.endswith(f", {root.get('author')}")
    assert "generationDateAndTime" not in root.attrib


def test_the_date_is_that_of_the_sources(tmp_path: Path) -> None:
    dated = generated(WHEEL, tmp_path, SOURCE_DATE_EPOCH="1700000000")
    assert dated.get("generationDateAndTime") == "2023-11-14T22:13:20+00:00"
    schema = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"
    etree.XMLSchema(file=schema).assertValid(etree.parse(tmp_path / "modelDescription.xml"))


@pytest.mark.parametrize(
    ("license_text", "epoch", "message"),
    [(None, "", "LICENSE: cannot be read"), *TABLES["origins"]],
)
def test_a_wrong_origin_is_named(
    tmp_path: Path, license_text: str | None, epoch: str, message: str
) -> None:
    if license_text is not None:
        (tmp_path / "LICENSE").write_text(license_text)
    options = ("--license", tmp_path / "LICENSE")
    result = generate(WHEEL, tmp_path / "out", *options, SOURCE_DATE_EPOCH=epoch)
    assert result.returncode == 2
    assert result.stderr.startswith("generate.py: ") and result.stderr.count("\n") == 1
    assert message in result.stderr


def test_generated_files_in_the_build_are_fresh(fmu: Path, tmp_path: Path) -> None:
    built = fmu.parent / "fmu" / "RPManipulator"
    root = ET.parse(built / "modelDescription.xml").getroot()
    date = root.get("generationDateAndTime")
    epoch = str(int(datetime.fromisoformat(date).timestamp())) if date else ""
    options = ("--version", root.get("version", ""), "--license", ROOT / "LICENSE")
    options += ("--icon", ARM.with_name("model.png"))
    generated(ARM, tmp_path, *options, SOURCE_DATE_EPOCH=epoch)
    names = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()}
    assert len(names) == 8
    for name in names:
        assert (built / name).read_text() == (tmp_path / name).read_text()


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes everywhere")
def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    result = generate(WHEEL, tmp_path / "out")
    assert result.returncode == 2
    assert str(tmp_path) in result.stderr
