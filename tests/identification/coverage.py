"""How often intervals hold the true values: synthetic logs of the plant, all starts 20 % off.

    build/venv/bin/python -m tests.identification.coverage 200

prints the table of docs/identification.md; exit code 1 if a bound is missed.
"""

import argparse
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from rparm.identification.request import DELAY
from tests.identification.synthetic import PLANT, Machine, identified, write

LATE = 1.4e-3  # s
CASES = {
    "white noise": PLANT,
    "encoder counts": replace(PLANT, counts=(2 * np.pi / 10000, 1e-6)),
    "delay": replace(PLANT, late=LATE),
    "effort noise": replace(PLANT, effort_noise=0.02, noise=(1e-5, 1e-5)),
}
NEAR = 0.1  # of a true value: a fit that ends further away has not found it
CONVERGED = 0.95  # share of the logs
COVERAGE = 0.90, 0.98  # of 95 % intervals, pooled over parameters


@dataclass(frozen=True)
class Row:
    """A case of the table."""

    logs: int
    found: int  # logs from which all parameters are found
    coverage: float  # of the intervals by scatter
    classical: float  # of the classical ones
    seconds: float  # of processor time, each fit

    @property
    def holds(self) -> bool:
        """Whether it is as good as it must be."""
        low, high = COVERAGE
        return self.found >= CONVERGED * self.logs and low <= self.coverage <= high


def study(machine: Machine, seeds: Iterable[int]) -> Row:
    """Identify the parameters of a machine from a log for each seed."""
    found, inside, classical, seconds = [], [], [], 0.0
    with TemporaryDirectory() as folder:
        for seed in seeds:
            log = write(machine, Path(folder) / "log.csv", seed)
            begin = time.process_time()
            result = identified(machine, log, seed, delay=bool(machine.late))
            seconds += time.process_time() - begin
            true = {**machine.true, **({DELAY: LATE} if machine.late else {})}
            values = [(result.estimates[name], x) for name, x in true.items()]
            near = all(abs(estimate.value / x - 1) < NEAR for estimate, x in values)
            found.append(result.has_converged and near)
            inside += [_holds((estimate.low, estimate.high), x) for estimate, x in values]
            classical += [_holds(estimate.classical, x) for estimate, x in values]
    count = len(found)
    return Row(
        count, sum(found), float(np.mean(inside)), float(np.mean(classical)), seconds / count
    )


def _holds(interval: tuple[float | None, float | None] | None, true: float) -> bool:
    """Whether an interval holds a value; one that is not known holds none."""
    low, high = interval or (None, None)
    return low is not None and high is not None and low < true < high


def main() -> int:
    """Print the table; 0 if all bounds hold."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=int, help="of each case")
    parser.add_argument("cases", nargs="*", default=list(CASES), help="some of the cases")
    options = parser.parse_args()
    if unknown := set(options.cases) - set(CASES):
        parser.error(f"no case {unknown.pop()!r} (known: {', '.join(CASES)})")
    print("| case | logs | found | by scatter | classical | s |\n|---|--:|--:|--:|--:|--:|")
    failed = False
    for name in options.cases:
        row = study(CASES[name], range(options.logs))
        shares = f"{row.coverage:.3f} | {row.classical:.3f} | {row.seconds:.2f}"
        print(f"| {name} | {row.logs} | {row.found} | {shares} |", flush=True)
        failed |= not row.holds
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
