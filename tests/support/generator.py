"""Runs the generator as the build does, on the declarations of the models and on changed copies."""

import os
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

from tests.support.paths import ROOT

VARIABLES = ROOT / "models" / "rp_manipulator" / "variables.toml"


def generate(
    variables: Path, output: Path, *options: str | Path, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the generator as the build does."""
    command = [sys.executable, ROOT / "fmu" / "generate.py", variables, "--output", output]
    command += options
    kept = {key: value for key, value in os.environ.items() if key != "SOURCE_DATE_EPOCH"}
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=kept | environment
    )


def generated(
    variables: Path, output: Path, *options: str | Path, **environment: str
) -> ET.Element:
    """Run the generator and parse the model description."""
    result = generate(variables, output, *options, **environment)
    assert result.returncode == 0, result.stderr
    return ET.parse(output / "modelDescription.xml").getroot()


def copied(model: str, to: Path, below: str = "models") -> Path:
    """Copy what the generator reads for a model, to be changed; the path of its variables.toml."""
    (to / "src" / "instance").mkdir(parents=True)
    for shared in (ROOT / "src" / "instance").glob("*.toml"):
        shutil.copy(shared, to / "src" / "instance")
    for declaration in (
        *ROOT.glob("models/*/variables.toml"),
        ROOT / below / model / "variables.toml",
    ):
        copy = to / declaration.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(declaration, copy)
    return to / below / model / "variables.toml"


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
