"""Faults planted in the program that encloses motions: each has to be noticed by the checkers."""

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from tests.prove.problems import (
    SMALL,
    SOURCES,
    TOO_BROAD,
    Problem,
    check,
    check_operations,
    enclosures,
    run,
)
from tests.support.tables import tables

COMPILE = ("cc", "-std=c17", "-O1", "-ffp-contract=off", "-w")
UNCOMPILABLE = "does not compile"
WIDEST = 1e-26  # radius of free motion


@dataclass(frozen=True)
class Fault:
    """A text that is replaced in a file, which has it once."""

    name: str
    file: str
    before: str
    after: str

    def source(self, text: str) -> str:
        """The file with the fault."""
        assert text.count(self.before) == 1, f"{self.name}: {self.file} was changed"
        return text.replace(self.before, self.after)


PLANTED = tuple(Fault(*fault) for fault in tables(__file__)["fault"])


def built(folder: Path, file: str, source: str) -> Path | None:
    """The program with another source for one file; None: it does not compile."""
    for path in SOURCES.glob("*.[ch]"):
        (folder / path.name).write_text(source if path.name == file else path.read_text())
    files = sorted(folder.glob("*.c"))
    program = folder / "prove"
    done = subprocess.run([*COMPILE, *files, "-o", program, "-lm"], capture_output=True)
    return program if done.returncode == 0 else None


def noticed(program: Path) -> str | None:
    """How the checkers notice that something is wrong; None: they do not."""
    for name, problem in SMALL.items():
        answer, wrong = certified(problem, program)
        if answer != 0 or wrong:
            return f"{name}: {wrong or 'no certificate'}"
    try:
        check_operations.check(program)
    except check_operations.WrongAnswer as error:
        return f"operation {str(error)[:60]}"
    except subprocess.TimeoutExpired:
        return "no answer"
    if not enclosures(SMALL["free"].text, program)[:, :, 2].max() < WIDEST:
        return "free: too wide"
    answer, wrong = certified(TOO_BROAD, program)
    return f"too broad: {wrong}" if answer == 0 and wrong else None


def certified(problem: Problem, program: Path) -> tuple[int, str]:
    """The program's exit code, and what is wrong with its certificate."""
    certificate = program.with_name("certificate")
    try:
        answer = run(problem.text, certificate, program)
        if answer.returncode == 0:
            lines = certificate.read_text().splitlines()
            check.check(problem.text.splitlines(), answer.stdout.splitlines(), lines)
    except subprocess.TimeoutExpired:
        return 1, "no end"
    except check.WrongClaim as error:
        return 0, str(error)
    return answer.returncode, ""


def verdict(fault: Fault) -> str | None:
    """How a fault is noticed; None: it is not."""
    with tempfile.TemporaryDirectory() as folder:
        source = fault.source((SOURCES / fault.file).read_text())
        program = built(Path(folder), fault.file, source)
        return UNCOMPILABLE if program is None else noticed(program)
