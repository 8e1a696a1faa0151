"""The commands, and which one arguments ask for; the options of each are in its module."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import NoReturn

from rparm import project
from rparm.command_line.options import add_common
from rparm.errors import UserError, did_you_mean
from rparm.project import PROGRAM

DEFAULT = "run"  # what names and options without a command are for

COMMANDS = {
    "run": "simulate scenarios, check them, write a report; the default",
    "new": "write a scenario to start from",
    "build": "make FMUs of a file with equations",
    "new-model": "write a file with equations to start from",
    "list": "name the scenarios",
    "system": "run systems in Ecos, check them, write a report",
    "coupling": "study how far co-simulation of a system is from its exact solution",
    "linearize": "find an equilibrium, a linear model, margins, the largest step",
    "identify": "find parameters that fit logs of a machine",
    "campaign": "run a scenario or a system many times, over parameters",
    "federation": "run a system with each FMU in its own process, coupled by HELICS",
    "federate": "step one component in a federation of another machine",
    "prove": "bound the errors of runs and references by theorem",
    "playground": "say where the page with the plant is, for a browser",
    "fmu": "copy an FMU, for another tool",
    "completion": "print what makes a shell complete these commands",
}
# the extra of the distribution that has what a command needs
NEEDS = {
    "system": "system",
    "coupling": "system",
    "identify": "control",
    "campaign": "campaign",
    "linearize": "control",
    "federation": "federation",
    "federate": "federation",
}
COMMON = ("--json", "--quiet")
HELP = ("help", "--help", "-h")
VERSION = "--version"

NO_READER = 141  # 128 + SIGPIPE, which not every system has
EXIT_CODES = (
    "exit codes: 0 all well, 1 a result is bad, 2 wrong use or failure, 130 Ctrl-C,\n"
    f"{NO_READER} whoever read the output has left, as head does"
)
EPILOG = f"""With --json, standard output has one JSON document and nothing else. "exit_code" is in
it, and "error" with the message if there is one. A command that is interrupted prints none.
{EXIT_CODES}."""


@dataclass(frozen=True)
class Ended:
    """How a command has ended."""

    code: int  # to exit with
    verdict: str  # the last line
    document: Mapping[str, object] = field(default_factory=dict)  # for programs
    error: UserError | None = None
    page: Path | None = None  # that --open shows


class Answered(Exception):
    """Help or the version was asked for, and no command is to run; `text` has it."""

    def __init__(self, name: str, text: str) -> None:
        super().__init__(text)
        self.name, self.text = name, text.rstrip("\n")


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
            "  --json        print one JSON document, and all else on standard error",
            "  --quiet       print the last line only, and what is wrong",
            "  --output DIR  write into this folder",
            "  --open        then show what was written in a browser",
            "",
            f"{PROGRAM} {VERSION} prints the version.",
            EXIT_CODES,
        ]
    )


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Options of the command that `arguments` ask for; `command` is its name.

    Names and options without a command are those of `run`. Only the module of the command is
    imported, because some take long.

    UserError if something in them is wrong. Raises Answered if no command is to run.
    """
    first, *rest = arguments
    while first in COMMON and rest:  # may stand in front of the command
        first, *rest = [*rest, first]
    if first == VERSION:
        raise Answered("version", project.version())
    if first in HELP:
        raise Answered("help", _help([name for name in rest if name not in COMMON]))
    if first == "--list":
        first = "list"
    if first not in COMMANDS:
        first, rest = DEFAULT, [first, *rest]
    options = parser(first).parse_args(rest)
    options.command = first
    return options


def _help(names: Sequence[str]) -> str:
    """Help on the first of `names`, or on everything if there are none."""
    if not names:
        return overview()
    if names[0] not in COMMANDS:
        guess = did_you_mean(names[0], COMMANDS)
        raise UserError(f"no command {names[0]!r}{guess} ({PROGRAM} help names them)")
    return parser(names[0]).format_help()


def parser(command: str) -> argparse.ArgumentParser:
    """What takes the options of a command."""
    module = import_module(f"rparm.commands.{command.replace('-', '_')}")
    made = _Parser(
        prog=f"{PROGRAM} {command}",
        description=module.DESCRIPTION,
        epilog=EPILOG,
        allow_abbrev=False,  # --json is looked for before anything is parsed
    )
    module.add_options(made)
    add_common(made)
    return made


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """One line, like every other mistake of the user."""
        raise UserError(f"{message} (--help explains)")

    def print_help(self, file: object = None) -> NoReturn:
        """Leave it to whoever prints."""
        raise Answered("help", self.format_help())

    def parse_args(self, *arguments, **keywords) -> argparse.Namespace:
        """Propose the closest option for an unknown one."""
        options, rest = self.parse_known_args(*arguments, **keywords)
        if rest:
            guess = did_you_mean(rest[0].partition("=")[0], self._option_string_actions)
            self.error(f"unrecognized arguments: {' '.join(rest)}{guess}")
        return options
