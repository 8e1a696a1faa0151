"""The archives of the built FMUs of FMI 3.0, and where units stand in them. All else that their
model descriptions say: tests/models/test_published_interface.py."""

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


def test_units_stand_in_types(path: Path) -> None:
    """Importers refuse them on variables; every type is used."""
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    used = set()
    for variable in root.find("ModelVariables"):
        assert not set(variable.attrib) & {"unit", "displayUnit", "nominal", "quantity"}
        used.add(variable.get("declaredType"))
    assert used - {None} == {t.get("name") for t in root.find("TypeDefinitions")}
