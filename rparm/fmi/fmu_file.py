"""FMUs as files: checked, read and unpacked once, for any number of runs; archives and their XML.

Archives, SSPs too, may be hostile: they are refused before they fill the disk, write outside of
their folder, mean another thing on another system or crash the process.
"""

import errno
import re
import stat
import struct
import unicodedata
import zipfile
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ModelDescription, ValidationError
from lxml import etree

from rparm import building
from rparm.errors import UserError, one_line, placed, reason
from rparm.files import UnreadableError, check_regular, is_file, show
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.model import Model, described
from rparm.fmi.versions import Fmi2Instance, Fmi2ModelExchange, Fmi3Instance, Fmi3ModelExchange
from rparm.interruption import temporary_folder
from rparm.project import VERSIONS

LARGEST_CONTENT = 2**30  # bytes of all files in an archive
LARGEST_SYSTEM = 2**32  # bytes of all files in the FMUs of an SSP
LARGEST_XML = 64_000_000  # bytes; parsed it takes some twenty times as much memory
MOST_FILES = 10_000  # in an archive
LONGEST_NAME = 400  # characters of a path in an archive, each other of which may be a folder
# of FMI and SSP; zipfile unpacks others without a limit of memory
METHODS = {zipfile.ZIP_STORED: "stored", zipfile.ZIP_DEFLATED: "deflate"}
ENCRYPTED = 0x1 | 0x40 | 0x2000  # flags: encrypted, strongly, with a hidden directory
CONTROL = ("Cc", "Cs", "Zl", "Zp")  # categories of characters that end lines or control a terminal
DESCRIPTION = "modelDescription.xml"
LIBRARY_SUFFIX = fmpy.sharedLibraryExtension  # of this platform
CO_SIMULATION, MODEL_EXCHANGE = "co-simulation", "model exchange"
INSTANCES: dict[tuple[str, str], type[Instance]] = {
    ("2.0", CO_SIMULATION): Fmi2Instance,
    ("3.0", CO_SIMULATION): Fmi3Instance,
    ("2.0", MODEL_EXCHANGE): Fmi2ModelExchange,
    ("3.0", MODEL_EXCHANGE): Fmi3ModelExchange,
}
SOURCES = "sources/"  # no run needs them
BINARY, SOURCE = re.compile(r"binaries/[^/]+/[^/]+"), re.compile(r"sources/.+\.c")


# ---- Archives ------------------------------------------------------------------------------------
def unpack(
    path: Path, folder: Path, kind: str, only: str | None = None, without: str = ""
) -> dict[str, int]:
    """Unpack an archive to an empty folder; bytes of all files by path, or UnreadableError.

    If asked for, it is `only` one file, or all but those in a folder.
    """
    check_regular(path)
    if path.is_dir():
        raise UnreadableError(f"is a folder, expected an {kind}")
    where = ""
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            _check(entries)
            for entry in entries:
                left_out = without and entry.filename.startswith(without)
                if only in (None, entry.filename) and not left_out:
                    where = f"{_shown(entry.filename)} "
                    file = Path(archive.extract(entry, folder))
                    size = file.stat().st_size if is_file(file) else entry.file_size
                    if size != entry.file_size:
                        raise zipfile.BadZipFile(f"{size} bytes, expected {entry.file_size}")
    except (UnreadableError, MemoryError):
        raise
    except Exception as error:  # zipfile and its decoders raise many
        if isinstance(error, OSError) and error.errno != errno.EINVAL:  # not of a wrong offset
            wrong = f"{where}cannot be {'unpacked' if where else 'read'}"
        else:
            wrong = f"{where}is damaged" if where else f"not an {kind}, a zip archive, or damaged"
        raise UnreadableError(f"{wrong}: {one_line(reason(error))}") from error
    return {entry.filename: entry.file_size for entry in entries if not entry.is_dir()}


def read_xml(path: Path) -> etree._ElementTree:
    """Parse an unpacked XML file; UnreadableError if it is none, too large, or has a DOCTYPE."""
    size = path.stat().st_size
    if size > LARGEST_XML:
        most = f"expected at most {LARGEST_XML / 1e6:.0f} MB"
        raise UnreadableError(f"has {size / 1e6:.0f} MB, {most}")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True)
    try:  # from bytes: given a name, libxml2 takes it for a URL
        tree = etree.fromstring(path.read_bytes(), parser).getroottree()
    except etree.XMLSyntaxError as error:
        raise UnreadableError(f"not valid XML: {one_line(error.msg)}") from error
    if tree.docinfo.doctype:
        raise UnreadableError("has a DOCTYPE, leave it out")
    return tree


def wrong_name(name: str) -> str:
    """Say why the name of a file can be no path in an archive, or nothing."""
    if len(name) > LONGEST_NAME:
        return f"has a name of {len(name)} characters, expected at most {LONGEST_NAME}"
    if any(unicodedata.category(character) in CONTROL for character in name):
        return "has a control character in its name"
    parts = name.split("/")
    if name.startswith(("/", "\\")) or ":" in name or any(map(_leads_up, parts + name.split("\\"))):
        return "would lie outside of its folder"
    if "\\" in name:
        return "has a backslash in its name, expected / between folders"
    return "" if set(parts) - {"", "."} else "is no name of a file"


def check_library(path: Path) -> None:
    """Refuse a shared object (ELF, 64 bit) that is cut off: it would kill the process."""
    with path.open("rb") as file:
        header = file.read(64)
        if header[:6] != b"\x7fELF\x02\x01" or len(header) < 64:
            return  # of another kind: the loader says what is wrong
        table = struct.unpack_from("<Q", header, 32)[0]
        entry_size, count = struct.unpack_from("<HH", header, 54)
        size = path.stat().st_size
        if table + entry_size * count > size:
            raise UnreadableError(f"is cut off: {size} bytes")
        file.seek(table)
        entries = file.read(entry_size * count)
    for at in range(0, len(entries) - 39, max(entry_size, 40)):
        kind, _, offset, _, _, length = struct.unpack_from("<IIQQQQ", entries, at)
        if kind == 1 and offset + length > size:
            raise UnreadableError(f"is cut off: {size} bytes, {offset + length} are loaded")


def _check(entries: Sequence[zipfile.ZipInfo]) -> None:
    """Refuse what is wrong with an archive by its directory."""
    if len(entries) > MOST_FILES:
        raise UnreadableError(f"has {len(entries)} files inside, expected at most {MOST_FILES}")
    # unpacking ends at the sizes that the archive declares: they can be relied on
    content = sum(entry.file_size for entry in entries)
    if content > LARGEST_CONTENT:
        most = f"expected at most {LARGEST_CONTENT / 1e6:.0f} MB"
        raise UnreadableError(f"has {content / 1e6:.0f} MB inside, {most}")
    places: dict[tuple[str, ...], zipfile.ZipInfo] = {}
    for entry in entries:
        # zipfile cuts the name at a null character, and may take another one from an extra field
        original = entry.orig_filename
        wrong = wrong_name(original) or wrong_name(entry.filename) or _wrong_entry(entry)
        if wrong:
            raise UnreadableError(f"{_shown(original)} {wrong}")
        other = places.setdefault(_place(entry.filename), entry)
        if other is not entry and not (other.is_dir() and entry.is_dir()):
            if other.filename == entry.filename:
                raise UnreadableError(f"{_shown(entry.filename)} is there twice")
            both = f"{_shown(other.filename)} and {_shown(entry.filename)}"
            raise UnreadableError(f"{both} are one file on some systems")
    for place, entry in places.items():
        for length in range(1, len(place)):
            above = places.get(place[:length])
            if above is not None and not above.is_dir():
                folder = f"a folder of {_shown(entry.filename)}"
                raise UnreadableError(f"{_shown(above.filename)} is a file, and {folder}")


def _leads_up(part: str) -> bool:
    """Return whether it is "..", or is so where blanks and dots at its end are dropped."""
    return len(part) > 1 and not part.strip(" .")


def _wrong_entry(entry: zipfile.ZipInfo) -> str:
    """Say why an entry cannot be unpacked, or nothing."""
    if stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device, expected a file"
    if entry.flag_bits & ENCRYPTED:
        return "is encrypted"
    if entry.compress_type not in METHODS:
        known = " or ".join(METHODS.values())
        return f"is compressed by method {entry.compress_type}, expected {known}"
    return ""


def _place(name: str) -> tuple[str, ...]:
    """Return a place for names that are one file under Windows (case, ends) or macOS (accents)."""
    parts = unicodedata.normalize("NFC", name).casefold().split("/")
    return tuple(part.rstrip(" .") for part in parts if part not in ("", "."))


def _shown(name: str) -> str:
    return show(name, 120)


# ---- FMUs ----------------------------------------------------------------------------------------
class Fmu(AbstractContextManager["Fmu"]):
    """FMU unpacked in the folder `within`, a temporary one by default; removed at the end.

    Of a file with equations it is built, for a `version` of FMI, with `gradients`. Raises
    UserError if the file is no FMU of the `kind`, co-simulation or model exchange, of a known
    version of FMI, that runs on this platform. Messages name it `shown`, if in an archive.
    """

    def __init__(
        self,
        path: Path,
        within: Path | None = None,
        shown: Path | None = None,
        kind: str = CO_SIMULATION,
        version: str = VERSIONS[0],
        gradients: Sequence[str] = (),
    ) -> None:
        self.path, self.kind = Path(shown or path), kind  # the path for messages
        with building.archive(path, version, gradients) as archive:
            self._unpack(archive, within)

    def _unpack(self, archive: Path, within: Path | None) -> None:
        found, platform = _for_this_platform(archive, self.path, self.kind)
        description, self.model = found.description, found.model
        self.guid = description.guid  # in FMI 3.0, the instantiationToken
        self.log_categories = [category.name for category in description.logCategories]
        self.identifier = _interface(description, self.kind).modelIdentifier  # of the shared object
        with ExitStack() as unpacked:
            self.folder = unpacked.enter_context(temporary_folder(within))
            library = f"{self.identifier}{LIBRARY_SUFFIX}"
            self.library = self.folder / "binaries" / platform / library
            with placed(self.path):
                unpack(archive, self.folder, "FMU", without=SOURCES)
            try:
                check_library(self.library)
            except (OSError, UnreadableError) as error:
                raise UserError(f"{self.path}: {library}: {reason(error)}") from error
            self._unpacked = unpacked.pop_all()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._unpacked.close()

    def notes(self, kind: str) -> list[str]:
        """Return what an FMU of equations says for linear models: "flat" or "modulated"."""
        tree = read_xml(self.folder / DESCRIPTION)
        found = tree.xpath(f"/*/*/*[@name='rparm' or @type='rparm']/linearize/{kind}/@text")
        return [str(text) for text in found]

    def instance(self, name: str, smooth_inputs: Sequence[str] = ()) -> Instance:
        """Return a new `Instance`, of the class for the FMU's kind and version."""
        return INSTANCES[self.model.fmi_version, self.kind](self, name, smooth_inputs)


def read_model(path: Path) -> Model:
    """Read the model that an FMU declares; UserError if it cannot be run here."""
    with building.archive(path) as archive:
        return _for_this_platform(archive, Path(path))[0].model


@dataclass(frozen=True)
class Described:
    """Description of an FMU for co-simulation, without its binary."""

    description: ModelDescription
    model: Model
    sizes: dict[str, int]  # of the files inside in bytes, by name


def describe(path: Path, kind: str = CO_SIMULATION) -> Described:
    """Read what an FMU of a known version and this kind declares; UnreadableError if it is none."""
    with temporary_folder() as folder:
        sizes = unpack(path, folder, "FMU", DESCRIPTION)
        if DESCRIPTION not in sizes:
            raise UnreadableError(f"not an FMU, it has no {DESCRIPTION}")
        try:
            description = _read(folder, kind)
            return Described(description, described(description), sizes)
        except _WrongKindError:
            raise
        except (UnreadableError, ValidationError, ValueError) as error:
            raise UnreadableError(f"wrong {DESCRIPTION}: {one_line(error)}") from error
        # fmpy raises bare exceptions, and others for input that it does not expect
        except Exception as error:
            kind = "" if type(error) is Exception else f"fmpy fails with {type(error).__name__}: "
            raise UnreadableError(f"wrong {DESCRIPTION}: {kind}{one_line(error)}") from error


class _WrongKindError(UnreadableError):
    """An FMU of another version of FMI, or of another kind."""

    def __init__(self, root: etree._Element, kind: str) -> None:
        found = f"FMI {root.get('fmiVersion')}"
        found += " for model exchange" if root.find("ModelExchange") is not None else ""
        expected = f"an FMU of FMI {' or '.join(VERSIONS)} for {kind}"
        super().__init__(f"expected {expected}, found {found}")


def _interface(description: ModelDescription, kind: str) -> Any:
    return description.coSimulation if kind == CO_SIMULATION else description.modelExchange


def _read(folder: Path, kind: str) -> ModelDescription:
    """Read the model description in a folder, by fmpy once it is known to be one."""
    root = read_xml(folder / DESCRIPTION).getroot()
    if root.tag != "fmiModelDescription" or "fmiVersion" not in root.attrib:
        expected = "expected fmiModelDescription with an fmiVersion"
        raise UnreadableError(f"line {root.sourceline}: {expected}, found {show(root.tag)}")
    if root.get("fmiVersion") not in VERSIONS:
        raise _WrongKindError(root, kind)
    description = fmpy.read_model_description(folder)
    if _interface(description, kind) is None:
        raise _WrongKindError(root, kind)
    if description.fmiVersion == "3.0":  # fmpy does not read it
        for interface in (description.coSimulation, description.modelExchange):
            if interface is not None:
                node = "CoSimulation" if interface is description.coSimulation else "ModelExchange"
                given = root.find(node).get("providesDirectionalDerivatives")
                interface.providesDirectionalDerivative = given in ("true", "1")
    return description


def _for_this_platform(path: Path, shown: Path, kind: str = CO_SIMULATION) -> tuple[Described, str]:
    """Return the description of an FMU that can be run here, and the folder of its binary."""
    with placed(shown):
        found = describe(path, kind)
    identifier = _interface(found.description, kind).modelIdentifier
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
        expected = "expected a C identifier as modelIdentifier"
        raise UserError(f"{shown}: {expected}, found {show(identifier)}")
    platforms = sorted({name.split("/")[1] for name in found.sizes if BINARY.fullmatch(name)})
    wanted = INSTANCES[found.model.fmi_version, kind].PLATFORMS
    here = [platform for platform in wanted if platform in platforms]
    if not here:
        way_out = "; `fmpy compile` makes one" if any(map(SOURCE.fullmatch, found.sizes)) else ""
        has = f"(has: {', '.join(platforms) or 'none'})"
        raise UserError(f"{shown}: has no binary for {' or '.join(wanted)} {has}{way_out}")
    return found, here[0]
