"""rparm is not for Linux only: what other systems lack, or do in another way, is not used. It
is for all models, too.

No test here runs on another system. Those that change this one change it to what is documented of
the other.
"""

import ast
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rparm.errors import UserError
from rparm.fmi import fmu_file
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.versions import Fmi2Instance
from rparm.runs import simulation
from tests.support.paths import ROOT, SYSTEMS
from tests.support.programs import python
from tests.support.rparm_project import (
    BUILD,
    FMUS,
    SHORT,
    Console,
    declared,
    load,
    names_of,
    repacked,
)

SOURCES = sorted(path for top in ("rparm", "models") for path in (ROOT / top).rglob("*.py"))

# ---- What the sources use ------------------------------------------------------------------------

# modules, attributes of modules and arguments of calls that Python has not got on Windows
MODULES = {"crypt", "curses", "fcntl", "grp", "posix", "pty", "pwd", "readline", "resource"}
MODULES |= {"syslog", "termios", "tty"}
ATTRIBUTES = {
    "os": r"(fork|forkpty|killpg|get(e?[ug]id|pgid|pgrp|sid|loadavg|groups)|set(e?[ug]id|pgid|sid)"
    r"|sched_\w+|mkfifo|mknod|l?chown|uname|f?statvfs|nice|wait|wait3|wait4|waitid|W[A-Z]+|openpty"
    r"|sysconf|pread|pwrite|O_(NOFOLLOW|DIRECTORY|NONBLOCK|CLOEXEC)|confstr|sendfile|chroot)",
    "signal": r"(SIG(KILL|HUP|ALRM|USR[12]|PIPE|CHLD|QUIT|STOP|CONT|TSTP)|alarm|[gs]etitimer|pause"
    r"|sigwait\w*|pthread_\w+|siginterrupt)",
    "time": r"(clock|tzset|clock_\w+|pthread_\w+)",
}
ARGUMENTS = {"preexec_fn", "pass_fds", "process_group", "start_new_session"}
# a branch is not looked into whose condition asks what there is
ASKS = re.compile(r"hasattr\(|sys\.platform|os\.name")


def not_portable(tree: ast.AST) -> Iterator[str]:
    """What a module of Python uses that not every system has, or has with another default."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            yield node.module
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            pattern = ATTRIBUTES.get(node.value.id)
            if pattern and re.fullmatch(pattern, node.attr):
                yield f"{node.value.id}.{node.attr}"
        elif isinstance(node, ast.Call):
            yield from _not_portable_call(node)
        if not (isinstance(node, ast.If) and ASKS.search(ast.unparse(node.test))):
            yield from not_portable(node)


def _not_portable_call(call: ast.Call) -> Iterator[str]:
    """Texts in the encoding or with the line ends of the system, and arguments of POSIX."""
    name = ast.unparse(call.func)
    given = {keyword.arg: keyword.value for keyword in call.keywords}
    for argument in sorted(ARGUMENTS & set(given)):
        if not ASKS.search(ast.unparse(given[argument])):
            yield f"{name}({argument}=)"
    if name.endswith("CDLL") and [ast.unparse(x) for x in call.args] == ["None"]:
        yield f"{name}(None)"
    if given.keys() & {"text", "universal_newlines"} and "encoding" not in given:
        yield f"{name} without encoding"
    if name == "os.open" or not re.search(r"(^|\.)(open|read_text|write_text)$", name):
        return
    if name in ("read_text", "write_text"):  # of rparm.files
        return
    mode = ""
    if name.endswith("open"):
        place = 0 if "." in name else 1
        mode = given.get("mode", call.args[place] if len(call.args) > place else None)
        mode = ast.literal_eval(mode) if mode is not None else "r"
    if "b" not in mode and "encoding" not in given:
        yield f"{name} without encoding"
    writes = name.endswith("write_text") or set(mode) & set("wax")
    if writes and "b" not in mode and "newline" not in given:
        yield f"{name} without newline"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_sources_use_what_every_system_has(path: Path) -> None:
    assert list(not_portable(ast.parse(path.read_text(encoding="utf-8")))) == []


# ---- Names of files ------------------------------------------------------------------------------

# characters and names that Windows keeps for itself
RESERVED = re.compile(r'[<>:"\\|?*\x00-\x1f]|[. ]$|^(con|prn|aux|nul|com\d|lpt\d)(\.|$)', re.I)


def unusable(names: list[str]) -> list[str]:
    """Paths that Windows cannot have, or that it takes for the same as another one."""
    bad = [name for name in names if any(map(RESERVED.search, name.split("/")))]
    folded = [name.casefold() for name in names]
    return bad + [name for name in names if folded.count(name.casefold()) > 1]


def test_names_in_archives_and_in_the_project_suit_every_system() -> None:
    for path in (*FMUS.values(), *(BUILD / f"{name}.ssp" for name in SYSTEMS)):
        with zipfile.ZipFile(path) as archive:
            assert unusable(archive.namelist()) == []
    for top in ("rparm", "fmu", "models", "src", "tests"):
        names = [path.relative_to(ROOT).as_posix() for path in (ROOT / top).rglob("*")]
        assert unusable(names) == []


# ---- Runs ----------------------------------------------------------------------------------------

WITHOUT_POSIX = """
import os, signal, sys
for module in {"fcntl", "grp", "pwd", "resource", "termios"}:
    sys.modules[module] = None  # cannot be imported
for name in ("SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGUSR1"):
    delattr(signal, name)
for name in ("fork", "getuid", "getgid", "killpg", "setsid", "sched_getaffinity"):
    delattr(os, name)
from rparm.__main__ import _as_program
sys.argv[:1] = ["rparm"]
sys.exit(_as_program())
"""


def test_run_without_what_windows_lacks(fmu: Path, tmp_path: Path) -> None:
    arguments = ("run", SHORT, "--tolerance", "1e-8", "--fmu", fmu, "--report", tmp_path / "report")
    console = {"PYTHONIOENCODING": "cp1252"}  # in western Europe
    options = {"folder": tmp_path, "environment": console, "text": False}
    done = python("-c", WITHOUT_POSIX, *arguments, **options)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"passed: 1 scenario" in done.stdout
    assert (tmp_path / "report" / "index.html").is_file()


def test_the_scenarios_are_those_of_the_given_fmus_model(project: Path, console: Console) -> None:
    """Though its file is somewhere and nothing is built."""
    other = load(names_of("rp_trajectory")[0])
    model = project / "models" / other.model
    (model / "scenarios").mkdir(parents=True)
    shutil.copy(other.path, model / "scenarios")
    shutil.copytree(other.reference_folder, model / "references" / other.name)
    fmu = shutil.copy(FMUS[other.model], project / "downloaded.fmu")
    arguments = ("run", "--tolerance", "1e-8", "--fmu", fmu, "--report", project / "report")
    code, out, err = console(*arguments)
    assert (code, err) == (0, "")
    rows = [line.split()[0] for line in out.splitlines() if line.endswith("passed")]
    assert rows == [other.name] and "passed: 1 scenario; " in out


def test_fmu_of_a_model_without_scenarios(project: Path, fmu: Path, console: Console) -> None:
    def change(xml: str) -> str:
        return re.sub(r'modelName="\w+"', 'modelName="Other"', xml)

    other = repacked(fmu, project / "x.fmu", change)
    words = f"has no scenarios of Other, the model of {other}"
    assert words in console.refused("run", "--fmu", other)


# ---- Binaries ------------------------------------------------------------------------------------


def with_binaries(
    source: Path, target: Path, binaries: dict[str, Callable[[bytes], bytes]]
) -> Path:
    """Copy of an FMU with its binary of this platform, changed, in other folders."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            if not name.startswith("binaries/"):
                new.writestr(name, old.read(name))
            elif name.endswith(fmu_file.LIBRARY_SUFFIX):
                for folder, change in binaries.items():
                    new.writestr(f"binaries/{folder}/{Path(name).name}", change(old.read(name)))
    return target


def same(content: bytes) -> bytes:
    return content


@pytest.mark.parametrize(
    "binaries",
    [
        # linux64, in which fmpy looks there too, holds the binary for x86-64
        {"aarch64-linux": same, "linux64": lambda _: b"for another machine"},
        {"linux64": same},  # as fmpy compiles it
    ],
    ids=["shipped", "compiled"],
)
def test_on_arm_a_binary_is_in_the_folder_of_either_version(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, binaries: dict
) -> None:
    monkeypatch.setattr(Fmi2Instance, "PLATFORMS", ("aarch64-linux", "linux64"))
    with Fmu(with_binaries(fmu, tmp_path / "arm.fmu", binaries)) as opened:
        simulation.simulate(opened, load(SHORT))


@pytest.mark.parametrize("sources", [False, True])
def test_fmu_for_other_platforms(fmu: Path, tmp_path: Path, sources: bool) -> None:
    path = with_binaries(fmu, tmp_path / "other.fmu", {"plan9": same, "amiga": same})
    with zipfile.ZipFile(path, "a") as archive:
        if sources:
            archive.writestr("sources/all.c", "")
    with pytest.raises(UserError, match=r"has no binary for .* \(has: amiga, plan9\)") as caught:
        Fmu(path)
    assert ("`fmpy compile` makes one" in str(caught.value)) == sources


def test_a_loaded_library_that_windows_keeps_hides_no_error(
    fmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remove = os.unlink

    def keep_libraries(path: str, *arguments: object, **options: object) -> None:
        if str(path).endswith(fmu_file.LIBRARY_SUFFIX):
            raise PermissionError(13, "in use by another process", path)
        remove(path, *arguments, **options)

    monkeypatch.setattr(os, "unlink", keep_libraries)
    with pytest.raises(UserError, match="the real reason"), Fmu(fmu) as opened:
        folder = opened.folder
        raise UserError("the real reason")
    monkeypatch.undo()
    assert folder.is_dir()
    shutil.rmtree(folder)


# ---- The co-simulation engine --------------------------------------------------------------------


def test_a_broken_ecos_is_named(
    tmp_path: Path, console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ecospy.py").write_text("raise OSError('libecosc.so:\\nwrong machine')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    ssp = BUILD / "ClosedLoop.ssp"
    error = console.failed("system", "nominal", "--ssp", ssp, "--report", tmp_path / "report")
    assert "ecospy cannot be loaded: libecosc.so: wrong machine" in error


KILLED = """
import os, signal, subprocess, sys
from rparm import interruption
del os.killpg
child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
interruption._kill(child)
assert child.wait(10) == -signal.SIGKILL
"""


def test_the_child_is_killed_where_there_are_no_process_groups() -> None:
    subprocess.run([sys.executable, "-c", KILLED], cwd=ROOT, check=True)


def test_components_are_found_by_paths_of_windows() -> None:
    from rparm.systems import ecos
    from rparm.systems import ssp as ssp_archives

    with ssp_archives.unpacked(BUILD / "ClosedLoop.ssp") as opened:
        component = opened.system.components[0]
        path = "C:\\Temp\\x\\" + component.source.replace("/", "\\")
        assert ecos._components(opened, path) == repr(component.name)
        assert ecos._components(opened, "C:\\Temp\\other.fmu") == "'other.fmu'"


# ---- Names of models -----------------------------------------------------------------------------

# rparm drives any FMU: it names no model
DRIVERS = sorted(x for x in (ROOT / "rparm").rglob("*") if x.suffix in (".py", ".html"))
# of every model with states
SOLVER = {"time", "solver_steps", "solver_rhs_evaluations", "solver_restarts"}
SOLVER |= {"solver_failed_steps", "effective_relative_tolerance"}
SOLVER |= {"solver_method", "relative_tolerance"}
# words of English, letters and an argument of Ecos that are names of variables too
WORDS = {"branch", "mode", "motion", "radius", "turns", "duration", "frequency", "a", "g"}
WORDS |= {"start_time", "position"}
WORDS |= {"delay"}  # an argument of tqdm
WORDS |= {"seed"}  # of random numbers
WORDS |= {"angle", "damping"}  # of complex numbers and of poles


@pytest.fixture(scope="module")
def of_models() -> set[str]:
    """Names of models, FMUs, systems and variables."""
    found = {*FMUS, *(fmu.stem for fmu in FMUS.values()), "closed_loop", "ClosedLoop", "Machine"}
    for model in FMUS:
        found |= set(declared(model).variables) - SOLVER - WORDS
    assert {"q1", "tau1", "Kp1", "q1_ref", "kinetic_energy"} <= found
    return found


@pytest.mark.parametrize("path", DRIVERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_model_is_named(path: Path, of_models: set[str]) -> None:
    assert of_models.intersection(re.findall(r"\w+", path.read_text(encoding="utf-8"))) == set()
