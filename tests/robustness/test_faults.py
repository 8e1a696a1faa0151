"""Commands that the system or the user stops print one line and leave no half-written file."""

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rparm.__main__ import main
from tests.support.paths import ROOT
from tests.support.programs import RPARM, python, run
from tests.support.ssp_files import SSP

SCENARIO = "constant_effort_single_step"
RUN = ("run", SCENARIO, "--tolerance", "1e-8")
SYSTEM = ("system", "nominal")
LONG = ("run", "constant_effort")
FMU_SOURCES = ROOT / "fmu"


def limit_files(largest: int | None) -> None:
    """In a process to be: it can write files of at most so many bytes."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    if largest is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))


STOPS = pytest.mark.parametrize(
    ("stop", "code", "said"),
    [(signal.SIGINT, 130, "interrupted\n"), (signal.SIGTERM, 143, "")],
    ids=["Ctrl-C", "SIGTERM"],
)


class Place:
    """Folders of a command: where it is run, its report, its temporary files."""

    def __init__(self, folder: Path, fmu: Path) -> None:
        self.here = folder / "a folder, ü"
        self.report = self.here / "report"
        self.temporary = folder / "temporary"
        self.here.mkdir()
        self.temporary.mkdir()
        self.fmu = fmu

    def popen(
        self, arguments: tuple[str, ...], largest: int | None = None, **options
    ) -> subprocess.Popen:
        """Start a command, which may write files of at most `largest` bytes."""
        given = ("--fmu", str(self.fmu)) if arguments[0] == "run" else ("--ssp", str(SSP))

        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "rparm", *arguments, *given, "--report", "report"],
            cwd=self.here,
            env={
                **os.environ,
                "PYTHONPATH": str(ROOT),
                "TMPDIR": str(self.temporary),
                **options.pop("env", {}),
            },
            text=True,
            preexec_fn=lambda: limit_files(largest),
            **{key: value for key, value in streams.items() if key != "env"},
        )

    def call(self, arguments: tuple[str, ...], **options) -> tuple[int, str, str]:
        with self.popen(arguments, **options) as process:
            out, err = process.communicate(timeout=600)
        return process.returncode, out, err or ""

    def written(self) -> list[str]:
        """Names in the report's folder."""
        return sorted(x.name for x in self.report.iterdir()) if self.report.exists() else []

    def assert_clean(self) -> None:
        """No temporary file is left, under whatever name."""
        assert [x.name for x in self.temporary.iterdir() if x.name.startswith("rparm-")] == []
        assert [name for name in self.written() if name.startswith(".")] == []


@pytest.fixture
def place(tmp_path: Path, fmu: Path) -> Place:
    return Place(tmp_path, fmu)


def assert_one_line(err: str, *parts: str) -> None:
    assert err.startswith("error: ") and err.count("\n") == 1
    for part in parts:
        assert part in err


# ---- no room on the disk -----------------------------------------------------------------------


@pytest.mark.parametrize(("arguments", "largest"), [(RUN, 0), (RUN, 30_000), (SYSTEM, 1_000_000)])
def test_no_room_for_files(place: Place, arguments: tuple[str, ...], largest: int) -> None:
    """Where the copy of the FMU, or the values of a run, find no room."""
    code, _, err = place.call(arguments, largest=largest)
    assert code == 2
    # matplotlib prints a line if it cannot store its list of fonts
    assert_one_line(re.sub("^Could not save font_manager.*\n", "", err))
    assert place.written() == []
    place.assert_clean()


@pytest.mark.parametrize("arguments", [RUN, SYSTEM], ids=["run", "system"])
def test_no_room_for_the_report(place: Place, arguments: tuple[str, ...]) -> None:
    if run("mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place.here).returncode:
        pytest.skip("only root can make a small disk")
    try:
        code, _, err = place.call(arguments)
        assert code == 2
        assert_one_line(err, "report: cannot be written: No space left on device")
        assert place.written() == []
        place.assert_clean()
    finally:
        subprocess.run(["umount", place.here], check=True)


@pytest.mark.parametrize("program", ["generate", "package", "document"])
def test_what_builds_an_fmu_leaves_nothing_broken(tmp_path: Path, program: str) -> None:
    """An older file stays as it was, and no other appears."""
    model = ROOT / "models" / "rp_manipulator"
    description = ROOT / "build" / "fmu" / "RPManipulator" / "modelDescription.xml"
    output = tmp_path / "out"
    output.mkdir()
    file, arguments = {
        "generate": ("modelDescription.xml", [model / "rp_manipulator.toml", "--output", output]),
        "package": ("a.fmu", [output / "a.fmu", f"model={model}"]),
        "document": (
            "index.html",
            ["--readme", model / "README.md", "--model-description", description]
            + ["--output", output],
        ),
    }[program]
    (output / file).write_bytes(b"\xff older")

    command = (sys.executable, "-B", FMU_SOURCES / f"{program}.py", *arguments)
    done = run(*command, preexec_fn=lambda: limit_files(3000))
    assert done.returncode == 2
    assert done.stderr.startswith(f"{program}.py: ") and done.stderr.count("\n") == 1
    assert [x.name for x in output.iterdir()] == [file]
    assert (output / file).read_bytes() == b"\xff older"


# ---- no reader of the output -------------------------------------------------------------------


def test_the_reader_leaves(place: Place) -> None:
    with place.popen(SYSTEM) as process:
        process.stdout.readline()
        process.stdout.close()
        err = process.stderr.read()
    assert process.returncode == 128 + signal.SIGPIPE and err == ""
    place.assert_clean()


def test_no_room_for_the_output(place: Place) -> None:
    with Path("/dev/full").open("w") as full:
        code, _, err = place.call(RUN, stdout=full)
    assert code == 2
    assert_one_line(err, "output or temporary files: No space left on device")
    place.assert_clean()


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_no_room_for_errors(place: Place, unbuffered: str) -> None:
    """What is left in a buffer must not change the exit code either."""
    with Path("/dev/full").open("w") as full:
        environment = {"PYTHONUNBUFFERED": unbuffered}
        code, out, _ = place.call(("run", "unknown"), stderr=full, env=environment)
    assert code == 2 and out == ""


def test_names_that_the_output_cannot_encode(tmp_path: Path) -> None:
    for part in ("rparm", "fmu/compiler"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("__pycache__"))
    model = tmp_path / "models" / "m"
    (model / "scenarios").mkdir(parents=True)
    text = (
        'title = "A"\ndescription = "B"\ntolerance = 1e-6\n[time]\nstart = 0\nstop = 1\nstep = 1\n'
    )
    (model / "scenarios" / "ü.toml").write_text(text)
    plain = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = run(sys.executable, "-m", "rparm", "list", cwd=tmp_path, env=plain, text=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"\\xfc  A\n", b"")


def test_a_message_is_one_line_whatever_it_quotes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "a\nb\x1b[31m"]) == 2
    assert_one_line(capsys.readouterr().err, r"a\nb\x1b[31m")


# ---- the user stops it -------------------------------------------------------------------------


@STOPS
@pytest.mark.parametrize("arguments", [LONG, ("system",)], ids=["run", "system"])
def test_stopped_in_the_middle(
    place: Place, arguments: tuple[str, ...], stop: signal.Signals, code: int, said: str
) -> None:
    with place.popen(arguments) as process:
        process.stdout.readline()  # the head of the table: an FMU is unpacked
        process.send_signal(stop)
        out, err = process.communicate(timeout=600)
    if "open it: " not in out:  # else it had ended before
        assert (process.returncode, err) == (code, said)
    place.assert_clean()


@STOPS
def test_a_library_may_hide_that_it_was_stopped(stop: signal.Signals, code: int, said: str) -> None:
    program = f"""
import os, signal, sys
from rparm import __main__ as cli

def main():
    try:
        os.kill(os.getpid(), signal.{stop.name})
        signal.pause()
    except BaseException:
        raise ValueError("Invalid affine transformation matrix")

cli.main = main
sys.exit(cli._as_program())
"""
    done = python("-c", program)
    assert (done.returncode, done.stderr) == (code, said)


# ---- surroundings ------------------------------------------------------------------------------


def test_without_a_home_and_with_the_plainest_locale(place: Place) -> None:
    environment = {"LC_ALL": "C", "LANG": "C", "HOME": "/nonexistent"}
    code, out, err = place.call(RUN, env=environment)
    assert (code, err) == (0, "")
    assert "; report/index.html; open it: " in out  # relative to the current folder
    place.assert_clean()


def test_the_scripts_take_no_modules_from_elsewhere(tmp_path: Path) -> None:
    """Neither of the current folder nor of PYTHONPATH."""
    for name in ("numpy", "tomllib", "argparse"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong module')")
    text = (ROOT / "run.sh").read_text()
    assert "unset PYTHONPATH PYTHONHOME" in text
    calls = re.findall(r"python\" (?!\])(\S+)", text)
    assert calls == ["-P"] * 3
    done = python(*RPARM, "list", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
