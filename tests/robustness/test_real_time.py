"""How much work a step can be, by instructions and lines of a cache: docs/real-time.md."""

import os
import re
import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.support.missing import missing
from tests.support.paths import FMI_HEADERS
from tests.support.rparm_project import BUILD

STEPS = os.environ.get("REAL_TIME_STEPS", "100000")
PROGRAM = BUILD / "tests" / "robustness" / "real_time"
LIBRARY = BUILD / "fmu" / "RPPlant" / "RPPlant.so"
METHODS = {"cvode_adams": 1, "taylor": 4}
# Largest work of a step over the median of those without events, by events in the step: the first
# for a step without any, the second more for each event.
BOUNDS = {"cvode_adams": (13, 4), "taylor": (8, 6)}
RARE = {"cvode_adams": 4, "taylor": 5}  # what ten million steps add to the first


@dataclass
class Steps:
    """Steps with so many events."""

    events: int
    count: int
    median: int  # blocks of code
    largest: int


def output(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def counting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """RPPlant from its own sources, compiled so that it counts blocks of code."""
    archive = BUILD / "release" / "RPPlant.fmu"
    if not archive.exists():
        missing("build/release: ./release.sh")
    folder = tmp_path_factory.mktemp("counting")
    with zipfile.ZipFile(archive) as opened:
        names = [name for name in opened.namelist() if name.startswith("sources/")]
        opened.extractall(folder, names)
    library = folder / "RPPlant.so"
    options = ["-O3", "-ffp-contract=off", "-fPIC", "-shared", "-w", "-fsanitize-coverage=trace-pc"]
    options.append(f"-I{FMI_HEADERS}")
    output("gcc", *options, "-o", library, *sorted((folder / "sources").glob("*.c")), "-lm")
    return library


def instructions(method: int, work: Path) -> int:
    """Instructions of the step of a file, in the library as it is delivered."""
    if shutil.which("valgrind") is None:
        missing("valgrind: ./setup.sh --platforms")
    text = output(
        "valgrind", "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=fmi2DoStep",
        "--callgrind-out-file=/dev/null", PROGRAM, "replay", LIBRARY, method, work,
    )  # fmt: skip
    return int(re.search(r"Collected : (\d+)", text)[1])


@pytest.mark.parametrize("restitution", [0, 0.5])
@pytest.mark.parametrize("method", METHODS)
def test_work_of_a_step_is_bounded_by_its_events(
    method: str, restitution: float, counting: Path, tmp_path: Path
) -> None:
    number = METHODS[method]
    worst, median = tmp_path / "worst", tmp_path / "median"
    table = output(PROGRAM, "count", counting, number, restitution, STEPS, 1, worst, median)
    steps = [Steps(*map(int, line.split())) for line in table.splitlines()]
    figures = instructions(number, median), instructions(number, worst)
    print(method, restitution, *steps, figures, sep="\n")
    assert steps[0].events == 0 and steps[1].events == 1 and steps[1].count > 300
    without, each = BOUNDS[method]
    without += RARE[method] if int(STEPS) > 1_000_000 else 0
    for found in steps:
        assert found.largest <= (without + each * found.events) * steps[0].median, found
    # what the blocks say holds for the instructions of the delivered library, too
    blocks = max(found.largest for found in steps) / steps[0].median
    assert figures[1] / figures[0] == pytest.approx(blocks, rel=0.3)


# ---- Lines of a cache ----------------------------------------------------------------------------


TOUCHED_LINES = BUILD / "tests" / "robustness" / "touched_lines"
ARM = BUILD / "fmu" / "RPManipulator" / "RPManipulator.so"
LINE = 64  # bytes
MOST = 2048  # bytes
TAYLOR = 4


def accesses(trace: Path, mark: int) -> list[tuple[int, int]]:
    """Address and size of each between the last two writes of the mark."""
    found = re.findall(r"^ ([LSM]) ([0-9a-f]+),(\d+)$", trace.read_text(), re.M)
    all_ = [(kind, int(address, 16), int(size)) for kind, address, size in found]
    *_, begin, end = (i for i, (kind, at, _) in enumerate(all_) if kind == "S" and at == mark)
    return [(address, size) for _, address, size in all_[begin + 1 : end]]


def test_a_step_touches_few_lines_of_an_instance(tmp_path: Path) -> None:
    if shutil.which("valgrind") is None:
        missing("valgrind: ./setup.sh --platforms")
    trace = tmp_path / "trace"
    command = ["valgrind", "--tool=lackey", "--trace-mem=yes", f"--log-file={trace}"]
    done = subprocess.run(
        [*command, TOUCHED_LINES, ARM, str(TAYLOR)], capture_output=True, text=True, check=True
    )
    mark, begin, end = (int(address, 16) for address in done.stdout.split())
    touched = [
        byte
        for address, size in accesses(trace, mark)
        if begin <= address < end
        for byte in range(address, address + size)
    ]
    # where lines begin depends on what was allocated before, such as paths
    shifts = range(0, LINE, 16)
    lines = max(len({(byte + shift) // LINE for byte in touched}) for shift in shifts)
    print(f"{lines} lines")
    # its four states, their inputs and its time alone are in three
    assert 3 < lines <= MOST // LINE
