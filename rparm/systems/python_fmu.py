"""Packs a component in Python as an FMU of FMI 2.0, by pythonfmu.

The FMU has the component's file, the modules beside it that this imports, and a class of pythonfmu
that calls it. It needs a Python where it runs, with the packages that its description names.
"""

import json
import keyword
import shutil
import subprocess
import sys
from collections.abc import Mapping
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

from rparm import project
from rparm.errors import UserError
from rparm.interruption import temporary_folder
from rparm.systems.python_component import ANY, PythonComponent

CALLER = "python_fmu_caller.py.in"  # beside this file; CLASS stands for the name


def pack(name: str, component: PythonComponent, fixed: Mapping[str, Any], path: Path) -> str:
    """Write the FMU of a component, and return what it needs to run.

    Attributes that an FMU does not have as parameters, such as arrays, get the values in `fixed`.
    UserError if pythonfmu is missing or fails.
    """
    project.check_installed(["pythonfmu"], "system")
    beside, packages = imported(component.path)
    needed = f"Python {sys.version_info.major}.{sys.version_info.minor}"
    needed += f" with {', '.join(packages)}" if packages else ""
    variables = component.model.variables.values()
    own = {v.name: v for v in variables if v.type != ANY}
    of = {
        kind: {name: v.type for name, v in own.items() if v.causality == kind}
        for kind in ("input", "output", "parameter")
    }
    given = {
        "description": f"{component.path.name}, in Python: needs {needed}",
        "file": component.path.name,
        "target": component.target,
        "inputs": of["input"],
        "outputs": of["output"],
        "parameters": of["parameter"],
        "units": {name: v.unit for name, v in own.items() if v.unit},
        "fixed": fixed,
    }
    class_name = name.replace(".", "_") + "_" * keyword.iskeyword(name)
    with temporary_folder() as folder:
        caller, data = folder / f"{class_name}_caller.py", folder / f"{class_name}.json"
        text = Path(__file__).with_name(CALLER).read_text(encoding="utf-8")
        caller.write_text(text.replace("CLASS", class_name), encoding="utf-8", newline="\n")
        data.write_text(json.dumps(given), encoding="utf-8", newline="\n")
        files = [data, component.path.absolute(), *beside]
        command = [sys.executable, "-m", "pythonfmu", "build", "-f", caller, "-d", folder, *files]
        process = subprocess.run(
            command, check=False, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=folder
        )
        if process.returncode != 0:
            *_, last = process.stdout.decode(errors="replace").strip().splitlines() or [""]
            raise UserError(f"{component.path}: pythonfmu fails: {last}")
        shutil.copyfile(folder / f"{class_name}.fmu", path)
    return needed


def imported(path: Path) -> tuple[list[Path], list[str]]:
    """Return modules and packages beside a file that it imports, and the names of others."""
    folder = path.absolute().parent
    finder = ModuleFinder([str(folder)])
    finder.run_script(str(path))
    found = {module.partition(".")[0] for module in finder.modules}.difference({"__main__"})
    places = [
        folder / name if (folder / name).is_dir() else folder / f"{name}.py" for name in found
    ]
    others = (
        {name.partition(".")[0] for name in finder.badmodules} - sys.stdlib_module_names - found
    )
    return sorted(filter(Path.exists, places)), sorted(others)
