"""The command line: which command arguments ask for, and options that commands share."""

import argparse
import re
import shlex
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from rparm import needs, project
from rparm.errors import UserError, WrongValueError, did_you_mean
from rparm.needs import COMMANDS, COMMON, DEFAULT, EXIT_CODES, HELP, SHARED, VERSION
from rparm.project import PROGRAM, VERSIONS

SHORTEST = 1e-9  # s, of steps
EPILOG = f"""With --json, standard output has one JSON document and nothing else. "exit_code" is in
it, and "error" with the message if there is one. A command that is interrupted prints none.
{EXIT_CODES}."""


@dataclass(frozen=True)
class Ended:
    """End of a command."""

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
    """Return the help on everything: the commands in a line each."""
    return needs.overview(PROGRAM)


def function(command: str, form: str) -> Any:
    """Return the function of a command that is named in this form, as "do_{}"."""
    module = import_module(f"rparm.commands.{COMMANDS[command].module}")
    return getattr(module, form.format(command.replace("-", "_")))


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the command's options, and its name as `command`; raise Answered if none is to run.

    Names and options without a command are for `run`. UserError if something in them is wrong.
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
    """Return the help on the first of `names`, or on everything if there are none."""
    if not names:
        return overview()
    if names[0] not in COMMANDS:
        guess = did_you_mean(names[0], COMMANDS)
        raise UserError(f"no command {names[0]!r}{guess} ({PROGRAM} help names them)")
    return parser(names[0]).format_help()


def parser(command: str) -> argparse.ArgumentParser:
    """Return the parser of a command's options, as commands.toml declares them."""
    known, part = COMMANDS[command], COMMANDS[command].options.get("--output", {}).get("part", "")
    words = {
        "program": PROGRAM, "pages": f"{project.page('x')}"[:-1],
        "report": project.from_root(project.report_folder(part)),
        "campaigns": project.from_root(project.campaign_folder("NAME")),
    }  # fmt: skip
    about = " ".join(known.description.format(**words).split())
    # no abbreviations: --json is looked for before anything is parsed
    texts = {"description": about, "epilog": EPILOG}
    made = _Parser(prog=f"{PROGRAM} {command}", allow_abbrev=False, **texts)
    groups = defaultdict[str, argparse._ActionsContainer](made.add_mutually_exclusive_group)
    groups[""] = made
    options = {**known.options, **SHARED["common"], **(SHARED["builds"] if known.builds else {})}
    for names, given in options.items():
        if isinstance(given, str):
            given = {"action": "store_true", "help": given}
        own = SHARED["like"].get(given.get("like"), {}) | given
        if "help" in own:
            own["help"] = own["help"].format(**words) or argparse.SUPPRESS
        group = groups[own.pop("group", "")]
        if "part" in own:
            own |= {"default": project.report_folder(own.pop("part"))}
            hidden = {"dest": "report", "type": Path, "help": argparse.SUPPRESS}
            made.add_argument("--report", default=own["default"], **hidden)  # its old name
        if "type" in own:
            own["type"] = TYPES[own["type"]]
        own.pop("like", None)
        group.add_argument(*names.split(), **own)
    return made


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Refuse in one line, like every other mistake of the user."""
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


def number(text: str) -> int:
    """Parse the number of a run, from 0."""
    if not text.isdecimal() or len(text) > 12:
        raise argparse.ArgumentTypeError(f"expected the number of a run, got {text!r}")
    return int(text)


def count(text: str) -> int:
    """Parse a count, from 1."""
    if not text.isdecimal() or not 1 <= int(text) <= 10_000:
        raise argparse.ArgumentTypeError(f"expected a number from 1 to 10000, got {text!r}")
    return int(text)


def pairs(option: str, given: Sequence[str]) -> dict[str, str]:
    """Split "NAME=VALUE"; UserError if a text has another form or a name comes twice."""
    found: dict[str, str] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise UserError(f"{option}: expected NAME=VALUE, got {text!r}")
        if name in found:
            raise UserError(f"{option}: {name} is given twice")
        found[name] = value
    return found


def names(given: Sequence[str]) -> list[str]:
    """Split names between commas, but those of indexes as in T[1,2], or given one by one."""
    every = (name.strip() for text in given for name in re.split(r",(?![^\[]*\])", text))
    return [name for name in every if name]


def retyped(command: str, positional: Iterable[object], given: Mapping[str, object]) -> str:
    """Write a command as it is typed again in the project's folder; without options not given."""
    parts = [project.PROGRAM, command, *map(_typed, positional)]
    for name, value in given.items():
        if value is True:
            parts.append(f"--{name}")
        elif value is not None and value is not False and value != "" and value != []:
            values = value if isinstance(value, list) else [value]
            parts += [f"--{name}", *map(_typed, values)]
    return shlex.join(parts)


def file_or_name(given: str, suffixes: Iterable[str]) -> str | Path:
    """Return a path, or a name of the project, for `retyped`."""
    return Path(given) if Path(given).suffix.lower() in suffixes else given


def _typed(value: object) -> str:
    if isinstance(value, float):
        return repr(value).replace("e-0", "e-")
    return str(project.from_root(value) if isinstance(value, Path) else value)


def relative_tolerance(text: str) -> float:
    with suppress(ValueError):
        if 0 < float(text) < 1:
            return float(text)
    raise argparse.ArgumentTypeError(f"expected a number between 0 and 1, got {text!r}")


def seconds(text: str) -> float:
    from rparm.units import SECONDS, typed_quantity  # takes long

    try:
        return typed_quantity(text, SECONDS)
    except WrongValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def positive_seconds(text: str) -> float:
    found = seconds(text)
    if found < SHORTEST:
        raise argparse.ArgumentTypeError(f"expected {SHORTEST:g} s or more, got {text!r}")
    return found


def _silence(text: str) -> float:
    with suppress(argparse.ArgumentTypeError):
        found = seconds(text)
        if found >= 1:
            return found
    form = "a number, or one with s, ms, cs or ks"
    raise argparse.ArgumentTypeError(f"expected 1 s or more: {form}, got {text!r}")


def _version(text: str) -> str:
    version = project.fmi_version(text)
    if version is not None:
        return version
    known = " or ".join(version[0] for version in VERSIONS)
    raise argparse.ArgumentTypeError(f"expected {known}, got {text!r}")


TYPES = {
    "path": Path, "number": number, "count": count, "seconds": seconds, "version": _version,
    "positive_seconds": positive_seconds, "relative_tolerance": relative_tolerance,
    "silence": _silence,
}  # fmt: skip
