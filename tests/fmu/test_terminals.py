"""terminalsAndIcons.xml of the FMUs of FMI 3.0, and that equal members are what the closed loop
connects."""

import struct
import tomllib
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from tests.support.generator import WHEEL, generate, wheel_in
from tests.support.paths import NAMES, ROOT

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"
FILE = "terminalsAndIcons/terminalsAndIcons.xml"
ICON = "terminalsAndIcons/icon.png"
COMPONENTS = {"arm": "RPManipulator", "controller": "RPController", "trajectory": "RPTrajectory"}
LOOP = ROOT / "models" / "closed_loop" / "loop.toml"

# matching rule of a terminal, kind and causality of its members
KINDS = {
    ("plug", "signal", "input"), ("plug", "signal", "output"), ("none", "signal", "output"),
    ("plug", "inflow", "input"), ("plug", "outflow", "output"),
}  # fmt: skip
# a connection without terminals: of the payload, and of no joint
PAYLOAD = ("trajectory", "payload_attached", "controller", "payload_attached")


def path_of(fmu: Path, component: str) -> Path:
    return fmu.parent / "fmi3" / f"{COMPONENTS[component]}.fmu"


def by_path(parent: ET.Element, above: str = "") -> dict[str, ET.Element]:
    """All terminals, also nested ones."""
    found = {}
    for terminal in parent.iterfind("Terminal"):
        path = above + terminal.get("name")
        assert path not in found
        found |= {path: terminal} | by_path(terminal, f"{path}.")
    return found


def described(fmu: Path) -> tuple[dict[str, ET.Element], dict[str, str]]:
    """Terminals by path, for example arm.joint1; causality of all variables."""
    with zipfile.ZipFile(fmu) as archive:
        terminals = ET.fromstring(archive.read(FILE)).find("Terminals")
    variables = fmpy.read_model_description(str(fmu)).modelVariables
    return by_path(terminals), {v.name: v.causality for v in variables}


@pytest.fixture(params=COMPONENTS)
def component(request: pytest.FixtureRequest) -> str:
    return request.param


# ---- what is in the FMUs -------------------------------------------------------------------------


def test_the_file_follows_the_schema(fmu: Path, component: str) -> None:
    with zipfile.ZipFile(path_of(fmu, component)) as archive:
        document = etree.fromstring(archive.read(FILE))
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(document)
    assert document.get("fmiVersion") == "3.0"


def test_the_icon_keeps_its_shape(fmu: Path, component: str) -> None:
    with zipfile.ZipFile(path_of(fmu, component)) as archive:
        icon, document = archive.read(ICON), ET.fromstring(archive.read(FILE))
    assert icon.startswith(b"\x89PNG")
    width, height = struct.unpack(">II", icon[16:24])
    graphics = document.find("GraphicalRepresentation")
    for element in ("CoordinateSystem", "Icon"):
        x1, y1, x2, y2 = (
            float(graphics.find(element).get(key)) for key in ("x1", "y1", "x2", "y2")
        )
        assert (y2 - y1) / (x2 - x1) == pytest.approx(height / width, rel=1e-12)
        assert (x1, y1) == (-x2, -y2)


def test_terminals_of_the_same_name_connect_the_closed_loop(fmu: Path) -> None:
    ends: dict[tuple[str, str], list[tuple[str, str, str]]] = {}
    found = set()
    for component in COMPONENTS:
        terminals, causality = described(path_of(fmu, component))
        for path, terminal in terminals.items():
            for member in terminal.iterfind("TerminalMemberVariable"):
                variable, rule = member.get("variableName"), terminal.get("matchingRule")
                found.add((rule, member.get("variableKind"), causality[variable]))
                if rule == "plug":
                    end = (causality[variable], component, variable)
                    ends.setdefault((path, member.get("memberName")), []).append(end)
    assert found == KINDS
    connections = set()
    for pair in ends.values():
        (first, *source), (second, *target) = sorted(pair, reverse=True)
        assert (first, second) == ("output", "input")
        connections.add((*source, *target))
    connections.add(PAYLOAD)
    pairs = tomllib.loads(LOOP.read_text())["connections"].items()
    assert connections == {(*start.split("."), *end.split(".")) for end, start in pairs}


@pytest.mark.parametrize("name", NAMES)
def test_importers_of_fmi_2_need_not_refuse_it(fmu: Path, name: str) -> None:
    """FMI Library reads the file and refuses the version that the standard asks for."""
    with zipfile.ZipFile(fmu.with_name(f"{name}.fmu")) as archive:
        names = archive.namelist()
    assert "model.png" in names
    assert not [entry for entry in names if entry.startswith("terminalsAndIcons/")]


# ---- what the generator does ---------------------------------------------------------------------


TERMINAL = """
[terminals.axle]
rule = "bus"
description = "Axle"
signals = { angle = "angle" }
"""


def generated_file(file: Path, output: Path, *options: str | Path) -> ET.Element:
    result = generate(file, output, *options)
    assert result.returncode == 0, result.stderr
    return ET.parse(output / "terminalsAndIcons.xml").getroot()


def test_a_model_without_picture_has_no_icon(tmp_path: Path) -> None:
    wheel = wheel_in(tmp_path)
    wheel.write_text(wheel.read_text() + TERMINAL)
    assert [child.tag for child in generated_file(wheel, tmp_path)] == ["Terminals"]


def test_a_model_without_terminals_has_an_icon_only(tmp_path: Path) -> None:
    icon = ROOT / "models" / "rp_manipulator" / "model.png"
    document = generated_file(WHEEL, tmp_path, "--icon", icon)
    assert [child.tag for child in document] == ["GraphicalRepresentation"]
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(etree.fromstring(ET.tostring(document)))


@pytest.mark.parametrize("content", [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n\0\0"])
def test_a_picture_that_is_no_png_is_named(tmp_path: Path, content: bytes) -> None:
    icon = tmp_path / "model.png"
    icon.write_bytes(content)
    result = generate(WHEEL, tmp_path / "out", "--icon", icon)
    assert result.returncode == 2
    assert result.stderr == f"generate.py: {icon}: is not a PNG file\n"
