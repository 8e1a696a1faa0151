"""run.sh: what it sets up and builds, which command it calls where, and what is printed where.

Set-up, CMake and Python are small scripts here that say how they are called.
"""

import json
import os
import pty
import re
import shlex
import shutil
import subprocess
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest

from rparm.needs import COMMANDS, SOURCES, overview, plan
from tests.support.paths import ROOT
from tests.support.programs import run
from tests.support.rparm_project import MISTAKES

SETUP = """#!/bin/sh
echo "set up $*"
"""
CMAKE = """#!/bin/sh
if [ "$1" = --build ]; then
  [ ! -e "$2/broken" ] || { echo "no rule"; exit 2; }
  echo "[ 50%] Building"; echo "$@" >>"$2/built"
fi
"""
PYTHON = """#!/usr/bin/env python3
import json, os, sys
if sys.argv[1:3] != ["-P", "-m"]:
    os.execvp("python3", ["python3", *sys.argv[1:]])
print(json.dumps({"here": os.getcwd(), "arguments": sys.argv[1:]}))
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A project with run.sh and nothing but small scripts below it."""
    root = tmp_path / "the project"
    scenarios = Path("models/rp_plant/scenarios")
    shutil.copytree(ROOT / scenarios, root / scenarios)
    shutil.copy(ROOT / "run.sh", root)
    (root / "rparm").mkdir()
    for name in ("needs.py", "commands.toml"):
        shutil.copy(ROOT / "rparm" / name, root / "rparm")
    for name, text in {
        "setup.sh": SETUP,
        "bin/cmake": CMAKE,
        "build/venv/bin/python": PYTHON,
    }.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        path.chmod(0o755)
    (tmp_path / "folder of a user").mkdir()
    return root


def call(root: Path, *arguments: str, stderr: int = subprocess.PIPE) -> subprocess.CompletedProcess:
    options = {"capture_output": False, "stdout": subprocess.PIPE, "stderr": stderr}
    options["env"] = {**os.environ, "PATH": f"{root / 'bin'}:{os.environ['PATH']}"}
    return run(root / "run.sh", *arguments, cwd=root.parent / "folder of a user", **options)


@pytest.mark.parametrize(("arguments", "words"), MISTAKES["plan"]["rows"])
def test_what_a_command_needs(arguments: list[str], words: str) -> None:
    assert " ".join(plan(arguments, ROOT / "models")) == words


def test_locks_and_extras_are_there() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for command in COMMANDS.values():
        assert not command.lock or (ROOT / "requirements" / f"{command.lock}.txt").is_file()
        assert command.extra in ("", *project["optional-dependencies"])


@pytest.mark.parametrize(("arguments", "wanted", "lock", "target"), MISTAKES["called"]["rows"])
def test_which_command_is_called(
    root: Path, arguments: str, wanted: str, lock: str, target: str
) -> None:
    """In the user's folder, and with nothing on standard output but what the command prints."""
    done = call(root, *shlex.split(arguments))
    found = json.loads(done.stdout)
    assert found["here"] == str(root.parent / "folder of a user")
    assert found["arguments"] == ["-P", "-m", "rparm", *shlex.split(wanted)]
    built = root / "build/built"
    assert not target if not built.exists() else f"--target {target} " in built.read_text()
    name = "the FMUs" if target == "all" else f"the {target}"
    said = [f"set up {lock}", *["run.sh: configuring", f"run.sh: building {name}"] * bool(target)]
    assert (done.returncode, done.stderr.splitlines()) == (0, [] if "quiet" in wanted else said)


@pytest.mark.parametrize("arguments", [["power_off"], ["playground"], ["--quiet", "power_off"]])
def test_a_terminal_shows_how_far_a_build_is(root: Path, arguments: list[str]) -> None:
    ours, theirs = pty.openpty()
    done = call(root, *arguments, stderr=theirs)
    os.close(theirs)
    os.set_blocking(ours, False)
    shown = b""
    with suppress(OSError):  # there is no more
        while more := os.read(ours, 10_000):
            shown += more
    os.close(ours)
    assert done.returncode == 0
    if "--quiet" in arguments:
        assert shown == b""
    else:
        assert b"building  50 % |####################                    |" in shown


def test_nothing_is_asked_again_until_something_has_changed(root: Path) -> None:
    """Set-up and CMake, for each lock and target: new, changed and removed files count."""
    asked = ["set up", "run.sh: configuring", "run.sh: building the FMUs"]

    def said(*arguments: str) -> list[str]:
        return [line.strip() for line in call(root, *arguments).stderr.splitlines()]

    assert said("power_off") == asked and said("power_off") == [] and said("prove", "x") == []
    assert said("identify", "x")[0] == "set up --control" and said("identify", "x") == []
    source, made = root / "src" / "model" / "a.c", root / "build" / "RPPlant.fmu"
    source.parent.mkdir(parents=True)
    for path in (source, root / "setup.sh", made):
        path.open("a").write("\n")
        assert said("power_off") == asked and said("power_off") == []
    for path in (source, made):
        path.unlink()
        assert said("power_off") == asked and said("power_off") == []
    (root / "build" / "broken").touch()
    source.touch()
    for _ in range(2):
        assert said("power_off")[:3] == asked
    (root / "build" / "broken").unlink()
    assert said("power_off") == asked


def test_a_change_while_something_is_built_counts(root: Path) -> None:
    (root / "src").mkdir()
    with (root / "bin" / "cmake").open("a") as file:
        file.write('echo >>"$(dirname "$0")/../src/late.c"\n')
    for _ in range(2):
        assert "run.sh: configuring" in call(root, "power_off").stderr


def test_all_that_make_knows_is_looked_at() -> None:
    """Files of the project that something in build/ is made from."""
    build = Path(os.environ.get("RP_FMU", ROOT / "build" / "x")).absolute().parent
    rules = [*build.glob("CMakeFiles/*/build.make"), *build.glob("src/*/CMakeFiles/*/build.make")]
    assert rules
    found = set()
    for path in [*rules, build / "CMakeFiles" / "Makefile.cmake"]:
        found |= set(re.findall(rf"{ROOT}/([\w.][\w./-]*)|\.\./([\w.][\w./-]*)", path.read_text()))
    named = {Path(a or b).parts[0] for a, b in found if (ROOT / (a or b)).is_file()}
    assert {"fmu", "models", "src", "CMakeLists.txt"} <= named
    assert named - {"build", "tests", "examples"} <= set(SOURCES)


def test_a_build_that_fails_shows_its_log(root: Path) -> None:
    (root / "build/broken").touch()
    said = "the build failed, build/build.log says why"
    for arguments in (["power_off"], ["--json"], ["--quiet"], ["playground"]):
        done = call(root, *arguments)
        assert done.returncode == 2 and done.stderr.endswith(f"no rule\nrun.sh: {said}\n")
        found = json.loads(done.stdout) if "--json" in arguments else done.stdout
        assert found == ({"exit_code": 2, "error": said} if "--json" in arguments else "")


def test_a_set_up_that_fails_is_a_document_too(root: Path) -> None:
    (root / "setup.sh").write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    done = call(root, "list", "--json")
    assert done.returncode == 2
    assert json.loads(done.stdout) == {"exit_code": 2, "error": "the set-up failed"}


def test_the_overview_needs_no_set_up(root: Path) -> None:
    (root / "setup.sh").unlink()
    for arguments in (["help"], ["--help"], ["-h"], ["--quiet", "help"]):
        done = call(root, *arguments)
        assert (done.returncode, done.stdout, done.stderr) == (0, f"{overview('./run.sh')}\n", "")
