"""What a campaign varies: a scenario on its model's FMU, or a variant of a system.

Both are opened here and made into components, values and wires that the loop takes.
"""

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from rparm import project
from rparm.campaign.campaign_file import Campaign
from rparm.campaign.job import Component, HeldInputs
from rparm.coupling.connected_instance import start_value
from rparm.errors import UserError, WrongValueError, did_you_mean, hint
from rparm.fmi.compiled.loop import Part
from rparm.fmi.fmu_file import describe, read_model
from rparm.fmi.model import INITIAL, INPUTS, PARAMETERS, Model, Value, Variable
from rparm.scenarios import scenario
from rparm.scenarios.scenario import MAX_STEPS, Scenario
from rparm.system import ssp
from rparm.system.ssp import Ssp


class Base(ABC):
    """A scenario or system, opened."""

    path: Path  # FMU or SSP
    folder: str  # of the model or system, below models/
    archives: dict[str, bytes]  # FMUs by their hash
    times: np.ndarray  # (n + 1,) communication points in s
    tolerance: float | None
    questions: tuple[str, ...] = ()  # to ask the user about the scenario

    @property
    @abstractmethod
    def models(self) -> list[Model]:
        """What the FMU of each component declares."""

    @abstractmethod
    def variable(self, name: str) -> tuple[int, Variable]:
        """A variable and the number of its component; WrongValueError if there is none."""

    @abstractmethod
    def start_values(self) -> dict[str, Value]:
        """Start values of all variables, by the names that a campaign uses."""

    @abstractmethod
    def components(
        self, read: Sequence[tuple[int, str]], fixed: Mapping[tuple[int, str], Value]
    ) -> list[Component]:
        """The components, which read Real variables `read` and start from values `fixed`."""

    @abstractmethod
    def real_outputs(self) -> list[str]:
        """Names of all Real outputs."""

    @abstractmethod
    def states(self) -> list[str]:
        """Names of the continuous states that are outputs."""

    @property
    @abstractmethod
    def held(self) -> tuple[HeldInputs, HeldInputs]:
        """Inputs with zero-order hold that the file gives: Reals and Booleans."""

    @property
    @abstractmethod
    def hashes(self) -> dict[str, str]:
        """SHA-256 of the files that runs follow from: scenario or SSP, and FMUs."""

    def settable(self, name: str) -> tuple[int, Variable]:
        """A variable that a run may start from; WrongValueError if there is none of that name."""
        component, variable = self.variable(name)
        local_state = variable.causality == "local" and variable.initial == "exact"
        if not (variable.is_a(PARAMETERS) or variable.is_a(INITIAL) or local_state):
            raise WrongValueError(f"{name!r} is not a parameter or the start value of a state")
        return component, variable


class ScenarioBase(Base):
    """A scenario; names are those of its model."""

    def __init__(self, path: Path, given: Scenario, model: Model) -> None:
        content = path.read_bytes()
        digest = _sha256(content)
        self.path, self.folder, self.archives = path, given.model, {digest: content}
        self._hash, self._scenario, self._model = digest, given, model
        self.times, self.tolerance = given.times, given.tolerance
        self.questions = tuple(f"scenario {given.name}: {text}" for text in given.questions)
        kinds = {name: values.dtype == bool for name, values in given.inputs.items()}
        self._reals = {n: v for n, v in given.inputs.items() if not kinds[n]}
        self._switches = {n: v for n, v in given.inputs.items() if kinds[n]}

    @property
    def models(self) -> list[Model]:
        return [self._model]

    def variable(self, name: str) -> tuple[int, Variable]:
        if name not in self._model.variables:
            guess = did_you_mean(name, self._model.variables)
            raise WrongValueError(f"the model has no variable {name!r}{guess}")
        return 0, self._model.variables[name]

    def settable(self, name: str) -> tuple[int, Variable]:
        """Also an input, which then is constant."""
        component, variable = self.variable(name)
        if variable.is_a(INPUTS) and variable.type == "Real":
            return component, variable
        return super().settable(name)

    def start_values(self) -> dict[str, Value]:
        return self._scenario.start_values

    def real_outputs(self) -> list[str]:
        return self._model.real_outputs

    def states(self) -> list[str]:
        return [name for name in self._model.states if name in self.real_outputs()]

    def hold(self, name: str, value: float) -> int:
        """Column of a held input, which is `value` throughout from now on."""
        self._reals[name] = np.full(len(self.times), value)
        return list(self._reals).index(name)

    def components(
        self, read: Sequence[tuple[int, str]], fixed: Mapping[tuple[int, str], Value]
    ) -> list[Component]:
        variables = self._model.variables

        def references(names: Sequence[str]) -> tuple[int, ...]:
            return tuple(variables[name].reference for name in names)

        given = self._scenario.parameters | self._scenario.initial
        return [
            Component(
                name=self._scenario.name,
                archive=self._hash,
                values=given | {name: value for (_, name), value in fixed.items()},
                reals=Part(
                    references(list(self._reals)),
                    tuple(range(len(self._reals))),
                    references([name for _, name in read]),
                ),
                switches=Part(
                    references(list(self._switches)), tuple(range(len(self._switches))), ()
                ),
            )
        ]

    @property
    def held(self) -> tuple[HeldInputs, HeldInputs]:
        count = len(self.times)
        reals = HeldInputs.of(self._reals, count, np.float64)
        return reals, HeldInputs.of(self._switches, count, np.int32)

    @property
    def hashes(self) -> dict[str, str]:
        file = self._scenario.path
        own = {file.name: _sha256(file.read_bytes()), self._model.name: self._hash}
        return own | self._scenario.logs

    def derivatives(self) -> list[tuple[int, int]]:
        """Value references of each state's derivative and of the state."""
        if not self._model.gives_directional_derivatives:
            raise WrongValueError("the FMU gives no directional derivatives")
        found = [x.variable for x in describe(self.path).description.derivatives]
        return [(v.valueReference, v.derivative.valueReference) for v in found]

    def discrete_outputs(self, kind: str) -> list[int]:
        """Value references of the outputs of a type that change at events only."""
        return [
            v.reference
            for v in self._model.variables.values()
            if (v.causality, v.variability, v.type) == ("output", "discrete", kind)
        ]


class SystemBase(Base):
    """A variant of a system; names are ``component.variable``."""

    def __init__(self, folder: str, opened: Ssp, variant: str, times: np.ndarray) -> None:
        self.path, self.folder, self.times, self.tolerance = opened.path, folder, times, None
        self._ssp, self._system = opened, opened.system
        self._names = [component.name for component in self._system.components]
        self._parameters = self._system.parameter_sets[variant]
        self.archives, self._hashes = {}, {}
        for name in self._names:
            content = opened.fmu(name).read_bytes()
            self._hashes[name] = _sha256(content)
            self.archives[self._hashes[name]] = content

    @property
    def models(self) -> list[Model]:
        return [self._ssp.models[name] for name in self._names]

    def variable(self, name: str) -> tuple[int, Variable]:
        component, _, variable = name.partition(".")
        known = self._ssp.models[component].variables if component in self._names else {}
        if variable not in known:
            everything = [f"{c}.{v}" for c in self._names for v in self._ssp.models[c].variables]
            guess = did_you_mean(name, everything)
            raise WrongValueError(f"the system has no variable {name!r}{guess}")
        return self._names.index(component), known[variable]

    def start_values(self) -> dict[str, Value]:
        found = {}
        for name in self._names:
            values = self._ssp.models[name].start_values | self._parameters.get(name, {})
            found |= {f"{name}.{variable}": value for variable, value in values.items()}
        return found

    def components(
        self, read: Sequence[tuple[int, str]], fixed: Mapping[tuple[int, str], Value]
    ) -> list[Component]:
        connections = self._system.connections
        fed = {
            kind: [
                c for c in connections if self._type(c.start_component, c.start_connector) == kind
            ]
            for kind in ("Real", "Boolean")
        }
        for c in connections:
            if self._type(c.start_component, c.start_connector) not in fed:
                raise UserError(f"{self.path}: {c}: is neither Real nor Boolean")
        outputs = {"Real": list(read), "Boolean": []}
        for kind, known in outputs.items():
            sources = [(self._names.index(c.start_component), c.start_connector) for c in fed[kind]]
            known[:] = sorted(dict.fromkeys([*known, *sources]), key=lambda key: key[0])
        result = []
        for i, name in enumerate(self._names):
            parts = {}
            for kind, known in outputs.items():
                incoming = [c for c in fed[kind] if c.end_component == name]
                parts[kind] = Part(
                    tuple(self._reference(i, c.end_connector) for c in incoming),
                    tuple(
                        known.index((self._names.index(c.start_component), c.start_connector))
                        for c in incoming
                    ),
                    tuple(self._reference(i, variable) for j, variable in known if j == i),
                )
            values = self._started(name)
            values |= {variable: value for (j, variable), value in fixed.items() if j == i}
            result.append(
                Component(name, self._hashes[name], values, parts["Real"], parts["Boolean"])
            )
        return result

    def real_outputs(self) -> list[str]:
        return [f"{c}.{name}" for c in self._names for name in self._ssp.models[c].real_outputs]

    def states(self) -> list[str]:
        found = [f"{c}.{name}" for c in self._names for name in self._ssp.models[c].states]
        return [name for name in found if name in self.real_outputs()]

    def _started(self, component: str) -> dict[str, Value]:
        with self._ssp.unpacked_fmu(component) as fmu:
            return {
                name: start_value(fmu, component, name, value)
                for name, value in self._parameters.get(component, {}).items()
            }

    def _type(self, component: str, variable: str) -> str:
        return self._ssp.models[component].variables[variable].type

    def _reference(self, component: int, variable: str) -> int:
        return self._ssp.models[self._names[component]].variables[variable].reference

    @property
    def held(self) -> tuple[HeldInputs, HeldInputs]:
        count = len(self.times)
        return HeldInputs.of({}, count, np.float64), HeldInputs.of({}, count, np.int32)

    @property
    def hashes(self) -> dict[str, str]:
        return {self.path.name: _sha256(self.path.read_bytes())} | self._hashes


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


@contextmanager
def opened(
    campaign: Campaign, given: Path | None, where: Path = Path("campaign")
) -> Iterator[Base]:
    """The scenario or system of a campaign, with the FMU or SSP `given`, or that of its model.

    UserError if it cannot be opened; beginning with `where`, the campaign's file, if that is wrong.
    """
    times = campaign.time.model_dump(exclude_none=True)
    if campaign.scenario is not None:
        with _said_of(where):
            own = Path(campaign.scenario).suffix.lower() == ".toml"
            beside = where.parent / campaign.scenario
            file = beside if own else project.scenario_file(campaign.scenario)
            subject = scenario.subject_of(file)
        path = given or project.fmu_of(subject, "--fmu")
        model = read_model(path)
        with _said_of(where):
            loaded = scenario.load(file, model, times)
        yield ScenarioBase(path, loaded, model)
        return
    folders = project.systems()
    if campaign.system not in folders:
        known = hint(campaign.system, folders)
        raise UserError(f"{where}: system: no system {campaign.system!r}{known}")
    path = given or project.built(folders[campaign.system], ".ssp", "--fmu")
    with ssp.unpacked(path) as system:
        variants = system.system.parameter_sets
        if campaign.variant not in variants:
            known = hint(campaign.variant, variants)
            raise UserError(f"{where}: variant: no variant {campaign.variant!r}{known}")
        with _said_of(where):
            given_times = _system_times(system, times)
        yield SystemBase(campaign.system, system, campaign.variant, given_times)


@contextmanager
def _said_of(where: object) -> Iterator[None]:
    try:
        yield
    except UserError as error:
        raise UserError(f"{where}: {error}") from None


def _system_times(opened: Ssp, given: Mapping[str, float]) -> np.ndarray:
    """Communication points (n + 1,) of a system in s, each computed from its number."""
    system = opened.system
    start = given.get("start", system.start)
    stop, step = given.get("stop", system.stop), given.get("step", system.step)
    if not start < stop or step > stop - start or (stop - start) / step > MAX_STEPS:
        raise UserError(
            f"[time]: start {start!r} s, stop {stop!r} s and step {step!r} s make no run of "
            f"1 to {MAX_STEPS} steps"
        )
    return start + np.arange(round((stop - start) / step) + 1) * step
