"""Devices, cut and endless files: the command prints one line and leaves nothing behind."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rparm.models.closed_loop.coupling.loop import opened as opened_loop

from rparm import files
from rparm.errors import UserError
from rparm.fmi.fmu_file import Fmu
from rparm.runs import comparison
from rparm.runs import scenario as scenarios
from rparm.systems import ssp
from tests.support.paths import ROOT
from tests.support.rparm_project import declared
from tests.support.ssp_files import SSP, Edit, edited, replace

MODEL = "rp_manipulator"
SCENARIO = "constant_effort_single_step"
STRUCTURE = "SystemStructure.ssd"
DESCRIPTION = "modelDescription.xml"


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A copy of the model's folder with one scenario."""
    folder = tmp_path / "models" / MODEL
    part = f"scenarios/{SCENARIO}.toml"
    (folder / part).parent.mkdir(parents=True)
    shutil.copy(ROOT / "models" / MODEL / part, folder / part)
    source = ROOT / "models" / MODEL / "references" / SCENARIO
    shutil.copytree(source, folder / "references" / SCENARIO)
    return folder


def scenario_file(model: Path) -> Path:
    return model / "scenarios" / f"{SCENARIO}.toml"


def reference_file(model: Path) -> Path:
    return model / "references" / SCENARIO / "RPManipulator_ref.csv"


def read(model: Path) -> None:
    comparison.load_reference(
        scenarios.load(scenario_file(model), declared(MODEL)), declared(MODEL)
    )


def refused(action: Callable[[], object], *parts: str) -> None:
    with pytest.raises(UserError) as caught:
        action()
    for part in parts:
        assert part in str(caught.value)


def open_fmu(path: Path) -> None:
    with Fmu(path):
        pass


def open_ssp(path: Path) -> None:
    with ssp.unpacked(path):
        pass


# ---- what is no file ---------------------------------------------------------------------------


@pytest.mark.parametrize("file", [scenario_file, reference_file])
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (os.mkfifo, "a device or a pipe"),
        (lambda path: path.symlink_to("/dev/zero"), "a device or a pipe"),
        (lambda path: path.symlink_to(path.name), "Too many levels"),
        (lambda path: path.mkdir(), "Is a directory"),
    ],
    ids=["pipe", "device", "loop", "folder"],
)
def test_what_is_no_file_is_refused_at_once(
    model: Path, file: Callable[[Path], Path], make: Callable[[Path], object], message: str
) -> None:
    path = file(model)
    path.unlink()
    make(path)
    refused(lambda: read(model), path.name, message)


@pytest.mark.parametrize("action", [open_fmu, open_ssp], ids=["FMU", "SSP"])
def test_a_pipe_is_no_archive(tmp_path: Path, action: Callable[[Path], None]) -> None:
    os.mkfifo(tmp_path / "pipe")
    refused(lambda: action(tmp_path / "pipe"), "pipe: cannot be read", "expected a file")


def test_files_of_other_editors_are_read(model: Path) -> None:
    for path in (scenario_file(model), reference_file(model)):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    read(model)


def test_files_that_are_too_large(model: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "LARGEST_TOML", 10_000_000)
    with scenario_file(model).open("r+b") as file:
        file.truncate(10_000_001)
    refused(lambda: read(model), f"{SCENARIO}.toml: is larger than 10 MB")


# ---- scenarios -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("start = 0.0", f"start = 0x{'f' * 5000}", "[time] start: expected a finite number"),
        ("start = 0.0", f"start = [0x{'f' * 5000}]", "[time] start: expected a number"),
        ("start = 0.0", f"start{'.x' * 50_000} = 0.0", "a key of more than 32 parts"),
        ("[time]", f"x = {'[' * 100_000}\n[time]", "not valid TOML"),
        ("step = ", f"step = [{'0.01, ' * 1001}] # ", "[time] step: has 1001 lengths, expected at"),
    ],
    ids=["number", "number in a list", "key", "nesting", "steps"],
)
def test_values_beyond_all_measure(model: Path, old: str, new: str, message: str) -> None:
    path = scenario_file(model)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    refused(lambda: read(model), f"{SCENARIO}.toml", message)


# ---- references --------------------------------------------------------------------------------


def test_a_reference_cut_anywhere_is_refused(model: Path) -> None:
    path = reference_file(model)
    scenario = scenarios.load(scenario_file(model), declared(MODEL))
    content = path.read_bytes()
    for length in range(len(content)):
        path.write_bytes(content[:length])
        refused(
            lambda: comparison.load_reference(scenario, declared(MODEL)),
            str(path),
            "make_references.py",
        )
    path.write_bytes(content)
    comparison.load_reference(scenario, declared(MODEL))


# ---- archives ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"controller"', '"steering"', "has no component 'controller', which the study needs"),
        ('stopTime="6"', 'stopTime="5"', "stops at 5.0 s; the references are for 6.0 s"),
        ('baseStepSize="0.001"', 'baseStepSize="1e-9"', "more than 10000000 steps"),
    ],
)
def test_a_system_that_the_study_does_not_know(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    path = edited(SSP, tmp_path / "a.ssp", {STRUCTURE: replace(old, new, -1)})

    def study() -> None:
        with opened_loop(path):
            pass

    refused(study, f"{path}: ", message)


def without_variables(content: bytes) -> bytes:
    """A model description with no variable but the time."""
    text = content.decode()
    for section, rest in (
        (
            "ModelVariables",
            '<ScalarVariable name="time" valueReference="0" causality="independent" '
            'variability="continuous"><Real/></ScalarVariable>',
        ),
        ("ModelStructure", ""),
    ):
        begin, end = text.index(f"<{section}>"), text.index(f"</{section}>")
        text = text[:begin] + f"<{section}>{rest}" + text[end:]
    return text.encode()


def without_an_output(content: bytes) -> bytes:
    """A model description in which the total energy is no output any more."""
    before, name, after = content.decode().partition('name="total_energy"')
    return (before + name + after.replace('causality="output"', 'causality="local"', 1)).encode()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without_variables, f"{SCENARIO}.toml: [parameters]: the model has no variable"),
        (without_an_output, "_ref.csv, line 1: 'total_energy' is not an output of the model"),
    ],
)
def test_an_fmu_without_what_is_compared(
    fmu: Path, tmp_path: Path, model: Path, change: Edit, message: str
) -> None:
    """It must not pass because there is nothing to compare."""
    path = edited(fmu, tmp_path / "a.fmu", {DESCRIPTION: change})
    command = [sys.executable, "-m", "rparm", "run", SCENARIO, "--fmu", str(path)]
    ignored = shutil.ignore_patterns("__pycache__")  # other tests write there
    shutil.copytree(ROOT / "rparm", tmp_path / "rparm", ignore=ignored)
    shutil.copytree(ROOT / "fmu" / "compiler", tmp_path / "fmu" / "compiler", ignore=ignored)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert message in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new"),
    [('start="2.0" min="0.0"', 'start="two" min="0.0"'), ('value="2"', 'value="second"')],
)
def test_a_model_description_with_wrong_numbers(
    fmu: Path, tmp_path: Path, old: str, new: str
) -> None:
    path = edited(fmu, tmp_path / "a.fmu", {DESCRIPTION: replace(old, new)})
    refused(lambda: open_fmu(path), "a.fmu: wrong modelDescription.xml: ", new.split('"')[1])
