"""`new`, `new-system`, `ssp`, `schema`, `fmu`, `list`, ...: files."""

import argparse
import json
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from zipfile import ZipFile

from rparm import console, project, schemas
from rparm.building import EQUATIONS
from rparm.command_line import Ended
from rparm.commands.equations import SUFFIX, own_file
from rparm.errors import UserError, closest, placed
from rparm.files import NAME, check_for_windows, copied, create, from_folder, read_toml, written
from rparm.fmi.model import INPUTS, Model, Value, Variable
from rparm.interruption import temporary_folder
from rparm.project import START
from rparm.runs import scenario
from rparm.systems.structure import times
from rparm.units import NONE

TOOLS = project.page("docs/use-in-your-tool.md")
TUTORIAL = "docs/tutorial.md"


def do_new(options: argparse.Namespace) -> Ended:
    path = _scenario_path(options.name)
    if options.output:
        path = options.output / path
    if Path(options.model or "").suffix.lower() in (".fmu", EQUATIONS):
        subject = Path(options.model)
        key, name = "fmu", from_folder(subject, path.parent)
    else:
        subject = project.model(options.model) if options.model else _usual_model()
        key, name = "model", subject.name
    begin = read_toml(subject / START) if (subject / START).is_file() else {}
    text = scenario.template(path.stem, key, name, _declared(subject), begin)
    if options.output:
        with written(path):
            options.output.mkdir(parents=True, exist_ok=True)
    create(path, text)
    verdict = f"{path}: written; run it by {project.PROGRAM} {shlex.quote(str(path))}"
    return Ended(0, verdict, {"file": path.absolute(), "model": name}, page=path)


def _declared(subject: Path) -> Model:
    """Read the description of a file, or of a model of the project, which need not be built."""
    from rparm.fmi.fmu_file import describe, read_model  # takes long

    file = subject / f"{subject.name}{EQUATIONS}"
    try:
        return read_model(project.fmu_of(subject))
    except UserError:
        if not file.is_file():
            raise
    with temporary_folder() as folder:
        program = [sys.executable, project.model_builder().with_name("generate.py")]
        subprocess.run([*program, file, "--output", folder], check=True, capture_output=True)
        with ZipFile(folder / "described.fmu", "w") as archive:
            archive.write(folder / "modelDescription.xml", "modelDescription.xml")
        return describe(folder / "described.fmu").model


def _scenario_path(name: str) -> Path:
    """Return the file for a name, with or without suffix; UserError for an impossible one."""
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
    """Return the folder of the model that has the most scenarios."""
    folders = list(project.models().values())
    if not folders:
        raise UserError(f"{project.models_folder()}: has no scenarios")
    return max(folders, key=lambda folder: len(list(folder.glob("scenarios/*.toml"))))


def do_new_system(options: argparse.Namespace) -> Ended:
    path = own_file(options, "system")
    found = _components(options.fmus, path.parent)
    text = _system_file(path.stem, found)
    with written(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    create(path, text)
    verdict = f"{path}: written; run it by {project.PROGRAM} system {shlex.quote(str(path))}"
    return Ended(0, verdict, {"file": path.absolute(), "components": list(found)}, page=path)


def _components(given: Sequence[str], folder: Path) -> dict[str, tuple[str, Model]]:
    """Return the source of each component, as a file in `folder` names it, and its description."""
    found: dict[str, tuple[str, Model]] = {}
    for text in given:
        path = Path(text)
        if path.suffix.lower() in (".fmu", EQUATIONS):
            model, source, stem = _declared(path), from_folder(path, folder), path.stem
        else:
            model = _declared(project.model(text))
            source = stem = model.name
        first = re.sub(r"\W", "_", stem, flags=re.ASCII)
        first = first if NAME.match(first) else f"c_{first}"
        names = (first if n == 1 else f"{first}{n}" for n in count(1))
        name = next(name for name in names if name not in found)
        found[name] = source, model
    return found


def _system_file(name: str, components: Mapping[str, tuple[str, Model]]) -> str:
    """Write a system without connections, with guesses of them as comments."""
    from rparm.texts import rendered  # takes long

    models = {name: model for name, (_, model) in components.items()}
    ends = any((model.experiment.stop or 0.0) > 0 for model in models.values())
    with placed("default experiments"):
        _, stop, step, _ = times(0.0, None if ends else scenario.USUAL_STOP, None, models)
    guesses: list[tuple[str, str, str]] = []
    inputs: list[tuple[str, Value, str]] = []
    for component, (_, model) in components.items():
        for variable in (x for x in model.variables.values() if x.is_a(INPUTS)):
            end, unit = f"{component}.{variable.name}", " ".join((variable.unit or "").split())
            feeding = _feeding(component, variable, components)
            nothing = False if variable.type == "Boolean" else 0.0
            start = nothing if variable.start is None else variable.written(variable.start)
            inputs += [] if feeding else [(end, start, unit)]
            guesses += [(end, output, unit) for output in feeding]
    return rendered(
        "new_system.toml", program=project.PROGRAM, name=name, step=step, stop=stop,
        components=components, guesses=guesses, inputs=inputs,
    )  # fmt: skip


def _feeding(
    component: str, variable: Variable, components: Mapping[str, tuple[str, Model]]
) -> list[str]:
    """Return outputs of its type and name, of its unit or none; else the most similar of its unit.

    The unit "1" and none are the same.
    """
    outputs = {
        f"{other}.{output.name}": output
        for other, (_, model) in components.items()
        for output in model.variables.values()
        if other != component and output.causality == "output" and output.type == variable.type
    }
    alike = {
        name: x.name
        for name, x in outputs.items()
        if x.unit == variable.unit or {x.unit, variable.unit} <= {*NONE}
    }
    same = [
        name
        for name, x in outputs.items()
        if x.name == variable.name and (name in alike or not (x.unit and variable.unit))
    ]
    similar = closest(variable.name, alike.values())
    return same or [name for name, own in alike.items() if own == similar][:1]


def do_schema(options: argparse.Namespace) -> Ended:
    text = schemas.text(options.kind)
    if options.output is None:
        return Ended(0, text.rstrip(), {"schema": json.loads(text)})
    file = schemas.write(options.output / f"{options.kind}.schema.json", text)
    return Ended(0, f"{file}: written", {"file": file.absolute()}, page=file)


def do_ssp(options: argparse.Namespace) -> Ended:
    from rparm.systems import loop_file, ssp_writer  # take long

    if options.file.suffix.lower() != SUFFIX:
        raise UserError(f"{options.file}: expected a loop file {SUFFIX}")
    with loop_file.opened(options.file, version=options.fmi) as opened:
        path, name = options.output, f"{opened.system.name}.ssp"
        path = path if path.suffix.lower() == ".ssp" else path / name
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            needed = ssp_writer.write(path, opened)
        system, inputs = opened.system, list(opened.system.inputs)
    unread = "inputs of the system, which Ecos and libcosim do not load"
    notes = [f"{unread}: {', '.join(inputs)}"] if inputs else []
    if system.order != "jacobi":
        notes.append(f"order {system.order}: an annotation that only rparm reads")
    if system.rates:
        rates = f"rates of {', '.join(system.rates)}"
        notes.append(f"{rates}: annotations of OSP, since SSP has no rates")
    console.messages(str(path), [*opened.notes, *notes])
    document = {"file": path.absolute(), "inputs": inputs, "needs": needed}
    lacks = [f"how {', '.join(inputs)} move{'s' * (len(inputs) == 1)}"] if inputs else []
    lacks += [f"{what}, which {component} needs" for component, what in needed.items()]
    written_as = f"{path}: written" + (f" without {', and without '.join(lacks)}" if lacks else "")
    verdict = f"{written_as}; run it by {project.PROGRAM} system {shlex.quote(str(path))}"
    return Ended(0, verdict, document, page=path)


def do_fmu(options: argparse.Namespace) -> Ended:
    """Copy the FMU; a file that has its name is replaced."""
    file = project.built(project.model(options.name), ".fmu", version=options.fmi)
    path = copied(file, (options.output or Path()) / file.name)
    verdict = f"{path}: FMI {options.fmi}, {path.stat().st_size} bytes; to import it: {TOOLS}"
    return Ended(0, verdict, {"file": path.absolute(), "fmi_version": options.fmi})


def do_list(_: argparse.Namespace) -> Ended:
    files = project.scenario_files()
    found = [
        {"name": name, "title": scenario.title(path), "model": project.model_folder(path).name}
        for name, path in files.items()
    ]
    return Ended(0, console.titles(found), {"scenarios": found})


def do_playground(options: argparse.Namespace) -> Ended:
    page = project.playground_page()
    if options.output:
        page = copied(page, options.output / "playground.html")
    return Ended(0, "", {"page": page.absolute()}, page=page)
