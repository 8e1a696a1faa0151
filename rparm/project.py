"""Places of all files: no other module of rparm knows the project's folders and file names.

models/MODEL/scenarios/NAME.toml        a scenario
models/MODEL/convergence/NAME.toml      a problem for the order of convergence, of that format
models/MODEL/references/NAME/           MODEL_ref.csv of a scenario, exact.json of a problem
models/MODEL/references/scales.toml     sums that errors are divided by, instead of maxima
models/MODEL/MODEL.toml                 its equations; with_elements/: without events in C
models/SYSTEM/loop.toml                 connects models to a system
models/SYSTEM/references/VARIANT/       ecos.csv of a variant of the system
models/SYSTEM/study.py                  what to measure, draw and study there
models/*/campaigns/NAME.toml            a campaign
models/MODEL/start.toml                 values that a new scenario of the model begins with
models/SYSTEM/system.svg                its components and the signals between them
models/*/animation.py                   what of a run the report animates
models/SYSTEM/identification.py         makes a log of the system, to identify parameters from
build/*.fmu, build/*.ssp                built from the folder of the same name, without regard
                                        to case and underscores; of FMI 2.0
build/fmi3/                             the same of FMI 3.0
build/loop/                             the library that steps FMUs, of rparm/loop
build/runtime/runtime.json              what FMUs of own equations are linked with
build/release/built.tar.xz              the same for all platforms, that program, and the playground
fmu/equations_to_fmu.py                 makes these FMUs, in a separate process
build/report/                           what the commands write: index.html, folders of its parts

An installed package has fmu/ and models/ in its folder share/, what is built as `rparm.shipped`
says, and writes to rparm-output/ in the current folder.
"""

import functools
import os
import platform
import re
import subprocess
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from rparm import fmu_tools, shipped
from rparm.errors import UserError, did_you_mean, reason
from rparm.files import is_file
from rparm.needs import COMMANDS

PACKAGE = Path(__file__).resolve().parent
INSTALLED = shipped.SHARE.is_dir()  # else the package is in a checkout
ROOT = shipped.SHARE if INSTALLED else PACKAGE.parent
PROGRAM = "rparm" if INSTALLED else "./run.sh"

LOOP = "loop.toml"  # the file of a system
DIAGRAM = "system.svg"
START = "start.toml"
STUDY = "study"  # the module of a system's folder that rparm.systems.comparison describes
IDENTIFICATION = "identification"  # module of a system's folder, read by identification.request
ANIMATION = "animation"  # the module of a model's or system's folder for rparm.report.motion
ELEMENTS = "with_elements"  # in the folder of a model, the same one with elements for its events
PROVEN = "references/proven.toml"  # in the folder of a model whose references and runs are proven
WEB = "wasm32-wasi"  # platform of FMUs for browsers
SCENARIO_FOLDERS = ("scenarios", "convergence")
BUILD_FOLDERS = {"2.0": "build", "3.0": "build/fmi3"}  # by version of FMI
VERSIONS = tuple(BUILD_FOLDERS)
NO_CACHE = "RPARM_NO_CACHE"  # variable of the environment, which --no-cache sets


EQUATIONS = {"states", "discrete", "sampled", "algebraic", "where", "outputs"}
EQUATIONS |= {"experiment", "modes", "estimator"}
VARIABLE = re.compile(r"\s*\w+(\.\w+|\[[\d,\s]+\])+\s*")
OF_LOOP = {
    "start",
    "stop",
    "step",
    "order",
    "keep",
    "variants",
}  # keys of systems of components only
# command -> the files that it takes, and keys that such a file has and others do not
KINDS = {
    "system": ("a system", {"components", "connections"}),
    "campaign": ("a campaign", {"sampling", "runs"}),
    "build": ("a model of equations", EQUATIONS | {"components"}),
    "run": ("a scenario", {"model", "fmu", "tolerance", "time"}),
}
# what makes such a file of a model of equations
WRITERS = {"system": "new-system NAME {}", "run": "new NAME --model {}"}


def check_current_folder() -> None:
    """Refuse a current folder that has been removed: most paths then lead nowhere."""
    try:
        Path.cwd()
    except OSError as error:
        text = f"{reason(error)}; change to another one"
        raise UserError(f"the current folder cannot be used: {text}") from None


def fmi_version(given: object) -> str | None:
    """Return the version of FMI by its first digit or in full; None if it is none of `VERSIONS`."""
    return next((x for x in VERSIONS if str(given) in (x, x[0])), None)


def models_folder() -> Path:
    return ROOT / "models"


def scenario_files() -> dict[str, Path]:
    """Return all scenarios by name; UserError if two scenarios have the same name."""
    found: dict[str, Path] = {}
    for path in sorted(models_folder().glob("*/scenarios/*.toml")):
        if path.stem in found:
            raise UserError(f"{path}: the name {path.stem!r} is taken by {found[path.stem]}")
        found[path.stem] = path
    return dict(sorted(found.items()))


def scenario_file(given: str | Path, folder: Path = Path()) -> Path:
    """Return a scenario: a file in a folder, or one of the project; UserError if there is none."""
    if Path(given).suffix.lower() == ".toml":
        return folder / given
    name, found = str(given), scenario_files()
    if name not in found:
        guess = did_you_mean(name, found)
        raise UserError(f"no scenario {name!r}{guess} ({PROGRAM} list names them)")
    return found[name]


def is_of(command: str, content: Iterable[str]) -> bool:
    """Return whether a TOML file has keys of the files that a command takes."""
    return not KINDS[command][1].isdisjoint(content)


def is_system(content: Mapping[str, object]) -> bool:
    """Return whether a file describes components that run side by side, not one model of them."""
    keys = {*content}
    has_equations = bool(EQUATIONS & keys) or _has_expressions(content.get("connections"))
    return is_of("system", keys) and bool(OF_LOOP & keys or not has_equations)


def _has_expressions(connections: object) -> bool:
    """Return whether more is connected than a variable with a variable."""
    if isinstance(connections, dict):
        return any(map(_has_expressions, connections.values()))
    return isinstance(connections, str) and not VARIABLE.fullmatch(connections)


def refuse_other(path: Path, content: Iterable[str], command: str) -> None:
    """Refuse a TOML file with keys of another command's files, and none of this one's."""
    found = [other for other in KINDS if is_of(other, content)]
    if found and command not in found:
        other, expected = KINDS[found[0]][0], KINDS[command][0]
        way_out = f"{found[0]} {path} takes it"
        if found[0] == "build" and command in WRITERS:
            way_out = f"{WRITERS[command].format(path)} writes {expected} of it"
        raise UserError(f"{path}: is {other}, expected {expected}: {PROGRAM} {way_out}")


def campaign_files() -> dict[str, Path]:
    """Return all campaigns of models and systems by name."""
    found = {path.stem: path for path in models_folder().glob("*/campaigns/*.toml")}
    return dict(sorted(found.items()))


def campaign_file(given: str | Path) -> Path:
    """Return a campaign: a file, or one of the project by its name; UserError if there is none."""
    path, known = Path(given), campaign_files()
    if path.suffix or is_file(path):
        return path
    if str(given) not in known:
        guess = did_you_mean(str(given), known)
        raise UserError(f"no campaign {str(given)!r}{guess} ({PROGRAM} campaign --list names them)")
    return known[str(given)]


def models() -> dict[str, Path]:
    """Return the folders of all models that have scenarios, by name."""
    folders = sorted({path.parents[1] for path in models_folder().glob("*/scenarios/*.toml")})
    return {folder.name: folder for folder in folders}


def proven() -> list[str]:
    """Return the names of the models whose references and runs are proven."""
    return [name for name, folder in models().items() if (folder / PROVEN).is_file()]


def model(name: str) -> Path:
    """Return the folder of a model, by its own name or its FMU's; a UserError lists known ones."""
    known = models()
    for folder in known.values():
        if name == folder.name or is_built_from(name, folder):
            return folder
    guess = did_you_mean(name, [*known, *built_names(".fmu")])
    raise UserError(f"no model {name!r}{guess} (known: {', '.join(known) or 'none'})")


def is_in_model(file: Path) -> bool:
    """Return whether a file lies where a model has its scenarios and problems."""
    return Path(file).absolute().parent.name in SCENARIO_FOLDERS


def is_ours(file: Path) -> bool:
    """Return whether a file is one of the project's scenarios, or lies where they do."""
    file = Path(file).resolve()
    return is_in_model(file) and file.parents[2] == models_folder().resolve()


def convergence_files() -> list[Path]:
    """Return all problems for the order of convergence."""
    return sorted(models_folder().glob("*/convergence/*.toml"))


def model_folder(scenario: Path) -> Path:
    """Return the folder of the model of a scenario or problem; UserError if the file is in none."""
    folder = scenario.absolute().parent
    if folder.name not in SCENARIO_FOLDERS:
        raise UserError(f"{scenario}: expected in models/MODEL/scenarios/")
    return folder.parent


def references(folder: Path) -> Path:
    return folder / "references"


def reference_folder(scenario: Path) -> Path:
    return references(model_folder(scenario)) / scenario.stem


def reference_file(scenario: Path, model: str) -> Path:
    """Return the reference of a scenario, of a model whose FMU has the name `model`."""
    return reference_folder(scenario) / f"{model}_ref.csv"


def scales_file(folder: Path) -> Path:
    """Return the sums that errors of a model or system are divided by."""
    return references(folder) / "scales.toml"


def exact_state_file(problem: Path) -> Path:
    """Return the exact final state of a problem for the order of convergence."""
    return reference_folder(problem) / "exact.json"


def variant_reference_file(system: Path, variant: str) -> Path:
    """Return the reference of a system's variant: Jacobi stepping, read as Ecos does."""
    return references(system) / variant / "ecos.csv"


def making_references(folder: Path, name: str) -> str:
    """Say how to make the reference called `name` of a model or system again, for messages."""
    if INSTALLED:
        return "it comes with rparm, install that again"
    # relative to the project's folder, in which its documentation gives all commands
    script = f"models/make_references.py {folder.name} {name}"
    return f"to make it again: build/venv/bin/python {script}"


def systems() -> dict[str, Path]:
    """Return the folders of all systems by name."""
    found = sorted(path.parent for path in models_folder().glob(f"*/{LOOP}"))
    if not found:
        raise UserError(f"{models_folder()}: has no folder with {LOOP}")
    return {folder.name: folder for folder in found}


def is_built_from(name: str, folder: Path) -> bool:
    """Return whether an FMU or SSP called `name` is built from the folder of a model or system."""
    return name.lower() == folder.name.replace("_", "").lower()


def built_names(suffix: str) -> list[str]:
    """Return the names of the FMUs (.fmu) or systems (.ssp) that are there, without suffix."""
    if INSTALLED:
        files = [Path(name) for name in shipped.names() if name.startswith(VERSIONS[0])]
    else:
        files = sorted((ROOT / BUILD_FOLDERS[VERSIONS[0]]).glob(f"*{suffix}"))
    return [file.stem for file in files if file.suffix == suffix]


def built(folder: Path, suffix: str, option: str = "", version: str = VERSIONS[0]) -> Path:
    """Return the FMU or SSP built from a folder; a UserError names an `option` for another file."""
    kind = suffix.removeprefix(".").upper()
    if INSTALLED:
        for name in shipped.names():
            of_version = name.startswith(version) and name.endswith(suffix)
            if of_version and is_built_from(Path(name).stem, folder):
                return shipped.file(name, cache_folder("files"))
        raise UserError(f"rparm comes with no {kind} of {folder.name}")
    build = ROOT / BUILD_FOLDERS[version]
    for path in sorted(build.glob(f"*{suffix}")):
        if is_built_from(path.stem, folder):
            return path
    way_out = f"{PROGRAM} builds it" + (f", {option} PATH takes another one" if option else "")
    raise UserError(f"{build}: has no {kind} of {folder.name}: {way_out}")


def is_built(path: Path, folder: Path) -> bool:
    """Return whether a file of this build is built from the folder of a model or system."""
    is_here = path.resolve().parent in [ROOT.resolve() / name for name in BUILD_FOLDERS.values()]
    return is_here and is_built_from(path.stem, folder)


def equations(fmu: Path) -> Path | None:
    """Return the file with the equations of an FMU of the project, or such a file; or None."""
    if fmu.suffix.lower() == ".toml":
        return fmu
    is_shipped = INSTALLED and fmu.resolve().is_relative_to(cache_folder("files").resolve())
    for folder in models().values():
        if is_built_from(fmu.stem, folder) if is_shipped else is_built(fmu, folder):
            return equations_of_model(folder)
    return None


def equations_of_model(folder: Path) -> Path | None:
    """Return the file with the equations of a model: that without events in C, if there is one."""
    name = f"{folder.name}.toml"
    files = folder / ELEMENTS / name, folder / name
    return next((file for file in files if file.is_file()), None)


def fmu_of(subject: Path, option: str = "", version: str = VERSIONS[0]) -> Path:
    """Return the FMU of a scenario's subject: a file itself, or built from a model's folder."""
    return built(subject, ".fmu", option, version) if subject.is_dir() else subject


def platform_name() -> str:
    """Return FMI 3.0's name for the platform of this machine's binaries."""
    if os.name == "nt":
        return "x86_64-windows"  # Windows on Arm runs them, too
    machine = platform.machine().replace("arm64", "aarch64")
    return f"{machine}-{platform.system().lower()}"


def loop_folder() -> Path:
    """Return the folder of the library that steps FMUs, for this machine (rparm/loop)."""
    return ROOT / "loop" / platform_name() if INSTALLED else PACKAGE.parent / "build" / "loop"


def built_for_all() -> Path:
    """Return the folder built by a release for each platform; UserError if there is none."""
    if INSTALLED:
        return shipped.unpacked(shipped.BUILT, cache_folder("built"))
    archive = ROOT / "build" / "release" / shipped.BUILT.name
    if not archive.is_file():
        raise UserError(f"{archive}: not there, ./release.sh makes it")
    return shipped.unpacked(archive, ROOT / "build" / "built")


def page(name: str) -> Path:
    """Return a page that also the wheel has, by its path in the project."""
    return from_root(ROOT / name)


def model_builder() -> Path:
    """Return the path of the program that makes FMUs of own equations."""
    return Path(fmu_tools.__path__[0]) / "equations_to_fmu.py"


def runtimes(all_platforms: bool, web: bool = False) -> list[Path]:
    """Return the runtimes to link models with, here or on all platforms; UserError if not there."""
    if all_platforms:
        return sorted(path for path in built_for_all().glob("*.json") if path.stem != WEB)
    if INSTALLED:
        runtime = built_for_all() / f"{WEB if web else platform_name()}.json"
        way_out = f"{PROGRAM} build --platforms builds for others"
    else:
        runtime = ROOT / "build" / (f"platforms/{WEB}" if web else "") / "runtime/runtime.json"
        way_out = f"{PROGRAM} {'playground' if web else 'build'} makes it"
    if not runtime.is_file():
        raise UserError(f"{runtime}: not there; {way_out}")
    return [runtime]


def from_root(path: Path) -> Path:
    """Write a path as commands in the project's folder do, in a checkout."""
    path = path.absolute()
    return path.relative_to(ROOT) if path.is_relative_to(ROOT) and not INSTALLED else path


def report_folder(part: str = "") -> Path:
    """Return the folder that commands write to if no other one is given."""
    return (Path("rparm-output") if INSTALLED else ROOT / "build" / "report") / part


def campaign_folder(name: str) -> Path:
    """Return the folder for a campaign's results if no other one is given."""
    return report_folder("campaigns") / name


def playground_page() -> Path:
    """Return the page with the plant; UserError if it has not been built."""
    page = (built_for_all() if INSTALLED else ROOT / "build") / "playground" / "index.html"
    if not page.is_file():
        raise UserError(f"{page}: not there, {PROGRAM} playground builds it")
    return page


def plotly_script() -> Path:
    """Return the library that draws the plots: of the package plotly, or shipped as .xz."""
    if INSTALLED:
        return ROOT / "plotly" / "plotly.min.js.xz"
    found = find_spec("plotly")
    assert found is not None and found.origin is not None  # requirements/run.in has it
    return Path(found.origin).parent / "package_data" / "plotly.min.js"


def version() -> str:
    if INSTALLED:
        from importlib import metadata  # takes long

        return metadata.version("rparm")
    text = (PACKAGE.parent / "CMakeLists.txt").read_text(encoding="utf-8")
    found = re.search(r"^project\(\w+ VERSION (\S+)", text, re.MULTILINE)
    assert found is not None
    return found[1]


@functools.cache
def commit() -> str:
    """Return the commit of a checkout, with -dirty if files have changed; "" if it is not known."""
    if not (PACKAGE.parent / ".git").exists():
        return ""
    here = ["git", "-C", str(PACKAGE.parent)]
    command = [*here, "describe", "--always", "--dirty", "--exclude", "*"]
    with suppress(OSError):
        return subprocess.run(command, capture_output=True, encoding="utf-8").stdout.strip()
    return ""


def results_folder(folder: Path) -> Path:
    """Return the folder whose start page lists what is written into `folder`."""
    usual = report_folder().absolute()
    return usual if folder.absolute().is_relative_to(usual) else folder


def how_to_install(extra: str) -> str:
    """Return the command that installs the packages of an extra of the distribution."""
    if INSTALLED:
        return f'pip install "rparm[{extra}]"'
    has_lock = any(command.lock == extra for command in COMMANDS.values())
    return f"./setup.sh --{extra}" if has_lock else "./setup.sh"


def not_installed(packages: str, extra: str) -> UserError:
    """Return the error for missing packages of an extra of the distribution."""
    return UserError(f"{packages}: not installed, {how_to_install(extra)} does it")


def check_installed(packages: Iterable[str], extra: str) -> None:
    """Refuse to run where some of the packages are missing."""
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise not_installed(", ".join(missing), extra)


def cache_folder(part: str) -> Path:
    """Return the folder for `part` of the files that can be made again."""
    if not INSTALLED:
        return ROOT / "build" / part
    return _user_cache() / part


def builds_folder() -> Path | None:
    """Return the user's folder for models that were built; None: nothing is kept."""
    return None if os.environ.get(NO_CACHE) else _user_cache() / "builds"


def _user_cache() -> Path:
    from platformdirs import user_cache_path  # takes long

    given = os.environ.get("RPARM_CACHE")
    return Path(given or user_cache_path("rparm", appauthor=False)).absolute()


def set_library_caches() -> None:
    """Lead the caches of libraries to folders that can be written, for child processes too."""
    os.environ.setdefault("MPLCONFIGDIR", str(cache_folder("matplotlib")))


def child_environment() -> dict[str, str]:
    """Return the variables for a Python process of this package, started with -P."""
    if INSTALLED:
        return dict(os.environ)
    folders = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(folders)}
