"""The page of the format: its example is a model, its commands work."""

import re
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np

from tests.equations.compiled import Model, read_text
from tests.equations.examples import FOLDER, build, simulated
from tests.support.paths import ROOT

PAGE = (FOLDER / "README.md").read_text()
EXAMPLE = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[0]


def test_the_pendulum_swings(tmp_path: Path) -> None:
    """A small swing with damping and torque about its closed form."""
    (tmp_path / "pendulum.toml").write_text(EXAMPLE)
    fmu = build(tmp_path / "pendulum.toml", tmp_path)
    run = simulated(fmu, 4.0, 0.1, {"phi": 1e-4, "d": 0.3})
    rate = np.sqrt(9.81 - 0.15**2)
    t = run["time"]
    swing = np.exp(-0.15 * t) * (np.cos(rate * t) + 0.15 / rate * np.sin(rate * t))
    np.testing.assert_allclose(run["phi"], 1e-4 * swing, rtol=0, atol=1e-11)


def test_it_names_all_sections_and_functions(tmp_path: Path) -> None:
    assert all(f"`[{section}]`" in PAGE for section in ("parameters", "inputs", "states", "where"))
    line = re.search(r"`(sin cos .*?)`", PAGE)[1]
    calls = " + ".join(f"{f}(p, p)" if f in ("atan2", "min", "max") else f"{f}(p)"
                       for f in line.split())  # fmt: skip
    Model(tmp_path, f'name = "M"\n[parameters]\np = {{ start = 1 }}\n[where]\na = "{calls}"\n')
    unit = re.search(r'`("dyn" = .*?)`', PAGE)[1]
    read_text(tmp_path, f'name = "M"\n[units]\n{unit}\n[inputs]\nf = {{ unit = "dyn" }}\n')


def test_a_new_model_is_one(tmp_path: Path) -> None:
    command = [sys.executable, "-P", "-m", "rparm"]
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}

    def call(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            [*command, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True
        )

    assert call("new-model", "Spring").returncode == 0
    assert call("build", "Spring.toml").returncode == 0
    first = (tmp_path / "Spring.fmu").read_bytes()
    assert (tmp_path / "Spring.lock.toml").is_file()
    again = call("build", "Spring.toml", "--output", "again")
    assert again.returncode == 0 and (tmp_path / "again" / "Spring.fmu").read_bytes() == first
    description = fmpy.read_model_description(tmp_path / "fmi3" / "Spring.fmu")
    assert description.fmiVersion == "3.0" and description.coSimulation is not None
    run = simulated(tmp_path / "Spring.fmu", 5.0, 0.1, {"c": 0.0})
    np.testing.assert_allclose(run["x"], np.cos(2 * run["time"]), rtol=0, atol=1e-7)
    for arguments, mistake in (
        (("new-model", "Spring"), "Spring.toml: exists already"),
        (("new-model", "a b"), "'a b' is no name"),
        (("build", "none.toml"), "none.toml: cannot be read"),
    ):
        refused = call(*arguments)
        assert refused.returncode == 2 and mistake in refused.stderr
        assert refused.stderr.count("\n") == 1
