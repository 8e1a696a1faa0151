"""Measures the rate of a campaign against a plain loop in C over the same FMU, in turns.

    build/venv/bin/python -m tests.campaign.rate [--runs 2000] [--rounds 5] [--workers 2]

Work: 2 s of the arm at 1 ms with changing inputs, four variables read at every step. In each round
the C loop, the campaign with as many workers as the loop has threads, the C loop with one thread
and the campaign with one worker make the same number of runs. Ratios are formed within a round;
the table shows their median, smallest and largest. Processor time is that of the threads of the
loop, and of the worker processes: on a busy machine it is what repeats. Nothing is judged.
"""

import argparse
import itertools
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
import psutil

from cosim.campaign import bases, campaign_file, engine, planning
from cosim.campaign.points import Points
from cosim.campaign.results import Results
from cosim.fmu_file import Fmu
from tests.campaign.files import HEAD
from tests.support.cosim_project import FMUS
from tests.support.paths import ROOT

MODEL = "rp_manipulator"
TEXT = (
    HEAD
    + """scenario = "sine_efforts"
sampling = "random"
runs = {runs}
block = 100
time = {{ stop = 2.0 }}
[set]
q2 = 0.0
dq1 = 0.0
dq2 = 0.0
[parameters.m2]
uniform = [0.8, 1.2]
[parameters.q1]
uniform = [-1.6, -1.4]
[keep]
final = ["q1", "dq1", "dq2"]
maximum = ["q2"]
"""
)


@dataclass(frozen=True)
class Taken:
    """What some runs have taken."""

    wall: float  # s
    processor: float  # s
    memory: int = 0  # bytes of the largest worker at the end


def compiled(folder: Path) -> Path:
    """The C loop as a program."""
    headers = Path(fmpy.__file__).parent / "c-code"
    program = folder / "c_loop"
    source = ROOT / "tests" / "campaign" / "c_loop.c"
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-isystem", str(headers)]
    libraries = ["-lm", "-ldl", "-lpthread"]
    subprocess.run(["gcc", *flags, str(source), "-o", str(program), *libraries], check=True)
    return program


def run_loop(program: Path, fmu: Fmu, runs: int, threads: int) -> Taken:
    """Runs by the C loop."""
    arguments = [str(program), str(fmu.library), fmu.guid, str(runs), str(threads)]
    out = subprocess.run(arguments, check=True, capture_output=True, text=True).stdout
    wall, processor, _ = map(float, out.split())
    return Taken(wall, processor)


class Campaigns:
    """Campaigns on a cluster that stays."""

    def __init__(self, client: engine.Client, folder: Path) -> None:
        self._client, self._folder, self._count = client, folder, itertools.count()
        self._workers = [psutil.Process(pid) for pid in client.run(_process).values()]

    def run(self, runs: int) -> Taken:
        """Runs by a campaign, results included."""
        folder = self._folder / str(next(self._count))
        folder.mkdir(parents=True)
        file = folder / "rate.toml"
        file.write_text(TEXT.format(runs=runs), encoding="utf-8")
        campaign = campaign_file.read(file)
        with bases.opened(campaign, None) as base:
            job = planning.plan(campaign, base, file)
            points = Points(campaign, planning.constants(campaign, base))
            results = Results(folder, campaign, job, "")
            results.begin()
            made = engine.Engine(self._client, campaign, job, base.archives, points, results)
            before = self._processor()
            begin = time.perf_counter()
            made.run(range(campaign.blocks), lambda _: None)
            wall = time.perf_counter() - begin
        memory = max(worker.memory_info().rss for worker in self._workers)
        assert not results.missing()
        return Taken(wall, self._processor() - before, memory)

    def _processor(self) -> float:
        return sum(sum(worker.cpu_times()[:2]) for worker in self._workers)


def _process() -> int:
    return psutil.Process().pid


@contextmanager
def campaigns(workers: int, folder: Path) -> Iterator[Campaigns]:
    """A cluster with workers that have compiled their loop."""
    with engine.cluster(None, workers, folder / f"workers_{workers}") as client:
        made = Campaigns(client, folder / f"campaigns_{workers}")
        made.run(100 * workers)
        yield made


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=2000, help="in each turn")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    runs, many = options.runs, options.workers
    found: dict[str, list[Taken]] = {}
    with (
        TemporaryDirectory() as name,
        Fmu(FMUS[MODEL]) as fmu,
        campaigns(many, Path(name)) as several,
        campaigns(1, Path(name)) as one,
    ):
        program = compiled(Path(name))
        for number in range(options.rounds):
            turns = {
                "loop": lambda: run_loop(program, fmu, runs, many),
                "campaign": lambda: several.run(runs),
                "loop, one": lambda: run_loop(program, fmu, runs // many, 1),
                "campaign, one": lambda: one.run(runs // many),
            }
            for turn, make in turns.items():
                found.setdefault(turn, []).append(make())
            line = ", ".join(f"{turn} {taken[-1].wall:.2f} s" for turn, taken in found.items())
            print(f"round {number + 1}: {line}", file=sys.stderr, flush=True)
    report(found, runs, many)
    return 0


def report(found: dict[str, list[Taken]], runs: int, many: int) -> None:
    """Print the table."""
    loop, several = found["loop"], found["campaign"]
    one_loop, one = found["loop, one"], found["campaign, one"]

    def line(name: str, values: list[float], unit: str = "") -> None:
        middle = statistics.median(values)
        print(f"{name:<58} {middle:8.3f} {min(values):8.3f} {max(values):8.3f} {unit}")

    print(f"{'':<58} {'median':>8} {'least':>8} {'most':>8}")
    line(f"loop, {many} threads", [runs / x.wall for x in loop], "runs/s")
    line(f"campaign, {many} workers", [runs / x.wall for x in several], "runs/s")
    line(
        f"rate of the campaign to that of the loop, {many} cores",
        [x.wall / y.wall for x, y in zip(loop, several, strict=True)],
    )
    line(
        "the same by processor time",
        [x.processor / y.processor for x, y in zip(loop, several, strict=True)],
    )
    line(
        "rate of the campaign to that of the loop, one core",
        [x.wall / y.wall for x, y in zip(one_loop, one, strict=True)],
    )
    line(
        f"campaign, one worker to {many}: scaling",
        [many * x.wall / y.wall for x, y in zip(one, several, strict=True)],
    )
    line(
        f"loop, one thread to {many}: scaling",
        [many * x.wall / y.wall for x, y in zip(one_loop, loop, strict=True)],
    )
    line("processor time of a run, loop", [1e3 * x.processor / runs for x in loop], "ms")
    line("processor time of a run, campaign", [1e3 * x.processor / runs for x in several], "ms")
    line("memory of the largest worker", [x.memory / 1e6 for x in several], "MB")


if __name__ == "__main__":
    sys.exit(main())
