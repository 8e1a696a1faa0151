"""Measures the loop that numba compiles against the same loop in C, over the same instances.

    build/venv/bin/python -m tests.campaign.rate.loop [--runs 40]

Both make each run in turns, by the processor time of the thread; their records must have the same
bits. "All of a run" is the loop with numba, what goes before it, and the measures. Ratios are
medians with their quartiles. Nothing else is judged.
"""

import argparse
import statistics
import subprocess
import sys
import time
from ctypes import CDLL, Structure, addressof, c_int64, c_void_p
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rparm.campaign import campaign_file
from rparm.campaign.runs import Runner
from rparm.fmi.compiled_loop import Wires
from tests.campaign.rate.works import WORKS
from tests.campaign.runners import runner
from tests.support.paths import FMI_HEADERS, ROOT


class _Wires(Structure):
    _fields_ = [
        ("inputs", c_void_p),
        ("first_input", c_void_p),
        ("sources", c_void_p),
        ("outputs", c_void_p),
        ("first_output", c_void_p),
        ("output_place", c_int64),
    ]


def _as_c(wires: Wires) -> _Wires:
    arrays = wires.inputs, wires.first_input, wires.sources, wires.outputs, wires.first_output
    place = len(wires.values) - len(wires.outputs)
    return _Wires(*(array.ctypes.data for array in arrays), place)


def compiled(folder: Path) -> CDLL:
    """The loop in C."""
    library = folder / "c_runner.so"
    source = ROOT / "tests" / "campaign" / "rate" / "c_runner.c"
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Wno-unused-parameter", "-Werror"]
    flags += ["-shared", "-fPIC"]
    subprocess.run(
        ["gcc", *flags, "-isystem", str(FMI_HEADERS), str(source), "-o", str(library)], check=True
    )
    return CDLL(str(library))


def advance_in_c(library: CDLL, runs: Runner) -> None:
    """What `Runner._advance` does, in C."""
    job, stepper = runs._job, runs._stepper
    reals, switches = stepper.reals, stepper.switches
    c_reals, c_switches = _as_c(reals), _as_c(switches)

    def data(array: np.ndarray) -> c_void_p:
        return c_void_p(array.ctypes.data)

    status = library.advance(
        data(stepper.calls),
        c_int64(len(stepper.calls)),
        data(job.times),
        c_int64(job.steps),
        data(runs._held),
        c_int64(runs._held.shape[1]),
        c_void_p(addressof(c_reals)),
        data(reals.values),
        data(reals.to_set),
        c_void_p(addressof(c_switches)),
        data(switches.values),
        data(switches.to_set),
        data(job.columns),
        c_int64(len(job.columns)),
        data(runs._record),
    )
    assert status == 0, status


def measure(name: str, text: str, runs: int, library: CDLL, folder: Path) -> None:
    """Print the median time of a run of each, and that of their ratios."""
    file = folder / f"{name}.toml"
    file.write_text(text.format(runs=runs), encoding="utf-8")
    campaign = campaign_file.read(file)
    taken: dict[str, list[float]] = {"C": [], "numba": [], "all of a run": []}
    with runner(campaign, folder) as (made, job, points):
        targets = points.targets(points.of(range(runs)), job)
        made.rows([0], targets[:1])  # compiles
        for point in targets:
            records = []
            loops = {"C": lambda: advance_in_c(library, made), "numba": made._advance}
            for kind, loop in loops.items():
                made._initialize(point)
                begin = time.thread_time()
                loop()
                taken[kind].append(time.thread_time() - begin)
                records.append(made._record.copy())
            assert np.array_equal(*records), "the two loops differ"
            begin = time.thread_time()
            made.rows([0], point[None])
            taken["all of a run"].append(time.thread_time() - begin)
    print(f"{name}, {job.steps} steps")
    for kind, seconds in taken.items():
        ratios = [c / s for c, s in zip(taken["C"], seconds, strict=True)]
        low, middle, high = statistics.quantiles(ratios, n=4)
        middle_time = f"{1e3 * statistics.median(seconds):6.2f} ms"
        print(f"  {kind:<13} {middle_time}, rate to C {middle:.3f} ({low:.3f} to {high:.3f})")


def main() -> int:
    """Measure the arm and the closed loop."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=40)
    runs = parser.parse_args().runs
    with TemporaryDirectory() as name:
        library = compiled(Path(name))
        for work, text in WORKS.items():
            measure(work, text, runs, library, Path(name))
    return 0


if __name__ == "__main__":
    sys.exit(main())
