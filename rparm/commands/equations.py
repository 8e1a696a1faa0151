"""`build`, `estimator` and `new-model`: files with equations, and those from which they follow."""

import argparse
import re
import shlex
from importlib.util import find_spec
from pathlib import Path

from rparm import project
from rparm.building import ESTIMATOR, NEEDED, build
from rparm.command_line import Ended
from rparm.errors import UserError
from rparm.files import NAME, check_for_windows, create, read_toml, written

SUFFIX = ".toml"
COMMA = re.compile(r",(?![^[(]*[])])")  # none within brackets


def own_file(options: argparse.Namespace, kind: str) -> Path:
    """Return the file for a new model or system; UserError for an impossible name."""
    if not NAME.fullmatch(options.name):
        wrong = f"{options.name!r} is no name for a {kind}"
        raise UserError(f"{wrong}: a letter, then letters, digits, _")
    check_for_windows(options.name)
    return (options.output or Path()) / f"{options.name}{SUFFIX}"


def do_new_model(options: argparse.Namespace) -> Ended:
    from rparm import schemas  # take long
    from rparm.texts import rendered

    path = own_file(options, "model")
    of_schema = path.with_name("model.schema.json")
    # the packages that make it come with the compiler of `build`: without them there is none
    text = schemas.text("model") if all(map(find_spec, NEEDED)) else ""
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    first = f"#:schema ./{of_schema.name}\n" if text else ""
    template = f"new_model_{options.kind}.toml" if options.kind else "new_model.toml"
    create(path, first + rendered(template, name=options.name))
    if text and not of_schema.exists():
        create(of_schema, text)
    verdict = f"{path}: written; {project.PROGRAM} build {shlex.quote(str(path))} makes FMUs of it"
    return Ended(0, verdict, {"file": path.absolute()}, page=path.absolute())


def do_estimator(options: argparse.Namespace) -> Ended:
    file, kept = options.file, options.toml
    given = read_toml(file)
    if ESTIMATOR not in given and "measure" in given:
        raise UserError(f"{file}: {ESTIMATOR} is missing: the plant's file")
    if ESTIMATOR not in given:
        wanted = f'expected one of an estimator, with {ESTIMATOR} = "plant.toml"'
        raise UserError(f"{file}: {wanted}; {project.PROGRAM} build takes a plant's")
    paths = build(file, output=options.output or Path(), platforms=options.platforms)
    document: dict[str, object] = {"fmus": [path.absolute() for path in paths]}
    if kept:
        from rparm.estimator.equations import write  # takes long

        if kept.suffix != SUFFIX or kept.exists() and kept.samefile(file):
            raise UserError(f"--toml: expected another file {SUFFIX}, got {kept}")
        with written(kept):
            write(file, kept)
        document["equations"] = kept.absolute()
    also = f"; {kept}: written" if kept else ""
    return Ended(0, f"{' and '.join(map(str, paths))}: built{also}", document)


def do_build(options: argparse.Namespace) -> Ended:
    to, where = options.output or Path(), {"platforms": options.platforms, "web": options.web}
    gradients = COMMA.split(options.gradients) if options.gradients else ()
    paths = build(options.file, output=to, gradients=[*map(str.strip, gradients)], **where)
    then = f"a scenario of it: {project.PROGRAM} new my_run --model {shlex.quote(str(paths[0]))}"
    then = f"drop one on the page: {project.PROGRAM} playground --open" if options.web else then
    verdict = f"{' and '.join(map(str, paths))}: built; {then}"
    return Ended(0, verdict, {"fmus": [path.absolute() for path in paths]})
