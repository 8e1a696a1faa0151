"""Command line of cosim, a module of cosim.commands each; and how a command ends."""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import NoReturn

from cosim import project
from cosim.errors import UserError, reason
from cosim.model import VERSIONS

LONGEST_MESSAGE = 2000  # characters; some quote what a file says
# signals that end the program; Windows has no SIGHUP, SIGBREAK is its Ctrl-Break and closed console
ENDINGS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; the exit code: 0 passed, 1 a bound exceeded, 2 a user's mistake.

    2 also if the system gives out: no memory, no room on the disk or for the output.
    """
    if isinstance(sys.stdout, TextIOWrapper):  # names that it cannot encode are no reason to stop
        sys.stdout.reconfigure(errors="backslashreplace")
    # keeps matplotlib's font cache in the project
    os.environ.setdefault("MPLCONFIGDIR", str(project.ROOT / "build" / "matplotlib"))
    try:
        options = _parser().parse_args(arguments)
        # imported here because it takes long: so Ctrl-C during the import leaves no traceback
        code = import_module(f"cosim.commands.{options.command}").run(options)
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
    """Say in one line what is wrong, with what would move the cursor escaped."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    text = text if len(text) <= LONGEST_MESSAGE else f"{text[:LONGEST_MESSAGE]} ..."
    with suppress(OSError):  # standard error may be full too
        print(f"error: {text}", file=sys.stderr)
    return 2


def _drop_output() -> None:
    """Discard what is still buffered, or the interpreter would fail to write it at exit."""
    with suppress(OSError, ValueError, AttributeError):  # closed, or not of the system
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _as_program() -> int:
    """`main`, ended by Ctrl-C or another of `ENDINGS`: temporary files are removed then.

    Compiled code of libraries may turn the exception of a signal into another one: whatever
    arrives after a signal counts as its end.
    """
    received: list[int] = []

    def stop(number: int, _: object) -> NoReturn:
        received.append(number)
        raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(128 + number)

    for ending in (getattr(signal, name) for name in ENDINGS if hasattr(signal, name)):
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


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, like every other mistake of the user."""
        raise UserError(f"{message} (--help explains)")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m cosim",
        description="Simulates scenarios on co-simulation FMUs and checks them against references.",
    )
    commands = parser.add_subparsers(
        title="commands", dest="command", required=True, metavar="COMMAND"
    )
    run = commands.add_parser(
        "run",
        help="simulate, check against the references, write a report",
        description="Simulates each scenario at its own tolerance and at 1e-11, and over the "
        "tolerances 1e-4 to 1e-11; compares all outputs with the reference, and prints the errors "
        "and their bounds. Without names, measures the order of convergence in the communication "
        "step too. The FMUs are of FMI 2.0; those of FMI 3.0 must give the same bits. Exit code: 0 "
        "all as it should be, 1 not, 2 wrong use.",
    )
    run.add_argument("names", nargs="*", metavar="NAME", help="scenarios (default: all)")
    run.add_argument(
        "--fmu",
        type=Path,
        metavar="PATH",
        help="the FMU, for the scenarios of its model (default: that of each model, in build/)",
    )
    _add_fmi(run, None, "run only FMUs of this version of FMI")
    _add_report(run, project.report_folder())
    run.add_argument(
        "--tolerance",
        type=_tolerance,
        metavar="X",
        help="run at this relative tolerance only, without the sweep",
    )
    commands.add_parser(
        "list",
        help="name the scenarios",
        description="Prints the name and the title of every scenario.",
    )
    system_options = _Parser(add_help=False)
    choice = system_options.add_mutually_exclusive_group()
    choice.add_argument(
        "--ssp", type=Path, metavar="PATH", help="the system (default: all in build/)"
    )
    _add_fmi(choice, VERSIONS[0], "systems in build/ with FMUs of this version of FMI (default: 2)")
    _add_report(system_options, project.report_folder("system"))
    system = commands.add_parser(
        "system",
        parents=[system_options],
        help="run systems in Ecos, check against the references, write a report",
        description="Runs the variants of the systems in Ecos and compares every variable with the "
        "reference. Exit code: 0 all within the bound, 1 not, 2 wrong use, a wrong system or a "
        "component that fails.",
    )
    system.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="variants, or systems with all theirs (default: all)",
    )
    system.add_argument("--list", action="store_true", help="name the systems and their variants")
    commands.add_parser(
        "coupling",
        parents=[system_options],
        help="study how far co-simulation of a system is from its exact solution",
        description="Steps the system in several orders, with inputs held and extrapolated and "
        "with step-size control, and compares it with the solution in continuous time. Exit code: "
        "0 as expected, 1 not, 2 wrong use.",
    )
    _add_federation(commands)
    return parser


def _add_federation(commands: argparse._SubParsersAction) -> None:
    federation = commands.add_parser(
        "federation",
        help="run a system with each FMU in its own process, coupled by HELICS",
        description="Runs variants of the closed loop with each FMU in its own process, coupled by "
        "HELICS, and compares every value with that of the master that steps all in one process in "
        "Jacobi order. The processes may be on several machines. Exit code: 0 all within the "
        "bound, 1 not, 2 wrong use or a process that fails.",
    )
    choice = federation.add_mutually_exclusive_group()
    choice.add_argument(
        "--ssp", type=Path, metavar="PATH", help="the system (default: the closed loop in build/)"
    )
    _add_fmi(choice, VERSIONS[0], "the system in build/ with FMUs of this version of FMI")
    federation.add_argument(
        "--listen",
        metavar="ADDRESS",
        help="where processes of other machines find the federation, as tcp://192.168.0.1:23404 "
        "(default: a free port that only this machine sees)",
    )
    federation.add_argument(
        "--elsewhere",
        nargs="+",
        default=[],
        metavar="COMPONENT",
        help="components that are not started here: prints the command that steps each",
    )
    federation.add_argument("names", nargs="*", metavar="NAME", help="variants (default: all)")
    federate = commands.add_parser(
        "federate",
        help="step one component in a federation of another machine",
        description="Steps one component of a system until the federation has come to the end.",
    )
    federate.add_argument("ssp", type=Path, metavar="SSP", help="the system")
    federate.add_argument("variant", metavar="VARIANT")
    federate.add_argument("component", metavar="COMPONENT")
    federate.add_argument(
        "--broker", required=True, metavar="ADDRESS", help="of the federation, as --listen there"
    )


def _add_fmi(parser: argparse._ActionsContainer, default: str | None, text: str) -> None:
    parser.add_argument("--fmi", type=_version, metavar="{2,3}", default=default, help=text)


def _version(text: str) -> str:
    """Version of FMI from its first digit or in full."""
    for version in VERSIONS:
        if text in (version, version[0]):
            return version
    known = " or ".join(version[0] for version in VERSIONS)
    raise argparse.ArgumentTypeError(f"expected {known}, got {text!r}")


def _add_report(parser: argparse.ArgumentParser, folder: Path) -> None:
    parser.add_argument(
        "--report",
        type=Path,
        metavar="DIR",
        default=folder,
        help=f"folder for pictures and results (default: {folder.relative_to(project.ROOT)})",
    )


def _tolerance(text: str) -> float:
    try:
        tolerance = float(text)
    except ValueError:
        tolerance = 0.0
    if not 0 < tolerance < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return tolerance


if __name__ == "__main__":
    sys.exit(_as_program())
