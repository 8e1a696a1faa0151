"""FMUs of own equations, from the cache or by the program that makes them: all files or none."""

import errno
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from rparm import build_cache, project
from rparm.errors import UserError, one_line
from rparm.files import read_toml, whole, written
from rparm.interruption import run_group, temporary_folder, uninterrupted

EQUATIONS = ".toml"  # suffix of their files
ESTIMATOR = "estimator"  # the key of a file from which equations are made
WARNINGS = "warnings"  # what is kept beside the files
WARNING, NOTE = "warning: ", "note: "  # how its lines begin

# packages that the program imports
NEEDED = ("latex2mathml", "markdown_it", "mdit_py_plugins", "pycparser")


def build(
    file: str | Path,
    *,
    output: str | Path = "",
    platforms: bool = False,
    web: bool = False,
    lock: bool = True,
    gradients: Sequence[str] = (),
) -> tuple[Path, Path]:
    """Make FMUs of the equations in a file; examples/models/README.md explains it.

    Beside the file, NAME.lock.toml keeps the value references.

    Parameters
    ----------
    file : path
        The file with the equations.
    output : path
        Folder for the FMUs; default: the current one.
    platforms : bool
        For all platforms, by zig; else for this machine, by gcc, clang or zig.
    web : bool
        As WebAssembly, by zig, for the playground.
    lock : bool
        Whether the lock file is written.
    gradients : sequence of str
        Parameters, and starts of states as start(NAME), by which there are gradients; they replace
        those in the file.

    Returns
    -------
    tuple of path
        NAME.fmu of FMI 2.0 and fmi3/NAME.fmu of FMI 3.0.
    """
    project.check_installed(NEEDED, "build")
    file, tables = Path(file), {}
    with suppress(OSError, ValueError, RecursionError):  # the program says what is wrong with them
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
        project.refuse_other(file, tables, "build")
    runtimes = project.runtimes(platforms, web)
    with temporary_folder() as work, _equations(file, tables) as equations:
        options = not (platforms or web), gradients, work
        kept, *fmus = _kept(equations, file, runtimes, *options, notes=lock)
        paths = Path(output) / fmus[0], Path(output) / fmus[1]
        # the cache may have it from a file of another name
        keeps = lock and not gradients  # which are not of the file
        made = {_lock(file): work / kept} if keeps else {}
        _put(made | dict(zip(paths, (work / name for name in fmus), strict=True)))
    return paths


@contextmanager
def _equations(file: Path, tables: dict[str, Any]) -> Iterator[Path]:
    """Yield a file with equations: this one, or what is made of that of an estimator."""
    if ESTIMATOR not in tables:
        yield file
        return
    from rparm.estimator.equations import write  # takes long

    with temporary_folder() as folder:
        equations = folder / file.name
        for warning in write(file, equations):
            print(f"{WARNING}{file}: {warning}", file=sys.stderr)
        if _lock(file).is_file():
            shutil.copyfile(_lock(file), _lock(equations))
        try:
            yield equations
        except UserError as error:
            raise UserError(f"{error}".replace(str(equations), str(file))) from None


def is_equations(file: Path) -> bool:
    """Return whether a file .toml has equations, and no system; UserError if it cannot be read."""
    found = read_toml(file) if Path(file).suffix.lower() == EQUATIONS else {}
    return project.is_of("build", found) and not project.is_system(found)


@contextmanager
def archive(
    file: Path, version: str = project.VERSIONS[0], gradients: Sequence[str] = ()
) -> Iterator[Path]:
    """Yield the FMU of a file with equations, in a temporary folder; another file as it is."""
    if Path(file).suffix.lower() != EQUATIONS:
        yield Path(file)
        return
    with temporary_folder() as folder:
        fmus = build(file, output=folder, lock=False, gradients=gradients)
        yield fmus[project.VERSIONS.index(version)]


def _lock(file: Path) -> Path:
    """Return the lock file of a file with equations."""
    return file.with_suffix(".lock.toml")


def _kept(
    file: Path,
    shown: Path,
    runtimes: list[Path],
    of_this_machine: bool,
    gradients: Sequence[str],
    work: Path,
    notes: bool,
) -> list[str]:
    """Make the lock file and the FMUs in the folder `work`, or take them from the cache.

    shown: the file of the user. notes: whether those are printed, not only warnings.
    """
    cache = build_cache.of_user()

    def parts() -> list[object]:
        if not cache.folder:
            return []
        found = build_cache.parts_of(file, runtimes, of_this_machine, NEEDED)
        return found and [*found, *gradients]

    lock = _lock(file)
    origin = parts()
    key = build_cache.key(origin, lock)
    found = cache.get(key) if origin else None
    if found is None:
        names, warnings = _made(file, runtimes, of_this_machine, gradients, work)
        found = {WARNINGS: warnings.encode("utf-8", "surrogateescape")}
        found |= {name: (work / name).read_bytes() for name in names}
        # a file may have changed in between
        if origin and build_cache.key(parts(), lock) == key:
            for of_lock in {key, build_cache.key(origin, work / names[0])}:
                cache.put(of_lock, found)
    warnings = found.pop(WARNINGS).decode("utf-8", "surrogateescape")
    for line in warnings.splitlines():
        kind = NOTE if line.startswith(NOTE) else WARNING
        if notes or kind == WARNING:
            print(line.replace(kind, f"{kind}{shown}: ", 1), file=sys.stderr)
    for name, content in found.items():
        (work / name).parent.mkdir(exist_ok=True)
        (work / name).write_bytes(content)
    return list(found)


def _made(
    file: Path, runtimes: list[Path], of_this_machine: bool, gradients: Sequence[str], work: Path
) -> tuple[list[str], str]:
    """Make the lock file and the FMUs in the folder `work`; their names, and warnings."""
    tool = project.model_builder()
    command = [sys.executable, tool, "--output", work, "--runtime", *runtimes]
    command += ["--of-this-machine"] if of_this_machine else []
    command += ["--gradients", *gradients] if gradients else []
    # zig keeps its C library in a cache; temporary files go to `work`, also of a killed program
    kept = os.environ.get("ZIG_GLOBAL_CACHE_DIR") or str(project.cache_folder("zig"))
    environment = {"ZIG_GLOBAL_CACHE_DIR": kept}
    environment |= dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(work))
    environment["PYTHONIOENCODING"] = "utf-8:surrogateescape"  # names of files may be no UTF-8
    environment = project.child_environment() | environment
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    text = {"encoding": "utf-8", "errors": "surrogateescape"}
    ended = run_group([*command, "--", file], env=environment, **pipes, **text)
    if ended.returncode:
        lines = ended.stderr.strip().splitlines() or [f"{tool} ended with {ended.returncode}"]
        raise UserError(one_line(lines[-1]))
    return ended.stdout.splitlines(), ended.stderr


def _put(files: dict[Path, Path]) -> None:
    """Copy files to the places that are their keys: all, or none if one fails."""
    for place in files:
        with written(place):
            if place.is_dir():  # else the others would be there when it fails
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    with uninterrupted(), ExitStack() as stack:
        for place, file in files.items():
            with written(place):
                place.parent.mkdir(parents=True, exist_ok=True)
                is_lock = file.suffix == ".toml" and place.is_file()
                if is_lock and file.read_bytes() == place.read_bytes():
                    continue  # a lock file that has all: its folder may be read-only
            stack.enter_context(written(place))
            shutil.copyfile(file, stack.enter_context(whole(place)))
