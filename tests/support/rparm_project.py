"""A copy of the project with few scenarios, and changed files, for the tests of the Python side."""

import functools
import os
import shutil
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from rparm import __main__ as cli
from rparm import project
from rparm.fmi.fmu_file import read_model
from rparm.fmi.model import Model
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario
from tests.support.paths import FOLDERS, ROOT
from tests.support.tables import tables

BUILD = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).absolute().parent
FMUS = {folder: BUILD / f"{name}.fmu" for name, folder in FOLDERS.items()}
FILES = project.scenario_files()
NAMES = list(FILES)
MISTAKES = tables(str(ROOT / "tests" / "rparm" / "mistakes"))
SHORT, LONG = "constant_effort_single_step", "constant_effort"  # the same motion


def fmi3_fmu(path: Path) -> Path:
    """The FMU of FMI 3.0 beside one of FMI 2.0."""
    return path.parent / "fmi3" / path.name


def names_of(model: str) -> list[str]:
    """Scenarios of one model, by its folder."""
    return [name for name, path in FILES.items() if project.model_folder(path).name == model]


@functools.cache
def declared(model: str) -> Model:
    """What the built FMU of a model declares, by the model's folder."""
    return read_model(FMUS[model])


def load(name: str, root: Path = ROOT) -> Scenario:
    """A scenario of the project, or of a copy of it."""
    path = root / FILES[name].relative_to(ROOT)
    return scenarios.load(path, declared(project.model_folder(path).name))


def staircase(scenario: Scenario, points: int) -> np.ndarray | None:
    """Inputs held over each of the first steps, for fmpy: an event wherever one of them changes."""
    if not scenario.inputs:
        return None
    values = np.column_stack([*scenario.inputs.values()])[:points]
    rows = [(scenario.times[0], *values[0])]
    for i in range(1, len(values)):
        if np.any(values[i] != values[i - 1]):
            rows += [(scenario.times[i], *values[i - 1]), (scenario.times[i], *values[i])]
    rows.append((scenario.times[points], *values[-1]))
    return np.array(rows, dtype=[("time", float), *((name, float) for name in scenario.inputs)])


def copy_project(folder: Path) -> None:
    """A project with two scenarios."""
    model = folder / "models" / "rp_manipulator"
    (model / "scenarios").mkdir(parents=True)
    (model / "references").mkdir()
    shutil.copy(ROOT / "models/rp_manipulator/references/scales.toml", model / "references")
    for name in (SHORT, LONG):
        original = load(name)
        shutil.copy(original.path, model / "scenarios")
        shutil.copytree(original.reference_folder, model / "references" / name)


def reference_file(project: Path, name: str) -> Path:
    return project / f"models/rp_manipulator/references/{name}/RPManipulator_ref.csv"


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def repacked(source: Path, target: Path, change: Callable[[str], str], drop: str = "-") -> Path:
    """Copy of an FMU with a changed modelDescription.xml and without files under `drop`."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = change(content.decode()).encode()
            if not name.startswith(drop):
                new.writestr(name, content)
    return target


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error."""
    code = cli.main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return code, out, err


def check_near(result: Mapping[str, np.ndarray]) -> None:
    """The motion of an example stays near the arm: within 2 m and a turn, below 100 J."""
    largest = [np.abs(result[name]).max() for name in ("q1", "q2", "kinetic_energy")]
    assert np.all(np.array(largest) < (2 * np.pi, 2.0, 100.0)), largest
    assert np.ptp(result["q1"]) > 0.1


def assert_one_line(error: str) -> None:
    assert error.startswith("error: ") and error.count("\n") == 1 and "Traceback" not in error


class Console:
    """The command line, called in this process: what it ends with and prints."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        """Exit code, standard output and standard error."""
        return call(self._capsys, *arguments)

    def refused(self, *arguments: object) -> str:
        """The one line that a mistake gets; nothing else is printed."""
        return self.failed(*arguments, printed="")

    def failed(self, *arguments: object, printed: str | None = None) -> str:
        """The one line in which a command says why it ends, whatever it has printed before."""
        code, out, error = self(*arguments)
        assert code == 2 and (printed is None or out == printed), error
        assert_one_line(error)
        return error
