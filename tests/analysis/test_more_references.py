"""The references of a model are what the program writes into an empty folder, byte for byte."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.rparm_project import names_of


# those of the arm, the plant and the systems have tests of their own
@pytest.mark.parametrize("part", ["actuator", "controller", "environment", "sensor", "trajectory"])
def test_references_made_again_are_the_same(part: str, tmp_path: Path) -> None:
    kept = ROOT / "models" / f"rp_{part}" / "references"
    command = [sys.executable, ROOT / "models" / "make_references.py", f"rp_{part}"]
    subprocess.run([*command, "--output", tmp_path], check=True, cwd=tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == set(names_of(f"rp_{part}"))
    assert names == {path.parent.name for path in kept.glob("*/*_ref.csv")}
    for made in tmp_path.glob("*/*"):
        assert made.read_bytes() == (kept / made.relative_to(tmp_path)).read_bytes(), made
