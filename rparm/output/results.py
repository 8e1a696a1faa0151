"""Results of scenarios for programs: what --json prints of them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from rparm.runs.comparison import Failure, Run, Sweep, comparisons
from rparm.runs.convergence import Convergence
from rparm.runs.scenario import Scenario


@dataclass
class Done:
    chosen: Sequence[Scenario]  # of the project
    own: Sequence[Scenario]  # of users, which are not compared with anything
    runs: list[Run] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    sweeps: list[Sweep] = field(default_factory=list)
    studies: list[Convergence] = field(default_factory=list)


def document(done: Done) -> dict[str, object]:
    """Each scenario with its runs and its sweep, and the studies."""
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
        "sweep": _sweep(sweeps[0]) if sweeps else None,
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


def _sweep(sweep: Sweep) -> dict[str, object]:
    return {
        "tolerances": sweep.tolerances,
        "errors": sweep.errors,
        "violations": sweep.violations,
        "passed": sweep.passed,
    }


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
