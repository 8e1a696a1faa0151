"""Which folder may include or import which: arrows between folders go one way.

A C file may include headers of its own folder, public headers of the folders below it, and the C
standard library. What else a folder may use is in the tables here, and in no other place.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import ROOT

# ---- The architecture ----------------------------------------------------------------------------

# folder, as a regular expression: folders whose public headers it includes
MAY_INCLUDE = {
    r"src/model": (),
    r"src/integrator": ("src/model",),
    r"src/instance": ("src/integrator", "src/model"),
    r"fmu": ("src/instance", "src/model"),
    r"fmu/fmi\d": ("fmu", "src/instance", "src/model"),
    r"models": ("src/model",),
    r"models/\w+(/equations)?": ("models", "src/model"),
}
# the equations of another model
MAY_INCLUDE_MODEL = {
    "models/rp_controller": "models/rp_manipulator",
    "models/rp_plant": "models/rp_manipulator",
    "models/rp_plant/equations": "models/rp_manipulator",
}

# libraries that hide headers; those of other folders are all public
PUBLIC_HEADERS = {
    "src/integrator": {"integrator.h", "ode.h"},
    "src/instance": {
        "continuous_states.h", "derivatives.h", "instance.h", "serialization.h", "snapshot.h",
        "stepping.h", "values.h", "variables.h",
    },
}  # fmt: skip

# headers that are not in the project: which, and the folders that include them
STANDARD = (
    r"(assert|ctype|errno|float|inttypes|limits|math|setjmp|signal|stdalign|stdarg|stdatomic|stdbool"
    r"|stddef|stdint|stdio|stdlib|string|time)\.h"
)
LIBRARIES = {
    "the C standard library": (STANDARD, r".*"),
    "POSIX": (r"sched\.h", r"src/model"),  # platform.h: another thread may run
    "SUNDIALS": (r"(arkode|cvode|nvector|sun\w+)/\w+\.h", r"src/integrator"),
    "FMI 2.0": (r"fmi2\w+\.h", r"fmu/fmi2"),
    "FMI 3.0": (r"fmi3\w+\.h", r"fmu/fmi3"),
}

# Python, by the first part of the path; tests import everything
MAY_IMPORT = {
    "cosim": {"cosim"},
    "fmu": {"fmu"},
    "models": {"models", "cosim"},
}

# ---- C: includes ---------------------------------------------------------------------------------

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def folder_of(path: Path, root: Path) -> str:
    return path.parent.relative_to(root).as_posix()


def c_files(root: Path) -> list[Path]:
    return sorted(path for top in ("src", "fmu", "models") for path in (root / top).rglob("*.[ch]"))


def find_header(name: str, source: Path, files: list[Path]) -> Path | None:
    """The project's header that `source` includes by this name; None: it is not one of them."""
    if source.parent / name in files:
        return source.parent / name
    found = [path for path in files if path.match(name)]
    assert len(found) < 2, f"{name} is the name of {len(found)} headers"
    return found[0] if found else None


def is_library_of(name: str, folder: str) -> bool:
    return any(
        re.fullmatch(headers, name) and re.fullmatch(folders, folder)
        for headers, folders in LIBRARIES.values()
    )


def is_allowed(header: Path, folder: str, root: Path) -> bool:
    """Whether files of this folder may include the header."""
    rules = [below for pattern, below in MAY_INCLUDE.items() if re.fullmatch(pattern, folder)]
    assert len(rules) == 1, f"{folder} has no place in the architecture"
    target = folder_of(header, root)
    if target in (folder, f"{folder}/equations", MAY_INCLUDE_MODEL.get(folder)):
        return True
    return target in rules[0] and header.name in PUBLIC_HEADERS.get(target, {header.name})


def includes(path: Path) -> list[str]:
    return [name for _, name in INCLUDE.findall(path.read_text())]


def wrong_includes(root: Path) -> Iterator[str]:
    files = c_files(root)
    for path in files:
        folder = folder_of(path, root)
        for name in includes(path):
            header = find_header(name, path, files)
            if header is None:
                fine = is_library_of(name, folder)
            else:
                fine = is_allowed(header, folder, root)
            if not fine:
                yield f"{path.relative_to(root)} includes {name}"


def include_circles(root: Path) -> Iterator[str]:
    """Circles of headers that include each other."""
    files = c_files(root)
    done: set[Path] = set()

    def visit(header: Path, way: list[Path]) -> Iterator[str]:
        if header in way:
            yield " -> ".join(path.name for path in [*way[way.index(header) :], header])
        elif header not in done:
            for name in includes(header):
                included = find_header(name, header, files)
                if included is not None:
                    yield from visit(included, [*way, header])
            done.add(header)

    for path in files:
        if path.suffix == ".h":
            yield from visit(path, [])


# ---- Python: imports -----------------------------------------------------------------------------


def imports(path: Path) -> Iterator[str]:
    """First parts of the names of the modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0]


def wrong_imports(root: Path) -> Iterator[str]:
    files = {top: sorted((root / top).rglob("*.py")) for top in MAY_IMPORT}
    # a module is imported by the name of its folder, or by its own where that folder is on the path
    names = {top: {top, *(path.stem for path in files[top])} for top in files}
    names["tests"] = {"tests"}
    for top, allowed in MAY_IMPORT.items():
        for path in files[top]:
            for name in imports(path):
                if name in sys.stdlib_module_names or path.with_name(f"{name}.py") in files[top]:
                    continue
                tops = {other for other in names if name in names[other]}
                if tops and not tops & allowed:
                    yield f"{path.relative_to(root)} imports {name}"


# ---- Tests ---------------------------------------------------------------------------------------


def test_includes_follow_the_architecture() -> None:
    assert list(wrong_includes(ROOT)) == []


def test_no_header_includes_itself_by_way_of_others() -> None:
    assert list(include_circles(ROOT)) == []


def test_imports_follow_the_architecture() -> None:
    assert list(wrong_imports(ROOT)) == []


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Headers and modules of every folder, with nothing in them."""
    for name in (
        "src/model/model.h", "src/integrator/ode.h", "src/integrator/method.h",
        "src/instance/instance.h", "src/instance/internals.h", "fmu/component.h",
        "fmu/fmi2/fmi2_calls.h", "fmu/fmi3/fmi3_calls.h", "models/taylor.h",
        "models/rp_manipulator/rp_manipulator.h", "models/rp_trajectory/motion.h",
        "models/rp_plant/rp_plant_model.h", "models/rp_plant/equations/rp_plant.h",
        "fmu/generate.py", "cosim/unit.py", "models/rp_plant/references/make.py",
    ):  # fmt: skip
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def write(project: Path, name: str, text: str) -> None:
    path = project / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("src/model/status.c", "math.h"),
        ("src/integrator/method_cvode.c", "cvode/cvode.h"),
        ("src/integrator/method_cvode.c", "method.h"),
        ("src/instance/values.c", "ode.h"),
        ("fmu/component.c", "instance.h"),
        ("fmu/fmi2/fmi2.c", "fmi2Functions.h"),
        ("fmu/fmi3/fmi3.c", "component.h"),
        ("models/rp_plant/equations/rp_plant.c", "taylor.h"),
        ("models/rp_plant/equations/rp_plant.c", "rp_manipulator.h"),
        ("models/rp_plant/rp_plant_model.c", "rp_plant.h"),
        ("models/rp_controller/rp_controller.c", "rp_manipulator.h"),
    ],
)
def test_what_may_be_included(project: Path, name: str, header: str) -> None:
    write(project, name, f'#include "{header}"\n')
    assert list(wrong_includes(project)) == []


@pytest.mark.parametrize(
    ("name", "header"),
    [
        ("src/model/status.c", "ode.h"),
        ("src/integrator/workspace.c", "sched.h"),
        ("src/integrator/method_cvode.c", "instance.h"),
        ("src/instance/values.c", "method.h"),
        ("src/instance/values.c", "component.h"),
        ("src/instance/values.c", "cvode/cvode.h"),
        ("src/instance/values.c", "rp_manipulator.h"),
        ("fmu/component.c", "internals.h"),
        ("fmu/component.c", "fmi2_calls.h"),
        ("fmu/component.h", "fmi2Functions.h"),
        ("fmu/fmi2/fmi2.c", "ode.h"),
        ("fmu/fmi2/fmi2.c", "fmi3_calls.h"),
        ("fmu/fmi2/fmi2.c", "fmi3Functions.h"),
        ("models/rp_plant/rp_plant.c", "instance.h"),
        ("models/rp_plant/equations/rp_plant.c", "rp_plant_model.h"),
        ("models/rp_trajectory/rp_trajectory.c", "rp_manipulator.h"),
        ("models/rp_plant/rp_plant.c", "nowhere.h"),
    ],
)
def test_what_may_not_be_included(project: Path, name: str, header: str) -> None:
    write(project, name, f"  #  include <{header}>\n")
    assert list(wrong_includes(project)) == [f"{name} includes {header}"]


def test_a_folder_without_a_rule_is_noticed(project: Path) -> None:
    write(project, "src/other/other.c", '#include "model.h"\n')
    with pytest.raises(AssertionError, match="src/other has no place"):
        list(wrong_includes(project))


def test_a_circle_is_noticed(project: Path) -> None:
    write(project, "src/model/model.h", '#include "second.h"\n')
    write(project, "src/model/second.h", '#include "third.h"\n')
    write(project, "src/model/third.h", '#include "second.h"\n')
    assert list(include_circles(project)) == ["second.h -> third.h -> second.h"]


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("cosim/run.py", "import cosim.unit"),
        ("fmu/document.py", "from generate import header"),
        ("models/rp_plant/references/more.py", "from make import derive"),
        ("models/rp_plant/references/more.py", "from cosim import unit"),
        ("models/rp_plant/references/more.py", "import numpy"),
    ],
)
def test_what_may_be_imported(project: Path, name: str, line: str) -> None:
    write(project, name, f"{line}\n")
    assert list(wrong_imports(project)) == []


@pytest.mark.parametrize(
    ("name", "line", "module"),
    [
        ("cosim/run.py", "    from models.rp_plant.references import make", "models"),
        ("cosim/run.py", "    import generate", "generate"),
        ("cosim/run.py", "    from tests.support import paths", "tests"),
        ("fmu/document.py", "    from cosim.unit import Fmu", "cosim"),
        ("fmu/document.py", "    import models", "models"),
        ("models/rp_plant/references/more.py", "    from fmu import generate", "fmu"),
        ("models/rp_plant/references/more.py", "    import generate", "generate"),
        ("models/rp_plant/references/more.py", "    import tests", "tests"),
    ],
)
def test_what_may_not_be_imported(project: Path, name: str, line: str, module: str) -> None:
    write(project, name, f"def late():\n{line}\n")
    assert list(wrong_imports(project)) == [f"{name} imports {module}"]
