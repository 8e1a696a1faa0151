"""How many lines of a cache a step touches of an instance: many are stepped in turn."""

import re
import shutil
import subprocess
from pathlib import Path

from tests.support.missing import missing
from tests.support.rparm_project import BUILD

PROGRAM = BUILD / "tests" / "robustness" / "touched_lines"
LIBRARY = BUILD / "fmu" / "RPManipulator" / "RPManipulator.so"
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
        [*command, PROGRAM, LIBRARY, str(TAYLOR)], capture_output=True, text=True, check=True
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
