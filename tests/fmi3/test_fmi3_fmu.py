"""The built FMUs of FMI 3.0 as their importers see them: archive, binary, model description."""

import re
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import pytest

from tests.support.rparm_project import FMUS

MODELS = list(FMUS)


@pytest.fixture(scope="module", params=MODELS)
def path(request: pytest.FixtureRequest) -> Path:
    """Each FMU of FMI 3.0."""
    of_fmi2 = FMUS[request.param]
    return of_fmi2.parent / "fmi3" / of_fmi2.name


@pytest.fixture(scope="module")
def root(path: Path) -> ET.Element:
    """Its model description."""
    with zipfile.ZipFile(path) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


@pytest.fixture(scope="module")
def fmi2_root(path: Path) -> ET.Element:
    """The model description of the FMU of FMI 2.0."""
    with zipfile.ZipFile(path.parents[1] / path.name) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


def variables(root: ET.Element) -> dict[str, ET.Element]:
    return {v.get("name", ""): v for v in root.find("ModelVariables")}


def test_the_archive_holds_what_importers_look_for(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        entries = {info.filename: info for info in archive.infolist()}
    # extra/ is tested in test_references.py; the pictures are those on the page
    pictures = {n for n in entries if re.fullmatch(r"documentation/[^/]+\.(svg|png)", n)}
    assert {n for n in entries if n not in pictures and not n.startswith("extra/")} == {
        f"binaries/x86_64-linux/{path.stem}.so",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "documentation/licenses/musl.txt",
        "documentation/licenses/sundials.txt",
        "modelDescription.xml",
        "terminalsAndIcons/icon.png",
        "terminalsAndIcons/terminalsAndIcons.xml",
    }
    assert {info.date_time for info in entries.values()} == {(1980, 1, 1, 0, 0, 0)}


def test_variables_are_those_of_fmi_2(root: ET.Element, fmi2_root: ET.Element) -> None:
    """But for the aliases that FMI 2.0 needs."""
    types = {
        "Real": "Float64",
        "Integer": "Int32",
        "Enumeration": "Enumeration",
        "Boolean": "Boolean",
    }
    expected = {
        name: variable
        for name, variable in variables(fmi2_root).items()
        if not name.startswith("der_")
    }
    assert [*variables(root)] == [*expected]
    for name, variable in variables(root).items():
        old = expected[name]
        assert variable.tag == types[old[0].tag]
        for key in ("valueReference", "description", "causality", "variability", "initial"):
            assert variable.get(key) == old.get(key), (name, key)
        for key in ("start", "min", "max"):
            assert variable.get(key) == old[0].get(key), (name, key)


def test_units_stand_in_types(root: ET.Element, fmi2_root: ET.Element) -> None:
    """Importers refuse them on variables; every type is used."""
    types = {t.get("name"): t for t in root.find("TypeDefinitions")}
    used = set()
    for name, variable in variables(root).items():
        assert not set(variable.attrib) & {"unit", "displayUnit", "nominal", "quantity"}
        if variable.tag in ("Int32", "Boolean"):
            continue
        declared = types[variable.get("declaredType")]
        used.add(variable.get("declaredType"))
        for key in ("unit", "displayUnit", "nominal"):
            assert declared.get(key) == variables(fmi2_root)[name][0].get(key), (name, key)
    assert used == set(types)
    assert not set(types) & set(variables(root))


def test_states_and_derivatives(root: ET.Element) -> None:
    """`derivative` is a value reference; the derivatives stand in the order of the states."""
    by_reference = {v.get("valueReference"): v for v in variables(root).values()}
    derivatives = [e.get("valueReference") for e in root.iter("ContinuousStateDerivative")]
    states = [by_reference[reference].get("derivative") for reference in derivatives]
    assert None not in states
    assert states == sorted(states, key=int)
    with_derivative = {v.get("derivative") for v in variables(root).values()} - {None}
    assert with_derivative == set(states)


def test_outputs_and_initial_unknowns(root: ET.Element) -> None:
    names = {v.get("valueReference"): n for n, v in variables(root).items()}
    outputs = [n for n, v in variables(root).items() if v.get("causality") == "output"]
    assert [names[e.get("valueReference")] for e in root.iter("Output")] == outputs
    for element in root.iter("InitialUnknown"):
        assert variables(root)[names[element.get("valueReference")]].get("initial") == "calculated"


def test_intermediate_updates_are_of_continuous_inputs_and_outputs(root: ET.Element) -> None:
    for name, variable in variables(root).items():
        expected = (
            variable.tag == "Float64"
            and variable.get("causality") in ("input", "output")
            and variable.get("variability") == "continuous"
        )
        assert (variable.get("intermediateUpdate") == "true") == expected, name


def test_the_token_is_not_the_guid(root: ET.Element, fmi2_root: ET.Element) -> None:
    assert root.get("instantiationToken") != fmi2_root.get("guid")
