"""The platforms of a release FMU: where their libraries lie, how the host for each is compiled, and
what runs it here."""

import functools
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

from tests.equations.examples import build
from tests.platforms.model import Model, read_model
from tests.support.missing import missing
from tests.support.paths import EXAMPLES, FMI_HEADERS, ROOT

BUILD = ROOT / "build"
NATIVE_HOST = (
    Path(os.environ.get("RP_FMU", BUILD / "RPManipulator.fmu")).parent / "tests/platform_host"
)
# of builds for one platform, of the hosts, and of wine
SCRATCH = BUILD / "platforms"
HOST_SOURCES = ("platform_host.c", "runs.c")
TIME_LIMIT = 900.0  # s; zig makes its C library for Windows when it is asked for the first time


@dataclass(frozen=True)
class Platform:
    """A row of the table."""

    name: str
    folder: str  # of the library in an FMU of FMI 2.0
    suffix: str  # of the library
    system: str  # platform.system() and platform.machine() where it runs without an emulator
    machine: str
    preset: str  # of CMakePresets.json that builds it with zig
    compiler: str  # where zig is not installed
    emulator: tuple[str, ...]


# macOS is not in the table: nothing here runs its binaries.
PLATFORMS = (
    Platform(
        name="linux64", folder="linux64", suffix=".so", system="Linux", machine="x86_64",
        preset="x86_64-linux", compiler="x86_64-linux-gnu-gcc",
        emulator=("qemu-x86_64-static", "-L", "/usr/x86_64-linux-gnu"),
    ),
    Platform(
        name="win64", folder="win64", suffix=".dll", system="Windows", machine="AMD64",
        preset="x86_64-windows", compiler="x86_64-w64-mingw32-gcc",
        emulator=("wine",),
    ),
    Platform(
        name="aarch64-linux", folder="aarch64-linux", suffix=".so",
        system="Linux", machine="aarch64",
        preset="aarch64-linux", compiler="aarch64-linux-gnu-gcc",
        emulator=("qemu-aarch64-static", "-L", "/usr/aarch64-linux-gnu"),
    ),
)  # fmt: skip


class Missing(Exception):
    """Something that a platform needs is not here."""


# ---- What is there -------------------------------------------------------------------------------


def archive_with(row: Platform, name: str) -> Path:
    """The FMU with the library of this platform: a release, or a build for this platform only."""
    if name in EXAMPLES:
        return example(name)
    places = (BUILD / "release" / f"{name}.fmu", SCRATCH / row.preset / f"{name}.fmu")
    for place in places:
        if place.is_file():
            with zipfile.ZipFile(place) as archive:
                if f"binaries/{row.folder}/{name}{row.suffix}" in archive.namelist():
                    refuse_older(place)
                    return place
    raise Missing(f"no FMU with a library for {row.name}: ./release.sh builds them")


@functools.cache
def example(name: str) -> Path:
    """The FMU of an example for all platforms, as users build one."""
    built = BUILD / "release" / "built.tar.xz"
    if not built.is_file():
        raise Missing("what FMUs for other platforms are linked with: ./release.sh builds it")
    refuse_older(built)
    output = SCRATCH / "examples" / name
    output.mkdir(parents=True, exist_ok=True)
    return build(ROOT / EXAMPLES[name], output, "--platforms")


@functools.cache
def newest_source() -> float:
    """When a source of the FMUs was changed last."""
    return max(
        path.stat().st_mtime
        for folder in ("src", "fmu", "models")
        for path in (ROOT / folder).rglob("*")
        if path.suffix in {".c", ".h"} or path.name == f"{path.parent.name}.toml"
    )


def refuse_older(fmu: Path) -> None:
    # the newest file beside it: an FMU that a change does not concern is not made again
    if max(path.stat().st_mtime for path in fmu.parent.iterdir()) < newest_source():
        raise Missing(f"{fmu.relative_to(ROOT)} is older than the sources: ./release.sh")


def emulator_of(row: Platform) -> tuple[str, ...]:
    if (platform.system(), platform.machine()) == (row.system, row.machine):
        return ()
    if shutil.which(row.emulator[0]) is None:
        raise Missing(f"{row.emulator[0]}, which runs {row.name}: ./setup.sh --platforms")
    return row.emulator


def compiler_of(row: Platform) -> list[str]:
    if importlib.util.find_spec("ziglang") is not None:
        presets = json.loads((ROOT / "CMakePresets.json").read_text())["configurePresets"]
        (preset,) = (each for each in presets if each["name"] == row.preset)
        target = preset["cacheVariables"]["ZIG_TARGET"]
        return [sys.executable, "-m", "ziglang", "cc", "-target", target]
    if shutil.which(row.compiler) is not None:
        return [row.compiler]
    raise Missing(f"zig or {row.compiler}, for the host of {row.name}: ./setup.sh --platforms")


@functools.cache
def host_of(row: Platform) -> Path:
    """The host for a platform, compiled if it is older than its sources."""
    sources = Path(__file__).parent
    host = SCRATCH / "hosts" / row.name / "platform_host.exe"
    command = compiler_of(row)
    changed = max(path.stat().st_mtime for path in sources.glob("*.[ch]"))
    if host.is_file() and host.stat().st_mtime > changed:
        return host
    host.parent.mkdir(parents=True, exist_ok=True)
    # -O3 and -s as for the release: zig has the C library for these options
    command += ["-std=c17", "-O3", "-s", "-isystem", str(FMI_HEADERS), "-o", str(host)]
    command += ["-I", str(ROOT / "fmu" / "fmi2")]  # fmi2_functions.h
    command += [str(sources / name) for name in HOST_SOURCES]
    if row.system == "Linux":
        command += ["-pthread", "-ldl"]
    finish(command, host.parent)
    return host


# ---- Running it ----------------------------------------------------------------------------------


def finish(command: list[str], folder: Path) -> None:
    """Run a program that must succeed."""
    environment = os.environ | {
        "WINEPREFIX": str(SCRATCH / "wine"),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree,mshtml=",  # asks for nothing to be installed
    }
    for kind in ("GLOBAL", "LOCAL"):
        environment.setdefault(f"ZIG_{kind}_CACHE_DIR", str(BUILD / "zig"))
    environment.pop("DISPLAY", None)
    # into a file: what wine leaves running for a while would keep a pipe open
    log = folder / "output.txt"
    with log.open("w") as output:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            timeout=TIME_LIMIT,
            check=False,
        )
    assert done.returncode == 0, f"{' '.join(command)}\n{log.read_text(errors='replace')}"


class Runner:
    """The library of one FMU on one platform; the native one if there is no row."""

    def __init__(
        self, row: Platform | None, name: str, fmu: Path, folder: Path, archive: Path | None = None
    ) -> None:
        """`fmu` is the native one; `folder` takes libraries and transcripts.

        `archive` has the library of the row; without it the release has.
        """
        self.row = row
        self.name = row.name if row else "native"
        self.model: Model = read_model(fmu)
        self.folder = folder / self.name / name
        self.folder.mkdir(parents=True, exist_ok=True)
        if row is None:
            self.command = [str(NATIVE_HOST)]
            archive, member = fmu, native_member(fmu)
        else:
            self.command = [*emulator_of(row), str(host_of(row))]
            archive = archive or archive_with(row, name)
            member = f"binaries/{row.folder}/{name}{row.suffix}"
        self.library = f"./{Path(member).name}"  # dlopen searches for names without a folder
        with zipfile.ZipFile(archive) as opened:
            (self.folder / self.library).write_bytes(opened.read(member))

    def recompile(self) -> None:
        """Replace the library by one that the row's gcc makes of the sources in the release.

        As a foreign build does it: every file by itself, with no options but the folder of FMI's
        headers, and -fPIC on Linux.
        """
        row = self.row
        assert row is not None
        if shutil.which(row.compiler) is None:
            raise Missing(f"{row.compiler}: ./setup.sh --platforms")
        with zipfile.ZipFile(archive_with(row, self.model.name)) as opened:
            names = [name for name in opened.namelist() if name.startswith("sources/")]
            opened.extractall(self.folder, names)
        sources = self.folder / "sources"
        files = sorted(path.name for path in sources.glob("*.c"))
        position = [] if row.system == "Windows" else ["-fPIC"]
        finish([row.compiler, *position, f"-I{FMI_HEADERS}", "-c", *files], sources)
        objects = [path.name for path in sorted(sources.glob("*.o"))]
        (self.folder / self.library).unlink()
        finish([row.compiler, "-shared", "-o", f"../{self.library}", *objects], sources)

    def run(self, *runs: str) -> list[bytes]:
        """Transcripts of runs that platform_host.c knows, each made in a separate thread."""
        (self.folder / "model").write_text(self.model.text(), encoding="utf-8", newline="\n")
        arguments = [word for i, run in enumerate(runs) for word in (run, f"{i}.transcript")]
        finish([*self.command, self.library, "model", *arguments], self.folder)
        return [(self.folder / f"{i}.transcript").read_bytes() for i in range(len(runs))]


def native_member(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        (member,) = (
            name for name in archive.namelist() if name.startswith("binaries/") and name[-1] != "/"
        )
    return member


def runner(
    row: Platform | None, name: str, fmu: Path, folder: Path, *, recompiled: bool = False
) -> Runner:
    """A Runner, or a skipped test that says what is missing; in CI nothing may be."""
    try:
        made = Runner(row, name, fmu.with_name(f"{name}.fmu"), folder)
        if recompiled:
            made.recompile()
        return made
    except Missing as error:
        missing(f"missing: {error}")
