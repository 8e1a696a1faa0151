"""Breaks the C sources in places drawn by chance: the C tests must notice.

random_mutants.py BUILD takes a sample of all mutants of src, fmu and models, builds each with the
settings of the folder BUILD in a copy of the sources and runs the C tests until one fails; those
that live run with sanitizers too. Mutants that do not compile, or of which the compiler makes the
same code, are replaced by the next ones of the seed.
"""

import argparse
import json
import random
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from sites import Mutant, order, sources
from workshop import Processes, Record, Workshop

ROOT = Path(__file__).resolve().parents[2]
T = TypeVar("T")
DEAD = ("killed", "timeout", "sanitizer")
REPLACED = ("uncompilable", "same code")


@dataclass
class Campaign:
    """Mutants to judge in their order, and the verdicts so far.

    Attributes
    ----------
    wanted : int
        How many verdicts count: those of REPLACED do not.
    results : Path or None
        File that is written after every verdict.
    """

    mutants: list[Mutant]
    wanted: int
    results: Path | None
    processes: Processes = field(default_factory=Processes)
    record: Record = field(default_factory=Record)
    verdicts: dict[int, tuple[str, str, float]] = field(default_factory=dict)
    taken: int = 0
    lock: threading.Condition = field(default_factory=threading.Condition)

    def counted(self) -> list[int]:
        """Mutants that have a verdict that counts, in their order."""
        return sorted(i for i, verdict in self.verdicts.items() if verdict[0] not in REPLACED)

    def remaining(self) -> Iterator[int]:
        """Mutants for one worker: a beginning of the order, as long as is needed."""
        while True:
            with self.lock:
                while len(self.counted()) + self.taken - len(self.verdicts) >= self.wanted:
                    if self.taken == len(self.verdicts) or self.processes.stopped.is_set():
                        return
                    self.lock.wait(1.0)
                if self.taken == len(self.mutants):
                    return
                index = self.taken
                self.taken += 1
            yield index

    def judge(self, workshop: Workshop) -> None:
        """Judge mutants without sanitizers until there are enough."""
        for index in self.remaining():
            self.judge_one(workshop, index, "plain")

    def judge_again(self, workshop: Workshop, indices: Iterator[int]) -> None:
        """Judge with sanitizers what has survived without."""
        workshop.prepare("sanitized")
        workshop.measure("sanitized", workshop.tests["sanitized"])
        while True:
            with self.lock:
                index = next(indices, None)
            if index is None:
                return
            self.judge_one(workshop, index, "sanitized")

    def judge_one(self, workshop: Workshop, index: int, kind: str) -> None:
        """Judge one mutant; print the verdict."""
        started = time.monotonic()
        verdict, test = workshop.judge(self.mutants[index], kind)
        with self.lock:
            self.verdicts[index] = (verdict, test, time.monotonic() - started)
            self.note(index)
            self.lock.notify_all()

    def note(self, index: int) -> None:
        """Print a verdict; write all verdicts to the file."""
        verdict, test, _ = self.verdicts[index]
        by = f" by {test}" if test else ""
        print(f"{index}: {self.mutants[index].description()}: {verdict}{by}", flush=True)
        if self.results is None:
            return
        lines = [
            json.dumps(
                {"index": i, **self.mutants[i].as_dict()}
                | {"verdict": verdict, "test": test, "seconds": round(seconds, 1)}
            )
            for i, (verdict, test, seconds) in sorted(self.verdicts.items())
        ]
        new = self.results.with_suffix(".new")
        new.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")
        new.replace(self.results)

    def in_parallel(self, work: Callable[..., T], items: Iterable[object]) -> list[T]:
        """Results of the same work on several items at once; the first fault ends all."""

        def guarded(item: object) -> T:
            try:
                return work(item)
            except BaseException:
                self.processes.stop()
                raise

        items = list(items)
        with ThreadPoolExecutor(max(len(items), 1)) as pool:
            futures = [pool.submit(guarded, item) for item in items]
            try:
                wait(futures)
            except BaseException:
                self.processes.stop()
                raise
        faults = [fault for future in futures if (fault := future.exception())]
        for fault in sorted(faults, key=lambda fault: isinstance(fault, InterruptedError)):
            raise fault
        return [future.result() for future in futures]

    def run(self, jobs: int, settings_from: Path) -> None:
        """Judge the mutants in as many copies as there are jobs."""
        with tempfile.TemporaryDirectory() as folder:

            def prepared(job: int) -> Workshop:
                place = Path(folder) / str(job)
                workshop = Workshop(place, settings_from, self.processes, self.record)
                workshop.measure("plain", workshop.tests["plain"])
                return workshop

            workshops = self.in_parallel(prepared, range(jobs))
            self.in_parallel(self.judge, workshops)
            living = [index for index in self.counted() if self.verdicts[index][0] == "survived"]
            rest = iter(living)
            if living:
                self.in_parallel(lambda workshop: self.judge_again(workshop, rest), workshops)


def report(campaign: Campaign, seconds: float) -> float:
    """Print the figures; the share in percent of those that die."""
    counts = Counter(verdict for verdict, _, _ in campaign.verdicts.values())
    judged = campaign.counted()
    living = [index for index in judged if campaign.verdicts[index][0] not in DEAD]
    died = len(judged) - len(living)
    for index in living:
        print(f"lives: {campaign.mutants[index].description()}")
    print("; ".join(f"{verdict} {count}" for verdict, count in sorted(counts.items())))
    print(
        f"figures: random mutants of all C; executions {len(judged)}; seconds {seconds:.0f}; "
        f"findings {len(living)}; {died} of {len(judged)} die"
    )
    return 100.0 * died / len(judged) if judged else 100.0


def main() -> int:
    """1 where too few mutants die, 2 where they cannot be made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path, metavar="BUILD")
    parser.add_argument("--seed", type=int, help="of the sample; a new one if it is not given")
    parser.add_argument("--count", type=int, metavar="N", help="mutants of the sample, else all")
    parser.add_argument("--jobs", type=int, default=2, metavar="N")
    parser.add_argument("--results", type=Path, help="write all verdicts to this file")
    parser.add_argument(
        "--at-least", type=float, default=0.0, metavar="PERCENT",
        help="of them must die",
    )  # fmt: skip
    arguments = parser.parse_args()
    if arguments.seed is None:
        arguments.seed = random.SystemRandom().randrange(1_000_000)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))
    started = time.monotonic()
    try:
        mutants = order(sources(ROOT), arguments.seed)
        print(f"seed {arguments.seed}: {len(mutants)} places", flush=True)
        campaign = Campaign(mutants, arguments.count or len(mutants), arguments.results)
        campaign.run(arguments.jobs, arguments.build)
    except (RuntimeError, LookupError) as error:
        print(f"random_mutants.py: {error}", file=sys.stderr)
        return 2
    share = report(campaign, time.monotonic() - started)
    return 1 if share < arguments.at_least else 0


if __name__ == "__main__":
    sys.exit(main())
