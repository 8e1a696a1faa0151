"""The sources of the FMUs: built by others' tools, with the bits of the build."""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
import pytest

from tests.fmu.symbols import libm, listed, standard
from tests.rp_manipulator.random_motions import random_case, simulate
from tests.support.instances import Instance, LoadedFmu
from tests.support.missing import missing
from tests.support.paths import EVERY, FMI_HEADERS, FOLDERS, ROOT
from tests.support.programs import run_checked
from tests.support.rparm_project import load

TAYLOR = {"RPManipulator"}  # compared with the Taylor method, too
STEPS = 250  # of each scenario
LARGEST = 500_000  # bytes of an FMU without binaries

# of the C runtime of mingw, which is linked statically: they look at bits
CLASSIFICATIONS = {"__fpclassify", "__isnan", "__signbit"}

# of x86 and Arm: multiply and add, rounded once
FUSED = re.compile(r"\tv?fn?m(?:add|sub)\w*|\tfml[as]\w*|\tfcm(?:la|ul)\w*")


@pytest.fixture(scope="module")
def releases(fmu: Path) -> dict[str, Path]:
    """Folders with sources/ and the description of each FMU, made by the build."""
    targets = [f"{name}_sources" for name in EVERY]
    run_checked("cmake", "--build", fmu.parent, "--target", *targets)
    return {name: fmu.parent / "fmu" / name / "release" for name in EVERY}


def scenarios_of(loaded: LoadedFmu) -> list[str]:
    """Two scenarios of the model without Booleans, which `trace` does not set."""
    description = loaded.description
    booleans = {v.name for v in description.modelVariables if v.type == "Boolean"}
    folder = ROOT / "models" / FOLDERS[description.modelName] / "scenarios"
    scenarios = (load(path.stem) for path in sorted(folder.glob("*.toml")))
    names = [
        s.name for s in scenarios if booleans.isdisjoint((*s.inputs, *s.parameters, *s.initial))
    ]
    return [names[len(names) // 2], names[-1]]


# ---- The same bits ------------------------------------------------------------------------------


def trace(loaded: LoadedFmu, name: str, method: int) -> Iterator[bytes]:
    """All values after each step of a scenario, then the serialized state and the messages."""
    types = {variable.name: variable.type for variable in loaded.description.modelVariables}
    scenario = load(name)
    with Instance(loaded, logging_on=True) as instance:
        for variable, value in (scenario.parameters | scenario.initial).items():
            setter = "setReal" if types[variable] == "Real" else "setInteger"
            getattr(instance.fmi, setter)([loaded.references[variable]], [value])
        if "solver_method" in types:
            instance.fmi.setInteger([loaded.references["solver_method"]], [method])
        instance.initialize(start=scenario.start, tolerance=scenario.tolerance)
        for i in range(min(STEPS, len(scenario.times) - 1)):
            t, end = scenario.times[i : i + 2]
            instance.set(**{name: values[i] for name, values in scenario.inputs.items()})
            instance.step(t, end - t)
            yield instance.everything()
        state = instance.fmi.getFMUState()
        yield bytes(instance.fmi.serializeFMUState(state))
        instance.fmi.freeFMUState(state)
        yield repr(instance.messages).encode()


def assert_same_bits(built: LoadedFmu, rebuilt: LoadedFmu) -> None:
    """Of every value in every scenario with every method, of states and messages."""
    for scenario in scenarios_of(built):
        for method in (1, 2, 3, 4) if built.description.modelName in TAYLOR else (1, 2, 3):
            expected = list(trace(built, scenario, method))
            assert len(set(expected)) > len(expected) / 2  # it moves
            assert list(trace(rebuilt, scenario, method)) == expected, (scenario, method)


@pytest.fixture(scope="module")
def built(fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, LoadedFmu]:
    """The FMUs of the build."""
    folder = tmp_path_factory.mktemp("built")
    return {name: LoadedFmu(fmu.with_name(f"{name}.fmu"), folder / name) for name in EVERY}


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_sources_and_description_stay_small(fmu: Path, tmp_path: Path, version: str) -> None:
    inner = "fmi3" if version == "fmi3" else ""
    targets = [f"{name}_{inner}_sources".replace("__", "_") for name in EVERY]
    run_checked("cmake", "--build", fmu.parent, "--target", *targets)
    sizes = {}
    for name in EVERY:
        release = fmu.parent / "fmu" / name / inner / "release"
        archive = tmp_path / f"{name}.fmu"
        entries = [f"{part}={release / part}" for part in ("modelDescription.xml", "sources")]
        run_checked(sys.executable, ROOT / "fmu" / "package.py", archive, *entries)
        sizes[name] = archive.stat().st_size
    assert max(sizes.values()) < LARGEST, sizes


@pytest.mark.parametrize("inner", ["", "fmi3"])
def test_fmpy_compiles_an_fmu_without_binaries(fmu: Path, tmp_path: Path, inner: str) -> None:
    """That of FMI 3.0 by its buildDescription.xml, with fmpy's own headers of FMI."""
    target = f"RPManipulator_{inner}_sources".replace("__", "_")
    run_checked("cmake", "--build", fmu.parent, "--target", target)
    release = fmu.parent / "fmu" / "RPManipulator" / inner / "release"
    assert not list(release.rglob("fmi?Functions.h"))
    archive, command = tmp_path / "RPManipulator.fmu", Path(sys.executable).parent / "fmpy"
    entries = [f"{name}={release / name}" for name in ("modelDescription.xml", "sources")]
    run_checked(sys.executable, ROOT / "fmu" / "package.py", archive, *entries)
    assert "No problems found." in run_checked(command, "validate", archive)
    options = ["--configuration", "Debug"]  # compiles three times faster than Release
    run_checked(command, "compile", archive, *options, CMAKE_BUILD_PARALLEL_LEVEL="2")
    start = {"q1": 0.3, "tau1": 2.0}
    built, compiled = (
        fmpy.simulate_fmu(str(path), stop_time=2.0, output_interval=0.01, start_values=start)
        for path in (fmu.parent / inner / archive.name, archive)
    )
    assert built["q1"][-1] != built["q1"][0]
    assert built.tobytes() == compiled.tobytes()


# ---- Plain compilers ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Build:
    """All C files of an FMU, each compiled by itself with the headers of FMI, and linked."""

    fmu: str
    compiler: str
    options: tuple[str, ...]
    tools: str = ""  # prefix of nm and objdump

    def __str__(self) -> str:
        return f"{self.compiler} {' '.join(self.options)}"


BUILDS = (
    Build("RPManipulator", "gcc", ("-O1", "-fPIC")),
    Build("RPPlant", "gcc", ("-O2", "-fPIC")),
    Build("RPTrajectory", "clang", ("-fPIC",)),
    Build("RPManipulator", "aarch64-linux-gnu-gcc", ("-O2", "-fPIC"), "aarch64-linux-gnu-"),
    Build("RPManipulator", "x86_64-w64-mingw32-gcc", (), "x86_64-w64-mingw32-"),
)
ELF = [build for build in BUILDS if "-fPIC" in build.options]
NATIVE = [build for build in BUILDS if not build.tools]
ARM = [build for build in BUILDS if "aarch64" in build.compiler]
WINDOWS = [build for build in BUILDS if "mingw" in build.compiler]


def compiled(compiler: str, options: tuple[str, ...], files: list[Path], folder: Path) -> None:
    """Compile files to objects in the folder, in two processes."""
    if not shutil.which(compiler):
        missing(f"{compiler} is not installed: ./setup.sh --platforms installs it")
    command = [compiler, *options, f"-I{FMI_HEADERS}", "-c"]
    with ThreadPoolExecutor(2) as executor:
        halves = [
            executor.submit(run_checked, *command, *files[i::2], folder=folder) for i in (0, 1)
        ]
        for half in halves:
            half.result()


@pytest.fixture(scope="module")
def libraries() -> dict[Build, Path]:
    """Libraries that were built, each in a folder with its objects; filled by `library`."""
    return {}


@pytest.fixture
def library(
    request: pytest.FixtureRequest,
    releases: dict[str, Path],
    libraries: dict[Build, Path],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """The library of the Build that the test is given."""
    build: Build = request.param
    if build not in libraries:
        folder = tmp_path_factory.mktemp("objects")
        files = sorted((releases[build.fmu] / "sources").glob("*.c"))
        compiled(build.compiler, build.options, files, folder)
        path = folder / f"{build.fmu}.library"
        run_checked(build.compiler, "-shared", "-o", path, *sorted(folder.glob("*.o")))
        libraries[build] = path
    return libraries[build]


def each(builds: tuple[Build, ...] | list[Build]) -> pytest.MarkDecorator:
    """Run a test on the libraries of these builds."""
    pairs = [(build, build) for build in builds]
    return pytest.mark.parametrize(
        ("build", "library"), pairs, indirect=["library"], ids=[str(build) for build in builds]
    )


@each(NATIVE)
def test_a_plain_compiler_gives_the_same_bits(
    build: Build, library: Path, built: dict[str, LoadedFmu], tmp_path: Path
) -> None:
    unpacked = Path(shutil.copytree(built[build.fmu].folder, tmp_path / "unpacked"))
    shutil.copy(library, unpacked / "binaries" / "linux64" / f"{build.fmu}.so")
    assert_same_bits(built[build.fmu], LoadedFmu(unpacked, unpacked))


# what a step by the Taylor series runs through
TAYLOR_FILES = ("generated_equations", "history", "method_taylor", "musl_*", "taylor_series")


def random_motions(loaded: LoadedFmu) -> list[bytes]:
    """States of motions by the Taylor series, with cubic inputs."""
    random = np.random.default_rng(5)
    return [simulate(loaded, random_case(random)).tobytes() for _ in range(200)]


@pytest.mark.parametrize(("compiler", "option"), [("gcc", "-O3"), ("clang", "-O2")])
@each([Build("RPManipulator", "gcc", ("-O1", "-fPIC"))])
def test_every_optimizer_gives_the_same_series(
    build: Build,
    library: Path,
    built: dict[str, LoadedFmu],
    releases: dict[str, Path],
    tmp_path: Path,
    compiler: str,
    option: str,
) -> None:
    sources = releases[build.fmu] / "sources"
    files = sorted(path for name in TAYLOR_FILES for path in sources.glob(f"{name}.c"))
    assert {"method_taylor.c", "generated_equations.c", "musl_sin.c"} <= {
        path.name for path in files
    }
    objects = tmp_path / "objects"
    shutil.copytree(library.parent, objects, ignore=shutil.ignore_patterns("*.library"))
    compiled(compiler, (option, "-fPIC"), files, objects)
    unpacked = Path(shutil.copytree(built[build.fmu].folder, tmp_path / "unpacked"))
    target = unpacked / "binaries" / "linux64" / f"{build.fmu}.so"
    run_checked(compiler, "-shared", "-o", target, *sorted(objects.glob("*.o")))
    rebuilt = LoadedFmu(unpacked, unpacked)
    assert random_motions(rebuilt) == random_motions(built[build.fmu])
    for scenario in scenarios_of(built[build.fmu]):
        assert list(trace(rebuilt, scenario, 4)) == list(trace(built[build.fmu], scenario, 4))


@each(BUILDS)
def test_no_function_of_libm_is_called(build: Build, library: Path) -> None:
    objects = sorted(library.parent.glob("*.o"))
    called = listed("--undefined-only", *objects, tools=build.tools)
    assert {"fmu_sin", "malloc", "memcpy"} <= called
    assert called & libm() <= (CLASSIFICATIONS if "mingw" in build.compiler else set())


@each(ELF)
def test_the_functions_of_the_standard_are_exported_and_no_others(
    build: Build, library: Path
) -> None:
    assert listed("--dynamic", "--defined-only", library, tools=build.tools) == standard("fmi2")


@each(WINDOWS)
def test_so_are_they_on_windows(build: Build, library: Path) -> None:
    listing = run_checked(f"{build.tools}objdump", "--private-headers", library)
    table = listing.partition("[Ordinal/Name Pointer] Table")[2].partition("\n\n")[0]
    assert set(re.findall(r"\[ *\d+\].* (\w+)$", table, re.MULTILINE)) == standard("fmi2")


# ---- Fused operations ---------------------------------------------------------------------------


@each(ARM)
def test_nothing_is_fused_on_arm(build: Build, library: Path) -> None:
    code = run_checked(f"{build.tools}objdump", "--disassemble", library)
    assert "\tfmul\t" in code
    assert not FUSED.search(code)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_nothing_is_fused_where_the_processor_could(
    releases: dict[str, Path], tmp_path: Path, compiler: str
) -> None:
    sources = releases["RPManipulator"] / "sources"
    patterns = ("generated_equations.c", "musl_*.c", "small_vector.c", "sundials_nvector_*.c")
    files = sorted(path for pattern in patterns for path in sources.glob(pattern))
    compiled(compiler, ("-O3", "-march=haswell", "-fPIC"), files, tmp_path)
    code = run_checked("objdump", "--disassemble", *sorted(tmp_path.glob("*.o")))
    assert "\tvmulsd " in code
    assert not FUSED.search(code)


def test_fast_math_is_refused(releases: dict[str, Path], tmp_path: Path) -> None:
    source = releases["RPManipulator"] / "sources" / "history.c"
    command = ["gcc", "-ffast-math", "-c", source, "-o", tmp_path / "history.o"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode != 0
    assert "#error" in result.stderr and "-ffast-math" in result.stderr


# ---- The description ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", EVERY)
def test_the_description_names_the_files_and_differs_in_nothing_else(
    releases: dict[str, Path], fmu: Path, tmp_path: Path, name: str
) -> None:
    release = releases[name]
    files = sorted(path.name for path in (release / "sources").glob("*.c"))
    root = ET.parse(release / "modelDescription.xml").getroot()
    for kind in ("ModelExchange", "CoSimulation"):
        interface = root.find(kind)
        assert [file.get("name") for file in interface.iterfind("SourceFiles/File")] == files
        interface.remove(interface.find("SourceFiles"))
    with zipfile.ZipFile(fmu.with_name(f"{name}.fmu")) as archive:
        plain = archive.read("modelDescription.xml").decode()
        assert not [entry for entry in archive.namelist() if entry.startswith("sources/")]
    expected, found = (
        ET.canonicalize(text, strip_text=True) for text in (plain, ET.tostring(root))
    )
    assert found == expected


@pytest.mark.parametrize("name", EVERY)
def test_no_file_names_a_path_of_the_machine(
    releases: dict[str, Path], fmu: Path, name: str
) -> None:
    for path in (releases[name] / "sources").rglob("*"):
        if path.is_file():
            content = path.read_bytes()
            assert not re.search(rb'# *include *[<"]/', content), path
            for folder in (ROOT, fmu.parent):
                assert os.fsencode(folder) not in content, path
