"""How much work a step can be, by instructions and lines of a cache: docs/real-time.md."""

import os
import re
import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.equations.examples import build
from tests.support.missing import missing
from tests.support.paths import FMI_HEADERS, ROOT
from tests.support.rparm_project import BUILD

HERE = Path(__file__).parent
STEPS = os.environ.get("REAL_TIME_STEPS", "100000")
METHODS = {"cvode_adams": 1, "taylor": 4}
OF_VARIABLE = re.compile(r'<ScalarVariable name="(\w+)" valueReference="(\d+)"')

# Largest work of a step over the median of those without events: of a step without events, and
# the first part of one with events. What ten million steps add to both.
BOUNDS = {
    ("RPPlant", "cvode_adams"): (11, 12),
    ("RPPlant", "taylor"): (8, 12),
    ("Six", "cvode_adams"): (3, 3),
    ("Six", "taylor"): (4, 9),
}
RARE = {("RPPlant", "taylor"): (4, 5)}  # else (4, 4)


def each(method: str, median: int, indicators: int) -> float:
    """What each event adds, in medians. median: of instructions."""
    return 1 / 3 if method == "cvode_adams" else 1 + (5000 + 500 * indicators) / median


@dataclass
class Steps:
    """Steps with so many events."""

    events: int
    count: int
    median: int  # blocks of code
    largest: int


@dataclass
class Measured:
    """A model, with the program that steps it."""

    name: str
    program: Path
    counting: Path  # library that counts blocks of code
    library: Path  # as it is delivered
    indicators: int


def output(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def unpacked(archive: Path, folder: Path) -> str:
    """Unpack an FMU and compile its own sources so that they count; its description."""
    with zipfile.ZipFile(archive) as opened:
        opened.extractall(folder)
    options = ["-O3", "-ffp-contract=off", "-fPIC", "-shared", "-w", "-fsanitize-coverage=trace-pc"]
    sources = sorted((folder / "sources").glob("*.c"))
    output("gcc", *options, f"-I{FMI_HEADERS}", "-o", folder / "counting.so", *sources, "-lm")
    return (folder / "modelDescription.xml").read_text(encoding="utf-8")


def indicators_in(description: str) -> int:
    return int(re.search(r'numberOfEventIndicators="(\d+)"', description)[1])


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    archive = BUILD / "release" / "RPPlant.fmu"
    if not archive.exists():
        missing("build/release: ./release.sh")
    folder = tmp_path_factory.mktemp("plant")
    count = indicators_in(unpacked(archive, folder))
    program = BUILD / "tests" / "robustness" / "real_time"
    library = BUILD / "fmu" / "RPPlant" / "RPPlant.so"
    return Measured("RPPlant", program, folder / "counting.so", library, count)


@pytest.fixture(scope="module")
def six(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    """A user's model; the program is compiled with its value references."""
    folder = tmp_path_factory.mktemp("six")
    shutil.copy(HERE / "six.toml", folder)
    description = unpacked(build(folder / "six.toml", folder), folder)
    references = "".join(f"SIX_{n} = {v},\n" for n, v in OF_VARIABLE.findall(description))
    token = re.search(r'guid="(.*?)"', description)[1]
    (folder / "value_references.h").write_text(
        f'#define SIX_GUID "{token}"\nenum {{\n{references}}};\n', encoding="utf-8"
    )
    harness = ROOT / "tests" / "fmi_harness"
    folders = [folder, harness, ROOT / "fmu" / "fmi2", ROOT / "fmu" / "fmi3", FMI_HEADERS]
    options = ["-std=c17", "-O2", "-w", "-rdynamic", *(f"-I{each}" for each in folders)]
    program = folder / "real_time"
    sources = [HERE / "real_time.c", harness / "fmu_library.c"]
    output("gcc", *options, "-o", program, *sources, "-ldl", "-lm")
    (library,) = folder.glob("binaries/*/Six.so")
    return Measured("Six", program, folder / "counting.so", library, indicators_in(description))


def instructions(of: Measured, method: int, work: Path) -> int:
    """Instructions of the step of a file, in the library as it is delivered."""
    if shutil.which("valgrind") is None:
        missing("valgrind: ./setup.sh --platforms")
    text = output(
        "valgrind", "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=fmi2DoStep",
        "--callgrind-out-file=/dev/null", of.program, "replay", of.library, method, work,
    )  # fmt: skip
    return int(re.search(r"Collected : (\d+)", text)[1])


def check_steps(measured: Measured, method: str, restitution: float, folder: Path) -> None:
    worst, median = folder / "worst", folder / "median"
    arguments = [METHODS[method], restitution, STEPS, 1, worst, median]
    table = output(measured.program, "count", measured.counting, *arguments)
    steps = [Steps(*map(int, line.split())) for line in table.splitlines()]
    figures = [instructions(measured, METHODS[method], work) for work in (median, worst)]
    print(measured.name, method, restitution, *steps, figures, sep="\n")
    assert steps[0].events == 0 and steps[1].events == 1 and steps[1].count > 300
    key = measured.name, method
    rare = RARE.get(key, (4, 4)) if int(STEPS) > 1_000_000 else (0, 0)
    bounds = [usual + more for usual, more in zip(BOUNDS[key], rare, strict=True)]
    more = each(method, figures[0], measured.indicators)
    for found in steps:
        bound = bounds[0] if found.events == 0 else bounds[1] + more * found.events
        assert found.largest <= bound * steps[0].median, found
    # what the blocks say holds for the instructions of the delivered library, too
    blocks = max(found.largest for found in steps) / steps[0].median
    assert figures[1] / figures[0] == pytest.approx(blocks, rel=0.3)


@pytest.mark.parametrize("restitution", [0, 0.5])
@pytest.mark.parametrize("method", METHODS)
def test_work_of_a_step_is_bounded_by_its_events(
    method: str, restitution: float, plant: Measured, tmp_path: Path
) -> None:
    check_steps(plant, method, restitution, tmp_path)


@pytest.mark.parametrize("method", METHODS)
def test_work_of_own_models_is_bounded_by_their_events(
    method: str, six: Measured, tmp_path: Path
) -> None:
    check_steps(six, method, 0.5, tmp_path)


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
