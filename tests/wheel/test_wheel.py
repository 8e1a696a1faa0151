"""Descriptions of the wheel's FMUs. Runs in which its Boolean input switches:
tests/rparm/test_boolean_inputs.py."""

import os
import xml.etree.ElementTree as ET
from pathlib import Path
from zipfile import ZipFile

import pytest
from fmpy.validation import validate_fmu

from tests.support.paths import ROOT

FOLDER = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent
FMUS = {
    "fmi2": FOLDER / "tests" / "wheel" / "Wheel.fmu",
    "fmi3": FOLDER / "tests" / "wheel" / "fmi3" / "Wheel.fmu",
}

both_versions = pytest.mark.parametrize("version", ["fmi2", "fmi3"])


def described(version: str) -> ET.Element:
    with ZipFile(FMUS[version]) as archive:
        return ET.fromstring(archive.read("modelDescription.xml"))


@both_versions
def test_fmpy_finds_no_problem(version: str) -> None:
    assert validate_fmu(str(FMUS[version])) == []


@both_versions
def test_variables(version: str) -> None:
    variables = {v.get("name"): v for v in described(version).find("ModelVariables")}
    types = variables if version == "fmi3" else {name: v[0] for name, v in variables.items()}
    booleans = {
        name: (v.get("causality"), v.get("variability"), v.get("initial"), types[name].get("start"))
        for name, v in variables.items()
        if types[name].tag == "Boolean"
    }
    assert booleans == {
        "is_reversed": ("parameter", "tunable", "exact", "false"),
        "is_counting": ("input", "discrete", None, "true"),
        "is_turning": ("output", "discrete", "calculated", None),
        "is_caught": ("output", "discrete", "calculated", None),
    }
    assert types["turns"].tag == {"fmi2": "Integer", "fmi3": "Int32"}[version]
    assert variables["lost_speed"].get("variability") == "discrete"
    assert [name for name, type_ in types.items() if type_.get("reinit") == "true"] == ["angle"]


def test_what_only_one_version_has() -> None:
    root = described("fmi3")
    assert described("fmi2").get("numberOfEventIndicators") == "2"
    updated = [v.get("name") for v in root.find("ModelVariables") if v.get("intermediateUpdate")]
    assert updated == ["angle", "rate", "speed"]
    indicators = [e.attrib for e in root.iterfind("ModelStructure/EventIndicator")]
    assert indicators == [
        {"valueReference": "50", "dependencies": "1 10"},  # to_stop: stop, angle
        {"valueReference": "51", "dependencies": "1 20"},  # push: stop, speed
    ]


def test_early_return_is_announced_with_events_only(fmu: Path) -> None:
    flags = {}
    for path in FMUS["fmi3"], fmu.parent / "fmi3" / fmu.name:
        with ZipFile(path) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
        kind = root.find("CoSimulation")
        assert kind.get("hasEventMode") == "true"
        flags[root.get("modelName")] = kind.get("mightReturnEarlyFromDoStep")
    assert flags == {"Wheel": "true", "RPManipulator": None}
