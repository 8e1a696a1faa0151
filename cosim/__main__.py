"""Command line: runs scenarios on an FMU, checks them against their references, writes a report."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from cosim.errors import UserError
from cosim.outputs import from_here, reason, written

# What takes long to import is imported where it is used: Ctrl-C meanwhile leaves no traceback, and
# `list` is quick.
if TYPE_CHECKING:
    from cosim.accuracy import Run, Runs, Sweep
    from cosim.convergence import Convergence
    from cosim.scenario import Scenario
    from cosim.system.ssp import Ssp
    from cosim.unit import Fmu

ROOT = Path(__file__).resolve().parents[1]
LONGEST_MESSAGE = 2000  # characters; some quote what a file says
QUICK = 20.0  # s, longest sweep that comes with a scenario asked for by name


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, like every other mistake of the user."""
        raise UserError(f"{message} (--help explains)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 passed, 1 a bound exceeded, 2 a user's mistake.

    2 also where the system gives out: no memory, no room on the disk or for the output.
    """
    if isinstance(sys.stdout, TextIOWrapper):  # names that it cannot encode are no reason to stop
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        options = _parser().parse_args(arguments)
        code = options.command(options)
        if sys.stdout is not None:
            sys.stdout.flush()
        return code
    except UserError as error:
        return _refuse(str(error))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever read the output has left
        _drop_output()
        return 1
    except OSError as error:
        _drop_output()
        return _refuse(f"{error.filename or 'output or temporary files'}: {reason(error)}")
    except MemoryError:
        return _refuse("out of memory")


def _refuse(text: str) -> int:
    """Tell in one line what is wrong, with what would move the cursor escaped."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    text = text if len(text) <= LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]} ..."
    with suppress(OSError):  # where standard error is full too
        print(f"error: {text}", file=sys.stderr)
    return 2


def _drop_output() -> None:
    """Let what is still buffered go nowhere, or the interpreter would fail on it at its end."""
    with suppress(OSError, ValueError, AttributeError):  # closed, or not of the system
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _as_program() -> int:
    """`main`, ended by the user's Ctrl-C, SIGTERM or SIGHUP: temporary files are removed then.

    Compiled code of libraries may turn the exception of a signal into one of its own: whatever
    arrives after a signal is its end.
    """
    received: list[int] = []

    def stop(number: int, _: object) -> NoReturn:
        received.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(128 + number)

    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # else it is ignored: nohup does so
        if signal.getsignal(ending) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(ending, stop)
    try:
        return main()
    except Exception:
        if not received:
            raise
        if received[0] == signal.SIGINT:
            print("interrupted", file=sys.stderr)
        return 128 + received[0]


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m cosim",
        description="Simulates scenarios on a co-simulation FMU, checks them against references.",
    )
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    run = commands.add_parser(
        "run",
        help="simulate, check against the references, write a report",
        description="Simulates each scenario at its own tolerance and at 1e-11, and over the "
        "tolerances 1e-4 to 1e-11; compares all outputs with the reference, and prints the errors "
        "and their bounds. Without names, measures the order of convergence in the communication "
        "step too. Exit code: 0 all within bounds, 1 not, 2 wrong use.",
    )
    run.add_argument("names", nargs="*", metavar="NAME", help="scenarios (default: all)")
    run.add_argument(
        "--fmu", type=Path, metavar="PATH", help="the FMU (default: that of the model, in build/)"
    )
    _add_report(run, ROOT / "build" / "report")
    run.add_argument(
        "--tolerance",
        type=_tolerance,
        metavar="X",
        help="run at this relative tolerance only, without the sweep",
    )
    run.set_defaults(command=_run)
    listing = commands.add_parser(
        "list",
        help="name the scenarios",
        description="Prints the name and the title of every scenario.",
    )
    listing.set_defaults(command=_list)
    closed_loop = _Parser(add_help=False)
    closed_loop.add_argument(
        "--ssp", type=Path, metavar="PATH", help="the system (default: build/ClosedLoop.ssp)"
    )
    _add_report(closed_loop, ROOT / "build" / "report" / "system")
    system = commands.add_parser(
        "system",
        parents=[closed_loop],
        help="run the closed loop in Ecos, check against the references, write a report",
        description="Runs the variants of the closed loop (build/ClosedLoop.ssp) in Ecos and "
        "compares every variable with the reference. Exit code: 0 all within the bound, 1 not, "
        "2 wrong use, a wrong system or a component that fails.",
    )
    system.add_argument("names", nargs="*", metavar="VARIANT", help="variants (default: all)")
    system.add_argument("--list", action="store_true", help="name the variants")
    system.set_defaults(command=_system)
    coupling = commands.add_parser(
        "coupling",
        parents=[closed_loop],
        help="study how far co-simulation of the closed loop is from its exact solution",
        description="Steps the closed loop (build/ClosedLoop.ssp) in several orders, with inputs "
        "held and extrapolated and with step-size control, and compares it with the solution in "
        "continuous time. Exit code: 0 as expected, 1 not, 2 wrong use.",
    )
    coupling.set_defaults(command=_coupling)
    return parser


def _add_report(parser: argparse.ArgumentParser, folder: Path) -> None:
    parser.add_argument(
        "--report",
        type=Path,
        metavar="DIR",
        default=folder,
        help=f"folder for pictures and results (default: {folder.relative_to(ROOT)})",
    )


def _tolerance(text: str) -> float:
    try:
        tolerance = float(text)
    except ValueError:
        tolerance = 0.0
    if not 0 < tolerance < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return tolerance


def _list(_: argparse.Namespace) -> int:
    from cosim import scenario as scenarios

    found = [scenarios.load(path) for path in scenarios.find_all(ROOT).values()]
    width = max((len(scenario.name) for scenario in found), default=0)
    for scenario in found:
        print(f"{scenario.name:<{width}}  {scenario.title}")
    return 0


def _run(options: argparse.Namespace) -> int:
    # keeps matplotlib's font cache in the project
    os.environ.setdefault("MPLCONFIGDIR", str(ROOT / "build" / "matplotlib"))
    from cosim import convergence, report
    from cosim.accuracy import TIGHTEST, Runs
    from cosim.simulation import Progress

    chosen = _choose(options.names)
    studies: list[Convergence] = []
    with ExitStack() as stack:
        fmus = _open_fmus(chosen, options.fmu, stack)
        runs = Runs(fmus)
        for scenario in chosen:
            runs.reference(scenario)  # a missing one shows before anything has run
        with written(options.report):  # and so does a report without a place
            options.report.mkdir(parents=True, exist_ok=True)
        if options.tolerance is not None:
            done, sweeps = _print_runs(runs, chosen, options.tolerance), []
        else:
            done = _print_runs(runs, chosen, None, TIGHTEST)
            sweeps = _print_sweeps(runs, _to_sweep(done) if options.names else chosen)
            studies = [] if options.names else _print_convergence(fmus)
        sections = [
            convergence.section(
                study, "convergence" if i == 0 else f"convergence_{study.scenario.name}"
            )
            for i, study in enumerate(studies)
        ]
        with written(options.report), Progress("report", len(done), "runs") as progress:
            index = report.write(options.report, done, sweeps, progress, sections)
    print(f"\nreport: {from_here(index)}")
    failed = dict.fromkeys(x.scenario.name for x in (*done, *sweeps, *studies) if not x.passed)
    print(f"FAILED: {', '.join(failed)}" if failed else f"passed: {_count(chosen, 'scenario')}")
    return 1 if failed else 0


def _system(options: argparse.Namespace) -> int:
    os.environ.setdefault("MPLCONFIGDIR", str(ROOT / "build" / "matplotlib"))
    from cosim.system import runs as system
    from cosim.system import ssp

    path = options.ssp or system.SYSTEM
    if options.ssp is None and not path.exists():
        raise UserError(f"{path}: no such file, ./run.sh builds it")
    with ExitStack() as stack:
        try:
            unpacked = stack.enter_context(ssp.unpacked(path))
        except UserError:
            if not options.list:
                _remove_results(options.report)
            raise
        chosen = system.choose(unpacked, options.names)
        if options.list:
            print(*chosen, sep="\n")
            return 0
        return _run_system(unpacked, chosen, options.report)


def _remove_results(folder: Path) -> None:
    """Of a system that cannot be run nothing older is left that might be taken for its results."""
    from cosim.system import report as system_report
    from cosim.system import runs as system

    with written(folder):
        system_report.remove(folder, [x.name for x in system.REFERENCES.iterdir() if x.is_dir()])


def _run_system(ssp: Ssp, chosen: Sequence[str], folder: Path) -> int:
    """Run variants; a row appears as one ends, and its files are written then."""
    from cosim.system import report as system_report
    from cosim.system import runs as system

    with written(folder):
        system_report.remove(folder, chosen)
    references = {name: system.load_reference(ssp, name) for name in chosen}
    width = max(len("variant"), *map(len, chosen))
    head = f"{'variant':<{width}}  steps      error    bound  tracking error  wall time  result"
    print(head, "-" * len(head), sep="\n", flush=True)
    outcomes = []
    for name in chosen:
        outcome = system.simulate(ssp, name, references[name])
        result = "passed" if outcome.passed else f"FAILED ({outcome.worst})"
        print(
            f"{name:<{width}} {ssp.system.steps:>6} {outcome.error:>10.2e} "
            f"{system.BOUND:>8.0e} {1e3 * outcome.distance.max():>12.4f} mm "
            f"{outcome.run.wall_time:>8.3f} s  {result}",
            flush=True,
        )
        for message in outcome.run.messages:
            print(f"{name}: {message}", file=sys.stderr)
        with written(folder):
            system_report.write_run(folder, ssp, outcome)
        outcomes.append(outcome)
    with written(folder):
        index = system_report.write_page(folder, ssp, outcomes)
    print(f"\nreport: {from_here(index)}")
    failed = [outcome.variant for outcome in outcomes if not outcome.passed]
    print(f"FAILED: {', '.join(failed)}" if failed else f"passed: {_count(chosen, 'variant')}")
    return 1 if failed else 0


def _coupling(options: argparse.Namespace) -> int:
    os.environ.setdefault("MPLCONFIGDIR", str(ROOT / "build" / "matplotlib"))
    from cosim.coupling import report as coupling

    return 0 if coupling.run(options.report, options.ssp) else 1


def _choose(names: Sequence[str]) -> list[Scenario]:
    """Scenarios called `names`, or all of them."""
    from cosim import scenario as scenarios

    if names:
        paths = [scenarios.find(ROOT, name) for name in dict.fromkeys(names)]
    else:
        paths = list(scenarios.find_all(ROOT).values())
    if not paths:
        raise UserError(f"{ROOT / 'models'}: has no scenarios")
    return [scenarios.load(path) for path in paths]


def _open_fmus(chosen: Sequence[Scenario], path: Path | None, stack: ExitStack) -> dict[str, Fmu]:
    """FMU of each model, by the model's folder name: the one at `path`, or those in build/."""
    from cosim import reference
    from cosim.unit import Fmu

    fmus: dict[str, Fmu] = {}
    for scenario in chosen:
        if scenario.model not in fmus:
            file = path or ROOT / "build" / f"{reference.model_name(scenario)}.fmu"
            if path is None and not file.exists():
                raise UserError(f"{file}: no such file, ./run.sh builds it")
            fmus[scenario.model] = stack.enter_context(Fmu(file))
    return fmus


def _print_runs(runs: Runs, chosen: Sequence[Scenario], *tolerances: float | None) -> list[Run]:
    """Run `chosen` at `tolerances`, None being each one's own; a row appears as a run ends."""
    from cosim.simulation import Progress

    width = max(len("scenario"), *(len(scenario.name) for scenario in chosen))
    head = f"{'scenario':<{width}}  tolerance    steps      error    bound  wall time  result"
    print(head, "-" * len(head), sep="\n", flush=True)
    done = []
    for scenario in chosen:
        for tolerance in dict.fromkeys(t or scenario.tolerance for t in tolerances):
            label = f"{scenario.name} at {tolerance:g}"
            with Progress(label, runs.steps_ahead(scenario, [tolerance])) as progress:
                run = runs.run(scenario, tolerance, progress)
            result = run.result
            verdict = "passed" if run.passed else f"FAILED ({run.worst})"
            print(
                f"{scenario.name:<{width}}  {tolerance:>9.0e} {result.steps:>8} {run.error:>10.2e} "
                f"{run.bound:>8.0e} {result.wall_time:>8.3f} s  {verdict}",
                flush=True,
            )
            for message in result.messages:
                print(f"{label}: the FMU says: {message}", file=sys.stderr)
            done.append(run)
    return done


def _to_sweep(done: Sequence[Run]) -> list[Scenario]:
    """Scenarios of `done` whose sweep is a matter of seconds, which the slower ones are told."""
    from cosim.accuracy import TOLERANCES

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


def _print_sweeps(runs: Runs, chosen: Sequence[Scenario]) -> list[Sweep]:
    """Run `chosen` over the tolerances; a row of errors appears as a scenario ends."""
    from cosim.accuracy import TOLERANCES, sweep
    from cosim.simulation import Progress

    if not chosen:
        return []
    width = max(len("error at tolerance"), *(len(scenario.name) for scenario in chosen))
    columns = " ".join(f"{tolerance:>8.0e}" for tolerance in TOLERANCES)
    head = f"{'error at tolerance':<{width}} {columns}  result"
    print("", head, "-" * len(head), sep="\n", flush=True)
    sweeps = []
    for scenario in chosen:
        ahead = runs.steps_ahead(scenario, TOLERANCES)
        with Progress(f"{scenario.name}, all tolerances", ahead) as progress:
            swept = sweep(runs, scenario, progress)
        errors = " ".join(f"{error:>8.1e}" for error in swept.errors)
        verdict = "passed" if swept.passed else "FAILED"
        print(f"{scenario.name:<{width}} {errors}  {verdict}", flush=True)
        sweeps.append(swept)
    for swept in sweeps:
        for text in swept.violations:
            print(f"{swept.scenario.name}: {text}")
    return sweeps


def _print_convergence(fmus: Mapping[str, Fmu]) -> list[Convergence]:
    """Study the order of convergence of each model; a table appears as a study ends."""
    from cosim import convergence
    from cosim.simulation import Progress

    studies = []
    for path in convergence.find_all(ROOT):
        problem = convergence.load(path)
        fmu = fmus.get(problem.scenario.model)
        if fmu is None:
            continue
        if not fmu.description.coSimulation.canInterpolateInputs:
            print(f"\n{problem.scenario.name}: left out, the FMU does not interpolate inputs")
            continue
        label = f"{problem.scenario.name}, all steps"
        with Progress(label, convergence.steps_ahead(problem)) as progress:
            study = convergence.study(fmu, problem, progress)
        print("", *convergence.lines(study), sep="\n", flush=True)
        studies.append(study)
    return studies


def _count(things: Sequence[object], name: str) -> str:
    return f"{len(things)} {name}" + ("s" if len(things) != 1 else "")


if __name__ == "__main__":
    sys.exit(_as_program())
