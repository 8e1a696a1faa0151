"""The commands, and which one arguments ask for; the options of each are in its module."""

import argparse
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from rparm import project
from rparm.errors import UserError, did_you_mean
from rparm.options import add_common
from rparm.project import PROGRAM

DEFAULT = "run"  # what names and options without a command are for

COMMANDS = {
    "run": "simulate scenarios, check them, write a report; the default",
    "new": "write a scenario to start from",
    "list": "name the scenarios",
    "system": "run systems in Ecos, check them, write a report",
    "coupling": "study how far co-simulation of a system is from its exact solution",
    "campaign": "run a scenario or a system many times, over parameters",
    "federation": "run a system with each FMU in its own process, coupled by HELICS",
    "federate": "step one component in a federation of another machine",
    "playground": "say where the page with the plant is, for a browser",
}
# the extra of the distribution that has what a command needs
NEEDS = {
    "system": "system",
    "coupling": "system",
    "campaign": "campaign",
    "federation": "federation",
    "federate": "federation",
}
COMMON = ("--json", "--quiet")
HELP = ("help", "--help", "-h")
VERSION = "--version"

EPILOG = """With --json, standard output has one JSON document and nothing else. "exit_code" is in
it, and "error" with the message if there is one. A command that is interrupted prints none."""
EXIT_CODES = "exit codes: 0 all is well, 1 a result is bad, 2 wrong use or failure, 130 Ctrl-C"


def overview() -> str:
    """Help on everything: the commands in a line each."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {text}" for name, text in COMMANDS.items()]
    return "\n".join(
        [
            f"usage: {PROGRAM} [COMMAND] [OPTION ...]",
            f"       {PROGRAM} help COMMAND",
            "",
            "Simulates scenarios on co-simulation FMUs and checks them against references.",
            "",
            "commands:",
            *lines,
            "",
            "options of all commands:",
            "  --json   print one JSON document, and all else on standard error",
            "  --quiet  print the last line only, and what is wrong",
            "",
            f"{PROGRAM} {VERSION} prints the version.",
            EXIT_CODES,
        ]
    )


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Options of the command that `arguments` ask for; `command` is its name.

    Names and options without a command are those of `run`. Only the module of the command is
    imported, because some take long.

    UserError if something in them is wrong. SystemExit after help has been printed.
    """
    first, *rest = arguments
    while first in COMMON and rest:  # may stand in front of the command
        first, *rest = [*rest, first]
    if first == VERSION:
        print(project.version())
        raise SystemExit(0)
    if first in HELP:
        if not set(rest) - set(COMMON):
            print(overview())
            raise SystemExit(0)
        if rest[0] not in COMMANDS:
            guess = did_you_mean(rest[0], COMMANDS)
            raise UserError(f"no command {rest[0]!r}{guess} ({PROGRAM} help names them)")
        return _parser(rest[0]).parse_args(["--help"])
    if first == "--list":
        first = "list"
    if first not in COMMANDS:
        first, rest = DEFAULT, [first, *rest]
    options = _parser(first).parse_args(rest)
    options.command = first
    return options


def _parser(command: str) -> argparse.ArgumentParser:
    module = import_module(f"rparm.commands.{command}")
    parser = _Parser(prog=f"{PROGRAM} {command}", description=module.DESCRIPTION, epilog=EPILOG)
    module.add_options(parser)
    add_common(parser)
    return parser


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, like every other mistake of the user."""
        raise UserError(f"{message} (--help explains)")

    def parse_args(self, *arguments, **keywords) -> argparse.Namespace:
        """Propose the option that is meant by one that there is not."""
        options, rest = self.parse_known_args(*arguments, **keywords)
        if rest:
            guess = did_you_mean(rest[0].partition("=")[0], self._option_string_actions)
            self.error(f"unrecognized arguments: {' '.join(rest)}{guess}")
        return options
