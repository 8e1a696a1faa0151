"""`prove`: how far runs and references are from the exact motion at most, by theorem."""

import argparse
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from rparm import building, console, project
from rparm.command_line import Ended, retyped
from rparm.console import Progress
from rparm.errors import UserError, WrongValueError, counted, placed
from rparm.files import check_writable, written
from rparm.fmi.fmu_file import Fmu
from rparm.interruption import temporary_folder
from rparm.proof import enclosure as enclosures
from rparm.proof import errors as proof
from rparm.proof.enclosure import Enclosure, Prover
from rparm.proof.errors import ProvenReference
from rparm.report import proof_page
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario
from rparm.units import rounded_up, short, typed_quantity, verdict

COLUMNS = {"values": 8, "nearest doubles": 8, "interval": 9}


def do_prove(options: argparse.Namespace) -> Ended:
    """Prove the errors of a scenario's runs, or of all references."""
    if options.name is None:
        for option in ("method", "tolerance", "within"):
            if getattr(options, option) is not None:
                raise UserError(f"--{option}: expected a scenario with it")
        return _references(options)
    if options.all:
        raise UserError(f"--all: expected no scenario with it, got {options.name!r}")
    check_writable(options.report)
    path = project.scenario_file(options.name)
    program = enclosures.prover_of(path)
    with _opened(path) as (fmu, scenario):
        methods = proof.methods_of(fmu, options.method)
        within = _within(options.within, program, fmu)
        enclosure = _enclosure(program, scenario, within, options.check)
        stopped = enclosure.stopped
        if stopped and not stopped.is_event:
            return Ended(1, f"failed: {stopped}", {"holds_up_to": stopped.time})
        good = None
        if path.resolve() in {file.resolve() for file in project.scenario_files().values()}:
            exact = _enclosure(program, scenario) if within else enclosure
            good = _reference(fmu, scenario, exact)
        states = enclosure.of(program.states)
        found, courses = _runs(fmu, scenario, states, methods, options.tolerance)
        with written(options.report):
            page = proof_page.write(
                options.report, scenario, fmu.model, states, courses, good, _command(options)
            )
    checked = _checked(enclosure.checked) if options.check else {}
    largest = max(e.error for errors in found.values() for e in errors.values())
    verdict = f"largest proven error: {rounded_up(largest, 2)}"
    methods = {m: {n: asdict(e) for n, e in errors.items()} for m, errors in found.items()}
    document = {"methods": methods} | ({"reference": asdict(good)} if good else {})
    document |= {"page": page.absolute()} | checked
    if stopped:
        document |= {"holds_up_to": stopped.time, "event": stopped.reason, "event_by": stopped.by}
        verdict = f"{verdict}; {stopped}"
    if good and not good.passed:
        return Ended(1, _verdict([good]), document, page=page)
    return Ended(0, verdict, document, page=page)


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Fmu, Scenario]]:
    """Open the FMU of a scenario; of a file with equations, with what its `experiment` says."""
    if not building.is_equations(path):
        with Fmu(project.fmu_of(scenarios.subject_of(path))) as fmu:
            yield fmu, scenarios.load(path, fmu.model)
        return
    with Fmu(path) as fmu, temporary_folder() as folder:
        file = folder / path.name
        text = scenarios.template(path.stem, scenarios.FMU, str(path.absolute()), fmu.model)
        file.write_text(text, encoding="utf-8", newline="\n")
        scenario = scenarios.load(file, fmu.model)
        text = "As the model's file says, with inputs at their starts."
        yield fmu, replace(scenario, path=path, title=fmu.model.name, description=text)


def _reference(fmu: Fmu, scenario: Scenario, enclosure: Enclosure) -> ProvenReference:
    """Check a scenario's reference; print its wrong values."""
    if enclosure.stopped is not None:
        raise UserError(f"{scenario.path}: {enclosure.stopped}")
    good = proof.proven_reference(fmu, scenario, enclosure)
    for wrong in good.wrong:
        print(wrong)
    return good


def _verdict(references: Collection[ProvenReference]) -> str:
    """Write the last line where values are wrong: the first one, and how many there are."""
    wrong = [value for good in references for value in good.wrong]
    count = sum(good.values - good.nearest for good in references)
    return f"failed: {wrong[0]}" + (f"; {count} values are wrong" if count > 1 else "")


def _command(options: argparse.Namespace) -> str:
    names = [options.name] if options.name else []
    given = {name: getattr(options, name) for name in ("method", "tolerance", "within")}
    given["check"] = options.check
    return retyped("prove", names, given)


def _within(given: str | None, program: Prover, fmu: Fmu) -> dict[str, float]:
    """Return by how much the start of each state may be off; states of other units are exact."""
    if given is None:
        return {}
    found: dict[str, float] = {}
    refusals = []
    for name in program.states:
        try:
            value = typed_quantity(given, fmu.model.variables[name].units)
            found[name] = value * (1 + 2.0**-48)  # more than roundings took from the typed value
        except WrongValueError as error:
            refusals.append(error)
    with placed("--within"):
        if not found:
            raise refusals[0]
        if any(value < 0 for value in found.values()):
            raise WrongValueError(f"expected 0 or more, got {given}")
    return found


def _enclosure(
    program: Prover, scenario: Scenario, within: Mapping[str, float] = {}, check: bool = False
) -> Enclosure:
    with Progress(f"{scenario.name}, proof", len(scenario.times) - 1) as progress:
        enclosure = program.enclose(scenario, within, progress, check=check)
    if len(enclosure.starts) > 1:
        console.remark(f"{scenario.name}: proven in {len(enclosure.starts)} pieces of the start")
    return enclosure


def _runs(
    fmu: Fmu, scenario: Scenario, enclosure: Enclosure, methods: list[str], tolerance: float | None
) -> tuple[dict[str, dict[str, proof.ProvenError]], dict[str, np.ndarray]]:
    """Print the largest errors of runs by each method; return these, and all errors by run."""
    units = [fmu.model.variables[name].unit for name in enclosure.names]
    heads = {f"{n} {u or ''}".strip(): 10 for n, u in zip(enclosure.names, units, strict=True)}
    print(f"{scenario.name}: largest distance from the exact motion at communication points")
    names = [
        f"{m} at {short(proof.tolerance_of(m, tolerance or scenario.tolerance))}" for m in methods
    ]
    table = console.PrintedTable("method", [*names, "interval"], heads, result=0)
    found, courses = {}, {}
    for method, name in zip(methods, names, strict=True):
        with Progress(f"{scenario.name}, {method}", len(scenario.times) - 1) as progress:
            used = tolerance or scenario.tolerance
            courses[name] = proof.error_bounds(fmu, scenario, enclosure, method, used, progress)
        errors = proof.largest_errors(courses[name], enclosure)
        table.row(name, [rounded_up(e.error, 2) for e in errors.values()])
        table.row("  at", [f"{e.at:.4g} s" for e in errors.values()])
        found[method] = errors
    table.row("interval", [rounded_up(e.radius, 1) for e in errors.values()])
    return found, courses


def _references(options: argparse.Namespace) -> Ended:
    """Check the references of all models with a prover."""
    check_writable(options.report)
    found: dict[str, ProvenReference] = {}
    rows, checked = [], 0
    for name in project.proven():
        folder = project.model(name)
        files = [x for x in project.scenario_files().values() if x.parents[1] == folder]
        program = enclosures.prover_of(files[0])
        table = console.PrintedTable("reference", [x.stem for x in files], COLUMNS)
        with Fmu(project.built(folder, ".fmu")) as fmu:
            for scenario in [scenarios.load(path, fmu.model) for path in files]:
                enclosure = _enclosure(program, scenario, check=options.check)
                good = found[scenario.name] = _reference(fmu, scenario, enclosure)
                cells = [str(good.values), str(good.nearest), rounded_up(good.radius, 1)]
                table.row(scenario.name, cells, verdict(good.passed))
                rows.append((scenario.name, *cells, verdict(good.passed)))
                checked += enclosure.checked
    everything = _checked(checked) if options.check else {}
    console.remark(
        "nearest doubles: values, of all columns, that are proven to be the doubles nearest to the "
        "exact ones; interval: radius of the widest one that contains an exact value"
    )
    with written(options.report):
        page = proof_page.write_references(
            options.report, ("reference", *COLUMNS, "result"), rows, found, _command(options)
        )
    good = {name: asdict(reference) for name, reference in found.items()}
    document = {"references": good, "page": page.absolute()} | everything
    if not all(reference.passed for reference in found.values()):
        return Ended(1, _verdict(found.values()), document, page=page)
    return Ended(0, f"proven: {counted(found, 'reference')}", document, page=page)


def _checked(steps: int) -> dict[str, dict[str, int]]:
    """Print how many steps are confirmed."""
    print(f"checked: {steps} steps confirmed")
    return {"checked": {"steps": steps}}
