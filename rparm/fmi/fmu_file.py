"""FMUs as files: checked, read and unpacked once, for any number of runs."""

import re
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ModelDescription, ValidationError
from lxml import etree

from rparm.archives import check_library, read_xml, unpack
from rparm.errors import UserError, one_line, placed, reason
from rparm.files import UnreadableError, show
from rparm.fmi.fmi2_instance import Fmi2Instance
from rparm.fmi.fmi3_instance import Fmi3Instance
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.model import Model, described
from rparm.fmi.model_exchange import Fmi2ModelExchange, Fmi3ModelExchange
from rparm.interruption import temporary_folder
from rparm.project import VERSIONS

DESCRIPTION = "modelDescription.xml"
LIBRARY_SUFFIX = fmpy.sharedLibraryExtension  # of this platform
CO_SIMULATION, MODEL_EXCHANGE = "co-simulation", "model exchange"
INSTANCES: dict[tuple[str, str], type[Instance]] = {
    ("2.0", CO_SIMULATION): Fmi2Instance,
    ("3.0", CO_SIMULATION): Fmi3Instance,
    ("2.0", MODEL_EXCHANGE): Fmi2ModelExchange,
    ("3.0", MODEL_EXCHANGE): Fmi3ModelExchange,
}
BINARY, SOURCE = re.compile(r"binaries/[^/]+/[^/]+"), re.compile(r"sources/.+\.c")


class Fmu(AbstractContextManager["Fmu"]):
    """An FMU that is unpacked; a context manager that removes the unpacked copy.

    Raises UserError if the file is no FMU of the `kind`, co-simulation or model exchange, of a
    known version of FMI, that runs on this platform. The copy is made in the folder `within`, or
    where temporary files are. Messages name the FMU by `shown`, where it lies in another archive.
    """

    def __init__(
        self,
        path: Path,
        within: Path | None = None,
        shown: Path | None = None,
        kind: str = CO_SIMULATION,
    ) -> None:
        self.path, self.kind = Path(shown or path), kind  # the path for messages
        found, platform = _for_this_platform(Path(path), self.path, kind)
        description, self.model = found.description, found.model
        self.guid = description.guid  # in FMI 3.0, the instantiationToken
        self.log_categories = [category.name for category in description.logCategories]
        self.identifier = _interface(description, kind).modelIdentifier  # of the shared object
        with ExitStack() as unpacked:
            self.folder = unpacked.enter_context(temporary_folder(within))
            library = f"{self.identifier}{LIBRARY_SUFFIX}"
            self.library = self.folder / "binaries" / platform / library
            with placed(self.path):
                unpack(Path(path), self.folder, "FMU")
            try:
                check_library(self.library)
            except (OSError, UnreadableError) as error:
                raise UserError(f"{self.path}: {library}: {reason(error)}") from error
            self._unpacked = unpacked.pop_all()

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._unpacked.close()

    def instance(self, name: str, smooth_inputs: Sequence[str] = ()) -> Instance:
        """A new `Instance`, of the class for the FMU's kind and version."""
        return INSTANCES[self.model.fmi_version, self.kind](self, name, smooth_inputs)


def read_model(path: Path) -> Model:
    """What the FMU at `path` declares; UserError if it cannot be run here."""
    return _for_this_platform(Path(path), Path(path))[0].model


@dataclass(frozen=True)
class Described:
    """What is known of an FMU for co-simulation without its binary."""

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
        except (
            Exception
        ) as error:  # fmpy raises bare exceptions, and others for input it does not expect
            kind = "" if type(error) is Exception else f"fmpy fails with {type(error).__name__}: "
            raise UnreadableError(f"wrong {DESCRIPTION}: {kind}{one_line(error)}") from error


class _WrongKindError(UnreadableError):
    """An FMU of another version of FMI, or of another kind."""

    def __init__(self, root: etree._Element, kind: str) -> None:
        found = f"FMI {root.get('fmiVersion')}"
        found += " for model exchange" if root.find("ModelExchange") is not None else ""
        super().__init__(
            f"expected an FMU of FMI {' or '.join(VERSIONS)} for {kind}, found {found}"
        )


def _interface(description: ModelDescription, kind: str) -> Any:
    return description.coSimulation if kind == CO_SIMULATION else description.modelExchange


def _read(folder: Path, kind: str) -> ModelDescription:
    """Model description in a folder, which fmpy reads once it is known to be one."""
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
        for node, interface in (
            ("CoSimulation", description.coSimulation),
            ("ModelExchange", description.modelExchange),
        ):
            if interface is not None:
                given = root.find(node).get("providesDirectionalDerivatives")
                interface.providesDirectionalDerivative = given in ("true", "1")
    return description


def _for_this_platform(path: Path, shown: Path, kind: str = CO_SIMULATION) -> tuple[Described, str]:
    """What an FMU declares that can be run here, and the folder of its binary."""
    with placed(shown):
        found = describe(path, kind)
    identifier = _interface(found.description, kind).modelIdentifier
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
        raise UserError(
            f"{shown}: expected a C identifier as modelIdentifier, found {show(identifier)}"
        )
    platforms = sorted({name.split("/")[1] for name in found.sizes if BINARY.fullmatch(name)})
    wanted = INSTANCES[found.model.fmi_version, kind].PLATFORMS
    here = [platform for platform in wanted if platform in platforms]
    if not here:
        way_out = "; `fmpy compile` makes one" if any(map(SOURCE.fullmatch, found.sizes)) else ""
        raise UserError(
            f"{shown}: has no binary for {' or '.join(wanted)} "
            f"(has: {', '.join(platforms) or 'none'}){way_out}"
        )
    return found, here[0]
