"""Makes references of a model's scenarios or a system's variants, without the code they check.

    build/venv/bin/python models/make_references.py MODEL [NAME ...]

MODEL/references/make_references.py calculates them. The module of a model gives INPUTS (and
OPTIONAL_INPUTS, written if the scenario has them) and outputs(scenario), columns by name at all
communication points; the module of a system gives names() and files(name). Scenarios are checked
against the built FMU, and start values are those that it declares.
"""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parent))

from rparm import project
from rparm.errors import UserError
from rparm.fmi.fmu_file import read_model
from rparm.fmi.model import Model
from rparm.models import reference_files
from rparm.runs import scenario as scenarios

Make = Callable[[Path], str]  # writes to a folder, tells how much


def make_scenario(module: ModuleType, path: Path, model: Model, folder: Path) -> str:
    """Write the reference of a scenario."""
    scenario = scenarios.load(path, model)
    optional = [n for n in getattr(module, "OPTIONAL_INPUTS", ()) if n in scenario.inputs]
    inputs = (*module.INPUTS, *optional)
    outputs = module.outputs(scenario)
    reference_files.write_scenario(scenario, folder, model.name, inputs, outputs)
    return f"{len(scenario.reference_rows)} rows"


def make_exact_state(module: ModuleType, path: Path, model: Model, folder: Path) -> str:
    """Write the exact final state of a problem for the order of convergence."""
    scenario = scenarios.load(path, model)
    module.write_exact_state(scenario, folder)
    return f"{scenario.stop:g} s"


def make_variant(module: ModuleType, name: str, folder: Path) -> str:
    """Write the reference of a system's variant."""
    files = module.files(name)
    reference_files.write_variant(folder, files)
    return ", ".join(f"{file} {len(times)} rows" for file, (times, _) in files.items())


def known(folder: Path) -> dict[str, Make]:
    """Return all references of a model or system by name."""
    module = import_module(f"rparm.models.{folder.name}.references.make_references")
    if hasattr(module, "files"):
        return {name: partial(make_variant, module, name) for name in module.names()}
    model = read_model(project.built(folder, ".fmu"))
    made: dict[str, Make] = {
        name: partial(make_scenario, module, path, model)
        for name, path in project.scenario_files().items()
        if project.model_folder(path) == folder
    }
    return made | {
        path.stem: partial(make_exact_state, module, path, model)
        for path in project.convergence_files()
        if project.model_folder(path) == folder
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes references.")
    models = sorted(path.parents[1].name for path in FOLDER.glob("*/references/make_references.py"))
    parser.add_argument("model", metavar="MODEL", choices=models, help=", ".join(models))
    parser.add_argument("names", nargs="*", metavar="NAME", help="references (default: all)")
    parser.add_argument("--output", type=Path, metavar="DIR", help="write to DIR/NAME instead")
    arguments = parser.parse_args()
    folder = FOLDER / arguments.model
    try:
        makers = known(folder)
        for name in arguments.names:
            if name not in makers:
                raise UserError(f"no reference {name!r} (known: {', '.join(makers)})")
        for name in arguments.names or makers:
            print(f"{name}: {makers[name]((arguments.output or folder / 'references') / name)}")
    except UserError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
