"""A signal that comes between the making of a folder, or of a process, and the assignment that
remembers it: nothing is left."""

import os
from pathlib import Path

import pytest

from rparm.interruption import uninterrupted
from tests.support.programs import python

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


@pytest.mark.parametrize("stop", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(
    ("number", "command"),
    [(1, ("run", "wall_inclined")), (1, ("system", "nominal")), (3, ("system", "nominal"))],
    ids=["of an FMU", "of a system", "of a run of Ecos"],
)
def test_a_folder_that_has_just_been_made(
    tmp_path: Path, number: int, command: tuple[str, ...], stop: str
) -> None:
    stopped(tmp_path, stop, "folder", number, *command, "--report", str(tmp_path / "report"))
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_has_just_been_started(tmp_path: Path) -> None:
    report = str(tmp_path / "report")
    line = stopped(tmp_path, "SIGINT", "process", 1, "system", "nominal", "--report", report)
    assert list(tmp_path.iterdir()) == []
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
        "try: exec('raise KeyboardInterrupt')\n"  # as where numba is imported
        "except KeyboardInterrupt: program._end(130)\n"
    )
    assert python("-m", "interrupted", folder=tmp_path).returncode == 130
