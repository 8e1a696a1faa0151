"""The FMUs of ./release.sh: what is in them, and their binaries as far as files show it."""

import hashlib
import json
import os
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path

import fmpy.validation
import lief
import pytest

from tests.fmu.symbols import check_elf, elementary_functions, standard
from tests.support.missing import missing
from tests.support.paths import NAMES, ROOT, SYSTEMS

BELOW = {"fmi2": "", "fmi3": "fmi3/"}  # folder of the archives of a version of FMI
# bytes of an FMU, by version, and of the wheel: what the page says
SIZES = re.findall(r"less than ([\d.]+) MB", (ROOT / "docs" / "release.md").read_text())
LARGEST = dict(zip(("fmi2", "fmi3", "wheel"), (1e6 * float(x) for x in SIZES), strict=True))

# what the loader of each platform has
KERNEL = re.compile(r"KERNEL32\.dll|api-ms-win-crt-[a-z]+-l1-1-0\.dll")


@pytest.fixture(scope="module")
def release(fmu: Path) -> Path:
    """Folder of the release of the built FMU."""
    folder = fmu.parent / "release"
    if not (folder / "SHA256SUMS").is_file():
        missing(f"{folder} has no release: ./release.sh builds it")
    return folder


EACH = [(version, name) for version in BELOW for name in NAMES]


@pytest.fixture(scope="module", params=EACH, ids=lambda each: "-".join(each))
def archive(request: pytest.FixtureRequest, release: Path) -> Iterator[zipfile.ZipFile]:
    version, name = request.param
    with zipfile.ZipFile(release / f"{BELOW[version]}{name}.fmu") as archive:
        yield archive


def name_of(archive: zipfile.ZipFile) -> str:
    return Path(archive.filename).stem


def version_of(archive: zipfile.ZipFile) -> str:
    return "fmi3" if Path(archive.filename).parent.name == "fmi3" else "fmi2"


def binary(archive: zipfile.ZipFile, folders: dict[str, str], suffix: str) -> bytes:
    return archive.read(f"binaries/{folders[version_of(archive)]}/{name_of(archive)}{suffix}")


# ---- The archives -------------------------------------------------------------------------------


def test_a_release_has_checksums_of_all_its_files(release: Path) -> None:
    lines = [line.split("  ") for line in (release / "SHA256SUMS").read_text().splitlines()]
    files = [
        path
        for pattern in ("*.fmu", "*.ssp", "*.tar.xz", "*.whl")
        for path in release.rglob(pattern)
    ]
    found = {path.relative_to(release).as_posix() for path in files}
    assert {name for _, name in lines} == found
    names = {*(f"{name}.ssp" for name in SYSTEMS), *(f"{name}.fmu" for name in NAMES)}
    (wheel,) = release.glob("*.whl")
    assert wheel.stat().st_size < LARGEST["wheel"]
    assert found == {
        wheel.name,
        "built.tar.xz",
        *(f"{below}{name}" for below in BELOW.values() for name in names),
    }
    for checksum, name in lines:
        assert hashlib.sha256((release / name).read_bytes()).hexdigest() == checksum, name


def test_the_bill_of_materials_names_what_is_compiled_in(release: Path, archive) -> None:
    bill = json.loads((release / "sbom.cdx.json").read_text())
    assert bill["bomFormat"] == "CycloneDX"
    components = {component["name"]: component for component in bill["components"]}
    file = Path(archive.filename).relative_to(release).as_posix()
    checksum = hashlib.sha256(Path(archive.filename).read_bytes()).hexdigest()
    assert components[file]["hashes"] == [{"alg": "SHA-256", "content": checksum}]
    used = next(d["dependsOn"] for d in bill["dependencies"] if d["ref"] == file)
    assert set(used) == {"SUNDIALS", "musl", "zig", "mingw-w64"}
    for name in used:
        assert re.fullmatch(r"\d+(\.\d+)+", components[name]["version"])
        license_text = archive.read(f"documentation/licenses/{name.lower()}.txt").decode()
        words = {"BSD-3-Clause": "BSD 3-Clause", "MIT": "Permission is hereby granted",
                 "ZPL-2.1": "Zope Public License"}  # fmt: skip
        assert words[components[name]["licenses"][0]["license"]["id"]] in license_text


def test_an_fmu_has_the_binaries_of_all_platforms_and_is_small(archive) -> None:
    name = name_of(archive)
    found = {entry for entry in archive.namelist() if entry.startswith("binaries/")}
    suffixes = {"linux": "so", "windows": "dll", "darwin": "dylib"}
    if version_of(archive) == "fmi3":
        processors = {"linux": ("x86_64", "aarch64"), "windows": ("x86_64",)}
        processors["darwin"] = processors["linux"]
        folders = [(f"{p}-{system}", system) for system in suffixes for p in processors[system]]
    else:
        folders = [("linux64", "linux"), ("aarch64-linux", "linux"), ("win64", "windows")]
        folders += [("darwin64", "darwin")]
    assert found == {f"binaries/{folder}/{name}.{suffixes[system]}" for folder, system in folders}
    assert Path(archive.filename).stat().st_size < LARGEST[version_of(archive)]


def test_the_standard_finds_no_fault(archive) -> None:
    assert fmpy.validation.validate_fmu(archive.filename) == []


def test_the_interface_is_that_of_the_fmu_for_one_platform(archive, fmu: Path) -> None:
    built_file = fmu.parent / BELOW[version_of(archive)] / Path(archive.filename).name
    with zipfile.ZipFile(built_file) as built:
        one = built.read("modelDescription.xml").decode()
    every = archive.read("modelDescription.xml").decode()
    if version_of(archive) == "fmi3":
        assert one == every  # sources/buildDescription.xml names the sources
        return
    files = r"\s*<SourceFiles>.*?</SourceFiles>\s*</(ModelExchange|CoSimulation)>"
    without = re.sub(files, "", every, flags=re.DOTALL)
    assert every != without
    assert re.search(r'guid="([^"]+)"', one)[1] == re.search(r'guid="([^"]+)"', every)[1]
    assert one.partition("<UnitDefinitions>")[2] == every.partition("<UnitDefinitions>")[2]


def test_no_file_names_the_machine_that_built_it(archive) -> None:
    for entry in archive.namelist():
        content = archive.read(entry)
        for path in (ROOT, Path.home() / ".cache"):
            assert os.fsencode(path) not in content, entry


# ---- Linux --------------------------------------------------------------------------------------


@pytest.fixture(params=[("linux64", "x86_64"), ("aarch64-linux", "aarch64")], ids=lambda p: p[0])
def elf(request: pytest.FixtureRequest, archive) -> lief.ELF.Binary:
    folder, machine = request.param
    folders = {"fmi2": folder, "fmi3": f"{machine}-linux"}
    parsed = lief.ELF.parse(list(binary(archive, folders, ".so")))
    assert parsed.header.machine_type == getattr(lief.ELF.ARCH, machine.upper())
    return parsed


def test_linux_library_is_as_it_must_be(elf: lief.ELF.Binary, archive) -> None:
    check_elf(elf, version_of(archive))


# ---- Windows ------------------------------------------------------------------------------------


@pytest.fixture
def pe(archive) -> lief.PE.Binary:
    return lief.PE.parse(list(binary(archive, {"fmi2": "win64", "fmi3": "x86_64-windows"}, ".dll")))


def test_windows_exports_the_functions_of_the_standard_only(pe: lief.PE.Binary, archive) -> None:
    assert pe.header.machine == lief.PE.Header.MACHINE_TYPES.AMD64
    assert {entry.name for entry in pe.get_export().entries} == standard(version_of(archive))


def test_windows_needs_nothing_to_be_installed(pe: lief.PE.Binary) -> None:
    """The C runtime of all Windows since 10, without its elementary functions."""
    needed = [library.name for library in pe.imports]
    assert needed
    for name in needed:
        assert KERNEL.fullmatch(name), name
        assert "math" not in name
    imported = {entry.name for library in pe.imports for entry in library.entries}
    assert not imported & elementary_functions()


def test_windows_loads_it_anywhere_and_runs_no_data(pe: lief.PE.Binary) -> None:
    found = set(pe.optional_header.dll_characteristics_lists)
    kinds = lief.PE.OptionalHeader.DLL_CHARACTERISTICS
    assert {kinds.DYNAMIC_BASE, kinds.HIGH_ENTROPY_VA, kinds.NX_COMPAT} <= found


# ---- macOS --------------------------------------------------------------------------------------


@pytest.fixture(params=[("x86_64", "X86_64"), ("aarch64", "ARM64")], ids=lambda p: p[0])
def macho(request: pytest.FixtureRequest, archive) -> lief.MachO.Binary:
    processor, header = request.param
    folders = {"fmi2": "darwin64", "fmi3": f"{processor}-darwin"}
    parsed = lief.MachO.parse(list(binary(archive, folders, ".dylib")))
    assert parsed.size == (2 if version_of(archive) == "fmi2" else 1)
    return parsed.take(getattr(lief.MachO.Header.CPU_TYPE, header))


def test_macos_exports_the_functions_of_the_standard(macho: lief.MachO.Binary, archive) -> None:
    """And two names that its linker adds to every library."""
    exported = {symbol.name for symbol in macho.exported_symbols}
    expected = {f"_{name}" for name in standard(version_of(archive))}
    assert exported == expected | {"___dso_handle", "__mh_dylib_header"}


def test_macos_needs_version_11_and_its_system_library(macho: lief.MachO.Binary, archive) -> None:
    oldest = macho.build_version.minos if macho.has_build_version else macho.version_min.version
    assert list(oldest) == [11, 0, 0]
    own = f"@rpath/{name_of(archive)}.dylib"
    assert {library.name for library in macho.libraries} == {own, "/usr/lib/libSystem.B.dylib"}
    imported = {symbol.name.removeprefix("_") for symbol in macho.imported_symbols}
    assert "malloc" in imported
    assert not imported & elementary_functions()


def test_macos_on_arm_loads_signed_code_only(macho: lief.MachO.Binary) -> None:
    if macho.header.cpu_type == lief.MachO.Header.CPU_TYPE.ARM64:
        assert macho.has_code_signature
