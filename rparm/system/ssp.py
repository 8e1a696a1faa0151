"""SSP archives: unpacked, read and checked, once."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from rparm.errors import placed
from rparm.fmi.fmu_file import Fmu, unpack
from rparm.fmi.model import INPUTS, Model, Variable
from rparm.interruption import temporary_folder
from rparm.system import ssp_checks
from rparm.system.ssp_reader import SspReader
from rparm.system.structure import System


@dataclass(frozen=True)
class Ssp:
    """An SSP that is unpacked and can be run."""

    path: Path
    folder: Path  # where it is unpacked
    system: System
    models: Mapping[str, Model]  # what the FMU of each component declares

    def fmu(self, component: str) -> Path:
        return self.folder / self.system.component(component).source

    def unpacked_fmu(self, component: str) -> Fmu:
        """FMU of a component, unpacked; messages name the SSP."""
        return Fmu(self.fmu(component), shown=self.path / self.system.component(component).source)

    @contextmanager
    def unpacked_fmus(self, names: Iterable[str] | None = None) -> Iterator[dict[str, Fmu]]:
        """FMUs of all components, or of those named, in this order."""
        with ExitStack() as stack:
            wanted = self.models if names is None else names
            yield {name: stack.enter_context(self.unpacked_fmu(name)) for name in wanted}

    @property
    def notes(self) -> list[str]:
        """What holds in all runs and is not in the SSP."""
        fed = {f"{c.end_component}.{c.end_connector}" for c in self.system.connections}
        alone = [
            f"{component}.{variable.name}"
            for component, model in self.models.items()
            for variable in model.variables.values()
            if variable.is_a(INPUTS) and f"{component}.{variable.name}" not in fed
        ]
        held = [f"not connected, constant: {', '.join(alone)}"] if alone else []
        return [*self.system.notes, *held]

    def variable(self, name: str) -> Variable:
        """What the FMU declares of ``component.variable``."""
        component, _, variable = name.partition(".")
        return self.models[component].variables[variable]


@contextmanager
def unpacked(path: Path) -> Iterator[Ssp]:
    """Unpack and read an SSP until the end; UserError if it is damaged, or `ssp_checks` refuses."""
    path = Path(path)
    with temporary_folder() as folder:
        with placed(path):
            unpack(path, folder, "SSP")
        system = SspReader(path, folder).system()
        yield Ssp(path, folder, system, ssp_checks.checked_models(path, folder, system))
