"""Balls contain exact values: of operations, and of motions up to the first event."""

import math
import random
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import product
from pathlib import Path

import flint
import numpy as np
import pytest
from flint import arb

from rparm import project
from rparm.errors import UserError
from rparm.proof import checker
from rparm.proof.enclosure import Enclosure
from tests.prove.problems import (
    COMPILE,
    EXAMPLES,
    PENDULUM,
    SMALL,
    SOURCES,
    TOO_BROAD,
    enclose,
    holds,
)
from tests.support.missing import missing
from tests.support.tables import tables

OWN = Path(__file__).with_name("operations.c")


@pytest.fixture(autouse=True)
def precise() -> Iterator[None]:
    flint.ctx.prec, before = 400, flint.ctx.prec
    yield
    flint.ctx.prec = before


# ---- Operations ----------------------------------------------------------------------------------

OPERATIONS: list[Callable[[arb, arb], arb]] = [
    lambda x, y: x + y, lambda x, y: x - y, lambda x, y: x * y, lambda x, y: x / y,
    lambda x, y: x * x + y * y, lambda x, _: x.sin(), lambda x, _: x.cos(), lambda x, _: x.exp(),
    lambda x, _: x.log(), lambda x, _: x.sqrt(), lambda x, _: x.atan(), lambda x, _: x.tanh(),
]  # fmt: skip
Ball = tuple[float, float, float]


def operands(count: int) -> Iterator[tuple[Ball, Ball]]:
    """Pairs of balls: of all sizes, with low parts, with radii, and such that parts cancel."""
    draw = random.Random(9)
    for i in range(count):
        size = 2.0 ** draw.randrange(-8, 9)
        x = draw.uniform(-2, 2) * size
        y = draw.choice([draw.uniform(-2, 2), -x, x * 2.0 ** -draw.randrange(40, 70)])
        lows = [draw.uniform(-0.5, 0.5) * math.ulp(z) * draw.choice([0, 1]) for z in (x, y)]
        if i % 3 == 0:  # the low parts cancel what the sum of the high parts is off by
            lost = float(Fraction(x) + Fraction(y) - Fraction(x + y))
            low = -lost * (1 + draw.uniform(-1, 1) * 2.0 ** -draw.randrange(20, 53))
            lows[0] = low if abs(low) <= math.ulp(x) / 2 else 0.0
        radii = [abs(z) * draw.choice([0, 0, 1e-12, 0.1, 0.6]) for z in (x, y)]
        yield (x, lows[0], radii[0]), (y, lows[1], radii[1])


def first_wrong(folder: Path, built: Path) -> str | None:
    """Where a result does not contain what numbers of its operands give, or is far too wide."""
    command = [*COMPILE, f"-I{folder}", OWN, "-o", built, "-lm"]
    subprocess.run(command, check=True)
    pairs = [*operands(6000)]
    text = "\n".join(" ".join(number.hex() for ball in pair for number in ball) for pair in pairs)
    lines = subprocess.run([built], input=text, capture_output=True, text=True, check=True).stdout
    for pair, line in zip(pairs, lines.splitlines(), strict=True):
        numbers = [float.fromhex(word) for word in line.split()]
        for k, operation in enumerate(OPERATIONS):
            high, low, radius = numbers[3 * k : 3 * k + 3]
            for sides in product((-1, 1), repeat=2):
                x, y = (
                    arb(z[0]) + arb(z[1]) + side * arb(z[2])
                    for z, side in zip(pair, sides, strict=True)
                )
                exact = operation(x, y)
                if radius < math.inf and not abs(exact - arb(high) - arb(low)) <= radius + 1e-250:
                    return f"operation {k} of {pair}"
            is_exact = pair[0][2] == pair[1][2] == 0 and 0.01 < pair[0][0] < 300 and k > 4
            if is_exact and not radius <= 1e-24 * max(1, abs(high)):
                return f"operation {k} of {pair} is off by {radius}"
    return None


def test_operations_contain_what_all_numbers_of_their_balls_give(tmp_path: Path) -> None:
    assert first_wrong(SOURCES, tmp_path / "operations") is None


# ---- Closed forms --------------------------------------------------------------------------------


def widest(found: Enclosure, names: tuple[str, ...]) -> float:
    return float(found.of(names).radius.max())


def test_a_pendulum_follows_its_elliptic_function() -> None:
    """sin(phi / 2) = k cd(t sqrt(g / l)), which rests where it starts."""
    times = [0.0, 0.5, 1.3, 4.0]
    found = enclose(PENDULUM, times)
    k, root = (arb(2.5) / 2).sin(), (arb(9.81) / arb(0.7)).sqrt()
    for row, time in enumerate(times):
        sn, cn, dn = jacobi(arb(time) * root, k)
        half = (k * cn / dn).asin()
        rate = -2 * k * root * (1 - k * k) * sn / (dn * dn) / half.cos()
        assert holds(found, row, {"phi": 2 * half, "w": rate})
    assert widest(found, ("phi", "w")) < 1e-26


def jacobi(u: arb, k: arb) -> tuple[arb, arb, arb]:
    """sn, cn and dn by arithmetic-geometric means (Abramowitz, Stegun 16.4)."""
    a, b, c = [arb(1)], (1 - k * k).sqrt(), [k]
    while not c[-1].abs_upper() < arb(2) ** -300:
        a.append((a[-1] + b) / 2)
        c.append((a[-2] - b) / 2)
        b = (a[-2] * b).sqrt()
    phi = 2 ** (len(a) - 1) * a[-1] * u
    for n in range(len(a) - 1, 0, -1):
        phi = (phi + (c[n] / a[n] * phi.sin()).asin()) / 2
    # the mean is left out of c by less than this
    phi += arb(0, 1) * arb(2) ** -280
    sn = phi.sin()
    return sn, phi.cos(), (1 - k * k * sn * sn).sqrt()


def test_two_bodies_follow_kepler() -> None:
    """x = a (cos E - e), with E - e sin E = n t from the perigee."""
    times = [0.0, 60.0, 3000.0, 43200.0, 86400.0]
    found = enclose(EXAMPLES / "two_body_orbit.toml", times)
    mu, r, v = arb(3.986004418e14), arb(7e6), arb(9e3)
    a = 1 / (2 / r - v * v / mu)
    e, n = 1 - r / a, (mu / a**3).sqrt()
    for row, time in enumerate(times):
        anomaly = n * time
        angle = anomaly
        for _ in range(60):  # Newton's method, from 1 on
            step = (angle - e * angle.sin() - anomaly) / (1 - e * angle.cos())
            angle = (angle - step).mid()
        rest = (angle - e * angle.sin() - anomaly).abs_upper() / (1 - e)
        angle += arb(0, 1) * rest.abs_upper()
        b, share = (1 - e * e).sqrt(), n * a / (1 - e * angle.cos())
        exact = {"x": a * (angle.cos() - e), "y": a * b * angle.sin()}
        exact |= {"v_x": -share * angle.sin(), "v_y": share * b * angle.cos()}
        assert holds(found, row, exact)
    assert widest(found, ("x", "y")) < 1e-13


def test_a_motor_follows_its_exponentials() -> None:
    times = [0.0, 0.001, 0.1, 2.0]
    found = enclose(EXAMPLES / "dc_motor.toml", times)
    R, L, k, d, ratio = map(arb, (1.2, 2e-3, 0.05, 1e-5, 20.0))
    J = arb(2e-5) + arb(0.02) / ratio**2
    linear = flint.arb_mat([[-R / L, -k / L, 12 / L, 0], [k / J, -d / J, 0, 0],
                            [0, 0, 0, 0], [0, 1 / ratio, 0, 0]])  # fmt: skip
    for row, time in enumerate(times):
        i, speed, _, angle = [x[2] for x in (linear * arb(time)).exp().tolist()]
        assert holds(found, row, {"i": i, "speed": speed, "angle": angle})
    assert widest(found, ("i", "speed", "angle")) < 1e-26


def test_a_ball_falls_until_its_impact() -> None:
    found = enclose(EXAMPLES / "bouncing_ball.toml", [0.0, 0.2, 0.45, 0.5])
    for row, time in enumerate((0.0, 0.2, 0.45)):
        t, g = arb(time), arb(9.81)
        assert holds(found, row, {"h": 1 - g * t * t / 2, "v": -g * t})
    assert found.stopped is not None and found.stopped.reason == "event impact (h < 0)"
    impact = (2 / arb(9.81)).sqrt()
    assert impact - 1e-12 < arb(found.stopped.time) < impact
    assert len(found.times) == 3 and found.stopped.is_event


# ---- Where proofs end ----------------------------------------------------------------------------

ENDS = tables(str(Path(__file__).with_name("faults")))


@pytest.mark.parametrize(("rest", "reason", "time", "is_event"), ENDS["stop"])
def test_where_a_proof_ends(rest: str, reason: str, time: float, is_event: bool) -> None:
    stopped = enclose(f'name = "M"\n{rest}', [0.0, 0.3, 2.0]).stopped
    assert stopped is not None and stopped.reason == reason and stopped.is_event == is_event
    assert time - 1e-6 < stopped.time <= time


@pytest.mark.parametrize(("rest", "message"), ENDS["refused"])
def test_what_is_refused(rest: str, message: str) -> None:
    with pytest.raises(UserError, match=f"^model.toml: {re.escape(message)}$"):
        enclose(f'name = "M"\n{rest}', [0.0, 0.3, 2.0])


def test_a_set_that_is_too_broad_ends_the_proof() -> None:
    assert TOO_BROAD.run().returncode == 1
    assert TOO_BROAD.points[-1].split()[2] == "growth" and TOO_BROAD.check() >= 0


def test_corners_of_an_uncertain_start_are_inside() -> None:
    times, radius = [0.0, 0.4, 1.0], 1e-3
    broad = enclose(PENDULUM, times, {"phi": radius, "w": radius})
    for a, b in product((-0.999, 0.5, 0.999), repeat=2):
        one = enclose(PENDULUM, times, initial={"phi": 2.5 + a * radius, "w": b * radius})
        assert np.all(np.abs(one.high - broad.high) <= broad.radius)
    assert broad.radius.max() < 0.05


# ---- Bad problems --------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", ["nan", "inf", "word", "0x1p+0x", ""])
def test_bad_numbers_are_refused(bad: str) -> None:
    text = "".join(SMALL["arm"].problem)
    for line in ("model", "number", "rates", "start", "to"):
        asked = re.sub(rf"^{line} \S+", f"{line} {bad}", text, count=1, flags=re.MULTILINE)
        ended = subprocess.run(
            [project.proof_program()], input=asked, capture_output=True, text=True
        )
        assert ended.returncode == 2 and len(ended.stderr.splitlines()) == 1


# ---- Certificates, compilers and faults ----------------------------------------------------------


@pytest.mark.parametrize("name", SMALL)
def test_certificates_are_confirmed(name: str) -> None:
    SMALL[name].run()
    assert SMALL[name].check() > 0


@pytest.mark.parametrize("name", ["step", "box", "centre", "side", "radii", "point"])
def test_a_claim_that_is_changed_is_refused(name: str) -> None:
    """All numbers of a line are halved; of a step, the length."""
    case = SMALL["uncertain"]
    case.run()
    row = next(i for i, line in enumerate(case.claims) if line.startswith(name))
    first, *words = case.claims[row].split()
    kept = 1 if name == "step" else 0
    changed = [(float.fromhex(word) / 2).hex() for word in words[kept:]]
    case.claims[row] = " ".join([first, *words[:kept], *changed])
    with pytest.raises(checker.WrongClaim):
        case.check()


def test_smaller_results_and_missing_lines_are_refused() -> None:
    case = SMALL["functions"]
    case.run()
    points, claims = case.points, case.claims
    words = points[-1].split()
    for place in range(4, len(words), 3):
        smaller = (float.fromhex(words[place]) * 0.05).hex()
        case.points = [*points[:-1], " ".join([*words[:place], smaller, *words[place + 1 :]])]
        with pytest.raises(checker.WrongClaim, match="printed ball"):
            case.check()
    for case.points in (points[1:], [points[0], *points[2:]], [*points[:-1], points[-1][:90]]):
        with pytest.raises(checker.WrongClaim):
            case.check()
    case.points = points
    first = [i for i, line in enumerate(claims) if line.startswith("step")][1]
    for case.claims in (claims[first:], claims[: first + 2], claims[:-1]):
        with pytest.raises(checker.WrongClaim):
            case.check()


@pytest.mark.parametrize(
    ("compiler", "emulator"),
    [
        ("gcc -O3 -march=native -ffp-contract=fast", ""),
        ("clang -O2 -march=native", ""),
        ("aarch64-linux-gnu-gcc -O2 -static -ffp-contract=fast", "qemu-aarch64-static"),
    ],
)
def test_every_compiler_gives_the_same_bits(compiler: str, emulator: str, tmp_path: Path) -> None:
    command, *options = compiler.split()
    if shutil.which(command) is None or (emulator and shutil.which(emulator) is None):
        missing(f"{command}, {emulator}: ./setup.sh --platforms")
    built = tmp_path / "prove"
    flags = ["-std=c17", "-ffp-contract=off", *options]
    subprocess.run([command, *flags, SOURCES / "prove.c", "-o", built, "-lm"], check=True)
    for case in SMALL.values():
        case.run()
        started = [*filter(None, [emulator]), built]
        there = subprocess.run(started, input="".join(case.problem), capture_output=True, text=True)
        assert there.stdout.splitlines() == case.points


def is_noticed(built: Path) -> bool:
    """Whether the checker tells that something is wrong with a program."""
    for case in (*SMALL.values(), TOO_BROAD):
        try:
            case.run(built)
            case.check()
        except (checker.WrongClaim, subprocess.TimeoutExpired, IndexError):
            return True
    return False


@pytest.mark.parametrize("fault", ENDS["fault"], ids=lambda fault: fault[0])
def test_planted_faults_are_noticed(fault: list[str], tmp_path: Path) -> None:
    """A text is replaced in a file, which has it once."""
    _, file, before, after = fault
    for path in SOURCES.glob("*.[ch]"):
        text = path.read_text()
        if path.name == file:
            assert text.count(before) == 1
            text = text.replace(before, after)
        (tmp_path / path.name).write_text(text)
    built = tmp_path / "prove"
    subprocess.run([*COMPILE, tmp_path / "prove.c", "-o", built, "-lm"], check=True)
    assert is_noticed(built) or first_wrong(tmp_path, tmp_path / "operations") is not None
