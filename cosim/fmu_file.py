"""FMUs as files: checked, read and unpacked once, for any number of runs."""

import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from zipfile import BadZipFile, ZipFile

import fmpy
from fmpy.model_description import ModelDescription

from cosim.archives import check_archive, check_library
from cosim.errors import UserError, one_line, reason
from cosim.fmi2_instance import Fmi2Instance
from cosim.fmi3_instance import Fmi3Instance
from cosim.fmi_instance import Instance
from cosim.input_files import UnreadableError
from cosim.interruption import temporary_folder
from cosim.model import VERSIONS, Model, described, is_known

LIBRARY_SUFFIX = fmpy.sharedLibraryExtension  # of this platform
INSTANCES: dict[str, type[Instance]] = {"2.0": Fmi2Instance, "3.0": Fmi3Instance}
BINARY, SOURCE = re.compile(r"binaries/[^/]+/[^/]+"), re.compile(r"sources/.+\.c")


class Fmu:
    """An FMU that is unpacked; a context manager that removes the unpacked copy.

    Raises UserError if the file is no FMU for co-simulation, of a known version of FMI, that runs
    on this platform. The copy is made in the folder `within`, or where temporary files are.
    """

    def __init__(self, path: Path, within: Path | None = None) -> None:
        self.path = Path(path)
        description, self.model, platform = _read(self.path)
        self.guid = description.guid  # in FMI 3.0, the instantiationToken
        self.log_categories = [category.name for category in description.logCategories]
        self.identifier = description.coSimulation.modelIdentifier  # name of the shared object
        self._unpacked = ExitStack()
        self.folder = self._unpacked.enter_context(temporary_folder(within))
        try:
            fmpy.extract(self.path, self.folder)
        except OSError as error:
            self.close()
            raise UserError(f"{self.path}: cannot be unpacked: {reason(error)}") from error
        except Exception as error:  # fmpy raises bare exceptions, zlib its own
            self.close()
            raise UserError(f"{self.path}: cannot be unpacked: {one_line(error)}") from error
        self.library = self.folder / "binaries" / platform / f"{self.identifier}{LIBRARY_SUFFIX}"
        try:
            check_library(self.library)
        except (OSError, UnreadableError) as error:
            self.close()
            text = error if isinstance(error, UnreadableError) else reason(error)
            raise UserError(f"{self.path}: {self.library.name}: {text}") from error

    def __enter__(self) -> "Fmu":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the unpacked copy."""
        self._unpacked.close()

    def instance(self, name: str, smooth_inputs: Sequence[str] = ()) -> Instance:
        """A new instance, of the class for the FMU's version of FMI; `name` is in its messages.

        What `smooth_inputs` are: `Instance`.
        """
        return INSTANCES[self.model.fmi_version](self, name, smooth_inputs)


def read_model(path: Path) -> Model:
    """What the FMU at `path` declares; UserError if it cannot be run here."""
    return _read(Path(path))[1]


def _read(path: Path) -> tuple[ModelDescription, Model, str]:
    """Model description of an FMU that can be run here, and the folder of its binary."""
    if path.is_dir():
        raise UserError(f"{path}: is a folder, expected an FMU")
    try:
        check_archive(path)
        description = fmpy.read_model_description(path)
        with ZipFile(path) as archive:
            names = archive.namelist()
    except UnreadableError as error:
        raise UserError(f"{path}: {error}") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {reason(error)}") from error
    except BadZipFile:
        raise UserError(f"{path}: not an FMU, which is a zip archive") from None
    except KeyError:
        raise UserError(f"{path}: not an FMU, it has no modelDescription.xml") from None
    except Exception as error:  # fmpy, lxml and zlib raise what they like for damaged content
        raise UserError(f"{path}: wrong modelDescription.xml: {one_line(error)}") from error
    if not is_known(description):
        found = f"FMI {description.fmiVersion}"
        found += " for model exchange" if description.modelExchange else ""
        known = " or ".join(VERSIONS)
        raise UserError(f"{path}: expected an FMU of FMI {known} for co-simulation, found {found}")
    identifier = description.coSimulation.modelIdentifier
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
        raise UserError(f"{path}: expected a C identifier as modelIdentifier, found {identifier!r}")
    platforms = sorted({name.split("/")[1] for name in names if BINARY.fullmatch(name)})
    wanted = INSTANCES[description.fmiVersion].PLATFORMS
    here = [platform for platform in wanted if platform in platforms]
    if not here:
        way_out = "; `fmpy compile` makes one" if any(map(SOURCE.fullmatch, names)) else ""
        raise UserError(
            f"{path}: has no binary for {' or '.join(wanted)} "
            f"(has: {', '.join(platforms) or 'none'}){way_out}"
        )
    try:
        return description, described(description), here[0]
    except ValueError as error:
        raise UserError(f"{path}: wrong modelDescription.xml: {one_line(error)}") from error
