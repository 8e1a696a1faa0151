"""Faults planted in the program that encloses motions: each has to be noticed by the checkers.

python -m tests.prove.faults
"""

import subprocess
import sys
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

COMPILE = ("cc", "-std=c17", "-O1", "-ffp-contract=off", "-w")
UNCOMPILABLE = "does not compile"
WIDEST = 1e-26  # radius of free motion


@dataclass(frozen=True)
class Fault:
    """A text that is replaced in a file, which has it once; and others."""

    name: str
    file: str
    before: str
    after: str
    also: tuple[tuple[str, str], ...] = ()

    def source(self, text: str) -> str:
        """The file with the fault."""
        for before, after in ((self.before, self.after), *self.also):
            assert text.count(before) == 1, f"{self.name}: {self.file} was changed"
            text = text.replace(before, after)
        return text


PLANTED = (
    Fault("sum: one rounding", "ball.h", "(fabs(lower) + fabs(rest))", "fabs(rest)"),
    Fault("sum: the other one", "ball.h", "(fabs(lower) + fabs(rest))", "fabs(lower)"),
    Fault("product: rounding of the lower parts", "ball.h", "+ 8.0 * HALF_ULP * products", ""),
    Fault("convolution: rounding of the lower sum", "ball.h", "(low_sizes + 8.0", "(8.0"),
    Fault("product: radius times radius", "ball.h", "(fabs(b.hi) + b.radius)", "fabs(b.hi)"),
    Fault("radii rounded to nearest", "ball.h", "(1.0 + 0x1p-48)", "1.0"),
    Fault("quotient: smallest divisor", "ball.h", "= ball_smallest(y)", "= fabs(y.hi)"),
    Fault(
        "quotient: remainder", "ball.h",
        "ball_largest(ball_difference(x, ball_product(quotient, y)))", "x.radius",
    ),
    Fault(
        "tail of the sine", "ball.h", "ball_widened(sum, ball_largest(term))",
        "ball_widened(sum, (int)k % 2 ? 0.0 : ball_largest(term))",
    ),
    Fault(
        "tail of the cosine", "ball.h", "ball_widened(sum, ball_largest(term))",
        "ball_widened(sum, (int)k % 2 ? ball_largest(term) : 0.0)",
    ),
    Fault("radius of the sine's angle", "ball.h", "*sine = ball_widened(s, x.radius)", "*sine = s"),
    Fault(
        "inputs at the begin of the step only", "step.h",
        "arm_efforts(problem, &step->times, whole, efforts)",
        "arm_efforts(problem, &step->times, ball_exact(0.0), efforts)",
    ),
    # a remainder that is accurate fits into the room of every box: the check of the box is masked
    # by that bound, and seen without it
    Fault("box not checked", "step.h", "return inside && accurate;", "return true;"),
    Fault("box without the first order's range", "step.h", "reached[i] += ball_largest(half);", ""),
    Fault("box without higher orders", "step.h", "reached[i] += ball_largest(x[k]);", ""),
    Fault(
        "remainder over the hull", "step.h", "begin(&series, problem, step->box,",
        "begin(&series, problem, step->hull,",
    ),
    Fault(
        "no remainder at the end", "step.h", "ball_sum(step->endpoint[i], step->remainder[i])",
        "step->endpoint[i]",
    ),
    Fault("inverse without its bound", "step.h", "share * all * OUTWARD", "0.0"),
    Fault("deviation of the frame", "step.h", "deviation *= OUTWARD;", "deviation = 0x1p-60;"),
    Fault(
        "hull without the frame", "step.h", "fabs(set->side[j][i])",
        "(j < STATES ? 0.0 : fabs(set->side[j][i]))",
    ),
    Fault(
        "derivatives at the centre", "step.h", "begin(&hull, problem, step->hull,",
        "begin(&hull, problem, before->centre,",
    ),
    Fault(
        "rounding of the spread", "step.h",
        "rest[i] += ball_largest(difference) * before->radius[j];", "",
    ),
    Fault(
        "radius of the endpoint", "step.h", "rest[i] = end.radius;",
        "rest[i] = step->remainder[i].radius;",
    ),
    Fault("time within the step", "arm_series.h", "ball_sum(times->within, after)", "after"),
    Fault(
        "parameters without radii", "step.h",
        "begin(&series, problem, step->box, false, 0)",
        "begin(&series, problem, step->box, true, 0)",
    ),
    Fault(
        "outputs without radii", "arm_outputs.h",
        "ball_widened(outputs[i], outputs[i].radius * LOOSENED)", "ball_midpoint(outputs[i])",
    ),
    Fault(
        "outputs with efforts of the step's begin", "prove.c", "ball_of_sum(time, -from), efforts",
        "ball_exact(0.0), efforts",
    ),
    Fault("outputs with another Coriolis term", "arm_outputs.h", "v)), 2.0)", "v)), 1.0)"),
    Fault("another velocity of the end effector", "arm_outputs.h", "ball_product(w, y)", "v"),
)  # fmt: skip


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


def main() -> int:
    alive = 0
    for fault in PLANTED:
        how = verdict(fault)
        alive += how is None
        print(f"{'ALIVE' if how is None else 'dead '} {fault.name}: {how}", flush=True)
    return int(alive > 0)


if __name__ == "__main__":
    sys.exit(main())
