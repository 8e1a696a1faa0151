"""The FMU in importers that are not fmpy gives what it gives in fmpy.

tests/importers/install.sh installs them. One that is not installed is skipped, but fails where the
environment variable REQUIRED_IMPORTERS (names with commas between) names it. In CI, where the
variable CI is set, the three that install.sh installs without an argument are required too.
"""

import json
import math
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from ctypes import c_double
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from fmpy import fmi2

from tests.support.instances import STATES, Instance, LoadedFmu
from tests.support.paths import ROOT

SCRIPTS = ROOT / "tests" / "importers"
BOUND = 1e-12  # of each output's maximum
TIME_LIMIT = 60.0  # s, of one tool


class Importer(NamedTuple):
    """How a tool runs the plan of this test."""

    inputs: str = "beginning"  # of the step that they are held over; or its "end"
    sets_states: bool = True  # False: it can only set parameters and inputs before it starts
    false_alarm: str | None = None  # regular expression of a complaint that is the tool's own error


IMPORTERS = {
    "ecospy": Importer(),
    # The FMI Library in libcosimpy 0.0.6 wants a start value for the independent variable, which
    # FMI 2.0.5, section 2.2.7, forbids; corrected upstream (fmi-library, pull request 129).
    # libcosim leaves enumerations out, and says so.
    "libcosimpy": Importer(
        false_alarm=r"Start attribute is required for this causality, variability and initial"
        r"|FMI 2.0 Enumeration variable type not supported, variable with name solver_method"
    ),
    "fmi-sim": Importer(),
    "cofmupy": Importer(),
    "pathsim-fmi": Importer(inputs="end"),
    "gemseo-fmu": Importer(sets_states=False),
}
CHECKER = "fmu-manipulation-toolbox"
REQUIRED = set(os.environ.get("REQUIRED_IMPORTERS", "").replace(",", " ").split())
if os.environ.get("CI"):
    REQUIRED |= {"ecospy", "libcosimpy", CHECKER}


def folder_of(tool: str) -> Path:
    """Where an importer is installed; no return where it is not."""
    install = SCRIPTS / "install.sh"
    if subprocess.run([install, "--check", tool], check=False).returncode == 0:
        return ROOT / "build" / "importers" / tool
    message = f"{tool} is not installed: {install.relative_to(ROOT)} {tool}"
    if tool in REQUIRED:
        pytest.fail(message)
    pytest.skip(message)


def start(command: Sequence[str | Path], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a program; `folder` takes its temporary files."""
    return subprocess.run(
        command,
        check=False,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
        env=os.environ | {"TMPDIR": str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
        timeout=TIME_LIMIT,
    )


def complaints(output: str, false_alarm: str | None = None) -> list[str]:
    """Lines with warnings and errors."""
    found = re.compile(r"\b(warn|warning|error|critical|fatal)\b", re.IGNORECASE)
    return [
        line
        for line in output.splitlines()
        if found.search(line) and not (false_alarm and re.search(false_alarm, line))
    ]


# ---- what to run, and what fmpy gives ------------------------------------------------------------


@pytest.fixture(scope="module")
def loaded(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> LoadedFmu:
    return LoadedFmu(fmu, tmp_path_factory.mktemp("unit"))


def make_plan(loaded: LoadedFmu, initial: bool = True) -> dict[str, Any]:
    """Inputs that change at every step, parameters and states that are not the start values."""
    steps = 200
    return {
        "start": 0.0,
        "step": 0.01,
        "steps": steps,
        "parameters": {"a": 0.15, "m2": 1.25},
        "initial": {"q1": 0.3, "q2": 0.2, "dq1": -0.4, "dq2": 0.1} if initial else {},
        "inputs": {
            "tau1": [3.0 * math.sin(0.7 * i + 0.3) for i in range(steps + 1)],
            "f2": [8.0 + 2.0 * math.cos(1.3 * i) for i in range(steps + 1)],
        },
        "outputs": [v.name for v in loaded.description.modelVariables if v.causality == "output"],
    }


def inputs_at(plan: dict[str, Any], i: int) -> dict[str, float]:
    return {name: values[i] for name, values in plan["inputs"].items()}


def co_simulation(loaded: LoadedFmu, plan: dict[str, Any], inputs: str) -> np.ndarray:
    """Outputs (steps + 1, outputs), with the inputs of the steps' beginning or of their end."""
    later = {"beginning": 0, "end": 1}[inputs]
    with Instance(loaded) as arm:
        arm.initialize(**plan["parameters"], **plan["initial"], **inputs_at(plan, 0))
        rows = [arm.get(*plan["outputs"])]
        for i in range(plan["steps"]):
            arm.set(**inputs_at(plan, i + later))
            arm.step(plan["start"] + i * plan["step"], plan["step"])
            rows.append(arm.get(*plan["outputs"]))
    return np.array(rows)


def euler(loaded: LoadedFmu, plan: dict[str, Any]) -> np.ndarray:
    """Outputs (steps + 1, outputs) of Model Exchange by Euler's method, inputs as they are."""
    x, dx = (c_double * len(STATES))(), (c_double * len(STATES))()
    times = [plan["start"] + i * plan["step"] for i in range(plan["steps"] + 1)]
    with Instance(loaded, fmi2.FMU2Model) as arm:
        arm.initialize(**plan["parameters"], **plan["initial"], **inputs_at(plan, 0))
        arm.fmi.newDiscreteStates()
        arm.fmi.enterContinuousTimeMode()
        rows = [arm.get(*plan["outputs"])]
        for i in range(plan["steps"]):
            arm.fmi.getContinuousStates(x, len(x))
            arm.fmi.getDerivatives(dx, len(dx))
            for k in range(len(x)):
                x[k] += dx[k] * (times[i + 1] - times[i])
            arm.fmi.setTime(times[i + 1])
            arm.fmi.setContinuousStates(x, len(x))
            arm.set(**inputs_at(plan, i + 1))
            arm.fmi.completedIntegratorStep()
            rows.append(arm.get(*plan["outputs"]))
    return np.array(rows)


def difference(values: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Largest difference of each output over all communication points, of its maximum."""
    assert values.shape == expected.shape
    assert np.all(np.isfinite(values))
    return np.abs(values - expected).max(axis=0) / np.abs(expected).max(axis=0)


# ---- the tools ---------------------------------------------------------------------------------


def run(tool: str, interface: str, fmu: Path, plan: dict[str, Any], folder: Path) -> np.ndarray:
    """Outputs (steps + 1, outputs) of the plan as the tool runs it."""
    installed = folder_of(tool)
    python: list[str | Path] = [installed / "bin" / "python"]
    extra: list[str | Path] = []
    if tool == "fmi-sim":
        python, extra = [sys.executable], [installed / "bin" / "fmi-sim", interface]
    driver = SCRIPTS / f"run_{tool.replace('-', '_')}.py"
    plan_file, result = folder / "plan.json", folder / "result.json"
    plan_file.write_text(json.dumps(plan), encoding="utf-8")
    process = start([*python, driver, *extra, fmu, plan_file, result], folder)
    assert process.returncode == 0, process.stdout
    assert complaints(process.stdout, IMPORTERS[tool].false_alarm) == []
    return np.array(json.loads(result.read_text(encoding="utf-8")))


def report(tool: str, plan: dict[str, Any], differences: np.ndarray) -> None:
    worst = int(differences.argmax())
    print(f"{tool}: largest difference {differences[worst]:.1e} ({plan['outputs'][worst]})")


@pytest.mark.parametrize("tool", IMPORTERS)
def test_co_simulation_is_that_of_fmpy(
    tool: str, fmu: Path, loaded: LoadedFmu, tmp_path: Path
) -> None:
    importer = IMPORTERS[tool]
    plan = make_plan(loaded, importer.sets_states)
    values = run(tool, "co-simulation", fmu, plan, tmp_path)
    differences = difference(values, co_simulation(loaded, plan, importer.inputs))
    report(tool, plan, differences)
    assert differences.max() <= BOUND


def test_model_exchange_is_that_of_fmpy(fmu: Path, loaded: LoadedFmu, tmp_path: Path) -> None:
    plan = make_plan(loaded)
    values = run("fmi-sim", "model-exchange", fmu, plan, tmp_path)
    differences = difference(values, euler(loaded, plan))
    report("fmi-sim", plan, differences)
    assert differences.max() <= BOUND


def test_the_plan_tells_one_order_of_inputs_from_the_other(loaded: LoadedFmu) -> None:
    plan = make_plan(loaded)
    beginning, end = (co_simulation(loaded, plan, inputs) for inputs in ("beginning", "end"))
    assert difference(end, beginning).min() > 1e6 * BOUND


def fmutool_check(fmu: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    return start([folder_of(CHECKER) / "bin" / "fmutool", "-check", "-input", fmu], folder)


def test_fmutool_finds_nothing(fmu: Path, tmp_path: Path) -> None:
    process = fmutool_check(fmu, tmp_path)
    assert process.returncode == 0, process.stdout
    assert complaints(process.stdout, false_alarm="No semantic error") == []
    assert "seems to be compliant with FMI-2.0" in process.stdout
    assert "No semantic error against the FMI-2 standard" in process.stdout


def test_fmutool_finds_an_error(fmu: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.fmu"
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(wrong, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b' initial="calculated"', b' initial="exact"', 1)
            target.writestr(name, content)
    process = fmutool_check(wrong, tmp_path)
    assert process.returncode != 0
    assert "a start value is required" in process.stdout


def test_required_importers_are_known() -> None:
    assert {*IMPORTERS, CHECKER} >= REQUIRED
