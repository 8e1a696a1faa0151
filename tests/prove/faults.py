"""Faults planted in the program that encloses motions: each has to be noticed by the checkers.

python -m tests.prove.faults [--random COUNT] [--seed SEED]
"""

import argparse
import itertools
import json
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
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
from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "tests" / "mutation"))
import sites  # noqa: E402

COMPILE = ("cc", "-std=c17", "-O1", "-ffp-contract=off", "-w")
UNCOMPILABLE = "does not compile"
FILES = ("ball.h", "arm_series.h", "step.h", "arm_outputs.h")
SAMPLE = Path(__file__).with_name("random_faults.json")
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


# functions that choose a frame, an order or the length of a step: any choice is good
CHOICES = {
    "frame_along", "reflect", "dot", "expand_centre",
}  # fmt: skip
# statements whose mutants change no bound, and why
MASKED = {
    "if (!expand_centre(problem, before, efforts, step))":
        "a longer step has to pass the same checks",
    "for (double size = fabs(x.hi); size >= 0x1p-4; size *= 0.5)": "any x below 1 will do",
    "rest[i] = (rest[i] + TINY) * OUTWARD": "TINY is far below OUTWARD's part of the rest",
    "const double middle = x[0].hi + half.hi": "any box will do",
    "step->box[i] = ball_around(middle, reached[i] * (1.0 + ROOM) + ACCURATE)": "any box will do",
    "inside = inside && (reached[i] + size) * (1.0 + CONFIRMED) < step->box[i].radius":
        "a remainder that is accurate fits into the room of every box, far above 2^-12 of it",
    "for (int d = 0; d < problem->directions; d++)": "one more, which nothing reads",
    "if (i < directions)": "one more, which nothing reads",
    "const double share = inverts ? deviation / ((1.0 - deviation) * INWARD) : (double)INFINITY":
        "the deviation adds up all rows, and is far below 1, which check.py confirms",
    "coordinates[i] = (coordinates[i] + share * all * OUTWARD) * OUTWARD":
        "the deviation adds up all rows: OUTWARD of it is far below that room",
    "coordinates[i] = (sum + TINY) * OUTWARD":
        "the OUTWARD that follows covers the sum's roundings, and TINY is far below them",
    "quotient.radius = divides ? (remainder / smallest + TINY) * OUTWARD : (double)INFINITY":
        "the bounds that are divided have room for this rounding",
    "const double shifted = 134217729.0 * a":
        "only products of the lower halves are rounded then, below 8 HALF_ULP^2 of the whole",
    "step->more_orders -= step->more_orders > 0 ? 1 : 0": "any order is good",
    "const bool more = inside && !accurate && step->order < LAST_ORDER - 1": "any order is good",
    "finite = finite && ball_largest(after->centre[i]) + after->radius[i] <= DBL_MAX":
        "a certificate with numbers that are not finite is refused",
    "for (int i = 0; i <= n; i += 16)": "OUTWARD is for 32 roundings, these are 17 and a few",
    "for (int j = 3; j >= k; j--)": "a fourth derivative would be below 2^-1000",
    "const struct step_times when = {.length = ball_exact(1.0), .within = ball_exact(0.0), "
    ".elapsed = ball_of_sum(point, -problem->start),}": "order 0 does not depend on the length",
    "for (int e = 0; e < EFFORTS; e++)": "one more, which nothing reads",
    "for (int i = 0; i < OUTPUTS; i++)": "one more, which nothing reads",
}  # fmt: skip


def random_faults(seed: int) -> Iterator[sites.Mutant]:
    """Random mutants of what is calculated, without those of choices."""
    every = [mutant for name in FILES for mutant in sites.mutants_of(name, text_of(name))]
    random.Random(seed).shuffle(every)
    yield from (mutant for mutant in every if mutant.function not in CHOICES)


def sample() -> list[sites.Mutant]:
    """The random mutants that the tests plant."""
    return [sites.Mutant(**entry) for entry in json.loads(SAMPLE.read_text())]


def source_of(fault: Fault | sites.Mutant) -> str:
    """The file with the fault in it."""
    text = text_of(fault.file)
    return fault.source(text) if isinstance(fault, Fault) else sites.mutated(fault, text)


def text_of(name: str) -> str:
    return (SOURCES / name).read_text()


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


def verdict(file: str, source: str) -> str | None:
    """How a fault is noticed; None: it is not."""
    with tempfile.TemporaryDirectory() as folder:
        program = built(Path(folder), file, source)
        return UNCOMPILABLE if program is None else noticed(program)


def main() -> int:
    parser = argparse.ArgumentParser(description="Plants faults; the checkers must notice each.")
    parser.add_argument("--random", type=int, default=0, metavar="COUNT", help="draw a new sample")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    faults: list[Fault | sites.Mutant] = list(PLANTED)
    if options.random:
        faults = list(itertools.islice(random_faults(options.seed), options.random))
    alive = 0
    drawn = []
    for fault in faults:
        how = verdict(fault.file, source_of(fault))
        name, statement = (
            (fault.name, "") if isinstance(fault, Fault) else (fault.description(), fault.statement)
        )
        if how is None and statement in MASKED:
            how = f"masked: {MASKED[statement]}"
        alive += how is None
        print(f"{'ALIVE' if how is None else 'dead '} {name}: {how}", flush=True)
        if isinstance(fault, sites.Mutant) and how != UNCOMPILABLE:
            drawn.append(fault.as_dict())
    if options.random:
        SAMPLE.write_text("[\n" + ",\n".join(map(json.dumps, drawn)) + "\n]\n")
    return int(alive > 0)


if __name__ == "__main__":
    sys.exit(main())
