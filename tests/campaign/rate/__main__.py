"""Measures the rate of a campaign against a plain loop in C and against plain processes, in turns.

    build/venv/bin/python -m tests.campaign.rate [--work arm] [--runs 2000] [--workers 2]

Works, 2000 steps a run: the arm with changing inputs; the closed loop of three FMUs. In each round
these make the same runs: the C loop with as many threads as there are workers, the campaign, and
plain processes without Dask, which keep no results. Then the same on one core. Ratios are formed
within a round; the table shows their median, smallest and largest. Processor time of the campaign
is that of its workers and of this process, which schedules and writes results: on a busy machine it
is what repeats. Nothing is judged.
"""

import argparse
import itertools
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from rparm.campaign import bases, campaign_file, engine, planning
from rparm.campaign.planning import Points
from rparm.campaign.runs import open_fmus
from tests.campaign.rate.c_loop import CLoop
from tests.campaign.rate.plain_processes import plain_processes
from tests.campaign.rate.works import WORKS
from tests.campaign.runners import engine_of


@dataclass(frozen=True)
class Taken:
    """What some runs have taken."""

    wall: float  # s
    processor: float  # s, of what makes runs
    engine: float = 0.0  # s of processor time, of this process
    memory: int = 0  # bytes of the largest worker at the end


class Campaigns:
    """Campaigns on a cluster that stays."""

    def __init__(self, client: engine.Client, work: str, folder: Path) -> None:
        self._client, self._work, self._folder = client, work, folder
        self._count = itertools.count()
        self._workers = [psutil.Process(pid) for pid in client.run(_process).values()]

    def run(self, runs: int) -> Taken:
        """Runs by a campaign, results included."""
        folder = self._folder / str(next(self._count))
        folder.mkdir(parents=True)
        file = folder / "rate.toml"
        file.write_text(WORKS[self._work].format(runs=runs), encoding="utf-8")
        with engine_of(self._client, file, folder) as (made, results):
            blocks = results.missing()
            before, own = self._processor(), time.process_time()
            begin = time.perf_counter()
            made.run(blocks, lambda _: None)
            wall = time.perf_counter() - begin
        memory = max(worker.memory_info().rss for worker in self._workers)
        assert not results.missing()
        return Taken(wall, self._processor() - before, time.process_time() - own, memory)

    def _processor(self) -> float:
        return sum(sum(worker.cpu_times()[:2]) for worker in self._workers)


def _process() -> int:
    return psutil.Process().pid


@contextmanager
def campaigns(workers: int, work: str, folder: Path) -> Iterator[Campaigns]:
    """A cluster with workers that have compiled their loop."""
    with engine.opened_cluster(None, workers, folder / f"workers_{workers}") as client:
        made = Campaigns(client, work, folder / f"campaigns_{workers}")
        made.run(100 * workers)
        yield made


Turn = Callable[[], Taken]


@contextmanager
def turns(work: str, runs: int, cores: int, folder: Path) -> Iterator[dict[str, Turn]]:
    """What makes runs of a work on so many cores."""
    file = folder / "rate.toml"
    file.write_text(WORKS[work].format(runs=runs), encoding="utf-8")
    campaign = campaign_file.read(file)
    with ExitStack() as stack:
        base = stack.enter_context(bases.opened(campaign, None))
        job = planning.plan(campaign, base, file)
        points = Points(campaign, planning.constants(campaign, base))
        targets = points.targets(points.of(range(runs)), job)
        fmus = stack.enter_context(open_fmus(base.archives, folder))
        loop = CLoop(job, fmus, targets, folder / "c")
        plain = stack.enter_context(plain_processes(cores, job, base.archives))
        plain.run(targets[:cores], 1)  # compiles
        dask = stack.enter_context(campaigns(cores, work, folder))
        yield {
            "loop": lambda: Taken(*loop.run(runs, cores)),
            "campaign": lambda: dask.run(runs),
            "plain": lambda: Taken(*plain.run(targets, campaign.block)),
        }


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", choices=WORKS, default="arm")
    parser.add_argument("--runs", type=int, default=2000, help="in each turn")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print(f"{options.work:<58} {'median':>8} {'least':>8} {'most':>8}")
    for cores in dict.fromkeys((options.workers, 1)):
        report(rounds(options.work, options.runs, cores, options.rounds), options.runs, cores)
    return 0


def rounds(work: str, runs: int, cores: int, count: int) -> dict[str, list[Taken]]:
    """What runs have taken in each round."""
    found: dict[str, list[Taken]] = {}
    with TemporaryDirectory() as name, turns(work, runs, cores, Path(name)) as made:
        for number in range(count):
            for kind, make in made.items():
                found.setdefault(kind, []).append(make())
            line = ", ".join(f"{kind} {taken[-1].wall:.2f} s" for kind, taken in found.items())
            print(f"on {cores}, round {number + 1}: {line}", file=sys.stderr, flush=True)
    return found


def report(found: dict[str, list[Taken]], runs: int, cores: int) -> None:
    """Print the lines of so many cores."""
    loop, campaign, plain = found["loop"], found["campaign"], found["plain"]

    def line(name: str, values: Iterator[float], unit: str = "") -> None:
        values = list(values)
        middle = statistics.median(values)
        print(f"{name:<58} {middle:8.3f} {min(values):8.3f} {max(values):8.3f} {unit}")

    def ratios(name: str, others: list[Taken], number: Callable[[float], float]) -> None:
        pairs = list(zip(campaign, others, strict=True))
        line(f"{name}, by the clock", (number(y.wall / x.wall) for x, y in pairs))
        used = [(x.processor + x.engine, y.processor) for x, y in pairs]
        line("  by processor time", (number(y / x) for x, y in used))

    print(f"on {cores}:")
    line("loop in C", (runs / x.wall for x in loop), "runs/s")
    line("campaign", (runs / x.wall for x in campaign), "runs/s")
    ratios("rate of the campaign to that of the loop in C", loop, lambda x: x)
    ratios("overhead over plain processes", plain, lambda x: 1 - x)
    line("processor time of a run, loop in C", (1e3 * x.processor / runs for x in loop), "ms")
    line("  plain processes", (1e3 * x.processor / runs for x in plain), "ms")
    line("  workers of the campaign", (1e3 * x.processor / runs for x in campaign), "ms")
    line("  the campaign's own process", (1e3 * x.engine / runs for x in campaign), "ms")
    line("memory of the largest worker", (x.memory / 1e6 for x in campaign), "MB")


if __name__ == "__main__":
    sys.exit(main())
