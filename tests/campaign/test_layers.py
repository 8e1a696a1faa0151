"""Modules of rparm.campaign use each other in one direction; workers load only what they need."""

import ast
import re
import subprocess
import sys

import pytest

from rparm import campaign
from tests.campaign.cluster.processes import ENVIRONMENT
from tests.support.paths import ROOT

FOLDER = ROOT / "rparm" / "campaign"
LAYERS = [
    re.findall(r"\w+", line[4:34])
    for line in campaign.__doc__.splitlines()
    if line.startswith("    ")
]
MODULES = {path.stem for path in FOLDER.glob("*.py")} - {"__init__"}
PREFIX = "rparm.campaign"


def used(module: str) -> set[str]:
    """Modules of the folder that a module imports."""
    found = set()
    for node in ast.walk(ast.parse((FOLDER / f"{module}.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == PREFIX:
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module.startswith(f"{PREFIX}."):
            found.add(node.module.removeprefix(f"{PREFIX}."))
    return found


def test_every_module_has_a_layer() -> None:
    assert sorted(name for layer in LAYERS for name in layer) == sorted(MODULES)


@pytest.mark.parametrize("module", sorted(MODULES))
def test_a_module_uses_those_of_its_layer_and_above(module: str) -> None:
    number = next(i for i, layer in enumerate(LAYERS) if module in layer)
    below = {name for layer in LAYERS[number + 1 :] for name in layer}
    assert not used(module) & below


@pytest.mark.parametrize(
    ("code", "unneeded"),
    [
        (f"import {PREFIX}.worker", {"scipy.stats", "SALib", "matplotlib"}),
        (
            "from rparm.__main__ import main; main(['list']);"
            "import rparm.commands.run, rparm.commands.system, rparm.commands.coupling",
            {"dask", "distributed", "numba", "pyarrow", "SALib"},
        ),
    ],
    ids=["worker", "other commands"],
)
def test_what_is_not_needed_is_not_loaded(code: str, unneeded: set[str]) -> None:
    code = f"import sys\n{code}\nprint(*(set(sys.modules) & {unneeded}))"
    run = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, env=ENVIRONMENT
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == ""
