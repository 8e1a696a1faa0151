"""`system`: run systems, compare the project's with references, estimate errors of others."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from rparm import console, project
from rparm.command_line import Ended, retyped
from rparm.console import Progress
from rparm.errors import UserError, counted, did_you_mean, together
from rparm.files import check_writable, written
from rparm.project import PROGRAM
from rparm.report import overlay, overview, system_page
from rparm.report.overview import SYSTEM, Entry
from rparm.report.system_page import Section
from rparm.result_tables import VariantTable, print_differences
from rparm.systems import comparison, ecos, master
from rparm.systems.comparison import Outcome, Reference
from rparm.systems.opened import given_file, opened


def do_system(options: argparse.Namespace) -> Ended:
    """Run the variants that the options name, or all; or name them."""
    with ExitStack() as stack:
        try:
            systems = [_opened(path, options, stack) for path in _paths(options)]
        except UserError:
            if not options.list:
                # if a system cannot be run, older results must not pass for new ones
                with written(options.report):
                    for name, folder in project.systems().items():
                        known = comparison.reference_names(folder)
                        system_page.remove(options.report, name, known)
            raise
        chosen = _choose(systems, options.names)
        if options.list:
            found = {system.name: names for system, names in chosen}
            blocks = ("\n  ".join([name, *names]) for name, names in found.items())
            return Ended(0, "\n".join(blocks), {"systems": found})
        known = {(SYSTEM, s.page(name)): s.names for s, names in chosen for name in names}
        options.others = overlay.read(options.other, known)
        check_writable(options.report)
        with written(options.report):
            for system, names in chosen:
                system_page.remove(options.report, system.name, [*map(system.page, names)])
        return _run(chosen, options)


def _paths(options: argparse.Namespace) -> list[Path]:
    """Return the SSPs to open: the given one, or all that the names may be of."""
    file = given_file(next(iter(options.names), None), options.ssp)
    options.own = file != options.ssp
    if options.own:
        options.names.pop(0)
    if file:
        return [file]
    folders = project.systems()
    if options.names and set(options.names) <= set(folders):
        folders = {name: folders[name] for name in dict.fromkeys(options.names)}
    return [project.built(folder, ".ssp", "--ssp", options.fmi) for folder in folders.values()]


def _opened(path: Path, options: argparse.Namespace, stack: ExitStack) -> Section:
    """Open the system in a file, with the folder that it is from, if it is the project's."""
    system = stack.enter_context(opened(path, options.step, options.fmi))
    folder = project.systems().get(system.system.name)
    if folder and options.own and not project.is_built(path, folder):
        folder = None  # a user's file may have the name of a system of the project
    console.messages(str(path), system.notes)
    return Section(folder, system)


def _choose(systems: Sequence[Section], names: Sequence[str]) -> list[tuple[Section, list[str]]]:
    """Choose the variants to run of each system, all without names; UserError for a wrong name."""
    owners: dict[str, str] = {system.name: "a system" for system in systems}
    for system in systems:
        for variant in system.variants:
            if variant in owners:
                where = f"{system.ssp.path}: the name of variant {variant!r}"
                raise UserError(f"{where} is taken by {owners[variant]}")
            owners[variant] = f"a variant of {system.name}"
    for name in names:
        if name not in owners:
            guess = did_you_mean(name, owners)
            raise UserError(f"no variant {name!r}{guess} ({PROGRAM} system --list names them)")
    chosen = []
    for system in systems:
        own = [name for name in dict.fromkeys(names) if name in system.variants]
        if not names or system.name in names:
            own = system.variants
        if own:
            chosen.append((system, own))
    return chosen


def _run(chosen: Sequence[tuple[Section, Sequence[str]]], options: argparse.Namespace) -> Ended:
    """Run variants; a row appears as a variant ends, and its files are written then."""
    plans: list[tuple[Section, dict[str, Reference | None]]] = []
    for system, names in chosen:
        references: dict[str, Reference | None] = dict.fromkeys(names)
        if options.exact and (system.folder or system.ssp.path.suffix.lower() != ".toml"):
            what = "a loop file whose components are all files with equations"
            raise UserError(f"{system.ssp.path}: --exact expects {what}")
        for name in system.ssp.system.rates if options.exact else ():
            raise UserError(
                f"{system.ssp.path}: --exact: {name} has its own rate, one FMU has none"
            )
        if system.folder and system.study:
            given = system.folder, system.study.EXPERIMENT
            references = {n: comparison.load_reference(system.ssp, n, *given) for n in names}
        plans.append((system, references))
    outcomes: list[Outcome] = []
    failures: dict[str, UserError] = {}
    code = 1
    entries: list[Entry] = []
    rows: list[dict[str, object]] = []
    for section, references in plans:
        why_not = ecos.absent() if section.folder else ecos.unsuited(section.ssp)
        engine, where = (master.run_in_master, "this process") if why_not else (ecos.run, "Ecos")
        if why_not:
            steps = f"the master of rparm steps {section.name}"
            same = ", in the same order as Ecos" * (section.ssp.system.order == "jacobi")
            print(f"{why_not}: {steps}{same}")
        console.stage(f"simulating {counted(references, 'variant')} of {section.name} in {where}")
        error_title = "error" if section.folder else "coupling error"
        table = VariantTable(references, section.measures, error_title)
        for name, reference in references.items():
            try:
                outcome = _simulated(section, name, reference, engine, options.exact)
            except UserError as error:
                failures[name] = error
                table.failed(name)
                rows.append({"system": section.name, "name": name, "error": str(error)})
                code = max(code, error.code)
                with written(options.report):
                    entries.append(system_page.write_failed(options.report, section, name, error))
                continue
            table.row(outcome)
            measures = {m.name: (m.value(outcome), m.unit) for m in section.measures}
            found = {"error": outcome.error, "worst": outcome.worst} if outcome.errors else {}
            if outcome.is_estimate:
                console.remark(system_page.estimate(outcome))
                found = {f"coupling_{key}": value for key, value in found.items()}
                if outcome.cheaper:
                    found |= dict(
                        zip(("cheaper_order", "cheaper_error"), outcome.cheaper, strict=True)
                    )
                if outcome.exact_errors:
                    console.remark(system_page.true_error(outcome))
                    worst = max(outcome.exact_errors, key=outcome.exact_errors.__getitem__)
                    found |= {"true_error": outcome.exact_errors[worst], "true_worst": worst}
            else:
                found |= {"bound": comparison.BOUND, "passed": outcome.passed}
            rows.append(
                {
                    "system": section.name,
                    "name": outcome.variant,
                    "steps": outcome.steps,
                    **found,
                    "measures": {m: {"value": v, "unit": u} for m, (v, u) in measures.items()},
                    "seconds": outcome.run.wall_time,
                }
            )
            console.messages(name, outcome.run.messages)
            with written(options.report):
                over = options.others.get((SYSTEM, section.page(outcome.variant)))
                entries.append(system_page.write_variant(options.report, section, outcome, over))
            if options.pictures:
                with written(options.pictures):
                    options.pictures.mkdir(parents=True, exist_ok=True)
                    system_page.write_picture(options.pictures / f"{name}.png", section, outcome)
            outcomes.append(outcome)
        print_differences(entries[-len(references) :])
    given = {"ssp": options.ssp, "step": options.step, "with": options.other}
    given["fmi"] = options.fmi if options.fmi != project.VERSIONS[0] else None
    more = retyped("system", [], given).partition(" system")[2]
    with written(options.report):
        entries = [replace(entry, command=entry.command + more) for entry in entries]
        index = overview.record(options.report, overview.SYSTEM, entries)
    failed = [*failures, *(outcome.variant for outcome in outcomes if not outcome.passed)]
    verdict = console.verdict_line(failed, rows, "variant")
    if not failed and not any(section.folder for section, _ in plans):
        verdict = verdict.replace("passed", "completed")
    document = {"passed": not failed, "variants": rows, "report": index.absolute()}
    if failures:
        return Ended(code, verdict, document, together(list(failures.values())), index)
    return Ended(1 if failed else 0, verdict, document, page=index)


def _simulated(
    section: Section, name: str, reference: Reference | None, engine: comparison.Engine,
    exact: bool,
) -> Outcome:  # fmt: skip
    """Run a variant, with a bar on a terminal if that takes long; exact: as one FMU, too."""
    steps = section.ssp.system.steps
    if reference is not None:
        with Progress(name, steps) as progress:
            return comparison.simulate(section.ssp, name, reference, engine, progress)
    estimates = not comparison.why_no_estimate(section.ssp)
    with Progress(name, 5 * steps if estimates else steps) as progress:
        try:
            outcome = comparison.run_alone(section.ssp, name, section.names, engine, progress)
        except UserError:
            if engine is ecos.run:  # it goes on where an FMU of FMI 3.0 ends the simulation
                master.run_in_master(section.ssp, name, section.names)
            raise
    return comparison.with_exact(outcome, section.ssp, section.names) if exact else outcome
