"""The program that encloses motions gives the same bits from every compiler and processor."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.prove.problems import SMALL, SOURCES, run
from tests.support.missing import missing

FLAGS = ["-std=c17", "-ffp-contract=off"]


@pytest.mark.parametrize(
    ("compiler", "emulator"),
    [
        ("gcc -O0", ""),
        ("gcc -O3 -march=native", ""),
        ("clang -O2 -march=native", ""),
        ("aarch64-linux-gnu-gcc -O2 -static", "qemu-aarch64-static"),
    ],
)
def test_every_compiler_gives_the_same_bits(compiler: str, emulator: str, tmp_path: Path) -> None:
    command = compiler.split()
    if shutil.which(command[0]) is None or (emulator and shutil.which(emulator) is None):
        missing(f"{command[0]}, {emulator}: ./setup.sh --platforms")
    program = tmp_path / "prove"
    sources = sorted(SOURCES.glob("*.c"))
    subprocess.run([*command, *FLAGS, *sources, "-o", program, "-lm"], check=True)
    started = [emulator, program] if emulator else [program]
    for problem in SMALL.values():
        there = subprocess.run(
            started, input=problem.text, capture_output=True, text=True, check=False
        )
        assert there.stdout == run(problem.text).stdout != ""
