"""Tables on the console: a head and a rule, then a row as soon as it is known."""

import sys
from collections.abc import Iterable, Sequence

from cosim.comparison import Run
from cosim.convergence import Convergence
from cosim.system.comparison import BOUND, Outcome
from cosim.system.study import Measure
from cosim.texts import bits, counted, milliseconds, verdict
from cosim.tolerance_sweep import Sweep


def head(*lines: str) -> None:
    """Print the head of a table, its last line underlined."""
    print(*lines, "-" * len(lines[-1]), sep="\n", flush=True)


def messages(label: str, texts: Iterable[str]) -> None:
    """Print what an FMU or an engine has to say, to standard error."""
    for text in dict.fromkeys(texts):
        print(f"{label}: {text}", file=sys.stderr)


def summary(failed: Iterable[str], done: Sequence[object], name: str) -> int:
    """Print what has failed, or how many things have passed; the exit code."""
    names = list(dict.fromkeys(failed))
    print(f"FAILED: {', '.join(names)}" if names else f"passed: {counted(done, name)}")
    return 1 if names else 0


class RunTable:
    """Runs of scenarios; `twin` is the version of FMI whose bits are compared, if any is."""

    def __init__(self, names: Iterable[str], twin: str | None = None) -> None:
        self._width = max(map(len, ("scenario", *names)))
        title = f"{f'FMI {twin}':<10}  " if twin else ""
        columns = f"  tolerance    steps      error    bound  wall time  {title}result"
        head(f"{'scenario':<{self._width}}{columns}")

    def row(self, run: Run) -> None:
        result = run.result
        text = "passed" if run.passed else f"FAILED ({run.failure})"
        text = text if run.compared else "ran, error estimated"
        bound = f"{run.bound:>8.0e}" if run.compared else f"{'-':>8}"
        if run.twin is not None:
            text = f"{bits(run.twin.differing):<10}  {text}"
        print(
            f"{run.scenario.name:<{self._width}}  {result.tolerance:>9.0e} {result.steps:>8} "
            f"{run.error:>10.2e} {bound} {result.wall_time:>8.3f} s  {text}",
            flush=True,
        )

    def failed(self, name: str, tolerance: float) -> None:
        """A run that an FMU did not finish."""
        print(
            f"{name:<{self._width}}  {tolerance:>9.0e}  FAILED: did not run to its end", flush=True
        )


class SweepTable:
    """Errors of scenarios over the tolerances."""

    def __init__(self, names: Iterable[str], tolerances: Iterable[float]) -> None:
        self._width = max(map(len, ("error at tolerance", *names)))
        columns = " ".join(f"{tolerance:>8.0e}" for tolerance in tolerances)
        head("", f"{'error at tolerance':<{self._width}} {columns}  result")

    def row(self, sweep: Sweep) -> None:
        errors = " ".join(f"{error:>8.1e}" for error in sweep.errors)
        name = sweep.scenario.name
        print(f"{name:<{self._width}} {errors}  {verdict(sweep.passed)}", flush=True)

    @staticmethod
    def violations(sweeps: Iterable[Sweep]) -> None:
        for sweep in sweeps:
            for text in sweep.violations:
                print(f"{sweep.scenario.name}: {text}")


class FederationTable:
    """Variants as federations, against the master in one process; times of a step of each."""

    def __init__(self, names: Iterable[str]) -> None:
        self._width = max(map(len, ("variant", *names)))
        columns = "  steps  difference    bound    HELICS      Ecos    master  result"
        head(f"{'us a step':>{self._width + 61}}", f"{'variant':<{self._width}}{columns}")

    def row(
        self,
        name: str,
        steps: int,
        difference: float,
        bound: float,
        times: Sequence[float],
        passed: bool,
    ) -> None:
        shown = " ".join(f"{us:>9.1f}" for us in times)
        print(
            f"{name:<{self._width}} {steps:>6} {difference:>11.2e} {bound:>8.0e} {shown}  "
            f"{verdict(passed)}",
            flush=True,
        )


class VariantTable:
    """Runs of a system's variants, with the measures of the system."""

    def __init__(self, names: Iterable[str], measures: Sequence[Measure]) -> None:
        self._width = max(map(len, ("variant", *names)))
        self._measures = measures
        titles = "".join(f"  {measure.name}" for measure in measures)
        columns = f"  steps      error    bound{titles}  wall time  result"
        head(f"{'variant':<{self._width}}{columns}")

    def row(self, outcome: Outcome) -> None:
        cells = [f"{outcome.variant:<{self._width}} {outcome.steps:>6} {outcome.error:>10.2e}"]
        cells.append(f" {BOUND:>8.0e}")
        for measure in self._measures:
            text = f"{measure.value(outcome):.4f} {measure.unit}"
            cells.append(f" {text:>{len(measure.name) + 1}}")
        text = "passed" if outcome.passed else f"FAILED ({outcome.worst})"
        print("".join(cells) + f" {outcome.run.wall_time:>8.3f} s  {text}", flush=True)

    def failed(self, name: str) -> None:
        """A variant that a component did not finish."""
        print(f"{name:<{self._width}}  FAILED: did not run to its end", flush=True)


def convergence(study: Convergence) -> None:
    """Print a table of errors over the communication step, and what is wrong with them."""
    name, rows = study.scenario.name, study.rows
    width = max(map(len, (name, *(row.name for row in rows))))
    steps = "".join(f" {milliseconds(step):>8}" for step in study.problem.steps)
    head("", f"{name:<{width}}{steps}   slope  result")
    for row in rows:
        errors = "".join(f" {error:>8.1e}" for error in row.errors)
        print(f"{row.name:<{width}}{errors}  {row.slope:>6.2f}  {verdict(row.holds)}")
    for text in study.violations:
        print(f"{name}: {text}")
    sys.stdout.flush()
