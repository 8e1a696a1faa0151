"""Systems in libcosim, which is installed in a separate environment."""

import json
import os
import re
import subprocess
from pathlib import Path

import numpy as np

from tests.importers.test_importers import folder_of
from tests.support.paths import ROOT
from tests.support.ssp_files import Edit

BINDING = re.compile(r'\s*<ssd:ParameterBinding source="resources/[a-z]+_(\w+)\.ssv"/>')


def only_variant(variant: str) -> Edit:
    """Edit of a structure that leaves the bindings of one variant: libcosim takes the first."""

    def edit(content: bytes) -> bytes:
        text = content.decode()
        assert len(set(BINDING.findall(text)) - {variant}) == len(set(BINDING.findall(text))) - 1
        return BINDING.sub(lambda m: m[0] if m[1] == variant else "", text).encode()

    return edit


def libcosim(path: Path, names: list[str], steps: int, folder: Path) -> dict[str, np.ndarray]:
    """Values by name, read after each step; no row of the start."""
    python = folder_of("osp") / "bin" / "python"
    driver = ROOT / "tests" / "importers" / "run_osp_system.py"
    plan, result = folder / "names.json", folder / "rows.json"
    plan.write_text(json.dumps(names), encoding="utf-8")
    process = subprocess.run(
        [python, driver, path, plan, str(steps), result],
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=120,
        env=os.environ | {"TMPDIR": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert process.returncode == 0, process.stdout
    rows = np.array(json.loads(result.read_text(encoding="utf-8")))
    return dict(zip(names, rows.T, strict=True))
