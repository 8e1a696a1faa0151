"""The FMU in importers that are not fmpy gives what it gives in fmpy.

tests/importers/install.sh installs them. One that is not installed is skipped; in CI, where the
variable CI is set, those that install.sh installs without an argument fail.
"""

import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from tests.importers.by_fmpy import co_simulation, euler
from tests.rp_plant.fmu.plant_runs import FRICTION
from tests.support.instances import LoadedFmu
from tests.support.paths import EVERY, ROOT

SCRIPTS = ROOT / "tests" / "importers"
BOUND = 1e-12  # of each output's maximum
TIME_LIMIT = 60.0  # s, of one tool
VERSIONS = ("fmi2", "fmi3")


class Importer(NamedTuple):
    """How a tool runs the plan of this test."""

    versions: Sequence[str] = VERSIONS
    false_alarm: str | None = None  # regular expression of a complaint that is the tool's own error


IMPORTERS = {
    # Ecos leaves enumerations of FMI 3.0 out, and says so.
    "ecospy": Importer(false_alarm="Variable named 'solver_method' is of unsupported type"),
    # The FMI Library in libcosimpy 0.0.6 wants a start value for the independent variable, which
    # FMI 2.0.5, section 2.2.7, forbids; corrected upstream (fmi-library, pull request 129).
    # libcosim leaves enumerations out, and says so.
    "osp": Importer(
        versions=["fmi2"],
        false_alarm=r"Start attribute is required for this causality, variability and initial"
        r"|FMI 2.0 Enumeration variable type not supported, variable with name solver_method",
    ),
    "fmuloader": Importer(),
    "fmi-sim": Importer(),
}
CHECKER = "fmu-manipulation-toolbox"
OPTIMIZER = "casadi"  # test_casadi.py
REQUIRED = {"ecospy", "osp", "fmuloader", CHECKER, OPTIMIZER} if os.environ.get("CI") else set()


class Built(NamedTuple):
    """The FMU of one version."""

    path: Path
    loaded: LoadedFmu


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
def built(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Built]:
    """The arm's FMU of each version."""
    paths = {"fmi2": fmu, "fmi3": fmu.parent / "fmi3" / fmu.name}
    return {
        version: Built(path, LoadedFmu(path, tmp_path_factory.mktemp(version)))
        for version, path in paths.items()
    }


def make_plan(loaded: LoadedFmu) -> dict[str, Any]:
    """Return a run: inputs change at every step; parameters and states are not the start values."""
    steps = 200
    return {
        "start": 0.0,
        "step": 0.01,
        "steps": steps,
        "parameters": {"a": 0.15, "m2": 1.25},
        "initial": {"q1": 0.3, "q2": 0.2, "dq1": -0.4, "dq2": 0.1},
        "inputs": {
            "tau1": [3.0 * math.sin(0.7 * i + 0.3) for i in range(steps + 1)],
            "f2": [8.0 + 2.0 * math.cos(1.3 * i) for i in range(steps + 1)],
        },
        "outputs": [v.name for v in loaded.description.modelVariables if v.causality == "output"],
    }


def difference(values: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Largest difference of each output over all communication points, of its maximum."""
    assert values.shape == expected.shape
    assert np.all(np.isfinite(values))
    return np.abs(values - expected).max(axis=0) / np.abs(expected).max(axis=0)


# ---- the tools ---------------------------------------------------------------------------------


def run(tool: str, fmu: Path, plan: dict[str, Any], folder: Path, *options: str) -> np.ndarray:
    """Outputs (steps + 1, outputs) of the plan as the tool runs it."""
    installed = folder_of(tool)
    python: list[str | Path] = [installed / "bin" / "python"]
    extra: list[str | Path] = []
    if tool == "fmi-sim":
        python, extra = [sys.executable], [installed / "bin" / "fmi-sim", *options]
    driver = SCRIPTS / f"run_{tool.replace('-', '_')}.py"
    plan_file, result = folder / "plan.json", folder / "result.json"
    plan_file.write_text(json.dumps(plan), encoding="utf-8")
    process = start([*python, driver, *extra, fmu, plan_file, result], folder)
    assert process.returncode == 0, process.stdout
    assert complaints(process.stdout, IMPORTERS[tool].false_alarm) == []
    return np.array(json.loads(result.read_text(encoding="utf-8")))


def report(case: str, plan: dict[str, Any], differences: np.ndarray) -> None:
    worst = int(differences.argmax())
    print(f"{case}: largest difference {differences[worst]:.1e} ({plan['outputs'][worst]})")


def cases() -> Iterator[tuple[str, str, list[str]]]:
    """Tool, version and options of each co-simulation."""
    for tool, importer in IMPORTERS.items():
        for version in importer.versions:
            choices = [[]]
            if (tool, version) == ("fmi-sim", "fmi3"):
                event, early = "--event-mode-used", "--early-return-allowed"
                choices = [[], [event], [early], [event, early]]
            for options in choices:
                yield tool, version, options


@pytest.mark.parametrize(
    ("tool", "version", "options"),
    [pytest.param(*case, id=" ".join([*case[:2], *case[2]])) for case in cases()],
)
def test_co_simulation_is_that_of_fmpy(
    tool: str, version: str, options: list[str], built: dict[str, Built], tmp_path: Path
) -> None:
    fmu, loaded = built[version]
    plan = make_plan(loaded)
    values = run(tool, fmu, plan, tmp_path, "co-simulation", *options)
    differences = difference(values, co_simulation(loaded, plan))
    report(" ".join([tool, version, *options]), plan, differences)
    assert differences.max() <= BOUND


@pytest.mark.parametrize("version", VERSIONS)
def test_model_exchange_is_that_of_fmpy(
    version: str, built: dict[str, Built], tmp_path: Path
) -> None:
    fmu, loaded = built[version]
    plan = make_plan(loaded)
    values = run("fmi-sim", fmu, plan, tmp_path, "model-exchange")
    differences = difference(values, euler(loaded, plan))
    report(f"fmi-sim {version}", plan, differences)
    assert differences.max() <= BOUND


@pytest.mark.parametrize("version", VERSIONS)
def test_the_plan_tells_one_order_of_inputs_from_the_other(
    version: str, built: dict[str, Built]
) -> None:
    loaded = built[version].loaded
    plan = make_plan(loaded)
    later = co_simulation(loaded, plan, held=1)
    assert difference(later, co_simulation(loaded, plan)).min() > 1e6 * BOUND


def fmutool_check(fmu: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    return start([folder_of(CHECKER) / "bin" / "fmutool", "-check", "-input", fmu], folder)


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("version", VERSIONS)
def test_fmutool_finds_nothing(version: str, name: str, fmu: Path, tmp_path: Path) -> None:
    below = fmu.parent if version == "fmi2" else fmu.parent / version
    process = fmutool_check(below / f"{name}.fmu", tmp_path)
    assert process.returncode == 0, process.stdout
    assert complaints(process.stdout, false_alarm="No semantic error") == []
    number = version[-1]
    assert f"seems to be compliant with FMI-{number}.0" in process.stdout
    assert f"No semantic error against the FMI-{number} standard" in process.stdout


@pytest.mark.parametrize("version", VERSIONS)
def test_a_container_gives_what_is_in_it(
    version: str, built: dict[str, Built], tmp_path: Path
) -> None:
    fmu, loaded = built[version]
    plan = make_plan(loaded) | {"parameters": {}, "initial": {}}  # their names differ outside
    folder = tmp_path / "made"
    folder.mkdir()
    (folder / fmu.name).symlink_to(fmu)
    table = folder / "container.csv"
    table.write_text(
        f"rule;from_fmu;from_port;to_fmu;to_port\nFMU;{fmu.name};;;\n", encoding="utf-8"
    )
    command = [folder_of(CHECKER) / "bin" / "fmucontainer", "-fmi", version[-1]]
    command += ["-fmu-directory", folder, "-container"]
    process = start([*command, f"{table.name}:{plan['step']}"], folder)
    assert process.returncode == 0, process.stdout
    assert complaints(process.stdout) == []
    container = LoadedFmu(folder / "container.fmu", tmp_path / "container")
    values = co_simulation(container, plan)
    differences = difference(values, co_simulation(loaded, plan))
    report(f"fmucontainer {version}", plan, differences)
    assert differences.max() <= BOUND


# ---- RPPlant in fmi-sim --------------------------------------------------------------------------


OUTPUTS = ["time", "q1", "q2", "dq1", "dq2", "mode1", "mode2"]
EVENT_MODE, EARLY_RETURN = "--event-mode-used", "--early-return-allowed"
STOP = 1.0  # s


@pytest.fixture(scope="module")
def paths(fmu: Path) -> dict[str, Path]:
    """RPPlant by version of FMI."""
    return {"fmi2": fmu.with_name("RPPlant.fmu"), "fmi3": fmu.parent / "fmi3" / "RPPlant.fmu"}


def simulate(fmu: Path, step: float, folder: Path, interface: str, *options: str) -> np.ndarray:
    """Rows of OUTPUTS; at events there may be further ones."""
    steps = round(STOP / step)
    plan = {
        "start": 0.0,
        "step": step,
        "steps": steps,
        "parameters": FRICTION | {"g": 0.0},
        "initial": {"dq1": 1.0, "dq2": -0.8},
        "inputs": {"tau1": [0.0] * (steps + 1), "f2": [0.0] * (steps + 1)},
        "outputs": OUTPUTS,
    }
    return run("fmi-sim", fmu, plan, folder, interface, *options)


def test_co_simulation_has_the_same_bits(paths: dict[str, Path], tmp_path: Path) -> None:
    step = 0.01
    expected = simulate(paths["fmi3"], step, tmp_path, "co-simulation")
    assert not expected[-1, 3:].any()  # both joints are held
    # its times of FMI 2.0 are rounded otherwise
    in_fmi2 = simulate(paths["fmi2"], step, tmp_path, "co-simulation")
    np.testing.assert_allclose(in_fmi2, expected, rtol=0, atol=1e-14)
    rows = []
    for options in [EVENT_MODE], [EARLY_RETURN], [EVENT_MODE, EARLY_RETURN]:
        found = simulate(paths["fmi3"], step, tmp_path, "co-simulation", *options)
        rows.append(len(found))
        k = np.rint(found[:, 0] / step)
        on_grid = found[np.abs(found[:, 0] - k * step) < 1e-12]
        first = np.unique(np.rint(on_grid[:, 0] / step), return_index=True)[1]
        np.testing.assert_array_equal(on_grid[first], expected)
    assert len(expected) < rows[1] < rows[2]  # it sees the events


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_the_error_of_eulers_method_falls_with_its_step(
    paths: dict[str, Path], version: str, tmp_path: Path
) -> None:
    expected = simulate(paths["fmi2"], 0.01, tmp_path, "co-simulation")[-1]
    errors = []
    for step in (1e-2, 1e-3):
        found = simulate(paths[version], step, tmp_path, "model-exchange")[-1]
        np.testing.assert_array_equal(found[3:], expected[3:])  # at rest
        errors.append(np.abs(found[1:3] - expected[1:3]).max())
    assert errors[1] < errors[0] / 5 < 5e-3
