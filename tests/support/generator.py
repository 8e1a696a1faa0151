"""Runs the generator as the build does, on files of models and on changed copies."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

from tests.support.paths import ROOT

ARM = ROOT / "models" / "rp_manipulator" / "rp_manipulator.toml"
WHEEL = ROOT / "tests" / "wheel" / "wheel.toml"  # by hand


def generate(
    file: Path, output: Path, *options: str | Path, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the generator as the build does."""
    command = [sys.executable, ROOT / "fmu" / "generate.py", file, "--output", output]
    command += ["--by-hand"] if file.name == WHEEL.name else []
    command += options
    kept = {key: value for key, value in os.environ.items() if key != "SOURCE_DATE_EPOCH"}
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=kept | environment
    )


def generated(file: Path, output: Path, *options: str | Path, **environment: str) -> ET.Element:
    """Run the generator and parse the model description."""
    result = generate(file, output, *options, **environment)
    assert result.returncode == 0, result.stderr
    return ET.parse(output / "modelDescription.xml").getroot()


def wheel_in(folder: Path) -> Path:
    """Copy what the generator reads for the wheel, to be changed; the path of its file."""
    folder.mkdir(exist_ok=True)
    for suffix in (".lock.toml", ".h"):
        shutil.copy(WHEEL.with_suffix(suffix), folder)
    return Path(shutil.copy(WHEEL, folder))


def change(path: Path, old: str, new: str) -> None:
    """Replace the first `old` in a file."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def scalars(root: ET.Element) -> dict[str, ET.Element]:
    """Map the name of each variable to its element."""
    return {v.get("name", ""): v for v in root.iterfind("ModelVariables/ScalarVariable")}


def unknowns(root: ET.Element, section: str) -> list[str]:
    """Names of the variables in a section of the model structure."""
    names = list(scalars(root))
    return [
        names[int(u.get("index")) - 1] for u in root.iterfind(f"ModelStructure/{section}/Unknown")
    ]
