"""The page of the example models: a run of each is drawn, of FMUs that the program builds."""

import os
import subprocess
import sys
from pathlib import Path

from tests.support.paths import ROOT

EXAMPLES = ROOT / "examples"


def test_a_run_of_each_model_is_drawn(tmp_path: Path) -> None:
    picture = tmp_path / "models.png"
    ran = subprocess.run(
        [sys.executable, EXAMPLES / "models" / "draw.py", picture],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, text=True, capture_output=True,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    files = {file.name.partition(".")[0] for file in (EXAMPLES / "models").glob("*.toml")}
    assert {line.partition(":")[0] for line in ran.stdout.splitlines()} == files
    assert picture.read_bytes().startswith(b"\x89PNG") and [*tmp_path.iterdir()] == [picture]
