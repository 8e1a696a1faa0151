"""Functions of libraries: what nm lists, those of the standard and of the system's libm; and what a
library for Linux must be."""

import ctypes
import re
from pathlib import Path

import lief

from tests.support.paths import FMI_HEADERS
from tests.support.programs import run_checked

COUNTS = {"fmi2": 44, "fmi3": 75}
GLIBC = (2, 17)  # as README.md says


def listed(*arguments: object, tools: str = "") -> set[str]:
    """Names that nm lists, without their versions and the names of these; `tools`: its prefix."""
    lines = (line.split() for line in run_checked(f"{tools}nm", *arguments).splitlines())
    return {line[-1].partition("@")[0] for line in lines if len(line) > 1 and line[-2] != "A"}


def standard(version: str) -> set[str]:
    """Functions of "fmi2" or "fmi3", by its header."""
    header = (FMI_HEADERS / f"{version}Functions.h").read_text()
    names = set(re.findall(rf"{version}FullName\(({version}\w+)\)", header))
    assert len(names) == COUNTS[version]
    return names


def libm() -> set[str]:
    """Functions of the system's libm."""
    ctypes.CDLL("libm.so.6")
    path = re.search(r"/\S*/libm\.so\.6", Path("/proc/self/maps").read_text()).group()
    names = listed("--dynamic", "--defined-only", path)
    assert {"sin", "sincos", "pow", "sqrt", "fmin"} <= names
    return names


def elementary_functions() -> set[str]:
    """Names in the system's libm, and those that a compiler may call instead."""
    return libm() | {"__sincos_stret", "__sincosf_stret", "__exp10"}


def check_elf(elf: lief.ELF.Binary, version: str) -> None:
    """Fail unless a library for Linux exports the standard's functions only, needs an old libc and
    nothing else, names no folder to load from, and is read-only where it can be."""
    assert {symbol.name for symbol in elf.exported_symbols} == standard(version)
    assert list(elf.libraries) == ["libc.so.6"]
    needed = [v.name for n in elf.symbols_version_requirement for v in n.get_auxiliary_symbols()]
    versions = [tuple(map(int, x.removeprefix("GLIBC_").split("."))) for x in needed]
    assert versions and max(versions) <= GLIBC
    assert not {symbol.name for symbol in elf.imported_symbols} & elementary_functions()
    tag, kind = lief.ELF.DynamicEntry.TAG, lief.ELF.Segment.TYPE
    assert not {entry.tag for entry in elf.dynamic_entries} & {tag.RPATH, tag.RUNPATH, tag.TEXTREL}
    # relocations are read-only once it is loaded, and then all are done
    assert elf.get(tag.FLAGS_1).has(lief.ELF.DynamicEntryFlags.FLAG.NOW)
    assert {kind.LOAD, kind.GNU_STACK, kind.GNU_RELRO} <= {segment.type for segment in elf.segments}
    both = lief.ELF.Segment.FLAGS.W | lief.ELF.Segment.FLAGS.X
    assert elf.has_nx and not [s for s in elf.segments if s.flags & both == both]
