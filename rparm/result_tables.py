"""Results of scenarios and systems, as tables on the console and as a document for programs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from rparm import console
from rparm.console import PrintedTable
from rparm.report.overview import Entry
from rparm.runs.comparison import TIGHTEST, Failure, Run, Sweep, comparisons
from rparm.runs.convergence import Convergence
from rparm.runs.scenario import Scenario
from rparm.systems.comparison import BOUND, Measure, Outcome
from rparm.units import duration, seconds, short, unit, verdict

NONE, DONE = "-", "completed"
SWEEP = ("tolerances", "errors", "violations", "passed")  # keys of the document


# ---- Tables --------------------------------------------------------------------------------------
class RunTable:
    """Runs of scenarios, a row each; `with_tight`: at their own tolerance and at the tightest."""

    def __init__(
        self, names: Iterable[str], tolerances: Iterable[float], with_tight: bool = False
    ) -> None:
        own = max((len(short(tolerance)) for tolerance in tolerances), default=0)
        columns = {"steps": 6, "error at tolerance": len("1.0e-10 at ") + own}
        if with_tight:
            columns[f"error at {short(TIGHTEST)}"] = 8
        self._with_tight = with_tight
        result = len(DONE) if not with_tight else len(verdict(True))
        self._table = PrintedTable("scenario", names, {**columns, "time": 7}, result=result)

    def row(
        self, name: str, tolerance: float, runs: Sequence[Run], failures: Iterable[str]
    ) -> None:
        """Print a scenario's runs, and why others have not come to their end (`failures`)."""
        first = next((run for run in runs if run.result.tolerance == tolerance), None)
        tight = next((run for run in runs if run.result.tolerance == TIGHTEST), None)
        cells = [
            _count(runs[0].result.steps) if runs else NONE,
            f"{_error(first)} at {short(tolerance)}",
            *([_error(tight)] if self._with_tight else []),
            seconds(first.result.wall_time) if first else NONE,
        ]
        problems = [*failures, *(run.violation for run in runs if not run.passed)]
        compared = all(run.compared for run in runs)
        good = verdict(True) if compared else DONE
        self._table.row(name, cells, verdict(False) if problems else good)
        for text in problems:
            console.remark(text)


def _error(run: Run | None) -> str:
    return NONE if run is None else short(run.error, 1)


def _count(number: int) -> str:
    """Write a count in at most six characters: 1234567 as 1.23M."""
    return str(number) if number < 1_000_000 else f"{number / 1e6:.3g}M"


class SweepTable:
    def __init__(self, names: Iterable[str], tolerances: Iterable[float]) -> None:
        print()
        columns = {short(tolerance): 5 for tolerance in tolerances}
        self._table = PrintedTable("error at tolerance", names, columns, gap=1, result=0)

    def row(self, sweep: Sweep) -> None:
        self._table.row(sweep.scenario.name, [short(error, 0) for error in sweep.errors])
        for text in sweep.violations:
            console.remark(f"{verdict(False)}: {text}")


class FederationTable:
    """Variants as federations, against the master in one process; times of a step of each."""

    def __init__(self, names: Iterable[str], bound: float) -> None:
        columns = {"steps": 6, "difference": 10}
        times = dict.fromkeys(("HELICS us/step", "Ecos us/step", "master us/step"), 7)
        self._bound = bound
        self._table = PrintedTable("variant", names, columns | times)

    def row(
        self, name: str, steps: int, difference: float, times: Sequence[float], passed: bool
    ) -> None:
        shown = ["-" if us != us else f"{us:.{1 if us < 10_000 else 0}f}" for us in times]
        self._table.row(name, [_count(steps), short(difference, 1), *shown], verdict(passed))
        if not passed:
            bound = f"above its bound {short(self._bound)}"
            console.remark(f"difference {short(difference, 1)}, {bound}")


class VariantTable:
    """Runs of a system's variants, with the measures of the system; `error` names their errors."""

    def __init__(
        self, names: Iterable[str], measures: Sequence[Measure], error: str = "error"
    ) -> None:
        self._measures = measures
        columns = {error: max(7, *map(len, error.split()))}
        columns |= {m.name: max(9, *map(len, m.name.split())) for m in measures}
        result = len(verdict(True) if error == "error" else DONE)
        self._table = PrintedTable("variant", names, {**columns, "time": 7}, result=result)

    def row(self, outcome: Outcome) -> None:
        measured = (f"{_seven_digits(m.value(outcome))} {m.unit}" for m in self._measures)
        error = short(outcome.error, 1) if outcome.errors else NONE
        cells = [error, *measured, seconds(outcome.run.wall_time)]
        good = DONE if outcome.is_estimate else verdict(outcome.passed)
        self._table.row(outcome.variant, cells, good)
        if not outcome.passed:
            bound = f"above its bound {short(BOUND)}"
            console.remark(f"error {short(outcome.error, 1)} of {outcome.worst}, {bound}")

    def failed(self, name: str) -> None:
        """Print a variant that a component did not finish."""
        self._table.row(name, [NONE] * (2 + len(self._measures)), verdict(False))
        console.remark("did not run to its end")


def _seven_digits(value: float) -> str:
    """Write a number in at most seven characters, unless it is very large or small."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"


def print_convergence(study: Convergence) -> None:
    """Print a table of errors over the communication step, and what is wrong with them."""
    print()
    steps = [duration(step) for step in study.problem.steps]
    columns = {step: max(5, len(step)) for step in steps}
    names = [row.name for row in study.rows]
    table = PrintedTable(study.scenario.name, names, {**columns, "slope": 5}, gap=1)
    for row in study.rows:
        cells = [*(short(error, 0) for error in row.errors), f"{row.slope:.2f}"]
        table.row(row.name, cells, verdict(row.holds))
    for text in study.violations:
        console.remark(f"{study.scenario.name}: {text}")


def print_measured(run: Run) -> None:
    """Print how far a run is from what was measured."""
    for compared in comparisons(run.scenario, run.result):
        known = unit(run.fmu.model.variables[compared.name].unit)
        rms = f"{compared.rms:.3g} {known} RMS from {compared.source}"
        console.remark(f"{run.scenario.name}: {compared.name} is {rms}")


def print_differences(entries: Iterable[Entry]) -> None:
    """Print how far results are from others that were given, and an empty line."""
    texts = [f"{entry.name}: {entry.difference}" for entry in entries if entry.difference]
    print(*texts, "", sep="\n")


# ---- The document --------------------------------------------------------------------------------
@dataclass
class Done:
    chosen: Sequence[Scenario]  # of the project
    own: Sequence[Scenario]  # of users, which are not compared with anything
    runs: list[Run] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    sweeps: list[Sweep] = field(default_factory=list)
    studies: list[Convergence] = field(default_factory=list)


def document(done: Done) -> dict[str, object]:
    """Return each scenario with its runs and its sweep, and the studies."""
    return {
        "scenarios": [_scenario(done, scenario) for scenario in (*done.chosen, *done.own)],
        "convergence": [_study(study) for study in done.studies],
    }


def _scenario(done: Done, scenario: Scenario) -> dict[str, object]:
    runs = [run for run in done.runs if run.scenario is scenario]
    failures = [failure for failure in done.failures if failure.scenario is scenario]
    sweeps = [sweep for sweep in done.sweeps if sweep.scenario is scenario]
    return {
        "name": scenario.name,
        "model": scenario.model,
        "file": scenario.path,
        "passed": not failures and all(x.passed for x in (*runs, *sweeps)),
        "compared": scenario in done.chosen,
        "warnings": scenario.questions,
        "runs": [_run(run) for run in runs],
        "failures": [{"tolerance": f.tolerance, "error": f.text} for f in failures],
        "sweep": {key: getattr(sweeps[0], key) for key in SWEEP} if sweeps else None,
    }


def _run(run: Run) -> dict[str, object]:
    found = {
        "fmi_version": run.fmu.model.fmi_version,
        "tolerance": run.result.tolerance,
        "steps": run.result.steps,
        "error": run.error,
        "worst": run.worst,
        "bound": run.bound if run.compared else None,
        "seconds": run.result.wall_time,
        "passed": run.passed,
        "messages": run.result.messages,
    }
    found["measured"] = {
        compared.name: {"source": compared.source, "rms": compared.rms}
        for compared in comparisons(run.scenario, run.result)
    }
    if run.twin is not None:
        found["twin"] = {"fmi_version": run.twin.fmi_version, "differing": run.twin.differing}
    return found


def _study(study: Convergence) -> dict[str, object]:
    return {
        "name": study.scenario.name,
        "steps": study.problem.steps.tolist(),
        "cases": [
            {"name": row.name, "errors": row.errors, "slope": row.slope, "passed": row.holds}
            for row in study.rows
        ],
        "passed": study.passed,
    }
