"""Bases of campaigns: a scenario on its model's FMU, or a variant of a system.

Both are opened here and made into components, values and wires that the loop takes; values with
units in the file become numbers in the units of their variables.
"""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from rparm import building, project
from rparm.campaign.campaign_file import Campaign, checked
from rparm.campaign.job import Archive, Component, HeldInputs, Wiring
from rparm.errors import UserError, WrongValueError, did_you_mean, placed
from rparm.fmi.fmu_file import describe, read_model
from rparm.fmi.model import INPUTS, Model, Value, Variable
from rparm.runs import scenario
from rparm.runs.scenario import Scenario
from rparm.systems.connected_instance import start_value
from rparm.systems.opened import opened as open_system
from rparm.systems.opened import system_file
from rparm.systems.python_component import PythonComponent
from rparm.systems.structure import OpenedSystem
from rparm.systems.structure import times as chosen_times
from rparm.units import quantity


class Base(ABC):
    """A scenario or system, opened: its FMU or SSP, the folder below models/, times (n + 1,) in s.

    `models` and the values `given` for their variables are by what stands before the names of
    variables: nothing in a scenario, ``component.`` in a system.
    """

    KIND: ClassVar[str]  # for messages
    archives: dict[str, Archive]  # FMUs and Python components by their hash
    tolerance: float | None = None
    wiring: Wiring | None = None  # of a system
    questions: tuple[str, ...] = ()  # to ask the user about the scenario or system
    _fed: Collection[str] = ()  # inputs that outputs feed

    def __init__(
        self,
        path: Path,
        folder: str,
        times: np.ndarray,
        models: Mapping[str, Model],
        given: Mapping[str, Mapping[str, Value]],
    ) -> None:
        self.path, self.folder, self.times = path, folder, times
        self.models = list(models.values())
        self._models, self._given = models, given
        self._variables = {
            f"{prefix}{name}": (component, variable)
            for component, (prefix, model) in enumerate(models.items())
            for name, variable in model.variables.items()
        }
        self._reals: dict[str, np.ndarray] = {}
        self._switches: dict[str, np.ndarray] = {}

    @abstractmethod
    def components(
        self, read: Sequence[tuple[int, str]], fixed: Mapping[tuple[int, str], Value]
    ) -> list[Component]:
        """Return the components, which read Real variables `read` and start from values `fixed`."""

    @property
    @abstractmethod
    def hashes(self) -> dict[str, str]:
        """SHA-256 of the files that determine the runs: scenario or SSP, and FMUs."""

    @property
    def held(self) -> tuple[HeldInputs, HeldInputs]:
        """Inputs with zero-order hold that the file gives: Reals and Booleans."""
        count = len(self.times)
        reals = HeldInputs.of(self._reals, count, np.float64)
        return reals, HeldInputs.of(self._switches, count, np.int32)

    def variable(self, name: str) -> tuple[int, Variable]:
        """Return a variable and the number of its component; WrongValueError if there is none."""
        if name not in self._variables:
            guess = did_you_mean(name, self._variables)
            raise WrongValueError(f"the {self.KIND} has no variable {name!r}{guess}")
        return self._variables[name]

    def settable(self, name: str) -> tuple[int, Variable]:
        """Find a variable that a run may start from, or an input to hold; or WrongValueError."""
        component, variable = self.variable(name)
        if variable.follows:
            raise WrongValueError(variable.why_it_follows)
        is_free = variable.is_a(INPUTS) and variable.type == "Real" and name not in self._fed
        if not (variable.can_start or is_free):
            raise WrongValueError(f"{name!r} is not a parameter or the start value of a state")
        return component, variable

    def start_values(self) -> dict[str, Value]:
        """Return start values of all variables, by the names that a campaign uses."""
        return {
            f"{prefix}{name}": value
            for prefix, model in self._models.items()
            for name, value in (model.start_values | self._given.get(prefix, {})).items()
        }

    def real_outputs(self) -> list[str]:
        return [f"{start}{x}" for start, model in self._models.items() for x in model.real_outputs]

    def states(self) -> list[str]:
        """Return the names of the continuous states that are outputs."""
        found = [f"{prefix}{x}" for prefix, model in self._models.items() for x in model.states]
        return [name for name in found if name in self.real_outputs()]


class ScenarioBase(Base):
    """A scenario; names are its model's."""

    KIND = "model"

    def __init__(self, path: Path, given: Scenario, model: Model) -> None:
        values = given.parameters | given.initial
        super().__init__(path, given.model, given.times, {"": model}, {"": values})
        content = path.read_bytes()
        self._hash, self._scenario, self._model = _sha256(content), given, model
        self.archives, self.tolerance = {self._hash: content}, given.tolerance
        self.questions = tuple(f"scenario {given.name}: {text}" for text in given.questions)
        for name, column in given.inputs.items():
            (self._switches if column.dtype == bool else self._reals)[name] = column

    def hold(self, name: str, value: float) -> int:
        """Return the column of a held input, which is `value` throughout from now on."""
        self._reals[name] = np.full(len(self.times), value)
        return list(self._reals).index(name)

    def components(
        self, read: Sequence[tuple[int, str]], fixed: Mapping[tuple[int, str], Value]
    ) -> list[Component]:
        values = self._given[""] | {name: value for (_, name), value in fixed.items()}
        return [Component(self._scenario.name, self._hash, values)]

    @property
    def hashes(self) -> dict[str, str]:
        file = self._scenario.path
        own = {file.name: _sha256(file.read_bytes()), self._model.name: self._hash}
        return own | self._scenario.logs

    def derivatives(self) -> list[tuple[int, int]]:
        """Return the value references of each state's derivative and of the state."""
        if not self._model.gives_directional_derivatives:
            raise WrongValueError("the FMU gives no directional derivatives")
        found = [x.variable for x in describe(self.path).description.derivatives]
        return [(v.valueReference, v.derivative.valueReference) for v in found]

    def discrete_outputs(self, kind: str) -> list[int]:
        """Return the value references of the discrete outputs of a type, "Real" or "Integer"."""
        return [
            v.reference
            for v in self._model.variables.values()
            if (v.causality, v.variability, v.type) == ("output", "discrete", kind)
        ]


class SystemBase(Base):
    """A variant of a system; names are ``component.variable``."""

    KIND = "system"

    def __init__(self, folder: str, opened: OpenedSystem, variant: str, times: np.ndarray) -> None:
        self._ssp, self._system = opened, opened.system
        self._names = [component.name for component in self._system.components]
        self._parameters = self._system.parameter_sets[variant]
        models = {f"{name}.": opened.models[name] for name in self._names}
        given = {f"{name}.": values for name, values in self._parameters.items()}
        super().__init__(opened.path, folder, times, models, given)
        self.questions = tuple(f"{opened.path.name}: {text}" for text in opened.notes)
        self._hashes, self.archives = {}, {}
        for name in self._names:
            content = self._archive(name)
            is_python = isinstance(content, PythonComponent)
            read = repr(content.__reduce__()).encode() if is_python else content
            self._hashes[name] = _sha256(read)
            self.archives[self._hashes[name]] = content
        system = self._system
        self.wiring = Wiring(system.connections, system.order, dict(system.rates))
        moved = system.inputs
        self._fed = {*(c.end for c in self._system.connections), *moved}
        for name, signal in moved.items():
            kind = opened.variable(name).type
            held = self._reals if kind == "Real" else self._switches
            held[name] = signal.values(times - self._system.start)

    def _archive(self, name: str) -> Archive:
        if name not in self._ssp.python:
            return self._ssp.fmu(name).read_bytes()
        with self._ssp.unpacked_fmu(name) as component:
            return cast(PythonComponent, component)

    def components(
        self, read: Sequence[tuple[int, str]], fixed: Mapping[tuple[int, str], Value]
    ) -> list[Component]:
        result = []
        for i, name in enumerate(self._names):
            with self._ssp.unpacked_fmu(name) as fmu:
                given = self._parameters.get(name, {}).items()
                values = {x: start_value(fmu, name, x, value) for x, value in given}
            values |= {variable: value for (j, variable), value in fixed.items() if j == i}
            result.append(Component(name, self._hashes[name], values))
        return result

    @property
    def hashes(self) -> dict[str, str]:
        files = {self.path.name: _sha256(self.path.read_bytes())}
        if not self._ssp.is_ssp:  # it may read others
            read = self._parameters, *(x.tolist() for x in self._reals.values())
            files[f"values of {self.path.name}"] = _sha256(repr(read).encode())
        return files | self._hashes


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@contextmanager
def opened(
    campaign: Campaign, given: Path | None, where: Path = Path("campaign")
) -> Iterator[Base]:
    """Open the scenario or system of a campaign, on its own FMU or SSP, or on the `given` one."""
    times = campaign.time.model_dump(exclude_none=True)
    if campaign.scenario is not None:
        with _said_of(where):
            file = project.scenario_file(campaign.scenario, where.parent)
            subject = scenario.subject_of(file)
        with building.archive(given or project.fmu_of(subject, "--fmu")) as path:
            model = read_model(path)
            with _said_of(where):
                loaded = scenario.load(file, model, times)
            yield ScenarioBase(path, loaded, model)
        return
    assert campaign.system is not None
    with _said_of(where):
        path = given or system_file(campaign.system, option="--fmu")
    with open_system(given or where.parent / path) as system:
        with _said_of(where):
            variant = system.variant(campaign.variant)
            given_times = _system_times(system, times)
        yield SystemBase(campaign.system, system, variant, given_times)


@contextmanager
def _said_of(where: object) -> Iterator[None]:
    try:
        yield
    except UserError as error:
        raise UserError(f"{where}: {error}") from None


def _system_times(opened: OpenedSystem, given: Mapping[str, float]) -> np.ndarray:
    """Return the communication points (n + 1,) of a system in s, each computed from its number."""
    system = replace(opened.system, **given)
    with placed("[time]"):
        chosen_times(system.start, system.stop, system.step, opened.models)  # checks them
    return system.times


# ---- Values with units ---------------------------------------------------------------------------
def in_si(campaign: Campaign, base: Base, where: object) -> Campaign:
    """Replace values with units by numbers; UserError, at `where`, if a value is wrong."""
    converter = _Converter(base, where)
    content = campaign.model_dump(exclude_unset=True)
    for name, distribution in content["parameters"].items():
        for kind, given in distribution.items():
            if isinstance(given, list):
                place = f"[parameters.{name}] {kind}"
                is_deviation = kind == "normal"
                distribution[kind] = [
                    converter.number(number, name, place, is_deviation and i == 1)
                    for i, number in enumerate(given)
                ]
    for name, given in content.get("set", {}).items():
        if converter.is_real(name):
            content["set"][name] = converter.number(given, name, f"[set] {name}")
    for kind, key, is_difference in (
        ("settling", "target", False),
        ("settling", "band", True),
        ("crossings", "level", False),
    ):
        for name, table in content["keep"].get(kind, {}).items():
            place = f"[keep.{kind}.{name}] {key}"
            table[key] = converter.number(table[key], table["variable"], place, is_difference)
    return checked(content, where)


def questions(campaign: Campaign, base: Base) -> Iterator[str]:
    """Ask about start values that are angles without a unit beyond one turn."""
    given = {name: (f"[set] {name}", [value]) for name, value in campaign.set.items()}
    for name, distribution in campaign.parameters.items():
        values = distribution.numbers[: 1 if distribution.kind == "normal" else None]
        given[name] = (f"[parameters.{name}]", values)
    for name, (place, values) in given.items():
        try:
            variable = base.variable(name)[1]
        except WrongValueError:  # of an expression, or refused later
            continue
        asked = next(filter(None, map(variable.question, values)), "")
        if asked:
            yield f"{place}: {asked}"


class _Converter:
    def __init__(self, base: Base, where: object) -> None:
        self._base, self._where = base, where

    def is_real(self, name: str) -> bool:
        """Return whether it is a variable of type Real; others take texts that are no numbers."""
        try:
            return self._base.variable(name)[1].type == "Real"
        except WrongValueError:  # refused later
            return False

    def number(self, given: Any, name: str, place: str, is_difference: bool = False) -> Any:
        """Convert a given value: a text with a unit becomes a number."""
        if not isinstance(given, str):
            return given
        with placed(f"{self._where}: {place}: without a variable no unit"):
            known = self._base.variable(name)[1].units
        with placed(f"{self._where}: {place}"):
            return quantity(given, known, is_difference)
