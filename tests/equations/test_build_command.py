"""`rparm build`, also from a program: interrupted, without a compiler, in odd places."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import fmpy
import numpy as np
import pytest

import rparm
from rparm.errors import UserError
from tests.equations.compiled import Model, ModelFileError, building, read_text
from tests.equations.examples import FOLDER, build, simulated
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python

TEXT = (FOLDER / "dahlquist.toml").read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a model, beside one for temporary files."""
    folder = tmp_path / "my models"
    folder.mkdir()
    (folder / "-decay.toml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "temporary").mkdir()
    return folder


def started(folder: Path, *arguments: str) -> subprocess.Popen:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    environment |= {"TMPDIR": str(folder.parent / "temporary")}
    return subprocess.Popen(
        [sys.executable, *RPARM, *arguments],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def left(folder: Path) -> list[str]:
    """All files but the model."""
    paths = (path for path in folder.parent.rglob("*") if path.is_file())
    return sorted(path.name for path in paths if path.name != "-decay.toml")


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM], ids=str)
def test_nothing_is_left_where_it_is_interrupted(folder: Path, ending: signal.Signals) -> None:
    """When its temporary folder is there, and when there are objects in it."""
    temporary = folder.parent / "temporary"
    for waited in ("rparm-*", "rparm-*/*/*/*.o"):
        with started(folder, "build", "--no-cache", "--", "-decay.toml") as process:
            limit = time.monotonic() + 60
            while not any(temporary.glob(waited)):
                assert process.poll() is None and time.monotonic() < limit
                time.sleep(0.01)
            process.send_signal(ending)
            errors = process.communicate()[1]
        assert process.returncode == 128 + ending and "Traceback" not in errors
        assert left(folder) == [] and not any(temporary.iterdir())


def refused(folder: Path, *arguments: str) -> str:
    with started(folder, *arguments) as process:
        output, errors = process.communicate()
    assert process.returncode == 2 and output == "" and errors.count("\n") == 1
    return errors


@pytest.mark.parametrize("name", ["/nowhere/cc", "cc"])
def test_what_to_install_is_said_where_no_compiler_is(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(building, "find_spec", lambda _: None)
    (tmp_path / "runtime.json").write_text(json.dumps({"compiler": [name]}))
    with pytest.raises(ModelFileError, match=r'^gcc, clang or zig: .* "rparm\[build\]" installs'):
        building.Runtime.load(tmp_path / "runtime.json", of_this_machine=True)


@pytest.mark.skipif(os.name != "posix", reason="needs scripts")
@pytest.mark.parametrize("error, way_out", [
    ("cc: error: no assembler", "install"), ("equations.c:1:10: fatal error: no math.h", "install"),
    ("equations.c:7:3: error: no entry", "the C that rparm wrote is wrong: please report"),
    ("../bead_events.c:7:3: error: no such", "the sources of .hook. are to be mended"),
    ("ld: undefined reference to bead_check", "the sources of .hook. are to be mended"),
])  # fmt: skip
def test_a_compiler_that_fails_is_named(tmp_path: Path, error: str, way_out: str) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text(f"#!/bin/sh\necho '{error}' >&2\nexit 1\n")
    compiler.chmod(0o755)
    (tmp_path / "runtime.json").write_text(json.dumps({"compiler": [str(compiler)]}))
    found = building.Runtime.load(tmp_path / "runtime.json", of_this_machine=True)
    with pytest.raises(ModelFileError, match=f"^.*/cc: {error}; [^\n]*{way_out}"):
        found.run(tmp_path)


def test_neither_fmu_nor_lock_file_is_there_if_one_fails(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "fmi3").touch()
    error = refused(folder, "build", "--output", "out", "--", "-decay.toml")
    assert "out/fmi3/Dahlquist.fmu: cannot be written" in error
    assert left(folder) == ["fmi3"]
    error = refused(folder, "new-model", "Spring", "--output", "out/fmi3")
    assert "out/fmi3/Spring.toml: cannot be written" in error


def test_a_folder_with_a_space_is_quoted(folder: Path) -> None:
    with started(folder, "new-model", "Spring", "--output", "and more") as process:
        assert "build 'and more/Spring.toml'" in process.communicate()[0]


def test_a_program_builds_and_runs_a_model(folder: Path) -> None:
    fmus = rparm.build(folder / "-decay.toml", output=folder / "of a program")
    assert left(folder) == ["-decay.lock.toml", "Dahlquist.fmu", "Dahlquist.fmu"]
    of_fmi2, of_fmi3 = (rparm.simulate(fmu, stop_time=2.0, step=0.1) for fmu in fmus)
    assert of_fmi3["x"] == pytest.approx(np.exp(-of_fmi3["time"]), rel=1e-7)
    assert np.array_equal(of_fmi2["x"], of_fmi3["x"])


MESSAGE = 'at most 50 % of it #1 (%d %s%n) "größer" 🙂 ??/'


def test_the_message_of_a_check_arrives_as_it_is(folder: Path) -> None:
    """Also one that is as long as it may be; with a line end it is still one line."""
    long = MESSAGE + "x" * (500 - len(MESSAGE.encode()))
    for given, expected in ((MESSAGE, MESSAGE), (long, long), ("of two\nlines", "of two lines")):
        check = f"\n[check]\n{json.dumps(given, ensure_ascii=False)} = 'k > -50'\n"
        (folder / "-decay.toml").write_text(TEXT + check, encoding="utf-8")
        for fmu in rparm.build(folder / "-decay.toml", output=folder):
            with pytest.raises(UserError) as refused:
                rparm.simulate(fmu, stop_time=1.0, step=0.1, start_values={"k": -60.0})
            assert str(refused.value).endswith(f"failed (error): {expected}")


@pytest.mark.parametrize("nominal", ["", ", nominal = 1e-12"])
def test_a_state_far_below_its_tolerance_is_a_warning(folder: Path, nominal: str) -> None:
    text = f'name = "Tiny"\n[states]\nh = {{ start = 1e-12, derivative = "-h"{nominal} }}\n'
    (folder / "tiny.toml").write_text(text, encoding="utf-8")
    with started(folder, "build", "tiny.toml") as process:
        _, error = process.communicate()
    assert process.returncode == 0
    warned = "warning: tiny.toml: [states]: h: starts at 1e-12, but its tolerance is 1e-10"
    assert error.startswith(warned) if not nominal else not error


# ---- The page of the format ----------------------------------------------------------------------


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
    sections = "parameters inputs states discrete functions where"
    named = "sampled.NAME events.NAME tables.NAME"
    assert all(f"`[{section}]`" in PAGE for section in f"{sections} {named}".split())
    line = re.search(r"`(sin cos .*?)`", PAGE)[1]
    calls = " + ".join(f"{f}(p, p)" if f in ("atan2", "hypot", "min", "max", "mod") else f"{f}(p)"
                       for f in line.split())  # fmt: skip
    Model(tmp_path, f'name = "M"\n[parameters]\np = {{ start = 1 }}\n[where]\na = "{calls}"\n')
    unit = re.search(r'`("dyn" = .*?)`', PAGE)[1]
    read_text(tmp_path, f'name = "M"\n[units]\n{unit}\n[inputs]\nf = {{ unit = "dyn" }}\n')


def test_a_new_model_is_one(tmp_path: Path) -> None:
    def call(*arguments: str) -> subprocess.CompletedProcess:
        return python(*RPARM, *arguments, folder=tmp_path)

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


def test_a_new_model_with_friction_slides_bounces_and_sticks(tmp_path: Path) -> None:
    """From 2 m/s, under 2 N: a stop at 0.2 m leaves half the speed, friction takes the rest."""

    def call(*arguments: str) -> subprocess.CompletedProcess:
        return python(*RPARM, *arguments, folder=tmp_path)

    assert call("new-model", "Slider", "--with", "friction").returncode == 0
    fmu = build(tmp_path / "Slider.toml", tmp_path)
    run = simulated(fmu, 2.0, 0.1, {"d": 0.0, "sticks": 2.0})
    fast = np.sqrt(4 - 4 * 0.2) / 2  # m/s, after the impact: too slow for the other stop
    assert run["x"][-1] == pytest.approx(0.2 - fast**2 / 4, abs=1e-8)
    assert run["stops.slide.loss"][-1] == pytest.approx(1.5 * fast**2, abs=1e-8)
    assert run["friction.slide.mode"][-1] == 2 and run["v"][-1] == 0
    refused = call("new-model", "Other", "--with", "belt")
    assert refused.returncode == 2 and "invalid choice: 'belt' (choose from" in refused.stderr
    assert "friction" in refused.stderr and refused.stderr.count("\n") == 1
