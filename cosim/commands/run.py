"""`run`: simulate scenarios, compare them with their references, write a report.

Files of users are run in the same way; they have no references.
"""

import argparse
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from cosim import console, convergence, project
from cosim import scenario as scenarios
from cosim.comparison import Failure, Run, Runs
from cosim.convergence import Convergence
from cosim.errors import UserError, together
from cosim.fmu_file import Fmu
from cosim.model import VERSIONS
from cosim.output_files import check_writable, from_here, written
from cosim.progress import Progress
from cosim.report import pages
from cosim.report.browser import show
from cosim.report.writer import ReportWriter
from cosim.scenario import Scenario
from cosim.tolerance_sweep import TIGHTEST, TOLERANCES, Sweep, sweep

FIRST, TWIN = VERSIONS  # of FMI: what runs, and what has to give the same bits
QUICK = 20.0  # s, longest sweep that runs by default for a named scenario


def run(options: argparse.Namespace) -> int:
    """Run the scenarios and files that the options name, or all scenarios."""
    with ExitStack() as stack:
        chosen, own, fmus, twins = _open(options, stack)
        runs = Runs(fmus, twins)
        for scenario in chosen:
            runs.reference(scenario)  # so that a missing reference is reported before anything runs
        check_writable(options.report)
        writer = ReportWriter(options.report)
        with written(options.report):
            writer.begin()
            if chosen:
                writer.forget({scenario.name for scenario in chosen} if options.names else None)
        sweeps: list[Sweep] = []
        studies: list[Convergence] = []
        failures: list[Failure] = []
        if options.tolerance is not None:
            done = _runs(runs, chosen, bool(twins), failures, options.tolerance)
        else:
            done = _runs(runs, chosen, bool(twins), failures, None, TIGHTEST)
            sweeps = _sweeps(runs, _ended(_quick(done) if options.names else chosen, failures))
            studies = [] if options.names else _convergence(fmus, twins)
        estimated = _estimated(runs, own, failures, options.tolerance)
        groups = writer.grouped([*done, *estimated])
        with written(options.report), Progress("report", len(groups), "pages") as progress:
            page = writer.write(groups, sweeps, studies, progress, failures)
    for name, file in writer.files.items():
        print(f"\n{name}: {from_here(file)}", end="")
    print(f"\nreport: {from_here(options.report / pages.INDEX)}")
    if options.open:
        show(page)
    if failures:
        raise together([UserError(failure.text) for failure in failures])
    failed = (x.scenario.name for x in (*done, *sweeps, *studies) if not x.passed)
    if not chosen:  # files of users are not compared with anything
        return 0
    return console.summary(failed, chosen, "scenario")


def _open(
    options: argparse.Namespace, stack: ExitStack
) -> tuple[list[Scenario], list[Scenario], dict[str, Fmu], dict[str, Fmu]]:
    """Scenarios that the options name, or all; users' own; FMUs by their models; and their twins.

    An FMU is opened once, and every scenario of its model is checked against it. Without names, one
    that is given runs only the scenarios of its model. There are twins if no FMU and no version of
    FMI is given, of the models whose scenarios have references.
    """
    given = stack.enter_context(Fmu(options.fmu)) if options.fmu else None
    if given is not None and options.fmi not in (None, given.model.fmi_version):
        found = given.model.fmi_version
        raise UserError(f"{given.path}: is an FMU of FMI {found}, --fmi wants {options.fmi}")
    files, own = _files(options.names)
    if not options.names:
        files = [
            file
            for file in project.scenario_files().values()
            if given is None or project.is_built_from(given.model.name, project.model_folder(file))
        ]
    if not files and not own:
        which = f" of {given.model.name}, the model of {options.fmu}" if given else ""
        raise UserError(f"{project.ROOT / 'models'}: has no scenarios{which}")
    folders = {file: scenarios.folder_of(file) for file in (*files, *own)}
    models = {folder.name: folder for folder in folders.values()}
    compared = {folders[file].name: folders[file] for file in files}
    if given is not None:
        fmus, twins = dict.fromkeys(models, given), {}
    elif options.fmi is not None:
        fmus, twins = _built(models, options.fmi, "--fmu", stack), {}
    else:
        fmus = _built(models, FIRST, "--fmu", stack)
        twins = _built(compared, TWIN, "", stack)
    for file in files if twins else ():
        scenarios.load(file, twins[folders[file].name].model)
    loaded, users = (
        [scenarios.load(file, fmus[folders[file].name].model) for file in some]
        for some in (files, own)
    )
    return loaded, users, fmus, twins


def _files(names: Sequence[str]) -> tuple[list[Path], list[Path]]:
    """Files of the project's scenarios that are named, and users' own files, by their paths."""
    files: dict[Path, None] = {}
    own: dict[str, Path] = {}
    for name in dict.fromkeys(names):
        path = Path(name)
        if path.suffix.lower() != ".toml":
            files[project.scenario_file(name)] = None
        elif project.is_ours(path):
            files[path.resolve()] = None
        elif own.setdefault(path.stem, path) != path:
            other = own[path.stem]
            raise UserError(f"{path}: its page would have the name of that of {other}")
    return list(files), list(own.values())


def _built(
    folders: Mapping[str, Path], version: str, option: str, stack: ExitStack
) -> dict[str, Fmu]:
    """FMUs in build/ of one version of FMI, by their models."""
    return {
        name: stack.enter_context(Fmu(project.built(folder, ".fmu", option, version)))
        for name, folder in folders.items()
    }


def _runs(
    runs: Runs,
    chosen: Sequence[Scenario],
    with_twins: bool,
    failures: list[Failure],
    *tolerances: float | None,
) -> list[Run]:
    """Run `chosen` at `tolerances`; None: at the tolerance of the scenario.

    A run that an FMU does not finish is added to `failures`.
    """
    if not chosen:
        return []
    names = (scenario.name for scenario in chosen)
    table = console.RunTable(names, TWIN if with_twins else None)
    done = []
    for scenario in chosen:
        for tolerance in dict.fromkeys(t or scenario.tolerance for t in tolerances):
            label = f"{scenario.name} at {tolerance:g}"
            ahead = runs.steps_ahead(scenario, [tolerance], compared=True)
            try:
                with Progress(label, ahead) as progress:
                    run = runs.compared(scenario, tolerance, progress)
            except UserError as error:
                failures.append(runs.failure(scenario, tolerance, error))
                table.failed(scenario.name, tolerance)
                continue
            table.row(run)
            console.messages(f"{label}: the FMU says", run.result.messages)
            done.append(run)
    return done


def _ended(chosen: Sequence[Scenario], failures: Sequence[Failure]) -> list[Scenario]:
    """Those of `chosen` that did not fail."""
    failed = {failure.scenario.path for failure in failures}
    return [scenario for scenario in chosen if scenario.path not in failed]


def _estimated(
    runs: Runs, own: Sequence[Scenario], failures: list[Failure], tolerance: float | None
) -> list[Run]:
    """Run scenarios of users, which have no references; None: at their own tolerances.

    A run that an FMU does not finish is added to `failures`.
    """
    if not own:
        return []
    table = console.RunTable(scenario.name for scenario in own)
    done = []
    for scenario in own:
        used = tolerance or scenario.tolerance
        try:
            with Progress(scenario.name, 2 * (len(scenario.times) - 1)) as progress:
                run = runs.estimated(scenario, used, progress)
        except UserError as error:
            failures.append(runs.failure(scenario, used, error))
            table.failed(scenario.name, used)
            continue
        table.row(run)
        console.messages(f"{scenario.name}: the FMU says", run.result.messages)
        done.append(run)
    return done


def _quick(done: Sequence[Run]) -> list[Scenario]:
    """Scenarios of `done` whose sweep takes seconds; says which ones are left out."""
    slowest: dict[Scenario, float] = {}
    for run in done:
        slowest[run.scenario] = max(slowest.get(run.scenario, 0.0), run.result.wall_time)
    quick = []
    for scenario, wall_time in slowest.items():
        seconds = wall_time * len(TOLERANCES)
        if seconds <= QUICK:
            quick.append(scenario)
        else:
            print(f"{scenario.name}: no sweep, it would take {seconds:.0f} s (run all: with sweep)")
    return quick


def _sweeps(runs: Runs, chosen: Sequence[Scenario]) -> list[Sweep]:
    """Run `chosen` over the tolerances."""
    if not chosen:
        return []
    table = console.SweepTable((scenario.name for scenario in chosen), TOLERANCES)
    sweeps = []
    for scenario in chosen:
        ahead = runs.steps_ahead(scenario, TOLERANCES)
        with Progress(f"{scenario.name}, all tolerances", ahead) as progress:
            sweeps.append(sweep(runs, scenario, progress))
        table.row(sweeps[-1])
    table.violations(sweeps)
    return sweeps


def _convergence(fmus: Mapping[str, Fmu], twins: Mapping[str, Fmu]) -> list[Convergence]:
    """Study the order of convergence of the models whose FMUs are open.

    An FMU that asks for inputs within a step, or else its twin, shows that of intermediate update.
    """
    studies = []
    for file in project.convergence_files():
        folder = project.model_folder(file).name
        fmu = fmus.get(folder)
        if fmu is None:
            continue
        problem = convergence.load(file, fmu.model)
        name = problem.scenario.name
        if not fmu.model.interpolates_inputs:
            print(f"\n{name}: left out, the FMU does not interpolate inputs")
            continue
        both = (fmu, twins.get(folder))
        updated = next((x for x in both if x is not None and x.model.asks_for_inputs), None)
        ahead = convergence.steps_ahead(problem, updated is not None)
        with Progress(f"{name}, all steps", ahead) as progress:
            study = convergence.study(fmu, problem, progress, updated)
        console.convergence(study)
        studies.append(study)
    return studies
