"""The command line as strangers use it: odd folders, narrow terminals, readers that leave."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rparm import project
from rparm.command_line import file_or_name, retyped
from rparm.interruption import uninterrupted
from rparm.needs import NO_READER
from tests.support.paths import ROOT
from tests.support.programs import python, run
from tests.support.rparm_project import BUILD, MISTAKES, Console

COMMAND = [sys.executable, "-P", "-m", "rparm"]


def started(*arguments: str, folder: Path = ROOT, **options: object) -> subprocess.Popen:
    return subprocess.Popen(
        [*COMMAND, *arguments], cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE, **options,
    )  # fmt: skip


# ---- Names ---------------------------------------------------------------------------------------

REFUSED = MISTAKES["name"]


@pytest.mark.parametrize("what", REFUSED)
def test_a_name_that_is_wrong_gets_a_guess_or_a_reason(what: str, console: Console) -> None:
    arguments, words = REFUSED[what]
    assert words in console.refused(*arguments)


def test_campaigns_of_the_project_have_names(console: Console) -> None:
    code, out, _ = console("campaign", "--list")
    assert code == 0 and [line.split()[0] for line in out.splitlines()] == [
        path.stem for path in sorted(ROOT.glob("models/*/campaigns/*.toml"), key=lambda x: x.stem)
    ]
    assert project.campaign_file("tolerance").parent.parent.name == "machine"


def test_what_to_type_again_leads_there_from_the_projects_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(ROOT / "models")
    for given, typed in (("mine/X.FMU", "models/mine/X.FMU"), ("RPPlant", "RPPlant")):
        again = retyped("linearize", [file_or_name(given, (".fmu", ".ssp"))], {})
        assert again == f"./run.sh linearize {typed}"


# ---- Folders whose names are not UTF-8 ----------------------------------------------------------

ODD = os.fsdecode(b"caf\xe9")  # in Latin-1


@pytest.fixture
def odd_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with FMUs and a system."""
    folder = tmp_path / ODD
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this system has no such names")
    for name in ("RPPlant.fmu", "ClosedLoop.ssp"):
        shutil.copy(BUILD / name, folder)
    monkeypatch.chdir(folder)
    return folder


IN_ODD_FOLDERS = {
    "nothing shown": ["run", f"{ODD}.toml", "--output", "out", "--json", "--quiet"],
    "scenario": ["run", f"{ODD}.toml", "--output", "out", "--json"],
    "scenario elsewhere": ["run", "{}/" + f"{ODD}.toml", "--output", "{}/out", "--json"],
    "system in Ecos": ["system", "nominal", "--ssp", "ClosedLoop.ssp", "--output", "out", "--json"],
    "linear": ["linearize", "{}/ClosedLoop.ssp", "--output", "out", "--save", "{}/a.mat", "--json"],
    "model": ["build", f"{ODD}-model.toml", "--output", "{}", "--json"],
    "copy": ["fmu", "rp_plant", "--output", "{}/new", "--json"],
    "document": ["list", "--output", "{}", "--json"],
}


def test_a_folder_may_have_any_name(odd_folder: Path, console: Console) -> None:
    assert console("new", "mine", "--model", "RPPlant.fmu")[0] == 0
    (odd_folder / "mine.toml").rename(odd_folder / f"{ODD}.toml")
    text = (ROOT / "examples" / "models" / "dahlquist.toml").read_text(encoding="utf-8")
    (odd_folder / f"{ODD}-model.toml").write_text(text, encoding="utf-8")
    for what, arguments in IN_ODD_FOLDERS.items():
        code, out, err = console(*(text.format(odd_folder) for text in arguments))
        assert (code, json.loads(out)["exit_code"]) == (0, 0), (what, err)
        assert "Traceback" not in err


def test_toml_names_no_such_file(odd_folder: Path, console: Console) -> None:
    error = console.refused("new", "x", "--model", "RPPlant.fmu", "--output", odd_folder.parent)
    assert "TOML has no such name, which is not UTF-8" in error
    assert not (odd_folder.parent / "x.toml").exists()


# ---- Terminals and readers -----------------------------------------------------------------------


@pytest.mark.parametrize("columns", [1, 9, 0, -1])
def test_a_terminal_may_be_narrow(
    columns: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, console: Console
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    for arguments in (["list"], ["help", "campaign"], ["fmu", "rp_plant", "--output", tmp_path]):
        code, out, _ = console(*arguments)
        assert code == 0 and out.strip()
    assert console("linearize", "RPPlant", "--output", tmp_path)[0] == 0
    assert console("run", "free_fall", "--tolerance", "1e-6", "--output", tmp_path)[0] == 0


@pytest.mark.parametrize(
    "arguments", [["list", "--json", "--quiet"], ["help", "run"]], ids=" ".join
)
def test_it_ends_as_by_a_signal_where_nobody_reads(arguments: list[str]) -> None:
    """As other programs do: `rparm list | head -1` is no bad result."""
    reading, writing = os.pipe()
    os.close(reading)
    with started(*arguments, stdout=writing) as process:
        os.close(writing)
        assert process.stderr is not None
        assert process.stderr.read() == b""
    assert process.returncode == NO_READER == 128 + 13


@pytest.mark.parametrize("arguments", [["linearize", "RPPlant"], ["--json", "--version"]])
def test_a_current_folder_that_is_gone_is_named(arguments: list[str], tmp_path: Path) -> None:
    script = 'mkdir gone && cd gone && rmdir ../gone && exec "$@"'
    command = ["sh", "-c", script, "sh", *COMMAND, *arguments]
    done = run(*command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == 2 and "the current folder cannot be used: " in done.stderr
    assert done.stderr.count("error:") == 1


# ---- Signals between the making of a thing and its assignment ------------------------------------


# Sends itself a signal right after the call of a function with a certain number.
PROGRAM = """
import os, signal, subprocess, sys
from rparm.__main__ import _as_program

kind, number, stop, *sys.argv[1:] = sys.argv[1:]
made = []

def interrupted(function, is_meant):
    def call(*arguments, **options):
        result = function(*arguments, **options)
        if is_meant(arguments):
            made.append(result)
            if len(made) == int(number):
                print("made", result, flush=True)
                os.kill(os.getpid(), getattr(signal, stop))
        return result
    return call

if kind == "folder":
    is_ours = lambda arguments: os.path.basename(arguments[0]).startswith("rparm-")
    os.mkdir = interrupted(os.mkdir, is_ours)
else:
    is_child = lambda arguments: "rparm.systems.ecos" in arguments[0]
    subprocess._fork_exec = interrupted(subprocess._fork_exec, is_child)
sys.exit(_as_program())
"""


def stopped(folder: Path, stop: str, kind: str, number: int, *command: str) -> str:
    """Run a command until it is stopped; the line that says what had just been made."""
    environment = {"TMPDIR": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    done = python("-c", PROGRAM, kind, number, stop, *command, environment=environment)
    expected = {"SIGINT": (130, "interrupted\n"), "SIGTERM": (143, "")}
    assert (done.returncode, done.stderr) == expected[stop]
    return next(line for line in done.stdout.splitlines() if line.startswith("made"))


@pytest.mark.parametrize(
    ("stop", "kind", "number", "command"),
    [
        ("SIGTERM", "folder", 1, ("run", "wall_inclined")),
        ("SIGINT", "folder", 1, ("system", "nominal")),
        ("SIGTERM", "folder", 3, ("system", "nominal")),
        ("SIGINT", "process", 1, ("system", "nominal")),
    ],
    ids=["folder of an FMU", "folder of a system", "folder of a run of Ecos", "process of Ecos"],
)
def test_what_has_just_been_made(
    tmp_path: Path, stop: str, kind: str, number: int, command: tuple[str, ...]
) -> None:
    line = stopped(tmp_path, stop, kind, number, *command, "--report", str(tmp_path / "report"))
    assert list(tmp_path.iterdir()) == []
    if kind == "process":
        with pytest.raises(ProcessLookupError):
            os.kill(int(line.split()[1]), 0)


def test_signals_wait_until_the_end_of_the_outer_block(tmp_path: Path) -> None:
    program = """
import os, signal
from rparm.interruption import handle_endings, uninterrupted
received = handle_endings()
done = []
try:
    with uninterrupted():
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGTERM)
            done.append(1)
        done.append(2)
        os.kill(os.getpid(), signal.SIGINT)
    done.append(3)
except SystemExit as end:
    print(done, end.code, [signal.Signals(n).name for n in received])
with uninterrupted():
    print("goes on")
"""
    done = python("-c", program, check=True)
    assert done.stdout == "[1, 2] 143 ['SIGTERM', 'SIGINT']\ngoes on\n"


def test_an_exception_in_a_block_stays_what_it_is() -> None:
    with pytest.raises(ValueError, match="of the block"), uninterrupted():
        raise ValueError("of the block")


def test_an_interrupt_that_was_caught_does_not_set_the_exit_code(tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(
        "from rparm import __main__ as program\n"
        "try: exec('raise KeyboardInterrupt')\n"
        "except KeyboardInterrupt: program._end(130)\n"
    )
    assert python("-m", "interrupted", folder=tmp_path).returncode == 130
