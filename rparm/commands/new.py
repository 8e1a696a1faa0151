"""`new`: write a scenario with comments, for a user to start from."""

import argparse
import shlex
from pathlib import Path

from rparm import project
from rparm.command_line import Ended
from rparm.command_line.options import add_output
from rparm.errors import UserError
from rparm.files import check_for_windows, create, from_folder, written
from rparm.fmi.fmu_file import read_model
from rparm.runs import scenario

DESCRIPTION = (
    f"Writes NAME.toml, a scenario with comments that runs as it is: {project.PROGRAM} NAME.toml."
)
SUFFIX = ".toml"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="name of the scenario, or path of its file")
    parser.add_argument(
        "--model",
        metavar="MODEL",
        help="what to simulate, or a file .fmu (default: the model with the most scenarios)",
    )
    add_output(parser, "folder for the file (default: this one, or that of the path)")


def run(options: argparse.Namespace) -> Ended:
    path = _path(options.name)
    if options.output:
        path = options.output / path
    if Path(options.model or "").suffix.lower() == ".fmu":
        subject = Path(options.model)
        key, name = "fmu", from_folder(subject, path.parent)
    else:
        subject = project.model(options.model) if options.model else _usual_model()
        key, name = "model", subject.name
    model = read_model(project.fmu_of(subject))
    text = scenario.template(path.stem, key, name, model)
    if options.output:
        with written(path):
            options.output.mkdir(parents=True, exist_ok=True)
    create(path, text)
    verdict = f"{path}: written; run it by {project.PROGRAM} {shlex.quote(str(path))}"
    return Ended(0, verdict, {"file": path.absolute(), "model": name}, page=path)


def _path(name: str) -> Path:
    """File for a name, with or without its suffix; UserError for one that no file can have."""
    path = Path(name)
    if not path.name or not path.stem.strip() or name.endswith(("/", "\\")):
        raise UserError(f"{name!r} is no name for a scenario")
    if any(not character.isprintable() for character in name):
        raise UserError(f"{name!r}: a name has printable characters only")
    if path.name.startswith("-"):
        raise UserError(f"{name!r}: a name begins with no hyphen, it would be an option")
    check_for_windows(path.name)
    return path if path.suffix.lower() == SUFFIX else path.with_name(path.name + SUFFIX)


def _usual_model() -> Path:
    """Folder of the model that has the most scenarios."""
    folders = list(project.models().values())
    if not folders:
        raise UserError(f"{project.models_folder()}: has no scenarios")
    return max(folders, key=lambda folder: len(list(folder.glob("scenarios/*.toml"))))
