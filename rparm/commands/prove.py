"""`prove`: how far runs and references are from the exact motion at most, by theorem."""

import argparse
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from rparm import project
from rparm.commands import Ended
from rparm.errors import UserError, WrongValueError, placed
from rparm.fmi.fmu_file import Fmu
from rparm.options import add_document, relative_tolerance
from rparm.output import console
from rparm.output.progress import Progress
from rparm.proof import proven, prover
from rparm.proof.proven import ASSUMED
from rparm.proof.prover import Enclosure, Prover
from rparm.scenarios import scenario as scenarios
from rparm.scenarios.scenario import Scenario
from rparm.texts import counted
from rparm.units import typed_quantity

DESCRIPTION = (
    "Encloses the exact motion of a scenario in intervals, by validated integration, and prints "
    "how far the states in a run of the FMU are from it at most, for each method of integration. "
    f"Without a scenario, does so for all references. Assumed are {ASSUMED}."
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Which scenario, and how it runs."""
    parser.add_argument(
        "name", nargs="?", metavar="SCENARIO", help="a scenario, or a file FILE.toml of your own"
    )
    parser.add_argument("--method", metavar="NAME", help="only this method of integration")
    parser.add_argument(
        "--tolerance",
        type=relative_tolerance,
        metavar="X",
        help="relative tolerance of the runs (default: that of the scenario)",
    )
    parser.add_argument(
        "--within",
        metavar="VALUE",
        help="by how much the start may be off: with a unit (0.1deg), the states of that unit",
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="check every step of the proof by a second program, in other arithmetic",
    )
    add_document(parser)


def run(options: argparse.Namespace) -> Ended:
    """Prove the errors of a scenario's runs, or of all references."""
    if options.name is None:
        for option in ("method", "tolerance", "within"):
            if getattr(options, option) is not None:
                raise UserError(f"--{option}: expected a scenario with it")
        return _references(options)
    own = Path(options.name).suffix.lower() == ".toml"
    path = Path(options.name) if own else project.scenario_file(options.name)
    program = prover.of_scenario(path)
    with Fmu(project.built(program.folder, ".fmu")) as fmu:
        scenario = scenarios.load(path, fmu.model)
        methods = proven.methods(fmu, options.method)
        within = _within(options.within, program, fmu)
        enclosure = _enclosure(program, scenario, within)
        if enclosure.stopped is not None:
            return Ended(
                1,
                f"failed: the proof holds up to {enclosure.stopped:.6g} s, no further",
                {"holds_up_to": enclosure.stopped},
            )
        found = _runs(fmu, scenario, enclosure, methods, options.tolerance)
    checked = _checked(program, {scenario: enclosure}) if options.check else {}
    largest = max(e.error for errors in found.values() for e in errors.values())
    document = {
        "methods": {m: {n: asdict(e) for n, e in errors.items()} for m, errors in found.items()}
    }
    return Ended(0, f"largest proven error: {largest:.2e}", document | checked)


def _within(given: str | None, program: Prover, fmu: Fmu) -> dict[str, float]:
    """By how much the start of each state may be off; those of other units are exact."""
    if given is None:
        return {}
    found: dict[str, float] = {}
    refusals = []
    for name in program.states:
        try:
            found[name] = typed_quantity(given, fmu.model.variables[name].units)
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
    fmu: Fmu,
    scenario: Scenario,
    enclosure: Enclosure,
    methods: list[str],
    tolerance: float | None,
) -> dict[str, dict[str, proven.ProvenError]]:
    """Run with each method; prints the largest errors, and where they are."""
    units = [fmu.model.variables[name].unit for name in enclosure.states]
    heads = {f"{n} {u or ''}".strip(): 10 for n, u in zip(enclosure.states, units, strict=True)}
    print(f"{scenario.name}: largest distance from the exact motion at communication points")
    names = [f"{m} at {proven.tolerance_of(m, tolerance or scenario.tolerance):g}" for m in methods]
    table = console.Table("method", [*names, "interval"], heads, result=0)
    found = {}
    for method, name in zip(methods, names, strict=True):
        with Progress(f"{scenario.name}, {method}", len(scenario.times) - 1) as progress:
            errors = dict(
                proven.errors(
                    fmu, scenario, enclosure, method, tolerance or scenario.tolerance, progress
                )
            )
        table.row(name, [f"{e.error:.2e}" for e in errors.values()])
        table.row("  at", [f"{e.at:.4g} s" for e in errors.values()])
        found[method] = errors
    table.row("interval", [f"{e.radius:.1e}" for e in errors.values()])
    return found


def _references(options: argparse.Namespace) -> Ended:
    """How good the references of all models with a prover are."""
    found = {}
    everything = {}
    for program in prover.provers().values():
        files = [x for x in project.scenario_files().values() if x.parents[1] == program.folder]
        columns = {"values": 8, "nearest doubles": 8, "error beyond": 9, "interval": 9}
        table = console.Table("reference", [x.stem for x in files], columns, result=0)
        with Fmu(project.built(program.folder, ".fmu")) as fmu:
            proofs = {}
            for scenario in [scenarios.load(path, fmu.model) for path in files]:
                enclosure = proofs[scenario] = _enclosure(program, scenario, {})
                if enclosure.stopped is not None:
                    raise UserError(f"{scenario.path}: proven up to {enclosure.stopped} s only")
                good = proven.of_reference(fmu, scenario, enclosure)
                share = f"{100 * good.nearest / good.values:.1f} %"
                cells = [str(good.values), share, f"{good.error:.1e}", f"{good.radius:.1e}"]
                table.row(scenario.name, cells)
                found[scenario.name] = asdict(good)
        if options.check:
            everything |= _checked(program, proofs)
    console.remark(
        "nearest doubles: of the states, proven; error beyond: more than half a unit in the last "
        "place; interval: the widest one that contains an exact state"
    )
    return Ended(0, f"proven: {counted(found, 'reference')}", {"references": found} | everything)


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
