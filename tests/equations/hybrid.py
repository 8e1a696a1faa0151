"""Judges runs of random models with impacts by an event loop that shares nothing with them.

build/venv/bin/python -m tests.equations.hybrid 7            # all runs of seed 7
build/venv/bin/python -m tests.equations.hybrid 7 --only co_simulation:erk:1e-07:0.01
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.equations.compiled import ModelFileError
from tests.equations.examples import METHODS
from tests.equations.hybrid_models import Hybrid, hybrid
from tests.equations.hybrid_runs import Run, Unit, co_simulation, early_return, model_exchange

TOLERANCES = (1e-5, 1e-7, 1e-10)
# error of states before it grows, over the tolerance; BDF adds up the most: 26 were seen
FACTOR = {"cvode_bdf": 100.0}
OTHERS = 10.0
ROUNDING = 1e-9  # likewise, whatever the tolerance
OF_OFFSET = 2e-10  # likewise of each impact, if the condition has an offset of a million units
OF_MASTER = 1e-6  # what the master of Model Exchange adds
OF_LOCATION = 1e-9  # units beyond its limit: two states, each by 2e-10 of nominal value and size
LARGEST_ERROR = 2e-3  # where more is possible, nothing is compared


@dataclass
class Failure:
    """What a run did wrong, first."""

    seed: int
    kind: str
    label: str  # of the run
    oracle: str
    text: str

    def __str__(self) -> str:
        return f"seed {self.seed} {self.kind} {self.label}: {self.oracle}: {self.text}"

    @property
    def command(self) -> str:
        return f"build/venv/bin/python -m tests.equations.hybrid {self.seed} --only {self.label}"


class Judge:
    """Compares runs of a model with its motion, as far as a tolerance permits."""

    def __init__(self, model: Hybrid, error: float, is_outside: bool = False) -> None:
        self.model, self.motion = model, model.motion
        self.errors = error * self.motion.growth  # units of length, at all times of the motion
        if is_outside:
            self.errors += OF_LOCATION * self.motion.lateness
        sure = self.errors <= LARGEST_ERROR
        self.known = len(sure) if sure.all() else int(np.argmin(sure))

    def steps(self, step: float) -> int:
        """The number of steps up to the last communication point that can be compared."""
        times, errors = self.motion.times[: self.known], self.errors
        count = round(float(times[-1]) / step) + 1 if len(times) else 0
        while count and not any(
            abs(t - count * step) < 1e-9 and self.motion.away(t, errors[k])
            for k, t in enumerate(times)
        ):
            count -= 1
        return count

    def judge(self, run: Run) -> Iterator[tuple[str, str]]:
        """Which oracles the run contradicts, and how."""
        if run.failure:
            yield "status", run.failure
        if run.differences:
            yield "snapshot", run.differences[0]
        yield from self._of_rows(run)

    def _of_rows(self, run: Run) -> Iterator[tuple[str, str]]:
        motion, unit, found = self.motion, self.model.unit, {}
        conditions = self.model.loop().conditions
        for t, x, count in zip(run.times, run.x, run.counts, strict=True):
            k = int(np.searchsorted(motion.times, t - 1e-9))
            error = self.errors[k]
            for c in conditions:
                distance = float(c.distance(t, np.array(x))) / c.unit
                if not distance > -8 * error:
                    found.setdefault("limit", f"{c.name} is passed by {-distance:.3g} at {t:.6g}")
            if not motion.away(t, error):
                continue
            expected = motion.count(t)
            if count != expected:
                found.setdefault("event_count", f"{count} for {expected} at {t:.6g}")
            far = float(np.max(np.abs(np.array(x) - motion.x[k]))) / unit
            if not far <= error:
                found.setdefault("state", f"{far:.3g} away at {t:.6g}, {error:.3g} allowed")
        if not run.failure and run.times and motion.count(run.times[-1]):
            last = motion.impacts[motion.count(run.times[-1]) - 1]
            allowed = 4 * error / last.speed + 1e-12
            if abs(run.last_event - last.t) > allowed and not math.isnan(run.last_event):
                found["last_event_time"] = f"{run.last_event} for {last.t}"
        yield from found.items()


def labels(model: Hybrid, is_full: bool) -> Iterator[str]:
    """The runs of a model: all, or one of each method and kind, in turn."""
    turn = model.seed
    for m, method in enumerate(METHODS):
        for i, tolerance in enumerate(TOLERANCES):
            for j, step in enumerate(model.steps):
                if is_full or ((turn + m) % 3 == i and (turn // 3 + m) % 2 == j):
                    yield f"co_simulation:{method}:{tolerance}:{step}"
        if (is_full or m == turn % 4) and not model.inputs:
            yield f"early_return:{method}:{TOLERANCES[turn % 3]}:{model.steps[1]}"
    yield f"model_exchange:-:{TOLERANCES[turn % 3]}:{model.steps[turn % 2]}"


def run(unit: Unit, model: Hybrid, label: str, count: int) -> Run:
    """The run of a label."""
    kind, method, tolerance, step = label.split(":")
    numbers = unit, method, float(tolerance), float(step), count
    if kind == "model_exchange":
        return model_exchange(unit, *numbers[2:], model.inputs)
    if kind == "early_return":
        found = early_return(*numbers, snapshots=True)
        found.last_event = math.nan
        return found
    return co_simulation(*numbers, model.inputs, [i.t for i in model.motion.impacts])


def failures(seed: int, is_full: bool = True, only: str = "") -> list[Failure]:
    """What the runs of a seed do wrong."""
    model, found = hybrid(seed), []
    chosen = [label for label in labels(model, is_full) if label.startswith(only)]
    with tempfile.TemporaryDirectory() as folder:
        try:
            unit = Unit(Path(folder), model.text())
        except ModelFileError as error:
            return [Failure(seed, model.kind, only or "-", "build", str(error))]
        for label in chosen:
            kind, method, tolerance, step = label.split(":")
            error = (
                FACTOR.get(method, OTHERS) * float(tolerance)
                + ROUNDING
                + OF_OFFSET * (model.form == "offset") * len(model.motion.impacts)
                + OF_MASTER * (kind == "model_exchange")
            )
            judge = Judge(model, error, kind == "model_exchange")
            count = judge.steps(float(step))
            made = run(unit, model, label, count)
            wrong = [Failure(seed, model.kind, label, *pair) for pair in judge.judge(made)]
            events = len(made.events)
            if kind == "early_return" and events != model.motion.count(count * float(step)):
                text = f"{events} for {model.motion.count(count * float(step))}"
                wrong.append(Failure(seed, model.kind, label, "early returns", text))
            found += wrong
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("--only", default="", help="how the labels of runs begin")
    arguments = parser.parse_args()
    model = hybrid(arguments.seed)
    motion = model.motion
    print(model.text())
    print(f"unit {model.unit}, inputs {model.inputs}")
    print(f"horizon {motion.horizon}: {motion.reason}; growth {motion.growth[-1]:.3g}")
    print("impacts:", *(f"{i.t:.9g} ({i.event}, {i.speed:.3g})" for i in motion.impacts))
    found = failures(arguments.seed, only=arguments.only)
    print(*found, sep="\n")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
