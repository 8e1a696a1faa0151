"""Runs a variant of a system in this process, where Ecos is not there to do it."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from rparm.coupling.connected_instance import ConnectedInstance
from rparm.coupling.master import Master
from rparm.system.ecos import Run, said_at_end
from rparm.system.ssp import Ssp


def run(ssp: Ssp, variant: str, names: Sequence[str]) -> Run:
    """Run a system in Jacobi order with one of its parameter sets; read what Ecos would read.

    That is the values of the Real, Integer or Boolean variables ``component.variable`` at a
    communication point after the inputs of the next step have been set. UserError if a component
    fails, or gives a value that is not finite.
    """
    system = ssp.system
    times = system.times
    rows = np.empty((len(times), len(names)))
    with ssp.unpacked_fmus() as fmus, Master(fmus, system.connections) as master:
        master.initialize(times[0], times[-1], system.parameter_sets[variant])
        readers = [_Reader(ssp, c, names) for c in master.components.values()]
        begin = time.perf_counter()
        for row, end in enumerate(times.tolist()):
            if row:
                master.advance(end)
            for reader in readers:
                with reader.component.instance.explained(f"at t = {end!r} s"):
                    reader.component.set_inputs(master.values[reader.component.sources])
                    reader.read(rows[row])
        wall_time = time.perf_counter() - begin
        messages = [
            f"{component.name!r}: {text}"
            for component in master.components.values()
            for text in component.instance.messages
        ]
        said = {name: _value(master, ssp, name) for name in said_at_end(ssp)}
    return Run(tuple(names), times, rows, wall_time, tuple(dict.fromkeys(messages)), said)


def _value(master: Master, ssp: Ssp, name: str) -> float:
    component, _, variable = name.partition(".")
    row = np.empty(1)
    _Reader(ssp, master.components[component], [name]).read(row)
    return float(row[0])


class _Reader:
    """Reads the wanted variables of one component into a row of the system's."""

    def __init__(self, ssp: Ssp, component: ConnectedInstance, names: Sequence[str]) -> None:
        self.component = component
        instance = component.instance
        own: dict[str, int] = {}
        for column, name in enumerate(names):
            owner, _, variable = name.partition(".")
            if owner == component.name:
                own[variable] = column
        variables = ssp.models[component.name].variables
        real = [name for name in own if variables[name].type == "Real"]
        self._reals = instance.reals(real)
        self._real_columns = [own[name] for name in real]
        self._others: list[tuple[int, Callable[[str], int | None], str]] = []
        for name in own.keys() - set(real):
            boolean = variables[name].type == "Boolean"
            self._others.append(
                (own[name], instance.boolean if boolean else instance.integer, name)
            )

    def read(self, row: np.ndarray) -> None:
        self._reals.get()
        row[self._real_columns] = self._reals.view
        for column, read, name in self._others:
            row[column] = read(name)
