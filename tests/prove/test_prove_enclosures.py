"""Balls that contain the arm's motion, against references and other arithmetic; certificates.

And the program that makes them: the same bits from every compiler, and faults in it.
"""

import json
import random
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path

import flint
import numpy as np
import pytest
from flint import arb

from rparm import project
from rparm.fmi.fmu_file import read_model
from rparm.runs import convergence
from tests.prove.problems import (
    BUILD,
    COMPILE,
    PARAMETERS,
    PROGRAM,
    SMALL,
    SOURCES,
    TOO_BROAD,
    ZERO,
    Problem,
    check,
    check_operations,
    enclosures,
    motion_series,
    run,
)
from tests.support.missing import missing
from tests.support.tables import tables

STATES = ("q1", "q2", "dq1", "dq2")
NAMES = ("m1", "m2", "I1z", "I2z", "l1", "lc1", "a", "g")
FOLDER = project.model("rp_manipulator")
MODEL = read_model(BUILD / "RPManipulator.fmu")


def half_unit(values: np.ndarray) -> np.ndarray:
    return np.spacing(np.abs(values)) / 2


# ---- Against references --------------------------------------------------------------------------


def test_exact_states_of_convergence_are_nearly_nearest_doubles() -> None:
    problem = convergence.load(FOLDER / "convergence" / "smooth_inputs.toml", MODEL)
    scenario = problem.scenario
    sines = convergence.smooth_inputs(scenario)
    offsets = [sines[name].offset for name in ("tau1", "f2")]
    smooth = Problem(
        [scenario.start_values[name] for name in STATES],
        [(scenario.stop, (offsets[0],), (offsets[1],))],
        [scenario.start_values[name] for name in NAMES],
        sines=[(i, *term) for i, name in enumerate(("tau1", "f2")) for term in sines[name].terms],
        start=scenario.start,
    )
    end = enclosures(smooth.text)[-1, :4]
    exact = json.loads(project.exact_state_file(scenario.path).read_text())["final"]
    values = np.array([exact[name] for name in STATES])
    assert end[:, 2].max() < 1e-21
    errors = np.abs((values - end[:, 0]) - end[:, 1]) + end[:, 2]
    assert np.all(errors <= half_unit(values) + 2e-16)


# ---- Against 300 bits ----------------------------------------------------------------------------

BITS, ORDER, STEP = 300, 31, 0.02  # of series over steps of so many s


@pytest.fixture
def precise() -> Iterator[None]:
    flint.ctx.prec, before = BITS, flint.ctx.prec
    yield
    flint.ctx.prec = before


def taylor(cubic: Sequence[float], time: arb, step: arb) -> list[arb]:
    """Coefficients of (t / step)^k, at a time, of a cubic from its derivatives at the start."""

    def derivative(k: int) -> arb:
        terms = (arb(u) * time**j / arb.fac_ui(j) for j, u in enumerate(cubic[k:]))
        return sum(terms, arb(0))

    return [derivative(k) * step**k / arb.fac_ui(k) for k in range(ORDER)]


def integrate(
    states: Sequence[float], parameters: Sequence[arb], cubics: Sequence[Sequence[float]], end: arb
) -> list[arb]:
    """q1, q2, dq1, dq2 at the end, by the checker's series, whose equations test_same_equations.py
    compares with the plain ones."""
    count = int(float(end) / STEP) + 1
    step, found = end / count, [arb(x) for x in states]
    for i in range(count):
        efforts = [taylor(cubic, i * step, step) for cubic in cubics]
        rows = motion_series.coefficients(found, parameters, efforts, step, ORDER)
        found = [arb(sum((x[0] for x in row), arb(0)).mid()) for row in rows]
    return found


def values_at(
    states: Sequence[float], arm: Sequence[float], cubics: Sequence[Sequence[float]], time: float
) -> list[arb]:
    """States and outputs after a time in s."""
    end, parameters = arb(time), [arb(p) for p in arm]
    found = integrate(states, parameters, cubics, end)
    efforts = [taylor(cubic, end, end)[0] for cubic in cubics]
    return [*found, *motion_series.outputs(found, parameters, efforts)]


def inside(states: Sequence[arb], balls: np.ndarray) -> bool:
    return all(
        abs(x - arb(hi) - arb(lo)) < arb(radius)
        for x, (hi, lo, radius) in zip(states, balls, strict=True)
    )


def random_problem(draw: random.Random) -> Problem:
    parameters = [draw.uniform(low, 3 * low) for low in (1, 0.5, 0.05, 0.02, 0.3, 0.1)]
    parameters += [draw.uniform(-0.3, 0.3), draw.choice((0.0, 1.62, 9.81))]
    cubics = [[draw.uniform(-size, size) for size in (5, 10, 20, 50)] for _ in range(2)]
    states = [draw.uniform(-3, 3), draw.uniform(0, 1), draw.uniform(-2, 2), draw.uniform(-1, 1)]
    return Problem(states, [(draw.uniform(0.03, 0.1), *cubics)], parameters)


@pytest.mark.usefixtures("precise")
@pytest.mark.parametrize("seed", range(200))
def test_random_arms_are_where_300_bits_say(seed: int) -> None:
    problem = random_problem(random.Random(seed))
    start, end = enclosures(problem.text)
    time, *cubics = problem.steps[0]
    assert end[:4, 2].max() < 1e-27 and end[4:, 2].max() < 1e-24
    for balls, at in ((start, 0.0), (end, time)):
        assert inside(values_at(problem.states, problem.parameters, cubics, at), balls)


@pytest.mark.usefixtures("precise")
def test_uncertain_starts_and_parameters() -> None:
    """All corners of the starts, each with parameters at random ends, and points between."""
    radii, parameter_radii = (1e-3, 1e-3, 2e-3, 1e-3), (0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3, 0.0)
    states, cubics = (-1.0, 0.3, 1.0, 0.5), ((1.0, 2.0, 0.0, 0.0), (-9.0, 0.0, 5.0, 0.0))
    problem = Problem(states, [(0.2, *cubics)], radii=radii, parameter_radii=parameter_radii)
    end = enclosures(problem.text)[-1]
    assert end[:4, 2].max() < 0.02
    draw = random.Random(1)
    corners = list(product((-1.0, 1.0), repeat=4))
    points = [[draw.uniform(-1, 1) for _ in range(4)] for _ in range(4)]
    for point in corners + points:
        start = [x + share * r for x, share, r in zip(states, point, radii, strict=True)]
        arm = [
            p + draw.choice((-0.999, 0.999)) * r
            for p, r in zip(PARAMETERS, parameter_radii, strict=True)
        ]
        assert inside(values_at(start, arm, cubics, 0.2), end)


# ---- Certificates --------------------------------------------------------------------------------


def certified(problem: Problem, folder: Path) -> tuple[list[str], list[str], list[str]]:
    certificate = folder / "certificate"
    points = run(problem.text, certificate).stdout
    return tuple(text.splitlines() for text in (problem.text, points, certificate.read_text()))


def test_operations_are_confirmed() -> None:
    assert check_operations.check(PROGRAM, seed=2) > 1000


@pytest.mark.parametrize("name", SMALL)
def test_certificates_are_confirmed(name: str, tmp_path: Path) -> None:
    assert check.check(*certified(SMALL[name], tmp_path)) > 0


CLAIMS = ("times", "hull", "box", "remainder", "endpoint", "jacobian", "deviation", "radii")


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_without_its_radius_is_refused(name: str, tmp_path: Path) -> None:
    problem, points, certificate = certified(SMALL["uncertain"], tmp_path)
    row = [i for i, line in enumerate(certificate) if line.startswith(name)][-1]
    words = certificate[row].split()
    place = -1 if name != "times" else 1
    words[place] = "0x0p+0"
    certificate[row] = " ".join(words)
    with pytest.raises(check.WrongClaim):
        check.check(problem, points, certificate)


def test_a_smaller_result_is_refused(tmp_path: Path) -> None:
    problem, points, certificate = certified(SMALL["uncertain"], tmp_path)
    words = points[-1].split()
    variables = [f"state {i}" for i in range(4)] + [f"output {i}" for i in range(10)]
    for i, variable in enumerate(variables):
        place = 4 + 3 * i
        share = 0.999 if i < 4 else 0.25  # the checker's sines are narrower
        smaller = (float.fromhex(words[place]) * share).hex()
        points[-1] = " ".join([*words[:place], smaller, *words[place + 1 :]])
        with pytest.raises(check.WrongClaim, match=f"printed ball of {variable}"):
            check.check(problem, points, certificate)


def words_kept(points: list[str], row: int, kept: int) -> list[str]:
    """Points of which one has only the first words."""
    return [*points[:row], " ".join(points[row].split()[:kept]), *points[row:][1:]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, c: (words_kept(p, 0, 2), c), "balls for"),
        (lambda p, c: (words_kept(p, len(p) - 1, 2), c), "balls for"),
        (lambda p, c: (words_kept(p, len(p) - 1, -3), c), "balls for"),
        (lambda p, c: (p, [re.sub(r"^step \d+", "step 0", x) for x in c]), "order below 1"),
        (lambda p, c: (p, [re.sub(r"^step \d+", "step -1", x) for x in c]), "order below 1"),
        (lambda p, c: ([p[0].replace("0x0p+0", "0x1p-1", 1), *p[1:]], c), "time of the start"),
        # a missing step
        (lambda p, c: (p, c[[i for i, x in enumerate(c) if x.startswith("step")][1] :]), ""),
    ],
)
def test_other_results_or_steps_are_refused(
    change: Callable[[list[str], list[str]], tuple], message: str, tmp_path: Path
) -> None:
    problem, points, certificate = certified(SMALL["free"], tmp_path)
    with pytest.raises(check.WrongClaim, match=message):
        check.check(problem, *change(points, certificate))


# ---- What is no problem --------------------------------------------------------------------------


def test_a_set_that_is_too_broad_stops_the_proof() -> None:
    answer = run(TOO_BROAD.text)
    assert answer.returncode == 1
    name, reached = answer.stdout.splitlines()[-1].split()
    assert name == "stopped" and 0 <= float.fromhex(reached) < 0.1


def test_an_inertia_that_may_vanish_stops_the_proof() -> None:
    """Without the bodies' inertia, J is 0 where link 2 passes the joint, at 0.25 s."""
    parameters = (0.0, 1.0, 0.0, 1e-30, 0.5, 0.0, 0.1, 0.0)
    problem = Problem((0.0, -0.25, 0.0, -1.0), [(1.0, ZERO, ZERO)], parameters)
    answer = run(problem.text)
    assert answer.returncode == 1
    assert 0.2 < float.fromhex(answer.stdout.split()[-1]) < 0.25


def test_a_stop_within_the_last_place_of_a_time_is_a_stop() -> None:
    """The slide would pass the joint at 3/4 of a step whose ends are neighbours."""
    parameters = (0.0, 1.0, 0.0, 1e-50, 0.5, 0.0, 0.1, 0.0)
    states = (0.0, -(0.5 - 3 * 2.0**-54), 0.0, -1.0)
    answer = run(Problem(states, [(1 + 2.0**-52, ZERO, ZERO)], parameters, start=1.0).text)
    assert answer.returncode == 1
    assert answer.stdout.splitlines()[-1] == "stopped 0x1p+0"


@pytest.mark.parametrize("bad", ["nan", "inf", "1e200", "word", "0x1p+0x"])
def test_bad_numbers_are_refused(bad: str) -> None:
    text = SMALL["free"].text
    for line in ("parameters", "states", "start", "to"):
        answer = run(re.sub(rf"^{line} \S+", f"{line} {bad}", text, flags=re.MULTILINE))
        assert answer.returncode == 2
        assert len(answer.stderr.splitlines()) == 1


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="Linux has it")
def test_points_that_are_lost_are_no_answer() -> None:
    """As on a disk that is full."""
    with FULL.open("w") as full:
        answer = subprocess.run(
            [PROGRAM], input=SMALL["held"].text, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert answer.returncode == 2
    assert answer.stderr == "what is proven cannot be written\n"


def test_a_number_that_is_finite_but_too_large_is_called_so() -> None:
    answer = run(re.sub(r"^states \S+", "states 1e200", SMALL["free"].text, flags=re.MULTILINE))
    assert answer.returncode == 2
    assert "numbers up to 1.2e30" in answer.stderr


# ---- Compilers and faults ------------------------------------------------------------------------


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

WIDEST = 1e-26  # radius of free motion
FAULTS = tables(str(Path(__file__).with_name("faults")))["fault"]


def wrong_of(problem: Problem, program: Path) -> str | None:
    """What is wrong with a program's certificate; None if it has none."""
    certificate = program.with_name("certificate")
    try:
        answer = run(problem.text, certificate, program)
        if answer.returncode != 0:
            return None
        lines = certificate.read_text().splitlines()
        check.check(problem.text.splitlines(), answer.stdout.splitlines(), lines)
    except subprocess.TimeoutExpired:
        return None
    except check.WrongClaim as error:
        return str(error)
    return ""


def is_noticed(program: Path) -> bool:
    """Whether the checkers notice that something is wrong with a program."""
    if any(wrong_of(problem, program) != "" for problem in SMALL.values()):
        return True
    try:
        check_operations.check(program)
    except (check_operations.WrongAnswer, subprocess.TimeoutExpired):
        return True
    is_wide = not enclosures(SMALL["free"].text, program)[:, :, 2].max() < WIDEST
    return is_wide or bool(wrong_of(TOO_BROAD, program))


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault[0])
def test_planted_faults_are_noticed(fault: list[str], tmp_path: Path) -> None:
    """A text is replaced in a file, which has it once."""
    _, file, before, after = fault
    for path in SOURCES.glob("*.[ch]"):
        text = path.read_text()
        if path.name == file:
            assert text.count(before) == 1
            text = text.replace(before, after)
        (tmp_path / path.name).write_text(text)
    program = tmp_path / "prove"
    command = [*COMPILE, *sorted(tmp_path.glob("*.c")), "-o", program, "-lm"]
    subprocess.run(command, check=True)
    assert is_noticed(program)
