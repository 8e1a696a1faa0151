"""The program that encloses motions: the same bits from every compiler, and faults in it."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.prove import faults
from tests.prove.problems import SMALL, SOURCES, run
from tests.support.missing import missing

# ---- Compilers -----------------------------------------------------------------------------------


FLAGS = ["-std=c17", "-ffp-contract=off"]  # those of the build; later ones of a compiler prevail


@pytest.mark.parametrize(
    ("compiler", "emulator"),
    [
        ("gcc -O0", ""),
        ("gcc -O3 -march=native", ""),
        ("gcc -O3 -march=native -ffp-contract=fast", ""),
        ("clang -O2 -march=native", ""),
        ("aarch64-linux-gnu-gcc -O2 -static", "qemu-aarch64-static"),
        ("aarch64-linux-gnu-gcc -O2 -static -ffp-contract=fast", "qemu-aarch64-static"),
    ],
)
def test_every_compiler_gives_the_same_bits(compiler: str, emulator: str, tmp_path: Path) -> None:
    command, *options = compiler.split()
    if shutil.which(command) is None or (emulator and shutil.which(emulator) is None):
        missing(f"{command}, {emulator}: ./setup.sh --platforms")
    program = tmp_path / "prove"
    sources = sorted(SOURCES.glob("*.c"))
    subprocess.run([command, *FLAGS, *options, *sources, "-o", program, "-lm"], check=True)
    started = [emulator, program] if emulator else [program]
    for problem in SMALL.values():
        there = subprocess.run(
            started, input=problem.text, capture_output=True, text=True, check=False
        )
        assert there.stdout == run(problem.text).stdout != ""


def test_fast_mathematics_is_refused(tmp_path: Path) -> None:
    """It would calculate the errors of operations as 0."""
    command = ["gcc", *FLAGS, "-ffast-math", SOURCES / "prove.c", "-o", tmp_path / "prove", "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "-ffast-math" in done.stderr


# ---- Faults --------------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", faults.PLANTED, ids=lambda fault: fault.name)
def test_planted_faults_are_noticed(fault: faults.Fault) -> None:
    how = faults.verdict(fault)
    assert how not in (None, faults.UNCOMPILABLE)
