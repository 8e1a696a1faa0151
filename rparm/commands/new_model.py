"""`new-model`: writes a file with equations and comments, for a user to start from."""

import argparse
import re
import shlex
from pathlib import Path

from rparm import project
from rparm.command_line import Ended
from rparm.command_line.options import add_output
from rparm.errors import UserError
from rparm.files import check_for_windows, create, written

DESCRIPTION = (
    f"Writes NAME.toml, a model of one's own with comments: {project.PROGRAM} build NAME.toml "
    "makes FMUs of it."
)
NAME = re.compile("[A-Za-z][A-Za-z0-9_]*", re.ASCII)
TEXT = """\
# A body on a spring: change it to what you simulate. examples/models/README.md explains the file.
name = "{name}"
description = "Body on a spring"
experiment = {{ stop = 10.0, step = 0.01, tolerance = 1e-8 }}

[parameters]                    # may be changed while the model runs
mass = {{ start = 1.0, unit = "kg", min = 1e-6, description = "Mass of the body" }}
k = {{ start = 4.0, unit = "N/m", description = "Of the spring" }}
c = {{ start = 0.2, unit = "N.s/m", min = 0, description = "Of the damper" }}

[inputs]                        # set from outside, 0 at the start unless given
force = {{ unit = "N" }}

[states]                        # derivative: by the time; states are outputs
x = {{ start = 1.0, unit = "m", derivative = "v" }}
v = {{ unit = "m/s", derivative = "(force - spring - c * v) / mass" }}

[where]                         # results that others use, in any order
spring = "k * x"

[outputs]
energy = {{ value = "(mass * v**2 + spring * x) / 2", unit = "J" }}

[check]                         # of parameters; the text is the message if it does not hold
"a body with neither spring nor damper drifts away" = "k > 0 or c > 0"
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="of the FMU: letters, digits and _")
    add_output(parser, "folder for the file (default: the current one)")


def run(options: argparse.Namespace) -> Ended:
    if not NAME.fullmatch(options.name):
        raise UserError(
            f"{options.name!r} is no name for a model: a letter, then letters, digits, _"
        )
    check_for_windows(options.name)
    path = (options.output or Path()) / f"{options.name}.toml"
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    create(path, TEXT.format(name=options.name))
    verdict = f"{path}: written; {project.PROGRAM} build {shlex.quote(str(path))} makes FMUs of it"
    return Ended(0, verdict, {"file": path.absolute()}, page=path.absolute())
