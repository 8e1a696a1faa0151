"""Which folder may include or import which: arrows between folders go one way.

A C file may include headers of its own folder, public headers of the folders below it, and the C
standard library. What else a folder may use is in the tables here, and in no other place. No files
call each other in a circle.
"""

import ast
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.analysis.call_graph import (
    Graph,
    Symbols,
    c_graph,
    circles,
    objects,
    package_graph,
    read_symbols,
)
from tests.support.paths import ROOT
from tests.support.programs import python

BUILD = Path(os.environ.get("RP_FMU", ROOT / "build" / "RPManipulator.fmu")).parent

# ---- The architecture ----------------------------------------------------------------------------

# folder, as a regular expression: folders and libraries whose headers it includes
MAY_INCLUDE = {
    r"src/model": (),
    r"src/integrator": ("src/model",),
    r"src/instance": ("src/integrator", "src/model"),
    r"fmu": ("src/model",),
    r"fmu/fmi": ("src/instance", "src/model"),
    r"fmu/fmi\d": ("fmu/fmi", "src/instance", "src/model"),
    r"models": ("src/model",),
    r"models/\w+(/with_elements)?": ("models", "src/model"),
    r"rparm/loop": (),
}  # fmt: skip
# the equations of another model
MAY_INCLUDE_MODEL = {
    "models/rp_controller": "models/rp_manipulator",
    "models/rp_plant": "models/rp_manipulator",
    "models/rp_plant/with_elements": "models/rp_manipulator",
}

# folders that hide headers; those of others are all public
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
    "the clock": (r"sys/time\.h|windows\.h", r"rparm/loop"),
    "x86-64": (r"cpuid\.h", r"src/model"),  # platform.h: the processor has AVX2
    "SUNDIALS": (r"(arkode|cvode|nvector|sun\w+)/\w+\.h", r"src/integrator"),
    "FMI 2.0": (r"fmi2\w+\.h", r"fmu/fmi2|rparm/loop"),
    "FMI 3.0": (r"fmi3\w+\.h", r"fmu/fmi3|rparm/loop"),
}

# Python, by the first part of the path; tests import everything
MAY_IMPORT = {
    "rparm": {"rparm", "fmu.compiler"},
    "fmu": {"fmu", "fmu.compiler"},
    "models": {"models", "rparm"},
}

# modules of rparm that only lead to another folder
ELSEWHERE = {
    ("rparm", "models"): "models",
    ("rparm", "fmu_tools"): "fmu",
    ("rparm", "fmu_tools", "compiler"): "fmu.compiler",
}

# packages of Python whose modules and folders use each other in one direction
PACKAGES = [
    path.parent
    for top in ("rparm", "fmu/compiler")
    for path in sorted(ROOT.glob(f"{top}/**/__init__.py"))
]

# what Python runs, and large packages that it must not load
NOT_LOADED = {
    "import rparm": {"fmpy", "numpy", "matplotlib"},
    "import rparm.campaign.runs": {"scipy.stats", "SALib", "matplotlib"},
    "from rparm.__main__ import main; main(['list']);"
    "import rparm.commands.run, rparm.commands.system": {
        "dask", "distributed", "pyarrow", "SALib",
    },
}  # fmt: skip

# ---- C: includes ---------------------------------------------------------------------------------

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def folder_of(path: Path, root: Path) -> str:
    return path.parent.relative_to(root).as_posix()


TOPS_OF_C = ("src", "fmu", "models", "rparm")


def c_files(root: Path) -> list[Path]:
    return sorted(path for top in TOPS_OF_C for path in (root / top).rglob("*.[ch]"))


def find_header(name: str, source: Path, files: list[Path]) -> Path | None:
    """The project's header that `source` includes by this name; None: it is not one of them."""
    beside = Path(os.path.normpath(source.parent / name))
    if beside in files:
        return beside
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
                made = name.removesuffix("_values.h") + ".toml"
                fine = is_library_of(name, folder) or any((root / "models").rglob(made))
            else:
                fine = is_allowed(header, folder, root)
            if not fine:
                yield f"{path.relative_to(root)} includes {name}"


def graph_of_c_files(root: Path, symbols: dict[str, Symbols]) -> Graph:
    """Calls by these symbols of the C files, calls in inline functions of headers, includes."""
    files = c_files(root)
    names = {path: path.relative_to(root).as_posix() for path in files}
    headers = {names[path]: path.read_text() for path in files if path.suffix == ".h"}
    included = {}
    for path in files:
        found = [find_header(name, path, files) for name in includes(path)]
        included[names[path]] = {names[header] for header in found if header is not None}
    return c_graph(symbols, headers, included)


# ---- Python: imports -----------------------------------------------------------------------------


def imports(path: Path) -> Iterator[str]:
    """First parts of the names of the modules that a file imports, or where those lead to."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [node.module]
        else:
            continue
        for name in names:
            parts = name.split(".")
            found = [ELSEWHERE.get(tuple(parts[:count])) for count in (3, 2)]
            yield next(filter(None, found), parts[0])


def wrong_imports(root: Path) -> Iterator[str]:
    files = {top: sorted((root / top).rglob("*.py")) for top in MAY_IMPORT}
    # a module is imported by the name of its folder, or by its own where that folder is on the path
    names = {top: {top, *(path.stem for path in files[top])} for top in files}
    for top in files:
        names[top] |= {path.parent.name for path in files[top] if path.stem == "__init__"}
    names["tests"] = {"tests"}
    names["fmu.compiler"] = {"fmu.compiler"}
    for top, allowed in MAY_IMPORT.items():
        for path in files[top]:
            for name in imports(path):
                if name in sys.stdlib_module_names or path.with_name(f"{name}.py") in files[top]:
                    continue
                tops = {other for other in names if name in names[other]}
                if tops and not tops & allowed and name.split(".")[0] != top:
                    yield f"{path.relative_to(root)} imports {name}"


# ---- Tests ---------------------------------------------------------------------------------------


def test_includes_follow_the_architecture() -> None:
    assert list(wrong_includes(ROOT)) == []


def test_no_circle_of_c_files() -> None:
    compiled = objects(BUILD)
    sources = [path for path in c_files(ROOT) if path.suffix == ".c" and path in compiled]
    assert len(sources) > 35, "build the project first"
    symbols = {path.relative_to(ROOT).as_posix(): read_symbols(compiled[path]) for path in sources}
    graph = graph_of_c_files(ROOT, symbols)
    reasons = {reason for needed in graph.values() for each in needed.values() for reason in each}
    assert {"include", "instance_continuation", "integrator_advance"} <= reasons
    assert circles(graph) == []


def test_imports_follow_the_architecture() -> None:
    assert list(wrong_imports(ROOT)) == []


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_no_circle_of_folders_and_modules(package: Path) -> None:
    assert circles(package_graph(package, ROOT)) == []


@pytest.mark.parametrize(("code", "unneeded"), NOT_LOADED.items())
def test_what_is_not_needed_is_not_loaded(code: str, unneeded: set[str]) -> None:
    code = f"import sys\n{code}\nprint(*(set(sys.modules) & {unneeded}))"
    run = python("-P", "-c", code)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == ""


# ---- Folders and files

# named by CONTRIBUTING.md only where they are in models
WITHOUT_A_WORD = {"assets", "templates", "references", "scenarios", "variants", "campaigns"}
LONGEST = 650  # lines


def test_every_folder_is_in_a_table() -> None:
    def folders(*patterns: str) -> set[str]:
        found = {path for pattern in patterns for path in ROOT.glob(pattern)}
        return {path.name for path in found if path.is_dir()} - {"__pycache__"}

    page = (ROOT / "tests" / "README.md").read_text(encoding="utf-8")
    cells = " ".join(line.split("|")[1] for line in page.splitlines() if line.startswith("|"))
    models = folders("models/*")
    assert folders("tests/*") - models <= set(re.findall(r"\w+", cells))
    sources = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = set(re.findall(r"\w+", sources)) | WITHOUT_A_WORD
    assert folders("src/*", "fmu/*", "fmu/compiler/*", "rparm/*", "rparm/*/*") <= named


def test_no_file_is_too_long_to_read() -> None:
    tops = ("src", "fmu", "models", "rparm", "playground", "tests")
    files = [path for top in tops for path in (ROOT / top).rglob("*.*")]
    files = [path for path in files if path.suffix in (".c", ".h", ".py", ".js")]
    assert [path for path in files if len_of(path) > LONGEST] == []


def len_of(path: Path) -> int:
    return path.read_bytes().count(b"\n")


# ---- What these tests notice


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Headers and modules of every folder, with nothing in them."""
    for name in (
        "src/model/model.h", "src/integrator/ode.h", "src/integrator/method.h",
        "src/instance/instance.h", "src/instance/state.h", "fmu/fmi/fmi_instance.h",
        "fmu/fmi2/fmi2_functions.h", "fmu/fmi3/fmi3_calls.h", "models/real.h",
        "models/rp_manipulator/rp_manipulator.h", "models/rp_trajectory/motion.h",
        "models/rp_plant/rp_plant_model.h", "models/rp_plant/rp_plant.h",
        "fmu/generate.py", "rparm/unit.py", "models/rp_plant/references/make.py",
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
        ("src/model/status.c", "ode.h"),
        ("src/integrator/workspace.c", "sched.h"),
        ("src/instance/history.c", "method.h"),
        ("src/instance/values.c", "cvode/cvode.h"),
        ("fmu/fmi/fmi_instance.c", "state.h"),
        ("fmu/fmi2/fmi2.c", "fmi3_calls.h"),
        ("fmu/fmi2/fmi2.c", "fmi3Functions.h"),
        ("models/rp_trajectory/rp_trajectory.c", "rp_manipulator.h"),
        ("models/rp_plant/rp_plant.c", "nowhere.h"),
    ],
)
def test_what_may_not_be_included(project: Path, name: str, header: str) -> None:
    write(project, name, f"  #  include <{header}>\n")
    assert list(wrong_includes(project)) == [f"{name} includes {header}"]


def test_a_circle_of_headers_is_noticed(project: Path) -> None:
    write(project, "src/model/model.h", '#include "second.h"\n')
    write(project, "src/model/second.h", '#include "third.h"\n')
    write(project, "src/model/third.h", '#include "second.h"\n')
    assert circles(graph_of_c_files(project, {})) == [
        "src/model/second.h -> src/model/third.h (include); "
        "src/model/third.h -> src/model/second.h (include)"
    ]


def test_a_circle_of_calls_is_noticed() -> None:
    symbols = {
        "a.c": Symbols({"a_do", "a_get"}, {"b_do", "malloc"}),
        "b.c": Symbols({"b_do"}, {"c_do"}),
        "c.c": Symbols({"c_do"}, {"a_do", "a_get"}),
        "above.c": Symbols({"above"}, {"a_do"}),
        "below.c": Symbols({"below"}, set()),
    }
    assert circles(c_graph(symbols, {}, {})) == [
        "a.c -> b.c (b_do); b.c -> c.c (c_do); c.c -> a.c (a_do, a_get)"
    ]


@pytest.mark.parametrize(
    "text",
    ["static inline int f(void) {\n    return up_do(1);\n}\n", "#define F(x) \\\n    up_do(x)\n"],
)
def test_a_header_that_calls_up_is_noticed(text: str) -> None:
    symbols = {"up.c": Symbols({"up_do"}, set())}
    assert circles(c_graph(symbols, {"low.h": text}, {"up.c": {"low.h"}})) == [
        "low.h -> up.c (up_do); up.c -> low.h (include)"
    ]


def test_a_circle_of_imports_is_noticed(project: Path) -> None:
    write(project, "rparm/unit.py", "def late():\n    from rparm import pages\n")
    write(project, "rparm/pages/__init__.py", "")
    write(project, "rparm/pages/first.py", "import rparm.pages.second\nimport rparm.other\n")
    write(project, "rparm/pages/second.py", "from rparm.unit import Fmu\n")
    write(project, "rparm/other.py", "if TYPE_CHECKING:\n    import rparm.pages.first\n")
    assert circles(package_graph(project / "rparm", project)) == [
        "pages -> unit (pages/second.py: rparm.unit.Fmu); unit -> pages (unit.py: rparm.pages)"
    ]


@pytest.mark.parametrize(
    ("name", "line", "module"),
    [
        ("rparm/run.py", "    from rparm.models.rp_plant.references import make", "models"),
        ("rparm/run.py", "    import generate", "generate"),
        ("rparm/run.py", "    from rparm.fmu_tools.generate import header", "fmu"),
        ("fmu/document.py", "    from rparm.unit import Fmu", "rparm"),
        ("models/rp_plant/references/more.py", "    import tests", "tests"),
    ],
)
def test_what_may_not_be_imported(project: Path, name: str, line: str, module: str) -> None:
    write(project, name, f"def late():\n{line}\n")
    assert list(wrong_imports(project)) == [f"{name} imports {module}"]
