"""SSP archives: unpacked, read and checked, once."""

import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from cosim.archives import check_archive
from cosim.errors import UserError, reason
from cosim.input_files import UnreadableError
from cosim.interruption import temporary_folder
from cosim.model import Model, Variable
from cosim.system import ssp_checks
from cosim.system.ssp_reader import SspReader
from cosim.system.structure import System


@dataclass(frozen=True)
class Ssp:
    """An SSP that is unpacked and can be run."""

    path: Path
    folder: Path  # where it is unpacked
    system: System
    models: Mapping[str, Model]  # what the FMU of each component declares

    def fmu(self, component: str) -> Path:
        """FMU of a component, as a file."""
        return self.folder / self.system.component(component).source

    def variable(self, name: str) -> Variable:
        """What the FMU declares of ``component.variable``."""
        component, _, variable = name.partition(".")
        return self.models[component].variables[variable]


@contextmanager
def unpacked(path: Path) -> Iterator[Ssp]:
    """Unpack an SSP to a temporary folder, which is removed at the end, and read it.

    Raises
    ------
    UserError
        If it is damaged, or no system that can be run (what that is: `cosim.system.ssp_checks`).
    """
    path = Path(path)
    with temporary_folder() as folder:
        _extract(path, folder)
        system = SspReader(path, folder).system()
        yield Ssp(path, folder, system, ssp_checks.checked_models(path, folder, system))


def _extract(path: Path, folder: Path) -> None:
    try:
        check_archive(path)
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    except UnreadableError as error:
        raise UserError(f"{path}: {error}") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be unpacked: {reason(error)}") from error
    except Exception as error:  # zipfile and its decoders raise many more
        raise UserError(f"{path}: not an SSP, or a damaged one: {error}") from error
