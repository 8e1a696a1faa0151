"""`prove`: how far runs and references are from the exact motion at most, by theorem."""

import argparse
from collections.abc import Collection, Mapping
from dataclasses import asdict

import numpy as np

from rparm import console, project, proof
from rparm.command_line import Ended, add_flag, add_report, add_tolerance, retyped
from rparm.console import Progress
from rparm.errors import UserError, WrongValueError, counted, placed
from rparm.files import check_writable, written
from rparm.fmi.fmu_file import Fmu
from rparm.proof import ASSUMED, Enclosure, ProvenReference, Prover
from rparm.report import proof_page
from rparm.runs import scenario as scenarios
from rparm.runs.scenario import Scenario
from rparm.units import rounded_up, short, typed_quantity, verdict

COLUMNS = {"values": 8, "nearest doubles": 8, "interval": 9}


def add_prove_options(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        "Encloses the exact motion of a scenario in intervals, by validated integration, and "
        "prints how far the states in a run of the FMU are from it at most, for each method of "
        "integration. Every value of the scenario's reference must be the double nearest to "
        f"the exact one. Without a scenario, checks all references. Assumed are {ASSUMED}."
    )
    parser.add_argument(
        "name", nargs="?", metavar="SCENARIO", help="a scenario, or a file FILE.toml of your own"
    )
    add_flag(parser, "--all", "all references, as without a scenario")
    parser.add_argument("--method", metavar="NAME", help="only this method of integration")
    add_tolerance(parser, "relative tolerance of the runs (default: that of the scenario)")
    text = "by how much the start may be off: with a unit (0.1deg), the states of that unit"
    parser.add_argument("--within", metavar="VALUE", help=text)
    text = "check every step of the proof by a second program, in other arithmetic"
    add_flag(parser, "--check", text)
    add_report(parser)


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
    program = proof.prover_of(path)
    with Fmu(project.built(program.folder, ".fmu")) as fmu:
        scenario = scenarios.load(path, fmu.model)
        methods = proof.methods_of(fmu, options.method)
        within = _within(options.within, program, fmu)
        enclosure = _enclosure(program, scenario, within)
        if enclosure.stopped is not None:
            text = f"failed: the proof holds up to {enclosure.stopped!r} s, no further"
            return Ended(1, text, {"holds_up_to": enclosure.stopped})
        good = None
        if path.resolve() in {file.resolve() for file in project.scenario_files().values()}:
            exact = _enclosure(program, scenario, {}) if within else enclosure
            good = _reference(fmu, scenario, exact)
        states = enclosure.of(program.states)
        found, courses = _runs(fmu, scenario, states, methods, options.tolerance)
        with written(options.report):
            page = proof_page.write(
                options.report, scenario, fmu.model, states, courses, good, _command(options)
            )
    checked = _checked(program, {scenario: enclosure}) if options.check else {}
    largest = max(e.error for errors in found.values() for e in errors.values())
    methods = {m: {n: asdict(e) for n, e in errors.items()} for m, errors in found.items()}
    document = {"methods": methods} | ({"reference": asdict(good)} if good else {})
    document |= {"page": page.absolute()} | checked
    if good and not good.passed:
        return Ended(1, _verdict([good]), document, page=page)
    return Ended(0, f"largest proven error: {rounded_up(largest, 2)}", document, page=page)


def _reference(fmu: Fmu, scenario: Scenario, enclosure: Enclosure) -> ProvenReference:
    """Check a scenario's reference; print its wrong values."""
    if enclosure.stopped is not None:
        raise UserError(f"{scenario.path}: proven up to {enclosure.stopped} s only")
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


def _enclosure(program: Prover, scenario: Scenario, within: dict[str, float]) -> Enclosure:
    with Progress(f"{scenario.name}, proof", len(scenario.times) - 1) as progress:
        enclosure = program.enclose(scenario, within, progress)
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
    table = console.Table("method", [*names, "interval"], heads, result=0)
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
    everything, rows = {}, []
    for program in proof.provers().values():
        files = [x for x in project.scenario_files().values() if x.parents[1] == program.folder]
        table = console.Table("reference", [x.stem for x in files], COLUMNS)
        with Fmu(project.built(program.folder, ".fmu")) as fmu:
            proofs = {}
            for scenario in [scenarios.load(path, fmu.model) for path in files]:
                enclosure = proofs[scenario] = _enclosure(program, scenario, {})
                good = found[scenario.name] = _reference(fmu, scenario, enclosure)
                cells = [str(good.values), str(good.nearest), rounded_up(good.radius, 1)]
                table.row(scenario.name, cells, verdict(good.passed))
                rows.append((scenario.name, *cells, verdict(good.passed)))
        if options.check:
            everything |= _checked(program, proofs)
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


def _checked(program: Prover, proofs: Mapping[Scenario, Enclosure]) -> dict[str, dict[str, int]]:
    """Check the proofs of scenarios; prints how much is confirmed."""
    steps = operations = 0
    for scenario, enclosure in proofs.items():
        ahead = len(enclosure.starts) * (len(scenario.times) - 1)
        with Progress(f"{scenario.name}, check", ahead) as progress:
            more, operations = program.check(scenario, enclosure, progress)
        steps += more
    print(f"checked: {steps} steps and {operations} operations confirmed")
    return {"checked": {"steps": steps, "operations": operations}}
