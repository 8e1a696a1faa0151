"""run.sh: which command it calls where, what it builds before, and what is printed where.

Set-up, CMake and Python are small scripts here that say how they are called.
"""

import json
import os
import pty
import shutil
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest

from rparm.command_line import COMMANDS, EXIT_CODES
from tests.support.paths import ROOT

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
print(json.dumps({"here": os.getcwd(), "arguments": sys.argv[1:]}))
"""


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A project with run.sh and nothing but small scripts below it."""
    root = tmp_path / "the project"
    scenarios = Path("models/rp_plant/scenarios")
    shutil.copytree(ROOT / scenarios, root / scenarios)
    shutil.copy(ROOT / "run.sh", root)
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
    return subprocess.run(
        [root / "run.sh", *arguments],
        cwd=root.parent / "folder of a user",
        env={**os.environ, "PATH": f"{root / 'bin'}:{os.environ['PATH']}"},
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        check=False,
    )


NOT_BUILT = [
    (["list"], ["list"]),
    (["--list"], ["--list"]),
    (["--version"], ["--version"]),
    (["run", "--list"], ["run", "--list"]),
    (["--json", "list"], ["--json", "list"]),
    (["help", "system"], ["help", "system"]),
    (["help", "playground"], ["help", "playground"]),
    (["--json", "help"], ["--json", "help"]),
    (["--help", "--json"], ["--help", "--json"]),
    (["completion", "bash"], ["completion", "bash"]),
    (["system", "--help"], ["system", "--help"]),
    (["federate", "a", "b"], ["federate", "a", "b"]),
    (["sytem"], ["sytem"]),  # no name of a scenario: refused at once
    (["my_scenario", "--quiet"], ["my_scenario", "--quiet"]),
]
BUILT = [
    ([], ["run"]),
    (["--json"], ["run", "--json"]),
    (["--fmi", "3"], ["--fmi", "3"]),
    (["power_off", "a b"], ["power_off", "a b"]),
    (["My Scenario.TOML"], ["My Scenario.TOML"]),
    (["system", "--json", "--", "--help"], ["system", "--json", "--", "--help"]),
    (["new", "x"], ["new", "x"]),
    (["fmu", "RPPlant"], ["fmu", "RPPlant"]),
    (["playground", "--open"], ["playground", "--open"]),
]


@pytest.mark.parametrize(
    ("arguments", "wanted", "built"),
    [(*case, False) for case in NOT_BUILT] + [(*case, True) for case in BUILT],
)
def test_which_command_is_called(
    root: Path, arguments: list[str], wanted: list[str], built: bool
) -> None:
    """In the user's folder, and with nothing on standard output but what the command prints."""
    done = call(root, *arguments)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["here"] == str(root.parent / "folder of a user")
    assert found["arguments"] == ["-P", "-m", "rparm", *wanted]
    assert (root / "build/built").exists() == built
    said = done.stderr.splitlines()
    what = "the playground" if "playground" in arguments else "the FMUs"
    stages = ["run.sh: configuring", f"run.sh: building {what}"] if built else []
    if "--quiet" in arguments:
        assert said == []
    else:
        assert said[0].startswith("set up") and said[1:] == stages
    assert done.stderr.replace("\n", "").isprintable()


def test_quiet_says_nothing(root: Path) -> None:
    done = call(root, "--quiet", "system")
    assert (done.returncode, done.stderr) == (0, "") and (root / "build/built").exists()


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


def test_help_names_every_command(root: Path) -> None:
    for arguments in (["help"], ["--help"], ["-h"], ["--quiet", "help"]):
        done = call(root, *arguments)
        assert (done.returncode, done.stderr) == (0, "")
        for command in (*COMMANDS.keys() - {"run"}, "help COMMAND"):
            assert f"./run.sh {command} " in done.stdout
        assert EXIT_CODES.removeprefix("exit codes: ") in done.stdout
        assert max(map(len, done.stdout.splitlines())) <= 80
