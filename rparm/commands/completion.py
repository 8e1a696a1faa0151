"""`completion`: what makes a shell complete commands, options, names and files."""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import shtab

from rparm import command_line, project
from rparm.command_line import COMMANDS, Ended
from rparm.files import write_text, written
from rparm.systems import comparison

SCRIPT = Path(project.PROGRAM).name
# names of files that the shells look for
SHELLS = {"bash": SCRIPT, "zsh": f"_{SCRIPT}", "tcsh": f"{SCRIPT}.tcsh"}


def do_completion(options: argparse.Namespace) -> Ended:
    """Print the script, with the names of all scenarios and systems."""
    script = shtab.complete(_all_commands(), options.shell)
    if options.output is None:
        return Ended(0, script, {"script": script})
    file = options.output / SHELLS[options.shell]
    with written(file):
        write_text(file, f"{script}\n")
    return Ended(0, f"{file}: written", {"script": script, "file": file.absolute()})


def _all_commands() -> argparse.ArgumentParser:
    """Return one parser that knows the options of all commands."""
    whole = argparse.ArgumentParser(prog=SCRIPT)
    commands = whole.add_subparsers()
    known = _values()
    for name, command in COMMANDS.items():
        made = command_line.parser(name)
        for action in made._actions:
            value = known.get(f"{name} {action.metavar}") or known.get(str(action.metavar))
            if value:
                action.complete = value
        commands.add_parser(name, parents=[made], add_help=False, help=command.text)
    commands.add_parser("help", help="explain a command").add_argument(
        "name", choices=list(COMMANDS)
    )
    return whole


def _values() -> dict[str, dict[str, Any]]:
    """Map each value, by its name in help after the name of its command, to its completion."""
    variants = {
        name: comparison.reference_names(folder) for name, folder in project.systems().items()
    }
    all_variants = [variant for names in variants.values() for variant in names]
    models = _words("models", project.models())
    return {
        "DIR": shtab.DIRECTORY,
        "PATH": shtab.FILE,
        "PEM": shtab.FILE,
        "SSP": shtab.glob("*.ssp"),
        "FILE.toml": shtab.glob("*.toml"),
        "{2,3}": _words("versions", [version[0] for version in project.VERSIONS]),
        "MODEL": models,
        "SCENARIO": _words("scenarios", project.scenario_files()),
        "VARIANT": _words("variants", all_variants),
        "campaign FILE.toml": _words("campaigns", project.campaign_files(), "*.toml"),
        "fmu NAME": models,
        "run NAME": _words("scenario_files", project.scenario_files(), "*.toml"),
        "system NAME": _words("systems", [*variants, *all_variants]),
        "federation NAME": _words("variants", all_variants),
    }


def _words(kind: str, names: Iterable[str], pattern: str = "") -> dict[str, Any]:
    """Complete one of `names`, or a file that is like `pattern`: in tcsh one of `names` only."""
    words, function = " ".join(names), f"_rparm_{kind}"
    bash, zsh = [f'compgen -W "{words}" -- "$1"'], f"_alternative '{kind}:{kind}:({words})'"
    before = ""
    if pattern:
        files = shtab.glob(pattern)
        before = files["preamble"]["bash"]
        bash.append(f'{files["bash"]} "$1"')
        zsh += f" 'files:file:_files -g \"{pattern}\"'"
    preamble = {"bash": before + _function(function, bash), "zsh": _function(function, [zsh])}
    return {"bash": function, "zsh": function, "tcsh": f"({words})", "preamble": preamble}


def _function(name: str, lines: Iterable[str]) -> str:
    return "\n".join([f"{name}() {{", *(f"  {line}" for line in lines), "}"])
