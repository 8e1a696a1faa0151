"""Instances of a job's components, which are reset between runs."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass

import numpy as np

from rparm.campaign.job import Job, Target
from rparm.errors import UserError
from rparm.fmi.fmi_instance import Instance
from rparm.fmi.fmu_file import Fmu
from rparm.fmi.loop import Tangent, one_component
from rparm.systems.master import Master, in_order
from rparm.systems.structure import WAYS, split


class Instances(AbstractContextManager["Instances"], ABC):
    """Instances of all components, of FMUs by their hash; a context manager that frees them."""

    def __init__(self, job: Job, fmus: Mapping[str, Fmu]) -> None:
        self._job = job
        self._fmus = {component.name: fmus[component.archive] for component in job.components}
        self._held = job.reals.values.copy()
        self._stack = ExitStack()

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)

    @abstractmethod
    def reset(self) -> None:
        """Reset all instances after a run; UserError if that fails."""

    @abstractmethod
    def run(self, point: np.ndarray, record: np.ndarray, growth: np.ndarray) -> list[int]:
        """Make a run with the values (targets,) into `record` and `growth`; Integers at its end.

        UserError if it fails: the instances are not to be used again.
        """

    def _targets(self, point: np.ndarray) -> Iterator[tuple[Target, float | int]]:
        """Hold the inputs that are targets, and yield the other ones with their values."""
        for (_, target), value in zip(self._job.targets, point.tolist(), strict=True):
            if not np.isfinite(value):
                raise UserError(f"{target.variable}: its value is not defined")
            if target.held is not None:
                self._held[:, target.held] = value
                continue
            model = self._fmus[self._job.components[target.component].name].model
            is_whole = model.variables[target.variable].type == "Integer"
            yield target, int(value) if is_whole else value

    def _integers(self, instances: list[Instance]) -> list[int]:
        found = (instances[c].integer(name) for c, name in self._job.integers.values())
        return [value for value in found if value is not None]


class Alone(Instances):
    """An instance of the model of a scenario."""

    def __init__(self, job: Job, fmus: Mapping[str, Fmu]) -> None:
        super().__init__(job, fmus)
        (component,) = job.components
        instance = self._fmus[component.name].instance(component.name)
        self._instance = self._stack.enter_context(instance)
        switches = job.switches.names
        self.loop = one_component(self._instance, job.reals.names, switches, job.watched)
        self._tangent = None
        if job.tangent is not None:
            self._tangent = Tangent(*job.tangent)
            self.loop.carry(self._tangent)

    def reset(self) -> None:
        self._instance.reset()

    def run(self, point: np.ndarray, record: np.ndarray, growth: np.ndarray) -> list[int]:
        self._initialize(point)
        times, loop = self._job.times, self.loop
        record[0] = loop.values[: loop.width]
        given = self._held[:-1], self._job.switches.values[:-1], record
        loop.run(times[1:], *given, growth=growth if self._tangent is not None else None)
        return self._integers([self._instance])

    def _initialize(self, point: np.ndarray) -> None:
        """Go to the first communication point, outputs read."""
        job, instance, loop = self._job, self._instance, self.loop
        instance.set_up(job.start, job.stop, job.tolerance)
        for name, value in job.components[0].values.items():
            instance.set(name, value)
        for target, value in self._targets(point):
            instance.set(target.variable, value)
        instance.enter_initialization()
        loop.start(job.start)
        loop.leave_initialization(self._held[0], self._job.switches.values[0])
        if self._tangent is not None:
            self._tangent.start()


@dataclass(frozen=True)
class _Held:
    """Values with zero-order hold, a signal of the master."""

    points: np.ndarray  # (n + 1,) s since the start
    rows: np.ndarray  # (n + 1,)

    def values(self, elapsed: np.ndarray) -> np.ndarray:
        return self.rows[np.searchsorted(self.points, elapsed)]


class Connected(Instances):
    """A system in its master."""

    def __init__(self, job: Job, fmus: Mapping[str, Fmu]) -> None:
        super().__init__(job, fmus)
        assert job.wiring is not None
        order, inputs = WAYS[job.wiring.order]
        connections, elapsed = job.wiring.connections, job.times - job.start
        models = {name: fmu.model for name, fmu in self._fmus.items()}
        signals = {
            name: _Held(elapsed, column)
            for held, rows in ((job.reals, self._held), (job.switches, job.switches.values))
            for name, column in zip(held.names, rows.T, strict=True)
        }
        master = Master(
            in_order(self._fmus, connections, order), connections, order, inputs,
            also=[split(name, models) for name in job.watched],
            signals=signals, rates=job.wiring.rates,
        )  # fmt: skip
        self._master = self._stack.enter_context(master)
        self._columns = [master.names.index(name) for name in job.watched]

    def reset(self) -> None:
        self._master.reset()

    def run(self, point: np.ndarray, record: np.ndarray, growth: np.ndarray) -> list[int]:
        job, master = self._job, self._master
        values = {component.name: dict(component.values) for component in job.components}
        for target, value in self._targets(point):
            values[job.components[target.component].name][target.variable] = value
        master.initialize(job.start, job.stop, values)
        master.watch(job.times, self._columns, rows=record)
        return self._integers([master.components[c.name].instance for c in job.components])


def instances(job: Job, fmus: Mapping[str, Fmu]) -> Instances:
    """Load the FMUs of a job and make their instances; UserError if that fails."""
    return (Alone if job.wiring is None else Connected)(job, fmus)
