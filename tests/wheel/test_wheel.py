"""The wheel's FMUs in fmpy: their descriptions, and runs in which a Boolean input switches."""

import os
import xml.etree.ElementTree as ET
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from tests.support.paths import ROOT

FOLDER = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent
FMUS = {
    "fmi2": FOLDER / "tests" / "wheel" / "Wheel.fmu",
    "fmi3": FOLDER / "tests" / "wheel" / "fmi3" / "Wheel.fmu",
}
SPEED = 7.0  # rad/s

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


@both_versions
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_an_integer_counts_while_a_boolean_input_says_so(version: str, kind: str) -> None:
    switches = [(0.0, True), (2.0, True), (2.0, False), (4.0, False), (4.0, True), (6.0, True)]
    inputs = np.array(
        [(time, SPEED, counting) for time, counting in switches],
        dtype=[("time", float), ("speed", float), ("is_counting", bool)],
    )
    result = fmpy.simulate_fmu(
        str(FMUS[version]),
        fmi_type=kind,
        solver="Euler",  # exact here; fmpy's CVode sets Booleans in continuous-time mode
        step_size=0.5,
        stop_time=6.0,
        output_interval=0.5,
        input=inputs,
        output=["angle", "turns", "is_turning", "is_counting"],
    )
    np.testing.assert_allclose(result["angle"], SPEED * result["time"], rtol=0, atol=1e-5)
    counting = result["is_counting"].astype(bool)
    assert counting.any() and not counting.all()
    expected = np.where(counting, np.floor(result["angle"] / (2 * np.pi)), 0)
    np.testing.assert_array_equal(result["turns"], expected)
    assert len(set(expected)) > 4
    assert result["is_turning"][1:].all()


def test_early_return_is_announced_with_events_only(fmu: Path) -> None:
    flags = {}
    for path in FMUS["fmi3"], fmu.parent / "fmi3" / fmu.name:
        with ZipFile(path) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
        kind = root.find("CoSimulation")
        assert kind.get("hasEventMode") == "true"
        flags[root.get("modelName")] = kind.get("mightReturnEarlyFromDoStep")
    assert flags == {"Wheel": "true", "RPManipulator": None}
