"""`run`: simulate scenarios, compare the project's with references, write a report."""

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from rparm import console, project, result_tables
from rparm.command_line import (
    Ended,
    retyped,
)
from rparm.commands.files import do_list
from rparm.console import Progress
from rparm.errors import UserError, counted, did_you_mean, placed, together
from rparm.files import check_writable, from_here, missing, written
from rparm.fmi.fmu_file import Fmu
from rparm.needs import COMMANDS
from rparm.project import PROGRAM, VERSIONS
from rparm.report import overlay, pages
from rparm.report.overview import FILES, SCENARIOS
from rparm.report.writer import ReportWriter
from rparm.result_tables import Done, RunTable, SweepTable, print_convergence, print_measured
from rparm.runs import convergence
from rparm.runs import scenario as scenarios
from rparm.runs.comparison import TIGHTEST, TOLERANCES, Failure, Run, Runs, Sweep, sweep
from rparm.runs.convergence import Convergence
from rparm.runs.scenario import Scenario
from rparm.units import short

SUFFIX = ".toml"
FIRST, TWIN = VERSIONS  # of FMI: the one that runs, and the one that has to give the same bits
QUICK = 20.0  # s, longest sweep that runs by default for a named scenario


def do_run(options: argparse.Namespace) -> Ended:
    """Run the scenarios and files that the options name, or all scenarios."""
    if options.list:
        return do_list(options)
    with ExitStack() as stack:
        chosen, own, fmus, twins = _open(options, stack)
        for scenario in (*chosen, *own) if options.tolerance is not None else ():
            with placed(f"--tolerance: {scenario.name}"):
                model = fmus[scenario.model].model
                model.check_tolerance(options.tolerance, scenario.parameters)
        for scenario in (*chosen, *own):
            texts = (f"{from_here(scenario.path)}: {x}" for x in scenario.questions)
            console.messages("warning", texts)
        runs = Runs(fmus, twins)
        for scenario in chosen:
            runs.reference(scenario)  # so that a missing reference is reported before anything runs
        check_writable(options.report)
        results = {(SCENARIOS, x.name): fmus[x.model].model.variables for x in chosen}
        results |= {(FILES, x.name): fmus[x.model].model.variables for x in own}
        given = {name: getattr(options, name) for name in ("fmu", "fmi", "tolerance")}
        given["with"] = options.other
        again = retyped("run", [], given).partition(" run")[2]
        writer = ReportWriter(options.report, again, overlay.read(options.other, results))
        with written(options.report):
            writer.begin()
            if chosen:
                some = {scenario.name for scenario in chosen} if options.names else None
                writer.forget(some, studies=options.tolerance is None)
        done = Done(chosen, own)
        if options.tolerance is not None:
            done.runs = _runs(runs, chosen, bool(twins), done.failures, options.tolerance)
        else:
            done.runs = _runs(runs, chosen, bool(twins), done.failures, None, TIGHTEST)
            swept = _quick(done.runs) if options.names else chosen
            failed = {failure.scenario.path for failure in done.failures}
            swept = [scenario for scenario in swept if scenario.path not in failed]
            done.sweeps = _sweeps(runs, swept, bool(options.names))
            done.studies = [] if options.names else _convergence(fmus, twins)
        done.runs += _estimated(runs, own, done.failures, options.tolerance)
        console.stage("writing the report")
        groups = writer.grouped(done.runs)
        for group in groups.values():
            print_measured(group[0])
        with written(options.report), Progress("report", len(groups), "pages") as progress:
            page = writer.write(groups, done.sweeps, done.studies, progress, done.failures)
    result_tables.print_differences(writer.entries)
    for name, file in writer.files.items():
        print(f"{name}: {from_here(file)}")
    return _ended(done, (options.report / pages.INDEX).absolute(), page)


def _ended(done: Done, report: Path, page: Path) -> Ended:
    """Return the end of the command, with the page to show."""
    wrong = [x.scenario.name for x in (*done.runs, *done.sweeps, *done.studies) if not x.passed]
    wrong += [failure.scenario.name for failure in done.failures]
    everything = [*done.chosen, *done.own]
    verdict = console.verdict_line(wrong, everything, "scenario")
    if not wrong and done.own:
        verdict = f"completed: {counted(everything, 'scenario')}, errors estimated"
        verdict = f"{verdict} of {len(done.own)}" if done.chosen else verdict
    document = {"passed": not wrong, **result_tables.document(done), "report": report}
    if done.failures:
        error = together([UserError(failure.text) for failure in done.failures])
        return Ended(2, verdict, document, error, page)
    return Ended(1 if wrong else 0, verdict, document, page=page)


def _open(
    options: argparse.Namespace, stack: ExitStack
) -> tuple[list[Scenario], list[Scenario], dict[str, Fmu], dict[str, Fmu]]:
    """Return scenarios of the options, or all; users' own; FMUs by their models; and their twins.

    Without names, a given FMU runs only the scenarios of its model. There are twins, of models
    whose scenarios have references, if no FMU and no version of FMI is given.
    """
    given = stack.enter_context(Fmu(options.fmu)) if options.fmu else None
    if given is not None and options.fmi is not None:
        _check_version(given, options.fmi)
    files, own = _files(options.names)
    if not options.names:
        files = [
            file
            for file in project.scenario_files().values()
            if given is None or project.is_built_from(given.model.name, project.model_folder(file))
        ]
    if not files and not own:
        which = f" of {given.model.name}, the model of {options.fmu}" if given else ""
        raise UserError(f"{project.models_folder()}: has no scenarios{which}")
    subjects = {file: scenarios.subject_of(file) for file in (*files, *own)}
    names = {file: scenarios.name_of(subject) for file, subject in subjects.items()}
    models = {names[file]: subject for file, subject in subjects.items()}
    compared = {names[file]: subjects[file] for file in files}
    if given is not None:
        fmus, twins = dict.fromkeys(models, given), {}
    elif options.fmi is not None:
        fmus, twins = _opened(models, options.fmi, "--fmu", stack), {}
        for fmu in fmus.values():
            _check_version(fmu, options.fmi)
    else:
        fmus = _opened(models, FIRST, "--fmu", stack)
        twins = _opened(compared, TWIN, "", stack)
    for file in files if twins else ():
        scenarios.load(file, twins[names[file]].model)
    loaded, users = (
        [scenarios.load(file, fmus[names[file]].model) for file in some] for some in (files, own)
    )
    return loaded, users, fmus, twins


def _files(names: Sequence[str]) -> tuple[list[Path], list[Path]]:
    """Return the files of named scenarios of the project, and users' own files, by their paths."""
    files: dict[Path, None] = {}
    own: dict[str, Path] = {}
    for name in dict.fromkeys(names):
        path = Path(name)
        if path.suffix.lower() != SUFFIX:
            files[_named(name)] = None
        elif project.is_ours(path):
            files[path.resolve()] = None
        elif not os.path.lexists(path):
            raise UserError(f"{path}: {missing(path)}")
        elif own.setdefault(path.stem, path) != path:
            other = own[path.stem]
            raise UserError(f"{path}: its page would have the same name as the page of {other}")
    return list(files), list(own.values())


def _named(name: str) -> Path:
    """Return the file of a scenario of the project; a UserError guesses another meaning."""
    known = project.scenario_files()
    if name in known:
        return known[name]
    if name in (*COMMANDS, "help"):
        raise UserError(f"no scenario {name!r}: the command {name} goes first, {PROGRAM} {name}")
    own = {file.name: file for file in _siblings(Path(name))}
    file = own.get(f"{Path(name).name}{SUFFIX}")
    if file is not None:
        raise UserError(f"no scenario {name!r}, did you mean the file {str(file)!r}?")
    guess = did_you_mean(name, [*known, *COMMANDS, "help", *map(str, own.values())])
    raise UserError(
        f"no scenario or command {name!r}{guess} ({PROGRAM} --list names all scenarios)"
    )


def _siblings(path: Path) -> list[Path]:
    """Return files of the folder of a path that may be scenarios."""
    with suppress(OSError, ValueError):  # not there, or a name that no folder has
        return [x for x in sorted(path.parent.iterdir()) if x.suffix.lower() == SUFFIX]
    return []


def _opened(
    subjects: Mapping[str, Path], version: str, option: str, stack: ExitStack
) -> dict[str, Fmu]:
    """Open FMUs by their models: those that scenarios name, else those in build/ of a version."""
    return {
        name: stack.enter_context(Fmu(project.fmu_of(subject, option, version), version=version))
        for name, subject in subjects.items()
    }


def _check_version(fmu: Fmu, wanted: str) -> None:
    found = fmu.model.fmi_version
    if found != wanted:
        raise UserError(f"{fmu.path}: is an FMU of FMI {found}, --fmi wants {wanted}")


def _runs(
    runs: Runs,
    chosen: Sequence[Scenario],
    with_twins: bool,
    failures: list[Failure],
    *tolerances: float | None,
) -> list[Run]:
    """Run `chosen` at `tolerances`, None: their own; what an FMU does not finish is a failure."""
    if not chosen:
        return []
    console.stage(f"simulating {counted(chosen, 'scenario')}")
    own = {s: [t or s.tolerance for t in dict.fromkeys(tolerances)] for s in chosen}
    table = RunTable(
        [s.name for s in chosen], [first for first, *_ in own.values()], len(tolerances) > 1
    )
    done = []
    for scenario in chosen:
        ended, why = [], []
        for tolerance in dict.fromkeys(own[scenario]):
            label = f"{scenario.name} at {short(tolerance)}"
            ahead = runs.steps_ahead(scenario, [tolerance], compared=True)
            found = _one(runs, failures, runs.compared, scenario, tolerance, label, ahead)
            ended += found
            if not found:
                why.append(f"tolerance {short(tolerance)}: did not run to its end")
        table.row(scenario.name, own[scenario][0], ended, why)
        done += ended
    if with_twins:
        differ = {run.scenario.name for run in done if run.twin and run.twin.differing}
        same = {run.scenario.name for run in done} - differ
        print(f"\nsame bits in FMI {FIRST} and {TWIN}: {counted(same, 'scenario')}")
    return done


def _one(
    runs: Runs,
    failures: list[Failure],
    run: Callable[..., Run],
    scenario: Scenario,
    tolerance: float,
    label: str,
    steps: int,
) -> list[Run]:
    """Return the run that `run` makes; none, but a failure, if the FMU does not finish it."""
    try:
        with Progress(label, steps) as progress:
            found = run(scenario, tolerance, progress)
    except UserError as error:
        failures.append(runs.failure(scenario, tolerance, error))
        return []
    console.messages(f"{label}: the FMU says", found.result.messages)
    return [found]


def _estimated(
    runs: Runs, own: Sequence[Scenario], failures: list[Failure], tolerance: float | None
) -> list[Run]:
    """Run users' scenarios, without references; what an FMU does not finish is a failure."""
    if not own:
        return []
    console.stage(f"simulating {counted(own, 'scenario')} of your own")
    used = [tolerance or scenario.tolerance for scenario in own]
    table = RunTable([scenario.name for scenario in own], used)
    done = []
    for scenario, at in zip(own, used, strict=True):
        steps = 2 * (len(scenario.times) - 1)
        found = _one(runs, failures, runs.estimated, scenario, at, scenario.name, steps)
        table.row(scenario.name, at, found, [] if found else ["did not run to its end"])
        done += found
    return done


def _quick(done: Sequence[Run]) -> list[Scenario]:
    """Return the scenarios whose sweep takes seconds; print which ones are left out."""
    slowest: dict[Scenario, float] = {}
    for run in done:
        slowest[run.scenario] = max(slowest.get(run.scenario, 0.0), run.result.wall_time)
    quick = []
    for scenario, wall_time in slowest.items():
        seconds = wall_time * len(TOLERANCES)
        if seconds <= QUICK:
            quick.append(scenario)
        else:
            text = f"{scenario.name}: no sweep, it would take {seconds:.0f} s (run all: with sweep)"
            console.remark(text)
    return quick


def _sweeps(runs: Runs, chosen: Sequence[Scenario], in_full: bool) -> list[Sweep]:
    """Run `chosen` over the tolerances; shows all of them `in_full`, else those that are wrong."""
    if not chosen:
        return []
    console.stage(f"simulating at {counted(TOLERANCES, 'tolerance')}")
    sweeps = []
    for scenario in chosen:
        ahead = runs.steps_ahead(scenario, TOLERANCES)
        with Progress(f"{scenario.name}, all tolerances", ahead) as progress:
            sweeps.append(sweep(runs, scenario, progress))
    shown = [x for x in sweeps if in_full or not x.passed]
    if shown:
        table = SweepTable((x.scenario.name for x in shown), TOLERANCES)
        for one in shown:
            table.row(one)
    if not in_full:
        good = counted([x for x in sweeps if x.passed], "scenario")
        print(f"errors follow the tolerance, {short(TOLERANCES[0])} to {short(TIGHTEST)}: {good}")
    return sweeps


def _convergence(fmus: Mapping[str, Fmu], twins: Mapping[str, Fmu]) -> list[Convergence]:
    """Study the order of convergence; also by intermediate update, of an FMU or its twin."""
    studies = []
    for file in project.convergence_files():
        folder = project.model_folder(file).name
        fmu = fmus.get(folder)
        if fmu is None:
            continue
        problem = convergence.load(file, fmu.model)
        name = problem.scenario.name
        if not fmu.model.interpolates_inputs:
            console.remark(f"{name}: left out, the FMU does not interpolate inputs")
            continue
        both = (fmu, twins.get(folder))
        updated = next((x for x in both if x is not None and x.model.asks_for_inputs), None)
        ahead = convergence.steps_ahead(problem, updated is not None)
        with Progress(f"{name}, all steps", ahead) as progress:
            study = convergence.study(fmu, problem, progress, updated)
        print_convergence(study)
        studies.append(study)
    return studies
