"""Options of the command line: a parser for each command."""

import argparse
import math
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from cosim import project
from cosim.errors import UserError
from cosim.federation import SILENCE
from cosim.model import VERSIONS


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, like every other mistake of the user."""
        raise UserError(f"{message} (--help explains)")


def make_parser() -> argparse.ArgumentParser:
    """The whole command line, as `main` reads it."""
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
    run.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="scenarios, or files FILE.toml of your own (default: all scenarios)",
    )
    run.add_argument(
        "--fmu",
        type=Path,
        metavar="PATH",
        help="the FMU, for the scenarios of its model (default: that of each model, in build/)",
    )
    _add_fmi(run, None, "run only FMUs of this version of FMI")
    _add_report(run)
    _add_open(run)
    run.add_argument(
        "--tolerance",
        type=_tolerance,
        metavar="X",
        help="run at this relative tolerance only, without the sweep",
    )
    new = commands.add_parser(
        "new",
        help="write a scenario to start from",
        description="Writes NAME.toml, a scenario with comments that runs as it is: "
        "./run.sh NAME.toml. Exit code: 0 written, 2 the file exists or cannot be written.",
    )
    new.add_argument("name", metavar="NAME", help="name of the scenario, or path of its file")
    new.add_argument(
        "--model",
        metavar="MODEL",
        help="what to simulate (default: the model with the most scenarios)",
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
    _add_report(system)
    _add_open(system)
    system.add_argument(
        "--pictures",
        type=Path,
        metavar="DIR",
        help="draw each variant into a picture in this folder, too",
    )
    system.add_argument("--list", action="store_true", help="name the systems and their variants")
    coupling = commands.add_parser(
        "coupling",
        parents=[system_options],
        help="study how far co-simulation of a system is from its exact solution",
        description="Steps the system in several orders, with inputs held and extrapolated and "
        "with step-size control, and compares it with the solution in continuous time. Exit code: "
        "0 as expected, 1 not, 2 wrong use.",
    )
    _add_report(coupling, "system")
    _add_campaign(commands)
    _add_federation(commands)
    return parser


def _add_campaign(commands: argparse._SubParsersAction) -> None:
    campaign = commands.add_parser(
        "campaign",
        help="run a scenario or a system many times, over parameters",
        description="Runs what is missing of a campaign, on a cluster of Dask, and writes tables "
        "and a page. A campaign that was stopped goes on. Exit code: 0 all runs are there, "
        "1 the run of --replay fails, 2 wrong use or stopped.",
    )
    campaign.add_argument("file", type=Path, metavar="FILE.toml", help="the campaign")
    campaign.add_argument(
        "--fmu", type=Path, metavar="PATH", help="the FMU or SSP (default: that in build/)"
    )
    campaign.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for the results (default: that in the file, or in build/campaigns/)",
    )
    campaign.add_argument(
        "--replay",
        type=_number,
        metavar="N",
        help="run only run N again; writes all its Real outputs and a page",
    )
    where = campaign.add_mutually_exclusive_group()
    where.add_argument("--scheduler", metavar="ADDRESS", help="a scheduler that runs elsewhere")
    where.add_argument(
        "--workers", type=_count, metavar="N", help="processes on this machine (default: a core)"
    )


def _number(text: str) -> int:
    if not text.isdecimal() or len(text) > 12:
        raise argparse.ArgumentTypeError(f"expected the number of a run, got {text!r}")
    return int(text)


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 10_000:
        raise argparse.ArgumentTypeError(f"expected a number from 1 to 10000, got {text!r}")
    return int(text)


def _seconds(text: str) -> float:
    with suppress(ValueError):
        if 1 <= float(text) < math.inf:
            return float(text)
    raise argparse.ArgumentTypeError(f"expected a number of seconds, 1 or more, got {text!r}")


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
        help="components that are not started here, in one variant: prints the command for each",
    )
    _add_silence(federation, "processes that do not answer for so long end the federation")
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
    _add_silence(federate, "most that a call of the FMU may take, or the broker be silent")
    # for processes that a federation starts: they end with their standard input
    federate.add_argument("--owned", action="store_true", help=argparse.SUPPRESS)


def _add_silence(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument(
        "--silence", type=_seconds, metavar="S", default=SILENCE, help=f"{text} (default: 60 s)"
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


def _add_report(parser: argparse.ArgumentParser, part: str = "") -> None:
    folder = project.report_folder(part)
    parser.add_argument(
        "--report",
        type=Path,
        metavar="DIR",
        default=folder,
        help=f"folder for pages and results (default: {folder.relative_to(project.ROOT)})",
    )


def _add_open(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--open", action="store_true", help="then open the report in a browser")


def _tolerance(text: str) -> float:
    try:
        tolerance = float(text)
    except ValueError:
        tolerance = 0.0
    if not 0 < tolerance < 1:
        raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")
    return tolerance
